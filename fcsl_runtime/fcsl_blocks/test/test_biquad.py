# SPDX-License-Identifier: Apache-2.0
"""Notch, TrackingNotch, BiquadLowPass and BiquadHighPass against SciPy's designs; changes in flight against the
time-varying analogue filter, solved as a differential equation."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import integrate, signal

SOURCE = "biquad.py"
FIXED = ["Notch", "BiquadLowPass", "BiquadHighPass"]
NAN, INF = float("nan"), float("inf")
Vector = np.ndarray[Any, Any]


def make(block: Callable[..., Any], class_: str, frequency: float, quality: float, rate: int = 500) -> Any:
    return block(SOURCE, class_, rate=rate, frequency=frequency, quality=quality)


def run(block: Any, values: Any, **inputs: float) -> list[float]:
    return [block.step(input=float(v), **inputs)["output"] for v in values]


def noise(count: int = 120) -> Vector:
    """Begins at 0, where SciPy's filters begin."""
    return np.concatenate([[0.0], np.random.default_rng(4).normal(size=count)])


def bilinear(class_: str, frequency: float, quality: float, rate: int) -> tuple[Vector, Vector]:
    """The analogue filter with the prewarped frequency, by SciPy's bilinear transform."""
    w = 2.0 * rate * np.tan(np.pi * frequency / rate)
    b = {"Notch": [1.0, 0.0, w * w], "BiquadLowPass": [w * w], "BiquadHighPass": [1.0, 0.0, 0.0]}[class_]
    found: tuple[Vector, Vector] = signal.bilinear(b, [1.0, w / quality, w * w], fs=rate)
    return found


@pytest.mark.parametrize("class_", FIXED)
@pytest.mark.parametrize(
    "rate, share, quality", [(500, 0.002, 0.5), (100, 0.1, 0.7), (500, 0.3, 10.0), (100, 0.48, 2.0)]
)
def test_it_is_that_of_scipy(block: Callable[..., Any], class_: str, rate: int, share: float, quality: float) -> None:
    u = noise()
    b, a = bilinear(class_, share * rate, quality, rate)
    found = run(make(block, class_, share * rate, quality, rate), u)
    np.testing.assert_allclose(found, signal.lfilter(b, a, u), rtol=1e-7, atol=1e-8)


def test_by_default_it_is_a_butterworth_filter(block: Callable[..., Any]) -> None:
    u = noise()
    for class_, kind in (("BiquadLowPass", "low"), ("BiquadHighPass", "high")):
        b, a = signal.butter(2, 60.0, kind, fs=500)
        found = run(block(SOURCE, class_, rate=500, frequency=60.0), u)
        np.testing.assert_allclose(found, signal.lfilter(b, a, u), rtol=1e-8, atol=1e-9)


def test_a_narrow_notch_is_that_of_iirnotch(block: Callable[..., Any]) -> None:
    """SciPy's designs the width, too, without warping; low below the rate, there is little of that."""
    u = noise()
    b, a = signal.iirnotch(5.0, 5.0, fs=500)
    np.testing.assert_allclose(run(make(block, "Notch", 5.0, 5.0), u), signal.lfilter(b, a, u), atol=1e-3)


@pytest.mark.parametrize("frequency", [20.0, 120.0, 220.0])
def test_the_notch_takes_out_its_frequency(block: Callable[..., Any], frequency: float) -> None:
    """Exactly at it, also near half the rate of runs; what is far from it passes."""
    t = np.arange(600) / 500
    for f, gain in ((frequency, 0.0), (0.3 * frequency, 1.0)):
        found = run(make(block, "Notch", frequency, 3.0), np.sin(2.0 * np.pi * f * t))
        assert np.sqrt(2.0 * np.mean(np.square(found[350:]))) == pytest.approx(gain, abs=0.02)


