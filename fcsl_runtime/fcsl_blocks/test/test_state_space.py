# SPDX-License-Identifier: Apache-2.0
"""StateSpace against SciPy's simulations of discrete systems, for several sizes; breaks, changed matrices, overflow, and
inputs that are not finite."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal


def system(n: int, m: int, p: int, seed: int = 1) -> dict[str, Any]:
    rng = np.random.default_rng(seed)
    a = rng.normal(size=(n, n))
    a *= 0.95 / np.abs(np.linalg.eigvals(a)).max()
    shapes = {"b": (n, m), "c": (p, n), "d": (p, m), "x0": (n,)}
    return {"a": a.tolist()} | {name: rng.normal(size=shape).tolist() for name, shape in shapes.items()}


def of_scipy(s: dict[str, Any], u: Any) -> np.ndarray[Any, Any]:
    _, y, _ = signal.dlsim((s["a"], s["b"], s["c"], s["d"], 1.0), u, x0=s["x0"])
    return np.asarray(y)


def respond(block: Any, u: Any) -> np.ndarray[Any, Any]:
    return np.array([block.step(u=row)["y"] for row in np.asarray(u).tolist()])


@pytest.mark.parametrize(("n", "m", "p"), [(1, 1, 1), (2, 1, 1), (3, 2, 4), (6, 3, 1), (1, 4, 2)])
def test_it_is_the_simulation_of_scipy(block: Callable[..., Any], n: int, m: int, p: int) -> None:
    s, u = system(n, m, p), np.random.default_rng(2).normal(size=(80, m))
    found = respond(block("state_space.py", "StateSpace", sizes={"n": n, "m": m, "p": p}, **s), u)
    np.testing.assert_allclose(found, of_scipy(s, u), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("rate", [100, 500])
def test_a_filter_of_scipy(block: Callable[..., Any], rate: int) -> None:
    """The step response of a Butterworth filter, the same in each run at every rate: the matrices are those of a period."""
    numerator, denominator = signal.butter(4, 0.2)
    a, b, c, d = (x.tolist() for x in signal.tf2ss(numerator, denominator))
    filter_ = block("state_space.py", "StateSpace", rate=rate, sizes={"n": 4, "m": 1, "p": 1}, a=a, b=b, c=c, d=d)
    found = respond(filter_, np.ones((60, 1)))[:, 0]
    np.testing.assert_allclose(found, signal.lfilter(numerator, denominator, np.ones(60)), rtol=1e-9)


def test_d_and_x0_are_zero_if_left_out(block: Callable[..., Any]) -> None:
    unit = block("state_space.py", "StateSpace", sizes={"n": 1, "m": 1, "p": 1}, a=[[0.5]], b=[[1.0]], c=[[2.0]])
    np.testing.assert_array_equal(respond(unit, [[1.0], [0.0], [0.0]])[:, 0], [0.0, 2.0, 1.0])


def test_after_a_break_it_begins_at_x0(block: Callable[..., Any]) -> None:
    s, u = system(3, 2, 2), np.random.default_rng(3).normal(size=(10, 2))
    unit = block("state_space.py", "StateSpace", sizes={"n": 3, "m": 2, "p": 2}, **s)
    first = respond(unit, u)
    unit.rest()
    np.testing.assert_array_equal(respond(unit, u), first)


def test_changed_matrices_keep_the_state(block: Callable[..., Any]) -> None:
    s, changed = system(2, 1, 1), system(2, 1, 1, seed=4)
    unit = block("state_space.py", "StateSpace", sizes={"n": 2, "m": 1, "p": 1}, **s)
    u = np.random.default_rng(5).normal(size=(20, 1))
    respond(unit, u)
    _, _, x = signal.dlsim((s["a"], s["b"], s["c"], s["d"], 1.0), np.vstack([u, [[0.0]]]), x0=s["x0"])
    unit.set(**changed)
    np.testing.assert_allclose(respond(unit, u), of_scipy(changed | {"x0": x[-1].tolist()}, u), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    s, u = system(2, 2, 2), np.random.default_rng(6).normal(size=(20, 2))
    unit = block("state_space.py", "StateSpace", sizes={"n": 2, "m": 2, "p": 2}, **s)
    assert unit.step(u=[value, 0.0]) == {"y": [0.0, 0.0], "health": "degraded"}  # it has not begun
    found = respond(unit, u[:10])
    bad = unit.step(u=[1.0, value])
    assert bad["y"] == found[-1].tolist() and bad["health"] == "degraded"
    found = np.vstack([found, respond(unit, u[10:])])
    np.testing.assert_allclose(found, of_scipy(s, u), rtol=1e-9, atol=1e-9)
    assert unit.step(u=[0.0, 0.0])["health"] == "nominal"


def test_an_unstable_system_stops_before_it_overflows(block: Callable[..., Any]) -> None:
    one: dict[str, Any] = {"a": [[10.0]], "b": [[1.0]], "c": [[1.0]], "x0": [1e300]}
    unit = block("state_space.py", "StateSpace", sizes={"n": 1, "m": 1, "p": 1}, **one)
    found = [unit.step(u=[0.0]) for _ in range(12)]
    assert all(np.isfinite(f["y"]).all() for f in found) and found[-1]["health"] == "degraded"
    unit.set(a=[[0.5]])
    assert unit.step(u=[0.0]) == {"y": [pytest.approx(1e308)], "health": "nominal"}
    unit.set(a=[[10.0]])
    unit.rest()
    assert unit.step(u=[0.0]) == found[0] and found[0]["health"] == "nominal"


def test_extremes_cause_no_fault(block: Callable[..., Any]) -> None:
    rng, extremes = np.random.default_rng(7), [0.0, -0.0, 5e-324, -1e-310, 1.0, 1e300, -1.7e308]
    unit = block("state_space.py", "StateSpace", sizes={"n": 2, "m": 2, "p": 1}, **system(2, 2, 1))
    for _ in range(200):
        assert np.isfinite(unit.step(u=rng.choice(extremes, size=2).tolist())["y"]).all()
        unit.set(a=rng.choice(extremes, size=(2, 2)).tolist(), c=rng.choice(extremes, size=(1, 2)).tolist())
    assert unit.native.get_value("block.counters.faults") == 0
