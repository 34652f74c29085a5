# SPDX-License-Identifier: Apache-2.0
"""Mahony against scipy's Rotation, the closed forms of its errors, and scipy's matrix exponential of the linear filter."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

G = 9.80665
ODD = [0.0, -0.0, 1e300, -1e300, 1.7e308, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]


def mahony(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    return block("mahony.py", "Mahony", rate=rate, **more)


def feed(m: Any, gyro: Any = (0.0, 0.0, 0.0), acceleration: Any = (0.0, 0.0, G), field: Any = (0.0, 0.0, 0.0)) -> Any:
    given = {"gyro": gyro, "acceleration": acceleration, "magnetic_field": field}
    found = m.step(**{n: np.asarray(v, float).tolist() for n, v in given.items()})
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


def attitude(out: Any) -> Rotation:
    return Rotation.from_quat(out["attitude"], scalar_first=True)


def angle_between(a: Rotation, b: Rotation) -> float:
    return float((a.inv() * b).magnitude())


def world(z_down: bool = False, declination: float = 0.0, dip: float = 1.1) -> tuple[Any, Any]:
    """What an accelerometer at rest and a magnetometer measure in axes of the world."""
    north, east = np.cos(dip) * np.cos(declination), np.cos(dip) * np.sin(declination)
    if z_down:
        return np.array([0.0, 0.0, -G]), 50.0 * np.array([north, east, np.sin(dip)])
    return np.array([0.0, 0.0, G]), 50.0 * np.array([east, north, -np.sin(dip)])


def rest(m: Any, q: Rotation, of: Any, gyro: Any = (0.0, 0.0, 0.0)) -> Any:
    return feed(m, gyro, q.inv().apply(of[0]), q.inv().apply(of[1]))


@pytest.mark.parametrize("rate", [100, 500])
def test_the_gyroscope_alone_is_integrated_exactly(block: Callable[..., Any], rate: int) -> None:
    m = mahony(block, rate=rate, kp=0.0, ki=0.0)
    feed(m)
    q = Rotation.identity()
    for w in np.random.default_rng(1).normal(size=(200, 3)) * 5.0:
        out = feed(m, w)
        q = q * Rotation.from_rotvec(w / rate)
        assert (out["rate"] == w).all()
    assert angle_between(attitude(out), q) < 1e-12
    assert np.linalg.norm(out["attitude"]) == pytest.approx(1.0, abs=1e-14)


@pytest.mark.parametrize("declination", [0.0, 0.3])
@pytest.mark.parametrize("z_down", [False, True])
def test_the_first_run_aligns(block: Callable[..., Any], z_down: bool, declination: float) -> None:
    m = mahony(block, z_down=z_down, declination=declination)
    of = world(z_down, declination)
    for q in [*Rotation.random(20, rng=2), Rotation.identity(), Rotation.from_euler("x", 180, degrees=True)]:
        out = rest(m, q, of)
        assert angle_between(attitude(out), q) < 1e-7 and out["aligned"] and out["health"] == "nominal"
        wanted, _ = Rotation.align_vectors(
            [of[0] / G, of[1] / 50.0], [q.inv().apply(of[0]) / G, q.inv().apply(of[1]) / 50]
        )
        assert angle_between(attitude(out), wanted) < 1e-6
        m.rest()


def test_without_a_field_it_aligns_the_shortest_way(block: Callable[..., Any]) -> None:
    m = mahony(block)
    wanted = Rotation.from_rotvec([0.3, -0.4, 0.0])
    assert angle_between(attitude(feed(m, acceleration=wanted.inv().apply([0, 0, G]))), wanted) < 1e-12
    opposite = mahony(block)
    assert feed(opposite, acceleration=[0.0, 0.0, -G])["attitude"].tolist() == [0.0, 1.0, 0.0, 0.0]


@pytest.mark.parametrize("degrees", [20.0, 170.0])
def test_tilt_converges_as_the_closed_form(block: Callable[..., Any], degrees: float) -> None:
    """angle' = -kp sin(angle): tan(angle / 2) = tan(angle0 / 2) exp(-kp t)."""
    kp = 0.8
    m = mahony(block, rate=500, kp=kp, ki=0.0)
    feed(m)
    tilted = Rotation.from_rotvec(np.radians(degrees) * np.array([0.6, -0.8, 0.0]))
    out = [feed(m, acceleration=tilted.inv().apply([0, 0, G])) for _ in range(1000)][-1]
    left = np.arccos((attitude(out).inv() * tilted).as_matrix()[2, 2])
    assert np.tan(left / 2) == pytest.approx(np.tan(np.radians(degrees) / 2) * np.exp(-kp * 2.0), rel=5e-3)
    assert (out["bias"] == 0.0).all()


