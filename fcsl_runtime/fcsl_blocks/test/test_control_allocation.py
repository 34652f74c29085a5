# SPDX-License-Identifier: Apache-2.0
"""ControlAllocation against SciPy's bounded least squares (BVLS and TRF), NNLS, and numpy's pseudoinverse, on random
problems with and without demands that the limits do not allow; its conditions of optimality; extreme inputs."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear, nnls

ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
SIZES = [(1, 1), (2, 1), (3, 5), (4, 4), (6, 4), (8, 3), (12, 6)]
Array = NDArray[np.float64]


def random_problem(rng: np.random.Generator, n: int, m: int, kind: int) -> dict[str, Array]:
    b = rng.normal(size=(m, n))
    low, high = -rng.uniform(0.1, 1.0, n), rng.uniform(0.1, 1.0, n)
    if kind % 2:
        low[:] = 0.0
    return {
        "effectiveness": b,
        "low": low,
        "high": high,
        "preferred": rng.uniform(low, high) if kind % 3 else np.zeros(n),
        "error_weight": 10.0 ** rng.uniform(-1.0, 1.0, m),
        "effort_weight": 10.0 ** rng.uniform(-3.0, -1.0, n),
    }


def demand(rng: np.random.Generator, of: dict[str, Array], scale: float) -> Array:
    """`scale` times what some commands within the limits do."""
    return np.asarray(scale * of["effectiveness"] @ rng.uniform(of["low"], of["high"]))


def stacked(of: dict[str, Array], wanted: Array) -> tuple[Array, Array]:
    a = np.vstack([of["error_weight"][:, None] * of["effectiveness"], np.diag(of["effort_weight"])])
    return a, np.concatenate([of["error_weight"] * wanted, of["effort_weight"] * of["preferred"]])


def cost(of: dict[str, Array], wanted: Array, u: Array) -> float:
    a, b = stacked(of, wanted)
    return float(((a @ u - b) ** 2).sum())


def reference(of: dict[str, Array], wanted: Array, method: str = "bvls") -> Array:
    a, b = stacked(of, wanted)
    found = lsq_linear(a, b, (of["low"], of["high"]), method=method, tol=1e-13, max_iter=1000)
    return np.asarray(found.x)


def plain(of: dict[str, Array]) -> dict[str, Any]:
    return {name: value.tolist() for name, value in of.items()}


def allocation(block: Callable[..., Any], of: dict[str, Array], **more: Any) -> Any:
    m, n = of["effectiveness"].shape
    return block("control_allocation.py", "ControlAllocation", sizes={"n": n, "m": m}, **{**plain(of), **more})


def feed(unit: Any, wanted: Array) -> dict[str, Any]:
    out = unit.step(wanted=wanted.tolist())
    return {n: np.array(v) if isinstance(v, list) else v for n, v in out.items()}


@pytest.mark.parametrize(("n", "m"), SIZES)
def test_it_is_the_bounded_least_squares_of_scipy(block: Callable[..., Any], n: int, m: int) -> None:
    """Every problem has its own matrix, limits and weights: parameters change in flight."""
    rng = np.random.default_rng(100 * n + m)
    unit = allocation(block, random_problem(rng, n, m, 0))
    at_limits = 0
    for kind in range(20):
        of = random_problem(rng, n, m, kind)
        wanted = demand(rng, of, [0.5, 1.0, 1.5, 3.0, 100.0][kind % 5])
        unit.set(**plain(of))
        out = feed(unit, wanted)
        expected = reference(of, wanted)
        np.testing.assert_allclose(out["command"], expected, atol=1e-7)
        assert cost(of, wanted, out["command"]) <= cost(of, wanted, expected) * (1 + 1e-9) + 1e-15
        np.testing.assert_allclose(out["achieved"], of["effectiveness"] @ out["command"], atol=1e-12)
        held = (out["command"] == of["low"]) | (out["command"] == of["high"])
        assert (out["saturated"] == held).all() and out["optimal"] and out["health"] == "nominal"
        assert (out["command"] >= of["low"]).all() and (out["command"] <= of["high"]).all()
        assert (out["rounds"] == 1) == (not held.any())
        at_limits += int(held.sum())
    assert at_limits > 3 * n


def test_it_is_the_trust_region_solution_of_scipy(block: Callable[..., Any]) -> None:
    """A second reference, which has no active set."""
    rng = np.random.default_rng(5)
    of = random_problem(rng, 6, 4, 0)
    unit = allocation(block, of)
    for scale in (0.5, 1.0, 2.0, 10.0):
        wanted = demand(rng, of, scale)
        best = reference(of, wanted, "trf")
        assert cost(of, wanted, feed(unit, wanted)["command"]) == pytest.approx(cost(of, wanted, best), rel=1e-6)


def test_thrusters_that_only_push_are_nnls(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(6)
    of = random_problem(rng, 8, 3, 0) | {"low": np.zeros(8), "high": np.full(8, 100.0), "preferred": np.zeros(8)}
    unit = allocation(block, of)
    for _ in range(30):
        wanted = rng.normal(size=3)
        np.testing.assert_allclose(feed(unit, wanted)["command"], nnls(*stacked(of, wanted))[0], atol=1e-8)


@pytest.mark.parametrize("scale", [1.0, 1e6])
@pytest.mark.parametrize("effort", [1e-3, 1e-6])
def test_within_the_limits_it_is_the_pseudoinverse(block: Callable[..., Any], scale: float, effort: float) -> None:
    """preferred + B+ (wanted - B preferred), for weights that differ by 3 to 12 powers of ten."""
    rng = np.random.default_rng(7)
    b, preferred = scale * rng.normal(size=(4, 8)), rng.uniform(-0.1, 0.1, 8)
    of = {"effectiveness": b, "low": np.full(8, -9.0), "high": np.full(8, 9.0), "preferred": preferred}
    unit = allocation(block, of, effort_weight=[effort] * 8)
    for _ in range(20):
        wanted = scale * rng.normal(size=4)
        out = feed(unit, wanted)
        expected = preferred + np.linalg.pinv(b) @ (wanted - b @ preferred)
        np.testing.assert_allclose(out["command"], expected, atol=1e-11 + 3.0 * (effort / scale) ** 2)
        assert out["rounds"] == 1 and not out["saturated"].any()


def test_a_demand_that_the_limits_allow_is_met(block: Callable[..., Any]) -> None:
    """Also where the clipped pseudoinverse does not: the others make up for actuators at limits, with stiff weights."""
    rng = np.random.default_rng(8)
    of = {"effectiveness": 1e5 * rng.normal(size=(3, 8)), "low": np.full(8, -1.0), "high": np.full(8, 1.0)}
    unit, failing = allocation(block, of), 0
    for _ in range(80):
        wanted = of["effectiveness"] @ rng.choice([-1.0, 1.0, 0.9], 8) * 0.9
        out = feed(unit, wanted)
        np.testing.assert_allclose(out["achieved"], wanted, atol=1e-3)
        assert out["optimal"]
        clipped = np.clip(np.linalg.pinv(of["effectiveness"]) @ wanted, -1.0, 1.0)
        failing += bool(np.abs(of["effectiveness"] @ clipped - wanted).max() > 1.0)
    assert failing > 10


def test_weights_say_which_axis_yields(block: Callable[..., Any]) -> None:
    """A quadrotor: thrust, roll, pitch, yaw. Yaw yields, then thrust."""
    b = np.array([[1.0, 1.0, 1.0, 1.0], [1.0, -1.0, -1.0, 1.0], [1.0, 1.0, -1.0, -1.0], [0.1, -0.1, 0.1, -0.1]])
    of = {"effectiveness": b, "low": np.zeros(4), "high": np.ones(4)}
    unit = allocation(block, of, error_weight=[1.0, 100.0, 100.0, 0.1])
    out = feed(unit, np.array([3.6, 0.3, 0.0, 0.2]))
    np.testing.assert_allclose(out["achieved"][1:3], [0.3, 0.0], atol=1e-3)
    assert 0.0 < out["achieved"][3] < 0.19 and out["achieved"][0] == pytest.approx(3.6, abs=0.1)
    unit.set(error_weight=[1.0, 1.0, 1.0, 0.0])  # yaw is not controlled
    out = feed(unit, np.array([2.0, 0.0, 0.0, 99.0]))
    np.testing.assert_allclose(out["achieved"], [2.0, 0.0, 0.0, 0.0], atol=1e-5)


def test_a_failed_actuator_is_one_without_range(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(9)
    of = random_problem(rng, 6, 3, 2)
    unit = allocation(block, of)
    of["low"][2] = of["high"][2] = 0.3
    unit.set(**plain(of))
    for scale in (0.5, 2.0, 20.0):
        wanted = demand(rng, of, scale)
        out = feed(unit, wanted)
        assert out["command"][2] == 0.3 and out["saturated"][2] and out["optimal"]
        rest = np.delete(of["effectiveness"], 2, axis=1)
        others = {k: np.delete(v, 2) if v.shape == (6,) else v for k, v in of.items()} | {"effectiveness": rest}
        expected = reference(others, wanted - 0.3 * of["effectiveness"][:, 2])
        np.testing.assert_allclose(np.delete(out["command"], 2), expected, atol=1e-7)
    unit.set(low=[2.0] * 6, high=[1.0] * 6)  # crossed
    out = feed(unit, wanted)
    assert (out["command"] == 1.0).all() and out["optimal"]


@pytest.mark.parametrize("scale", [1.0, 1e6])
def test_degenerate_effectiveness(block: Callable[..., Any], scale: float) -> None:
    """Ties, equal columns and lost axes: there is one minimum all the same. With weights that differ by 8 powers of ten,
    actuators without effect together are not placed exactly, but the rounds end."""
    rng = np.random.default_rng(10)
    of = random_problem(rng, 5, 4, 0)
    unit = allocation(block, of)
    for k in range(60):
        of["effectiveness"] = scale * rng.integers(-1, 2, (4, 5)).astype(float)
        of["low"], of["high"] = np.full(5, float(-(k % 2))), np.ones(5)
        of["preferred"] = np.full(5, [0.0, 0.5, -3.0][k % 3])
        of["effort_weight"], of["error_weight"] = np.full(5, 1e-2), np.ones(4)
        unit.set(**plain(of))
        wanted = scale * rng.integers(-4, 5, 4).astype(float)
        out, expected = feed(unit, wanted), reference(of, wanted)
        assert out["optimal"]
        assert cost(of, wanted, out["command"]) <= cost(of, wanted, expected) * (1 + 1e-9)
        if scale == 1.0:
            np.testing.assert_allclose(out["command"], expected, atol=1e-7)


def test_roundings_release_no_actuator_for_ever(block: Callable[..., Any]) -> None:
    """A problem in which the gradient is mostly roundings: a released actuator would go outwards, be held, and released."""
    of = {
        "effectiveness": 1e6
        * np.array([[1.0, 1.0, -1.0, 0.0, 0.0], [-1.0, -1.0, -1.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0, -1.0]]),
        "low": np.full(5, -1.0),
        "high": np.ones(5),
        "preferred": np.array([0.7, -0.1, 0.5, -0.2, -0.9]),
        "error_weight": np.ones(3),
        "effort_weight": np.full(5, 1e-4),
    }
    wanted = np.array([-1e6, -4.6e6, 1.4e6])
    out = feed(allocation(block, of), wanted)
    assert out["optimal"] and out["health"] == "nominal" and out["rounds"] < 10
    assert cost(of, wanted, out["command"]) <= cost(of, wanted, reference(of, wanted)) * (1 + 1e-9)


def test_breaks_and_the_period_make_no_difference(block: Callable[..., Any]) -> None:
    of = random_problem(np.random.default_rng(11), 4, 3, 0)
    wanted = np.array([0.4, -2.0, 1.0])
    found = []
    for rate in (100, 500):
        unit = allocation(block, of, rate=rate)
        found.append(feed(unit, wanted))
        feed(unit, -wanted)
        unit.rest()
        found.append(feed(unit, wanted))
    assert all((f["command"] == found[0]["command"]).all() for f in found)


def test_nan_comes_out(block: Callable[..., Any]) -> None:
    """In all commands, also of actuators that have no effect on the axis, and of an axis without weight."""
    of = random_problem(np.random.default_rng(12), 4, 3, 0)
    of["effectiveness"][:, 3] = 0.0
    of["error_weight"][2] = 0.0
    unit = allocation(block, of)
    for axis in range(3):
        wanted = np.array([0.1, 0.2, 0.3])
        assert np.isfinite(feed(unit, wanted)["command"]).all()
        wanted[axis] = np.nan
        out = feed(unit, wanted)
        assert np.isnan(out["command"]).all() and not out["optimal"] and out["health"] == "degraded"


def test_extremes(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(13)
    unit = allocation(block, random_problem(rng, 4, 3, 0))
    extremes = {
        "effectiveness": [0.0, -0.0, 1e12, -1e12, 5e-324, 1e-200, 1.0, -2.0],
        "low": [-1e12, -0.0, 0.0, 5e-324, -1.0],
        "high": [1e12, -0.0, 0.0, 5e-324, 1.0],
        "preferred": [-1e12, 1e12, -0.0, 5e-324, 0.5],
        "error_weight": [0.0, 1e6, 5e-324, 1.0, 1e-3],
        "effort_weight": [1e-6, 1e6, 1.0, 1e-3],
    }
    for _ in range(150):
        shapes = {n: (3, 4) if n == "effectiveness" else (3,) if n == "error_weight" else (4,) for n in extremes}
        of = {n: rng.choice(v, shapes[n]) for n, v in extremes.items()}
        unit.set(**plain(of))
        wanted = rng.choice(ODD, 3)
        out = feed(unit, wanted)
        if not np.isnan(wanted).any():
            low = np.minimum(of["low"], of["high"])
            assert (out["command"] >= low).all() and (out["command"] <= of["high"]).all(), (of, wanted)
    assert unit.native.get_value("block.counters.faults") == 0
