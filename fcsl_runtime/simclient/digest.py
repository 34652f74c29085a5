# SPDX-License-Identifier: Apache-2.0
"""One number for what a machine did: equal digests mean the same outputs, states and health in every tick, bit for bit.

The digest is the SHA-256 over, for every path in sorted order: the path, a zero byte, the number of its samples (u64),
and the SHA-256 over its samples, each as tick (u64) and bits, little-endian and in the order recorded. Paths are
`<instance>.outputs.<field>` (transition_request and health included), `machine.state` and `machine.next_state` (a
state's bits are its name's length, u32, and UTF-8 bytes). NaNs count as equal. Namespaces, message times and the order
of topics do not enter, so that recordings of one run by different hosts compare equal.
"""

from __future__ import annotations

import argparse
import hashlib
import struct
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from .bag import Bag, RecordedMachine, StateReader, stacks
from .cdr import bits
from .cli import completeness, run_tool
from .errors import BagError

_SAMPLE_HEAD = struct.Struct("<Q")
#: Message fields that are not values of the machine.
_FRAME = ("header.stamp.sec", "header.stamp.nanosec", "tick")


class _Sums:
    """A running hash and sample count per path."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[hashlib._Hash, list[int]]] = {}

    def add(self, path: str, data: bytes, samples: int) -> None:
        if path not in self._sums:
            self._sums[path] = (hashlib.sha256(), [0])
        running, count = self._sums[path]
        running.update(data)
        count[0] += samples

    def total(self) -> str:
        whole = hashlib.sha256()
        for path in sorted(self._sums):
            running, count = self._sums[path]
            whole.update(path.encode() + b"\0" + _SAMPLE_HEAD.pack(count[0]) + running.digest())
        return whole.hexdigest()


def _add_outputs(bag: Bag, machine: RecordedMachine, sums: _Sums) -> None:
    instance_of = {topic: instance for instance, topic in machine.outputs.items()}
    for topic, rows in stacks(bag, list(instance_of)):
        if "tick" not in (rows.dtype.names or ()):
            raise BagError(f"{bag.path}: topic `{topic}` is not the output of a machine")
        ticks = np.ascontiguousarray(rows["tick"]).view(np.uint8).reshape(len(rows), 8)
        for field in rows.dtype.names or ():
            if field not in _FRAME:
                values = bits(rows[field]).view(np.uint8).reshape(len(rows), -1)
                sums.add(f"{instance_of[topic]}.outputs.{field}", np.hstack((ticks, values)).tobytes(), len(rows))


def _add_states(bag: Bag, machine: RecordedMachine, sums: _Sums) -> None:
    reader = StateReader(bag, machine.state)
    for _, _, data in bag.messages({machine.state}):
        sample = reader.read(data)
        for name, state in (("state", sample.state), ("next_state", sample.next_state)):
            text = state.encode()
            sums.add(f"machine.{name}", struct.pack("<QI", sample.tick, len(text)) + text, 1)


def digest(bag: str | Path | Bag, machine: str = "") -> str:
    """Hex SHA-256 of what `machine` (the only one, by default) did in `bag`. Raises BagError."""
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    recorded = opened.machine(machine)
    sums = _Sums()
    _add_outputs(opened, recorded, sums)
    _add_states(opened, recorded, sums)
    return sums.total()


def main(arguments: Sequence[str]) -> int:
    parser = argparse.ArgumentParser(prog="simclient.digest", description="Prints the digest of a recorded run.")
    parser.add_argument("bag", help="directory or .mcap file")
    parser.add_argument("--machine", default="", help="which machine, when the bag holds several")
    options = parser.parse_args(arguments)
    bag = Bag(options.bag)
    print(digest(bag, options.machine))
    return completeness("simclient.digest", bag.truncated)


if __name__ == "__main__":
    run_tool("simclient.digest", main)
