# SPDX-License-Identifier: Apache-2.0
"""Runs a machine on a foreign bag: mapped message fields become samples of sensor channels."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..bag import Bag
from ..c_run import CSeries
from ..clock_offsets import named_offset
from ..descriptor import Channel, Machine
from ..errors import BagError, MapError, did_you_mean
from ..paths import split_path
from ..ros.topics import readings_of, topics_of
from ..run import Run
from .expect import Comparison, table
from .mapping import Entry, Map
from .outputs import SLICE_TICKS, Outputs
from .sample_extraction import TargetSamples, Wish, gather, refusals, wish
from .tick_alignment import (
    JUMP_NS,
    Array,
    Coverage,
    Oddities,
    TickGrid,
    align,
    first_ticks_at,
    tick_count,
)

#: More ticks mean that the stamps are wrong (for example one of zero and one of today).
MAX_TICKS = 100_000_000
#: max_age_ticks of a channel whose samples never expire.
NEVER = 2**32 - 1
#: Texts of the oddities by name.
_ODD = {
    "unset": "with the stamp zero",
    "repeated": "with the time of the message before",
    "late": "out of order (sorted in)",
    "jumps_back": f"jumps back of more than {JUMP_NS // 10**9} s",
    "stuck": "until the clock had caught up",
    "jumps_ahead": f"jumps ahead of more than {JUMP_NS // 10**9} s",
    "headerless": "without a header (placed by the time of recording)",
}


@dataclass(frozen=True)
class Fate:
    """The use of one channel's messages: `coverage` counts the used ones; the others by reason (number, first one), with
    `frames` as those of an Intake.

    `invalid`: ticks after the first sample whose last sample was older than max_age_ticks or timeout_ms allow.
    """

    messages: int
    coverage: Coverage
    refused: dict[str, tuple[int, int]]
    invalid: int
    frames: str = ""


@dataclass(frozen=True)
class ForeignRun:
    """The result of a run: the grid, the use of each mapped channel's messages, and oddities of the bag.

    `str` gives the report of `fcsl replay --map`.
    """

    grid: TickGrid
    header_time: bool
    fates: dict[str, Fate]
    oddities: dict[str, Oddities]
    unmapped: tuple[str, ...]
    starved: tuple[str, ...]  # the instances that will be failed, because a channel of theirs is not mapped
    notes: tuple[str, ...]
    truncated: str
    comparisons: tuple[Comparison, ...] = ()
    digest: str = ""  # of the run (simclient.bag.digest), if its outputs were taken

    def __str__(self) -> str:
        grid = self.grid
        clock = "header stamps" if self.header_time else "log times"
        seconds = grid.ticks / grid.tick_hz
        lines = [
            f"{grid.ticks} ticks ({seconds:.3f} s at {grid.tick_hz} Hz) from t0 = {_seconds(grid.first_ns)} s, {clock}",
            *self._table(),
        ]
        for name, fate in self.fates.items():
            if fate.refused:
                lines.append(f"  {name}: refused: {', '.join(refusals(fate.refused, fate.frames))}")
        for topic, odd in self.oddities.items():
            found = [f"{count} {text}" for name, text in _ODD.items() if (count := getattr(odd, name))]
            if found:
                lines.append(f"  {topic}: {', '.join(found)}")
        lines += [f"  {text}" for text in _clocks({topic: odd.offset_ns for topic, odd in self.oddities.items()})]
        if self.unmapped:
            failed = f"; without samples, these instances are failed: {', '.join(self.starved)}" if self.starved else ""
            lines.append(f"  not mapped: {', '.join(self.unmapped)}{failed}")
        lines += [f"  note: {note}" for note in self.notes]
        if self.comparisons:
            lines.append(table(self.comparisons))
        if self.digest:
            lines.append(f"  digest {self.digest}")
        return "\n".join(lines)

    def _table(self) -> list[str]:
        head = ("channel", "messages", "used", "superseded", "refused", "held ticks", "waiting ticks", "invalid ticks")
        rows: list[tuple[object, ...]] = [(*head, "largest gap")]
        for name, fate in self.fates.items():
            c = fate.coverage
            refused = fate.messages - c.used - c.superseded
            gap = f"{c.largest_gap_ns / 1e6:.3f} ms"
            rows.append((name, fate.messages, c.used, c.superseded, refused, c.held, c.waiting, fate.invalid, gap))
        widths = [max(len(str(row[i])) for row in rows) for i in range(len(rows[0]))]
        return [
            f"  {row[0]!s:<{widths[0]}}  " + "  ".join(f"{v!s:>{w}}" for v, w in zip(row[1:], widths[1:], strict=True))
            for row in rows
        ]


def _seconds(time_ns: int) -> str:
    """Exact decimal; a float cannot hold today's times in ns."""
    return f"{time_ns // 10**9}.{time_ns % 10**9:09d}"


