# SPDX-License-Identifier: Apache-2.0
"""What a bag holds of a run, for pictures: its values by path, the times of its states, and curves with their gaps."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..bag import Array, Bag, RecordedMachine, has_stamps, stacks, stamps_s
from ..bag.events import RecordedEvent, events
from ..bag.fields import field_value, leaf_names
from ..bag.stamps import Clock
from ..bag.states import Visit, visits
from ..bag.violations import Violation, violations
from ..cli import Progress
from ..errors import BagError
from .panels import Curve
from .rotation import euler_deg, unjoined
from .series import Gaps
from .signals import ACTUATORS, FRAME_FIELDS, PARTS_OF_A_RUN, STALE, Catalogue, Signals, Value, signals_of
from .views import Views, views_or_remark

_HEALTH, _TICK = "health", "tick"
#: Name of the signals of the machine itself.
MACHINE = "machine"


@dataclass(frozen=True)
class Span:
    """A time in which the machine was in one state."""

    state: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class Rows:
    """The messages of one topic: stamps in s, shape (N,); fields of shape (N,) or (N, count)."""

    t_s: Array
    fields: dict[str, Array]


class RecordedRun:
    """One machine of a bag and the plant around it. Raises BagError.

    `machine` selects one of several; `truth` is the plant's topic, by default every topic below /<namespace>/sim/. With
    `foreign` other topics have values, too, with paths like `/imu/data:angular_velocity.x`; the bag may then be without
    a machine. `time` chooses their clock (bag/stamps.py), which is `clock` when they were read. `spans` are the visits to
    states; `states` their names in order of first appearance.
    """

    def __init__(self, bag: Bag, machine: str = "", truth: str = "", foreign: bool = False, time: str = ""):
        self.bag = bag
        self.clock: Clock | None = None
        self._time = time
        self.machine: RecordedMachine | None = None
        self.signals: list[Signals] = []
        if bag.machines() or machine or not foreign:
            self.machine = bag.machine(machine)
            self.signals = self._of_machine(self.machine, truth)
        self.spans = _spans(visits(bag, self.machine)) if self.machine else []
        if foreign:
            self.signals += self._others()
        self.catalogue = Catalogue(self.signals)

    def views(self) -> tuple[Views | None, str]:
        """What the recording chooses for its pictures, or None; and a remark if that is not valid."""
        return views_or_remark(self.bag.views(self.machine)) if self.machine else (None, "")

    @property
    def name(self) -> str:
        return self.machine.name if self.machine else ""

    @cached_property
    def violations(self) -> list[Violation]:
        """Of the requirements of the machine."""
        return violations(self.bag, self.machine, round(self.spans[-1].end_s * 1e9)) if self.machine else []

    @cached_property
    def events(self) -> list[RecordedEvent]:
        """That the algorithms of the machine reported."""
        return events(self.bag, self.machine) if self.machine else []

    @property
    def states(self) -> list[str]:
        return list(dict.fromkeys(span.state for span in self.spans))

    def _of_machine(self, machine: RecordedMachine, truth: str) -> list[Signals]:
        plant = plant_topics(self.bag, machine, truth)
        own = {**machine.outputs, **machine.fields}
        return [
            *(signals_in(self.bag, topic, name_of_plant(topic), True) for topic in plant),
            *(signals_in(self.bag, topic, name, False) for name, topic in own.items()),
            Signals(MACHINE, machine.state, False, {"state": 0}, steps=frozenset({"state"})),
        ]

    def _others(self) -> list[Signals]:
        own = self.machine.prefix + "/" if self.machine else None
        taken = {signals.topic for signals in self.signals}
        names = [n for n in self.bag.topics if n not in taken and (own is None or not n.startswith(own))]
        return [_foreign(self.bag, name) for name in names if self.bag.topics[name].count]

    # ---- values ----------------------------------------------------------------------------------------------

    def read(self, values: Iterable[Value]) -> dict[str, Rows]:
        """The chosen fields by topic, in one pass over the bag. Numbers of instances that did not run are NaN.

        Where ticks are missing in the bag, a row of NaN ends the curves.
        """
        wanted: dict[str, set[str]] = {}
        for value in values:
            wanted.setdefault(value.signals.topic, set()).add(value.field)
        by_topic = {its.topic: its for its in self.signals}
        states = {topic: self._states() for topic in wanted if self.machine and topic == self.machine.state}
        wanted = {topic: fields for topic, fields in wanted.items() if topic not in states}
        healths = {topic: self._health_topic(by_topic[topic]) for topic in wanted}
        rows = self._rows({**wanted, **{topic: set() for topic in healths.values() if topic not in wanted and topic}})
        return states | {
            topic: self._with_gaps(by_topic[topic], rows, healths[topic], fields) for topic, fields in wanted.items()
        }

    def constants(self) -> set[str]:
        """Paths of the machine's and the plant's outputs that do not change."""
        outputs = {its.topic: its for its in self.signals if its.part == "outputs"}
        first: dict[str, Array] = {}
        changed = set[str]()
        for topic, some in stacks(self.bag, outputs):
            begin = first.setdefault(topic, some[:1])
            for name in outputs[topic].sizes:
                path = outputs[topic].path(name)
                if path not in changed and np.any((some[name] != begin[name]) & (some[name] == some[name])):
                    changed.add(path)
        return {its.path(name) for its in outputs.values() for name in its.sizes} - changed

    def _states(self) -> Rows:
        """The state as its number in `states`, at the beginning and at the end of each visit."""
        t_s = np.array([t for span in self.spans for t in (span.start_s, span.end_s)])
        numbers = np.repeat([float(self.states.index(span.state)) for span in self.spans], 2)
        return Rows(t_s, {"state": numbers})

    def _health_topic(self, signals: Signals) -> str:
        """The topic that says when the values of `signals` are stale; empty where nothing does."""
        if signals.truth or self.machine is None or signals.part not in PARTS_OF_A_RUN:
            return ""
        topic = self.machine.outputs.get(signals.owner, "")
        return topic if topic and _HEALTH in self.bag.fixed_layout(topic).leaves else ""

    def _rows(self, wanted: dict[str, set[str]]) -> dict[str, Rows]:
        """All messages of the topics: those of the machine and its plant as arrays, others one by one."""
        own = {signals.topic for signals in self.signals if not signals.name.startswith("/")}
        fixed = own & wanted.keys()
        parts: dict[str, list[Array]] = {topic: [] for topic in fixed}
        for topic, some in stacks(self.bag, fixed):
            parts[topic].append(some)
        rows = {}
        for topic in fixed:
            layout = self.bag.fixed_layout(topic)
            all_rows = np.concatenate(parts[topic]) if parts[topic] else np.empty(0, layout.dtype)
            fields = {name: all_rows[name] for name in (*wanted[topic], _HEALTH, _TICK) if name in layout.leaves}
            rows[topic] = Rows(stamps_s(all_rows), fields)
        return rows | self._decoded({topic: wanted[topic] for topic in wanted.keys() - fixed})

    def _decoded(self, wanted: dict[str, set[str]]) -> dict[str, Rows]:
        """Topics whose messages may vary in size. Arrays that differ in size from the first are NaN."""
        times: dict[str, list[float]] = {topic: [] for topic in wanted}
        found: dict[str, dict[str, list[Any]]] = {t: {name: [] for name in names} for t, names in wanted.items()}
        progress = Progress("reading", sum(self.bag.topics[t].count for t in wanted))
        clock = self.clock = Clock(self.bag, wanted, self._time) if wanted else None
        for done, (topic, log_ns, data) in enumerate(self.bag.messages(wanted) if wanted else ()):
            progress.at(done)
            time_ns = clock.time_ns(topic, log_ns, data) if clock else None
            if time_ns is None:
                continue
            message = self.bag.decode(topic, data)
            times[topic].append(time_ns * 1e-9)
            for name, numbers in found[topic].items():
                numbers.append(field_value(self.bag.topic(topic), message, name))
        rows = {}
        for topic in wanted:
            t_s = np.array(times[topic], dtype=np.float64)
            order = np.argsort(t_s, kind="stable")  # stamps may be out of order
            rows[topic] = Rows(t_s[order], {name: _alike(numbers)[order] for name, numbers in found[topic].items()})
        return rows

    def _with_gaps(self, signals: Signals, rows: dict[str, Rows], health_topic: str, fields: set[str]) -> Rows:
        mine = rows[signals.topic]
        stale = _stale(mine.t_s, rows[health_topic]) if health_topic else np.zeros(len(mine.t_s), dtype=bool)
        shown = {}
        for name in fields:
            shown[name] = mine.fields[name].astype(np.float64)
            if not signals.is_health(name):
                shown[name][stale] = np.nan
        if _TICK not in mine.fields and not signals.truth:
            return Rows(mine.t_s, shown)
        return Rows(*Gaps().insert(mine.t_s, mine.fields.get(_TICK, mine.t_s), shown))


def curve(rows: dict[str, Rows], wanted: Curve) -> tuple[Array, Array]:
    """(t_s, values) of a curve, float64 of shape (N,); NaN in gaps."""
    its = rows[wanted.value.signals.topic]
    values, first = its.fields[wanted.value.field], wanted.value.first
    if wanted.angle is not None:
        return its.t_s, unjoined(euler_deg(values[:, first : first + 4])[:, wanted.angle])
    return its.t_s, values if wanted.element is None else values[:, wanted.element]


def plant_topics(bag: Bag, machine: RecordedMachine, truth: str) -> list[str]:
    """The topics of the plant around a machine that can be shown; where `truth` is given, it alone and what actuators got."""
    prefix = machine.prefix.rsplit("/", 1)[0] + "/sim/"
    if truth:
        return list(dict.fromkeys([bag.topic(truth).name, *({prefix + ACTUATORS} & bag.topics.keys())]))
    layouts = {topic: bag.layout(topic) for topic in bag.topics if topic.startswith(prefix)}
    return [topic for topic, layout in layouts.items() if layout is not None and has_stamps(layout)]


def name_of_plant(topic: str) -> str:
    """The model's name, which is the last part of its topic."""
    return topic.rsplit("/", 1)[-1]


