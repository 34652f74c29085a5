# SPDX-License-Identifier: Apache-2.0
"""ScheduledPid against Pid, numpy's interpolation, SciPy's filters and a closed form with moving gains; jumps of the
schedule, loops with a plant, limits, breaks, inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal
from scipy.interpolate import make_interp_spline

H = 0.01
ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
TABLES: dict[str, Any] = {
    "breakpoints": [10.0, 20.0, 50.0],
    "kp_table": [4.0, 2.0, 0.5],
    "ki_table": [8.0, 3.0, 1.0],
    "kd_table": [0.4, 0.2, 0.0],
}


def scheduled(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    values = {**TABLES, **more}
    return block("scheduled_pid.py", "ScheduledPid", rate=rate, sizes={"n": len(values["breakpoints"])}, **values)


def flat(kp: float, ki: float = 0.0, kd: float = 0.0) -> dict[str, Any]:
    return {"breakpoints": [0.0, 1.0], "kp_table": [kp] * 2, "ki_table": [ki] * 2, "kd_table": [kd] * 2}


def feed(pid: Any, **inputs: Any) -> dict[str, Any]:
    given = {"setpoint": 0.0, "measured": 0.0, "feedforward": 0.0, "track": 0.0} | inputs
    return dict(pid.step(**given))


def test_with_a_flat_table_it_is_pid(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(1)
    more = {"b": 0.7, "c": 0.3, "derivative_time": 0.05, "low": -3.0, "high": 3.0}
    gains = {"kp": 1.7, "ki": 5.0, "kd": 0.3}
    for tracking_time in (0.0, 0.1):
        more["tracking_time"] = tracking_time
        pid, unit = block("pid.py", "Pid", **more, **gains), scheduled(block, **{**more, **flat(**gains)})
        saturated = 0
        for k in range(300):
            r, y, f, t = rng.normal(size=4).tolist()
            if k % 100 == 50:
                pid.rest()
                unit.rest()
            if k % 100 == 70:
                y = float("nan")
            expected = feed(pid, setpoint=r, measured=y, feedforward=f, track=t)
            found = feed(unit, setpoint=r, measured=y, feedforward=f, track=t, schedule=rng.uniform(-1.0, 2.0))
            assert {n: found[n] for n in expected} == expected
            saturated += expected["saturated"]
        assert 30 < saturated < 270


def test_the_gains_are_those_of_numpy_and_scipy(block: Callable[..., Any]) -> None:
    unit = scheduled(block)
    for x in [-1e300, 9.0, 10.0, 12.5, 20.0, 33.0, 50.0, 51.0, 1e300]:
        out = feed(unit, schedule=x)
        for name in ("kp", "ki", "kd"):
            table = TABLES[f"{name}_table"]
            assert out[name] == pytest.approx(np.interp(x, TABLES["breakpoints"], table), rel=1e-14)
            line = make_interp_spline(TABLES["breakpoints"], table, k=1)
            assert out[name] == pytest.approx(float(line(np.clip(x, 10.0, 50.0))), rel=1e-12)


def test_between_breakpoints_it_is_the_pid_of_scipy(block: Callable[..., Any]) -> None:
    """At 35: kp 1.25, ki 2, kd 0.1."""
    tf = 0.05
    unit = scheduled(block, derivative_time=tf, c=1.0)
    feed(unit, schedule=35.0)
    errors = np.random.default_rng(2).normal(size=200)
    found = [feed(unit, setpoint=e, schedule=35.0)["command"] for e in errors]
    integral = signal.lfilter([0.0, 2.0 * H], [1.0, -1.0], errors)
    derivative = signal.lfilter(np.array([0.1, -0.1]) / (tf + H), [1.0, -tf / (tf + H)], errors)
    np.testing.assert_allclose(found, 1.25 * errors + integral + derivative, rtol=1e-9, atol=1e-9)


def test_moving_gains_are_the_velocity_form(block: Callable[..., Any]) -> None:
    """v = sum of kp of the run before times the change of b r - y, and of ki e h, as sums of numpy."""
    rng = np.random.default_rng(3)
    b = 0.6
    unit = scheduled(block, b=b, kd_table=[0.0] * 3)
    x, r, y = rng.uniform(0.0, 60.0, 200), rng.normal(size=200), rng.normal(size=200)
    found = [feed(unit, setpoint=r[k], measured=y[k], schedule=x[k], track=0.9)["command"] for k in range(200)]
    kp, ki = (np.interp(x, TABLES["breakpoints"], TABLES[n]) for n in ("kp_table", "ki_table"))
    moves = kp[:-1] * np.diff(b * r - y) + ki[:-1] * (r - y)[:-1] * H
    np.testing.assert_allclose(found, 0.9 + np.concatenate([[0.0], np.cumsum(moves)]), atol=1e-10)


@pytest.mark.parametrize("b", [0.0, 0.5, 1.0])
def test_a_jump_of_the_schedule_makes_none_in_the_command(block: Callable[..., Any], b: float) -> None:
    unit = scheduled(block, b=b, derivative_time=0.1)
    feed(unit, setpoint=3.0, measured=1.0, schedule=10.0)
    before = [feed(unit, setpoint=3.0, measured=1.0, schedule=10.0)["command"] for _ in range(200)][-1]
    after = feed(unit, setpoint=3.0, measured=1.0, schedule=50.0)
    assert after["kp"] == 0.5 and after["command"] - before == pytest.approx(8.0 * 2.0 * H)  # of the last ki
    unit.set(kp_table=[4.0, 2.0, 70.0], ki_table=[8.0, 3.0, 30.0])  # nor do other tables
    last = feed(unit, setpoint=3.0, measured=1.0, schedule=50.0)
    assert last["kp"] == 70.0 and last["command"] - after["command"] == pytest.approx(1.0 * 2.0 * H)


def test_the_schedule_does_not_disturb_a_loop_at_rest(block: Callable[..., Any]) -> None:
    """x' = u - x at its setpoint, b = 0.3: nothing moves. The control is Pid with the same gains set in flight."""
    unit = scheduled(block, b=0.3, kd_table=[0.0] * 3)
    pid = block("pid.py", "Pid", kp=4.0, ki=8.0, b=0.3)
    moved = {}
    for name, law in (("scheduled", unit), ("pid", pid)):
        x, trace = 0.0, []
        for k in range(1200):
            at = 10.0 if k < 800 else 50.0
            if name == "pid" and k == 800:
                pid.set(kp=0.5, ki=1.0)
            inputs = {"setpoint": 2.0, "measured": x} | ({"schedule": at} if name == "scheduled" else {})
            u = feed(law, **inputs)["command"]
            x = u + (x - u) * np.exp(-H)
            trace.append(x)
        assert trace[799] == pytest.approx(2.0, abs=1e-6)
        moved[name] = np.abs(np.array(trace[800:]) - 2.0).max()
    assert moved["scheduled"] < 1e-6 and moved["pid"] > 0.1


