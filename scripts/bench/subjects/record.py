# SPDX-License-Identifier: Apache-2.0
"""Recording: what it costs the thread that steps, and how many messages per second the writer sustains."""

from __future__ import annotations

import json
import os
import shutil
import statistics
import subprocess
import tempfile
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.cache import build_machine
from simclient.bag import Bag
from simclient.library import runtime_library

from ..harness.native import BENCH, compile_program
from ..harness.size import sized
from .chain import build_chain
from .lander import CONFIG

ROUNDS = sized(41, 1)
WRITE_TICKS = sized(150_000, 2000)
WRITE_ROUNDS = sized(5, 1)


def _program(folder: Path) -> Path:
    stepped = BENCH.parent / "verify/instructions"
    includes = [stepped, *(package_prefix(p) / "include" for p in ("fcsl_runtime", "fcsl_hal"))]
    return compile_program(
        ["subjects/record.c", "harness/timing.c", stepped / "stepped.c", runtime_library()], folder / "record", includes
    )


def _run(program: Path, *arguments: str | Path) -> dict[str, Any]:
    environment = {**os.environ, "LD_LIBRARY_PATH": str(runtime_library().parent)}
    line = [str(program), *map(str, arguments)]
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True, env=environment)
    facts: dict[str, Any] = json.loads(done.stdout)
    return facts


def _written(program: Path, library: Path, folder: Path) -> dict[str, Any]:
    """Messages per second from the first tick to the closed bag, of the median round."""
    rates, processor = [], []
    for _ in range(WRITE_ROUNDS):
        facts = _run(program, "write", library, folder, str(WRITE_TICKS))
        bag = Bag(folder / "written")
        messages = sum(topic.count for topic in bag.topics.values())
        size = sum(file.stat().st_size for file in bag.files)
        shutil.rmtree(folder / "written")
        rates.append(messages / facts["wall_s"])
        processor.append(facts["processor_s"] / messages * 1e9)
    return {
        "messages_per_s": statistics.median(rates),
        "messages_per_s_low": min(rates),
        "messages_per_s_high": max(rates),
        "messages_per_tick": messages / WRITE_TICKS,
        "processor_ns_per_message": statistics.median(processor),
        "bytes_per_message": size / messages,
    }


def record_times(folder: Path) -> dict[str, Any]:
    """Per machine: ns and instructions per tick with and without recording, and what the writer sustains."""
    folder.mkdir(parents=True, exist_ok=True)
    program = _program(folder)
    machines = {"chain of 3": build_chain(folder, 3, 0)[0], "lander": build_machine(CONFIG).library}
    facts = {}
    for name, library in machines.items():
        bags = folder / f"bags of {name}"
        bags.mkdir()
        facts[name] = {**_run(program, "step", library, bags, str(ROUNDS)), **_written(program, library, bags)}
    return facts


def record_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, f in facts.items():
        goal = (
            (" (goal 100)", "", " (goal 500 000)") if name == "chain of 3" else (" (goal 80)", " (goal 300 more)", "")
        )
        rows += [
            (
                f"recording, {name}: added to a tick",
                f"{f['added_ns']:.0f} ns ({f['added_ns_low']:.0f} to {f['added_ns_high']:.0f}){goal[0]}",
            ),
            ("    ticks back to back, without and with", f"{f['plain_ns']:.0f} ns, {f['recorded_ns']:.0f} ns"),
            (
                "    ticks at 1 kHz, without and with",
                f"{f['paced_plain_ns']:.0f} ns, {f['paced_recorded_ns']:.0f} ns{goal[1]}",
            ),
            (
                "    instructions of a tick, without and with",
                f"{f['plain_instructions']:.0f}, {f['recorded_instructions']:.0f}",
            ),
            (
                f"    writer, {f['messages_per_tick']:.0f} messages per tick",
                f"{f['messages_per_s']:,.0f} messages/s{goal[2]}".replace(",", " "),
            ),
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        found = record_times(Path(name) / "record")
    print(json.dumps(found, indent=2))
    for what, figure in record_rows(found):
        print(f"{what:<52}{figure:>44}")
