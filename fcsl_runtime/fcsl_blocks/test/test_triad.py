# SPDX-License-Identifier: Apache-2.0
"""Triad against scipy's Rotation.align_vectors with an exact primary vector, and its covariance against Monte Carlo,
numerical derivatives and the form of Shuster and Oh."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation

ODD = [0.0, -0.0, 1e300, -1e300, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]
S1, S2 = 0.002, 0.01


def triad(block: Callable[..., Any], **more: Any) -> Any:
    return block("triad.py", "Triad", primary_deviation=S1, secondary_deviation=S2, **more)


def feed(found: Any, w: Any, v: Any) -> dict[str, Any]:
    out = found.step(
        primary=list(map(float, w[0])),
        secondary=list(map(float, w[1])),
        primary_reference=list(map(float, v[0])),
        secondary_reference=list(map(float, v[1])),
    )
    return {n: np.array(x) if isinstance(x, list) else x for n, x in out.items()}


def aligned(w: Any, v: Any) -> Rotation:
    """Body to world, the primary vector exactly."""
    return Rotation.align_vectors(v, w, weights=[np.inf, 1.0])[0]


def rotation(out: dict[str, Any]) -> Rotation:
    assert np.linalg.norm(out["attitude"]) == pytest.approx(1.0) and out["attitude"][0] >= 0.0
    return Rotation.from_quat(out["attitude"], scalar_first=True)


def unit(v: Any) -> Any:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def separation(a: Any, b: Any) -> float:
    return float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))


def test_attitude_is_that_of_scipy(block: Callable[..., Any]) -> None:
    """Vectors of any length, which no rotation fits exactly."""
    found, rng = triad(block, degraded_angle=0.0), np.random.default_rng(1)
    for _ in range(100):
        w, v = rng.normal(size=(2, 2, 3)) * 10.0 ** rng.uniform(-3, 3, (2, 2, 1))
        out = feed(found, w, v)
        assert (rotation(out) * aligned(w, v).inv()).magnitude() < 1e-9
        np.testing.assert_allclose(rotation(out).apply(unit(w[0])), unit(v[0]), atol=1e-12)
        assert out["health"] == "nominal"
        assert out["angle"] == pytest.approx(separation(w[0], w[1]))
        assert out["residual"] == pytest.approx(separation(w[0], w[1]) - separation(v[0], v[1]), abs=1e-12)


def test_every_rotation_keeps_its_digits(block: Callable[..., Any]) -> None:
    """Also where elements of the quaternion vanish: half turns, quarter turns, the identity."""
    found = triad(block)
    v = np.array([[0.3, -0.2, 0.9], [0.7, 0.6, -0.1]])
    some = [Rotation.from_quat(q) for q in np.random.default_rng(2).normal(size=(50, 4))]
    some += [Rotation.from_rotvec(a * np.pi * np.eye(3)[i]) for i in range(3) for a in (1.0, 0.5, -0.5, 1.0 - 1e-9)]
    for r in [*some, *Rotation.create_group("O"), Rotation.from_rotvec(np.pi * unit(np.array([1.0, -2.0, 3.0])))]:
        out = feed(found, r.inv().apply(v), v)
        assert (rotation(out) * r.inv()).magnitude() < 1e-14 and abs(out["residual"]) < 1e-15


def test_gravity_and_north(block: Callable[..., Any]) -> None:
    """An accelerometer at rest and a compass: level and 30 degrees left of east in the world's ENU."""
    heading = np.radians(30.0)
    field = np.array([20.0 * np.sin(heading), 20.0 * np.cos(heading), -40.0])
    out = feed(triad(block), [[0.0, 0.0, 9.81], field], [[0.0, 0.0, 1.0], [0.0, 1.0, -2.0]])
    np.testing.assert_allclose(out["attitude"], [np.cos(heading / 2), 0.0, 0.0, np.sin(heading / 2)], atol=1e-15)


@pytest.mark.parametrize("angle", [0.12, 0.8, np.pi / 2, 2.9])
def test_covariance_has_the_form_of_shuster_and_oh(block: Callable[..., Any], angle: float) -> None:
    found, rng = triad(block), np.random.default_rng(3)
    for _ in range(10):
        w1, across = np.linalg.qr(rng.normal(size=(3, 3)))[0][:2]
        w2 = np.cos(angle) * w1 + np.sin(angle) * across
        v = Rotation.random(rng=rng).apply([w1, w2])
        p = S1**2 * np.eye(3) + (
            (S2**2 - S1**2) * np.outer(w1, w1) + S1**2 * (w1 @ w2) * (np.outer(w1, w2) + np.outer(w2, w1))
        ) / np.sum(np.cross(w1, w2) ** 2)
        out = feed(found, [3.0 * w1, 0.1 * w2], v)
        np.testing.assert_allclose(out["covariance"], p, rtol=1e-9, atol=1e-12 * p.max())
        assert (out["covariance"] == out["covariance"].T).all() and np.linalg.eigvalsh(out["covariance"]).min() > 0.0


def test_covariance_is_that_of_numerical_derivatives(block: Callable[..., Any]) -> None:
    found, rng = triad(block, degraded_angle=0.0), np.random.default_rng(4)
    for _ in range(10):
        w = unit(rng.normal(size=(2, 3)))
        v = Rotation.random(rng=rng).apply(w)
        truth = aligned(w, v)

        def error(d: Any, w: Any = w, v: Any = v, truth: Rotation = truth) -> Any:
            """In body axes, of scipy's attitude, with both vectors turned by small rotations."""
            turned = [Rotation.from_rotvec(d[3 * i : 3 * i + 3]).apply(w[i]) for i in range(2)]
            return (truth.inv() * aligned(turned, v)).as_rotvec()

        g = approx_fprime(np.zeros(6), error, 1e-7)
        p = g @ np.diag([S1**2] * 3 + [S2**2] * 3) @ g.T
        np.testing.assert_allclose(feed(found, w, v)["covariance"], p, rtol=1e-4, atol=1e-5 * p.max())


