# SPDX-License-Identifier: Apache-2.0
"""LeadLag against SciPy's bilinear rule; limits, breaks, changes of times, and inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal

NAN, INF = float("nan"), float("inf")


def run(block: Any, values: Any) -> list[float]:
    return [block.step(input=float(v))["output"] for v in values]


def make(block: Callable[..., Any], lead: float, lag: float, rate: int = 100) -> Any:
    return block("lead_lag.py", "LeadLag", rate=rate, lead_time=lead, lag_time=lag)


@pytest.mark.parametrize(
    "rate, lead, lag", [(100, 0.2, 0.05), (500, 0.05, 0.2), (100, 0.0, 0.3), (500, 0.1, 0.1), (100, 1.0, 0.005)]
)
def test_it_is_that_of_scipy(block: Callable[..., Any], rate: int, lead: float, lag: float) -> None:
    u = np.concatenate([[0.0], np.random.default_rng(2).normal(size=150)])
    b, a, _ = signal.cont2discrete(([lead, 1.0] if lead else [1.0], [lag, 1.0]), 1.0 / rate, method="bilinear")
    np.testing.assert_allclose(run(make(block, lead, lag, rate), u), signal.lfilter(b[0], a, u), rtol=1e-9, atol=1e-9)


def test_a_step_comes_in_with_the_lead_and_settles_at_one(block: Callable[..., Any]) -> None:
    """Continuous: 1 + (lead / lag - 1) exp(-t / lag). Sampled fast, the rule comes close."""
    compensator = make(block, 0.4, 0.1, 500)
    found = run(compensator, [0.0, *np.ones(500)])[1:]
    t = (np.arange(500) + 0.5) / 500  # the rule takes the step as a ramp of one period
    np.testing.assert_allclose(found, 1.0 + 3.0 * np.exp(-t / 0.1), atol=2e-3)
    assert found[-1] == pytest.approx(1.0, abs=1e-3)


def test_the_first_run_is_at_rest(block: Callable[..., Any]) -> None:
    compensator = make(block, 0.4, 0.1)
    for level in (7.0, -3.0):
        assert run(compensator, [level] * 5) == [level] * 5
        run(compensator, [0.0, 50.0])
        compensator.rest()


def test_the_first_finite_input_begins(block: Callable[..., Any]) -> None:
    compensator = make(block, 0.4, 0.1)
    assert [compensator.step(input=NAN)[n] for n in ("output", "health")] == [0.0, "degraded"]
    assert run(compensator, [2.0, 2.0]) == [2.0, 2.0]


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    """It leaves no trace."""
    compensator, other = make(block, 0.4, 0.1), make(block, 0.4, 0.1)
    before = [c.step(input=v) for c in (compensator, other) for v in (1.0, 2.0)][-1]
    assert compensator.step(input=value) == before | {"health": "degraded"}
    after = compensator.step(input=3.0)
    assert after == other.step(input=3.0) and after["health"] == "nominal"


def test_new_times_make_no_jump(block: Callable[..., Any]) -> None:
    """At rest nothing moves; in motion with the input held, y goes on toward it with the new lag."""
    compensator = make(block, 0.4, 0.1)
    run(compensator, [3.0] * 3)
    compensator.set(lead_time=5.0, lag_time=0.3)
    assert run(compensator, [3.0] * 3) == [3.0] * 3
    moving = run(compensator, [4.0])[0]
    compensator.set(lead_time=0.0, lag_time=100.0)
    assert run(compensator, [4.0])[0] == pytest.approx(moving + (4.0 - moving) * 0.01 / 100.005, rel=1e-12)


def test_a_lag_below_half_the_period_does_not_ring(block: Callable[..., Any]) -> None:
    found = run(make(block, 0.0, 0.0), [0.0, 1.0, 1.0, 1.0])
    assert found == [0.0, 0.5, 1.0, 1.0]


def test_no_input_faults(block: Callable[..., Any]) -> None:
    extremes = [1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -5e-324, -0.0, 0.0, NAN, INF, -INF]
    rng = np.random.default_rng(5)
    compensator = make(block, 0.0, 0.0)
    for lead, lag in ((0.0, 0.0), (1e9, 0.0), (0.0, 1e9), (1e-300, 1e-300)):
        compensator.rest()
        compensator.set(lead_time=lead, lag_time=lag)
        for v in rng.permutation([*extremes, *rng.normal(size=10)]):
            assert np.isfinite(compensator.step(input=float(v))["output"])
        assert compensator.native.get_value("block.counters.faults") == 0
