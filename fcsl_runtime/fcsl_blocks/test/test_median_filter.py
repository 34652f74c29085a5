# SPDX-License-Identifier: Apache-2.0
"""MedianFilter against scipy.signal.medfilt and numpy.median; breaks, outliers, inputs that are not finite."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import signal

NAN, INF = float("nan"), float("inf")


def make(block: Callable[..., Any], n: int, rate: int = 100) -> Any:
    return block("median_filter.py", "MedianFilter", sizes={"n": n}, rate=rate)


def run(block: Any, values: Any) -> list[float]:
    return [block.step(input=float(v))["output"] for v in values]


@pytest.mark.parametrize("n", [1, 3, 5, 9])
def test_it_is_that_of_scipy(block: Callable[..., Any], n: int) -> None:
    """SciPy's window is centred; before the first input, the window is full of it."""
    u = np.random.default_rng(1).normal(size=80).round(1)  # with equal ones
    padded = np.concatenate([np.full(n - 1, u[0]), u])
    expected = signal.medfilt(padded, n)[n // 2 : len(padded) - n // 2]
    assert run(make(block, n), u) == expected.tolist()


@pytest.mark.parametrize("n", [2, 4])
def test_an_even_size_takes_the_mean_of_the_middle_two(block: Callable[..., Any], n: int) -> None:
    u = np.random.default_rng(2).normal(size=60)
    windows = np.lib.stride_tricks.sliding_window_view(np.concatenate([np.full(n - 1, u[0]), u]), n)
    np.testing.assert_allclose(run(make(block, n), u), np.median(windows, axis=1), rtol=1e-15)


@pytest.mark.parametrize("rate", [100, 500])
def test_outliers_vanish_and_a_step_comes_late(block: Callable[..., Any], rate: int) -> None:
    filter_ = make(block, 5, rate)
    assert run(filter_, [1, 1, 1, 900, -900, 1, 1, 1, 1]) == [1.0] * 9
    assert run(filter_, [2, 2, 2, 2]) == [1.0, 1.0, 2.0, 2.0]


def test_the_first_run_fills_the_window(block: Callable[..., Any]) -> None:
    filter_ = make(block, 5)
    run(filter_, [3.0, 4.0, 5.0])
    filter_.rest()
    assert run(filter_, [8.0, 1.0, 1.0, 1.0]) == [8.0, 8.0, 8.0, 1.0]


@pytest.mark.parametrize("value", [NAN, INF, -INF])
def test_what_is_not_finite_is_passed_over(block: Callable[..., Any], value: float) -> None:
    filter_, other = make(block, 3), make(block, 3)
    assert [filter_.step(input=value)[n] for n in ("output", "health")] == [0.0, "degraded"]
    assert run(filter_, [7.0]) == [7.0]  # the first that is finite takes the place of the first run
    run(other, [7.0])
    assert filter_.step(input=value) == {"output": 7.0, "health": "degraded"}
    assert run(filter_, [9.0, 8.0, 1.0]) == run(other, [9.0, 8.0, 1.0])
    assert filter_.step(input=1.0)["health"] == "nominal"


def test_no_input_faults(block: Callable[..., Any]) -> None:
    extremes = [1e300, -1e300, 1.7e308, 1.7e308, -1.7e308, 5e-324, -5e-324, -0.0, 0.0, NAN, INF, -INF]
    rng = np.random.default_rng(5)
    for n in (1, 2, 3, 8):
        filter_ = make(block, n)
        assert np.isfinite(run(filter_, rng.permutation(extremes * 4))).all()
        assert filter_.native.get_value("block.counters.faults") == 0
