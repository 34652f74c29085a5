# SPDX-License-Identifier: Apache-2.0
"""The vehicle in 3D. Pose and thrust are identified in the signals by name, size and unit:

    position   an array of 3 in m named pos or position; else scalars pos_x, pos_y and the altitude (signals.ALTITUDE) as z.
               The plant's, if there is truth, else the first instance's.
    attitude   an array of 4 named q, quat, quaternion, attitude or orientation, scalar first: the plant's, else that of the
               instance with the position, else the first. Without a position every attitude is shown separately.
    thrust     arrays of 3 in N named thrust or force: an arrow in body axes, in the direction of the force. Else the last
               instance's throttle or thrust: an arrow out of the engine, in the direction of the exhaust.
The longest arrow so far has length ARROW_M; throttles without a unit are fractions of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import rerun as rr

from ..bag import Array
from .lines import TIMELINE, times
from .signals import ALTITUDE, FORCE, POSITION, THROTTLE, Signals, named, quaternions

ROOT = "world"
#: Length of the longest arrow, metres.
ARROW_M = 4.0
_BODY_COLOUR = (214, 214, 220)
_LEG_COLOUR = (120, 120, 128)
_FLAME_COLOUR = (255, 140, 0)
_FORCE_COLOUR = (255, 80, 60)
_TRAIL_COLOUR = (70, 130, 200)
_MARKER_COLOUR = (255, 210, 80)
#: The trail gets a point after this time, in s, if the vehicle has moved by this distance, in m.
_TRAIL_S, _TRAIL_M = 0.05, 0.05
#: Distance between attitudes that are shown separately, in m.
_APART_M = 2.5


@dataclass(frozen=True)
class _Thrust:
    signals: Signals
    field: str
    entity: str
    #: An array of 3 in body axes; otherwise a scalar along the body's axis.
    vector: bool
    #: The value of a full-length arrow, if known in advance.
    full: float


class World:
    """Poses of one run, logged batch by batch. `colour_of` gives the colour of an instance's lines (RGBA)."""

    def __init__(
        self, stream: rr.RecordingStream, signals: Sequence[Signals], colour_of: Callable[[Signals], Sequence[int]]
    ):
        self._stream, self._colour_of = stream, colour_of
        self._position = _find_position(signals)
        self._attitudes = _find_attitudes(signals, self._position)
        self._thrusts = _find_thrusts(signals, self.vehicle) if self.vehicle else []
        self._largest: dict[str, float] = {}
        self._last: Array | None = None
        self._last_s = -np.inf
        #: The poses of the last batch, which give the position at a time.
        self._when: Array = np.zeros(1)
        self._where: Array = np.zeros((1, 3))
        if self:
            stream.log(ROOT, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
            self._set_up()

    def __bool__(self) -> bool:
        """Whether there is anything to show in 3D."""
        return bool(self._position or self._attitudes)

    @property
    def vehicle(self) -> str:
        """The entity of the vehicle with a position; empty if there is none."""
        return f"{ROOT}/{self._position[0].name}" if self._position else ""

    @property
    def guide(self) -> str:
        """The topic with the vehicle's position; empty if there is none."""
        return self._position[0].topic if self._position else ""

    def reach(self, columns: Mapping[str, Array]) -> float:
        """The largest height or distance of the vehicle in rows of `guide`, in m."""
        if self._position is None:
            return 0.0
        far = np.abs(_positions(columns, self._position[1]))
        return float(np.max(far, initial=0.0, where=np.isfinite(far)))

    # ---- static data -----------------------------------------------------------------------------------------

    def _set_up(self) -> None:
        if self._position:
            self._vehicle_body()
        else:
            for number, (signals, name) in enumerate(self._attitudes):
                self._box(number, signals, name)
        for thrust in self._thrusts:
            colour, origin = (_FORCE_COLOUR, [0, 0, 1.9]) if thrust.vector else (_FLAME_COLOUR, [0, 0, 1.1])
            look = rr.Arrows3D.from_fields(origins=[origin], radii=[0.2], colors=[colour])
            self._stream.log(thrust.entity, look, static=True)

    def _vehicle_body(self) -> None:
        """A body of about 3 m, standing on its origin on four legs."""
        entity = f"{self.vehicle}/body"
        body = rr.Cylinders3D(
            lengths=[1.6], radii=[1.0], centers=[[0, 0, 1.9]], colors=[_BODY_COLOUR], fill_mode="solid"
        )
        self._stream.log(entity, body, static=True)
        feet = [[1.8 * np.cos(a), 1.8 * np.sin(a), 0.0] for a in np.arange(4) * np.pi / 2 + np.pi / 4]
        legs = [[[foot[0] / 2, foot[1] / 2, 1.4], foot] for foot in feet]
        self._stream.log(f"{entity}/legs", rr.LineStrips3D(legs, radii=0.08, colors=[_LEG_COLOUR]), static=True)

    def _box(self, number: int, signals: Signals, name: str) -> None:
        entity = f"{ROOT}/{signals.name}/{name}"
        colour = self._colour_of(signals)
        box = rr.Boxes3D(half_sizes=[[0.5, 0.3, 0.12]], colors=[colour], fill_mode="solid")
        self._stream.log(f"{entity}/body", box, static=True)
        self._stream.log(f"{entity}/body", rr.TransformAxes3D(1.0), static=True)
        place = [0.0, _APART_M * number, 1.1]
        label = rr.Points3D([place], labels=[f"{signals.name}.{name}"], colors=[colour], radii=0.01, show_labels=True)
        self._stream.log(f"{ROOT}/labels/{signals.name}/{name}", label, static=True)

    # ---- data over time --------------------------------------------------------------------------------------

    def move(self, signals: Signals, t_s: Array, columns: Mapping[str, Array]) -> None:
        """Logs the pose and thrust of a topic at the times t_s; rows with NaN are skipped."""
        if self._position and signals is self._position[0]:
            self._translate(t_s, _positions(columns, self._position[1]))
        for number, (who, name) in enumerate(self._attitudes):
            if who is signals:
                self._rotate(number, t_s, columns[name], f"{ROOT}/{who.name}/{name}")
        for thrust in self._thrusts:
            if thrust.signals is signals:
                self._push(thrust, t_s, columns[thrust.field])

    def _send(self, entity: str, t_s: Array, columns: rr.ComponentColumnList) -> None:
        self._stream.send_columns(entity, indexes=[rr.TimeColumn(TIMELINE, duration=times(t_s))], columns=columns)

    def _translate(self, t_s: Array, position: Array) -> None:
        known = np.isfinite(position).all(axis=1)
        t_s, position = t_s[known], position[known]
        if not len(t_s):
            return
        self._send(self.vehicle, t_s, rr.Transform3D.columns(translation=position))
        self._when, self._where = t_s, position
        times, strips = [], []
        for time, point in zip(t_s.tolist(), position, strict=True):
            if self._last is None:
                self._last, self._last_s = point, time
            elif time - self._last_s >= _TRAIL_S and np.linalg.norm(point - self._last) >= _TRAIL_M:
                times.append(time)
                strips.append(np.array([self._last, point], dtype=np.float32))
                self._last, self._last_s = point, time
        if times:
            looks = {"radii": np.full(len(times), 0.06), "colors": np.tile([*_TRAIL_COLOUR, 255], (len(times), 1))}
            self._send(f"{ROOT}/trail", np.array(times), rr.LineStrips3D.columns(strips=strips, **looks))

    def _rotate(self, number: int, t_s: Array, q: Array, alone: str) -> None:
        known = np.isfinite(q).all(axis=1)
        xyzw = np.roll(q[known], -1, axis=1).astype(np.float32)
        if not len(xyzw):
            return
        if self._position:
            self._send(f"{self.vehicle}/body", t_s[known], rr.Transform3D.columns(quaternion=xyzw))
        else:
            beside = np.tile([0.0, _APART_M * number, 0.0], (len(xyzw), 1))
            self._send(alone, t_s[known], rr.Transform3D.columns(quaternion=xyzw, translation=beside))

    def _push(self, thrust: _Thrust, t_s: Array, values: Array) -> None:
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        vectors = values if thrust.vector else np.outer(values, [0.0, 0.0, -1.0])
        lengths = np.linalg.norm(vectors, axis=1)
        full = thrust.full or max(self._largest.get(thrust.entity, 0.0), float(lengths.max(initial=0.0)))
        self._largest[thrust.entity] = full
        # An arrow of length zero would still show its head.
        shown = vectors * (ARROW_M / full if full > 0 else 0.0)
        arrows = rr.Arrows3D.columns(vectors=shown.astype(np.float32))
        self._send(thrust.entity, t_s, arrows)

    def mark(self, t_s: float, number: int, text: str) -> None:
        """A labelled point at the vehicle's position at t_s, from the last batch."""
        if not self._position:
            return
        self._stream.set_time(TIMELINE, duration=times(t_s))
        where = self._where[min(int(np.searchsorted(self._when, t_s)), len(self._when) - 1)]
        point = rr.Points3D([where], radii=0.25, colors=[_MARKER_COLOUR], labels=[text], show_labels=True)
        self._stream.log(f"{ROOT}/transitions/{number}", point)


def _find_position(signals: Sequence[Signals]) -> tuple[Signals, tuple[str, ...]] | None:
    """The topic with the vehicle's position, and its fields: one array, or the scalars x, y, z ("" for a missing one)."""
    arrays = named(signals, POSITION, 3)
    if arrays:
        return arrays[0][0], (arrays[0][1],)
    altitudes = named(signals, ALTITUDE)
    if not altitudes:
        return None
    source, altitude = altitudes[0]
    axes = [name if source.sizes.get(name) == 0 else "" for name in ("pos_x", "pos_y")]
    return source, (*axes, altitude)


def _positions(columns: Mapping[str, Array], fields: tuple[str, ...]) -> Array:
    """Shape (N, 3)."""
    if len(fields) == 1:
        return columns[fields[0]]
    rows = len(columns[fields[2]])
    return np.stack([columns[name] if name else np.zeros(rows) for name in fields], axis=1)


def _find_attitudes(
    signals: Sequence[Signals], position: tuple[Signals, tuple[str, ...]] | None
) -> list[tuple[Signals, str]]:
    found = quaternions(signals)
    if position is None:
        return found
    # In order of preference: the plant's, that of the topic with the position, any.
    return sorted(found, key=lambda pair: (not pair[0].truth, pair[0] is not position[0]))[:1]


def _find_thrusts(signals: Sequence[Signals], vehicle: str) -> list[_Thrust]:
    vectors = [pair for pair in named(signals, FORCE, 3) if "N" in pair[0].units.get(pair[1], "")]
    if vectors:
        return [_Thrust(s, name, f"{vehicle}/body/{s.name}/{name}", True, 0.0) for s, name in vectors]
    throttles = [pair for pair in named(signals, THROTTLE) if not pair[0].truth]
    if not throttles:
        return []
    source, name = throttles[-1]
    return [_Thrust(source, name, f"{vehicle}/body/thrust", False, 0.0 if name in source.units else 1.0)]