def test_the_tracking_notch_is_the_notch_at_each_frequency(block: Callable[..., Any]) -> None:
    u = noise()
    tracking = block(SOURCE, "TrackingNotch", rate=500, harmonic=3.0, quality=2.0, least=30.0)
    assert run(tracking, u, frequency=15.0) == run(make(block, "Notch", 45.0, 2.0), u)
    centres = [tracking.step(frequency=f)["centre"] for f in (15.0, 5.0, -1e300, 80.0, 100.0, 1e308)]
    assert centres == pytest.approx([45.0, 30.0, 30.0, 240.0, 245.0, 245.0])


def test_the_tracking_notch_follows_a_rotor(block: Callable[..., Any]) -> None:
    """40 to 80 Hz in 2 s: a fixed notch lets it through, that which follows takes out most of it."""
    t = np.arange(1000) / 500
    frequency = 40.0 + 20.0 * t
    u = np.sin(2.0 * np.pi * (40.0 * t + 10.0 * t * t))
    tracking = block(SOURCE, "TrackingNotch", rate=500, quality=2.0, least=30.0)
    found = [tracking.step(input=v, frequency=f)["output"] for v, f in zip(u.tolist(), frequency.tolist(), strict=True)]
    fixed = run(make(block, "Notch", 40.0, 2.0), u)
    assert np.std(found[100:]) < 0.02 < 0.2 < np.std(fixed[500:])


def test_without_a_frequency_the_tracking_notch_keeps_its_centre(block: Callable[..., Any]) -> None:
    u = noise(60)
    tracking = block(SOURCE, "TrackingNotch", rate=500, quality=2.0, least=30.0)
    first = [tracking.step(input=v, frequency=NAN) for v in (2.0, -5.0, 0.0)]
    assert [(o["output"], o["health"]) for o in first] == [(v, "degraded") for v in (2.0, -5.0, 0.0)]
    tracking.rest()
    kept = [tracking.step(input=v, frequency=50.0 if i < 30 else INF) for i, v in enumerate(u.tolist())]
    assert [o["output"] for o in kept] == run(make(block, "Notch", 50.0, 2.0), u)
    assert [o["health"] for o in kept] == ["nominal"] * 30 + ["degraded"] * 31


@pytest.mark.parametrize("class_", FIXED)
def test_the_first_run_is_at_rest(block: Callable[..., Any], class_: str) -> None:
    """Also after a break: nothing of before is left."""
    filter_ = make(block, class_, 20.0, 1.0)
    for level in (7.0, -3.0):
        assert run(filter_, [level] * 20) == [0.0 if class_ == "BiquadHighPass" else level] * 20
        run(filter_, [0.0, 5.0, 100.0])
        filter_.rest()
    assert filter_.step(input=NAN)["health"] == "degraded"
    assert run(filter_, [4.0] * 3) == [0.0 if class_ == "BiquadHighPass" else 4.0] * 3


@pytest.mark.parametrize("class_", FIXED)
def test_at_rest_no_change_moves_the_output(block: Callable[..., Any], class_: str) -> None:
    """To the bit. The control: a delay line (transposed direct form II) that keeps its values jumps."""
    filter_ = make(block, class_, 5.0, 0.7)
    level = run(filter_, [3.0] * 2)[-1]
    for frequency, quality in ((50.0, 0.7), (1.0, 0.7), (1.0, 20.0), (200.0, 0.01), (0.0, 0.5), (1e9, 1e4)):
        filter_.set(frequency=frequency, quality=quality)
        assert run(filter_, [3.0] * 2) == [level] * 2
    b, a = bilinear(class_, 5.0, 0.7, 500)
    zi = signal.lfilter_zi(b, a) * 3.0
    b, a = bilinear(class_, 50.0, 0.7, 500)
    assert abs(signal.lfilter(b, a, [3.0], zi=zi)[0][0] - level) > 0.15