@pytest.mark.parametrize("z_down", [False, True])
@pytest.mark.parametrize("degrees", [20.0, -170.0])
def test_yaw_converges_as_the_closed_form(block: Callable[..., Any], degrees: float, z_down: bool) -> None:
    kp = 0.8
    m = mahony(block, rate=500, kp=kp, ki=0.0, z_down=z_down)
    of = world(z_down)
    tilt = Rotation.from_euler("xy", [0.5, -0.4])
    rest(m, tilt, of)
    turned = Rotation.from_euler("z", degrees, degrees=True) * tilt
    out = [rest(m, turned, of) for _ in range(1000)][-1]
    left = (attitude(out) * turned.inv()).as_rotvec()
    assert np.abs(left[:2]).max() < 1e-9
    assert np.tan(-left[2] / 2) == pytest.approx(np.tan(np.radians(degrees) / 2) * np.exp(-kp * 2.0), rel=5e-3)


def test_small_errors_are_those_of_the_linear_filter(block: Callable[..., Any]) -> None:
    """error' = (gyro bias - bias) - kp error, bias' = ki error, about each axis, by scipy's expm."""
    kp, ki, h, true = 1.2, 0.9, 0.002, 0.003
    m = mahony(block, rate=500, kp=kp, ki=ki)
    of = world(dip=0.0)  # with a dip, a tilt error is seen as one of yaw
    rest(m, Rotation.identity(), of)
    state = np.array([0.0, 0.0, true])
    step = expm(np.array([[-kp, -1.0, 1.0], [ki, 0.0, 0.0], [0.0, 0.0, 0.0]]) * h)
    for i in range(1000):
        out = rest(m, Rotation.identity(), of, gyro=[true, -true, true])
        state = step @ state
        if i % 100 == 99:
            error = attitude(out).as_rotvec()
            np.testing.assert_allclose(error, state[0] * np.array([1, -1, 1]), atol=2e-5)
            np.testing.assert_allclose(out["bias"], state[1] * np.array([1, -1, 1]), atol=2e-5)


@pytest.mark.parametrize("z_down", [False, True])
def test_the_bias_is_found_in_motion(block: Callable[..., Any], z_down: bool) -> None:
    m = mahony(block, z_down=z_down)
    of, true, h = world(z_down), np.array([0.02, -0.03, 0.01]), 0.01
    q = Rotation.random(rng=4)
    rest(m, q, of)
    for i in range(3000):
        w = np.array([np.sin(0.011 * i), 0.7 * np.cos(0.017 * i), 0.5])
        q = q * Rotation.from_rotvec(w * h)
        out = rest(m, q, of, gyro=w + true)
    np.testing.assert_allclose(out["bias"], true, atol=2e-4)
    np.testing.assert_allclose(out["rate"], w, atol=2e-4)
    assert angle_between(attitude(out), q) < 5e-4


def test_the_bias_has_a_limit(block: Callable[..., Any]) -> None:
    m = mahony(block, bias_limit=0.01, ki=5.0)
    for _ in range(300):
        out = feed(m, gyro=[0.5, -0.5, 0.0])
    assert out["bias"].tolist() == [0.01, -0.01, 0.0]


def test_a_disturbed_field_does_not_tilt(block: Callable[..., Any]) -> None:
    m = mahony(block, ki=0.0)
    feed(m)
    for field in np.random.default_rng(5).normal(size=(200, 3)):
        out = feed(m, field=field)
        np.testing.assert_allclose(attitude(out).apply([0.0, 0.0, 1.0]), [0.0, 0.0, 1.0], atol=1e-12)
    assert abs(attitude(out).as_rotvec()[2]) > 1e-3  # yaw it does turn


