# SPDX-License-Identifier: Apache-2.0
"""Trapezoid against the least time of a linear program (SciPy) and closed forms, Quintic against SciPy's polynomials from
derivatives; targets, limits and plans that change on the way, breaks, and inputs that are not finite."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import BPoly
from scipy.optimize import linprog

H = 0.01
EXTREMES = [0.0, -0.0, 5e-324, -1e-310, 1.0, -3.0, 1e150, -1e160, 1e300, -1.7e308]


def go(trapezoid: Any, **inputs: Any) -> dict[str, Any]:
    return dict(trapezoid.step(**{"target": 0.0, "track_position": 0.0, "track_velocity": 0.0, **inputs}))


def travel(trapezoid: Any, runs: int, **inputs: Any) -> dict[str, np.ndarray[Any, Any]]:
    found = [go(trapezoid, **inputs) for _ in range(runs)]
    return {name: np.array([f[name] for f in found]) for name in found[0]}


def feasible(x: float, v: float, target: float, vmax: float, amax: float, n: int, h: float) -> bool:
    """Whether n accelerations, each held for h, lead to rest at the target, with the velocities within the limit."""
    k = np.arange(n)
    ends = np.vstack(
        [(n - k - 0.5) * h * h, np.full(n, h)]
    )  # what each adds to the position and the velocity at the end
    sums = np.tril(np.ones((n, n))) * h
    found = linprog(
        np.zeros(n),
        A_ub=np.vstack([sums, -sums]),
        b_ub=np.concatenate([np.full(n, vmax - v), np.full(n, vmax + v)]),
        A_eq=ends,
        b_eq=[target - x - v * n * h, -v],
        bounds=(-amax, amax),
    )
    return bool(found.status == 0)


@pytest.mark.parametrize(
    ("x", "v", "target", "vmax", "amax"),
    [
        (0.0, 0.0, 1.0, 1.0, 4.0),  # with cruise
        (0.0, 0.0, 0.1, 1.0, 4.0),  # without
        (0.3, 0.8, -0.5, 1.0, 3.0),  # first to the wrong side
        (0.0, 0.9, 0.05, 1.0, 3.0),  # too fast to stop before the target
        (-0.2, -0.7, 0.9, 0.8, 5.0),
    ],
)
def test_the_time_is_the_least(
    block: Callable[..., Any], x: float, v: float, target: float, vmax: float, amax: float
) -> None:
    """One period less is infeasible for any accelerations that are held for a period; two more are feasible."""
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=vmax, max_acceleration=amax)
    found = travel(trapezoid, 250, target=target, track_position=x, track_velocity=v)
    runs = int(np.argmax(found["arrived"]))
    assert 10 < runs < 200 and found["remaining"][0] == pytest.approx(runs * H, abs=H)
    assert not feasible(x, v, target, vmax, amax, runs - 1, H) and feasible(x, v, target, vmax, amax, runs + 2, H)
    assert (found["position"][runs:] == target).all() and not found["velocity"][runs:].any()


def test_the_profile_is_the_closed_form(block: Callable[..., Any]) -> None:
    """From rest: up to 2 within 0.8 s, cruise, and down; 5 / 2 + 2 / 2.5 s in all."""
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=2.0, max_acceleration=2.5)
    found = travel(trapezoid, 400, target=5.0)
    t, total = np.arange(400) * H, 5.0 / 2.0 + 2.0 / 2.5
    v = np.clip(np.minimum(2.5 * t, 2.5 * (total - t)), 0.0, 2.0)
    up, down = np.minimum(t, 0.8), np.maximum(total - np.maximum(t, total - 0.8), 0.0)
    x = 1.25 * up**2 + 2.0 * np.clip(t - 0.8, 0.0, total - 1.6) + 0.8 - 1.25 * down**2
    np.testing.assert_allclose(found["velocity"], v, atol=1e-12)
    np.testing.assert_allclose(found["position"], x, atol=1e-12)
    np.testing.assert_allclose(found["remaining"], np.maximum(total - t, 0.0), atol=1e-6)
    np.testing.assert_allclose(found["acceleration"][1:], np.diff(v) / H, atol=1e-9)


def test_limits_hold_and_nothing_is_passed(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(1)
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=2.0)
    at = 0.0
    for _ in range(8):
        target = float(rng.normal(scale=10.0 ** rng.uniform(-6.0, 0.0)))
        found = travel(trapezoid, 600, target=target)
        assert np.abs(found["velocity"]).max() <= 1.0 + 1e-12
        assert np.abs(found["acceleration"]).max() <= 2.0 * (1.0 + 1e-9)
        steps = np.diff(
            found["position"]
        )  # between the least and the greatest that accelerations within the limit make
        means = 0.5 * (found["velocity"][1:] + found["velocity"][:-1])
        assert np.abs(steps - means * H).max() <= 0.25 * 2.0 * H * H * (1.0 + 1e-9)
        assert found["position"].min() >= min(at, target) - 1e-12 and found["position"].max() <= max(at, target) + 1e-12
        assert found["arrived"][-1] and found["position"][-1] == target
        assert (np.diff(found["remaining"]) <= 1e-12).all()
        at = target


def test_far_from_zero_it_arrives_too(block: Callable[..., Any]) -> None:
    """At 1e7 positions are rounded to 2e-9."""
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=2.0)
    go(trapezoid, track_position=1e7, target=1e7)
    for target in (1e7 + 0.3, 1e7 - 0.2, 1e7 - 0.2 + 1e-6):
        found = travel(trapezoid, 200, target=target)
        assert found["arrived"][-1] and found["position"][-1] == target
        assert np.abs(found["acceleration"]).max() <= 2.0 * (1.0 + 1e-3)


def test_the_target_moves_on_the_way(block: Callable[..., Any]) -> None:
    """At random: velocity and acceleration stay within their limits, and position is the integral of velocity."""
    rng = np.random.default_rng(2)
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=5.0)
    last = go(trapezoid)
    for _ in range(60):
        target = float(rng.normal())
        for _ in range(int(rng.integers(1, 20))):
            now = go(trapezoid, target=target)
            assert abs(now["velocity"]) <= 1.0 + 1e-12 and abs(now["acceleration"]) <= 5.0 * (1.0 + 1e-9)
            mean = 0.5 * (now["velocity"] + last["velocity"])
            assert abs(now["position"] - last["position"] - mean * H) <= 0.25 * 5.0 * H * H * (1.0 + 1e-9)
            last = now
    assert travel(trapezoid, 400, target=0.5)["position"][-1] == 0.5


def test_a_ramp_is_followed_at_the_way_to_stop(block: Callable[..., Any]) -> None:
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=2.0)
    lags = [k * H * 0.5 - go(trapezoid, target=k * H * 0.5)["position"] for k in range(400)]
    np.testing.assert_allclose(lags[200:], 0.5**2 / (2.0 * 2.0), atol=0.5 * H)


@pytest.mark.parametrize("target", [-0.2, 0.1, 0.235, 0.249])
def test_a_target_that_comes_too_near_is_passed_and_reached(block: Callable[..., Any], target: float) -> None:
    """At 1, with A = 2, the way to stop is 0.25: the position turns there, and comes back."""
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=2.0)
    go(trapezoid, track_velocity=1.0, target=target)
    found = travel(trapezoid, 200, target=target)
    assert found["position"].max() == pytest.approx(0.25, abs=1e-5)
    assert np.abs(np.diff(found["position"])).max() <= 1.0 * H + 1e-12
    arrival = 0.5 + 2.0 * math.sqrt((0.25 - target) / 2.0)
    assert int(np.argmax(found["arrived"])) + 1 == math.ceil(arrival / H)


def test_limits_change_in_flight(block: Callable[..., Any]) -> None:
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=2.0, max_acceleration=10.0)
    assert travel(trapezoid, 30, target=100.0)["velocity"][-1] == 2.0
    trapezoid.set(max_velocity=0.5)
    found = travel(trapezoid, 20, target=100.0)
    np.testing.assert_allclose(found["velocity"], np.maximum(2.0 - 0.1 * np.arange(1, 21), 0.5), atol=1e-12)
    trapezoid.set(max_velocity=0.0, max_acceleration=1.0)
    found = travel(trapezoid, 60, target=100.0)
    np.testing.assert_allclose(found["velocity"], np.maximum(0.5 - 0.01 * np.arange(1, 61), 0.0), atol=1e-12)
    assert found["remaining"][-1] == math.inf and not found["arrived"].any()


def test_it_begins_with_the_tracked_motion(block: Callable[..., Any]) -> None:
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=2.0, max_acceleration=10.0)
    travel(trapezoid, 10, target=4.0)
    trapezoid.rest()
    begin = {"track_position": -7.0, "track_velocity": 0.5, "target": 4.0}
    first = go(trapezoid, **begin)
    assert (first["position"], first["velocity"], first["acceleration"]) == (-7.0, 0.5, 0.0)
    second = go(trapezoid, **begin)
    assert second["velocity"] == pytest.approx(0.6) and second["position"] == pytest.approx(-7.0 + 0.55 * H)
    trapezoid.rest()
    there = go(trapezoid, track_position=4.0, target=4.0)
    assert there["arrived"] and there["remaining"] == 0.0


@pytest.mark.parametrize("rate", [100, 500])
def test_the_way_does_not_depend_on_the_period(block: Callable[..., Any], rate: int) -> None:
    trapezoid = block("trajectory.py", "Trapezoid", rate=rate, max_velocity=1.0, max_acceleration=3.0)
    found = travel(trapezoid, rate, target=2.0)
    assert found["position"][rate // 5] == pytest.approx(0.5 * 3.0 * 0.2**2)
    assert found["position"][rate * 9 // 10] == pytest.approx(1.0 / 6.0 + 0.9 - 1.0 / 3.0)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_a_target_that_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=1.0)
    before = travel(trapezoid, 20, target=1.0)
    bad = go(trapezoid, target=value)
    assert bad == {n: v[-1] for n, v in before.items()} | {"health": "degraded"}
    go(trapezoid, target=1.0)
    assert go(trapezoid, target=1.0, track_position=value)["health"] == "nominal"  # not read any more
    trapezoid.rest()
    for port in ("target", "track_position", "track_velocity"):
        assert go(trapezoid, **{"track_position": 5.0, port: value})["health"] == "degraded"
    assert go(trapezoid, track_position=5.0)["position"] == 5.0  # the first run with what is finite


def test_extremes_of_the_trapezoid(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(3)
    trapezoid = block("trajectory.py", "Trapezoid", max_velocity=1.0, max_acceleration=1.0)
    for _ in range(300):
        trapezoid.set(max_velocity=abs(rng.choice(EXTREMES)), max_acceleration=max(1e-9, rng.choice(EXTREMES)))
        if rng.uniform() < 0.3:
            trapezoid.rest()
        found = go(
            trapezoid, **{n: float(rng.choice(EXTREMES)) for n in ("target", "track_position", "track_velocity")}
        )
        assert np.isfinite([found["position"], found["velocity"]]).all() and found["health"] in ("nominal", "degraded")
    assert trapezoid.native.get_value("block.counters.faults") == 0


START, END = [1.0, -2.0, 3.0], [-4.0, 5.0, -6.0]
NAMES = ["position", "velocity", "acceleration"]


def quintic_step(quintic: Any, start: Any = START, end: Any = END, **inputs: Any) -> dict[str, Any]:
    motions = {f"track_{n}": v for n, v in zip(NAMES, start, strict=True)}
    motions |= {f"end_{n}": v for n, v in zip(NAMES, end, strict=True)}
    return dict(quintic.step(**{"duration": 1.5, "restart": False, **motions, **inputs}))


def motion(found: dict[str, Any]) -> list[float]:
    return [found[n] for n in NAMES]


def reference(start: Any, end: Any, duration: float, times: Any) -> np.ndarray[Any, Any]:
    """Rows of position, velocity, acceleration."""
    way = BPoly.from_derivatives([0.0, duration], [start, end])
    return np.array([way(times), way(times, nu=1), way(times, nu=2)]).T


@pytest.mark.parametrize("rate", [100, 500])
@pytest.mark.parametrize("duration", [0.3, 1.5])
def test_it_is_the_polynomial_of_scipy(block: Callable[..., Any], rate: int, duration: float) -> None:
    quintic = block("trajectory.py", "Quintic", rate=rate)
    runs = round(duration * rate)
    found = [quintic_step(quintic, duration=duration) for _ in range(runs + 5)]
    times = np.arange(runs) / rate
    np.testing.assert_allclose(
        [motion(f) for f in found[:runs]], reference(START, END, duration, times), atol=1e-9, rtol=1e-9
    )
    np.testing.assert_allclose([f["remaining"] for f in found[:runs]], duration - times, atol=1e-9)
    assert motion(found[0]) == START and [motion(f) for f in found[runs:]] == [END] * 5
    assert [f["done"] for f in found] == [False] * runs + [True] * 5


def test_a_duration_between_periods_ends_in_the_next_run(block: Callable[..., Any]) -> None:
    quintic = block("trajectory.py", "Quintic")
    done = [quintic_step(quintic, duration=0.105)["done"] for _ in range(12)]
    assert done == [False] * 11 + [True]


def test_a_restart_is_smooth(block: Callable[..., Any]) -> None:
    """The new way begins with the motion that the old one has in that run."""
    quintic = block("trajectory.py", "Quintic")
    for _ in range(40):
        quintic_step(quintic)
    now = quintic_step(quintic, end=[9.0, 0.0, 0.0], duration=0.8, restart=True)
    old = reference(START, END, 1.5, 0.4)
    np.testing.assert_allclose(motion(now), old, rtol=1e-9)
    found = [motion(quintic_step(quintic)) for _ in range(80)]  # the end and the duration are not read any more
    np.testing.assert_allclose(found[:79], reference(old, [9.0, 0.0, 0.0], 0.8, np.arange(1, 80) * H), atol=1e-8)
    assert found[79] == [9.0, 0.0, 0.0]
    assert motion(quintic_step(quintic, end=START, duration=0.1, restart=True)) == [9.0, 0.0, 0.0]
    assert [motion(quintic_step(quintic)) for _ in range(10)][-1] == START


@pytest.mark.parametrize("duration", [0.0, -1.0, -0.0])
def test_without_time_it_is_at_the_end(block: Callable[..., Any], duration: float) -> None:
    quintic = block("trajectory.py", "Quintic")
    for _ in range(2):
        found = quintic_step(quintic, duration=duration)
        assert motion(found) == END and found["done"] and found["remaining"] == 0.0


def test_after_a_break_it_begins_anew(block: Callable[..., Any]) -> None:
    quintic = block("trajectory.py", "Quintic")
    for _ in range(60):
        quintic_step(quintic)
    quintic.rest()
    start, end = [0.5, 0.25, 0.0], [1.0, 0.0, 0.0]
    found = [motion(quintic_step(quintic, start=start, end=end, duration=1.0)) for _ in range(101)]
    np.testing.assert_allclose(found, reference(start, end, 1.0, np.arange(101) * H), atol=1e-12)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_begins_no_way(block: Callable[..., Any], value: float) -> None:
    quintic = block("trajectory.py", "Quintic")
    for port in [f"{kind}_{n}" for kind in ("track", "end") for n in NAMES] + ["duration"]:
        assert quintic_step(quintic, **{port: value})["health"] == "degraded"
    assert motion(quintic_step(quintic)) == START
    before = [quintic_step(quintic) for _ in range(30)][-1]
    assert quintic_step(quintic, end=[value] * 3, restart=True) == before | {"health": "degraded"}
    after = quintic_step(quintic, start=[value] * 3, end=[value] * 3, duration=value)  # not read on the way
    assert after["health"] == "nominal"
    np.testing.assert_allclose(motion(after), reference(START, END, 1.5, 31 * H), rtol=1e-9)


def test_extremes_of_the_quintic(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(4)
    quintic = block("trajectory.py", "Quintic")
    for _ in range(300):
        if rng.uniform() < 0.3:
            quintic.rest()
        start, end = rng.choice(EXTREMES, size=3).tolist(), rng.choice(EXTREMES, size=3).tolist()
        duration = float(rng.choice([*EXTREMES, 0.02, 0.05]))
        found = quintic_step(quintic, start=start, end=end, duration=duration, restart=bool(rng.integers(2)))
        assert np.isfinite(motion(found)).all() and found["health"] in ("nominal", "degraded")
    assert quintic.native.get_value("block.counters.faults") == 0
