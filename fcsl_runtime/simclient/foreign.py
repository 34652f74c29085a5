# SPDX-License-Identifier: Apache-2.0
"""Runs a machine on somebody else's bag: mapped message fields become samples of sensor channels."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .bag import Bag, Topic, field_value
from .descriptor import TYPE_FORMATS, Channel, Machine
from .errors import BagError, MapError, did_you_mean
from .grid import Coverage, Sample, place, tick_count
from .mapping import Entry, Map
from .run import Run

#: More ticks than this mean that the stamps are wrong (one of them zero, another of today).
MAX_TICKS = 100_000_000
_INDEXED = re.compile(r"^(.*)\[([0-9]+)\]$")


@dataclass(frozen=True)
class ForeignRun:
    """What was run: the grid, and for each mapped channel how many messages there were and what became of them."""

    ticks: int
    tick_hz: int
    first_ns: int
    header_time: bool
    messages: dict[str, int]
    coverage: dict[str, Coverage]
    unmapped: tuple[str, ...]

    def __str__(self) -> str:
        clock = "header stamps" if self.header_time else "log times"
        seconds = self.ticks / self.tick_hz
        lines = [
            f"{self.ticks} ticks ({seconds:.3f} s at {self.tick_hz} Hz) from t0 = {self.first_ns / 1e9:.9f} s, {clock}"
        ]
        width = max(len("channel"), *(len(name) for name in self.coverage))
        head = ("messages", "used", "superseded", "held ticks", "waiting ticks", "largest gap")
        lines.append(f"  {'channel':<{width}}  " + "  ".join(head))
        for name, c in self.coverage.items():
            cells = (self.messages[name], c.used, c.superseded, c.held, c.waiting, f"{c.largest_gap_ns / 1e6:.3f} ms")
            lines.append(
                f"  {name:<{width}}  " + "  ".join(f"{v!s:>{len(h)}}" for v, h in zip(cells, head, strict=True))
            )
        if self.unmapped:
            lines.append(f"  not mapped: {', '.join(self.unmapped)}")
        return "\n".join(lines)


class _Source:
    """One map entry against the bag and machine it met."""

    def __init__(self, entry: Entry, bag: Bag, machine: Machine):
        self.entry = entry
        sensors = {c.name: c for c in machine.channels if c.direction == "sensor"}
        if entry.channel not in sensors:
            hint = did_you_mean(entry.channel, sensors)
            there = ", ".join(sensors) or "none"
            raise MapError(
                f"{entry.place}: machine `{machine.name}` has no sensor channel `{entry.channel}`{hint}; it has {there}"
            )
        self.channel: Channel = sensors[entry.channel]
        try:
            self.topic: Topic = bag.topic(entry.topic)
        except BagError as error:
            raise MapError(f"{entry.place}: {error}") from None
        count = self.channel.field.count
        for key, numbers in (("scale", entry.scale), ("offset", entry.offset)):
            if len(numbers) not in (0, 1, count):
                raise MapError(f"{entry.place}: `{key}` has {len(numbers)} numbers; the channel has {count}")
        if entry.order and count != 4:
            raise MapError(f"{entry.place}: `quaternion` needs a channel of 4 elements; `{entry.channel}` has {count}")
        self._scale = (entry.scale or (1.0,)) * (count if len(entry.scale) < 2 else 1)
        self._offset = (entry.offset or (0.0,)) * (count if len(entry.offset) < 2 else 1)
        self._linear = bool(entry.scale or entry.offset)
        self._format = f"<{count}{TYPE_FORMATS[self.channel.field.type]}"

    def payload(self, message: Any, index: int) -> bytes:
        """The channel's bytes out of message number `index` of the topic. Raises MapError."""
        numbers: list[Any] = []
        for field in self.entry.fields:
            numbers += self._numbers(message, field)
        field_type, count = self.channel.field.type, self.channel.field.count
        if len(numbers) != count:
            raise self._error(f"gives {len(numbers)} numbers; channel `{self.channel.name}` takes {count}", index)
        if self.entry.order:
            numbers = [numbers[i] for i in self.entry.order]
        if self._linear:
            numbers = [n * s + o for n, s, o in zip(numbers, self._scale, self._offset, strict=True)]
        if field_type not in ("f32", "f64"):
            numbers = [self._integer(n, field_type, index) for n in numbers]
        try:
            return struct.pack(self._format, *numbers)
        except (struct.error, OverflowError):
            raise self._error(f"gives {numbers}, out of the range of {field_type}", index) from None

    def _integer(self, number: Any, field_type: str, index: int) -> int:
        if number != number or number != int(number) or (field_type == "bool" and number not in (0, 1)):
            raise self._error(
                f"gives {number}, which is not {'a bool' if field_type == 'bool' else 'an integer'}", index
            )
        return int(number)

    def _error(self, text: str, index: int) -> MapError:
        what = f"`{', '.join(self.entry.fields)}` of message {index} of `{self.topic.name}`"
        return MapError(f"{self.entry.place}: {what} {text}")

    def _numbers(self, message: Any, path: str) -> list[Any]:
        indexed = _INDEXED.match(path)
        try:
            value = field_value(self.topic, message, indexed.group(1) if indexed else path)
            if indexed:
                value = value[int(indexed.group(2))]
        except BagError as error:
            raise MapError(f"{self.entry.place}: {error}") from None
        except (IndexError, TypeError):
            raise MapError(f"{self.entry.place}: `{path}`: no such element in `{self.topic.name}`") from None
        if getattr(value, "__msgtype__", "").endswith("/Quaternion") and not self.entry.order:
            raise MapError(
                f"{self.entry.place}: `{path}` is a quaternion in the order x, y, z, w; add `quaternion: xyzw`, "
                "and the channel gets w, x, y, z"
            )
        flat: list[Any] = []
        if not _flatten(value, flat):
            raise MapError(f"{self.entry.place}: `{path}` of `{self.topic.name}` is not made of numbers only")
        return flat


