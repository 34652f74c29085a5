# SPDX-License-Identifier: Apache-2.0
"""Compares the outputs of a machine on a bag with the outputs that the bag expects.

A message is compared with the output of one tick. `held`: the first tick at or after its time, which would take it as
an input; the newest message of a tick counts. `nearest`: the tick nearest to its time; of two, the earlier.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fcsl_compiler.api.ros import ConversionError, Kind, select_all

from ..bag import Bag
from ..descriptor import Machine
from ..errors import BagError, MapError, did_you_mean
from ..ros.types import definitions_of
from .mapping import STATE, Expectation
from .outputs import Outputs
from .poses import are_rotations
from .sample_extraction import Wish, gather, refusals, wish
from .text_field import texts_of
from .tick_alignment import Array, TickGrid, align, first_ticks_at, nearest_ticks


@dataclass(frozen=True)
class Target:
    """An expectation checked against machine and bag; `wish` is None for the machine's state."""

    expectation: Expectation
    measure: str  # values, angle, tilt, state
    unit: str
    wish: Wish | None


@dataclass(frozen=True, eq=False)
class Comparison:
    """n messages compared with the outputs of n ticks; `ours` and `theirs` have shape (n, count), or (n,) texts for
    states.

    `error` is the largest over the elements; `exceeded` marks messages with an element beyond its tolerance. `refused`
    messages were expected quaternions of length zero or infinity, which are no orientation. `nothing`: why nothing is compared.
    """

    target: Target
    t_s: Array
    ours: Array
    theirs: Array
    error: Array
    exceeded: Array
    refused: int = 0
    nothing: str = ""

    @property
    def holds(self) -> bool:
        """Whether anything was compared, and all of it is within tolerance."""
        return len(self.error) > 0 and not self.exceeded.any()


def check(expectations: Sequence[Expectation], bag: Bag, machine: Machine) -> list[Target]:
    """The checked expectations. Raises MapError, which names the expectation that machine or bag cannot meet."""
    return [_target(expectation, bag, machine) for expectation in expectations]


def _target(expectation: Expectation, bag: Bag, machine: Machine) -> Target:
    entry = expectation.entry
    if entry.target == STATE:
        if expectation.compare or expectation.absolute or expectation.relative or len(entry.fields) != 1:
            raise MapError(f"{entry.location}: states are compared as text: one `field`, no tolerance")
        try:
            bag.topic(entry.topic)
        except BagError as error:
            raise MapError(f"{entry.location}: {error}") from None
        return Target(expectation, "state", "", None)
    outputs = [path for path, field in machine.fields.items() if field.role == "output"]
    if entry.target not in outputs:
        raise MapError(
            f"{entry.location}: machine `{machine.name}` has no output `{entry.target}`{did_you_mean(entry.target, outputs)}"
        )
    field = machine.fields[entry.target]
    wanted = wish(bag, entry, "f64", field.count)
    definitions = definitions_of(bag.store(entry.topic).fielddefs)
    try:
        kind = select_all(definitions, wanted.topic.type, entry.fields, field.count).kind
    except ConversionError as error:
        raise MapError(f"{entry.location}: {error}") from None
    rotation = kind is Kind.QUATERNION or bool(entry.order)
    measure = expectation.compare or ("angle" if rotation else "values")
    if measure != "values" and not rotation:
        raise MapError(f"{entry.location}: `compare: {measure}` is for quaternions; is `quaternion: wxyz` missing?")
    if measure != "values" and expectation.relative:
        raise MapError(f"{entry.location}: `rel` does not apply to an angle; give `abs` in rad")
    return Target(expectation, measure, field.unit if measure == "values" else "rad", wanted)


def compare(
    targets: Sequence[Target], bag: Bag, outputs: Outputs, grid: TickGrid, header_time: bool
) -> list[Comparison]:
    """Compares `outputs`, the machine's for `bag` on `grid`, with `bag`. Raises BagError."""
    wishes = [target.wish for target in targets if target.wish is not None]
    all_samples = gather(bag, wishes, header_time)[0] if wishes else {}
    found = []
    for target in targets:
        name = target.expectation.entry.target
        if target.wish is None:
            times_ns, theirs, messages = texts_of(bag, target.expectation.entry, header_time)
            none = "" if len(times_ns) else f"none of its {messages} messages can be used" if messages else _NO_MESSAGE
            ours = outputs.column(name)
        else:
            samples = all_samples[name]
            times_ns, theirs = samples.times_ns, samples.values.reshape(len(samples.times_ns), target.wish.pick.count)
            none = "" if len(times_ns) else ", ".join(refusals(samples.refused, samples.frames)) or _NO_MESSAGE
            values = outputs.column(name)
            ours = values.reshape(len(values), -1).astype(np.float64)
        found.append(_compared(target, grid, times_ns, ours, theirs, none))
    return found


#: Why nothing is compared, if the bag has nothing.
_NO_MESSAGE = "its topic has no message"