@pytest.mark.parametrize("class_", FIXED)
@pytest.mark.parametrize("after", [(9.0, 1.0), (4.0, 0.3), (2.0, 8.0)])
def test_in_motion_a_change_makes_no_jump(block: Callable[..., Any], class_: str, after: tuple[float, float]) -> None:
    """Against the analogue filter, whose integrators keep their values while frequency and quality change at once."""
    rate, change = 1000, 0.15
    t = np.arange(400) / rate
    filter_ = make(block, class_, 4.0, 1.0, rate)

    def u(t: float) -> float:
        return float(1.0 - np.cos(2.0 * np.pi * 3.0 * t))

    def slope(t: float, x: Vector) -> list[float]:
        frequency, quality = (4.0, 1.0) if t < change else after
        w = 2.0 * np.pi * frequency
        return [w / quality * (u(t) - x[0] - x[1]), quality * w * x[0]]

    found = []
    for i, now in enumerate(t):
        if i == 151:  # the run whose step begins at the change
            filter_.set(frequency=after[0], quality=after[1])
        found += run(filter_, [u(now)])
    band, low = integrate.solve_ivp(slope, (0.0, t[-1]), [0.0, 0.0], t_eval=t, rtol=1e-9, atol=1e-11, max_step=1e-3).y
    values = np.array([u(now) for now in t])
    expected = {"Notch": values - band, "BiquadLowPass": low, "BiquadHighPass": values - band - low}[class_]
    np.testing.assert_allclose(found, expected, atol=4e-3)


def test_frequencies_that_change_in_each_run_stay_stable(block: Callable[..., Any]) -> None:
    """quality^2 band^2 + low^2 never grows without input, here of the low-pass, whose output is `low`."""
    filter_ = make(block, "BiquadLowPass", 20.0, 10.0)
    run(filter_, [0.0, 1.0, 1.0])
    rng, last = np.random.default_rng(6), INF
    for i in range(150):
        filter_.set(frequency=float(rng.choice([1.0, 30.0, 100.0, 249.0])))
        found = run(filter_, [0.0])[0]
        if i >= 2:  # the last input is 0, too
            state = [filter_.native.get_value(f"block.state.{n}") for n in ("band", "low")]
            assert state[1] == found
            energy = 100.0 * state[0] ** 2 + state[1] ** 2
            assert energy <= last * (1.0 + 1e-12)
            last = energy
    assert last < 0.1


@pytest.mark.parametrize("class_", FIXED)
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], class_: str) -> None:
    """It leaves no trace: with and without it, the next outputs are the same."""
    filter_, other = make(block, class_, 20.0, 1.0), make(block, class_, 20.0, 1.0)
    before = [f.step(input=v) for f in (filter_, other) for v in (1.0, 2.0)][-1]
    for value in (NAN, INF, -INF):
        assert filter_.step(input=value) == before | {"health": "degraded"}
        before = filter_.step(input=3.0)
        assert before == other.step(input=3.0) and before["health"] == "nominal"


def test_no_input_faults(block: Callable[..., Any]) -> None:
    extremes = [1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -5e-324, -0.0, 0.0, NAN, INF, -INF]
    rng = np.random.default_rng(5)
    blocks = [make(block, class_, 0.0, 0.01) for class_ in FIXED]
    tracking = block(SOURCE, "TrackingNotch", rate=500, quality=1.0, least=0.0)
    for frequency, quality in ((0.0, 0.01), (1e-300, 1e4), (1e9, 0.01), (249.0, 1e4)):
        for b in blocks:
            b.rest()
            b.set(frequency=frequency, quality=quality)
        tracking.set(quality=quality)
        for v in rng.permutation([*extremes, *rng.normal(size=10)]):
            outputs = [b.step(input=float(v)) for b in blocks]
            outputs.append(tracking.step(input=float(v), frequency=float(rng.choice(extremes))))
            assert all(np.isfinite(o["output"]) for o in outputs)
    for b in (*blocks, tracking):
        assert b.native.get_value("block.counters.faults") == 0
