# SPDX-License-Identifier: Apache-2.0
"""DelayCompensation against motions that are known: what is measured late is what would be measured now."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

NAN = float("nan")


def make(block: Callable[..., Any], delay: float, n: int = 2, memory: int = 8, rate: int = 100) -> Any:
    sizes = {"n": n, "memory": memory}
    return block("delay_compensation.py", "DelayCompensation", sizes=sizes, rate=rate, delay=delay)


@pytest.mark.parametrize("rate", [50, 100])
@pytest.mark.parametrize("delay", [0.0, 0.01, 0.05, 0.063])
def test_a_constant_rate_is_made_up_for(block: Callable[..., Any], delay: float, rate: int) -> None:
    late = make(block, delay, rate=rate)
    slope = np.array([3.0, -0.5])
    for k in range(20):
        now = k / rate
        measured = (slope * (now - delay)).tolist()
        out = late.step(measured=measured, measured_fresh=k % 3 == 0, rate=slope.tolist())
        if k > 8:
            assert out["fresh"] == (k % 3 == 0) and out["health"] == "nominal"
            if out["fresh"]:
                np.testing.assert_allclose(out["present"], slope * now, atol=1e-12)


def test_an_acceleration_leaves_half_a_period(block: Callable[..., Any]) -> None:
    """With the rate of the run before, as the page says."""
    late, a, delay, h = make(block, 0.05, n=1), 4.0, 0.05, 0.01
    for k in range(12):
        now = k * h
        out = late.step(measured=[a / 2 * (now - delay) ** 2], measured_fresh=True, rate=[a * (now - h)])
    np.testing.assert_allclose(a / 2 * now**2 - out["present"][0], a * h * delay / 2, rtol=1e-9)


def test_a_memory_that_is_too_short(block: Callable[..., Any]) -> None:
    late = make(block, 0.05, n=1, memory=3)
    for _ in range(6):
        out = late.step(measured=[1.0], measured_fresh=True, rate=[2.0])
    assert out["health"] == "degraded" and out["fresh"]
    np.testing.assert_allclose(out["present"], 1.0 + 2.0 * 0.03)
    late.set(delay=0.03)
    assert late.step(measured=[1.0], measured_fresh=True, rate=[2.0])["health"] == "nominal"


def test_a_break_forgets(block: Callable[..., Any]) -> None:
    late = make(block, 0.02, n=1)
    for _ in range(6):
        late.step(measured=[1.0], measured_fresh=True, rate=[100.0])
    late.rest()
    out = late.step(measured=[1.0], measured_fresh=True, rate=[1.0])
    assert out["present"] == [1.01] and out["health"] == "degraded"
    assert late.step(measured=[1.0], measured_fresh=True, rate=[1.0]) == {
        "present": [1.02],
        "fresh": True,
        "health": "nominal",
    }


@pytest.mark.parametrize("name", ["measured", "rate"])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], name: str) -> None:
    late = make(block, 0.02, n=1)
    good = {"measured": [1.0], "measured_fresh": True, "rate": [1.0]}
    for _ in range(3):
        before = late.step(**good)
    assert late.step(**good | {name: [NAN]}) == {"present": before["present"], "fresh": False, "health": "degraded"}
    late.step(**good)
    late.step(**good)
    assert late.step(**good) == before and before["fresh"]
    assert late.native.get_value("block.counters.faults") == 0
