#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""What Foxglove shows of a recording: its own packages read our bags, and every named value is what rosbags reads.

Two bags: a machine with every scalar type, arrays and matrices, of which every field is recorded, written with values chosen at
random by bits (NaN, infinities, -0, subnormal and 64-bit numbers among them); and the lander's flight as `fcsl-sim` records it.
The packages (package.json, exact versions) come from npm, Node.js from PyPI. The controls: a value changed by one bit,
two fields that have changed names, and a message left out are noticed.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import random
import shutil
import struct
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader

from simclient import AlgTwin, Field

from ..shared.cases import OUT, ROOT, CheckFailed, run, write_facts

FOLDER = Path(__file__).resolve().parent
PROBE = ROOT / "fcsl_runtime/simclient/test" / "machines" / "probe.json"
_TICKS = 500

#: A message: its topic, its log time in ns, its fields by name.
Message = tuple[str, int, Any]


def installed(folder: Path) -> Path:
    """The reader with its packages, in `folder`: npm runs only where the list of them has changed."""
    folder.mkdir(parents=True, exist_ok=True)
    shutil.copy(FOLDER / "read.js", folder)
    wanted, done = (FOLDER / "package.json").read_text(), folder / "package.json.installed"
    if not done.is_file() or done.read_text() != wanted:
        (folder / "package.json").write_text(wanted)
        # Node.js has certificates of its own; what this computer trusts is what pip and apt go by, too.
        os.environ["NODE_OPTIONS"] = "--use-system-ca"
        options = ("--no-package-lock", "--ignore-scripts", "--no-audit", "--no-fund", "--fetch-retries=1")
        run(["npm", "install", "--prefix", folder, *options], timeout_s=300.0)
        done.write_text(wanted)
    return folder / "read.js"


def exact(value: Any) -> Any:
    """A value as read.js prints it: what JSON cannot hold as text."""
    if isinstance(value, np.ndarray):
        return [exact(v) for v in value.tolist()]
    if isinstance(value, list):
        return [exact(v) for v in value]
    if hasattr(value, "__msgtype__"):
        # Constants are attributes of the message, too; a field's name has no capital letter.
        return {name: exact(v) for name, v in vars(value).items() if name == name.lower() and name != "__msgtype__"}
    if isinstance(value, float):
        if math.isnan(value) or math.isinf(value):
            return {"nan": "NaN", "inf": "Infinity", "-inf": "-Infinity"}[str(value)]
        return "-0" if value == 0.0 and math.copysign(1.0, value) < 0 else value
    return value


def equal(theirs: Any, ours: Any) -> bool:
    """Whether two values are one; whole numbers of 64 bits are text over there."""
    if isinstance(ours, dict) and isinstance(theirs, dict):
        return list(ours) == list(theirs) and all(equal(theirs[name], ours[name]) for name in ours)
    if isinstance(ours, list) and isinstance(theirs, list):
        return len(ours) == len(theirs) and all(map(equal, theirs, ours))
    if isinstance(theirs, str) and isinstance(ours, int) and not isinstance(ours, bool):
        return theirs == str(ours)
    if isinstance(ours, float) and isinstance(theirs, int | float):
        return struct.pack("<d", ours) == struct.pack("<d", theirs)
    return type(ours) is type(theirs) and bool(ours == theirs)


def by_rosbags(bag: Path) -> Iterator[Message]:
    with AnyReader([bag]) as reader:
        for connection, time_ns, data in reader.messages():
            yield connection.topic, time_ns, exact(reader.deserialize(data, connection.msgtype))


def by_foxglove(reader: Path, bag: Path) -> list[Message]:
    (file,) = bag.glob("*.mcap")
    found = []
    for line in run(["node", reader, file]).splitlines():
        topic, time_ns, content = json.loads(line)
        found.append((topic, int(time_ns), content))
    return found


