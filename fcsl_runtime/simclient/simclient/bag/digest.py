# SPDX-License-Identifier: Apache-2.0
"""One hash of a machine's run: equal digests mean the same outputs, states and health in every tick, bit for bit.

The digest is the SHA-256 over, for every path in sorted order: the path, a zero byte, the number of its samples (u64),
and the SHA-256 over its samples, each as tick (u64) and bits, little-endian and in the order recorded. Paths are
`<instance>.outputs.<field>` (transition_request and health included), `machine.state` and `machine.next_state` (a
state's bits are its name's length, u32, and UTF-8 bytes). NaNs count as equal. Namespaces, message times and the order
of topics are not part of it. So recordings of one run by different hosts compare equal.
"""

from __future__ import annotations

import hashlib
import struct
from pathlib import Path

import numpy as np

from ..errors import BagError
from ..ros.cdr import bits
from .bag import Array, Bag
from .states import StateReader, StateRun

_COUNT = struct.Struct("<Q")
_SIZE = struct.Struct("<I")
#: Message fields that are not values of the machine.
_FRAME = ("header.stamp.sec", "header.stamp.nanosec", "tick")


class _Sums:
    """A running hash and sample count per path."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[hashlib._Hash, list[int]]] = {}

    def add(self, path: str, ticks: Array, values: Array) -> None:
        """N samples: their `ticks`, u64 of shape (N,), and the bytes of their `values`, u8 of shape (N, size)."""
        samples = np.empty((len(ticks), 8 + values.shape[1]), np.uint8)
        samples[:, :8] = ticks.view(np.uint8).reshape(-1, 8)
        samples[:, 8:] = values
        running, count = self._sums.setdefault(path, (hashlib.sha256(), [0]))
        running.update(samples.data)
        count[0] += len(samples)

    def total(self) -> str:
        whole = hashlib.sha256()
        for path in sorted(self._sums):
            running, count = self._sums[path]
            whole.update(path.encode() + b"\0" + _COUNT.pack(count[0]) + running.digest())
        return whole.hexdigest()


def _add_outputs(instance: str, rows: Array, sums: _Sums) -> None:
    ticks = np.ascontiguousarray(rows["tick"])
    for field in rows.dtype.names or ():
        if field not in _FRAME:
            sums.add(f"{instance}.outputs.{field}", ticks, bits(rows[field]).view(np.uint8).reshape(len(rows), -1))


def _add_states(run: StateRun, sums: _Sums) -> None:
    for name, state in (("state", run.state), ("next_state", run.next_state)):
        text = state.encode()
        value = np.frombuffer(_SIZE.pack(len(text)) + text, np.uint8)
        sums.add(f"machine.{name}", run.ticks, np.broadcast_to(value, (len(run.ticks), len(value))))


def digest(bag: str | Path | Bag, machine: str = "") -> str:
    """Hex SHA-256 of the run of `machine` (default: the only one) in `bag`. Raises BagError."""
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    recorded = opened.machine(machine)
    instance_of = {topic: instance for instance, topic in recorded.outputs.items()}
    layouts = {topic: opened.fixed_layout(topic) for topic in instance_of}
    states = StateReader(opened, recorded.state)
    sums = _Sums()
    for topic, batch in opened.topic_batches({*instance_of, recorded.state}):
        if topic == recorded.state:
            for run in states.runs(batch):
                _add_states(run, sums)
        elif "tick" in layouts[topic].leaves:
            _add_outputs(instance_of[topic], opened.rows(topic, batch), sums)
        else:
            raise BagError(f"{opened.path}: topic `{topic}` is not the output of a machine")
    return sums.total()
