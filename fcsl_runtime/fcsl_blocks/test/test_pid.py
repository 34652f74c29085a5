# SPDX-License-Identifier: Apache-2.0
"""Pid against closed forms, SciPy, and a loop with a plant; limits, breaks, changes of gains, and inputs that are not
finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal

H = 0.01


def feed(pid: Any, **inputs: Any) -> dict[str, Any]:
    return dict(pid.step(**{"setpoint": 0.0, "measured": 0.0, "feedforward": 0.0, "track": 0.0, **inputs}))


def test_proportional_weights_and_feedforward(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=2.0, b=0.25)
    feed(pid)
    assert feed(pid, setpoint=4.0, measured=1.0, feedforward=0.5)["command"] == 2.0 * (0.25 * 4.0 - 1.0) + 0.5


def test_the_parts_are_those_of_scipy(block: Callable[..., Any]) -> None:
    """I: forward Euler, ki h / (z - 1). D: backward differences, kd (z - 1) / ((tf + h) z - tf)."""
    kp, ki, kd, tf = 1.5, 4.0, 0.2, 0.05
    pid = block("pid.py", "Pid", kp=kp, ki=ki, kd=kd, derivative_time=tf, c=1.0)
    feed(pid)  # the first run begins at `track`
    errors = np.random.default_rng(1).normal(size=200)
    found = [feed(pid, setpoint=e)["command"] for e in errors]
    integral = signal.lfilter([0.0, ki * H], [1.0, -1.0], errors)
    derivative = signal.lfilter(np.array([kd, -kd]) / (tf + H), [1.0, -tf / (tf + H)], errors)
    np.testing.assert_allclose(found, kp * errors + integral + derivative, rtol=1e-9, atol=1e-9)


def test_a_setpoint_step_makes_no_kick(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=1.0, kd=10.0)
    feed(pid)
    assert feed(pid, setpoint=1.0)["command"] == 1.0
    assert feed(pid, setpoint=1.0, measured=0.1)["command"] == pytest.approx(0.9 - 10.0 * 0.1 / H)


def closed_loop(pid: Any, setpoint: float, runs: int) -> np.ndarray[Any, Any]:
    """x' = u - x, exactly sampled."""
    x, trace = 0.0, []
    for _ in range(runs):
        u = feed(pid, setpoint=setpoint, measured=x)["command"]
        x = u + (x - u) * np.exp(-H)
        trace.append(x)
    return np.array(trace)


@pytest.mark.parametrize("tracking_time", [0.0, 0.2])
def test_windup(block: Callable[..., Any], tracking_time: float) -> None:
    """Against a limit for 4 s, the integral does not grow: the loop returns without a long overshoot."""
    limits: dict[str, Any] = {"low": -1.2, "high": 1.2, "tracking_time": tracking_time}
    pid = block("pid.py", "Pid", kp=4.0, ki=8.0, **limits)
    feed(pid)
    trace = closed_loop(pid, 1.0, 600)
    assert trace.max() < 1.1 and abs(trace[-1] - 1.0) < 1e-3
    held = feed(pid, setpoint=9.0)
    for _ in range(400):
        held = feed(pid, setpoint=9.0, measured=0.0)
    assert held["command"] == 1.2 and held["saturated"]
    back = [feed(pid, setpoint=-9.0)["command"] for _ in range(3)]
    assert back[-1] == -1.2


def test_without_protection_the_integral_would_wind_up(block: Callable[..., Any]) -> None:
    """The control: wide limits outside of the block leave it unprotected."""
    pid = block("pid.py", "Pid", kp=4.0, ki=8.0)
    feed(pid)
    for _ in range(400):
        feed(pid, setpoint=9.0)
    assert feed(pid, setpoint=-9.0)["command"] > 1.2


def test_it_begins_at_the_tracked_command(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=3.0, ki=1.0, kd=0.5, high=5.0)
    assert feed(pid, setpoint=2.0, measured=1.0, track=0.7)["command"] == pytest.approx(0.7)
    for _ in range(50):
        feed(pid, setpoint=2.0, measured=1.0)
    pid.rest()
    assert feed(pid, setpoint=-3.0, measured=4.0, track=1.5)["command"] == pytest.approx(1.5)
    pid.rest()
    assert feed(pid, setpoint=-3.0, measured=4.0, track=9.0)["command"] == pytest.approx(5.0)


def test_a_change_of_the_integral_gain_makes_no_jump(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=1.0, ki=2.0)
    feed(pid)
    before = [feed(pid, setpoint=1.0)["command"] for _ in range(30)][-1]
    pid.set(ki=20.0)
    assert feed(pid, setpoint=1.0)["command"] - before == pytest.approx(2.0 * H)


@pytest.mark.parametrize("name", ["setpoint", "measured", "feedforward"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], name: str, value: float) -> None:
    pid = block("pid.py", "Pid", kp=1.0, ki=1.0, kd=0.1)
    feed(pid)
    before = feed(pid, setpoint=1.0)
    bad = feed(pid, **{"setpoint": 1.0, name: value})
    assert bad["command"] == before["command"] and bad["health"] == "degraded"
    after = feed(pid, setpoint=1.0)
    assert np.isfinite(after["command"]) and after["health"] == "nominal"


def test_a_start_waits_for_a_measurement(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=1.0, ki=1.0)
    feed(pid, setpoint=1.0)
    pid.rest()
    assert feed(pid, setpoint=5.0, measured=float("nan"), track=2.0)["health"] == "degraded"
    assert feed(pid, setpoint=5.0, measured=1.0, track=float("nan"))["health"] == "degraded"
    assert feed(pid, setpoint=5.0, measured=1.0, track=2.0)["command"] == pytest.approx(2.0)


def test_the_period_is_that_of_the_state(block: Callable[..., Any]) -> None:
    for rate in (100, 500):
        pid = block("pid.py", "Pid", rate=rate, kp=0.0, ki=1.0)
        feed(pid)
        last = [feed(pid, setpoint=1.0)["command"] for _ in range(rate)][-1]
        assert last == pytest.approx((rate - 1) / rate)


def test_a_step_too_large_for_a_double_is_passed_over(block: Callable[..., Any]) -> None:
    """It left I and D at NaN before."""
    pid = block("pid.py", "Pid", kp=1e10, ki=1.0, kd=1.0, c=1.0, low=-1.0, high=1.0)
    given = {"measured": 0.0, "feedforward": 0.0, "track": 0.0}
    first = pid.step(setpoint=0.0, **given)
    lost = pid.step(setpoint=1e308, **given)
    assert lost["health"] == "degraded" and lost["command"] == first["command"]
    after = pid.step(setpoint=0.0, **given)
    assert after["health"] == "nominal" and after["command"] == 0.0


def test_without_integral_action_the_start_leaves_no_offset(block: Callable[..., Any]) -> None:
    pid = block("pid.py", "Pid", kp=2.0)
    given = {"measured": 0.0, "feedforward": 0.0, "track": 5.0}
    assert pid.step(setpoint=1.0, **given)["command"] == 2.0
    assert pid.step(setpoint=0.0, **given)["command"] == 0.0
