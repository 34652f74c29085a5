# SPDX-License-Identifier: Apache-2.0
"""Shows a run in the rerun viewer and defines its entities, for bags, live nodes and telemetry.

Entities have the names of the topics. Their timeline is `sim_time`, the stamps:
    /<ns>/<machine>/<instance>/<output>     lines; an array is one entity with a line per element
    /<ns>/<machine>/<instance>/health       lanes: nominal, degraded, failed, stale
    /<ns>/<machine>/<instance>/inputs/<input>   lines; the same with parameters, state, counters, if present
    /<ns>/<machine>/state                   lanes: the states; below it `step`, their numbers as a step plot
    /<ns>/<machine>/transitions             a log of changes of state; below it `marker`, a point for each on the step plot
    /<ns>/<machine>/health                  a log of instances that degrade, fail, recover
    /<ns>/<machine>/telemetry               a log of the receiver: sessions, gaps
    /<ns>/sim/<instance>/<output>           the plant's truth
    /world/…                                the vehicle in 3D (world.py)
Values of a stale instance are left out, because they are old. Lines and lanes have a gap where values are unknown.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import rerun as rr

from ..bag import Array
from ..bag.states import StateSample
from .lines import TIMELINE, send_lines, times
from .signals import HEALTH, STALE, UNKNOWN, Signals, quaternions, raw_instance
from .summary import ANGLES, euler_deg
from .world import World

_STATE_COLOURS = (0x4C8FD0FF, 0x6FB560FF, 0xE39A3BFF, 0x9A7FC4FF, 0xB8AC3EFF, 0xD9606BFF, 0x5FB8B8FF, 0xC08A5AFF)
_HEALTH_COLOURS = (0x3FA65AFF, 0xE3B341FF, 0xE5484DFF, 0x55595FFF)
_HEALTH_LEVELS = ("INFO", "WARN", "ERROR")
_TRUTH_COLOUR = [225, 45, 70, 255]
_RAW_COLOUR = [130, 130, 140, 160]
_STEP_COLOUR = [160, 170, 190, 255]
_MARKER_COLOUR = [255, 210, 80, 255]
#: Distinguishable with colour blindness (after Okabe and Ito), on dark and light backgrounds; likewise the truth's
#: colour.
LINE_COLOURS = (
    [86, 180, 233, 255],
    [230, 159, 0, 255],
    [0, 190, 140, 255],
    [230, 120, 180, 255],
    [205, 185, 30, 255],
    [213, 94, 0, 255],
    [120, 140, 255, 255],
)
_NS = 1_000_000_000


@dataclass(frozen=True)
class Cast:
    """The shown topics of a run: the machine's begin with `prefix`; `states` are in the order of their colours.

    `signals` are outputs of instances and the plant; `inside` are their other values: `nav.inputs`, `nav.state`.
    """

    prefix: str
    signals: Sequence[Signals]
    states: Sequence[str]
    inside: Sequence[Signals] = ()

    @property
    def instances(self) -> list[Signals]:
        return [signals for signals in self.signals if not signals.truth]

    @property
    def plant(self) -> list[Signals]:
        return [signals for signals in self.signals if signals.truth]


def angle_entity(signals: Signals, name: str, angle: str) -> str:
    """The entity of an Euler angle of the quaternion `name`; angles are easier to read than elements."""
    return f"{signals.topic}/{name}/{angle}_deg"


@dataclass
class _Logged:
    """The values logged last, for entities that log only changes."""

    state: str = ""
    #: The state of the lane; "" in a gap.
    lane: str = ""
    transitions: int = 0
    health: dict[str, int] = field(default_factory=dict)


class Scene:
    """Logs one run to one stream, batch by batch, in time order within each topic."""

    def __init__(self, stream: rr.RecordingStream, cast: Cast):
        self.cast = cast
        self._stream = stream
        self._logged = _Logged()
        self._by_topic = {signals.topic: signals for signals in (*cast.signals, *cast.inside)}
        self._quaternions = {(s.topic, name) for s, name in quaternions(cast.signals)}
        self._raw = raw_instance(cast.signals)
        #: Topics whose `health` is that of the instance and not an ordinary value.
        self._healthy = {signals.topic for signals in cast.instances}
        self._numbers = {signals.name: number for number, signals in enumerate(cast.instances)}
        self.world = World(stream, cast.signals, lambda signals: self._line_style(signals)[0])
        self._set_up()

    # ---- static data -----------------------------------------------------------------------------------------

    def _set_up(self) -> None:
        for signals in self._by_topic.values():
            for name, size in signals.sizes.items():
                if name != "health" or signals.topic not in self._healthy:
                    self._style_lines(signals, name, size)
        prefix, states = self.cast.prefix, list(self.cast.states)
        colours = np.resize(np.array(_STATE_COLOURS, dtype=np.uint32), len(states))
        self._static(f"{prefix}/state", rr.StateConfiguration(values=states, colors=colours))
        legend = ", ".join(f"{number} {state}" for number, state in enumerate(states))
        step = rr.components.InterpolationMode.StepAfter
        self._static(
            f"{prefix}/state/step",
            rr.SeriesLines(names=[legend], colors=[_STEP_COLOUR], widths=[2.0], interpolation_mode=step),
        )
        self._static(
            f"{prefix}/transitions/marker",
            rr.SeriesPoints(names=["transition"], colors=[_MARKER_COLOUR], markers=["diamond"], marker_sizes=[6.0]),
        )
        health = rr.StateConfiguration(values=HEALTH, colors=np.array(_HEALTH_COLOURS, dtype=np.uint32))
        for signals in self.cast.instances:
            self._static(f"{signals.topic}/health", health)

    def _style_lines(self, signals: Signals, name: str, size: int) -> None:
        colour, width = self._line_style(signals)
        label = f"{signals.name}.{name}"
        unit = f", {signals.units[name]}" if name in signals.units else ""
        lines = max(1, size)
        names = [f"{label}[{i}]{unit}" for i in range(size)] or [label + unit]
        colours = [LINE_COLOURS[i % len(LINE_COLOURS)] for i in range(size)] or [colour]
        self._static(f"{signals.topic}/{name}", rr.SeriesLines(names=names, colors=colours, widths=[width] * lines))
        for angle in ANGLES if (signals.topic, name) in self._quaternions else ():
            look = rr.SeriesLines(names=[label], colors=[colour], widths=[width])
            self._static(angle_entity(signals, name, angle), look)

    def _line_style(self, signals: Signals) -> tuple[list[int], float]:
        """Colour (RGBA) and width of lines. Truth is drawn last, thin, so that what it covers stays visible."""
        if signals.truth:
            return _TRUTH_COLOUR, 1.0
        if signals.name == self._raw:
            return _RAW_COLOUR, 1.0
        # Inner values of an instance have its colour.
        number = self._numbers.get(signals.name.partition(".")[0], 0)
        return LINE_COLOURS[number % len(LINE_COLOURS)], 2.5

    def _static(self, entity: str, archetype: rr.AsComponents) -> None:
        self._stream.log(entity, archetype, static=True)

    # ---- data over time --------------------------------------------------------------------------------------

    def outputs(self, topic: str, t_s: Array, columns: Mapping[str, Array]) -> None:
        """Logs values of a topic at the times t_s, float64 of shape (N,); its fields of shape (N,) or (N, count).

        In rows without known values, numbers are NaN and `health` is negative.
        """
        signals = self._by_topic[topic]
        health = columns.get("health") if topic in self._healthy else None
        stale = None if health is None else health == STALE
        shown: dict[str, Array] = {}
        lines: dict[str, Array] = {}
        for name in signals.sizes:
            if name == "health" and health is not None:
                self._health(signals, t_s, health)
                continue
            shown[name] = values = columns[name].astype(np.float64)
            if stale is not None:
                values[stale] = np.nan
            lines[f"{topic}/{name}"] = values
            if (topic, name) in self._quaternions:
                angles = euler_deg(values).T
                lines |= {angle_entity(signals, name, a): angles[i] for i, a in enumerate(ANGLES)}
        send_lines(self._stream, t_s, lines)
        self.world.move(signals, t_s, shown)

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

    def states(self, samples: Sequence[StateSample]) -> None:
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