def signals_in(bag: Bag, topic: str, name: str, truth: bool) -> Signals:
    """The signals of a topic of a machine or its plant. Raises BagError if its messages vary in size."""
    layout = bag.layout(topic)
    if layout is None or not has_stamps(layout):
        raise BagError(
            f"{bag.path}: topic `{topic}` [{bag.topic(topic).type}] cannot be shown: no header or no fixed size"
        )
    return signals_of(name, topic, truth, layout, bag.topic(topic).schema)


def _foreign(bag: Bag, topic: str) -> Signals:
    """The numbers of a topic that is none of the machine's. A topic that cannot be read has none."""
    try:
        layout = bag.layout(topic)
        if layout is not None:
            return signals_of(topic, topic, False, layout, "")
        message = bag.decode(topic, next(data for _, _, data in bag.messages({topic})))
    except (BagError, StopIteration):
        return Signals(topic, topic, False, {})
    sizes: dict[str, int] = {}
    for name in leaf_names(message):
        numbers = np.asarray(field_value(bag.topic(topic), message, name))
        if name not in FRAME_FIELDS and numbers.dtype.kind in "biuf" and numbers.ndim <= 1:
            sizes[name] = len(numbers) if numbers.ndim else 0
    return Signals(topic, topic, False, sizes)


def _alike(numbers: list[Any]) -> Array:
    """The values as one float64 array with a row each."""
    shape = np.shape(numbers[0]) if numbers else ()
    return np.array([n if np.shape(n) == shape else np.full(shape, np.nan) for n in numbers], dtype=np.float64)


def _stale(t_s: Array, outputs: Rows) -> Array:
    """Whether the instance was stale at each of the times, by the newest of its healths up to then."""
    stale: Array = outputs.fields[_HEALTH] == STALE
    if np.array_equal(t_s, outputs.t_s):
        return stale
    newest = np.searchsorted(outputs.t_s, t_s, side="right") - 1
    return stale[np.maximum(newest, 0)] if len(stale) else np.zeros(len(t_s), dtype=bool)


def _spans(there: list[Visit]) -> list[Span]:
    """State intervals by tick stamps; each ends where the next begins, the last with its tick."""
    ends = [visit.start_ns for visit in there[1:]] + [there[-1].end_ns]
    return [Span(v.state, v.start_ns * 1e-9, end * 1e-9) for v, end in zip(there, ends, strict=True)]
