# SPDX-License-Identifier: Apache-2.0
"""DifferentialDrive against its inverse kinematics and limits; DifferentialOdometry against scipy's matrix exponential on
SE(2), scipy's Rotation, and covariances from numerical derivatives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import integrate, linalg
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation

DRIVE = "differential_drive.py"
B, L, R = 0.4, 0.1, 0.11  # separation and radii
SIZE: dict[str, Any] = {"wheel_separation": B, "left_radius": L, "right_radius": R}
H = 0.01
ODD = [0.0, -0.0, 1e300, -1e300, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]


def drive(block: Callable[..., Any], **limits: float) -> Any:
    return block(DRIVE, "DifferentialDrive", **SIZE, **limits)


def odometry(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    return block(DRIVE, "DifferentialOdometry", rate=rate, **SIZE, **more)


def feed(odo: Any, left: float = 0.0, right: float = 0.0, **more: Any) -> dict[str, Any]:
    """The same numbers as angles and as speeds; the block takes one pair."""
    wheels = {"left_angle": left, "right_angle": right, "left_speed": left, "right_speed": right}
    found = odo.step(**wheels, **{"reset": False, **more})
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


# ---- DifferentialDrive


def test_wheel_speeds_are_those_of_points_of_a_rigid_body(block: Callable[..., Any]) -> None:
    """v + w x r at the wheels, from numpy."""
    d = drive(block)
    for v, w in np.random.default_rng(1).normal(size=(20, 2)):
        out = d.step(speed=v, yaw_rate=w)
        at = [v + np.cross([0.0, 0.0, w], [0.0, y, 0.0])[0] for y in (B / 2, -B / 2)]
        np.testing.assert_allclose([out["left"] * L, out["right"] * R], at, rtol=1e-12, atol=1e-15)
        assert not out["saturated"] and (out["limited_speed"], out["limited_yaw_rate"]) == (v, w)


@pytest.mark.parametrize(
    "limits",
    [
        {"max_speed": 0.5},
        {"max_yaw_rate": 0.7},
        {"max_wheel_speed": 6.0},
        {"max_speed": 1.0, "max_yaw_rate": 1.0, "max_wheel_speed": 9.0},
    ],
)
def test_limits_keep_the_curvature_and_are_reached(block: Callable[..., Any], limits: dict[str, float]) -> None:
    d = drive(block, **limits)
    saturated = 0
    for v, w in np.random.default_rng(2).normal(size=(60, 2)) * 2.0:
        out = d.step(speed=v, yaw_rate=w)
        assert out["limited_speed"] * w == pytest.approx(out["limited_yaw_rate"] * v)
        assert np.sign(out["limited_speed"]) == np.sign(v)
        shares = [
            abs(out["limited_speed"]) / limits.get("max_speed", 1e308),
            abs(out["limited_yaw_rate"]) / limits.get("max_yaw_rate", 1e308),
            max(abs(out["left"]), abs(out["right"])) / limits.get("max_wheel_speed", 1e308),
        ]
        assert max(shares) <= 1.0 + 1e-12
        if out["saturated"]:
            saturated += 1
            assert max(shares) == pytest.approx(1.0)
        else:
            assert (out["limited_speed"], out["limited_yaw_rate"]) == (v, w)
        assert (out["left"] * L + out["right"] * R) / 2 == pytest.approx(out["limited_speed"], abs=1e-12)
        assert (out["right"] * R - out["left"] * L) / B == pytest.approx(out["limited_yaw_rate"], abs=1e-12)
    assert 5 < saturated < 60


def test_a_limit_of_zero_stops_it_and_limits_change_in_flight(block: Callable[..., Any]) -> None:
    d = drive(block, max_speed=0.0)
    out = d.step(speed=1.0, yaw_rate=1.0)
    assert out["left"] == 0.0 == out["right"] and out["saturated"]
    assert d.step(speed=0.0, yaw_rate=1.0)["limited_yaw_rate"] == 1.0
    d.set(max_speed=0.5)
    assert d.step(speed=1.0, yaw_rate=1.0)["limited_yaw_rate"] == 0.5


def test_drive_extremes(block: Callable[..., Any]) -> None:
    d = drive(block, max_speed=1.0, max_wheel_speed=8.0)
    before = d.step(speed=0.1, yaw_rate=0.1)
    for v in ODD:
        for w in ODD:
            out = d.step(speed=v, yaw_rate=w)
            if np.isfinite(v) and np.isfinite(w):
                assert abs(out["left"]) <= 8.0 and abs(out["right"]) <= 8.0
                assert out["health"] == "nominal"
            else:
                assert out == before | {"health": "degraded"}
            before = out
    assert d.native.get_value("block.counters.faults") == 0
    # a break makes no difference
    before = d.step(speed=0.3, yaw_rate=0.2)
    d.rest()
    assert d.step(speed=0.3, yaw_rate=0.2) == before


# ---- DifferentialOdometry


def se2(way_left: float, way_right: float) -> np.ndarray[Any, Any]:
    """The motion of one step, by scipy's matrix exponential of the twist."""
    ds, dh = (way_left + way_right) / 2, (way_right - way_left) / B
    return np.asarray(linalg.expm(np.array([[0.0, -dh, ds], [dh, 0.0, 0.0], [0.0, 0.0, 0.0]])))