def _flatten(value: Any, flat: list[Any]) -> bool:
    """Appends every number of a field in order of definition; False when something in it is not a number."""
    if isinstance(value, (bool, int, float)):
        flat.append(value)
        return True
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, list):
        return all(_flatten(item, flat) for item in value)
    if hasattr(value, "__msgtype__"):
        names = [name for name in value.__dataclass_fields__ if name != "__msgtype__"]
        return all(_flatten(getattr(value, name), flat) for name in names)
    return False


class _Samples:
    """Everything mapped, by channel: when samples were, and their bytes."""

    def __init__(self) -> None:
        self.times: dict[str, list[Sample]] = {}
        self.payloads: dict[str, dict[tuple[str, int], bytes]] = {}


def _header_time_ns(source: _Source, message: Any) -> int:
    header = getattr(message, "header", None)
    if header is None:
        raise MapError(
            f"{source.entry.place}: `{source.topic.name}` [{source.topic.type}] has no header; use `time: log`"
        )
    return int(header.stamp.sec) * 1_000_000_000 + int(header.stamp.nanosec)


def _collect(bag: Bag, chart: Map, sources: Sequence[_Source]) -> _Samples:
    by_topic: dict[str, list[_Source]] = {}
    samples = _Samples()
    for source in sources:
        by_topic.setdefault(source.topic.name, []).append(source)
        samples.times.setdefault(source.channel.name, [])
        samples.payloads.setdefault(source.channel.name, {})
    counts = dict.fromkeys(by_topic, 0)
    for topic, log_ns, data in bag.messages(set(by_topic)):
        index, message = counts[topic], bag.decode(topic, data)
        counts[topic] += 1
        for source in by_topic[topic]:
            time_ns = _header_time_ns(source, message) if chart.header_time else log_ns
            samples.times[source.channel.name].append(Sample(time_ns, topic, index))
            samples.payloads[source.channel.name][topic, index] = source.payload(message, index)
    if bag.truncated:
        raise BagError(f"{bag.path}: the bag is incomplete: {bag.truncated}")
    for topic, count in counts.items():
        if count == 0:
            raise MapError(f"{by_topic[topic][0].entry.place}: `{topic}` has no messages in {bag.path}")
    return samples


def _check_sources(sources: Sequence[_Source]) -> None:
    seen: dict[tuple[str, str], str] = {}
    for source in sources:
        key = (source.channel.name, source.topic.name)
        if key in seen:
            raise MapError(
                f"{source.entry.place}: channel `{key[0]}` is mapped from `{key[1]}` twice; first at {seen[key]}"
            )
        seen[key] = source.entry.place


def run_foreign(
    bag: Bag,
    chart: Map,
    run: Run,
    record: tuple[Path, str] | None = None,
    progress: Callable[[int, int], None] = lambda tick, ticks: None,
) -> ForeignRun:
    """Runs `run` from its start over the whole bag; `record` is (directory, namespace) of a bag of ours to write.

    Raises MapError or BagError naming the line of the map that does not meet what the bag or the machine has.
    """
    machine = run.machine
    sources = [_Source(entry, bag, machine) for entry in chart.entries]
    _check_sources(sources)
    samples = _collect(bag, chart, sources)
    everything = [sample.time_ns for times in samples.times.values() for sample in times]
    first_ns, last_ns = min(everything), max(everything)
    ticks = tick_count(first_ns, last_ns, machine.tick_hz)
    if ticks > MAX_TICKS:
        raise MapError(
            f"{chart.path}: stamps from {first_ns / 1e9:.3f} s to {last_ns / 1e9:.3f} s would make {ticks} ticks; "
            "is one of them wrong? `time: log` takes the times of recording instead"
        )
    coverage: dict[str, Coverage] = {}
    due: dict[int, dict[int, bytes]] = {}
    channels = {source.channel.name: source.channel.index for source in sources}
    for name, times in samples.times.items():
        delivered, coverage[name] = place(times, first_ns, ticks, machine.tick_hz)
        for tick, sample in delivered.items():
            due.setdefault(tick, {})[channels[name]] = samples.payloads[name][sample.topic, sample.index]
    _drive(run, due, ticks, record, progress)
    return ForeignRun(
        ticks=ticks,
        tick_hz=machine.tick_hz,
        first_ns=first_ns,
        header_time=chart.header_time,
        messages={name: len(times) for name, times in samples.times.items()},
        coverage=coverage,
        unmapped=tuple(c.name for c in machine.channels if c.direction == "sensor" and c.name not in channels),
    )


def _drive(
    run: Run,
    due: dict[int, dict[int, bytes]],
    ticks: int,
    record: tuple[Path, str] | None,
    progress: Callable[[int, int], None],
) -> None:
    """Steps through all ticks, delivering what is due before each."""
    run.attach()
    if record is not None:
        run.record(*record, lossless=True)
    for tick in sorted(due):
        if tick > run.tick:
            run.step(tick - run.tick)
        run.write_channels(due[tick])
        progress(tick, ticks)
    run.step(ticks - run.tick)
    if record is not None:
        run.record_stop()
