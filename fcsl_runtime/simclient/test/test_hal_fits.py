# SPDX-License-Identifier: Apache-2.0
"""The fits of fcsl hal against a known truth with noise, and against SciPy's least_squares."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from simclient.hal.fit_accel import GRAVITY, fit_accel, side_up
from simclient.hal.fit_compass import coverage, fit_compass, turned_coverage
from simclient.hal.fit_rc import fit_ranges
from simclient.hal.fit_still import fit_still
from simclient.hal.least_squares import Vector, minimize

SEEDS = range(20)
SYMMETRIC = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


def test_the_mean_of_a_gyro_at_rest() -> None:
    random = np.random.default_rng(1)
    truth, noise = np.array([0.01, -0.02, 0.3]), np.array([0.001, 0.002, 0.004])
    still = fit_still(truth + random.normal(size=(5000, 3)) * noise)
    assert np.allclose(still.mean, truth, atol=5 * noise.max() / np.sqrt(5000))
    assert np.allclose(still.deviation, noise, rtol=0.1)


def test_minimize_finds_what_scipy_finds() -> None:
    random = np.random.default_rng(2)
    x = np.linspace(0.0, 2.0, 50)
    y = 1.5 * np.exp(-0.7 * x) + random.normal(size=50) * 0.01

    def model(p: Vector) -> tuple[Vector, Vector]:
        curve = np.exp(p[1] * x)
        return p[0] * curve - y, np.column_stack([curve, p[0] * x * curve])

    start = np.array([1.0, 0.0])
    reference = least_squares(lambda p: model(p)[0], start, xtol=1e-12, ftol=1e-12, gtol=1e-12)
    assert np.allclose(minimize(model, start), reference.x, atol=1e-8)


@pytest.mark.parametrize(
    ("residual", "slope", "start", "root"),
    [
        (np.arctan, lambda x: 1.0 / (1.0 + x * x), 3.0, 0.0),  # each whole step overshoots by more than the last
        (np.log, lambda x: 1.0 / x, 5.0, 1.0),  # the first whole step ends where there is no value
    ],
)
def test_a_step_that_makes_it_worse_is_halved(
    residual: Callable[[Vector], Vector], slope: Callable[[Vector], Vector], start: float, root: float
) -> None:
    with np.errstate(invalid="ignore"):
        found = minimize(lambda p: (residual(p), slope(p).reshape(1, 1)), np.array([start]))
    assert found == pytest.approx([root], abs=1e-9)


# ---- accelerometer ---------------------------------------------------------------------------------------------------


def positions(random: np.random.Generator, offset: Vector, scale: Vector, noise: float, tilt: float) -> Vector:
    """Readings with each end of each axis up, about, twice."""
    up = np.vstack([np.eye(3), -np.eye(3)] * 2)
    tilted = Rotation.from_rotvec(random.uniform(-tilt, tilt, size=(12, 3))).apply(up)
    return tilted * GRAVITY / scale + offset + random.normal(size=(12, 3)) * noise


@pytest.mark.parametrize("seed", SEEDS)
def test_accel(seed: int) -> None:
    random = np.random.default_rng(seed)
    offset, scale = random.uniform(-1.0, 1.0, 3), random.uniform(0.9, 1.1, 3)
    exact = fit_accel(positions(random, offset, scale, 0.0, 0.2))
    assert np.allclose(exact.offset, offset, atol=1e-9) and np.allclose(exact.scale, scale, atol=1e-9)
    assert np.abs(exact.residuals).max() < 1e-9

    readings = positions(random, offset, scale, 0.01, 0.2)
    noisy = fit_accel(readings)
    assert np.allclose(noisy.offset, offset, atol=0.05) and np.allclose(noisy.scale, scale, atol=0.005)

    def residuals(p: Vector) -> Vector:
        lengths: Vector = np.linalg.norm(p[:3] * (readings - p[3:]), axis=1)
        return lengths - GRAVITY

    reference = least_squares(residuals, [1.0] * 3 + [0.0] * 3, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    assert np.allclose(noisy.scale, reference.x[:3], atol=1e-6)
    assert np.allclose(noisy.offset, reference.x[3:], atol=1e-6)
    assert np.allclose(noisy.residuals, residuals(np.concatenate([noisy.scale, noisy.offset])), atol=1e-9)


def test_six_positions_are_enough() -> None:
    random = np.random.default_rng(3)
    offset, scale = np.array([0.5, -0.3, 0.2]), np.array([0.97, 1.02, 1.05])
    fit = fit_accel(positions(random, offset, scale, 0.0, 0.1)[:6])
    assert np.allclose(fit.offset, offset, atol=1e-9) and np.allclose(fit.scale, scale, atol=1e-9)


def test_the_side_that_is_up() -> None:
    assert side_up(np.array([0.3, -9.7, 0.5])) == (1, -1)
    assert side_up(np.array([9.8, 0.0, 0.0])) == (0, 1)
    assert side_up(np.array([6.9, 6.9, 0.0])) is None
    assert side_up(np.zeros(3)) is None


# ---- compass ---------------------------------------------------------------------------------------------------------


def soft_iron(random: np.random.Generator) -> Vector:
    """Symmetric, with a determinant of 1."""
    raw = random.uniform(-0.15, 0.15, (3, 3))
    matrix: Vector = np.eye(3) + (raw + raw.T) / 2
    return matrix / np.cbrt(np.linalg.det(matrix))


def turned(random: np.random.Generator, count: int) -> Vector:
    return Rotation.random(count, random_state=int(random.integers(1 << 31))).apply([1.0, 0.0, 0.0])


@pytest.mark.parametrize("seed", SEEDS)
def test_compass(seed: int) -> None:
    random = np.random.default_rng(seed)
    matrix, offset, field = soft_iron(random), random.uniform(-60e-6, 60e-6, 3), random.uniform(25e-6, 65e-6)
    ideal = turned(random, 400) * field @ np.linalg.inv(matrix) + offset
    exact = fit_compass(ideal)
    assert exact is not None
    assert np.allclose(exact.offset, offset, atol=1e-12) and np.allclose(exact.matrix, matrix, atol=1e-6)
    assert exact.field == pytest.approx(field, rel=1e-6) and exact.residual < 1e-9 and exact.coverage > 0.95

    readings = ideal + random.normal(size=ideal.shape) * 0.5e-6
    noisy = fit_compass(readings)
    assert noisy is not None
    assert np.allclose(noisy.offset, offset, atol=0.5e-6) and np.allclose(noisy.matrix, matrix, atol=0.02)

    def residuals(p: Vector) -> Vector:
        a = np.empty((3, 3))
        a[SYMMETRIC] = p[:6]
        a[SYMMETRIC[::-1]] = p[:6]
        lengths: Vector = np.linalg.norm((readings * 1e6 - p[6:]) @ a, axis=1)
        return lengths - 1.0

    start = np.concatenate([np.ones(3) / (field * 1e6), np.zeros(3), offset * 1e6])
    reference = least_squares(residuals, start, x_scale="jac", xtol=1e-15, ftol=1e-15, gtol=1e-15)
    assert np.allclose(noisy.offset * 1e6, reference.x[6:], atol=1e-4)
    assert noisy.residual == pytest.approx(np.sqrt(np.mean(residuals(reference.x) ** 2)), rel=1e-6)


def test_the_matrix_of_a_compass_does_not_turn_the_field() -> None:
    random = np.random.default_rng(4)
    fit = fit_compass(turned(random, 300) * 40e-6)
    assert fit is not None and np.allclose(fit.matrix, np.eye(3), atol=1e-9)


def test_coverage() -> None:
    random = np.random.default_rng(5)
    everywhere = turned(random, 2000)
    assert coverage(everywhere) == 1.0
    assert 0.4 < coverage(everywhere[everywhere[:, 2] > 0.0]) < 0.7  # half of them, and those at the edge
    angles = np.linspace(0.0, 2 * np.pi, 1000)
    level = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(1000)])
    assert coverage(level) < 0.4
    assert coverage(np.zeros((3, 3))) == 0.0
    assert turned_coverage(level * 40e-6, 10e-6) == 0.0
    assert turned_coverage(everywhere * 40e-6 + 20e-6, 10e-6) > 0.9


@pytest.mark.parametrize(
    "readings",
    [
        np.zeros((100, 3)),
        np.ones((8, 3)),
        np.random.default_rng(6).normal(size=(100, 1)) * [[1.0, 2.0, 3.0]],
        np.column_stack([np.linspace(-1, 1, 99), np.linspace(-1, 1, 99) ** 2, np.linspace(-1, 1, 99) ** 3]),
    ],
    ids=["nothing", "few", "line", "curve"],
)
def test_readings_that_are_no_ellipsoid(readings: Vector) -> None:
    fit = fit_compass(readings)
    assert fit is None or fit.coverage < 0.75 or fit.residual > 0.1


def test_a_compass_that_is_turned_about_one_axis_covers_too_little() -> None:
    random = np.random.default_rng(7)
    angles = np.linspace(0.0, 4 * np.pi, 1000)
    level = np.column_stack([np.cos(angles), np.sin(angles), np.full(1000, -0.5)]) * 40e-6
    fit = fit_compass(level + random.normal(size=(1000, 3)) * 0.3e-6)
    assert fit is None or fit.coverage < 0.75


# ---- remote control --------------------------------------------------------------------------------------------------


def test_ranges_of_sticks() -> None:
    random = np.random.default_rng(8)
    rest = np.column_stack(
        [1502 + random.integers(-2, 3, 100), np.full(100, 1000), np.full(100, 1500), np.full(100, 1900)]
    )
    wave = np.sin(np.linspace(0.0, 20.0, 1000))
    moved = np.column_stack([1500 + 488 * wave, 1500 + 500 * wave, np.full(1000, 1501), 1500 + 400 * wave])
    stick, throttle, still, switch = fit_ranges(rest, moved)
    assert stick is not None and (stick.minimum, stick.middle, stick.maximum) == (1012, 1502, 1988)
    assert 2 <= stick.deadband <= 4
    assert throttle is not None and (throttle.minimum, throttle.middle, throttle.maximum, throttle.deadband) == (
        1000,
        1500,
        2000,
        0,
    )
    assert still is None
    assert switch is not None and switch.middle == 1500
