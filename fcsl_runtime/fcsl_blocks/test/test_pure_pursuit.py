# SPDX-License-Identifier: Apache-2.0
"""PurePursuit against scipy: nearest points by a k-d tree, goals by brentq, arcs by solve_ivp, its linear loop by expm;
and closed forms on circles."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import interp1d
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.spatial import KDTree

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
BEND = [[0.0, 0.0], [4.0, 0.0], [6.0, 3.0], [6.0, 3.0], [5.0, 7.0], [9.0, 8.0]]  # with a point twice


class Follower:
    """A block and its path."""

    def __init__(self, block: Callable[..., Any], path: Any, n: int | None = None, rate: int = 100, **more: Any):
        self.path = np.array(path, float).reshape(-1, 2)
        n = n or len(self.path)
        given: dict[str, Any] = {"lookahead_min": 1.0, **more}
        self.block = block("pure_pursuit.py", "PurePursuit", rate=rate, sizes={"n": n}, **given)
        self.rest = np.full((n - len(self.path), 2), np.nan)  # what is not in use

    def step(self, position: Any = (0.0, 0.0), heading: float = 0.0, speed: float = 1.0, **more: Any) -> dict[str, Any]:
        given: dict[str, Any] = {
            "path": np.vstack([self.path, self.rest]).tolist(),
            "count": len(self.path),
            "restart": False,
            "position": np.asarray(position, float).tolist(),
            "heading": float(heading),
            "speed": float(speed),
        }
        found = self.block.step(**{**given, **more})
        return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def at(path: Any) -> tuple[Any, float]:
    """The path as a function of the way along it, from scipy, and its length."""
    points = np.array(path)
    points = points[[True, *(np.abs(np.diff(points, axis=0)).sum(1) > 0)]]
    s = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    return interp1d(s, points, axis=0), float(s[-1])


@pytest.mark.parametrize("n", [6, 9])
def test_nearest_and_goal_are_those_of_scipy(block: Callable[..., Any], n: int) -> None:
    f = Follower(block, BEND, n=n, goal_tolerance=0.0)
    path, length = at(BEND)
    fine = np.linspace(0.0, length, 40001)
    tree = KDTree(path(fine))
    seen = {"far": 0, "end": 0, "between": 0}
    for p in np.random.default_rng(1).uniform([-1.0, -1.5], [10.0, 9.0], (240, 2)):
        out = f.step(p, restart=True)
        distance, k = tree.query(p)
        assert abs(out["cross_track"]) == pytest.approx(distance, abs=1e-3)
        assert np.hypot(*(path(np.clip(out["progress"], 0, length)) - p)) == pytest.approx(distance, abs=1e-3)
        assert out["remaining"] == pytest.approx(length - out["progress"])
        s = np.clip(out["progress"], 0, length)
        outside = np.flatnonzero((np.hypot(*(path(fine) - p).T) > 1.0) & (fine > s))
        if distance >= 1.0:
            seen["far"] += 1
            goal = path(s)
        elif not len(outside):
            seen["end"] += 1
            goal = path(length)
        else:
            seen["between"] += 1
            i = outside[0]
            goal = path(brentq(lambda u, p=p: np.hypot(*(path(u) - p)) - 1.0, max(s, fine[i - 1] - 1e-9), fine[i]))
        np.testing.assert_allclose(out["goal"], goal, atol=1e-6)
    assert min(seen.values()) > 2, seen


def test_the_arc_leads_to_the_goal(block: Callable[..., Any]) -> None:
    f = Follower(block, BEND)
    rng = np.random.default_rng(2)
    for _ in range(20):
        p, heading, speed = rng.uniform([1, -1], [6, 5]), rng.uniform(-3, 3), rng.uniform(0.2, 2.0)
        out = f.step(p, heading, speed, restart=True)
        assert out["yaw_rate"] == pytest.approx(out["curvature"] * speed)
        end = 2 * np.pi / abs(out["curvature"])
        arc = solve_ivp(
            lambda s, x, k=out["curvature"]: [np.cos(x[2]), np.sin(x[2]), k],
            (0, end),
            [*p, heading],
            rtol=1e-9,
            max_step=end / 1500,
        )
        assert np.hypot(*(arc.y[:2].T - out["goal"]).T).min() < 4e-3 * max(1.0, end / 6)


@pytest.mark.parametrize("radius", [-8.0, 5.0])
@pytest.mark.parametrize("look", [0.5, 2.0])
def test_on_a_circle_the_curvature_is_that_of_the_circle(block: Callable[..., Any], radius: float, look: float) -> None:
    angle = np.linspace(0.0, 4.0, 801)
    circle = np.column_stack([abs(radius) * np.sin(angle), radius * (1 - np.cos(angle))])
    f = Follower(block, circle, lookahead_min=look)
    for i in (0, 80, 400):
        out = f.step(circle[i], np.sign(radius) * angle[i])
        assert out["curvature"] == pytest.approx(1.0 / radius, rel=2e-3)
        assert abs(out["cross_track"]) < 1e-9


@pytest.mark.parametrize("rate", [100, 500])
def test_beside_a_straight_line_the_loop_is_linear(block: Callable[..., Any], rate: int) -> None:
    """curvature = -2 (y / L + heading) / L for small ones: the poles are (-1 +- i) / L per metre."""
    look, h, v = 2.0, 1 / rate, 1.5
    f = Follower(block, [[0.0, 0.0], [100.0, 0.0]], rate=rate, lookahead_min=look)
    x = np.array([0.0, 0.01, 0.0])
    for _ in range(3 * rate):
        out = f.step(x[:2], x[2], v)
        assert out["cross_track"] == pytest.approx(x[1], abs=1e-12)
        middle = x[2] + out["yaw_rate"] * h / 2
        x = x + h * np.array([v * np.cos(middle), v * np.sin(middle), out["yaw_rate"]])
    wanted = expm(v * 3.0 * np.array([[0.0, 1.0], [-2 / look**2, -2 / look]])) @ [0.01, 0.0]
    np.testing.assert_allclose(x[1:], wanted, atol=1e-4)


def drive(f: Follower, x: Any, v: float = 1.0, runs: int = 6000) -> tuple[np.ndarray[Any, Any], dict[str, Any]]:
    trace, h = [], 0.01
    for _ in range(runs):
        out = f.step(x[:2], x[2], v)
        trace.append([*x, out["progress"], out["cross_track"]])
        if out["done"]:
            break
        middle = x[2] + out["yaw_rate"] * h / 2
        x = x + h * np.array([v * np.cos(middle), v * np.sin(middle), out["yaw_rate"]])
    return np.array(trace), out


def test_a_figure_of_eight_is_followed_through_its_crossing(block: Callable[..., Any]) -> None:
    t = np.linspace(0.0, 2 * np.pi, 60)
    eight = np.column_stack([3 * np.sin(t), 3 * np.sin(t) * np.cos(t)])
    f = Follower(block, eight, lookahead_min=0.3, search_distance=0.5)
    trace, out = drive(f, np.array([0.0, 0.0, np.pi / 4]))
    length = at(eight)[1]
    assert out["done"] and out["remaining"] <= 0.1 and out["curvature"] == 0.0 == out["yaw_rate"]
    assert trace[-1, 3] == pytest.approx(length, abs=0.11) and len(trace) * 0.01 == pytest.approx(length, rel=0.03)
    assert (np.diff(trace[:, 3]) >= 0.0).all() and np.abs(trace[:, 4]).max() < 0.05


def test_it_comes_from_afar_and_cuts_corners_by_less_than_the_lookahead(block: Callable[..., Any]) -> None:
    f = Follower(block, BEND, lookahead_min=0.5)
    trace, out = drive(f, np.array([-1.0, 2.0, 0.0]))
    assert out["done"] and np.abs(trace[400:, 4]).max() < 0.3


def test_lookahead_grows_with_speed(block: Callable[..., Any]) -> None:
    f = Follower(block, [[0.0, 0.0], [100.0, 0.0]], lookahead_min=0.5, lookahead_time=2.0, lookahead_max=5.0)
    for speed, look in ((0.0, 0.5), (0.1, 0.5), (1.0, 2.0), (-1.0, 2.0), (9.0, 5.0)):
        np.testing.assert_allclose(f.step((10.0, 0.0), 0.0, speed, restart=True)["goal"], [10.0 + look, 0.0])
    f.block.set(lookahead_max=20.0)
    np.testing.assert_allclose(f.step((10.0, 0.0), 0.0, 9.0)["goal"], [28.0, 0.0])


def test_the_curvature_has_a_limit(block: Callable[..., Any]) -> None:
    f = Follower(block, [[0.0, 0.0], [9.0, 0.0]], max_curvature=0.4)
    out = f.step((1.0, 0.5), 0.0)
    assert out["curvature"] == -0.4 and out["saturated"] and out["cross_track"] == 0.5
    f.block.set(max_curvature=2.0)
    out = f.step((1.0, 0.5), 0.0)
    assert out["curvature"] == pytest.approx(-1.0) and not out["saturated"]


def test_the_nearest_point_goes_on_only(block: Callable[..., Any]) -> None:
    f = Follower(block, [[0.0, 0.0], [9.0, 0.0]], search_distance=2.0)
    assert f.step((3.0, 0.0))["progress"] == 3.0  # the first run looks everywhere
    assert f.step((2.0, 0.0))["progress"] == 3.0
    assert f.step((8.0, 0.0))["progress"] == 5.0
    assert f.step((8.0, 0.0))["progress"] == 7.0
    assert f.step((1.0, 0.0), restart=True)["progress"] == 1.0
    f.block.rest()
    assert f.step((8.0, 0.0))["progress"] == 8.0
    f.path = f.path * 0.5  # a shorter path than progress
    out = f.step((4.0, 1.0))
    assert out["progress"] == 4.5 and out["remaining"] == 0.0 and out["done"]


def test_few_points(block: Callable[..., Any]) -> None:
    f = Follower(block, [[0.0, 0.0], [1.0, 2.0], [9.0, 2.0]], goal_tolerance=0.0)
    for count in (0, -1, -(2**31)):
        out = f.step((3.0, 0.0), count=count)
        assert out["done"] and out["curvature"] == 0.0 and out["health"] == "nominal" and out["cross_track"] == 0.0
    one = f.step((3.0, 1.0), count=1)
    assert (
        one["goal"].tolist() == [0.0, 0.0] and one["done"] and abs(one["cross_track"]) == pytest.approx(np.hypot(3, 1))
    )
    assert (f.step((3.0, 0.0), count=2**31 - 1)["goal"] == f.step((3.0, 0.0), count=3)["goal"]).all()
    assert f.step((1.0, 2.0), count=2)["done"]
    same = Follower(block, [[1.0, 1.0]] * 4)
    assert same.step((1.0, 1.0))["done"] and same.step((5.0, 1.0))["goal"].tolist() == [1.0, 1.0]
    single = Follower(block, [[1.0, 1.0]])
    assert single.step((5.0, 1.0))["goal"].tolist() == [1.0, 1.0]


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
@pytest.mark.parametrize("name", ["position", "heading", "speed", "path"])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], name: str, value: float) -> None:
    f = Follower(block, BEND)
    before = f.step((1.0, 0.5))
    path = f.path.copy()
    path[4, 1] = value
    bad = {"position": [1.0, value], "heading": value, "speed": value, "path": path.tolist()}
    given: dict[str, Any] = {"position": (2.0, 0.5), "restart": True, name: bad[name]}
    out = f.step(**given)
    assert out["health"] == "degraded"
    for n in f.block.outputs:
        np.testing.assert_array_equal(out[n], before[n])
    assert f.step((2.0, 0.5))["health"] == "nominal"


@pytest.mark.parametrize("restart", [False, True])
def test_a_start_waits_for_finite_inputs(block: Callable[..., Any], restart: bool) -> None:
    f = Follower(block, [[0.0, 0.0], [9.0, 0.0]], search_distance=0.5)
    f.step((3.0, 0.0))
    if not restart:
        f.block.rest()
    assert f.step((float("nan"), 0.0), restart=restart)["health"] == "degraded"
    assert f.step((7.0, 0.0))["progress"] == 7.0


def test_at_the_end_and_far_away(block: Callable[..., Any]) -> None:
    f = Follower(block, [[0.0, 0.0], [9.0, 0.0]], search_distance=2.0, lookahead_min=10.0)
    f.step((3.0, 0.0))
    out = f.step((9.0, 0.0))  # at its goal, while the nearest point is still on its way
    assert out["health"] == "nominal" and out["goal"].tolist() == [9.0, 0.0] and out["curvature"] == 0.0
    assert not out["done"]
    assert f.step((1.7e308, 1.7e308))["health"] == "degraded"
    assert f.step((9.0, 0.0), restart=True)["done"]
    assert f.step((9.0, 0.0), float("nan"))["health"] == "degraded"


def test_extremes(block: Callable[..., Any]) -> None:
    f = Follower(block, BEND, lookahead_time=0.5, search_distance=3.0, max_curvature=5.0)
    rng = np.random.default_rng(3)
    for i in range(300):
        more: dict[str, Any] = {"path": rng.choice(ODD, (6, 2)).tolist()} if i % 3 == 0 else {}
        counts = [-(2**31), -1, 0, 1, 3, 6, 7, 2**31 - 1]
        out = f.step(rng.choice(ODD, 2), *rng.choice(ODD, 2), count=int(rng.choice(counts)), **more)
        assert abs(out["curvature"]) <= 5.0 and all(
            np.isfinite(out[n]).all() for n in ("goal", "progress", "remaining")
        )
    assert f.block.native.get_value("block.counters.faults") == 0
    out = f.step((1.0, 0.0), restart=True)
    assert out["health"] == "nominal" and out["progress"] == 1.0
