# SPDX-License-Identifier: Apache-2.0
"""Extracts samples from a bag as map entries specify: the samples of each target in order, and counts of all messages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np

from fcsl_compiler.api.ros import Pick

from ..bag import Bag, Topic
from ..bag.definitions import declarations
from ..bag.mcap_file import distinct
from ..errors import BagError, MapError
from ..ros import frame_names
from ..ros.reader import REASONS, Reader
from ..ros.types import definitions_of
from .mapping import Entry
from .poses import are_rotations
from .tick_alignment import Array, Oddities, joined_rows, screen

#: Reasons besides REASONS for which a message is not used.
OTHER_TYPE = "type"
NO_STAMP = "unset"
STUCK = "stuck"
#: One of REASONS.
FRAME = "frame"
#: Texts of the reasons.
_REFUSED = {
    OTHER_TYPE: "of another type than most of the topic's",
    NO_STAMP: "with the stamp zero",
    STUCK: "after a backward jump of the clock",
    "encoding": "not in little-endian CDR",
    "truncated": "truncated",
    "malformed": "malformed",
    "stamp": "with an invalid stamp",
    FRAME: "with another frame",
    "shape": "with another length",
    "range": "out of range",
    "nan": "with a NaN",
    "unmeasured": "not measured",
    "unknown": "with none of the choices",
    "rotation": "with a rotation of length zero or infinity",
}
#: Reasons for which a message as a whole is not decoded, so that it has no stamp either.
_UNREAD = [REASONS.index(reason) for reason in ("encoding", "truncated", "malformed", "stamp", FRAME)]


@dataclass(frozen=True)
class Wish:
    """A map entry checked against its bag: the scalars that it takes from a topic."""

    entry: Entry
    topic: Topic
    pick: Pick


def wish(bag: Bag, entry: Entry, scalar: str, count: int, null_refused: bool = False) -> Wish:
    """The scalars that `entry` takes for a target of `count` scalars. `null_refused`: a quaternion of length zero is
    none. Raises MapError with the entry's location.
    """
    try:
        topic = bag.topic(entry.topic)
    except BagError as error:
        raise MapError(f"{entry.location}: {error}") from None
    pick = Pick(
        name=entry.target,
        fields=entry.fields,
        type=scalar,
        count=count,
        axes=entry.axes,
        source_axes=entry.source_axes,
        order=entry.order,
        rotation=entry.rotation,
        scale=entry.scale,
        offset=entry.offset,
        null_refused=null_refused,
        choices=entry.choices,
        shorter=entry.shorter,
    )
    return Wish(entry, topic, pick)


@dataclass(frozen=True)
class TargetSamples:
    """The samples of one target, ordered by topic and then as in the bag.

    `times_ns` place them on the grid, `stamps_ns` are header stamps (0 without one), `values` has a row of bytes for
    each. `messages` is the number of messages; `refused` maps a reason to (number of unused messages, index of the
    first). `frames` tells the frames of the first message with others than the channels have: "'map', not 'odom'".
    """

    times_ns: Array
    stamps_ns: Array
    values: Array
    messages: int
    refused: dict[str, tuple[int, int]]
    frames: str = ""


def refusals(refused: Mapping[str, tuple[int, int]], frames: str = "") -> list[str]:
    """As text; messages count from 0 in their topic. `frames`: those of samples."""
    return [
        f"{count} {_REFUSED[reason]} (first: message {first}{f': {frames}' if frames and reason == FRAME else ''})"
        for reason, (count, first) in refused.items()
    ]


@cache
def _is_same(schema: str, first: str) -> bool:
    """Whether messages with one definition can be read with the other. Distributions differ in their comments."""
    return schema in ("", first) or declarations(schema) == declarations(first)


@dataclass
class _Column:
    """All messages of one topic read so far."""

    reader: Reader
    wishes: list[Wish]
    frame: str = ""
    child_frame: str = ""
    #: Time of recording and frames of the first message with others; of one time, the first by their text.
    other_frames: tuple[int, str] | None = None
    log_ns: list[Array] = field(default_factory=list)
    stamps_ns: list[Array] = field(default_factory=list)
    values: list[Array] = field(default_factory=list)
    status: list[Array] = field(default_factory=list)
    other: list[Array] = field(default_factory=list)

    def add(self, data: bytes, entries: Array, announced: Topic) -> None:
        topic = self.wishes[0].topic
        other = announced.type != topic.type or not _is_same(announced.schema, topic.schema)
        # A message of another type is treated as empty: counted, not decoded.
        sizes = entries["end"] - entries["begin"]
        samples = self.reader.read_many(data, entries["begin"], np.zeros_like(sizes) if other else sizes)
        for i, w in enumerate(self.wishes):
            if self.reader.rotations[i]:
                taken = samples.status[:, i] == 0
                samples.status[taken & ~are_rotations(samples.values[w.pick.name]), i] = REASONS.index("rotation")
        self.log_ns.append(entries["log_ns"].copy())
        self.stamps_ns.append(samples.stamps)
        self.values.append(samples.values)
        self.status.append(samples.status)
        self.other.append(np.full(len(entries), other))
        if self.frame or self.child_frame:
            self._note_frames(data, entries[samples.status[:, 0] == REASONS.index(FRAME)])

    def _note_frames(self, data: bytes, entries: Array) -> None:
        """Looks at messages with another frame."""
        if not len(entries):
            return
        first_ns = int(entries["log_ns"].min())
        for entry in entries[entries["log_ns"] == first_ns]:
            came, wanted = frame_names.differing(data[entry["begin"] : entry["end"]], self.frame, self.child_frame)
            found = first_ns, f"{came}, not {wanted}"
            self.other_frames = found if self.other_frames is None else min(found, self.other_frames)

    def sorted_out(self, stamped: bool) -> tuple[list[TargetSamples], Oddities]:
        """The samples of each wish. `stamped`: samples are placed by the header stamp, where the type has one."""
        header_time = stamped and self.reader.has_stamp
        log_ns, stamps_ns, others = (_joined(parts) for parts in (self.log_ns, self.stamps_ns, self.other))
        other = others.astype(bool)
        status = np.concatenate(self.status) if self.status else np.empty((0, len(self.wishes)), np.uint8)
        values = joined_rows(self.values) if self.values else np.empty(0, self.reader.dtype)
        if not (log_ns[1:] > log_ns[:-1]).all():
            order = self._order(log_ns, stamps_ns, other, status, values)
            log_ns, stamps_ns, other, status, values = (a[order] for a in (log_ns, stamps_ns, other, status, values))
        all_read = not status.any()
        # One pick is enough: a fault of a message as a whole appears in all picks.
        unread = np.zeros(len(log_ns), bool) if all_read else np.isin(status[:, 0], _UNREAD)
        readable = ~other & ~unread
        times_ns = stamps_ns if header_time else log_ns
        if readable.all():
            timed, oddities = screen(times_ns, log_ns, header_time)
        else:
            timed = np.zeros(len(log_ns), bool)
            timed[readable], oddities = screen(times_ns[readable], log_ns[readable], header_time)
        if stamped and not header_time:
            oddities = replace(oddities, headerless=len(log_ns))
        unset = readable & (times_ns == 0) & header_time
        whole = {OTHER_TYPE: other, NO_STAMP: unset, STUCK: readable & ~timed & ~unset}
        all_samples = []
        for i, w in enumerate(self.wishes):
            judged = timed | (unread & ~other)
            found: list[int] = [] if all_read else np.flatnonzero(np.bincount(status[:, i])).tolist()
            masks = whole | {REASONS[code]: judged & (status[:, i] == code) for code in found if code}
            refused = {reason: (int(m.sum()), int(m.argmax())) for reason, m in masks.items() if m.any()}
            taken = timed & (status[:, i] == 0)
            times, stamps, column = times_ns, stamps_ns, values[w.pick.name]
            if not taken.all():  # usually all are used; then no copy is made, and all share their times
                times, stamps, column = times[taken], stamps[taken], column[taken]
            frames = self.other_frames[1] if self.other_frames else ""
            all_samples.append(TargetSamples(times, stamps, column, len(log_ns), refused, frames))
        return all_samples, oddities

    def _order(self, log_ns: Array, stamps_ns: Array, other: Array, status: Array, values: Array) -> Array:
        """The order of the messages: by time of recording, of one time by stamp, and of one stamp by their content. So
        it does not matter in which order a file has them.
        """
        keys = [log_ns, np.where(other, 0, stamps_ns), other]
        for i, w in enumerate(self.wishes):
            taken = (status[:, i] == 0) & ~other
            column = np.ascontiguousarray(values[w.pick.name]).reshape(len(log_ns), -1)
            keys += [status[:, i], *np.where(taken[:, None], column, 0).T]
        return np.lexsort(keys[::-1])


def gather(
    bag: Bag,
    wishes: Sequence[Wish],
    header_time: bool,
    progress: Callable[[int], None] = lambda done: None,
    nan_allowed: bool = False,
) -> tuple[dict[str, TargetSamples], dict[str, Oddities]]:
    """(samples by target, oddities of times by topic). `progress` receives the number of messages read. `nan_allowed`: a
    NaN is a value, else it is refused.

    Raises MapError for entries that do not fit their message, BagError for a bag without the definitions.
    """
    columns = {topic: _column(bag, topic, wishes, nan_allowed) for topic in sorted({w.topic.name for w in wishes})}
    done = 0
    for batch, announced in bag.batches(columns.keys()):
        numbers = batch.entries["number"]
        present = distinct(numbers)
        for number in present:
            topic = announced[number]
            mine = batch.entries if len(present) == 1 else batch.entries[numbers == number]
            columns[topic.name].add(batch.data, mine, topic)
        done += len(numbers)
        progress(done)
    parts: dict[str, list[TargetSamples]] = {}
    oddities = {}
    for name, column in columns.items():
        all_samples, oddities[name] = column.sorted_out(header_time)
        for w, target_samples in zip(column.wishes, all_samples, strict=True):
            parts.setdefault(w.entry.target, []).append(target_samples)
    return {target: _merged(found) for target, found in parts.items()}, oddities


def _column(bag: Bag, topic: str, wishes: Sequence[Wish], nan_allowed: bool) -> _Column:
    mine = [w for w in wishes if w.topic.name == topic]
    definitions = definitions_of(bag.store(topic).fielddefs)
    frame, child_frame = (_agreed(mine, key) for key in ("frame", "child_frame"))
    kind = mine[0].topic.type
    try:
        reader = Reader(definitions, kind, [w.pick for w in mine], frame, child_frame, nan_allowed=nan_allowed)
        return _Column(reader, mine, frame, child_frame)
    except MapError:
        for w in mine:  # which of them it is
            try:
                Reader(definitions, kind, [w.pick])
            except MapError as error:
                raise MapError(f"{w.entry.location}: {error}") from None
        raise


def _agreed(wishes: Sequence[Wish], key: str) -> str:
    """The frame that a topic's messages must have, from the channels' `ros` blocks; empty if none names one."""
    frames = {frame: w.entry.location for w in wishes if (frame := getattr(w.entry, key))}
    if len(frames) > 1:
        raise MapError(
            f"{wishes[0].entry.location}: `{wishes[0].topic.name}` feeds channels of different frames: {', '.join(sorted(frames))}"
        )
    return next(iter(frames), "")


def _joined(parts: Sequence[Array]) -> Array:
    return np.concatenate(parts) if parts else np.empty(0, np.int64)


def _merged(parts: Sequence[TargetSamples]) -> TargetSamples:
    """Merges the samples of several topics for one target; the first refused message is from the first topic with one."""
    if len(parts) == 1:
        return parts[0]
    refused: dict[str, tuple[int, int]] = {}
    for part in parts:
        for reason, (count, first) in part.refused.items():
            before = refused.get(reason)
            refused[reason] = (count + before[0], before[1]) if before else (count, first)
    return TargetSamples(
        times_ns=np.concatenate([part.times_ns for part in parts]),
        stamps_ns=np.concatenate([part.stamps_ns for part in parts]),
        values=np.concatenate([part.values for part in parts]),
        messages=sum(part.messages for part in parts),
        refused=refused,
        frames=next((part.frames for part in parts if part.frames), ""),
    )
