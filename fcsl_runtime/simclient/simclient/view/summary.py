# SPDX-License-Identifier: Apache-2.0
"""The summary of a recorded run: outputs by instance, plant truth, states."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..bag import Array, Bag, RecordedMachine, has_stamps, rows_of, stamps_s
from ..bag.states import visits
from ..errors import BagError
from .signals import FRAME_FIELDS, STALE, Quantity, named, quaternions, raw_instance, units_of

#: Names of the columns of `euler_deg`.
ANGLES = ("roll", "pitch", "yaw")


@dataclass(frozen=True)
class Source:
    """All values of one topic: `fields` maps name to values of shape (N,) or (N, count), `units` name to unit."""

    name: str
    topic: str
    truth: bool
    t_s: Array
    fields: dict[str, Array]
    units: dict[str, str]

    @property
    def sizes(self) -> dict[str, int]:
        """Number of elements of each field; 0: a scalar."""
        return {name: 0 if values.ndim == 1 else values.shape[1] for name, values in self.fields.items()}

    def running(self, field: str) -> Array:
        """`fields[field]` as float64 with NaN where the instance was stale: its value was old."""
        values: Array = self.fields[field].astype(np.float64)
        health = self.fields.get("health")
        if health is not None:
            values[health == STALE] = np.nan
        return values


@dataclass(frozen=True)
class Span:
    """A time in which the machine was in one state."""

    state: str
    start_s: float
    end_s: float


@dataclass(frozen=True)
class RunSummary:
    """One recorded machine and the plant around it, in memory."""

    machine: RecordedMachine
    sources: tuple[Source, ...]
    spans: tuple[Span, ...]

    def named(self, quantity: Quantity) -> list[tuple[Source, str]]:
        """The scalar fields that are `quantity` (signals.named)."""
        return named(self.sources, quantity)

    def quaternions(self) -> list[tuple[Source, str]]:
        """Every output that is an attitude by name and size, scalar first."""
        return quaternions(self.sources)

    @property
    def raw(self) -> str:
        """The instance with the vehicle's raw sensors (signals.raw_instance)."""
        return raw_instance(self.sources)

    @property
    def states(self) -> list[str]:
        """The visited states, in order of first appearance."""
        return list(dict.fromkeys(span.state for span in self.spans))


def _can_be_shown(bag: Bag, topic: str) -> bool:
    layout = bag.layout(topic)
    return layout is not None and has_stamps(layout)


def _source(bag: Bag, topic: str, name: str, truth: bool) -> Source:
    layout = bag.layout(topic)
    if layout is None or not has_stamps(layout):
        raise BagError(
            f"{bag.path}: topic `{topic}` [{bag.topic(topic).type}] cannot be shown: no header or no fixed size"
        )
    rows = rows_of(bag, topic)
    fields = {n: rows[n] for n in rows.dtype.names or () if n not in FRAME_FIELDS}
    for n, leaf in layout.leaves.items():
        if leaf.ros_type == "bool":
            fields[n] = fields[n].astype(bool)
    return Source(name, topic, truth, stamps_s(rows), fields, units_of(bag.topic(topic).schema))


def _spans(bag: Bag, machine: RecordedMachine) -> tuple[Span, ...]:
    """State intervals by tick stamps; each ends where the next begins, the last with its tick."""
    there = visits(bag, machine)
    ends = [visit.start_ns for visit in there[1:]] + [there[-1].end_ns]
    return tuple(Span(v.state, v.start_ns * 1e-9, end * 1e-9) for v, end in zip(there, ends, strict=True))


def read_summary(bag: Bag, machine: str = "", truth: str = "") -> RunSummary:
    """Reads one machine of an FCSL bag. `truth` is the plant's topic, by default every topic below /<namespace>/sim/.

    Raises BagError, also if the bag has no tick of the machine; `bag.truncated` then describes damage.
    """
    recorded = bag.machine(machine)
    prefix = recorded.prefix.rsplit("/", 1)[0] + "/sim/"
    truths = [bag.topic(truth).name] if truth else [t for t in bag.topics if t.startswith(prefix)]
    sources = [_source(bag, t, t.rsplit("/", 1)[-1], True) for t in truths if truth or _can_be_shown(bag, t)]
    sources += [_source(bag, topic, instance, False) for instance, topic in recorded.outputs.items()]
    return RunSummary(recorded, tuple(sources), _spans(bag, recorded))


def euler_deg(q: Array) -> Array:
    """Roll, pitch, yaw (ZYX) in degrees, shape (N, 3), of scalar-first quaternions, shape (N, 4)."""
    w, x, y, z = q.astype(np.float64).T
    roll = np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
    pitch = np.arcsin(np.clip(2 * (w * y - z * x), -1, 1))
    yaw = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.degrees(np.stack((roll, pitch, yaw), axis=1))


def thinned(t_s: Array, values: Array, points: int) -> tuple[Array, Array]:
    """Reduces to about `points` points and keeps extremes: minimum and maximum of each time interval."""
    step = 2 * len(t_s) // points
    if step <= 2:
        return t_s, values
    n = len(t_s) // step * step
    stretches = values[:n].reshape(-1, step)
    empty = np.isnan(stretches).all(axis=1)
    safe = np.where(np.isnan(stretches), np.inf, stretches)
    low = np.where(empty, np.nan, safe.min(axis=1))
    high = np.where(empty, np.nan, np.where(np.isnan(stretches), -np.inf, stretches).max(axis=1))
    t = np.repeat(t_s[:n:step], 2)
    return np.concatenate((t, t_s[n:])), np.concatenate((np.stack((low, high), axis=1).ravel(), values[n:]))
