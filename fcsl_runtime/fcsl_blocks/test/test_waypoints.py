# SPDX-License-Identifier: Apache-2.0
"""WaypointSequencer: its bisecting planes against scipy's cdist (a plane is where two points are equally far), distances
against numpy.linalg and scipy's minimize_scalar, dwell times, loops, jumps, breaks, and inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.spatial.distance import cdist

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, -1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
BOX = [[10.0, 0.0, 5.0], [10.0, 10.0, 5.0], [0.0, 10.0, 8.0], [0.0, 0.0, 8.0]]


class Mission:
    """A block and its waypoints."""

    def __init__(self, block: Callable[..., Any], waypoints: Any = BOX, n: int = 8, rate: int = 100, **more: Any):
        self.waypoints = np.array(waypoints, float)
        self.dwell = np.zeros(len(self.waypoints))
        self.n = n
        given = {"acceptance_radius": 1.0, **more}
        self.block = block("waypoints.py", "WaypointSequencer", rate=rate, sizes={"n": n}, **given)

    def step(self, position: Any = (0.0, 0.0, 0.0), **more: Any) -> dict[str, Any]:
        unused = self.n - len(self.waypoints)
        given: dict[str, Any] = {
            "waypoints": np.vstack([self.waypoints, np.full((unused, 3), np.nan)]).tolist(),
            "dwell": [*self.dwell, *[float("nan")] * unused],
            "count": len(self.waypoints),
            "jump": False,
            "jump_to": 0,
            "position": np.asarray(position, float).tolist(),
        }
        found = self.block.step(**{**given, **more})
        return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def unit(v: Any) -> Any:
    return v / np.linalg.norm(v)


@pytest.mark.parametrize("seed", range(4))
def test_corners_are_passed_by_their_bisecting_planes(block: Callable[..., Any], seed: int) -> None:
    """Random corners of less than 90 deg, crossed anywhere. Beyond the plane, w + p is nearer than w - q."""
    rng = np.random.default_rng(seed)
    steps = [unit(rng.normal(size=3))]
    while len(steps) < 6:
        step = unit(rng.normal(size=3))
        if 0.05 < step @ steps[-1] < 0.95:
            steps.append(step)
    points = np.cumsum(np.array(steps) * rng.uniform(20.0, 40.0, (6, 1)), axis=0)
    m = Mission(block, points, acceptance_radius=0.0)
    m.step([0.0, 0.0, 0.0])
    froms = np.vstack([[0.0, 0.0, 0.0], points])
    for i in range(5):
        w, q, p = points[i], unit(points[i] - froms[i]), unit(points[i + 1] - points[i])
        sides = 0
        for x in w + rng.normal(size=(25, 3)) * 3.0:
            near, far = cdist([x], [w + p, w - q])[0]
            out = m.step(x, jump=False)
            assert out["index"] == (i + 1 if near < far else i)
            sides += 1
            if near < far:
                assert out["previous"].tolist() == w.tolist() and out["target"].tolist() == points[i + 1].tolist()
                break
        else:
            raise AssertionError("no point was beyond the plane")
    out = m.step(points[5] - 0.01 * unit(points[5] - points[4]) + 5.0 * np.cross(steps[5], unit(steps[5][::-1] + 1.0)))
    assert not out["done"] and out["index"] == 5
    out = m.step(points[5] + 0.01 * unit(points[5] - points[4]))
    assert out["done"] and out["index"] == 5 and out["remaining"] == pytest.approx(0.01)


def test_beyond_90_degrees_the_plane_is_across_the_leg(block: Callable[..., Any]) -> None:
    points = np.array([[50.0, 0.0, 0.0], [0.0, 5.0, 0.0], [50.0, 5.0, 0.0], [0.0, 5.0, 0.0]])  # hairpins, and a U-turn
    m = Mission(block, points, acceptance_radius=0.5)
    m.step([0.0, 0.0, 0.0])
    # 3 m aside, on the inner side of the corner: beyond the bisecting plane
    assert np.diff(cdist([[20.0, 3.0, 0.0]], [points[0] + unit(points[1] - points[0]), points[0] - [1, 0, 0]])[0]) > 0
    assert m.step([20.0, 3.0, 0.0])["index"] == 0
    assert m.step([49.99, 3.0, 0.0])["index"] == 0
    assert m.step([50.01, 3.0, 0.0])["index"] == 1
    assert m.step([0.0, 5.3, 0.0])["index"] == 2
    assert m.step([30.0, 5.0, 0.0])["index"] == 2
    assert m.step([49.9, 6.0, 0.0])["index"] == 2
    assert m.step([50.1, 6.0, 0.0])["index"] == 3


def test_acceptance_radius(block: Callable[..., Any]) -> None:
    m = Mission(block, acceptance_radius=2.0, pass_plane=False)
    rng = np.random.default_rng(5)
    for i, w in enumerate(m.waypoints):
        for r in (9.0, 2.1, 2.0001, 1.9999):
            out = m.step(w + r * unit(rng.normal(size=3)))
            assert out["index"] == (min(i + 1, 3) if r < 2.0 else i)
    assert out["done"]
    m.block.set(acceptance_radius=0.1)
    m.step([5.0, 0.0, 5.0], jump=True)
    assert m.step([20.0, 9.0, 9.0])["index"] == 0  # beyond the plane
    m.block.set(pass_plane=True)
    assert m.step([20.0, 9.0, 9.0])["index"] == 1


def test_distances(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(6)
    points = rng.uniform(-30.0, 30.0, (8, 3))
    m = Mission(block, points, acceptance_radius=0.0, pass_plane=False)
    start = np.array([3.0, 4.0, 5.0])
    m.step(start)
    for i in range(8):
        assert np.array_equal(m.step(points[i - 1] if i else start)["target"], points[i])
        a, b = points[i - 1] if i else start, points[i]
        for x in rng.uniform(-40.0, 40.0, (6, 3)):
            out = m.step(x)
            fit = minimize_scalar(lambda s, a=a, b=b, x=x: np.linalg.norm(a + s * unit(b - a) - x), tol=1e-10)
            assert out["index"] == i and np.array_equal(out["previous"], a)
            assert out["along_track"] == pytest.approx(fit.x, abs=1e-5)
            assert out["cross_track"] == pytest.approx(fit.fun, abs=1e-9)
            assert out["distance"] == pytest.approx(np.linalg.norm(b - x))
            way = np.vstack([x, points[i:]])
            assert out["remaining"] == pytest.approx(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
        if i < 7:
            m.step(points[i])


@pytest.mark.parametrize("rate", [100, 500])
def test_a_flight(block: Callable[..., Any], rate: int) -> None:
    """A point at 5 m/s toward the target: legs of straight lines, so that the times are ways / speed."""
    m = Mission(block, rate=rate, acceptance_radius=0.05)
    m.dwell[1] = 0.5
    x, trace, came = np.zeros(3), [], dict[int, float]()
    for k in range(12 * rate):
        out = m.step(x)
        came.setdefault(int(out["index"]) + 10 * bool(out["done"]), k / rate)
        trace.append(out["cross_track"])
        gap = out["target"] - x
        x = x + gap * min(1.0, 5.0 / rate / max(float(np.linalg.norm(gap)), 1e-12))
    legs = np.linalg.norm(np.diff([[0.0, 0.0, 0.0], *BOX], axis=0), axis=1) / 5.0 + [0.0, 0.5, 0.0, 0.0]
    assert [came[i] for i in (1, 2, 3, 13)] == pytest.approx(np.cumsum(legs), abs=2.0 / rate + 4 * 0.05 / 5.0)
    assert max(trace) < 0.06 and x == pytest.approx(np.array(BOX[3]))


@pytest.mark.parametrize("rate", [100, 500])
def test_dwell(block: Callable[..., Any], rate: int) -> None:
    m = Mission(block, rate=rate)
    m.dwell[0] = 0.2
    m.step()
    assert not m.step([20.0, 0.0, 5.0])["dwelling"]  # passing is not enough
    found = [m.step(BOX[0])]
    found += [m.step([12.0, 0.0, 5.0]) for _ in range(rate)]  # blown away: the time counts
    assert [o["index"] for o in found] == [0] * (rate // 5) + [1] * (rate + 1 - rate // 5)
    assert [o["dwelling"] for o in found] == [True] * (rate // 5) + [False] * (rate + 1 - rate // 5)
    m.dwell[:] = [0.0, 0.0, 0.0, 0.1]
    out = [m.step(BOX[i]) for i in (1, 2, 3)][-1]
    assert out["dwelling"] and not out["done"]
    found = [m.step(BOX[3]) for _ in range(rate // 10)]
    assert [o["done"] for o in found] == [False] * (rate // 10 - 1) + [True]
    assert m.step([50.0, 50.0, 50.0])["done"]


def test_loop_and_hold(block: Callable[..., Any]) -> None:
    m = Mission(block)
    assert [m.step(p)["index"] for p in BOX] == [1, 2, 3, 3]
    out = m.step(BOX[3])
    assert out["done"] and out["distance"] == 0.0 == out["remaining"] and out["target"].tolist() == BOX[3]
    m.block.set(loop=True)
    out = m.step(BOX[3])
    assert out["index"] == 0 and not out["done"] and out["previous"].tolist() == BOX[3]
    assert [m.step(p)["index"] for p in BOX * 2] == [1, 2, 3, 0] * 2
    m.block.set(loop=False)
    assert [m.step(p)["index"] for p in BOX] == [1, 2, 3, 3]
    assert m.step(BOX[3])["done"]
    m.waypoints = np.vstack([BOX, [[0.0, 0.0, 30.0]]])  # a further one
    m.dwell = np.zeros(5)
    out = m.step(BOX[3])
    assert out["index"] == 4 and not out["done"] and out["remaining"] == 22.0


def test_the_plane_of_the_last_corner_of_a_loop(block: Callable[..., Any]) -> None:
    for loop, index in ((True, 0), (False, 3)):
        m = Mission(block, np.array(BOX) * [1.0, 1.0, 0.0], acceptance_radius=0.1, loop=loop)
        [m.step(p) for p in m.waypoints[:3]]
        out = m.step([1.0, 0.8, 0.0])  # inside of the corner, beyond its bisecting plane, before the end of the leg
        assert out["index"] == index and not out["done"]


def test_jump(block: Callable[..., Any]) -> None:
    m = Mission(block)
    m.dwell[2] = 0.1
    m.step()
    out = m.step([3.0, 4.0, 0.0], jump=True, jump_to=2)
    assert out["index"] == 2 and out["previous"].tolist() == [3.0, 4.0, 0.0] and out["along_track"] == 0.0
    [m.step(BOX[2]) for _ in range(8)]
    assert m.step(BOX[2], jump=True, jump_to=2)["dwelling"]
    assert [m.step(BOX[2])["index"] for _ in range(10)] == [2] * 9 + [3]
    assert m.step(BOX[3])["done"]
    out = m.step(BOX[2], jump=True)
    assert out["index"] == 0 and not out["done"]
    assert m.step([5.0, 5.0, 5.0], jump=True, jump_to=99)["index"] == 3
    assert m.step([5.0, 5.0, 5.0], jump=True, jump_to=-99)["index"] == 0
    m.step([np.nan, 5.0, 5.0], jump=True, jump_to=1)  # waits
    out = m.step([5.0, 6.0, 5.0])
    assert out["index"] == 1 and out["previous"].tolist() == [5.0, 6.0, 5.0]
    assert m.step([5.0, 7.0, 5.0])["previous"].tolist() == [5.0, 6.0, 5.0]


def test_after_a_break_the_mission_goes_on(block: Callable[..., Any]) -> None:
    m = Mission(block)
    m.dwell[1] = 0.1
    out = m.step([1.0, 2.0, 3.0])
    assert out["index"] == 0 and out["previous"].tolist() == [1.0, 2.0, 3.0]
    m.step(BOX[0])
    [m.step(BOX[1]) for _ in range(8)]
    m.block.rest()
    assert m.step([np.nan, 7.0, 7.0])["health"] == "degraded"
    out = m.step([7.0, 7.0, 7.0])
    assert out["index"] == 1 and out["previous"].tolist() == [7.0, 7.0, 7.0] and not out["dwelling"]
    assert [m.step(BOX[1])["index"] for _ in range(12)] == [1] * 10 + [2] * 2


def test_waypoints_and_count_change_in_flight(block: Callable[..., Any]) -> None:
    m = Mission(block)
    [m.step(p) for p in BOX[:3]]
    m.waypoints[3] = [0.0, 0.0, 20.0]
    out = m.step([0.0, 5.0, 8.0])
    assert out["target"].tolist() == [0.0, 0.0, 20.0] and out["previous"].tolist() == BOX[2]
    out = m.step([0.0, 5.0, 8.0], count=2)
    assert out["index"] == 1 and out["previous"].tolist() == [0.0, 5.0, 8.0]
    assert m.step(BOX[1], count=2)["done"]


@pytest.mark.parametrize("pass_plane", [False, True])
def test_legs_without_length(block: Callable[..., Any], pass_plane: bool) -> None:
    m = Mission(block, [BOX[0]] * 3 + [BOX[1]], pass_plane=pass_plane)
    out = m.step(BOX[0])
    assert out["index"] == 1 and out["along_track"] == 0.0 == out["cross_track"]
    assert [m.step(BOX[0])["index"] for _ in range(3)] == [2, 3, 3]
    m = Mission(block, [BOX[0]], loop=True, pass_plane=pass_plane)
    assert [m.step(BOX[0])["index"] for _ in range(3)] == [0, 0, 0]


def test_a_doubled_waypoint_is_flown_by(block: Callable[..., Any]) -> None:
    """Beyond the first of the two, on the outer side of the corner, where the second one's way on has not begun."""
    m = Mission(block, [BOX[0], BOX[0], BOX[1]], acceptance_radius=0.1)
    m.step([0.0, 0.0, 5.0])
    assert m.step([10.5, -1.0, 5.0])["index"] == 1
    assert m.step([11.0, -1.0, 5.0])["index"] == 2


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    m = Mission(block)
    m.dwell[1] = 0.1
    m.step()
    m.step(BOX[0])
    first = m.step(BOX[1])
    assert first["dwelling"]
    bad: list[dict[str, Any]] = [{"position": [value if i == k else 5.0 for i in range(3)]} for k in range(3)]
    for i in (1, 2, 3):
        points = np.full((8, 3), np.nan)
        points[:4] = BOX
        points[i, i % 3] = value
        bad.append({"waypoints": points.tolist(), "position": [5.0, 5.0, 5.0]})
    bad += [{"dwell": [0.0, value, *[0.0] * 6]}, {"count": 0}, {"count": -5}]
    for change in bad * 2:
        out = m.step(**change)
        assert out["health"] == "degraded", change
        assert all(np.array_equal(out[n], first[n]) for n in first if n != "health")
    assert [m.step(BOX[1])["index"] for _ in range(10)] == [1] * 9 + [2]  # the time has stood still
    points = np.full((8, 3), np.nan)
    points[2:4] = BOX[2:]  # what is behind does not matter
    assert m.step(BOX[2], waypoints=points.tolist())["index"] == 3