def test_accelerations_beyond_the_gate_do_not_count(block: Callable[..., Any]) -> None:
    m = mahony(block, acceleration_gate=0.1)
    feed(m)
    for scale, moves in ((1.09, True), (1.11, False), (0.91, True), (0.89, False), (0.0, False)):
        before = attitude(feed(m))
        after = attitude(feed(m, acceleration=scale * G * np.array([np.sin(0.5), 0.0, np.cos(0.5)])))
        assert (angle_between(before, after) > 2e-3) == moves, scale
    m.set(acceleration_gate=1.0)
    before = attitude(feed(m))
    assert angle_between(before, attitude(feed(m, acceleration=[G, 0.0, 0.0]))) > 5e-3


def test_after_a_break_it_aligns_again(block: Callable[..., Any]) -> None:
    """Yaw and bias stay where nothing measures yaw."""
    m = mahony(block, kp=0.0, ki=0.5)
    feed(m)
    for _ in range(100):
        out = feed(m, gyro=[0.0, 0.0, 0.7], acceleration=[0.5, 0.0, G])
    yaw, bias = attitude(out).as_euler("ZYX")[0], out["bias"]
    assert yaw == pytest.approx(0.7, abs=0.05) and np.abs(bias).max() > 1e-3
    m.rest()
    out = feed(m, gyro=[9.0, 9.0, 9.0])
    np.testing.assert_allclose(attitude(out).as_euler("ZYX"), [yaw, 0.0, 0.0], atol=0.03)
    np.testing.assert_allclose(attitude(out).apply([0, 0, 1]), [0, 0, 1], atol=1e-12)
    assert (out["bias"] == bias).all()


def test_it_waits_for_a_vertical(block: Callable[..., Any]) -> None:
    m = mahony(block)
    for _ in range(3):
        out = feed(m, gyro=[1.0, 1.0, 1.0], acceleration=[0.0, 0.0, 0.0])
        assert out["health"] == "degraded" and not out["aligned"] and out["attitude"].tolist() == [1.0, 0.0, 0.0, 0.0]
    out = feed(m, acceleration=[0.0, G, 0.0])
    assert out["health"] == "nominal" and out["aligned"]
    np.testing.assert_allclose(attitude(out).apply([0, 1, 0]), [0, 0, 1], atol=1e-12)


@pytest.mark.parametrize("name", ["gyro", "acceleration", "field"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over_and_made_up_for(block: Callable[..., Any], name: str, value: float) -> None:
    m, whole = mahony(block, kp=0.0, ki=0.0), mahony(block, kp=0.0, ki=0.0)
    w = [1.0, 2.0, 3.0]
    for each in (m, whole):
        feed(each)
        before = feed(each, w)
    for _ in range(2):
        bad = feed(m, **{"gyro": w, name: [0.0, 0.0, value]})
        assert bad["health"] == "degraded"
        for n in ("attitude", "rate", "bias"):
            assert (bad[n] == before[n]).all()
        feed(whole, w)
    after, wanted = feed(m, w), feed(whole, w)
    assert after["health"] == "nominal" and angle_between(attitude(after), attitude(wanted)) < 1e-12


@pytest.mark.parametrize("name", ["gyro", "acceleration", "field"])
def test_a_first_sample_that_is_not_finite_does_not_align(block: Callable[..., Any], name: str) -> None:
    m = mahony(block)
    out = feed(m, **{"gyro": [1.0, 0.0, 0.0], name: [0.0, float("nan"), 1.0]})
    assert out["health"] == "degraded" and not out["aligned"]
    assert angle_between(attitude(feed(m, [1.0, 0.0, 0.0])), Rotation.identity()) < 1e-12


def test_after_a_break_it_waits_for_finite_samples(block: Callable[..., Any]) -> None:
    m = mahony(block)
    feed(m)
    m.rest()
    tilted = Rotation.from_rotvec([0.5, 0.0, 0.0])
    assert feed(m, gyro=[float("nan")] * 3)["health"] == "degraded"
    out = feed(m, gyro=[1.0] * 3, acceleration=tilted.inv().apply([0, 0, G]))
    assert angle_between(attitude(out), tilted) < 1e-12


def test_extremes(block: Callable[..., Any]) -> None:
    m = mahony(block)
    rng = np.random.default_rng(6)
    for i in range(300):
        out = feed(m, *rng.choice(ODD, (3, 3)))
        assert np.isfinite(out["attitude"]).all() and np.isfinite(out["bias"]).all()
        assert np.linalg.norm(out["attitude"]) == pytest.approx(1.0)
        if i % 50 == 49:
            m.rest()
    assert m.native.get_value("block.counters.faults") == 0
