# SPDX-License-Identifier: Apache-2.0
"""The vehicle in 3D: the `body` of the run's views, its trail, its thrust, and a marker for each transition.

The longest thrust so far has an arrow of ARROW sizes of the body; thrusts without a unit are fractions of it.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import rerun as rr

from ..bag import Array
from .body import TOPS, log_body
from .lines import TIMELINE, times
from .series import newest
from .signals import Catalogue, Value
from .views import Body

ROOT = "world"
VEHICLE, ATTITUDE = f"{ROOT}/vehicle", f"{ROOT}/vehicle/body"
#: In sizes of the body: length of the longest arrow, radii, and how far it moves between two points of its trail.
ARROW = 1.3
_ARROW_RADIUS, _TRAIL_RADIUS, _MARKER_RADIUS, _TRAIL_STEP = 0.03, 0.02, 0.08, 0.02
_TRAIL_S = 0.05
#: Size of a vehicle that is not to be seen. rerun ignores a scale of zero, and draws the vehicle.
_VANISHED = 1e-9
_FORCE_COLOUR = (255, 80, 60)
_TRAIL_COLOUR = (70, 130, 200)
_MARKER_COLOUR = (255, 210, 80)

#: Times in s, shape (N,), and fields of shape (N,) or (N, count), by topic; NaN where they are not known.
Batch = Mapping[str, tuple[Array, Mapping[str, Array]]]


class World:
    """Poses of one run, logged batch by batch. Without a body, or without what it needs, nothing is shown.

    `remarks` say what of the body cannot be shown, and why.
    """

    def __init__(self, stream: rr.RecordingStream, body: Body | None, catalogue: Catalogue):
        self._stream, self._body, self._catalogue = stream, body, catalogue
        self.remarks: list[str] = []
        self._position = self._find_position() if body else []
        self._attitude = self._find(body.attitude, (4,)) if body else None
        self._thrust = self._find(body.thrust, (), (3,)) if body else None
        self._largest = 1.0 if self._thrust and not self._thrust.shape and not self._thrust.unit else 0.0
        self._held: dict[str, tuple[Array, Array]] = {}
        self._hidden: dict[str, bool] = {}
        self._last: Array | None = None
        self._last_s = -np.inf
        #: The positions of the last batch, which say where a transition was.
        self._when: Array = np.zeros(1)
        self._where: Array = np.zeros((1, 3))
        if self:
            self._set_up()

    def __bool__(self) -> bool:
        """Whether there is anything to show in 3D."""
        return bool(self._position or self._attitude)

    @property
    def moves(self) -> bool:
        """Whether the vehicle has a position."""
        return bool(self._position)

    @property
    def size(self) -> float:
        """Largest extent of the body, in m."""
        return self._body.size if self._body else 1.0

    @property
    def up(self) -> float:
        """1 where z points up, -1 where it points down."""
        return -1.0 if self._body and self._body.up == "-z" else 1.0

    @property
    def places(self) -> list[Value]:
        """The values that are the position."""
        return [place for place in self._position if isinstance(place, Value)]

    def _find(self, path: str, *shapes: tuple[int, ...]) -> Value | None:
        """The value of a path of the body, if it has one of these shapes."""
        if not path:
            return None
        found = self._catalogue.find(path)
        if found is None or found.shape not in shapes:
            self.remarks.append(f"{path} ({'not recorded' if found is None else 'of another shape'})")
            return None
        return found

    def _find_position(self) -> list[Value | float]:
        """One array, or three numbers, or nothing where one of them is not recorded."""
        assert self._body is not None
        wanted = self._body.position
        shape = (3,) if len(wanted) == 1 else ()
        found = [place if isinstance(place, float) else self._find(place, shape) for place in wanted]
        there = [place for place in found if place is not None]
        has_values = any(isinstance(place, Value) for place in there)
        return there if len(there) == len(wanted) and has_values else []

    def reach(self, values: Batch) -> float:
        """The largest height or distance of the vehicle in these values, in m."""
        parts = [self._of(place, values) for place in self.places]
        far = [np.abs(part[1]) for part in parts if part is not None]
        return max((float(np.max(part, initial=0.0, where=np.isfinite(part))) for part in far), default=0.0)

    # ---- static data -----------------------------------------------------------------------------------------

    def _set_up(self) -> None:
        assert self._body is not None
        coordinates = rr.ViewCoordinates.RIGHT_HAND_Z_UP if self.up > 0 else rr.ViewCoordinates.RIGHT_HAND_Z_DOWN
        self._stream.log(ROOT, coordinates, static=True)
        remark = log_body(self._stream, f"{ATTITUDE}/shape", self._body)
        if remark:
            self.remarks.append(remark)
        if self._thrust:
            top = [0.0, 0.0, self.up * TOPS[self._body.shape] * self.size]
            arrow = rr.Arrows3D.from_fields(origins=[top], radii=[_ARROW_RADIUS * self.size], colors=[_FORCE_COLOUR])
            self._stream.log(f"{ATTITUDE}/thrust", arrow, static=True)

    # ---- data over time --------------------------------------------------------------------------------------

    def move(self, values: Batch) -> None:
        """Logs pose and thrust of a batch. A vehicle whose pose is not known is hidden."""
        if self._position and (moved := self._positions(values)) is not None:
            self._translate(*moved)
        if self._attitude and (turned := self._of(self._attitude, values)) is not None:
            self._rotate(*turned)
        if self._thrust and (pushed := self._of(self._thrust, values)) is not None:
            self._push(*pushed)

    def _of(self, value: Value, values: Batch) -> tuple[Array, Array] | None:
        """Times and numbers of a value, (N,) or (N, count); None if its topic is not in the batch."""
        if value.signals.topic not in values:
            return None
        t_s, columns = values[value.signals.topic]
        numbers = columns[value.field]
        if not value.signals.sizes[value.field]:
            return t_s, numbers
        part = numbers[:, value.first : value.first + value.lines]
        return t_s, part if value.shape else part[:, 0]

    def _positions(self, values: Batch) -> tuple[Array, Array] | None:
        """Times and positions, shape (N, 3). Axes of other topics have their newest value at that time."""
        leader = self._of(self.places[0], values)
        if leader is None or len(self._position) == 1:
            return leader
        t_s, _ = leader
        axes = []
        for place in self._position:
            if isinstance(place, float):
                axes.append(np.full(len(t_s), place))
                continue
            known, own = self._held.get(place.path), self._of(place, values)
            parts = [part for part in (known, own) if part is not None]
            if own is not None:
                self._held[place.path] = own[0][-1:], own[1][-1:]
            joined = [np.concatenate(column) for column in zip(*parts, strict=True)] or [np.empty(0), np.empty(0)]
            axes.append(newest(joined[0], joined[1], t_s))
        return t_s, np.stack(axes, axis=1)

    def _send(self, entity: str, t_s: Array, columns: rr.ComponentColumnList) -> None:
        self._stream.send_columns(entity, indexes=[rr.TimeColumn(TIMELINE, duration=times(t_s))], columns=columns)

    def _translate(self, t_s: Array, position: Array) -> None:
        known: Array = np.asarray(np.isfinite(position).all(axis=1))
        self._hide(VEHICLE, t_s, known)
        t_s, position = t_s[known], position[known]
        if not len(t_s):
            return
        self._send(VEHICLE, t_s, rr.Transform3D.columns(translation=position, scale=np.ones_like(position)))
        self._when, self._where = t_s, position
        self._draw_trail(t_s, position)

    def _hide(self, entity: str, t_s: Array, known: Array) -> None:
        """Makes the body vanish where its pose becomes unknown."""
        for at in np.flatnonzero(np.r_[not self._hidden.get(entity), known[:-1]] & ~known).tolist():
            self._stream.set_time(TIMELINE, duration=times(float(t_s[at])))
            self._stream.log(entity, rr.Transform3D(scale=_VANISHED))
        if len(known):
            self._hidden[entity] = not known[-1]

    def _draw_trail(self, t_s: Array, position: Array) -> None:
        moments, strips = [], []
        for time, point in zip(t_s.tolist(), position, strict=True):
            if self._last is None:
                self._last, self._last_s = point, time
            elif time - self._last_s >= _TRAIL_S and np.linalg.norm(point - self._last) >= _TRAIL_STEP * self.size:
                moments.append(time)
                strips.append(np.array([self._last, point], dtype=np.float32))
                self._last, self._last_s = point, time
        if moments:
            radii = np.full(len(moments), _TRAIL_RADIUS * self.size)
            options = {"radii": radii, "colors": np.tile([*_TRAIL_COLOUR, 255], (len(moments), 1))}
            self._send(f"{ROOT}/trail", np.array(moments), rr.LineStrips3D.columns(strips=strips, **options))

    def _rotate(self, t_s: Array, q: Array) -> None:
        known: Array = np.asarray(np.isfinite(q).all(axis=1) & (q != 0.0).any(axis=1))
        self._hide(ATTITUDE, t_s, known)
        xyzw = np.roll(q[known], -1, axis=1).astype(np.float32)
        if len(xyzw):
            same_size = np.ones((len(xyzw), 3))
            self._send(ATTITUDE, t_s[known], rr.Transform3D.columns(quaternion=xyzw, scale=same_size))

    def _push(self, t_s: Array, values: Array) -> None:
        values = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
        vectors = values if values.ndim == 2 else np.outer(values, [0.0, 0.0, self.up])
        self._largest = max(self._largest, float(np.linalg.norm(vectors, axis=1).max(initial=0.0)))
        # An arrow of length zero would still show its head.
        shown = vectors * (ARROW * self.size / self._largest if self._largest > 0 else 0.0)
        self._send(f"{ATTITUDE}/thrust", t_s, rr.Arrows3D.columns(vectors=shown.astype(np.float32)))

    def mark(self, t_s: float, number: int, text: str) -> None:
        """A labelled point at the vehicle's position at t_s, from the last batch."""
        if not self._position:
            return
        self._stream.set_time(TIMELINE, duration=times(t_s))
        where = self._where[min(int(np.searchsorted(self._when, t_s)), len(self._when) - 1)]
        radius = _MARKER_RADIUS * self.size
        point = rr.Points3D([where], radii=radius, colors=[_MARKER_COLOUR], labels=[text], show_labels=True)
        self._stream.log(f"{ROOT}/transitions/{number}", point)