@pytest.mark.parametrize("scale", [1e-9, 1e-3, 0.3, 20.0])
def test_pose_is_the_product_of_exponentials(block: Callable[..., Any], scale: float) -> None:
    """From nearly straight to several turns of the vehicle per step."""
    odo = odometry(block)
    rng = np.random.default_rng(3)
    angles = np.array([1.0, -2.0])
    assert feed(odo, *angles)["position"].tolist() == [0.0, 0.0, 0.0]
    pose = np.eye(3)
    for _ in range(60):
        turn = rng.normal(size=2) * scale
        angles = angles + turn
        out = feed(odo, *angles)
        pose = pose @ se2(L * turn[0], R * turn[1])
        heading = np.arctan2(pose[1, 0], pose[0, 0])
        np.testing.assert_allclose(out["position"], [*pose[:2, 2], 0.0], atol=1e-11 * max(1.0, scale))
        assert abs(np.angle(np.exp(1j * (out["heading"] - heading)))) < 1e-9
        quaternion = Rotation.from_euler("z", out["heading"]).as_quat(scalar_first=True)
        np.testing.assert_allclose(
            np.outer(out["attitude"], out["attitude"]), np.outer(quaternion, quaternion), atol=1e-12
        )
        np.testing.assert_allclose(out["linear"], [(L * turn[0] + R * turn[1]) / 2 / H, 0, 0], rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(out["angular"], [0, 0, (R * turn[1] - L * turn[0]) / B / H], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("rate", [100, 500])
def test_speeds_are_integrated_over_the_period(block: Callable[..., Any], rate: int) -> None:
    odo = odometry(block, rate=rate, use_speeds=True)
    first = feed(odo, 3.0, 4.0)
    v, w = (3.0 * L + 4.0 * R) / 2, (4.0 * R - 3.0 * L) / B
    assert first["position"].tolist() == [0.0, 0.0, 0.0] and first["linear"][0] == pytest.approx(v)
    out = [feed(odo, 3.0, 4.0) for _ in range(rate // 2)][-1]
    path = integrate.solve_ivp(
        lambda t, s: [v * np.cos(s[2]), v * np.sin(s[2]), w], (0.0, 0.5), [0.0, 0.0, 0.0], rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose([*out["position"][:2], out["heading"]], path.y[:, -1], atol=1e-9)
    assert out["linear"][0] == pytest.approx(v) and out["angular"][2] == pytest.approx(w)


def pose_after(pose: Any, ways: Any) -> np.ndarray[Any, Any]:
    x, y, heading = pose
    c, s = np.cos(heading), np.sin(heading)
    end = np.array([[c, -s, x], [s, c, y], [0, 0, 1]]) @ se2(*ways)
    return np.array([end[0, 2], end[1, 2], heading + (ways[1] - ways[0]) / B])


@pytest.mark.parametrize("scale", [0.02, 0.08, 3.0])
def test_covariances_are_those_of_numerical_derivatives(block: Callable[..., Any], scale: float) -> None:
    slip, deviation = 0.02, 0.05
    odo = odometry(block, slip=slip, speed_deviation=deviation, planar_variance=1e-4)
    feed(odo)
    rng = np.random.default_rng(4)
    angles, pose, p = np.zeros(2), np.zeros(3), np.zeros((3, 3))
    for _ in range(12):
        turn = rng.normal(size=2) * scale
        angles += turn
        ways = np.array([L, R]) * turn
        f = approx_fprime(pose, lambda s, u=ways: pose_after(s, u), 1e-7)
        g = approx_fprime(ways, lambda u, s=pose: pose_after(s, u), 1e-7)
        q = np.diag(slip * abs(ways))
        p, pose = f @ p @ f.T + g @ q @ g.T, pose_after(pose, ways)
        out = feed(odo, *angles)
        np.testing.assert_allclose(out["covariance"], p, rtol=1e-4, atol=1e-6 * p.max())
        assert np.linalg.eigvalsh(out["covariance"]).min() > -1e-15 and (out["covariance"] == out["covariance"].T).all()
        whole = np.diag([0, 0, 1e-4, 1e-4, 1e-4, 0.0])
        whole[np.ix_([0, 1, 5], [0, 1, 5])] = out["covariance"]
        np.testing.assert_array_equal(out["pose_covariance"], whole)
        t = np.array([[0.5, 0.5], [-1 / B, 1 / B]])
        speeds = q / H**2 + np.diag((np.array([L, R]) * deviation) ** 2)
        twist = np.diag([0, 1e-4, 1e-4, 1e-4, 1e-4, 0])
        twist[np.ix_([0, 5], [0, 5])] = t @ speeds @ t.T
        np.testing.assert_allclose(out["twist_covariance"], twist, rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("half", [0.0, 1e-5, -0.0099, 0.0099, 0.0101, 1.5])
def test_one_long_step_on_both_sides_of_the_series(block: Callable[..., Any], half: float) -> None:
    odo = odometry(block, slip=0.02)
    feed(odo)
    ways = np.array([5.0 - half * B, 5.0 + half * B])
    out = feed(odo, *(ways / [L, R]))
    g = approx_fprime(ways, lambda u: pose_after(np.zeros(3), u), 1e-7)
    p = g @ np.diag(0.02 * abs(ways)) @ g.T
    np.testing.assert_allclose(out["covariance"], p, rtol=1e-4, atol=2e-6 * p.max())
    np.testing.assert_allclose(out["position"][:2], pose_after(np.zeros(3), ways)[:2], rtol=1e-12, atol=1e-12)


def test_straight_ahead_the_variance_has_a_closed_form(block: Callable[..., Any]) -> None:
    """After a way s: x: slip s / 2, heading: 2 slip s / b^2, y: the integral of (s - u)^2 d heading variance."""
    slip = 0.01
    odo = odometry(block, slip=slip)
    feed(odo)
    s, n = 2.0, 400
    out = [feed(odo, s * i / n / L, s * i / n / R) for i in range(1, n + 1)][-1]
    np.testing.assert_allclose(
        np.diag(out["covariance"]), [slip * s / 2, 2 * slip / B**2 * s**3 / 3, 2 * slip * s / B**2], rtol=1e-5
    )


def test_angles_that_begin_anew(block: Callable[..., Any]) -> None:
    odo = odometry(block, angle_range=2 * np.pi)
    plain = odometry(block)
    for i in range(80):
        a = 0.3 * i
        wrapped = feed(odo, np.angle(np.exp(1j * a)), np.angle(np.exp(-0.5j * a)))
        np.testing.assert_allclose(wrapped["position"], feed(plain, a, -0.5 * a)["position"], atol=1e-12)


@pytest.mark.parametrize("use_speeds", [False, True])
def test_odom_does_not_jump_over_a_break(block: Callable[..., Any], use_speeds: bool) -> None:
    odo = odometry(block, use_speeds=use_speeds, slip=0.01)
    feed(odo)
    before = [feed(odo, 0.1 * i, 0.13 * i) for i in range(1, 20)][-1]
    odo.rest()
    after = feed(odo, 77.0, -5.0)
    for name in ("position", "attitude", "covariance"):
        np.testing.assert_array_equal(after[name], before[name])
    if not use_speeds:
        assert after["linear"].tolist() == [0.0, 0.0, 0.0]
        moved = feed(odo, 77.1, -5.0)
        assert 0.0 < np.hypot(*(moved["position"] - before["position"])[:2]) < 0.02
    zero = feed(odo, 77.1, -5.0, reset=True)
    if not use_speeds:
        assert zero["position"].tolist() == [0.0] * 3 and not zero["covariance"].any() and zero["heading"] == 0.0
        assert zero["attitude"].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_reset_holds_also_where_the_sample_does_not(block: Callable[..., Any]) -> None:
    odo = odometry(block, slip=0.01, planar_variance=0.5)
    for i in range(5):
        feed(odo, 0.1 * i, 0.2 * i)
    lost = feed(odo, float("nan"), 1.0, reset=True)
    assert lost["health"] == "degraded" and not lost["position"].any() and not lost["covariance"].any()
    np.testing.assert_array_equal(lost["pose_covariance"], np.diag([0.0, 0.0, 0.5, 0.5, 0.5, 0.0]))


@pytest.mark.parametrize("use_speeds", [False, True])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_what_is_not_finite_is_passed_over_and_made_up_for(
    block: Callable[..., Any], use_speeds: bool, value: float
) -> None:
    """Two lost samples: the pose is that without the loss, the twist covers the gap."""
    odo, whole = (odometry(block, use_speeds=use_speeds, slip=0.01) for _ in range(2))

    def at(i: int) -> tuple[float, float]:
        return (3.0, 5.0) if use_speeds else (0.03 * i, 0.05 * i)

    for i in range(5):
        before = feed(odo, *at(i))
        feed(whole, *at(i))
    for i in (5, 6):
        bad = feed(odo, at(i)[0], value)
        assert bad["health"] == "degraded"
        for name in ("position", "covariance", "linear", "twist_covariance"):
            np.testing.assert_array_equal(bad[name], before[name])
        feed(whole, *at(i))
    after, wanted = feed(odo, *at(7)), feed(whole, *at(7))
    assert after["health"] == "nominal"
    for name in ("position", "attitude", "linear", "angular"):
        np.testing.assert_allclose(after[name], wanted[name], rtol=1e-9, atol=1e-12)


def test_after_a_break_it_waits_for_finite_angles(block: Callable[..., Any]) -> None:
    odo = odometry(block)
    feed(odo)
    odo.rest()
    assert feed(odo, float("nan"), 5.0)["health"] == "degraded"
    assert feed(odo, 5.0, 5.0)["position"].tolist() == [0.0, 0.0, 0.0]
    assert feed(odo, 5.1, 5.1)["position"][0] > 0.0


@pytest.mark.parametrize("use_speeds", [False, True])
def test_nothing_poisons_it(block: Callable[..., Any], use_speeds: bool) -> None:
    odo = odometry(block, use_speeds=use_speeds, slip=0.01, angle_range=6.0)
    rng = np.random.default_rng(5)
    for _ in range(200):
        feed(odo, *rng.choice(ODD, 2))
    assert odo.native.get_value("block.counters.faults") == 0
    last = [feed(odo, 1.0, 1.0, reset=True) for _ in range(2)][-1]
    assert last["health"] == "nominal" and all(np.isfinite(last[n]).all() for n in odo.outputs)


def test_parameters_change_in_flight(block: Callable[..., Any]) -> None:
    odo = odometry(block)
    feed(odo)
    odo.set(left_radius=0.2, right_radius=0.2)
    assert feed(odo, 1.0, 1.0)["position"].tolist() == [0.2, 0.0, 0.0]