def compare(theirs: list[Message], ours: list[Message]) -> int:
    """The number of messages, all the same in both. Raises CheckFailed with the first that differs."""
    if len(theirs) != len(ours):
        raise CheckFailed(f"Foxglove's reader finds {len(theirs)} messages, rosbags {len(ours)}")
    # Messages of one time may come in any order; those of one topic keep theirs.
    for (topic, time_ns, content), (their_topic, their_time, their_content) in zip(
        sorted(ours, key=lambda m: (m[0], m[1])), sorted(theirs, key=lambda m: (m[0], m[1])), strict=True
    ):
        if (topic, time_ns) != (their_topic, their_time) or not equal(their_content, content):
            raise CheckFailed(
                f"{topic} at {time_ns} ns differs:\n  Foxglove's reader: {their_topic} at {their_time} ns {their_content}\n"
                f"  rosbags:           {content}"
            )
    return len(ours)


def noticed(what: str, theirs: list[Message], ours: list[Message]) -> None:
    """A control. Raises CheckFailed where the comparison finds nothing."""
    try:
        compare(theirs, ours)
    except CheckFailed:
        return
    raise CheckFailed(f"the comparison does not notice {what}")


def controls(theirs: list[Message], ours: list[Message]) -> None:
    at, (topic, time_ns, content) = next(
        (n, m) for n, m in enumerate(ours) if m[0].endswith("/source") and n > len(ours) // 2
    )

    def instead(**fields: Any) -> list[Message]:
        return [*ours[:at], (topic, time_ns, content | fields), *ours[at + 1 :]]

    real = content["real"] if isinstance(content["real"], float) else 0.0
    noticed("a value changed by one bit", theirs, instead(real=math.nextafter(real, math.inf)))
    noticed("two fields that have changed names", theirs, instead(small=content["word"], word=content["small"]))
    noticed("a message left out", theirs, ours[:at] + ours[at + 1 :])


def random_value(field: Field, chance: random.Random) -> Any:
    """Bits by chance, of the field's type and shape: NaN, infinities, -0 and subnormal numbers come more often than by bits."""
    if field.type == "bool":
        return chance.random() < 0.5
    dtype = np.dtype(f"<{field.type[0]}{int(field.type[1:]) // 8}")
    bits = np.frombuffer(chance.randbytes(field.size), dtype=dtype).copy()
    if dtype.kind == "f":
        for n in range(bits.size):
            if chance.random() < 0.2:
                bits[n] = chance.choice(
                    [math.nan, math.inf, -math.inf, -0.0, 1.0, float(np.finfo(dtype).smallest_subnormal)]
                )
    return bits.reshape(field.shape) if field.shape else bits[0]


def record_probe(bag: Path, seed: int) -> Path:
    """A recording of the machine with every scalar type, whose fields get new values at every tick."""
    chance = random.Random(seed)
    with AlgTwin.from_config(PROBE) as twin:
        fields = [field for field in twin.fields("source.outputs.") if field.type[0].islower()]  # no enums
        twin.record(bag)
        for _ in range(_TICKS):
            twin.set_many({field.path: random_value(field, chance) for field in fields})
            twin.tick()
        twin.stop_recording()
    return bag


def record_lander(bag: Path) -> Path:
    simulation = ROOT / "examples" / "lander" / "sim" / "lander.sim.json"
    run(["fcsl-sim", "run", simulation, "--record", bag])
    return bag


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1, help="of the values (default 1)")
    options = parser.parse_args()
    try:
        reader = installed(OUT / "foxglove")
        read = {}
        with tempfile.TemporaryDirectory() as folder:
            for name, bag in (
                ("every scalar type", record_probe(Path(folder) / "probe", options.seed)),
                ("lander", record_lander(Path(folder) / "lander")),
            ):
                ours, theirs = list(by_rosbags(bag)), by_foxglove(reader, bag)
                read[name] = compare(theirs, ours)
                topics = len({topic for topic, _, _ in ours})
                print(
                    f"{name:18} {read[name]:6} messages of {topics:2} topics: the same by Foxglove's packages and rosbags"
                )
                if name == "every scalar type":
                    controls(theirs, ours)
        print("controls: a changed bit, exchanged names and a message left out are noticed")
        write_facts("foxglove", {"seed": options.seed, "messages": read})
    except CheckFailed as error:
        print(f"foxglove: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
