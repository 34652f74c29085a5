# SPDX-License-Identifier: Apache-2.0
"""Geofence against matplotlib's contains_points, and scipy's lsq_linear and k-d tree; closed forms of a square; hysteresis,
breaks, and inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from matplotlib.path import Path
from scipy.optimize import lsq_linear
from scipy.spatial import KDTree

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, -1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
SQUARE = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
COMB = [[0.0, 0.0], [9.0, 0.0], [9.0, 6.0], [7.0, 6.0], [6.0, 1.0], [5.0, 6.0], [3.0, 6.0], [3.0, 2.0], [2.0, 6.0]]
SPIRAL = [
    [0, 0],
    [8, 0],
    [8, 8],
    [2, 8],
    [2, 3],
    [5, 3],
    [5, 5],
    [4, 5],
    [4, 4],
    [3, 4],
    [3, 7],
    [7, 7],
    [7, 1],
    [0, 1],
]
TWICE = [[0.0, 0.0], [0.0, 0.0], [5.0, -1.0], [5.0, 4.0], [5.0, 4.0], [1.0, 3.0], [0.0, 0.0]]  # closed, points repeated
EIGHT = [[0.0, 0.0], [6.0, 6.0], [6.0, 0.0], [0.0, 6.0]]  # crosses itself


class Fence:
    """A block and its polygon."""

    def __init__(self, block: Callable[..., Any], polygon: Any, n: int | None = None, rate: int = 100, **more: Any):
        self.polygon = np.array(polygon, float)
        n = n or len(self.polygon)
        self.block = block("geofence.py", "Geofence", rate=rate, sizes={"n": n}, **more)
        self.rest = np.full((n - len(self.polygon), 2), np.nan)  # what is not in use

    def step(self, position: Any = (5.0, 5.0), altitude: float = 10.0, **more: Any) -> dict[str, Any]:
        given: dict[str, Any] = {
            "polygon": np.vstack([self.polygon, self.rest]).tolist(),
            "count": len(self.polygon),
            "position": np.asarray(position, float).tolist(),
            "altitude": float(altitude),
        }
        found = self.block.step(**{**given, **more})
        return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def edges(polygon: Any) -> list[Any]:
    points = np.array(polygon, float)
    return list(zip(points, np.roll(points, -1, axis=0), strict=True))


@pytest.mark.parametrize(
    "polygon", [SQUARE, COMB, SPIRAL, TWICE, EIGHT], ids=["square", "comb", "spiral", "twice", "eight"]
)
@pytest.mark.parametrize("turned", [False, True])
def test_inside_is_that_of_matplotlib(block: Callable[..., Any], polygon: Any, turned: bool) -> None:
    points = np.array(polygon[::-1] if turned else polygon, float)
    f = Fence(block, points, n=16)
    positions = np.random.default_rng(1).uniform(points.min(0) - 1.0, points.max(0) + 1.0, (150, 2))
    wanted = Path(np.vstack([points, points[:1]]), closed=True).contains_points(positions)
    tree = KDTree(np.vstack([np.linspace(a, b, 3001) for a, b in edges(points)]))
    found = [f.step(p) for p in positions]
    assert 10 < wanted.sum() < 140
    assert [o["inside"] for o in found] == wanted.tolist()
    distance = np.where(wanted, 1.0, -1.0) * tree.query(positions)[0]
    np.testing.assert_allclose([o["distance"] for o in found], distance, atol=3e-4)
    assert [o["breached"] for o in found] == (~wanted).tolist()


def test_rays_through_vertices(block: Callable[..., Any]) -> None:
    """On a grid, the ray toward +x meets vertices and runs along edges."""
    f = Fence(block, SPIRAL)
    path = Path([*SPIRAL, SPIRAL[0]], closed=True)
    tree = KDTree(np.vstack([np.linspace(a, b, 841) for a, b in edges(SPIRAL)]))
    for p in np.array(np.meshgrid(np.arange(-1, 10), np.arange(-1, 10))).reshape(2, -1).T.astype(float):
        out = f.step(p)
        if tree.query(p)[0] > 1e-9:
            # matplotlib's point is a little higher, so that its ray meets no vertex
            assert out["inside"] == path.contains_point((p[0], p[1] + 1e-3))
        else:
            assert abs(out["distance"]) < 1e-12 and np.abs(out["nearest"] - p).max() < 1e-12


def test_nearest_is_that_of_least_squares(block: Callable[..., Any]) -> None:
    f = Fence(block, COMB)
    for p in np.random.default_rng(2).uniform([-2.0, -2.0], [11.0, 8.0], (40, 2)):
        fits = [(a + lsq_linear(np.array([b - a]).T, p - a, (0.0, 1.0)).x * (b - a)) for a, b in edges(COMB)]
        distances = [np.hypot(*(q - p)) for q in fits]
        out = f.step(p)
        assert abs(out["distance"]) == pytest.approx(min(distances), rel=1e-6)
        assert np.hypot(*(out["nearest"] - p)) == pytest.approx(abs(out["distance"]), rel=1e-9)
        np.testing.assert_allclose(out["nearest"], fits[int(np.argmin(distances))], atol=1e-5)


def test_a_square_far_from_the_origin(block: Callable[..., Any]) -> None:
    """UTM-like coordinates: nothing cancels."""
    f = Fence(block, np.array(SQUARE) + [5e5, 6e6])
    out = f.step([5e5 + 9.75, 6e6 + 5.0])
    assert out["inside"] and out["distance"] == 0.25 and out["nearest"].tolist() == [5e5 + 10.0, 6e6 + 5.0]
    out = f.step([5e5 + 13.0, 6e6 + 14.0])
    assert not out["inside"] and out["distance"] == pytest.approx(-5.0, rel=1e-14)
    assert out["nearest"].tolist() == [5e5 + 10.0, 6e6 + 10.0]


def test_floor_and_ceiling(block: Callable[..., Any]) -> None:
    f = Fence(block, SQUARE, floor=2.0, ceiling=20.0)
    cases = [  # x, altitude, distance, vertical, clearance
        (1.0, 11.0, 1.0, 9.0, 1.0),
        (5.0, 3.0, 5.0, 1.0, 1.0),
        (5.0, 18.5, 5.0, 1.5, 1.5),
        (5.0, 1.5, 5.0, -0.5, -0.5),
        (5.0, 22.0, 5.0, -2.0, -2.0),
        (-3.0, 22.0, -3.0, -2.0, -3.0),
        (5.0, 20.0, 5.0, 0.0, 0.0),
    ]
    for x, altitude, *wanted in cases:
        out = f.step((x, 5.0), altitude)
        assert [out["distance"], out["vertical_distance"], out["clearance"]] == wanted
        assert out["inside"] == (wanted[2] >= 0.0) == (not out["breached"])
    f.block.set(ceiling=30.0)
    assert f.step((5.0, 5.0), 22.0)["inside"]
    f.block.set(floor=40.0)
    assert f.step((5.0, 5.0), 35.0)["breached"]


@pytest.mark.parametrize("rate", [100, 500])
def test_hysteresis(block: Callable[..., Any], rate: int) -> None:
    f = Fence(block, SQUARE, rate=rate, warning_distance=2.0, hysteresis=0.5)
    trace = [(x, *(f.step((x, 5.0))[n] for n in ("inside", "warning", "breached"))) for x in (
        5.0, 2.0, 1.9, 2.4, 2.5, 1.9, 0.0, -0.1, 0.0, 0.4, 0.5, 0.4, 2.4, 2.6,
    )]  # fmt: skip
    assert trace == [
        (5.0, True, False, False),
        (2.0, True, False, False),
        (1.9, True, True, False),
        (2.4, True, True, False),
        (2.5, True, False, False),
        (1.9, True, True, False),
        (0.0, True, True, False),
        (-0.1, False, True, True),
        (0.0, True, True, True),
        (0.4, True, True, True),
        (0.5, True, True, False),
        (0.4, True, True, False),
        (2.4, True, True, False),
        (2.6, True, False, False),
    ]


def test_parameters_change_in_flight(block: Callable[..., Any]) -> None:
    f = Fence(block, SQUARE, warning_distance=1.0)
    assert not f.step((2.0, 5.0))["warning"]
    f.block.set(warning_distance=3.0, hysteresis=1.0)
    assert f.step((2.0, 5.0))["warning"] and f.step((3.5, 5.0))["warning"]
    f.block.set(hysteresis=0.0)
    assert not f.step((3.5, 5.0))["warning"]


def test_after_a_break_the_hysteresis_begins_anew(block: Callable[..., Any]) -> None:
    f = Fence(block, SQUARE, warning_distance=2.0, hysteresis=0.5)
    f.step((-1.0, 5.0))
    assert f.step((0.2, 5.0))["breached"]
    f.block.rest()
    assert f.step((float("nan"), 5.0))["breached"]  # waits
    out = f.step((0.2, 5.0))
    assert not out["breached"] and out["warning"]
    f.block.rest()
    assert not f.step((2.2, 5.0))["warning"]
    f.block.rest()
    assert f.step((-0.1, 5.0))["breached"]


def test_few_points_enclose_nothing(block: Callable[..., Any]) -> None:
    f = Fence(block, SQUARE)
    on_border = f.step((5.0, 0.0), count=2)
    assert on_border["breached"] and on_border["warning"] and not on_border["inside"]
    for count, distance in ((-7, -5.0), (0, -5.0), (1, -5.0), (2, -4.0)):
        out = f.step((3.0, 4.0), count=count)
        assert out["breached"] and not out["inside"] and out["distance"] == distance
    assert f.step((0.0, 0.0), polygon=[[0.0, 0.0]] * 4, count=0)["breached"]  # nobody has loaded a fence
    assert f.step((3.0, 2.0), polygon=SQUARE, count=3)["inside"] and not f.step((3.0, 4.0), count=3)["inside"]
    assert f.step((3.0, 4.0), count=99)["distance"] == 3.0


@pytest.mark.parametrize("value", [float("nan"), float("inf"), float("-inf")])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    f = Fence(block, SQUARE)
    assert f.step((float("nan"), 5.0))["health"] == "degraded"
    first = f.step((9.0, 5.0))
    assert first["health"] == "nominal" and first["distance"] == 1.0
    for bad in ({"position": [value, 5.0]}, {"position": [5.0, value]}, {"altitude": value}):
        out = f.step(**bad)
        assert out["health"] == "degraded"
        assert all(np.array_equal(out[n], first[n]) for n in first if n != "health")
    for i in range(4):
        for j in range(2):
            polygon = np.array(SQUARE)
            polygon[i, j] = value
            out = f.step((-1.0, 5.0), polygon=polygon.tolist())
            assert out["health"] == "degraded" and out["distance"] == 1.0, (i, j)
    assert f.step((-1.0, 5.0))["distance"] == -1.0


def test_extremes(block: Callable[..., Any]) -> None:
    f = Fence(block, COMB, warning_distance=1.0, hysteresis=0.5)
    rng = np.random.default_rng(3)
    for i in range(300):
        more: dict[str, Any] = {"polygon": rng.choice(ODD, (9, 2)).tolist()} if i % 3 == 0 else {}
        counts = [-(2**31), -1, 0, 1, 3, 9, 10, 2**31 - 1]
        out = f.step(rng.choice(ODD, 2), rng.choice(ODD), count=int(rng.choice(counts)), **more)
        assert all(np.isfinite(out[n]).all() for n in ("distance", "nearest", "vertical_distance", "clearance"))
    assert f.block.native.get_value("block.counters.faults") == 0
    for scale in (1e-320, 1e-160, 1e160, 1e300):
        out = f.step(np.array([8.0, 2.0]) * scale, polygon=(np.array(COMB) * scale).tolist())
        assert out["health"] == "nominal" and out["inside"]
        assert out["distance"] == pytest.approx(scale, rel=1e-3, abs=0.0)
