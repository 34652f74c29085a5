# SPDX-License-Identifier: Apache-2.0
"""RateLimiter against SciPy's morphology and ramps; Deadband against the proximal operator of |x|, and a trigger."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import ndimage, optimize

NAN, INF = float("nan"), float("inf")
EXTREMES = [1e300, -1e300, 1.7e308, -1.7e308, 5e-324, -5e-324, -0.0, 0.0, NAN, INF, -INF]


def limiter(block: Callable[..., Any], rising: float, falling: float, rate: int = 100) -> Any:
    return block("limits.py", "RateLimiter", rate=rate, rising=rising, falling=falling)


def deadband(block: Callable[..., Any], **parameters: float) -> Any:
    return block("limits.py", "Deadband", **parameters)


def run(block: Any, values: Any, **inputs: float) -> list[float]:
    return [block.step(input=float(v), **inputs)["output"] for v in values]


@pytest.mark.parametrize("rate", [100, 500])
def test_one_limit_is_a_morphological_filter(block: Callable[..., Any], rate: int) -> None:
    """With the way down free, y is the greatest signal below u that rises by no more than the limit:
    min over k of u_(n-k) + k rising h, an erosion of u by a ramp. The way up alike: a dilation."""
    u = np.cumsum(np.random.default_rng(1).normal(size=100))
    u -= u[0]
    step, far = 0.3, 100
    ramp = np.concatenate([-step * np.arange(far, 0, -1), np.full(far + 1, -1e9)])  # the past only
    ramp[far] = 0.0
    eroded = ndimage.grey_erosion(u, structure=ramp, mode="nearest")
    dilated = ndimage.grey_dilation(u, structure=ramp[::-1], mode="nearest")
    np.testing.assert_allclose(run(limiter(block, step * rate, 1e9, rate), u), eroded, atol=1e-10)
    np.testing.assert_allclose(run(limiter(block, 1e9, step * rate, rate), u), dilated, atol=1e-10)


@pytest.mark.parametrize("rate", [100, 500])
def test_a_step_becomes_a_ramp_of_each_way(block: Callable[..., Any], rate: int) -> None:
    slew = limiter(block, 2.0, 5.0, rate)
    run(slew, [0.0])
    up = [slew.step(input=1.0) for _ in range(rate)]
    t = np.arange(1, rate + 1) / rate
    np.testing.assert_allclose([o["output"] for o in up], np.minimum(2.0 * t, 1.0), atol=1e-12)
    assert [o["limited"] for o in up[: rate // 2 - 1]] == [True] * (rate // 2 - 1) and not up[-1]["limited"]
    np.testing.assert_allclose(run(slew, -9.0 * np.ones(rate)), 1.0 - 5.0 * t, atol=1e-12)


def test_it_begins_at_the_tracked_output(block: Callable[..., Any]) -> None:
    slew = limiter(block, 2.0, 5.0)
    for track in (0.7, -4.0):
        assert run(slew, [3.0], track=track) == [track]
        assert run(slew, [3.0], track=99.0) == pytest.approx([track + 0.02])
        slew.rest()
    slew.step(input=1.0, track=1.0)
    assert slew.step(input=1.0) == {"output": 1.0, "limited": False, "health": "nominal"}


def test_new_rates_act_from_where_the_output_is(block: Callable[..., Any]) -> None:
    slew = limiter(block, 1.0, 1.0)
    run(slew, [0.0])
    assert run(slew, [9.0]) == pytest.approx([0.01])
    slew.set(rising=100.0)
    assert run(slew, [9.0]) == pytest.approx([1.01])
    slew.set(rising=0.0)
    assert run(slew, [9.0]) == pytest.approx([1.01])


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_the_limiter_passes_over_what_is_not_finite(block: Callable[..., Any], value: float) -> None:
    slew = limiter(block, 1.0, 1.0)
    for bad in ({"input": value, "track": 3.0}, {"input": 4.0, "track": value}):
        assert slew.step(**bad) == {"output": 0.0, "limited": False, "health": "degraded"}
    assert run(slew, [4.0], track=3.0) == [3.0]
    moving = slew.step(input=4.0, track=value)  # the track is needed no more
    assert moving["output"] == 3.01 and moving["health"] == "nominal"
    assert slew.step(input=value) == moving | {"health": "degraded"}
    assert run(slew, [4.0]) == pytest.approx([3.02])


def test_the_dead_zone_is_the_proximal_operator(block: Callable[..., Any]) -> None:
    """argmin over x of (x - u)^2 / 2 + width |x|."""
    dead = deadband(block, width=0.8)
    u = np.linspace(-3.0, 3.0, 41)

    def minimum(v: float) -> float:
        cost = optimize.minimize_scalar(
            lambda x: 0.5 * (x - v) ** 2 + 0.8 * abs(x), bounds=(-4.0, 4.0), method="bounded"
        )
        return float(cost.x)

    np.testing.assert_allclose(run(dead, u), [minimum(v) for v in u], atol=1e-4)
    np.testing.assert_allclose(run(dead, u), np.sign(u) * np.maximum(np.abs(u) - 0.8, 0.0), atol=1e-15)


def test_the_hysteresis_is_that_of_a_trigger(block: Callable[..., Any]) -> None:
    dead = deadband(block, width=1.0, hysteresis=0.5)
    u = [0.0, 1.2, 1.5, 1.6, 1.2, 1.0, 1.2, -1.5, -1.75, 1.25, -1.25, 0.5, 1.5]
    found = [dead.step(input=v) for v in u]
    assert [o["active"] for o in found] == [False] * 3 + [True, True] + [False] * 3 + [True] * 3 + [False] * 2
    expected = [0.0, 0.0, 0.0, 0.6, 0.2, 0.0, 0.0, 0.0, -0.75, 0.25, -0.25, 0.0, 0.0]
    assert [o["output"] for o in found] == pytest.approx(expected)


def test_after_a_break_the_deadband_is_not_active(block: Callable[..., Any]) -> None:
    dead = deadband(block, width=1.0, hysteresis=0.5)
    assert run(dead, [2.0, 1.25]) == [1.0, 0.25]
    dead.rest()
    assert run(dead, [1.25]) == [0.0]


def test_a_new_width_shifts_the_output(block: Callable[..., Any]) -> None:
    dead = deadband(block, width=1.0)
    assert run(dead, [2.0]) == [1.0]
    dead.set(width=0.5)
    assert run(dead, [2.0, 0.5]) == [1.5, 0.0]


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_the_deadband_passes_over_what_is_not_finite(block: Callable[..., Any], value: float) -> None:
    dead = deadband(block, width=1.0, hysteresis=0.5)
    assert run(dead, [2.0]) == [1.0]
    assert dead.step(input=value) == {"output": 1.0, "active": True, "health": "degraded"}
    assert dead.step(input=1.25) == {"output": 0.25, "active": True, "health": "nominal"}


def test_no_input_faults(block: Callable[..., Any]) -> None:
    rng = np.random.default_rng(5)
    slew, dead = limiter(block, 0.0, 0.0), deadband(block, width=0.0)
    for size in (0.0, 5e-324, 1.0, 1e308):
        slew.rest()
        slew.set(rising=size, falling=size)
        dead.set(width=size, hysteresis=size)
        for v in rng.permutation([*EXTREMES, *rng.normal(size=10)]):
            found = slew.step(input=float(v), track=float(rng.choice(EXTREMES))), dead.step(input=float(v))
            assert all(np.isfinite(o["output"]) for o in found)
        assert slew.native.get_value("block.counters.faults") == dead.native.get_value("block.counters.faults") == 0
