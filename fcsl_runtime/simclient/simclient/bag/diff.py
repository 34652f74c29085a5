# SPDX-License-Identifier: Apache-2.0
"""Where two bags differ: what `fcsl bag diff` prints.

Topics are compared by name. Messages of a topic are paired by tick, else by stamp, else by number. Fields are compared
bit for bit with NaNs equal, or within tolerances. Times of recording and what viewers show (`record/views`) are not
compared. Hashes in checkpoints identify the recording program; differences between them are notes.
"""

from __future__ import annotations

import fnmatch
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import zip_longest

from ..cli import Progress
from ..errors import BagError
from .bag import VIEWS_SUFFIX, Bag
from .compare import PROVENANCE, Comparison, FieldDifference, Message, Pair, Tolerance, short
from .fields import flat
from .seconds import seconds
from .stamps import Stamps
from .states import StateReader

#: Pairs of unequal bytes of a topic that are compared in one call.
_BATCH = 4096
#: Most fields listed that differ at the same time as the first.
_MAX_LISTED = 12
#: Messages shown before and after the first difference.
_CONTEXT = 2
EXACT = Tolerance()
#: Listed in place of a field for a message that only one bag has.
_WHOLE = "(message)"


@dataclass
class TopicDifference:
    """One topic: pairs compared, pairs that differ, messages in one bag only, differences by field."""

    name: str
    compared: int = 0
    differing: int = 0
    only: list[int] = field(default_factory=lambda: [0, 0])
    fields: dict[str, FieldDifference] = field(default_factory=dict)

    def add(self, count: int, found: dict[str, FieldDifference]) -> None:
        self.differing += count
        for name, difference in found.items():
            if name in self.fields:
                self.fields[name].also(difference)
            else:
                self.fields[name] = difference

    def alone(self, side: int, message: Message) -> None:
        """Counts a message that only bag number `side` has."""
        self.only[side] += 1
        values = ("present", "absent") if side == 0 else ("absent", "present")
        self.add(0, {_WHOLE: FieldDifference((message, message), "", values, 1)})


@dataclass
class Difference:
    """What `diff` found: `absent` names topics that one bag lacks, by bag; `notes` do not count as differences."""

    topics: list[TopicDifference]
    absent: tuple[list[str], list[str]]
    context: str
    notes: list[str]

    @property
    def same(self) -> bool:
        return not any(self.absent) and not any(topic.fields for topic in self.topics)

    def __str__(self) -> str:
        lines = [self.context] if self.context else []
        lines += [f"only in {'AB'[1 - side]}: {name}" for side in (0, 1) for name in self.absent[side]]
        for topic in self.topics:
            alone = "".join(f", {count} only in {'AB'[side]}" for side, count in enumerate(topic.only) if count)
            differing = f"{topic.differing} differ" if topic.differing else "identical"
            lines.append(f"{topic.name}: {topic.compared} messages, {differing}{alone}")
            for name, found in topic.fields.items():
                size = f", by at most {found.largest:.6g}" if found.largest else ""
                lines.append(f"    {name}: {found.count} from {_when(found.first[0])} on{size}")
        return "\n".join([*lines, *self.notes, "the bags are the same" if self.same else "the bags differ"])


def _when(message: Message) -> str:
    return f"t = {seconds(message.time_ns)} s"


class _Reader:
    """One of the two bags: its messages with the keys that pair them."""

    def __init__(self, bag: Bag, topics: Sequence[str]):
        self.bag = bag
        self._topics = set(topics)
        self._stamps = Stamps(bag)

    def messages(self) -> Iterator[tuple[str, Message]]:
        """(topic, message) in the order of the bag."""
        numbers = dict.fromkeys(self._topics, 0)
        for topic, log_ns, data in self.bag.messages(self._topics):
            time_ns = self._stamps.time_ns(topic, log_ns, data)
            tick = self._stamps.tick(topic, data)
            key = tick if tick is not None else time_ns if self._stamps.stamped(topic) else numbers[topic]
            numbers[topic] += 1
            yield topic, Message(key, time_ns, data)

    def around(self, topic: str, key: int) -> list[Message]:
        """The message of `topic` with this key and those next to it."""
        before: deque[Message] = deque(maxlen=_CONTEXT)
        found: list[Message] = []
        for name, message in self.messages():
            if name != topic:
                continue
            if message.key < key and not found:
                before.append(message)
            elif len(found) <= _CONTEXT:
                found.append(message)
            else:
                break
        return [*before, *found]


class _Pairing:
    """Pairs the messages of one topic as they come, and compares the pairs."""

    def __init__(self, readers: tuple[_Reader, _Reader], topic: str, tolerance: Tolerance):
        self.found = TopicDifference(topic)
        self._comparison = Comparison((readers[0].bag, readers[1].bag), topic, tolerance)
        self._waiting: tuple[deque[Message], deque[Message]] = (deque(), deque())
        self._unequal: list[Pair] = []

    def take(self, side: int, message: Message) -> None:
        self._waiting[side].append(message)
        first, second = self._waiting
        while first and second:
            if first[0].key == second[0].key:
                self._pair(first.popleft(), second.popleft())
            else:
                older = 0 if first[0].key < second[0].key else 1
                self._alone(older, self._waiting[older].popleft())

    def _pair(self, a: Message, b: Message) -> None:
        self.found.compared += 1
        if a.data != b.data:
            self._unequal.append((a, b))
            if len(self._unequal) == _BATCH:
                self._compare()

    def _alone(self, side: int, message: Message) -> None:
        self._compare()
        self.found.alone(side, message)

    def _compare(self) -> None:
        self.found.add(*self._comparison.differences(self._unequal))
        self._unequal.clear()

    def end(self) -> None:
        for side, waiting in enumerate(self._waiting):
            for message in waiting:
                self._alone(side, message)
        self._compare()


