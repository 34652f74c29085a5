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
from typing import Any

import numpy as np

from ..errors import BagError
from . import formats
from .bag import Array, Bag
from .states import StateReader

_COUNT = struct.Struct("<Q")
_SIZE = struct.Struct("<I")
#: Message fields that are not values of the machine.
_FRAME = ("header.stamp.sec", "header.stamp.nanosec", "tick")


def _samples(ticks: Array, kind: np.dtype[Any], shape: tuple[int, ...]) -> Array:
    """Samples as they are hashed, without gaps: their `tick`, and room for a `value`."""
    samples = np.empty(len(ticks), [("tick", "<u8"), ("value", kind, shape)])
    samples["tick"] = ticks
    return samples


class Sums:
    """The digest of samples as they come: a running hash and a count per path."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[hashlib._Hash, list[int]]] = {}

    def add(self, path: str, ticks: Array, values: Array) -> None:
        """N samples: their `ticks`, u64 of shape (N,), and their `values` as in messages, of shape (N,) or (N, count)."""
        samples = _samples(ticks, values.dtype, values.shape[1:])
        column = samples["value"]
        column[:] = values
        if column.dtype.kind == "f" and (nan := np.isnan(column)).any():
            column[nan] = np.nan
        self._add(path, samples)

    def _add(self, path: str, samples: Array) -> None:
        running, count = self._sums.setdefault(path, (hashlib.sha256(), [0]))
        running.update(samples.data)
        count[0] += len(samples)

    def add_states(self, ticks: Array, state: str, next_state: str) -> None:
        """The same states in all of `ticks`, u64 of shape (N,)."""
        for name, text in (("state", state.encode()), ("next_state", next_state.encode())):
            value = np.void(_SIZE.pack(len(text)) + text)
            samples = _samples(ticks, value.dtype, ())
            samples["value"] = value
            self._add(f"machine.{name}", samples)

    def total(self) -> str:
        """The digest, as hex."""
        whole = hashlib.sha256()
        for path in sorted(self._sums):
            running, count = self._sums[path]
            whole.update(path.encode() + b"\0" + _COUNT.pack(count[0]) + running.digest())
        return whole.hexdigest()


def digest(bag: str | Path | Bag, machine: str = "") -> str:
    """Hex SHA-256 of the run of `machine` (default: the only one) in `bag`. Raises BagError."""
    opened = formats.opened(bag)
    recorded = opened.machine(machine)
    instance_of = {topic: instance for instance, topic in recorded.outputs.items()}
    layouts = {topic: opened.fixed_layout(topic) for topic in instance_of}
    states = StateReader(opened, recorded.state)
    sums = Sums()
    for topic, batch in opened.topic_batches({*instance_of, recorded.state}):
        if topic == recorded.state:
            for run in states.runs(batch):
                sums.add_states(run.ticks, run.state, run.next_state)
        elif "tick" in layouts[topic].leaves:
            rows = opened.rows(topic, batch)
            ticks = np.ascontiguousarray(rows["tick"])
            for field in (name for name in layouts[topic].leaves if name not in _FRAME):
                sums.add(f"{instance_of[topic]}.outputs.{field}", ticks, rows[field])
        else:
            raise BagError(f"{opened.path}: topic `{topic}` is not the output of a machine")
    return sums.total()