def test_extremes(block: Callable[..., Any]) -> None:
    m = Mission(block, loop=True)
    rng = np.random.default_rng(7)
    for i in range(400):
        more: dict[str, Any] = {}
        if i % 3 == 0:
            more["waypoints"] = rng.choice(ODD, (8, 3)).tolist()
        if i % 4 == 0:
            more["dwell"] = rng.choice(ODD, 8).tolist()
        if i % 50 == 0:
            m.block.set(loop=i % 100 == 0, pass_plane=bool(rng.integers(2)))
        whole = [-(2**31), -1, 0, 1, 3, 7, 8, 9, 2**31 - 1]
        counts = {"count": int(rng.choice(whole)), "jump": i % 5 == 0, "jump_to": int(rng.choice(whole))}
        out = m.step(rng.choice(ODD, 3), **counts, **more)
        for name in ("target", "previous", "along_track", "cross_track", "distance", "remaining"):
            assert np.isfinite(out[name]).all(), name
        assert 0 <= out["index"] < 8 and out["cross_track"] >= 0.0 and out["distance"] >= 0.0
    assert m.block.native.get_value("block.counters.faults") == 0
    out = m.step([0.0, 0.0, 5.0], jump=True)
    assert out["health"] == "nominal" and out["index"] == 0 and out["distance"] == 10.0
    for scale in (1e-300, 1e-160, 1e160, 1e300):
        points = np.zeros((8, 3))
        points[:4] = np.array(BOX) * scale
        m.block.set(acceptance_radius=0.0, pass_plane=True)
        m.step(jump=True, waypoints=points.tolist(), count=4)
        out = m.step(np.array([9.0, 0.0, 5.0]) * scale, waypoints=points.tolist(), count=4)
        assert out["health"] == "nominal" and out["index"] == 0
        assert out["distance"] == pytest.approx(scale, rel=1e-12, abs=0.0)
        assert m.step(np.array([10.2, 0.0, 5.0]) * scale, waypoints=points.tolist(), count=4)["index"] == 1


def test_a_leg_whose_length_overflows(block: Callable[..., Any]) -> None:
    """From corner to corner of a cube: all ways but that one are finite."""
    far, middle = np.full(3, 0.7e308), np.zeros(3)
    m = Mission(block, [-far, -far], acceptance_radius=0.0)
    m.dwell[0] = 1.0
    m.step(-far)
    m.dwell[0] = 0.0
    m.waypoints[:] = [far, middle]
    assert m.step(middle)["health"] == "degraded"
    m = Mission(block, [-far, far], acceptance_radius=1.5e308)
    assert m.step(middle)["health"] == "degraded"
