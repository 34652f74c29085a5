# SPDX-License-Identifier: Apache-2.0
"""The frequency response of a simulation with its compiled controller, by flights in which a sine is added to inputs.

With c what the source gives, d the sine and u = c + d what the target gets, along the weights w of the injections (c is
w . c_i / w . w),

    loop           L = -C / U           the loop is cut where the sine is added
    sensitivity    S = 1 / (1 + L)      U / D
    response       Y / D                of an output

C, U, D, Y are the complex amplitudes at the frequency, from samples at the ticks. Each is half of the difference of two
flights, with the sine and with its opposite: noise, whose streams are the same in both, and whatever else the vehicle
does at that time cancel.

A frequency is measured if the amplitudes of two windows in a row agree, while no controller changes its state and the flight
goes on. Else its point says why it is not.
"""

from __future__ import annotations

import cmath
import math
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import groupby
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from simclient.errors import TwinError
from simclient.twin.trace import Trace

from ..config import SimConfig, load
from ..element_path import row_major_index, split_path
from ..errors import SimError
from ..sim_run import SimRun
from ..sim_twin import SimTwin
from ..whole_ticks import whole_ticks
from .injection import with_injections, with_moved

Array = np.ndarray[Any, Any]

#: Least samples and periods of a window, and most windows until two agree.
_SAMPLES, _PERIODS, _WINDOWS = 64, 2, 60
#: Two windows agree if no amplitude changes by more than this part of it, unless the caller says another one.
WITHIN = 1e-3
#: Of the largest sample: amplitudes below are rounding errors, and always agree.
_ROUNDING = 1e-12
#: Against division by zero.
_LEAST = 1e-300


@dataclass(frozen=True)
class Point:
    """Complex amplitudes at one frequency (rad/s). `change`: of them between the last two windows, as part of them. `rest`: what
    is not at this frequency, r.m.s., as part of what is; the largest of all signals: harmonics, where something is not linear.
    `why`: the reason why nothing was measured, or empty; with a reason there are no amplitudes."""

    omega: float
    source: complex
    sine: complex
    outputs: tuple[complex, ...]
    change: float
    rest: float
    why: str = ""

    @property
    def is_settled(self) -> bool:
        return not self.why

    @property
    def has_loop(self) -> bool:
        """Whether what the source gives depends on the sine."""
        return self.is_settled and self.source != 0

    @property
    def loop(self) -> complex:
        """Raises SimError where nothing was measured, as the next two do."""
        self._check()
        return -self.source / (self.source + self.sine)

    @property
    def sensitivity(self) -> complex:
        self._check()
        return 1.0 + self.source / self.sine

    def response(self, output: int) -> complex:
        self._check()
        return self.outputs[output] / self.sine

    def _check(self) -> None:
        if self.why:
            raise SimError(f"nothing was measured at {self.omega:g} rad/s: {self.why}")


def _not_measured(omega: float, change: float, why: str) -> Point:
    return Point(omega, 0j, 0j, (), change, 0.0, why)


class _Ended(Exception):
    """A flight is no longer the one to be measured; str() says why."""


