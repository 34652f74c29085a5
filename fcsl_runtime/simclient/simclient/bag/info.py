# SPDX-License-Identifier: Apache-2.0
"""Describes a bag: the output of `fcsl bag info`, as facts that JSON takes and as text.

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
    def hertz(self) -> float | None:
        """Average rate in Hz; None if it is undefined."""
        long = self.last_ns - self.first_ns
        return (self.timed - 1) * 1e9 / long if long > 0 else None


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


def facts(bag: Bag, machine: str = "", time: str = "") -> dict[str, Any]:
    """What `fcsl bag info --json` prints. `machine` selects one of several machines, `time` the clock (stamps.Clock). Times are in
    ns of that clock. Raises BagError."""
    machines = [bag.machine(machine, True)] if machine else bag.machines(by_bystanders=True)
    clock = Clock(bag, bag.topics, time)
    found = _scan(bag, machines, clock)
    timed = [span for span in found.spans.values() if span.timed]
    return {
        "bag": str(bag.path),
        "files": [file.name for file in bag.files],
        "bytes": sum(file.stat().st_size for file in bag.files),
        "messages": sum(span.count for span in found.spans.values()),
        "clock": str(clock),
        "first_ns": min(span.first_ns for span in timed) if timed else None,
        "last_ns": max(span.last_ns for span in timed) if timed else None,
        "timeless": list(clock.timeless),
        "damage": bag.truncated,
        "topics": [_topic(t.name, t.type or f"({t.encoding})", found.spans[t.name]) for t in bag.topics.values()],
        "machines": [_machine(bag, recorded, found) for recorded in machines],
    }


def _topic(name: str, kind: str, span: TopicSpan) -> dict[str, Any]:
    return {"topic": name, "type": kind, "messages": span.count, "hertz": span.hertz}


def _machine(bag: Bag, machine: RecordedMachine, found: Contents) -> dict[str, Any]:
    data, lacks = found.checkpoints.get(machine.checkpoint), bag.lacks(machine)
    described: dict[str, Any] = {"prefix": machine.prefix, "lacks": lacks, "checkpoint": None}
    if not lacks and data is not None:
        wanted = ("tick", "source_hash", "layout_hash", "build_hash", "data")
        checkpoint = bag.decode_own(machine.checkpoint, data, wanted)
        described["checkpoint"] = {
            "tick": checkpoint.tick,
            "source_hash": checkpoint.source_hash,
            "layout_hash": checkpoint.layout_hash,
            "build_hash": checkpoint.build_hash,
            "bytes": len(checkpoint.data),
        }
    described["writes"] = dict(sorted(found.writes.get(machine.writes, Counter()).items()))
    return described if machine.by_bystander else described | _states(bag, machine)


def _states(bag: Bag, machine: RecordedMachine) -> dict[str, Any]:
    try:
        return {"visits": [visit._asdict() for visit in visits(bag, machine)]}
    except BagError as error:
        return {"no_visits": str(error)}


# ---- as text ---------------------------------------------------------------------------------------------------------


def describe(bag: Bag, machine: str = "", time: str = "") -> str:
    """The same as text. Raises BagError."""
    found = facts(bag, machine, time)
    topics = [
        (t["topic"], t["type"], str(t["messages"]), "" if t["hertz"] is None else f"{t['hertz']:.2f} Hz")
        for t in found["topics"]
    ]
    lines = [*_head(found), "", *_table([("topic", "type", "messages", "rate"), *topics], right=(2, 3))]
    for recorded in found["machines"]:
        lines += ["", *_machine_lines(recorded)]
    return "\n".join(lines)


def _head(found: dict[str, Any]) -> list[str]:
    lines = [
        f"bag        {found['bag']}",
        f"files      {', '.join(found['files'])} ({found['bytes'] / 1e6:.3f} MB)",
        f"messages   {found['messages']}",
    ]
    first, last = found["first_ns"], found["last_ns"]
    if first is not None:
        lines += [
            f"time       {found['clock']}",
            f"duration   {seconds(last - first)} s",
            f"from       {seconds(first)} s",
            f"to         {seconds(last)} s",
        ]
    lines += [f"timeless   {text}" for text in found["timeless"]]
    return [*lines, f"damage     {found['damage'] or 'none'}"]


def _table(rows: Sequence[tuple[str, ...]], right: tuple[int, ...]) -> list[str]:
    """Rows with aligned columns; columns numbered in `right` are right-aligned."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    padded = [
        [cell.rjust(width) if i in right else cell.ljust(width)
         for i, (cell, width) in enumerate(zip(row, widths, strict=True))]
        for row in rows
    ]  # fmt: skip
    return ["  ".join(row).rstrip() for row in padded]


def _machine_lines(machine: dict[str, Any]) -> list[str]:
    checkpoint = machine["checkpoint"]
    lines = [f"machine    {machine['prefix']}"]
    if machine["lacks"]:
        lines.append(f"record     does not reproduce the run: {machine['lacks']}")
    elif checkpoint is None:
        lines.append("record     no checkpoint: shows what the machine did, but cannot be replayed")
    else:
        lines += [
            f"source     {checkpoint['source_hash']}",
            f"layout     {checkpoint['layout_hash']}",
            f"build      {checkpoint['build_hash']}",
            f"record     replays from the checkpoint before tick {checkpoint['tick']} ({checkpoint['bytes']} bytes)",
        ]
    lines.append("writes     " + (", ".join(f"{count} {kind}" for kind, count in machine["writes"].items()) or "none"))
    if "no_visits" in machine:
        lines.append(f"states     {machine['no_visits']}")
    return lines + (_visit_lines(machine["visits"]) if machine.get("visits") else [])


def _visit_lines(there: Sequence[dict[str, Any]]) -> list[str]:
    rows: list[tuple[str, ...]] = [("states", "from", "to", "ticks")]
    rows += [(v["state"], f"{seconds(v['start_ns'])} s", f"{seconds(v['end_ns'])} s",
              f"{v['first_tick']} to {v['last_tick']}") for v in there[:_MAX_VISITS]]  # fmt: skip
    if len(there) > _MAX_VISITS:
        rows.append((f"and {len(there) - _MAX_VISITS} more visits", "", "", ""))
    return [f"ticks      {there[0]['first_tick']} to {there[-1]['last_tick']}", *_table(rows, right=(1, 2))]