def test_a_plant_whose_gain_is_scheduled_away(block: Callable[..., Any]) -> None:
    """y' = g (u - y / g), kp and ki as 1 / g: the loop is the same at every g, here from 1 to 10."""
    points = np.linspace(1.0, 10.0, 10)
    tables = {"breakpoints": points.tolist(), "kp_table": (4.0 / points).tolist(), "ki_table": (8.0 / points).tolist()}
    responses = []
    for g in (1.0, 4.0, 10.0):
        unit = scheduled(block, **tables, kd_table=[0.0] * 10)
        feed(unit, schedule=g)
        y, trace = 0.0, []
        for _ in range(200):
            u = feed(unit, setpoint=1.0, measured=y, schedule=g)["command"]
            y = g * u + (y - g * u) * np.exp(-H)
            trace.append(y)
        responses.append(trace)
    np.testing.assert_allclose(responses[1], responses[0], rtol=1e-9)
    np.testing.assert_allclose(responses[2], responses[0], rtol=1e-9)
    assert responses[0][-1] == pytest.approx(1.0, abs=0.05)


def test_without_integral_action_p_follows_kp(block: Callable[..., Any]) -> None:
    unit = scheduled(block, ki_table=[0.0] * 3, kd_table=[0.0] * 3)
    feed(unit, schedule=10.0)
    for x, kp in ((10.0, 4.0), (20.0, 2.0), (50.0, 0.5), (10.0, 4.0)):
        assert feed(unit, setpoint=3.0, schedule=x)["command"] == pytest.approx(3.0 * kp)


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("tracking_time", [0.0, 0.2])
def test_windup(block: Callable[..., Any], tracking_time: float, side: float) -> None:
    """Against a limit for 4 s, while kp falls to an eighth: nothing of the large P is left in I."""
    unit = scheduled(block, low=-1.2, high=1.2, tracking_time=tracking_time, kd_table=[0.0] * 3)
    feed(unit, schedule=10.0)
    for k in range(400):
        held = feed(unit, setpoint=9.0 * side, schedule=10.0 + 0.1 * k)
    assert held["command"] == 1.2 * side and held["saturated"]
    back = [feed(unit, setpoint=-9.0 * side, schedule=50.0)["command"] for _ in range(3)]
    assert back[-1] == -1.2 * side


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize("moves", [1.0, -1.0])
def test_the_integral_stands_still_at_a_limit(block: Callable[..., Any], side: float, moves: float) -> None:
    """P alone is beyond the limit, whatever kp is, and I is 0: it still is when the error is gone."""
    unit = scheduled(block, low=-1.2, high=1.2, kd_table=[0.0] * 3)
    feed(unit, schedule=30.0)
    for k in range(100):
        feed(unit, setpoint=9.0 * side, schedule=30.0 + 0.2 * moves * k)
    assert feed(unit, schedule=30.0)["command"] == 0.0