class Response:
    """Flights of a simulation, from `at_s` on. Raises SimError, or DiagnosticError for what is wrong in the file.

    inputs: `instance.inputs.name`, `instance.inputs.name[1]` or `controller.channel`, each with `=WEIGHT` or not. outputs: scalars of
    the machine and of models. amplitude: of the sine, in the unit of the input. within: two windows agree if no amplitude
    changes by more than this part of it.
    """

    def __init__(
        self,
        config: SimConfig,
        inputs: Sequence[str],
        outputs: Sequence[str],
        at_s: Fraction | None,
        amplitude: float,
        within: float = WITHIN,
    ):
        if not inputs:
            raise SimError("an `--input` is needed: where the sine is added")
        if not 0.0 < within < 1.0:
            raise SimError(f"`--within` {within:g} is a part of an amplitude: above 0 and below 1")
        self.tick_hz = config.machine.tick_hz
        try:
            ticks = whole_ticks(at_s or Fraction(0), self.tick_hz)
        except ValueError as error:
            raise SimError(str(error)) from None
        self._amplitude, self.within = amplitude, within
        self._controllers = {"machine.state": "the controller"}
        self._controllers |= {f"{name}.machine.state": f"controller `{name}`" for name in config.companions}
        self._twins: list[SimTwin] = []
        with tempfile.TemporaryDirectory(prefix="fcsl-sim-response-") as folder:
            file = Path(folder) / config.path.name
            self.injections = with_injections(config, inputs, file)
            arguments = {**config.arguments, "sets": with_moved(config.arguments["sets"], self.injections)}
            injected = load(file, seed=config.seed, **arguments)
        try:
            for _ in range(2):
                self._twins.append(SimTwin(SimRun(injected)))
            self._outputs = [_Output(self._twins[0], path) for path in outputs]
            self._start = self._fly_to(ticks)
            self._states = {path: self._twins[0].get_value(path) for path in self._controllers}
        except TwinError as error:
            self.close()
            raise SimError(str(error)) from None
        except SimError:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        for twin in self._twins:
            twin.close()

    @property
    def outputs(self) -> list[tuple[str, str]]:
        """Path and unit of each."""
        return [(output.path, output.unit) for output in self._outputs]

    def _fly_to(self, ticks: int) -> bytes:
        twin = self._twins[0]
        if ticks:
            twin.tick(ticks)
        return twin.save()

    def points(self, omegas: Sequence[float]) -> Iterator[Point]:
        """A point for each frequency (rad/s, below pi times the ticks' rate), as soon as it is measured, or has turned out to be
        not measurable. Raises SimError."""
        for omega in omegas:
            try:
                yield self._point(omega)
            except TwinError as error:
                raise SimError(f"at {omega:g} rad/s: {error}") from None

    def _point(self, omega: float) -> Point:
        self._add_sine(omega)
        period = 2.0 * math.pi * self.tick_hz / omega
        window = math.ceil(period * max(_PERIODS, math.ceil(_SAMPLES / period)))
        before, change, flown = None, math.inf, 0
        for number in range(_WINDOWS):
            try:
                pairs = [self._samples(twin, window) for twin in self._twins]
            except _Ended as ended:
                return _not_measured(omega, change, f"{ended} ({self._so_far(number, window, change)})")
            found, left = _fit((pairs[0] - pairs[1]) / 2.0, omega / self.tick_hz, flown)
            flown += window
            floors = _ROUNDING * np.abs(pairs[0]).max(axis=0) / self.within + _LEAST
            rest = float(np.max(left / (np.abs(found) + floors)))
            phasors = self._along_weights(found, omega)
            if phasors[1] == 0 or phasors[2] == 0:
                return _not_measured(omega, change, "the sine is lost in rounding: it needs a larger amplitude")
            if before is not None:
                ports = np.full(3, floors[: 2 * len(self.injections)].max())
                sizes = np.abs(phasors) + np.concatenate([ports, floors[2 * len(self.injections) :]])
                change = float(np.max(np.abs(phasors - before) / sizes))
            if change <= self.within:
                return Point(omega, phasors[0], phasors[1], tuple(phasors[3:]), change, rest)
            before = phasors
        return _not_measured(omega, change, f"it does not settle: {self._so_far(_WINDOWS, window, change)}")

    def _add_sine(self, omega: float) -> None:
        """To both flights, at their beginning."""
        for twin, sign in zip(self._twins, (1.0, -1.0), strict=True):
            twin.restore(self._start)
            start = twin.get_value("machine.tick") / self.tick_hz
            for injection in self.injections:
                values = {
                    "amplitude": injection.amplitude(sign * self._amplitude),
                    "frequency": omega,
                    "start": start,
                }
                twin.set_many({f"{injection.instance}.parameters.{name}": value for name, value in values.items()})

    def _so_far(self, windows: int, ticks: int, change: float) -> str:
        done = f"after {windows} window{'' if windows == 1 else 's'} of {ticks / self.tick_hz:.3g} s"
        return done if math.isinf(change) else f"{done}, of which the last two differ by {change:.1g}"

    def _along_weights(self, found: Array, omega: float) -> Array:
        """Of source, sine, target and outputs. What a controller commands at a tick, and its sine, are seen after the next one."""
        square = sum(injection.weight**2 for injection in self.injections)
        source, sine = 0j, 0j
        for i, injection in enumerate(self.injections):
            given, passed_on = found[2 * i], found[2 * i + 1]
            tick = cmath.exp(1j * omega / self.tick_hz) if injection.is_commanded else 1.0
            source += injection.weight / square * given * tick
            sine += injection.weight / square * (passed_on - given) * tick
        return np.array([source, sine, source + sine, *found[2 * len(self.injections) :]])

    def _samples(self, twin: SimTwin, ticks: int) -> Array:
        """After each tick: what each source gives and what its target gets, then the outputs. Raises _Ended."""
        ports = [
            (f"{injection.instance}.{port}.value", injection.element)
            for injection in self.injections
            for port in ("inputs", "outputs")
        ]
        columns = [*ports, *((output.field, output.element) for output in self._outputs)]
        with twin.trace(*self._controllers, *(field for field, _ in columns)) as trace:
            try:
                twin.tick(ticks)
            except TwinError as error:
                self._check_states(trace)
                raise _Ended(str(error).partition("\n")[0]) from None
        self._check_states(trace)
        return np.column_stack([_element(trace[field], element).astype(float) for field, element in columns])

    def _check_states(self, trace: Trace) -> None:
        """Raises _Ended where a controller has changed its state: from there on it is another loop."""
        for path, controller in self._controllers.items():
            states = trace[path]
            changed = np.flatnonzero(states != self._states[path])
            if len(changed):
                at = f"{trace.time_s[changed[0]]:.6g} s"
                raise _Ended(f"{controller} went from {self._states[path]} to {states[changed[0]]} at {at}")


