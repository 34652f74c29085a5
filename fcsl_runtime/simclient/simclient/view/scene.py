# SPDX-License-Identifier: Apache-2.0
"""Shows a run in the rerun viewer and defines its entities, for bags, live nodes and telemetry.

Entities have the names of the topics. Their timeline is `sim_time`, the stamps:
    /<ns>/<machine>/<instance>/<output>     lines; an array is one entity with a line per element
    /<ns>/<machine>/<instance>/health       lanes: nominal, degraded, failed, stale
    /<ns>/<machine>/<instance>/inputs/<input>   lines; the same with parameters, state, counters, if present
    /<ns>/<machine>/state                   lanes: the states; below it `step`, their numbers as a step plot
    /<ns>/<machine>/transitions             a log of changes of state; below it `marker`, a point for each on the step plot
    /<ns>/<machine>/health                  a log of instances that degrade, fail, recover
    /<ns>/<machine>/requirements            a log of requirements that are violated, and hold again (of bags)
    /<ns>/<machine>/requirements/<id>       a lane: violated
    /<ns>/<machine>/events                  a log of what algorithms report (of bags)
    /<ns>/<machine>/telemetry               a log of the receiver: sessions, gaps
    /<ns>/sim/<instance>/<output>           the plant's truth
    /world/…                                the vehicle in 3D (world.py)
A quaternion that a panel shows as angles has roll_deg, pitch_deg and yaw_deg below it. Values of a stale instance are
left out, because they are old. Lines and lanes have a gap where values are unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import rerun as rr

from ..bag import Array
from ..bag.events import RecordedEvent
from ..bag.states import StateSample
from ..bag.violations import Violation
from .lines import TIMELINE, send_lines, times
from .panels import Choice, choose_by_views, choose_default
from .rotation import ANGLES, euler_deg, unjoined
from .series import newest
from .signals import HEALTH, PARTS_OF_A_RUN, STALE, UNKNOWN, Catalogue, Signals, Value
from .styles import COLOURS, rgba
from .views import Views
from .world import Batch, World

_STATE_COLOURS = (0x4C8FD0FF, 0x6FB560FF, 0xE39A3BFF, 0x9A7FC4FF, 0xB8AC3EFF, 0xD9606BFF, 0x5FB8B8FF, 0xC08A5AFF)
_HEALTH_COLOURS = (0x3FA65AFF, 0xE3B341FF, 0xE5484DFF, 0x55595FFF)
_HEALTH_LEVELS = ("INFO", "WARN", "ERROR")
#: Of an event, as a level of rerun.
_LEVELS = {"debug": "DEBUG", "info": "INFO", "warning": "WARN", "error": "ERROR"}
_STEP_COLOUR = [160, 170, 190, 255]
_MARKER_COLOUR = [255, 210, 80, 255]
#: Width of lines outside of panels.
_WIDTH = 1.5
STEP_AFTER = rr.components.InterpolationMode.StepAfter
_NS = 1_000_000_000


@dataclass(frozen=True)
class Cast:
    """The shown topics of a run: the machine's begin with `prefix`; `states` are in the order of their colours.

    `signals` are outputs of instances and the plant; `inside` are their other values: `nav.inputs`, `nav.state`.
    `views` is what the run chooses for its pictures; `remark` says why it is not used, if it is not valid. `violations` and
    `events` are those of a recorded run.
    """

    prefix: str
    signals: Sequence[Signals]
    states: Sequence[str]
    inside: Sequence[Signals] = ()
    views: Views | None = None
    remark: str = ""
    violations: Sequence[Violation] = ()
    events: Sequence[RecordedEvent] = ()

    @cached_property
    def catalogue(self) -> Catalogue:
        return Catalogue([*self.signals, *self.inside])

    @cached_property
    def choice(self) -> Choice:
        """The panels of the first page."""
        if self.views is not None and self.views.panels:
            return choose_by_views(self.views.panels, self.catalogue)
        return choose_default(self.catalogue)

    @property
    def instances(self) -> list[Signals]:
        return [signals for signals in self.signals if not signals.truth]

    @property
    def lanes_of_requirements(self) -> dict[str, str]:
        """The entity of each requirement that was violated, by id."""
        ids = dict.fromkeys(one.id for one in self.violations)
        return {id_: f"{self.prefix}/requirements/{rr.escape_entity_path_part(id_)}" for id_ in ids}

    @property
    def plant(self) -> list[Signals]:
        return [signals for signals in self.signals if signals.truth]


def angle_entity(value: Value, angle: int) -> str:
    """The entity of an angle (index of ANGLES) of a quaternion."""
    return f"{value.signals.topic}/{value.name}/{ANGLES[angle]}_deg"


@dataclass
class _Logged:
    """The values logged last, for entities that log only changes."""

    state: str = ""
    #: The state of the lane; "" in a gap.
    lane: str = ""
    transitions: int = 0
    health: dict[str, int] = field(default_factory=dict)
    #: The newest angles, by entity.
    angles: dict[str, float] = field(default_factory=dict)


class Scene:
    """Logs one run to one stream, batch by batch, in time order within each topic."""

    def __init__(self, stream: rr.RecordingStream, cast: Cast):
        self.cast = cast
        self._stream = stream
        self._logged = _Logged()
        self._by_topic = {signals.topic: signals for signals in (*cast.signals, *cast.inside)}
        #: Quaternions that panels show as angles, by topic.
        self._quaternions: dict[str, dict[str, Value]] = {}
        for curve in (c for panel in cast.choice.panels for c in panel.curves if c.angle is not None):
            self._quaternions.setdefault(curve.value.signals.topic, {})[curve.value.path] = curve.value
        #: Times and staleness of each instance: the newest of the last batch, and this batch.
        self._stale: dict[str, tuple[Array, Array]] = {}
        self.world = World(stream, cast.views.body if cast.views else None, cast.catalogue)
        self._set_up()

    @property
    def left_out(self) -> list[str]:
        """What of the run's views is not shown, and why."""
        chosen = self.cast.choice.left_out if self.cast.views is not None and self.cast.views.panels else []
        return list(dict.fromkeys([*filter(None, [self.cast.remark]), *chosen, *self.world.remarks]))

    # ---- static data -----------------------------------------------------------------------------------------

    def _set_up(self) -> None:
        for signals in self._by_topic.values():
            for name, size in signals.sizes.items():
                if not signals.is_health(name):
                    self._style_lines(signals, name, size)
        prefix, states = self.cast.prefix, list(self.cast.states)
        colours = np.resize(np.array(_STATE_COLOURS, dtype=np.uint32), len(states))
        self._static(f"{prefix}/state", rr.StateConfiguration(values=states, colors=colours))
        legend = ", ".join(f"{number} {state}" for number, state in enumerate(states))
        self._static(
            f"{prefix}/state/step",
            rr.SeriesLines(names=[legend], colors=[_STEP_COLOUR], widths=[2.0], interpolation_mode=STEP_AFTER),
        )
        self._static(
            f"{prefix}/transitions/marker",
            rr.SeriesPoints(names=["transition"], colors=[_MARKER_COLOUR], markers=["diamond"], marker_sizes=[6.0]),
        )
        health = rr.StateConfiguration(values=HEALTH, colors=np.array(_HEALTH_COLOURS, dtype=np.uint32))
        for signals in self.cast.instances:
            self._static(f"{signals.topic}/health", health)
        self._violations()
        for event in self.cast.events:
            level = _LEVELS[event.severity]
            self._event(f"{prefix}/events", event.stamp_ns / _NS, rr.TextLog(str(event), level=level))

    def _violations(self) -> None:
        """Logs when requirements were violated, and when they held again."""
        lanes, log = self.cast.lanes_of_requirements, f"{self.cast.prefix}/requirements"
        for lane in lanes.values():
            self._static(lane, rr.StateConfiguration(values=["violated"], colors=[_HEALTH_COLOURS[-2]]))
        for one in self.cast.violations:
            self._event(lanes[one.id], one.start_ns / _NS, rr.StateChange(state="violated"))
            text = f"{one.id} violated: {one.text}" + (f" ({one.values})" if one.values else "")
            self._event(log, one.start_ns / _NS, rr.TextLog(text, level="ERROR"))
            if one.ended:
                self._event(lanes[one.id], one.end_ns / _NS, rr.StateChange(state=""))
                self._event(log, one.end_ns / _NS, rr.TextLog(f"{one.id} holds again", level="INFO"))

    def _style_lines(self, signals: Signals, name: str, size: int) -> None:
        """How a field looks where a user draws it outside of the panels."""
        label = f"{signals.name}.{name}"
        unit = f", {signals.units[name]}" if name in signals.units else ""
        names = [f"{label}[{i}]{unit}" for i in range(size)] or [label + unit]
        colours = [rgba(COLOURS[i % len(COLOURS)]) for i in range(max(1, size))]
        mode = STEP_AFTER if name in signals.steps else None
        line_style = rr.SeriesLines(names=names, colors=colours, widths=[_WIDTH] * len(names), interpolation_mode=mode)
        self._static(f"{signals.topic}/{name}", line_style)

    def _static(self, entity: str, archetype: rr.AsComponents) -> None:
        self._stream.log(entity, archetype, static=True)

    # ---- data over time --------------------------------------------------------------------------------------

    def show(self, values: Batch, samples: Sequence[StateSample] = ()) -> None:
        """Logs values by topic at their times, and changes of the machine's state.

        In rows without known values, numbers are NaN and the health of an instance is negative.
        """
        for topic, (t_s, columns) in values.items():
            signals = self._by_topic[topic]
            if signals.is_health("health") and "health" in columns:
                self._remember(signals, t_s, columns["health"])
                self._health(signals, t_s, columns["health"])
        shown = {topic: (t_s, self._lines(topic, t_s, columns)) for topic, (t_s, columns) in values.items()}
        # Before the states, so that the vehicle's position at a transition is known.
        self.world.move(shown)
        self._states(samples)

    def _remember(self, signals: Signals, t_s: Array, health: Array) -> None:
        before_s, before = self._stale.get(signals.owner, (np.empty(0), np.empty(0, dtype=bool)))
        self._stale[signals.owner] = np.r_[before_s[-1:], t_s], np.r_[before[-1:], health == STALE]

    def _lines(self, topic: str, t_s: Array, columns: Mapping[str, Array]) -> dict[str, Array]:
        """Logs the lines of a topic; returns their values, with NaN where the instance was stale."""
        signals = self._by_topic[topic]
        stale = self._stale.get(signals.owner) if signals.part in PARTS_OF_A_RUN and not signals.truth else None
        is_old = newest(*stale, t_s) == 1.0 if stale is not None else None
        shown: dict[str, Array] = {}
        for name in signals.sizes:
            if signals.is_health(name):
                continue
            shown[name] = values = columns[name].astype(np.float64)
            if is_old is not None:
                values[is_old] = np.nan
        lines = {f"{topic}/{name}": values for name, values in shown.items()}
        for value in self._quaternions.get(topic, {}).values():
            angles = euler_deg(shown[value.field][:, value.first : value.first + value.lines]).T
            lines |= {angle_entity(value, i): self._unjoined(angle_entity(value, i), a) for i, a in enumerate(angles)}
        send_lines(self._stream, t_s, lines)
        return shown

    def _unjoined(self, entity: str, angles_deg: Array) -> Array:
        """`unjoined` behind the last angle of the batch before."""
        last = self._logged.angles.get(entity, np.nan)
        self._logged.angles[entity] = float(angles_deg[-1]) if len(angles_deg) else last
        return unjoined(np.r_[last, angles_deg])[1:]

    def _health(self, signals: Signals, t_s: Array, health: Array) -> None:
        """Logs changes only: all as lanes; changes to worse healths and recoveries also as a log."""
        last = self._logged.health.get(signals.topic, UNKNOWN)
        changes = np.flatnonzero(np.diff(health.astype(np.int64), prepend=last))
        if not len(changes):
            return
        # An empty name ends a lane.
        names = ["" if h < 0 else HEALTH[h] if h < len(HEALTH) else str(h) for h in health[changes].tolist()]
        lanes = rr.StateChange.columns(state=names)
        at_changes = rr.TimeColumn(TIMELINE, duration=times(t_s[changes]))
        self._stream.send_columns(f"{signals.topic}/health", indexes=[at_changes], columns=lanes)
        for at in changes.tolist():
            now = int(health[at])
            if 0 <= now < STALE and (now > 0 or 0 < last < STALE):
                text = rr.TextLog(f"{signals.name}: {HEALTH[now]}", level=_HEALTH_LEVELS[now])
                self._event(f"{self.cast.prefix}/health", float(t_s[at]), text)
            last = now
        self._logged.health[signals.topic] = last

    def _states(self, samples: Sequence[StateSample]) -> None:
        """Logs changes of the machine's state; the first one as the start.

        An empty state ends the lane: unknown from here on.
        """
        prefix = self.cast.prefix
        for sample in samples:
            if sample.state == self._logged.lane:
                continue
            t_s, number = sample.time_ns / _NS, self._number(sample.state)
            self._logged.lane = sample.state
            self._event(f"{prefix}/state", t_s, rr.StateChange(state=sample.state))
            self._event(f"{prefix}/state/step", t_s, rr.Scalars(number))
            if sample.state in ("", self._logged.state):
                continue
            text = f"starts in {sample.state}"
            if self._logged.state:
                text = f"{self._logged.state} → {sample.state}"
                self._logged.transitions += 1
                self._event(f"{prefix}/transitions/marker", t_s, rr.Scalars(number))
                self.world.mark(t_s, self._logged.transitions, sample.state)
            self._event(f"{prefix}/transitions", t_s, rr.TextLog(text, level="INFO"))
            self._logged.state = sample.state

    def _number(self, state: str) -> float:
        return float(list(self.cast.states).index(state)) if state in self.cast.states else np.nan

    def note(self, t_s: float, text: str, level: str = "INFO") -> None:
        """Logs a remark about the reception of the run."""
        self._event(f"{self.cast.prefix}/telemetry", t_s, rr.TextLog(text, level=level))

    def until(self, t_s: float) -> None:
        """Extends the step plot to this time, because a line needs an end."""
        if self._logged.lane in self.cast.states:
            self._event(f"{self.cast.prefix}/state/step", t_s, rr.Scalars(self._number(self._logged.lane)))

    def _event(self, entity: str, t_s: float, archetype: rr.AsComponents) -> None:
        self._stream.set_time(TIMELINE, duration=times(t_s))
        self._stream.log(entity, archetype)
