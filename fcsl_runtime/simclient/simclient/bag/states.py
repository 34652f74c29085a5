# SPDX-License-Identifier: Apache-2.0
"""The states that a recorded machine was in, with times and ticks."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..errors import BagError, did_you_mean
from ..ros.cdr import gathered
from .bag import Array, Bag, RecordedMachine
from .batch import Batch
from .rows import has_stamps

#: Seconds and nanoseconds of the header stamp.
_STAMP = struct.Struct("<4xiI")


class StateSample(NamedTuple):
    """One MachineState message; time_ns is its stamp."""

    tick: int
    time_ns: int
    state: str
    next_state: str


class StateRun(NamedTuple):
    """Consecutive MachineState messages with the same states; `ticks` (u64), `times_ns` (i64) of shape (N,), N > 0."""

    ticks: Array
    times_ns: Array
    state: str
    next_state: str


class StateReader:
    """Reads the MachineState messages of one machine. States repeat, so each pair of states is decoded once."""

    def __init__(self, bag: Bag, topic: str):
        layout = bag.layout(topic)
        if layout is None or "tick" not in layout.leaves or not has_stamps(layout):
            raise BagError(f"{bag.path}: topic `{topic}` has no states of a machine")
        self._bag = bag
        self._topic = topic
        self._tick_at = layout.leaves["tick"].offset
        self._known: dict[bytes, tuple[str, str]] = {}

    def read(self, data: bytes) -> StateSample:
        """Raises BagError."""
        behind = data[self._tick_at + 8 :]
        names = self._known.get(behind)
        if names is None:
            message = self._bag.decode_own(self._topic, data, ("state", "next_state"))
            names = self._known[behind] = message.state, message.next_state
        seconds, nanoseconds = _STAMP.unpack_from(data)
        tick = int.from_bytes(data[self._tick_at : self._tick_at + 8], "little")
        return StateSample(tick, seconds * 1_000_000_000 + nanoseconds, *names)

    def runs(self, batch: Batch) -> Iterator[StateRun]:
        """The messages of a batch, all of the machine's states, in order. Raises BagError."""
        sizes = batch.entries["end"] - batch.entries["begin"]
        for first, end in stretches(sizes[1:] != sizes[:-1]):
            yield from self._runs(Batch(batch.data, batch.entries[first:end]), int(sizes[first]))

    def _runs(self, batch: Batch, size: int) -> Iterator[StateRun]:
        """The runs in messages of one size in bytes."""
        data, begins = batch.data, batch.entries["begin"]
        behind = self._tick_at + 8
        if size <= behind:
            raise BagError(f"{self._bag.path}: a message of `{self._topic}` ({size} bytes) does not match its schema")
        ticks = gathered(data, begins + self._tick_at, 8).view("<u8")
        stamps = gathered(data, begins, _STAMP.size).view([("head", "V4"), ("sec", "<i4"), ("nanosec", "<u4")])
        times_ns = stamps["sec"] * np.int64(1_000_000_000) + stamps["nanosec"]
        names = gathered(data, begins + behind, size - behind)
        for first, end in stretches(names[1:] != names[:-1]):
            sample = self.read(data[begins[first] : begins[first] + size])
            yield StateRun(ticks[first:end], times_ns[first:end], sample.state, sample.next_state)


def stretches(differs: Array) -> Iterator[tuple[int, int]]:
    """(first, end) of each stretch of equal items among N; `differs` (N - 1,) marks items that differ from the next."""
    ends = [*(np.flatnonzero(differs) + 1).tolist(), len(differs) + 1]
    return zip([0, *ends], ends, strict=False)


class Visit(NamedTuple):
    """Consecutive ticks in one state: first and last tick, and their stamps in ns."""

    state: str
    first_tick: int
    last_tick: int
    start_ns: int
    end_ns: int


def visits(bag: Bag, machine: RecordedMachine) -> list[Visit]:
    """Every visit to a state, in bag order. Raises BagError if the bag has no tick of the machine."""
    found: list[Visit] = []
    if machine.state in bag.topics:
        reader = StateReader(bag, machine.state)
        for run in (run for _, batch in bag.topic_batches({machine.state}) for run in reader.runs(batch)):
            last_tick, end_ns = int(run.ticks[-1]), int(run.times_ns[-1])
            if found and found[-1].state == run.state:
                found[-1] = found[-1]._replace(last_tick=last_tick, end_ns=end_ns)
            else:
                found.append(Visit(run.state, int(run.ticks[0]), last_tick, int(run.times_ns[0]), end_ns))
    if not found:
        cause = f" ({bag.truncated})" if bag.truncated else ""
        raise BagError(f"{bag.path}: no tick of machine `{machine.name}` is in the bag{cause}")
    return found


def nth_visit(bag: Bag, machine: RecordedMachine, state: str, number: int) -> Visit:
    """Visit `number` (from 1) to `state`. Raises BagError, which gives the number of visits or the states visited."""
    there = visits(bag, machine)
    matching = [visit for visit in there if visit.state == state]
    if not matching:
        names = list(dict.fromkeys(visit.state for visit in there))
        raise BagError(
            f"{bag.path}: `{machine.name}` was never in state `{state}`{did_you_mean(state, names)}; "
            f"it was in {', '.join(names)}"
        )
    if not 1 <= number <= len(matching):
        times = "once" if len(matching) == 1 else f"{len(matching)} times"
        raise BagError(f"{bag.path}: `{machine.name}` was in `{state}` {times}; there is no visit {number}")
    return matching[number - 1]