class _Output:
    """A scalar: a field, or an element of one."""

    def __init__(self, twin: SimTwin, path: str):
        self.path = path
        self.field, self.element = split_path(path)
        field = twin.describe(self.field)
        if len(self.element) < len(field.shape) or row_major_index(self.element, field.shape) is None:
            raise SimError(
                f"`{path}`: {self.field} is {field.type_text}; name one element of it, or itself if it is a number"
            )
        if field.type not in ("f64", "f32"):
            raise SimError(f"`{path}` is {field.type_text}, no floating number")
        self.unit = field.unit


def _element(values: Array, index: tuple[int, ...]) -> Array:
    """Of each row."""
    return values.reshape(len(values), -1)[:, int(np.ravel_multi_index(index, values.shape[1:])) if index else 0]


def _fit(samples: Array, step: float, first: int) -> tuple[Array, Array]:
    """The complex amplitude of each column at `step` rad per sample, by least squares beside an offset and a trend; and the
    amplitude of a sine as large as what is left."""
    k = np.arange(len(samples))
    angle = step * (first + k)
    basis = np.column_stack([np.cos(angle), np.sin(angle), np.ones(len(k)), k / len(k)])
    found, *_ = np.linalg.lstsq(basis, samples, rcond=None)
    left = np.sqrt(2.0 * np.mean((samples - basis @ found) ** 2, axis=0))
    return found[0] - 1j * found[1], left


@dataclass(frozen=True)
class Margins:
    """Of a loop, between the lowest and the highest frequency that was measured; None: there is no crossing within. Angles in rad."""

    gain_crossover: float | None
    phase_margin: float | None
    phase_crossover: float | None
    gain_margin: float | None
    peak_sensitivity: float
    peak_frequency: float

    @property
    def delay_margin(self) -> float | None:
        """s"""
        if self.phase_margin is None or not self.gain_crossover:
            return None
        return self.phase_margin / self.gain_crossover


def margins(points: Sequence[Point]) -> Margins:
    """Of several crossings the one with the smallest margin counts. A point without a loop counts nowhere. Raises SimError if all
    are so."""
    with_loop = [point for point in points if point.has_loop]
    if not with_loop:
        raise SimError("no loop was measured at any frequency")
    at_gain, at_phase = crossings(points)
    crossover, phase_margin = min(at_gain, key=lambda pair: pair[1], default=(None, None))
    phase_crossover, gain_margin = min(at_phase, key=lambda pair: abs(math.log(pair[1])), default=(None, None))
    peak = max(with_loop, key=lambda point: abs(point.sensitivity))
    return Margins(crossover, phase_margin, phase_crossover, gain_margin, abs(peak.sensitivity), peak.omega)


def crossings(points: Sequence[Point]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Frequency (rad/s) and phase margin (rad) of each gain crossover; frequency and gain margin (a factor) of each phase
    crossover. Between points gain (dB) and phase are linear in the logarithm of the frequency; no crossing is sought across a
    point without a loop."""
    at_gain: list[tuple[float, float]] = []
    at_phase: list[tuple[float, float]] = []
    for run in measured_runs(points, lambda point: point.has_loop):
        omega = np.log([p.omega for p in run])
        gain = np.log(np.abs([p.loop for p in run]))
        phase = np.unwrap(np.angle([p.loop for p in run]))
        for at in _crossings(omega, gain, 0.0):
            angle = _between(omega, phase, at)
            at_gain.append((math.exp(at), abs(math.remainder(angle - math.pi, 2 * math.pi))))
        turns = range(math.floor(phase.min() / (2 * math.pi)) - 1, math.ceil(phase.max() / (2 * math.pi)) + 2)
        for at in (at for n in turns for at in _crossings(omega, phase, (2 * n + 1) * math.pi)):
            at_phase.append((math.exp(at), math.exp(-_between(omega, gain, at))))
    return at_gain, at_phase


def measured_runs(points: Sequence[Point], holds: Callable[[Point], bool]) -> list[list[Point]]:
    """The points for which it holds, those that follow one another together."""
    return [list(run) for held, run in groupby(points, holds) if held]


def _crossings(x: Array, y: Array, level: float) -> list[float]:
    found = []
    for i in range(len(x) - 1):
        low, high = y[i] - level, y[i + 1] - level
        if low * high < 0.0 or (low == 0.0 and high != 0.0):
            found.append(float(x[i] + (x[i + 1] - x[i]) * low / (low - high)))
    return found


def _between(x: Array, y: Array, at: float) -> float:
    return float(np.interp(at, x, y))


def spaced(low: float, high: float, count: int) -> list[float]:
    """Frequencies of equal ratio."""
    return [float(value) for value in np.geomspace(low, high, count)]