def test_it_begins_at_the_tracked_command(block: Callable[..., Any]) -> None:
    unit = scheduled(block, high=5.0, derivative_time=0.1)
    assert feed(unit, setpoint=2.0, measured=1.0, track=0.7, schedule=15.0)["command"] == pytest.approx(0.7)
    for _ in range(50):
        feed(unit, setpoint=2.0, measured=1.0, schedule=15.0)
    unit.rest()
    out = feed(unit, setpoint=-3.0, measured=4.0, track=1.5, schedule=45.0)
    assert out["command"] == pytest.approx(1.5) and out["kp"] == pytest.approx(0.75)
    unit.rest()
    assert feed(unit, setpoint=-3.0, measured=4.0, track=9.0, schedule=0.0)["command"] == pytest.approx(5.0)


@pytest.mark.parametrize("name", ["setpoint", "measured", "feedforward", "schedule"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], name: str, value: float) -> None:
    unit, control = scheduled(block), scheduled(block)
    for law in (unit, control):
        feed(law, schedule=30.0)
        before = feed(law, setpoint=1.0, schedule=30.0)
    bad = feed(unit, **{"setpoint": 1.0, "schedule": 30.0, name: value})
    assert bad == before | {"health": "degraded"}
    expected = feed(control, setpoint=2.0, measured=0.5, schedule=40.0)
    assert feed(unit, setpoint=2.0, measured=0.5, schedule=40.0) == expected


def test_a_start_waits(block: Callable[..., Any]) -> None:
    unit = scheduled(block)
    feed(unit, setpoint=1.0, schedule=20.0)
    unit.rest()
    nan = float("nan")
    assert feed(unit, setpoint=5.0, schedule=nan, track=2.0)["health"] == "degraded"
    assert feed(unit, setpoint=5.0, measured=nan, schedule=20.0, track=2.0)["health"] == "degraded"
    assert feed(unit, setpoint=5.0, schedule=20.0, track=nan)["health"] == "degraded"
    assert feed(unit, setpoint=5.0, schedule=20.0, track=2.0)["command"] == pytest.approx(2.0)


def test_the_period_is_that_of_the_state(block: Callable[..., Any]) -> None:
    for rate in (100, 500):
        unit = scheduled(block, rate=rate, **flat(kp=0.0, ki=1.0))
        feed(unit, schedule=0.5)
        last = [feed(unit, setpoint=1.0, schedule=0.5)["command"] for _ in range(rate)][-1]
        assert last == pytest.approx((rate - 1) / rate)


def test_breakpoints_that_do_not_ascend(block: Callable[..., Any]) -> None:
    """In the JSON they are refused (E441); a host may set them."""
    unit = scheduled(block)
    unit.set(breakpoints=[10.0, 50.0, 50.0])
    assert feed(unit, schedule=20.0)["health"] == "nominal"
    assert feed(unit, schedule=60.0)["health"] == "degraded"  # 0 / 0 at the end
    unit.set(breakpoints=[50.0, 10.0, 20.0])
    for x in ODD:
        feed(unit, schedule=x)
    assert unit.native.get_value("block.counters.faults") == 0


def test_extremes(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(4)
    for tracking_time in (0.0, 5e-324):
        unit = scheduled(block, low=-5.0, high=5.0, tracking_time=tracking_time)
        for k in range(300):
            names = ("setpoint", "measured", "feedforward", "schedule", "track")
            out = feed(unit, **dict(zip(names, rng.choice(ODD, 5).tolist(), strict=True)))
            assert -5.0 <= out["command"] <= 5.0
            if k % 40 == 0:
                unit.rest()
            if k % 50 == 0:
                for name in ("breakpoints", "kp_table"):
                    unit.set(**{name: rng.choice(ODD, 3).tolist()})
                unit.set(ki_table=rng.choice([0.0, 5e-324, 1e300, 2.0], 3).tolist())
        assert unit.native.get_value("block.counters.faults") == 0
        unit.set(**TABLES)
        unit.rest()
        assert feed(unit, setpoint=1.0, schedule=20.0, track=0.5)["command"] == pytest.approx(0.5)