def _clocks(offsets_ns: Mapping[str, int]) -> list[str]:
    """Topics whose stamps are of another clock than that of the recorder, where it matters: their offset is one of those
    between the known clocks, or differs from that of another topic.
    """
    found = []
    for topic, offset_ns in offsets_ns.items():
        known = named_offset(offset_ns)
        apart = max(abs(offset_ns - other) for other in offsets_ns.values()) > JUMP_NS
        if abs(offset_ns) > JUMP_NS and (known or apart):
            way = "ahead of" if offset_ns > 0 else "behind"
            why = f", the offset of {known}" if known else "; those of other topics are not: is it another clock?"
            found.append(f"{topic}: stamps {abs(offset_ns) / 1e9:.3f} s {way} the times of recording{why}")
    return found


def sensors_of(machine: Machine) -> dict[str, Channel]:
    return {channel.name: channel for channel in machine.channels if channel.direction == "sensor"}


def _entries(chart: Map, machine: Machine) -> Sequence[Entry]:
    """The entries of the map; for `channels: from machine`, one for each channel with a `ros` block."""
    if not chart.from_machine:
        return chart.entries
    mapped = [channel for channel in sensors_of(machine).values() if channel.ros_type]
    if not mapped:
        raise MapError(f"{chart.path}: `channels: from machine`, but no sensor channel of `{machine.name}` has `ros`")
    return [Entry(c.name, "/" + c.ros_topic.removeprefix("/"), location=chart.path) for c in mapped]


def _completed(entry: Entry, machine: Machine, bag: Bag) -> tuple[Entry, Channel]:
    """The entry, completed from the channel's `ros` block, and that channel. Raises MapError."""
    sensors = sensors_of(machine)
    if entry.target not in sensors:
        hint, there = did_you_mean(entry.target, sensors), ", ".join(sensors) or "none"
        raise MapError(
            f"{entry.location}: machine `{machine.name}` has no sensor channel `{entry.target}`{hint}; it has {there}"
        )
    channel = sensors[entry.target]
    if entry.timeout_ns and channel.max_age_ticks == NEVER:
        raise MapError(
            f"{entry.location}: `timeout_ms` needs a channel that can become too old: "
            f"give `{channel.name}` a `max_age_ticks` in the machine"
        )
    axes = entry.axes or channel.ros_axes
    if entry.fields:
        return replace(entry, axes=axes), channel
    if not channel.ros_type:
        raise MapError(
            f"{entry.location}: channel `{channel.name}`: `field` is missing, and the channel has no `ros` block to take it from"
        )
    there_is = bag.topics[entry.topic].type if entry.topic in bag.topics else ""
    if there_is and there_is.replace("/msg/", "/") != channel.ros_type.replace("/msg/", "/"):
        raise MapError(
            f"{entry.location}: `{entry.topic}` is {there_is}, channel `{channel.name}` takes {channel.ros_type}; give `field`"
        )
    taken = replace(entry, fields=(channel.ros_field,), axes=axes)
    choices, shorter = _reading(machine, channel)
    taken = replace(taken, choices=choices, shorter=shorter)
    return replace(taken, frame=channel.ros_frame, child_frame=channel.ros_child_frame), channel


def _reading(machine: Machine, channel: Channel) -> tuple[tuple[str | int, ...], bool]:
    """What the indices of a mapped channel stand for, and whether its list may be shorter."""
    topic = next(t for t in topics_of(machine) if channel in t.channels)
    return readings_of(topic)[topic.channels.index(channel)]


def _wishes(chart: Map, machine: Machine, bag: Bag) -> list[Wish]:
    wishes: list[Wish] = []
    for entry in _entries(chart, machine):
        entry, channel = _completed(entry, machine, bag)
        wishes.append(wish(bag, entry, channel.field.type, channel.field.count, null_refused=True))
    return wishes


def grid_of(
    path: str, all_samples: Mapping[str, TargetSamples], bag: Bag, tick_hz: int, most: int = MAX_TICKS
) -> TickGrid:
    """Ticks from the first sample of any target to the tick that receives the last one, `most` of them. `path`: the map.

    Raises MapError or BagError.
    """
    for name, samples in all_samples.items():
        if samples.messages and not len(samples.times_ns):
            raise MapError(
                f"{path}: `{name}`: no message can be used: {', '.join(refusals(samples.refused, samples.frames))}"
            )
    times = [samples.times_ns for samples in all_samples.values() if len(samples.times_ns)]
    if not times:
        damage = f" ({bag.truncated})" if bag.truncated else ""
        raise BagError(f"{bag.path}: there is no message on the mapped topics{damage}")
    first_ns, last_ns = min(int(t.min()) for t in times), max(int(t.max()) for t in times)
    ticks = tick_count(first_ns, last_ns, tick_hz)
    if ticks > most:
        raise MapError(
            f"{path}: stamps from {first_ns / 1e9:.3f} s to {last_ns / 1e9:.3f} s would make {ticks} ticks, more than {most}; "
            "is one of them wrong? `time: log` takes the times of recording instead"
        )
    return TickGrid(first_ns, ticks, tick_hz)


