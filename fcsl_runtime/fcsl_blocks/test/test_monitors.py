# SPDX-License-Identifier: Apache-2.0
"""RangeMonitor, StuckMonitor and RateMonitor against NumPy and SciPy on random signals; persistence, recovery, latching,
breaks, and values that are not finite."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal

H = 0.01
#: One parameter set of each monitor that fails on the value 9.0 after 0.0, and what makes it fail again and again.
KINDS = [
    ("RangeMonitor", {"high": 1.0}),
    ("RateMonitor", {"max_rate": 1.0}),
    ("StuckMonitor", {"tolerance": 100.0, "persistence": 0.0}),
]


def watch(monitor: Any, values: Any, **inputs: Any) -> dict[str, list[Any]]:
    found = [monitor.step(**{"value": float(v), "reset": False, **inputs}) for v in values]
    return {name: [f[name] for f in found] for name in found[0]}


def lasting(violated: Any, persistence: int, recovery: int) -> list[bool]:
    """The value of a flip-flop that is set by `persistence` + 1 violations in a row and cleared by `recovery` + 1 others."""
    violated = np.asarray(violated)
    sets = signal.lfilter(np.ones(persistence + 1), [1.0], violated) == persistence + 1
    clears = signal.lfilter(np.ones(recovery + 1), [1.0], ~violated) == recovery + 1
    found, value = [], False
    for is_set, is_clear in zip(sets, clears, strict=True):
        value = bool(is_set or (value and not is_clear))
        found.append(value)
    return found


def wandering(seed: int, runs: int = 400) -> np.ndarray[Any, Any]:
    """Noise behind a low-pass of SciPy, so that it stays on either side for a while."""
    noise = np.random.default_rng(seed).normal(size=runs)
    return np.asarray(signal.lfilter([0.4], [1.0, -0.8], noise))


@pytest.mark.parametrize(("persistence", "recovery"), [(0, 0), (1, 3), (6, 2)])
def test_range(block: Callable[..., Any], persistence: int, recovery: int) -> None:
    times = {"persistence": persistence * H, "recovery": recovery * H}
    x = wandering(1)
    found = watch(block("monitors.py", "RangeMonitor", low=-0.5, high=0.4, **times), x)
    violated = (x < -0.5) | (x > 0.4)
    assert found["violated"] == violated.tolist()
    assert found["failed"] == lasting(violated, persistence, recovery) and len(set(found["failed"])) == 2


def test_the_limits_are_within_the_range(block: Callable[..., Any]) -> None:
    monitor = block("monitors.py", "RangeMonitor", low=-1.0, high=2.0)
    values = [-1.0, 2.0, -0.0, np.nextafter(-1.0, -2.0), np.nextafter(2.0, 3.0)]
    assert watch(monitor, values)["failed"] == [False, False, False, True, True]
    monitor.set(low=3.0)
    assert watch(monitor, [2.5, 1.0, 4.0])["failed"] == [True, True, True]
    without = block("monitors.py", "RangeMonitor")
    assert watch(without, [1e300, -1e300])["failed"] == [False, False]


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_outside_of_the_range(block: Callable[..., Any], value: float) -> None:
    monitor = block("monitors.py", "RangeMonitor", low=-1.0, high=1.0, persistence=0.02)
    found = watch(monitor, [0.0, value, value, value, 0.0])
    assert found["failed"] == [False, False, False, True, False]
    assert found["health"] == ["nominal", "degraded", "degraded", "degraded", "nominal"]


@pytest.mark.parametrize(("persistence", "recovery"), [(0, 0), (2, 1)])
@pytest.mark.parametrize("rate", [100, 500])
def test_rate(block: Callable[..., Any], persistence: int, recovery: int, rate: int) -> None:
    times = {"persistence": persistence / rate, "recovery": recovery / rate}
    x = wandering(2)
    found = watch(block("monitors.py", "RateMonitor", rate=rate, max_rate=0.3 * rate, **times), x)
    rates = np.diff(x, prepend=x[0]) * rate
    np.testing.assert_allclose(found["rate"], rates, atol=1e-9)
    assert found["violated"] == (np.abs(rates) > 0.3 * rate).tolist()
    assert found["failed"] == lasting(np.abs(rates) > 0.3 * rate, persistence, recovery)
    assert len(set(found["failed"])) == 2


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_a_rate_over_a_gap_is_that_of_its_time(block: Callable[..., Any], value: float) -> None:
    monitor = block("monitors.py", "RateMonitor", max_rate=150.0)
    found = watch(monitor, [value, 1.0, 2.0, value, value, 5.0, 6.0])
    np.testing.assert_allclose(found["rate"], [0.0, 0.0, 100.0, 100.0, 100.0, 100.0, 100.0])
    assert not any(found["failed"]) and found["health"].count("degraded") == 3
    assert watch(monitor, [8.0, value])["failed"] == [True, True]  # it stays


def anchored(x: Any, tolerance: float, rate: int) -> np.ndarray[Any, Any]:
    """The times since the value left the interval around its anchor, from one departure to the next."""
    still, start = np.zeros(len(x)), 0
    while start < len(x):
        away = np.flatnonzero(np.abs(x[start:] - x[start]) > tolerance)
        end = start + int(away[0]) if len(away) else len(x)
        still[start:end] = np.arange(end - start) / rate
        start = end
    return still


@pytest.mark.parametrize("tolerance", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("rate", [100, 500])
def test_stuck(block: Callable[..., Any], tolerance: float, rate: int) -> None:
    x = np.repeat(wandering(3), np.random.default_rng(4).integers(1, 9, size=400))[:400]
    still = anchored(x, tolerance, rate)
    found = watch(block("monitors.py", "StuckMonitor", rate=rate, tolerance=tolerance, persistence=6 / rate), x)
    np.testing.assert_allclose(found["still"], still, atol=1e-12)
    assert found["failed"] == (np.round(still * rate) >= 6).tolist() and len(set(found["failed"])) == 2


def test_a_slow_drift_is_not_stuck(block: Callable[..., Any]) -> None:
    """Each step is within the tolerance; twelve of them are not."""
    monitor = block("monitors.py", "StuckMonitor", tolerance=1.0, persistence=0.2)
    assert not any(watch(monitor, 0.09 * np.arange(200))["failed"])
    assert watch(monitor, [20.0] * 30)["failed"].count(True) == 10


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_neither_moves_nor_stands(block: Callable[..., Any], value: float) -> None:
    monitor = block("monitors.py", "StuckMonitor", persistence=0.03)
    found = watch(monitor, [value, 1.0, 1.0, value, value, value, 1.0, 1.0, value, 2.0])
    np.testing.assert_allclose(found["still"], np.array([0, 0, 1, 1, 1, 1, 2, 3, 3, 0]) * H, atol=1e-12)
    assert found["failed"] == [False] * 7 + [True, True, False]


@pytest.mark.parametrize(("class_", "parameters"), KINDS)
def test_latching(block: Callable[..., Any], class_: str, parameters: dict[str, float]) -> None:
    """A latched failure outlasts its cause and breaks, until a reset; if the cause is there, it fails again at once."""
    calm, cause = ([0.0, 0.0], [0.0, 9.0]) if class_ != "StuckMonitor" else ([0.0, 200.0], [0.0, 0.0])
    monitor = block("monitors.py", class_, latching=True, **parameters)
    if class_ == "StuckMonitor":
        monitor.set(persistence=H)
    assert watch(monitor, calm)["failed"] == [False, False]
    assert watch(monitor, cause)["failed"][-1]
    assert watch(monitor, calm * 3)["failed"] == [True] * 6
    monitor.rest()
    assert watch(monitor, calm)["failed"] == [True] * 2
    assert watch(monitor, calm[-1:], reset=True)["failed"] == [False]
    assert watch(monitor, calm)["failed"] == [False] * 2
    watch(monitor, cause)
    monitor.set(latching=False)
    assert not watch(monitor, calm)["failed"][-1]


@pytest.mark.parametrize(("class_", "parameters"), KINDS)
def test_a_reset_begins_the_time_anew(block: Callable[..., Any], class_: str, parameters: dict[str, float]) -> None:
    """Both before the failure and after it: the run with `reset` is the first of four."""
    monitor = block("monitors.py", class_, **parameters | {"persistence": 0.03})
    cause = [0.0] * 20 if class_ == "StuckMonitor" else [float(9 * k) for k in range(2, 22)]
    assert not any(watch(monitor, cause[:3])["failed"])
    for begin in (3, 8):
        assert watch(monitor, cause[begin : begin + 1], reset=True)["failed"] == [False]
        assert watch(monitor, cause[begin + 1 : begin + 5])["failed"] == [False, False, True, True]


@pytest.mark.parametrize(("class_", "parameters"), KINDS)
def test_without_latching_a_break_forgets(block: Callable[..., Any], class_: str, parameters: dict[str, float]) -> None:
    monitor = block("monitors.py", class_, **parameters | {"persistence": 0.02})
    cause = [0.0] * 9 if class_ == "StuckMonitor" else [float(9 * k) for k in range(2, 11)]
    for runs in (2, 9):  # before the failure, and after it
        assert watch(monitor, cause[:runs])["failed"][-1] == (runs == 9)
        monitor.rest()
    found = watch(monitor, cause[:4])
    assert found["failed"][:2] == [False, False] and found["failed"][3]


def test_a_break_makes_no_rate(block: Callable[..., Any]) -> None:
    monitor = block("monitors.py", "RateMonitor", max_rate=1.0)
    watch(monitor, [5.0, 5.0])
    monitor.rest()
    assert watch(monitor, [-100.0, -100.0])["rate"] == [0.0, 0.0]
    monitor.rest()
    assert watch(monitor, [math.nan, 7.0])["rate"] == [0.0, 0.0]


@pytest.mark.parametrize(("class_", "parameters"), KINDS)
def test_parameters_change_in_flight(block: Callable[..., Any], class_: str, parameters: dict[str, float]) -> None:
    monitor = block("monitors.py", class_, **parameters | {"persistence": 10.0})
    cause = [0.0] * 9 if class_ == "StuckMonitor" else [float(9 * k) for k in range(2, 11)]
    assert not any(watch(monitor, cause[:5])["failed"])
    monitor.set(persistence=0.02)
    assert watch(monitor, cause[5:6])["failed"] == [True]


@pytest.mark.parametrize(("class_", "parameters"), KINDS)
def test_extremes_cause_no_fault(block: Callable[..., Any], class_: str, parameters: dict[str, float]) -> None:
    rng = np.random.default_rng(5)
    extremes = [0.0, -0.0, 5e-324, -1e-310, 1.0, 1e300, -1.7e308, 1.7e308, math.nan, -math.inf]
    monitor = block("monitors.py", class_, **parameters)
    for _ in range(200):
        monitor.set(**{n: abs(float(rng.choice(extremes[:8]))) for n in parameters}, latching=bool(rng.integers(2)))
        monitor.step(value=float(rng.choice(extremes)), reset=bool(rng.uniform() < 0.1))
    assert monitor.native.get_value("block.counters.faults") == 0
