# SPDX-License-Identifier: Apache-2.0
"""Distributions and designs of campaigns, against SciPy and the definitions."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from fcsl_sim.campaign.dispersion import (
    Choice,
    Grid,
    LatinHypercube,
    Normal,
    Random,
    Uniform,
    cholesky,
    random_share,
    shuffled,
)

SHARES = [1e-9, 0.001, 0.1, 0.5, 0.77, 0.999, 1 - 1e-9]


@pytest.mark.parametrize("share", SHARES)
def test_quantiles_are_those_of_scipy(share: float) -> None:
    assert Uniform(-2.0, 3.0).at(share) == pytest.approx(stats.uniform(-2.0, 5.0).ppf(share), rel=1e-12)
    assert Normal(5.0, 2.0, None).at(share) == pytest.approx(stats.norm(5.0, 2.0).ppf(share), rel=1e-9)
    truncated = stats.truncnorm(-1.0, 2.5, loc=5.0, scale=2.0).ppf(share)
    assert Normal(5.0, 2.0, (3.0, 10.0)).at(share) == pytest.approx(truncated, rel=1e-9)


@pytest.mark.parametrize("share", [0.0, 1.0 - 2.0**-53])
def test_a_normal_is_finite_and_within_its_bounds(share: float) -> None:
    assert math.isfinite(Normal(0.0, 1.0, None).at(share))
    assert 3.0 <= Normal(0.0, 1.0, (3.0, 4.0)).at(share) <= 4.0
    assert 30.0 <= Normal(0.0, 1.0, (30.0, 40.0)).at(share) <= 40.0


def test_choices_are_as_frequent_as_their_weights() -> None:
    choice = Choice((1, 2, 3), (1.0, 0.0, 3.0))
    counts = Counter(choice.at((i + 0.5) / 400) for i in range(400))
    assert counts == {1: 100, 3: 300}
    assert choice.at(1.0) == 3


def test_random_numbers_are_uniform_and_do_not_repeat() -> None:
    numbers = np.array([random_share(7, case, "a") for case in range(20_000)])
    assert stats.kstest(numbers, "uniform").pvalue > 1e-3
    assert len(set(numbers)) == len(numbers)
    others = np.array([random_share(7, case, "b") for case in range(20_000)])
    assert abs(np.corrcoef(numbers, others)[0, 1]) < 5 / math.sqrt(20_000)


@given(st.integers(1, 3000), st.integers(0, 2**64 - 1))
def test_shuffling_is_a_permutation(count: int, seed: int) -> None:
    assert sorted(shuffled(i, count, seed, "x") for i in range(count)) == list(range(count))


def test_shuffling_depends_on_seed_and_word() -> None:
    orders = [[shuffled(i, 100, seed, word) for i in range(100)] for seed in (1, 2) for word in ("a", "b")]
    assert len({tuple(order) for order in orders}) == 4
    assert all(abs(stats.spearmanr(range(100), order).statistic) < 0.5 for order in orders)


def test_a_latin_hypercube_has_one_case_in_each_part() -> None:
    design = LatinHypercube(3, ["a", "b"], [Uniform(0.0, 1.0), Normal(0.0, 1.0, None)], 500)
    values = np.array([design.values(case) for case in range(500)])
    assert sorted(np.floor(500 * values[:, 0]).astype(int)) == list(range(500))
    assert sorted(np.floor(500 * stats.norm.cdf(values[:, 1])).astype(int)) == list(range(500))
    assert abs(np.corrcoef(values.T)[0, 1]) < 0.2


def test_a_value_depends_on_nothing_but_seed_path_and_case() -> None:
    alone = Random(3, ["b"], [Uniform(0.0, 1.0)], 10)
    among = Random(3, ["a", "b"], [Uniform(0.0, 1.0)] * 2, 1000)
    assert [alone.values(case)[0] for case in range(10)] == [among.values(case)[1] for case in range(10)]


def test_a_grid_has_every_combination_once() -> None:
    grid = Grid([(1, 2), (10, 20, 30), (True,)])
    assert grid.count == 6
    assert [grid.values(case) for case in range(6)] == [
        (1, 10, True), (1, 20, True), (1, 30, True), (2, 10, True), (2, 20, True), (2, 30, True),
    ]  # fmt: skip
    assert Grid([]).count == 1 and Grid([]).values(0) == ()


def test_corners() -> None:
    assert Uniform(1.0, 2.0).corners() == (1.0, 2.0)
    assert Choice((3, 1, 2), (1.0, 1.0, 1.0)).corners() == (1, 3)
    assert Normal(0.0, 1.0, None).corners() is None
    assert Normal(0.0, 1.0, (-1.0, 1.0)).corners() == (-1.0, 1.0)


# ---- correlations ----------------------------------------------------------------------------------------------------

CORRELATIONS = [[1.0, -0.6, 0.3, 0.0], [-0.6, 1.0, 0.4, 0.0], [0.3, 0.4, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]]
SPREADS = (Normal(400.0, 8.0, None), Normal(-1.0, 0.5, None), Uniform(2.0, 5.0), Uniform(0.0, 1.0))


def test_cholesky_is_that_of_numpy() -> None:
    assert np.allclose(cholesky(CORRELATIONS), np.linalg.cholesky(CORRELATIONS), rtol=0, atol=1e-15)
    assert cholesky([[1.0, 0.9, -0.9], [0.9, 1.0, 0.9], [-0.9, 0.9, 1.0]]) is None
    assert cholesky([[1.0, 1.0], [1.0, 1.0]]) is None


def test_correlated_values_are_multivariate_normal_and_keep_their_distributions() -> None:
    """By the estimates of NumPy and SciPy over 20000 cases."""
    factor = cholesky(CORRELATIONS)
    assert factor is not None
    design = Random(7, list("abcd"), SPREADS, 20_000, factor)
    table = np.array([design.values(case) for case in range(design.count)])
    covariance = np.array([[64.0, -0.6 * 8.0 * 0.5], [-0.6 * 8.0 * 0.5, 0.25]])
    assert np.allclose(np.cov(table[:, :2].T), covariance, rtol=0.05)
    ranks = stats.spearmanr(table).statistic
    assert np.allclose(ranks, 6.0 / np.pi * np.arcsin(np.array(CORRELATIONS) / 2.0), rtol=0, atol=5 / np.sqrt(20_000))
    true = (("norm", (400.0, 8.0)), ("norm", (-1.0, 0.5)), ("uniform", (2.0, 3.0)), ("uniform", (0.0, 1.0)))
    for column, (name, shape) in zip(table.T, true, strict=True):
        assert stats.kstest(column, name, shape).pvalue > 1e-4
    alone = Random(7, list("abcd"), SPREADS, 20_000)
    for case in range(50):  # what is correlated with nothing before it stays, to the bit
        assert [alone.values(case)[i] for i in (0, 3)] == [design.values(case)[i] for i in (0, 3)]
