# SPDX-License-Identifier: Apache-2.0
"""Describes a bag as text: the output of `fcsl bag info`.

Every message is read, so the reported damage covers the whole bag and not only its index.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..cli import Progress
from ..errors import BagError
from .bag import Bag, RecordedMachine
from .seconds import seconds
from .stamps import Clock
from .states import visits

#: Most visits to states that are listed.
_MAX_VISITS = 200


@dataclass
class TopicSpan:
    """The number of intact messages of a topic, and of those that have a time the number, the first and the last time
    in ns."""

    count: int = 0
    timed: int = 0
    first_ns: int = 0
    last_ns: int = 0

    def add(self, time_ns: int | None) -> None:
        self.count += 1
        if time_ns is not None:
            self.first_ns = min(self.first_ns, time_ns) if self.timed else time_ns
            self.last_ns = max(self.last_ns, time_ns) if self.timed else time_ns
            self.timed += 1

    @property
    def hertz(self) -> str:
        """Average rate in Hz as text; empty if it is undefined."""
        long = self.last_ns - self.first_ns
        return f"{(self.timed - 1) * 1e9 / long:.2f} Hz" if long > 0 else ""


@dataclass
class Contents:
    """The results of one pass over a bag."""

    spans: dict[str, TopicSpan] = field(default_factory=dict)
    checkpoints: dict[str, bytes] = field(default_factory=dict)
    writes: dict[str, Counter[str]] = field(default_factory=dict)


def _scan(bag: Bag, machines: Sequence[RecordedMachine], clock: Clock) -> Contents:
    checkpoints = {machine.checkpoint for machine in machines}
    writes = {machine.writes: _write_kinds(bag, machine.writes) for machine in machines if machine.writes in bag.topics}
    found = Contents({topic: TopicSpan() for topic in bag.topics}, writes={topic: Counter() for topic in writes})
    progress = Progress("reading", sum(file.stat().st_size for file in bag.files))
    for batch, announced in bag.batches(in_order=False):
        progress.at(bag.read_bytes)
        for number, log_ns, begin, end in batch.entries.tolist():
            topic, data = announced[number].name, batch.data[begin:end]
            found.spans.setdefault(topic, TopicSpan()).add(clock.time_ns(topic, log_ns, data))
            if topic in checkpoints:
                found.checkpoints.setdefault(topic, data)
            elif topic in writes:
                kind = bag.decode_own(topic, data, ("kind",)).kind
                found.writes[topic][writes[topic].get(kind, f"kind {kind}")] += 1
    progress.finish()
    return found


def _write_kinds(bag: Bag, topic: str) -> dict[int, str]:
    """Maps numbers to names of the kinds of writes, from the bag's message definition."""
    constants = bag.store(topic).fielddefs.get(bag.topic(topic).type, ((), ()))[0]
    return {value: name for name, _, value in constants if isinstance(value, int)}


def describe(bag: Bag, machine: str = "", time: str = "") -> str:
    """The text. `machine` selects one of several machines, `time` the clock (stamps.Clock). Raises BagError."""
    machines = [bag.machine(machine, True)] if machine else bag.machines(by_bystanders=True)
    clock = Clock(bag, bag.topics, time)
    found = _scan(bag, machines, clock)
    lines = _head(bag, list(found.spans.values()), clock)
    lines += ["", *_topics(bag, found.spans)]
    for recorded in machines:
        lines += ["", *_machine(bag, recorded, found)]
    return "\n".join(lines)


def _head(bag: Bag, spans: Sequence[TopicSpan], clock: Clock) -> list[str]:
    size = sum(file.stat().st_size for file in bag.files)
    lines = [
        f"bag        {bag.path}",
        f"files      {', '.join(file.name for file in bag.files)} ({size / 1e6:.3f} MB)",
        f"messages   {sum(span.count for span in spans)}",
    ]
    if timed := [span for span in spans if span.timed]:
        first, last = min(span.first_ns for span in timed), max(span.last_ns for span in timed)
        lines += [
            f"time       {clock}",
            f"duration   {seconds(last - first)} s",
            f"from       {seconds(first)} s",
            f"to         {seconds(last)} s",
        ]
    lines += [f"timeless   {text}" for text in clock.timeless]
    return [*lines, f"damage     {bag.truncated or 'none'}"]


def _topics(bag: Bag, spans: dict[str, TopicSpan]) -> list[str]:
    rows = [(t.name, t.type or f"({t.encoding})", str(spans[t.name].count), spans[t.name].hertz)
            for t in bag.topics.values()]  # fmt: skip
    return _table([("topic", "type", "messages", "rate"), *rows], right=(2, 3))


def _table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> list[str]:
    """Rows with aligned columns; columns numbered in `right` are right-aligned."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    padded = [
        [cell.rjust(width) if i in right else cell.ljust(width)
         for i, (cell, width) in enumerate(zip(row, widths, strict=True))]
        for row in rows
    ]  # fmt: skip
    return ["  ".join(row).rstrip() for row in padded]


def _machine(bag: Bag, machine: RecordedMachine, found: Contents) -> list[str]:
    lines = [f"machine    {machine.prefix}"]
    data, lacks = found.checkpoints.get(machine.checkpoint), bag.lacks(machine)
    if lacks:
        lines.append(f"record     does not reproduce the run: {lacks}")
    elif data is None:
        lines.append("record     no checkpoint: shows what the machine did, but cannot be replayed")
    else:
        wanted = ("tick", "source_hash", "layout_hash", "build_hash", "data")
        checkpoint = bag.decode_own(machine.checkpoint, data, wanted)
        lines += [
            f"source     {checkpoint.source_hash}",
            f"layout     {checkpoint.layout_hash}",
            f"build      {checkpoint.build_hash}",
            f"record     replays from the checkpoint before tick {checkpoint.tick} ({len(checkpoint.data)} bytes)",
        ]
    writes = found.writes.get(machine.writes, Counter())
    lines.append("writes     " + (", ".join(f"{count} {kind}" for kind, count in sorted(writes.items())) or "none"))
    return lines if machine.by_bystander else lines + _states(bag, machine)


def _states(bag: Bag, machine: RecordedMachine) -> list[str]:
    try:
        there = visits(bag, machine)
    except BagError as error:
        return [f"states     {error}"]
    lines = [f"ticks      {there[0].first_tick} to {there[-1].last_tick}"]
    rows: list[tuple[Any, ...]] = [("states", "from", "to", "ticks")]
    rows += [(v.state, f"{seconds(v.start_ns)} s", f"{seconds(v.end_ns)} s", f"{v.first_tick} to {v.last_tick}")
             for v in there[:_MAX_VISITS]]  # fmt: skip
    if len(there) > _MAX_VISITS:
        rows.append((f"and {len(there) - _MAX_VISITS} more visits", "", "", ""))
    return lines + _table(rows, right=(1, 2))
