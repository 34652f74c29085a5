# SPDX-License-Identifier: Apache-2.0
"""Writes a part of a bag as a new bag: `fcsl bag cut`.

Messages are selected by one clock: header stamps, or log times. By header stamps, a message that has none belongs to the
cut if it was recorded between the first and the last that are selected. All messages of a machine's first tick belong to
the cut, too: on a robot's clock, a write before a tick has the stamp of the tick before it. A record of FCSL is more than
its messages: a replay starts from a checkpoint and repeats the host's writes from there. So a cut that starts after the
first checkpoint needs a new one, which is made by replaying the bag up to there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..bag import Bag, RecordedMachine
from ..bag.seconds import seconds
from ..bag.stamps import Clock, Stamps
from ..bag.writer import can_be_copied, copy_of
from ..cli import Progress
from ..complete_output import check_target
from ..errors import BagError
from ..run import Run
from .seek import seek

_NS = 1_000_000_000
#: Later than every time, in ns.
_NEVER = 1 << 63


@dataclass
class Cut:
    """The result, with its times by `clock`. `machines` maps each machine's prefix to the reason why the cut does not
    reproduce it, or to "".
    """

    messages: int
    first_ns: int
    last_ns: int
    clock: Clock
    machines: dict[str, str]
    left_out: list[str]

    def __str__(self) -> str:
        span = f"{seconds(self.first_ns)} s to {seconds(self.last_ns)} s"
        lines = [f"{self.messages} messages, {span}, by {self.clock}"]
        lines += [f"  cut where the others were recorded: {text}" for text in self.clock.timeless]
        lines += [f"  {prefix}: {f'shows but does not reproduce: {why}' if why else 'replays'}"
                  for prefix, why in self.machines.items()]  # fmt: skip
        lines += [f"  left out: {name}: not ROS 2 messages with a definition" for name in self.left_out]
        return "\n".join(lines)


def checkpoint_before(bag: Bag, machine: RecordedMachine, tick: int, time_ns: int, run: Run) -> bytes:
    """CDR of the Checkpoint message of `machine` before `tick`, whose stamp is `time_ns`, made by a replay on `run`.

    `run` is a new run of the recorded machine. Raises BagError if the sources differ, or if the record up to `tick` is
    incomplete or does not replay identically.
    """
    data = next((data for _, _, data in bag.messages({machine.checkpoint})), None)
    if data is None:
        raise BagError(f"{bag.path}: the initial checkpoint is missing")
    wanted = ("header", "tick", "source_hash", "layout_hash", "build_hash", "data")
    first = bag.decode_own(machine.checkpoint, data, wanted)
    _check_same(bag, machine, first, run)
    progress = Progress(f"replaying up to tick {tick}", tick - first.tick)
    seek(bag, machine, run, tick, progress.at)
    stamp = replace(first.header.stamp, sec=time_ns // _NS, nanosec=time_ns % _NS)
    message = replace(
        first,
        header=replace(first.header, stamp=stamp),
        tick=tick,
        build_hash=run.machine.build_hash,
        data=np.frombuffer(run.save(), np.uint8),
    )
    return bytes(bag.store(machine.checkpoint).serialize_cdr(message, bag.topic(machine.checkpoint).type))


def _check_same(bag: Bag, machine: RecordedMachine, checkpoint: Any, run: Run) -> None:
    """Raises BagError unless `run` has the sources and layout of the machine that took `checkpoint`."""
    for what, recorded, now in (
        ("from other sources of", checkpoint.source_hash, run.machine.source_hash),
        (
            "with another memory layout (by another version of fcslc) of",
            checkpoint.layout_hash,
            run.machine.layout_hash,
        ),
    ):
        if recorded != now:
            raise BagError(f"{bag.path}: recorded {what} `{machine.name}`\n  recorded  {recorded}\n  now       {now}")


def cut(
    bag: Bag,
    target: str | Path,
    begin_ns: int,
    end_ns: int,
    replayed: tuple[RecordedMachine, Run] | None = None,
    time: str = "",
) -> Cut:
    """Writes the messages of `bag` from `begin_ns` to `end_ns` (both included) to `target`, complete or not at all.

    `replayed`: a machine and a new run of it, which make the checkpoint of the cut. `time` chooses the clock
    (stamps.Clock). Raises BagError.
    """
    check_target(target, is_new=True)
    firsts = {machine.prefix: _first_tick(bag, machine, begin_ns, end_ns) for machine in bag.machines()}
    machines = {machine.prefix: _why_not(bag, machine, firsts[machine.prefix]) for machine in bag.machines()}
    opening: list[tuple[str, int, bytes]] = []
    if replayed is not None and machines[replayed[0].prefix]:
        machine, run = replayed
        first = firsts[machine.prefix]
        if first is None:
            span = f"{seconds(begin_ns)} s to {seconds(end_ns)} s"
            raise BagError(f"{bag.path}: no tick of `{machine.name}` lies from {span}")
        tick, time_ns = first
        opening.append((machine.checkpoint, time_ns, checkpoint_before(bag, machine, tick, time_ns, run)))
        machines[machine.prefix] = ""
    opening += _views(bag, begin_ns)
    topics = [name for name, topic in bag.topics.items() if can_be_copied(topic)]
    clock, left_out = Clock(bag, topics, time), [name for name in bag.topics if name not in topics]
    found = Cut(0, end_ns, begin_ns, clock, machines, left_out)
    stamps, progress = Stamps(bag), Progress("cutting", sum(bag.topics[name].count for name in topics))
    log_first_ns, log_last_ns = _recorded_within(bag, topics, begin_ns, end_ns, time)
    earliest_ns, latest_ns = _NEVER, -_NEVER
    first_ticks = {
        topic: first[0]
        for prefix, first in firsts.items()
        for topic in topics
        if first is not None and topic.startswith(f"{prefix}/")
    }
    with copy_of(bag, target, topics) as copy:
        for message in opening:
            copy.write(*message)
        for done, (topic, log_ns, data) in enumerate(bag.messages(set(topics))):
            progress.at(done)
            at_ns = clock.time_ns(topic, log_ns, data)
            if at_ns is None:
                if log_first_ns <= log_ns <= log_last_ns:
                    copy.write(topic, log_ns, data)
                continue
            earliest_ns, latest_ns = min(earliest_ns, at_ns), max(latest_ns, at_ns)
            in_first_tick = topic in first_ticks and stamps.tick(topic, data) == first_ticks[topic]
            if (at_ns >= begin_ns or in_first_tick) and at_ns <= end_ns:
                found.first_ns, found.last_ns = min(found.first_ns, at_ns), max(found.last_ns, at_ns)
                copy.write(topic, log_ns, data)
        found.messages = copy.messages
        if copy.messages == len(opening):
            there = f"; its {clock} go from {seconds(earliest_ns)} s to {seconds(latest_ns)} s"
            raise BagError(
                f"{bag.path}: no message from {seconds(begin_ns)} s to {seconds(end_ns)} s"
                f"{there if earliest_ns <= latest_ns else ''}; --time chooses the clock"
            )
    return found


def _recorded_within(bag: Bag, topics: Sequence[str], begin_ns: int, end_ns: int, time: str) -> tuple[int, int]:
    """The log times between which the messages from `begin_ns` to `end_ns` of the clock were recorded."""
    clock, first_ns, last_ns = Clock(bag, topics, time), end_ns, begin_ns
    if clock.by_header:
        first_ns, last_ns = _NEVER, -_NEVER
        for topic, log_ns, data in bag.messages(set(topics)):
            time_ns = clock.time_ns(topic, log_ns, data)
            if time_ns is not None and begin_ns <= time_ns <= end_ns:
                first_ns, last_ns = min(first_ns, log_ns), max(last_ns, log_ns)
    return first_ns, last_ns


def _views(bag: Bag, begin_ns: int) -> list[tuple[str, int, bytes]]:
    """What plots and viewers show of the machines, where it was recorded before the cut begins; its time is then that of
    the beginning."""
    topics = {machine.views for machine in bag.machines() if bag.topics.get(machine.views)}
    if not any(bag.topics[name].count for name in topics):
        return []
    before = ((topic, log_ns, data) for topic, log_ns, data in bag.messages(topics) if log_ns < begin_ns)
    return [(topic, begin_ns, data) for topic, _, data in before]


def _why_not(bag: Bag, machine: RecordedMachine, first: tuple[int, int] | None) -> str:
    """The reason why the cut, whose first tick and its time are `first`, does not reproduce `machine`; else empty."""
    stamps = Stamps(bag)
    for topic, _, data in bag.messages({machine.checkpoint}):
        if first is not None and stamps.tick(topic, data) == first[0]:
            return ""
    return "the checkpoint that a replay starts from lies before the cut; --config or --library puts one in"


def _first_tick(bag: Bag, machine: RecordedMachine, begin_ns: int, end_ns: int) -> tuple[int, int] | None:
    """Number and time of the first tick in the cut, or None."""
    stamps = Stamps(bag)
    for topic, log_ns, data in bag.messages({machine.state}):
        time_ns, tick = stamps.time_ns(topic, log_ns, data), stamps.tick(topic, data)
        if begin_ns <= time_ns <= end_ns and tick is not None:
            return tick, time_ns
    return None