def test_covariance_is_that_of_noise(block: Callable[..., Any]) -> None:
    """Monte Carlo: attitudes of noisy vectors spread as the covariance says; the mean of their squared, normalized
    errors is that of a chi-square of three degrees of freedom."""
    found, rng, n = triad(block), np.random.default_rng(5), 600
    w = unit(np.array([[0.2, 0.9, -0.4], [-0.8, 0.5, 0.3]]))
    truth = Rotation.from_rotvec([0.4, -1.0, 2.0])
    p = feed(found, w, truth.apply(w))["covariance"]
    errors, squares = [], []
    for _ in range(n):
        noisy = w + rng.normal(size=(2, 3)) * [[S1], [S2]]
        out = feed(found, noisy, truth.apply(w))
        errors.append((truth.inv() * rotation(out)).as_rotvec())
        squares.append(errors[-1] @ np.linalg.solve(out["covariance"], errors[-1]))
    # standard deviations of a sample's covariance are sqrt((p_ij^2 + p_ii p_jj) / n)
    sample, diagonal = np.cov(np.transpose(errors)), np.diag(p)
    assert (abs(sample - p) < 4.0 * np.sqrt((p**2 + np.outer(diagonal, diagonal)) / n)).all()
    assert abs(np.mean(squares) - 3.0) < 4.0 * np.sqrt(6.0 / n)


@pytest.mark.parametrize("frame", ["body", "world"])
@pytest.mark.parametrize("opposite", [False, True])
def test_health_of_nearly_parallel_vectors(block: Callable[..., Any], frame: str, opposite: bool) -> None:
    found = triad(block, degraded_angle=0.2, failed_angle=0.01)
    good = [[0.0, 0.0, 2.0], [1.0, 0.0, 0.0]]
    for angle, health in (
        (0.21, "nominal"),
        (0.19, "degraded"),
        (0.011, "degraded"),
        (0.009, "failed"),
        (0.0, "failed"),
    ):
        near = [[0.0, 0.0, 3.0], [0.0, np.sin(angle), (-1.0 if opposite else 1.0) * np.cos(angle)]]
        w, v = (near, good) if frame == "body" else (good, near)
        out = feed(found, w, v)
        assert out["health"] == health
        for name in found.outputs:
            assert np.isnan(out[name]).all() if health == "failed" else np.isfinite(out[name]).all()
        if health != "failed":
            assert (rotation(out) * aligned(w, v).inv()).magnitude() < 1e-9
    found.set(degraded_angle=0.0, failed_angle=1e-6)
    close = feed(found, [[0, 0, 1], [0, 2e-6, 1]], good)
    assert close["health"] == "nominal" and close["angle"] == pytest.approx(2e-6, rel=1e-9)


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize("bad", [[0.0, -0.0, 0.0], [1.0, float("nan"), 0.0], [float("inf"), 0.0, 1.0]])
def test_a_vector_of_zero_or_not_finite_fails(block: Callable[..., Any], place: int, bad: list[float]) -> None:
    found = triad(block)
    vectors = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.2], [0.0, 0.0, 1.0], [1.0, 0.0, 0.2]]
    before = feed(found, vectors[:2], vectors[2:])
    assert before["health"] == "nominal" and before["attitude"].tolist() == pytest.approx([1.0, 0.0, 0.0, 0.0])
    wrong = [bad if i == place else v for i, v in enumerate(vectors)]
    out = feed(found, wrong[:2], wrong[2:])
    assert out["health"] == "failed" and all(np.isnan(out[n]).all() for n in found.outputs)
    found.rest()
    after = feed(found, vectors[:2], vectors[2:])
    assert all(np.array_equal(after[n], before[n]) for n in (*found.outputs, "health"))


def test_extremes(block: Callable[..., Any]) -> None:
    found, rng = triad(block), np.random.default_rng(6)
    healths = set()
    for _ in range(400):
        w, v = rng.choice(ODD[:8] if rng.random() < 0.6 else ODD, (2, 2, 3))
        out = feed(found, w, v)
        healths.add(out["health"])
        good = out["health"] != "failed"
        assert all((np.isfinite if good else np.isnan)(out[n]).all() for n in found.outputs)
    assert found.native.get_value("block.counters.faults") == 0
    assert {"nominal", "failed"} <= healths
    tiny = feed(found, [[0, 0, 5e-324], [1e300, 0, 1e300]], [[0, 0, 1e-310], [1e-5, 0, 1e-5]])
    assert tiny["attitude"].tolist() == pytest.approx([1.0, 0.0, 0.0, 0.0]) and tiny["health"] == "nominal"


def test_the_deviations_change_in_flight(block: Callable[..., Any]) -> None:
    found = triad(block)
    vectors = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]]
    assert np.diag(feed(found, vectors, vectors)["covariance"]) == pytest.approx([S1**2, S1**2, S2**2])
    found.set(primary_deviation=0.0, secondary_deviation=0.1)
    assert np.diag(feed(found, vectors, vectors)["covariance"]) == pytest.approx([0.0, 0.0, 0.01])