@dataclass(frozen=True)
class _Delivery:
    """The samples that a channel gets, in the order of their ticks. `rows` are those of `values`; all others are i64."""

    channel: Channel
    ticks: Array
    ages: Array
    stamps_ns: Array
    rows: Array
    values: Array

    def series(self) -> CSeries:
        """For `Run.feed_series`; valid as long as this object."""
        columns = (self.ticks, self.ages, self.stamps_ns, self.rows, self.values)
        return CSeries(
            *(column.ctypes.data for column in columns),
            row_bytes=self.values.strides[0],
            row_count=len(self.values),
            count=len(self.ticks),
            channel=self.channel.index,
        )


def _delivery(
    channel: Channel, samples: TargetSamples, aligned: tuple[Array, Array, Coverage], timeout_ns: int, grid: TickGrid
) -> tuple[_Delivery, Fate]:
    """What one channel gets; `aligned` is `align` of the samples.

    If `timeout_ms` ends before the machine's own max_age_ticks, the channel gets its last sample once more, with the
    first age that is too old.
    """
    ticks, chosen, coverage = aligned
    until = np.append(ticks[1:], grid.ticks)[: len(ticks)]
    old = ticks + channel.max_age_ticks + 1
    ages = np.zeros(len(ticks), np.int64)
    due, rows = ticks, chosen
    if timeout_ns:
        silent = first_ticks_at(samples.times_ns[chosen] + timeout_ns + 1, grid.first_ns, grid.tick_hz)
        too_late = silent < np.minimum(until, old)
        due = np.concatenate((ticks, silent[too_late]))
        order = np.argsort(due, kind="stable")
        due, rows = due[order], np.concatenate((chosen, chosen[too_late]))[order]
        ages = np.concatenate((ages, np.full(int(too_late.sum()), channel.max_age_ticks + 1)))[order]
        old = np.minimum(old, silent)
    invalid = int(np.maximum(until - old, 0).sum())
    delivery = _Delivery(channel, due, ages, samples.stamps_ns[rows], rows, samples.values)
    return delivery, Fate(samples.messages, coverage, samples.refused, invalid, samples.frames)


def run_foreign(
    bag: Bag,
    chart: Map,
    run: Run,
    outputs: Outputs | None = None,
    record: tuple[Path, str] | None = None,
    progress: Callable[[str, int, int], None] = lambda what, done, total: None,
) -> ForeignRun:
    """Runs `run` from its start over the whole bag. `outputs` takes what it puts out, `record` is (directory,
    namespace) of an FCSL bag to write.

    Raises MapError or BagError, which names the line of the map that does not fit the bag or the machine.
    """
    machine = run.machine
    wishes = _wishes(chart, machine, bag)
    total = sum(bag.topics[topic].count for topic in {w.topic.name for w in wishes})
    all_samples, oddities = gather(bag, wishes, chart.header_time, lambda done: progress("reading", done, total))
    grid = grid_of(chart.path, all_samples, bag, machine.tick_hz)
    deliveries, fates = [], {}
    # By the identity of the times, which the channels of a topic share.
    aligned: dict[int, tuple[Array, Array, Coverage]] = {}
    for name, channel in sensors_of(machine).items():
        if name not in all_samples:
            continue
        samples = all_samples[name]
        times = id(samples.times_ns)
        if times not in aligned:
            aligned[times] = align(samples.times_ns, grid.first_ns, grid.ticks, grid.tick_hz)
        timeouts = [w.entry.timeout_ns for w in wishes if w.entry.target == name and w.entry.timeout_ns]
        delivery, fates[name] = _delivery(channel, samples, aligned[times], min(timeouts, default=0), grid)
        deliveries.append(delivery)
    _drive(run, deliveries, grid.ticks, outputs, record, progress)
    unmapped = [channel for name, channel in sensors_of(machine).items() if name not in fates]
    return ForeignRun(
        grid=grid,
        header_time=chart.header_time,
        fates=fates,
        oddities=oddities,
        unmapped=tuple(channel.name for channel in unmapped),
        starved=tuple(dict.fromkeys(split_path(c.field.path)[0] for c in unmapped if c.grace_ticks != NEVER)),
        notes=tuple(bag.notes),
        truncated=bag.truncated,
        digest=outputs.digest() if outputs else "",
    )


def _drive(
    run: Run,
    deliveries: Sequence[_Delivery],
    ticks: int,
    outputs: Outputs | None,
    record: tuple[Path, str] | None,
    progress: Callable[[str, int, int], None],
) -> None:
    """Steps through all ticks; delivers each sample before its tick. Python handles no signal during a slice."""
    run.attach()
    if record is not None:
        run.record(*record, lossless=True)
    series = (CSeries * len(deliveries))(*(delivery.series() for delivery in deliveries))
    slice_ticks = outputs.slice_ticks if outputs else SLICE_TICKS
    for begin in range(0, ticks, slice_ticks):
        end = min(begin + slice_ticks, ticks)
        run.feed_series(series, end)
        if outputs:
            outputs.collect()
        progress("running", end, ticks)
    if record is not None:
        run.record_stop()