def _compared(target: Target, grid: TickGrid, times_ns: Array, ours: Array, theirs: Array, nothing: str) -> Comparison:
    """The comparison of the outputs of all ticks with messages at `times_ns`."""
    behind_ns = times_ns - grid.first_ns
    inside = (behind_ns >= target.expectation.from_s * 1e9) & (behind_ns <= target.expectation.until_s * 1e9)
    t_s = behind_ns * 1e-9
    turned = inside & _turned(target, theirs)
    ticks, chosen = _aligned(times_ns[turned], grid, target.expectation.nearest)
    if not nothing and not len(chosen):
        span = f"of {len(t_s)} messages, from {t_s.min():.3f} s to {t_s.max():.3f} s,"
        if not inside.any():
            nothing = f"{span} none is within `from_s` and `until_s`"
        elif not turned.any():
            nothing = f"{span} all that count are quaternions of length zero or infinity"
        else:
            nothing = f"{span} none that counts is within the run, which ends at {grid.ticks / grid.tick_hz:.3f} s"
    chosen = np.flatnonzero(turned)[chosen]
    error, exceeded = _errors(target, ours[ticks], theirs[chosen])
    refused = int(np.count_nonzero(inside & ~turned))
    return Comparison(target, t_s[chosen], ours[ticks], theirs[chosen], error, exceeded, refused, nothing)


def _turned(target: Target, theirs: Array) -> Array:
    """Which messages can be compared: quaternions that are no rotation cannot."""
    return are_rotations(theirs) if target.measure in ("angle", "tilt") else np.ones(len(theirs), bool)


def _aligned(times_ns: Array, grid: TickGrid, nearest: bool) -> tuple[Array, Array]:
    """(ticks, index of the message compared with each)."""
    if nearest:
        ticks = nearest_ticks(times_ns, grid.first_ns, grid.tick_hz)
        chosen = np.flatnonzero((times_ns >= grid.first_ns) & (ticks < grid.ticks))
        return ticks[chosen], chosen
    inside = np.flatnonzero(first_ticks_at(times_ns, grid.first_ns, grid.tick_hz) < grid.ticks)
    ticks, chosen, _ = align(times_ns[inside], grid.first_ns, grid.ticks, grid.tick_hz)
    return ticks, inside[chosen]


def _errors(target: Target, ours: Array, theirs: Array) -> tuple[Array, Array]:
    """(largest error of each row, whether it exceeds the tolerance). A NaN in an output exceeds it."""
    if target.measure == "state":
        differs = ours != theirs
        return differs.astype(np.float64), differs
    limit: Array | float = target.expectation.absolute
    if target.measure == "values":
        off = np.abs(ours - theirs)
        off[ours == theirs] = 0.0  # equal infinities
        limit = limit + target.expectation.relative * np.abs(theirs)
    else:
        off = (_angle if target.measure == "angle" else _tilt)(ours, theirs)[:, None]
    return off.max(axis=1, initial=0.0), ~(off <= limit).all(axis=1)


def _unit(q: Array) -> Array:
    with np.errstate(invalid="ignore", divide="ignore"):
        unit: Array = q / np.linalg.norm(q, axis=1, keepdims=True)
    return unit


def _angle(p: Array, q: Array) -> Array:
    """Angle of the rotation between orientations (n, 4), w first; (n,) in rad."""
    p, q = _unit(p), _unit(q)
    w = (p * q).sum(axis=1)
    between = p[:, :1] * q[:, 1:] - q[:, :1] * p[:, 1:] - np.cross(p[:, 1:], q[:, 1:])
    angle: Array = 2.0 * np.arctan2(np.linalg.norm(between, axis=1), np.abs(w))
    return angle


def _tilt(p: Array, q: Array) -> Array:
    """Angle between the vertical directions in body axes; (n,) in rad."""
    a, b = _up(p), _up(q)
    tilt: Array = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    return tilt


def _up(q: Array) -> Array:
    """The world's z axis in body axes, shape (n, 3)."""
    w, x, y, z = _unit(q).T
    return np.stack((2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)), axis=1)


def table(comparisons: Sequence[Comparison]) -> str:
    """One line per expectation."""
    rows: list[tuple[str, ...]] = [
        ("expectation", "by", "compared", "max error", "rms", "tolerance", "exceeded", "first exceeded")
    ]
    for c in comparisons:
        wanted, unit = c.target.expectation, f" {c.target.unit}" if c.target.unit else ""
        tolerance = f"{wanted.absolute:g}{unit}" + (f" + {wanted.relative:g} of it" if wanted.relative else "")
        count = int(np.count_nonzero(c.exceeded))
        first = f"{c.t_s[int(np.argmax(c.exceeded))]:.6f} s" if count else "-"
        numbers = ["-", "-", "-"]
        if len(c.error) and c.target.measure != "state":
            rms = float(np.sqrt(np.mean(c.error**2)))
            numbers = [f"{float(c.error.max()):.4g}{unit}", f"{rms:.4g}{unit}", tolerance]
        rows.append((wanted.entry.target, c.target.measure, str(len(c.error)), *numbers, str(count), first))
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = [
        "  "
        + "  ".join(f"{v:<{w}}" if i < 2 else f"{v:>{w}}" for i, (v, w) in enumerate(zip(row, widths, strict=True)))
        for row in rows
    ]
    for c in comparisons:
        name = c.target.expectation.entry.target
        if c.refused:
            lines.append(f"  {name}: refused: {c.refused} expected quaternions of length zero or infinity")
        if c.nothing:
            lines.append(f"  {name}: nothing to compare: {c.nothing}")
    return "\n".join(lines)