def diff(
    first: Bag,
    second: Bag,
    tolerance: Tolerance = EXACT,
    topics: Sequence[str] = (),
) -> Difference:
    """Compares two bags; of topics that match one of the patterns `topics` only, when given. Raises BagError."""
    names = [_chosen(bag, topics) for bag in (first, second)]
    common = [name for name in names[0] if name in names[1]]
    if not common:
        raise BagError(f"{first.path} and {second.path} have no topic in common that could be compared")
    readers = _Reader(first, common), _Reader(second, common)
    pairings = {name: _Pairing(readers, name, tolerance) for name in common}
    progress = Progress("comparing", sum(max(bag.topics[name].count for bag in (first, second)) for name in common))
    for done, pair in enumerate(zip_longest(readers[0].messages(), readers[1].messages())):
        progress.at(done)
        for side, item in enumerate(pair):
            if item is not None:
                pairings[item[0]].take(side, item[1])
    for pairing in pairings.values():
        pairing.end()
    found = [pairing.found for pairing in pairings.values()]
    absent = [n for n in names[1] if n not in names[0]], [n for n in names[0] if n not in names[1]]
    return Difference(found, absent, _context(readers, found), _provenance(readers, common))


def _chosen(bag: Bag, patterns: Sequence[str]) -> list[str]:
    chosen = [
        n
        for n in bag.topics
        if not n.endswith(VIEWS_SUFFIX) and (not patterns or any(fnmatch.fnmatchcase(n, p) for p in patterns))
    ]
    if not chosen and patterns:
        bag.topic(patterns[0])  # raises, and lists what is there
    return chosen


def _context(readers: tuple[_Reader, _Reader], found: Sequence[TopicDifference]) -> str:
    """The first difference with its context; empty if there is none."""
    everything = [(topic, name, f) for topic in found for name, f in topic.fields.items()]
    if not everything:
        return ""
    earliest = min(f.first[0].time_ns for _, _, f in everything)
    at_once = [item for item in everything if item[2].first[0].time_ns == earliest]
    topic, name, first = at_once[0]
    message = first.first[0]
    tick = Stamps(readers[0].bag).tick(topic.name, message.data)
    where = f"tick {tick}, " if tick is not None else ""
    lines = [f"first difference at {where}{_when(message)}{_state_at(readers[0].bag, topic.name, earliest)}"]
    lines += [f"  {topic.name}  {name}{first.element}{_written(readers[0].bag, topic.name, message)}"]
    lines += [f"    A  {first.values[0]}", f"    B  {first.values[1]}"]
    if name != _WHOLE:
        lines += _around(readers, topic.name, name, message.key)
    others = [f"{other.name} {field_name}" for other, field_name, _ in at_once[1:]]
    if others:
        more = f" and {len(others) - _MAX_LISTED} more" if len(others) > _MAX_LISTED else ""
        lines.append(f"  at the same time: {', '.join(others[:_MAX_LISTED])}{more}")
    return "\n".join(lines)


def _written(bag: Bag, topic: str, message: Message) -> str:
    """The path that a message of host writes was written to."""
    if not topic.endswith("/record/writes"):
        return ""
    return f" of the write to `{bag.decode_own(topic, message.data, ('path',)).path}`"


def _state_at(bag: Bag, topic: str, time_ns: int) -> str:
    """The state of the machine of `topic`."""
    machine = next((m for m in bag.machines() if topic.startswith(m.prefix + "/")), None)
    if machine is None or machine.state not in bag.topics:
        return ""
    reader, state = StateReader(bag, machine.state), ""
    for _, _, data in bag.messages({machine.state}):
        sample = reader.read(data)
        if sample.time_ns > time_ns:
            break
        state = sample.state
    return f", state {state}" if state else ""


def _around(readers: tuple[_Reader, _Reader], topic: str, name: str, key: int) -> list[str]:
    """The field in the messages next to the one with `key`, in both bags."""
    columns: list[dict[int, str]] = []
    for reader in readers:
        decoded = {m.key: dict(flat(reader.bag.decode(topic, m.data))) for m in reader.around(topic, key)}
        columns.append({k: short(leaves.get(name, ""), 32) for k, leaves in decoded.items()})
    keys = sorted(columns[0].keys() | columns[1].keys())
    if len(keys) < 2:
        return []
    width = max(len(text) for text in ["A", *columns[0].values()])
    lines = [f"    {'':>12}  {'A':<{width}}  B"]
    return lines + [
        f"  {'>' if k == key else ' '} {k:>12}  {columns[0].get(k, ''):<{width}}  {columns[1].get(k, '')}".rstrip()
        for k in keys
    ]


def _provenance(readers: tuple[_Reader, _Reader], topics: Sequence[str]) -> list[str]:
    """Notes on the recording programs, where the checkpoints differ."""
    notes = []
    for topic in topics:
        if not topic.endswith("/record/checkpoint"):
            continue
        first = [next((data for _, _, data in r.bag.messages({topic})), None) for r in readers]
        if None in first:
            continue
        decoded = [r.bag.decode_own(topic, d, PROVENANCE) for r, d in zip(readers, first, strict=True) if d is not None]
        for name in PROVENANCE:
            a, b = (getattr(message, name) for message in decoded)
            if a != b:
                notes.append(f"note: {topic} {name}: {short(a, 16)} in A, {short(b, 16)} in B")
    return notes
