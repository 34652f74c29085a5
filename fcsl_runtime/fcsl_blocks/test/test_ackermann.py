# SPDX-License-Identifier: Apache-2.0
"""AckermannSteering against the velocities of points of a rigid body and closed forms of its limits; AckermannOdometry
against scipy's solve_ivp, matrix exponential on SE(2) and Rotation, and covariances from numerical derivatives."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy import integrate, linalg
from scipy.optimize import approx_fprime
from scipy.spatial.transform import Rotation

FILE = "ackermann.py"
BASE, KINGPINS, TRACK, L, R = 2.5, 1.2, 1.5, 0.3, 0.32  # wheelbase, tracks and radii
H = 0.01
STOP = 0.6  # greatest angle of the bicycle model
WHEELS: dict[str, Any] = {"wheelbase": BASE, "left_radius": L, "right_radius": R}
SIZE: dict[str, Any] = WHEELS | {"steering_track": KINGPINS, "traction_track": TRACK, "max_steering": STOP}
ODD = [0.0, -0.0, 1e300, -1e300, 5e-324, 1e-308, 1.0, -3.0, float("inf"), float("-inf"), float("nan")]


def car(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    return block(FILE, "AckermannSteering", rate=rate, **{**SIZE, **more})


def steer(vehicle: Any, speed: float = 0.0, bend: float = 0.0, **more: Any) -> dict[str, Any]:
    """The same number as curvature and as yaw rate; the block takes one."""
    given = {"speed": speed, "curvature": bend, "yaw_rate": bend, "track_steering": 0.0, "track_speed": 0.0}
    return dict(vehicle.step(**{**given, **more}))


def odometry(block: Callable[..., Any], rate: int = 100, **more: Any) -> Any:
    return block(FILE, "AckermannOdometry", rate=rate, **{**WHEELS, **more})


def feed(odo: Any, left: float, right: float, *steering: float, **more: Any) -> dict[str, Any]:
    """The same numbers as angles and as speeds; one angle of steering is that of both wheels."""
    wheels = {"left_angle": left, "right_angle": right, "left_speed": left, "right_speed": right}
    front = {"left_steering": steering[0], "right_steering": steering[-1]}
    found = odo.step(**wheels, **front, **{"reset": False, **more})
    return {n: np.array(v) if isinstance(v, list) else v for n, v in found.items()}


# ---- AckermannSteering


@pytest.mark.parametrize("front_drive", [False, True])
def test_wheels_move_as_points_of_a_rigid_body(block: Callable[..., Any], front_drive: bool) -> None:
    """v + w x r at the wheels, from numpy: no wheel slips, forward and backward."""
    vehicle = car(block, front_drive=front_drive)
    for v, steering in np.random.default_rng(1).uniform([-9.0, -STOP], [9.0, STOP], (40, 2)):
        out = steer(vehicle, v, np.tan(steering) / BASE)
        assert out["steering"] == pytest.approx(steering, rel=1e-12) and out["limited_speed"] == v
        assert not out["saturated"]
        w = out["limited_yaw_rate"]
        assert w == pytest.approx(v * np.tan(steering) / BASE, rel=1e-12) == v * out["limited_curvature"]

        def velocity(x: float, y: float, v: float = v, w: float = w) -> Any:
            return np.array([v, 0.0, 0.0]) + np.cross([0.0, 0.0, w], [x, y, 0.0])

        for side, name, radius in ((0.5, "left", L), (-0.5, "right", R)):
            front = velocity(BASE, side * KINGPINS) / v
            assert out[f"{name}_steering"] == pytest.approx(np.arctan2(front[1], front[0]), rel=1e-12)
            driven = velocity(BASE if front_drive else 0.0, side * TRACK)
            assert out[name] * radius == pytest.approx(np.copysign(np.linalg.norm(driven), v), rel=1e-12)


def test_the_bicycle_is_the_case_without_tracks(block: Callable[..., Any]) -> None:
    vehicle = car(block, steering_track=0.0, traction_track=0.0, front_drive=True)
    out = steer(vehicle, 2.0, 0.1)
    assert out["left_steering"] == out["right_steering"] == out["steering"] == np.arctan(0.25)
    assert out["left"] * L == pytest.approx(2.0 / np.cos(out["steering"])) == pytest.approx(out["right"] * R)
    straight = steer(vehicle, 2.0, 0.0)
    assert straight["steering"] == 0.0 and straight["left"] == 2.0 / L and not straight["saturated"]


def test_the_inner_wheel_turns_backward_about_a_point_between_the_wheels(block: Callable[..., Any]) -> None:
    vehicle = car(block, max_steering=1.57, traction_track=8.0, steering_track=8.0)
    out = steer(vehicle, 1.0, 0.5)
    assert out["left"] == pytest.approx(-1.0 / L) and out["right"] == pytest.approx(3.0 / R)
    assert out["left_steering"] == pytest.approx(np.arctan2(1.25, -1.0)) and 0.0 < out["right_steering"] < 0.6


def test_yaw_rate_over_speed_is_the_curvature(block: Callable[..., Any]) -> None:
    vehicle, other = car(block, use_yaw_rate=True), car(block)
    for v, w in np.random.default_rng(2).normal(size=(20, 2)):
        one, two = steer(vehicle, v, w), steer(other, v, w / v)
        assert one == two
        if not one["saturated"]:
            assert one["limited_yaw_rate"] == pytest.approx(w)


def test_at_rest_a_yaw_rate_leaves_the_steering(block: Callable[..., Any]) -> None:
    vehicle = car(block, use_yaw_rate=True, hold_speed=0.1)
    angle = steer(vehicle, 1.0, 0.1)["steering"]
    assert angle == pytest.approx(np.arctan(0.25))
    for v, w in ((0.0, 0.0), (0.0, 3.0), (-0.1, 1.0), (0.05, -1.0)):
        assert steer(vehicle, v, w)["steering"] == angle
    assert steer(vehicle, 0.11, -1.0)["steering"] == -STOP
    vehicle.set(hold_speed=0.0)
    assert steer(vehicle, 5e-324, 1.0)["steering"] == STOP
    assert steer(vehicle, 0.0, -1.0)["steering"] == STOP


def test_the_angle_is_limited_and_the_speed_stays(block: Callable[..., Any]) -> None:
    out = steer(car(block), 3.0, -9.0)
    assert out["steering"] == -STOP and out["saturated"] and out["limited_speed"] == 3.0
    assert out["limited_yaw_rate"] == pytest.approx(-3.0 * np.tan(STOP) / BASE)


@pytest.mark.parametrize("rate", [100, 500])
def test_the_rate_of_the_angle_is_limited(block: Callable[..., Any], rate: int) -> None:
    vehicle = car(block, rate=rate, max_steering_rate=0.5)
    found = [steer(vehicle, 2.0, 9.0) for _ in range(rate)] + [steer(vehicle, 2.0, -9.0) for _ in range(rate)]
    t = np.arange(1, 2 * rate + 1) / rate
    np.testing.assert_allclose([f["steering"] for f in found], np.interp(t, [0, 1, 2], [0, 0.5, 0]), atol=1e-12)
    assert all(f["saturated"] and f["limited_speed"] == 2.0 for f in found)
    np.testing.assert_allclose(
        [f["limited_yaw_rate"] for f in found], [2.0 / BASE * np.tan(f["steering"]) for f in found], atol=1e-12
    )
    vehicle.set(max_steering_rate=5.0)
    assert steer(vehicle, 2.0, 9.0)["steering"] == pytest.approx(found[-1]["steering"] + 5.0 / rate)


@pytest.mark.parametrize("rate", [100, 500])
def test_speed_follows_the_accelerations_through_zero(block: Callable[..., Any], rate: int) -> None:
    """Piecewise linear, with the corner at standstill between two runs."""
    limits: dict[str, Any] = {"max_acceleration": 1.0, "max_deceleration": 3.7}
    vehicle = car(block, rate=rate, **limits)
    n = 2 * rate
    found = [steer(vehicle, 9.0) for _ in range(n)] + [steer(vehicle, -1.0) for _ in range(n)]
    found += [steer(vehicle, 0.0) for _ in range(n)]
    t = np.arange(1, 3 * n + 1) / rate
    stands = 2.0 + 2.0 / 3.7
    wanted = np.interp(t, [0.0, 2.0, stands, stands + 1.0, 4.0, 4.0 + 1.0 / 3.7], [0.0, 2.0, 0.0, -1.0, -1.0, 0.0])
    np.testing.assert_allclose([f["limited_speed"] for f in found], wanted, atol=1e-12)
    assert found[0]["saturated"] and not found[-1]["saturated"]


@pytest.mark.parametrize(
    "limits",
    [
        {"max_speed": 2.0},
        {"max_wheel_speed": 9.0},
        {"max_lateral_acceleration": 1.0},
        {"max_speed": 4.0, "max_wheel_speed": 14.0, "max_lateral_acceleration": 1.5},
    ],
)
@pytest.mark.parametrize("front_drive", [False, True])
def test_limits_of_speed_keep_the_curvature_and_are_reached(
    block: Callable[..., Any], limits: dict[str, Any], front_drive: bool
) -> None:
    vehicle = car(block, use_yaw_rate=True, front_drive=front_drive, **limits)
    saturated = 0
    for v, k in np.random.default_rng(3).uniform([-8.0, -0.25], [8.0, 0.25], (80, 2)):
        out = steer(vehicle, v, v * k)
        assert out["limited_curvature"] == pytest.approx(k, rel=1e-9)
        assert np.sign(out["limited_speed"]) == np.sign(v)
        shares = [
            abs(out["limited_speed"]) / limits.get("max_speed", 1e308),
            max(abs(out["left"]), abs(out["right"])) / limits.get("max_wheel_speed", 1e308),
            abs(out["limited_speed"] * out["limited_yaw_rate"]) / limits.get("max_lateral_acceleration", 1e308),
        ]
        assert max(shares) <= 1.0 + 1e-12
        if out["limited_speed"] != v:
            saturated += 1
            assert out["saturated"] and max(shares) == pytest.approx(1.0)
    assert 5 < saturated < 80


def test_it_begins_at_the_tracked_angle_and_speed(block: Callable[..., Any]) -> None:
    limits: dict[str, Any] = {"max_steering_rate": 1.0, "max_acceleration": 2.0, "max_deceleration": 2.0}
    vehicle = car(block, **limits)
    first = steer(vehicle, 9.0, 9.0, track_steering=0.2, track_speed=1.5)
    assert first["steering"] == pytest.approx(0.21) and first["limited_speed"] == pytest.approx(1.52)
    then = steer(vehicle, 9.0, 9.0, track_steering=-0.2, track_speed=-3.0)
    assert then["steering"] == pytest.approx(0.22) and then["limited_speed"] == pytest.approx(1.54)
    vehicle.rest()
    again = steer(vehicle, 9.0, 9.0, track_steering=-7.0, track_speed=-3.0)
    assert again["steering"] == pytest.approx(-STOP + 0.01) and again["limited_speed"] == pytest.approx(-2.98)


def test_a_lowered_limit_is_approached_at_the_rates(block: Callable[..., Any]) -> None:
    vehicle = car(block)
    steer(vehicle, 4.0, 9.0)
    vehicle.set(max_steering=0.3, max_steering_rate=1.0, max_speed=2.0, max_deceleration=5.0)
    out = steer(vehicle, 4.0, 9.0)
    assert out["steering"] == pytest.approx(STOP - 0.01) and out["limited_speed"] == pytest.approx(3.95)
    for _ in range(50):
        out = steer(vehicle, 4.0, 9.0)
    assert out["steering"] == 0.3 and out["limited_speed"] == 2.0


@pytest.mark.parametrize("name", ["speed", "bend"])
@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_command_that_is_not_finite_is_passed_over(block: Callable[..., Any], name: str, value: float) -> None:
    vehicle = car(block, max_steering_rate=1.0, max_acceleration=1.0)
    before = [steer(vehicle, 2.0, 0.1) for _ in range(5)][-1]
    bad = steer(vehicle, **{"speed": 2.0, "bend": 0.1, name: value})
    assert bad == {**before, "health": "degraded"}
    after = steer(vehicle, 2.0, 0.1)
    assert after["limited_speed"] == pytest.approx(0.06) and after["steering"] == pytest.approx(0.06)
    assert steer(vehicle, 2.0, 0.1, yaw_rate=value, track_speed=value)["health"] == "nominal"


def test_a_start_waits_for_finite_inputs(block: Callable[..., Any]) -> None:
    vehicle = car(block, max_acceleration=1.0)
    steer(vehicle, 1.0)
    vehicle.rest()
    for bad in ({"speed": float("nan")}, {"track_speed": float("nan")}, {"track_steering": float("inf")}):
        assert steer(vehicle, **{"speed": 1.0, "track_speed": 0.5, **bad})["health"] == "degraded"
    assert steer(vehicle, 1.0, track_speed=0.5)["limited_speed"] == pytest.approx(0.51)


@pytest.mark.parametrize("use_yaw_rate", [False, True])
@pytest.mark.parametrize("zero", [False, True])
def test_steering_extremes(block: Callable[..., Any], use_yaw_rate: bool, zero: bool) -> None:
    names = ["max_speed", "max_acceleration", "max_deceleration", "max_lateral_acceleration", "max_wheel_speed"]
    limits: dict[str, Any] = dict.fromkeys(names, 0.0) if zero else {"max_speed": 30.0}
    vehicle = car(block, use_yaw_rate=use_yaw_rate, **limits)
    rng = np.random.default_rng(4)
    for i in range(300):
        if i % 50 == 49:
            vehicle.rest()
        v, bend, angle, speed = rng.choice(ODD, 4)
        out = steer(vehicle, v, bend, track_steering=angle, track_speed=speed)
        assert all(np.isfinite(out[n]) for n in vehicle.outputs)
    assert vehicle.native.get_value("block.counters.faults") == 0
    assert zero or [steer(vehicle, 1.0, 0.1) for _ in range(2)][-1]["limited_speed"] == 1.0


def test_a_speed_whose_wheels_overflow_is_passed_over(block: Callable[..., Any]) -> None:
    vehicle = car(block)
    before = steer(vehicle, 1.0, 0.1)
    vehicle.rest()
    assert steer(vehicle, 1e308, 0.2, track_speed=1e308) == {**before, "health": "degraded"}
    assert steer(vehicle, 1.0, 0.1, track_speed=2.0) == before


# ---- both


@pytest.mark.parametrize("front_drive", [False, True])
def test_odometry_finds_what_steering_commands(block: Callable[..., Any], front_drive: bool) -> None:
    vehicle = car(block, front_drive=front_drive)
    size: dict[str, Any] = {"steering_track": KINGPINS, "traction_track": TRACK, "front_drive": front_drive}
    odo = odometry(block, use_speeds=True, **size)
    for v, k in np.random.default_rng(5).uniform([-5.0, -0.27], [5.0, 0.27], (30, 2)):
        out = steer(vehicle, v, k)
        found = feed(odo, out["left"], out["right"], out["left_steering"], out["right_steering"])
        assert found["linear"][0] == pytest.approx(v) and found["angular"][2] == pytest.approx(v * k)


# ---- AckermannOdometry


def se2(way: float, turn: float) -> np.ndarray[Any, Any]:
    """The motion of one step, by scipy's matrix exponential of the twist."""
    return np.asarray(linalg.expm(np.array([[0.0, -turn, way], [turn, 0.0, 0.0], [0.0, 0.0, 0.0]])))


def pose_after(pose: Any, way: float, turn: float) -> np.ndarray[Any, Any]:
    x, y, heading = pose
    c, s = np.cos(heading), np.sin(heading)
    end = np.array([[c, -s, x], [s, c, y], [0, 0, 1]]) @ se2(way, turn)
    return np.array([end[0, 2], end[1, 2], heading + turn])


def shares(curvature: float, front_drive: bool) -> float:
    """The sum of the speeds of the driven wheels, over that of the vehicle."""
    if not front_drive:
        return 2.0
    ahead = curvature * BASE
    return float(sum(np.hypot(1.0 + side * curvature * TRACK, ahead) for side in (-0.5, 0.5)))


@pytest.mark.parametrize("scale", [1e-9, 0.3, 20.0])
def test_pose_is_the_product_of_exponentials(block: Callable[..., Any], scale: float) -> None:
    """From nearly no way to several turns of the vehicle per step."""
    odo = odometry(block)
    rng = np.random.default_rng(6)
    angles, bend = np.array([1.0, -2.0]), 0.0
    assert feed(odo, *angles, 0.0)["position"].tolist() == [0.0, 0.0, 0.0]
    pose = np.eye(3)
    for _ in range(60):
        turn, steering = rng.normal(size=2) * scale, rng.uniform(-1.0, 1.0)
        angles = angles + turn
        out = feed(odo, *angles, steering)
        way = (L * turn[0] + R * turn[1]) / 2
        mean, bend = (bend + np.tan(steering) / BASE) / 2, np.tan(steering) / BASE
        pose = pose @ se2(way, way * mean)
        heading = np.arctan2(pose[1, 0], pose[0, 0])
        np.testing.assert_allclose(out["position"], [*pose[:2, 2], 0.0], atol=1e-11 * max(1.0, scale))
        assert abs(np.angle(np.exp(1j * (out["heading"] - heading)))) < 1e-9
        quaternion = Rotation.from_euler("z", out["heading"]).as_quat(scalar_first=True)
        np.testing.assert_allclose(
            np.outer(out["attitude"], out["attitude"]), np.outer(quaternion, quaternion), atol=1e-12
        )
        np.testing.assert_allclose(out["linear"], [way / H, 0, 0], rtol=1e-5, atol=1e-9)
        np.testing.assert_allclose(out["angular"], [0, 0, way * mean / H], rtol=1e-5, atol=1e-9)


@pytest.mark.parametrize("rate", [100, 500])
@pytest.mark.parametrize("front_drive", [False, True])
def test_speeds_are_integrated_over_the_period(block: Callable[..., Any], rate: int, front_drive: bool) -> None:
    odo = odometry(block, rate=rate, use_speeds=True, front_drive=front_drive, traction_track=TRACK)
    steering = 0.4
    k = np.tan(steering) / BASE
    v = (13.0 * L + 14.0 * R) / shares(k, front_drive)
    first = feed(odo, 13.0, 14.0, steering)
    assert first["position"].tolist() == [0.0, 0.0, 0.0] and first["linear"][0] == pytest.approx(v)
    out = [feed(odo, 13.0, 14.0, steering) for _ in range(2 * rate)][-1]
    path = integrate.solve_ivp(
        lambda t, s: [v * np.cos(s[2]), v * np.sin(s[2]), v * k], (0.0, 2.0), [0.0, 0.0, 0.0], rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose([*out["position"][:2], out["heading"]], path.y[:, -1], atol=1e-8)
    assert out["linear"][0] == pytest.approx(v) and out["angular"][2] == pytest.approx(v * k)


@pytest.mark.parametrize("front_drive", [False, True])
def test_moving_steering_is_integrated_with_second_order(block: Callable[..., Any], front_drive: bool) -> None:
    """Angles of wheels that roll with a sinusoidal steering, from solve_ivp; five times the rate, 25 times the accuracy."""
    size: dict[str, Any] = {"steering_track": KINGPINS, "traction_track": TRACK, "front_drive": front_drive}

    def steering(t: float) -> float:
        return float(0.5 * np.sin(3.0 * t))

    def motion(t: float, s: Any) -> list[float]:
        k = np.tan(steering(t)) / BASE
        each = [1.0 - k * TRACK / 2, 1.0 + k * TRACK / 2]
        if front_drive:
            each = [np.hypot(e, k * BASE) for e in each]
        v = 4.0 + np.cos(t)
        return [v * np.cos(s[2]), v * np.sin(s[2]), v * k, v * each[0] / L, v * each[1] / R]

    path = integrate.solve_ivp(motion, (0.0, 2.0), [0.0] * 5, rtol=1e-10, atol=1e-10, dense_output=True).sol
    errors = []
    for rate in (100, 500):
        odo = odometry(block, rate=rate, **size)
        for t in np.arange(2 * rate + 1) / rate:
            cot = (
                BASE / np.tan(steering(t)) if t else np.inf
            )  # of the left: the distance of its centre from the kingpin
            front = [np.arctan(BASE / (cot - KINGPINS / 2)), np.arctan(BASE / (cot + KINGPINS / 2))]
            out = feed(odo, *path(t)[3:], *front)
        errors.append(np.linalg.norm([*out["position"][:2], out["heading"]] - path(2.0)[:3]))
    assert errors[0] < 2e-3 and errors[0] / errors[1] == pytest.approx(25.0, rel=0.2)


@pytest.mark.parametrize("front_drive", [False, True])
@pytest.mark.parametrize("scale", [0.02, 3.0])
def test_covariances_are_those_of_numerical_derivatives(
    block: Callable[..., Any], scale: float, front_drive: bool
) -> None:
    slip, bends, deviation, play = 0.02, 0.003, 0.05, 0.01
    noise: dict[str, Any] = {
        "slip": slip,
        "steering_slip": bends,
        "speed_deviation": deviation,
        "steering_deviation": play,
    }
    odo = odometry(block, front_drive=front_drive, traction_track=TRACK, planar_variance=1e-4, **noise)
    feed(odo, 0.0, 0.0, 0.1)
    rng = np.random.default_rng(7)
    angles, last, pose, p = np.zeros(2), 0.1, np.zeros(3), np.zeros((3, 3))
    radii = np.array([L, R])
    for _ in range(12):
        turn, steering = rng.normal(size=2) * scale, rng.uniform(-0.6, 0.6)
        angles += turn
        k = (np.tan(last) + np.tan(steering)) / 2 / BASE

        def after(s: Any, u: Any, k: float = k) -> np.ndarray[Any, Any]:
            way = (u[0] + u[1]) / shares(k, front_drive)
            return pose_after(s, way, k * way + u[2])

        noises = np.array([*(radii * turn), 0.0])
        way = (noises[0] + noises[1]) / shares(k, front_drive)
        f = approx_fprime(pose, lambda s, u=noises: after(s, u), 1e-7)
        g = approx_fprime(noises, lambda u, s=pose: after(s, u), 1e-7)
        q = np.diag([slip * abs(noises[0]), slip * abs(noises[1]), bends * abs(way)])
        p, pose = f @ p @ f.T + g @ q @ g.T, after(pose, noises)
        out = feed(odo, *angles, steering)
        np.testing.assert_allclose(out["covariance"], p, rtol=1e-4, atol=1e-6 * p.max())
        assert np.linalg.eigvalsh(out["covariance"]).min() > -1e-12 and (out["covariance"] == out["covariance"].T).all()
        whole = np.diag([0, 0, 1e-4, 1e-4, 1e-4, 0.0])
        whole[np.ix_([0, 1, 5], [0, 1, 5])] = out["covariance"]
        np.testing.assert_array_equal(out["pose_covariance"], whole)

        def twist(u: Any, rates: Any = turn / H, k: float = k, steering: float = steering) -> np.ndarray[Any, Any]:
            """Of deviations of the wheels' speeds, of the steering, and of the yaw rate."""
            bend = k + (np.tan(steering + u[2]) - np.tan(steering)) / BASE
            v = (radii @ rates + u[0] + u[1]) / shares(bend, front_drive)
            return np.array([v, v * bend + u[3]])

        t = approx_fprime(np.zeros(4), twist, 1e-7)
        speeds = [*(np.diag(q)[:2] / H**2 + (radii * deviation) ** 2), play**2, q[2, 2] / H**2]
        wanted = np.diag([0, 1e-4, 1e-4, 1e-4, 1e-4, 0])
        wanted[np.ix_([0, 5], [0, 5])] = t @ np.diag(speeds) @ t.T
        np.testing.assert_allclose(out["twist_covariance"], wanted, rtol=1e-4, atol=1e-6 * wanted.max())
        last = steering


def test_deviation_of_the_steering_with_kingpins(block: Callable[..., Any]) -> None:
    """Both angles deviate at once; the curvature is that of the mean of the two centres' inverse distances."""
    play = 0.01
    odo = odometry(block, use_speeds=True, steering_track=KINGPINS, steering_deviation=play, planar_variance=0.0)
    angles = np.array([0.5, 0.4])

    def yaw_rate(d: Any) -> float:
        """Where the wheels' axes meet the rear axle, at both sides."""
        places = np.array([0.5, -0.5]) * KINGPINS + BASE / np.tan(angles + d[0])
        return float(3.0 * L * np.mean(1.0 / places))

    odo.set(right_radius=L)
    out = feed(odo, 3.0, 3.0, *angles)
    assert out["angular"][2] == pytest.approx(yaw_rate([0.0]))
    slope = approx_fprime(np.zeros(1), yaw_rate, 1e-7)[0]
    assert out["twist_covariance"][5, 5] == pytest.approx((slope * play) ** 2, rel=1e-5)
    assert out["twist_covariance"][0, 0] == out["twist_covariance"][0, 5] == 0.0


@pytest.mark.parametrize("half", [0.0, 1e-5, -0.0099, 0.0099, 0.0101, 1.5])
def test_one_long_step_on_both_sides_of_the_series(block: Callable[..., Any], half: float) -> None:
    odo = odometry(block, slip=0.02, steering_slip=0.01)
    steering = np.arctan(BASE * half / 2.5)
    feed(odo, 0.0, 0.0, steering)
    out = feed(odo, 5.0 / L, 5.0 / R, steering)
    g = approx_fprime(np.array([5.0, 0.0]), lambda u: pose_after(np.zeros(3), u[0], u[0] * half / 2.5 + u[1]), 1e-7)
    p = g @ np.diag([0.02 * 10.0 / 4.0, 0.01 * 5.0]) @ g.T
    np.testing.assert_allclose(out["covariance"], p, rtol=1e-4, atol=2e-6 * p.max())
    np.testing.assert_allclose(out["position"][:2], pose_after(np.zeros(3), 5.0, 2 * half)[:2], rtol=1e-12, atol=1e-12)


def test_straight_ahead_the_variance_has_a_closed_form(block: Callable[..., Any]) -> None:
    """After a way s: x: slip s / 2, heading: steering_slip s, y: its integral with the lever squared, of s^3 / 3."""
    slip, bends = 0.01, 0.002
    odo = odometry(block, slip=slip, steering_slip=bends)
    s, n = 20.0, 400
    out = [feed(odo, s * i / n / L, s * i / n / R, 0.0) for i in range(n + 1)][-1]
    np.testing.assert_allclose(np.diag(out["covariance"]), [slip * s / 2, bends * s**3 / 3, bends * s], rtol=1e-5)


def test_angles_that_begin_anew(block: Callable[..., Any]) -> None:
    odo, plain = odometry(block, angle_range=2 * np.pi), odometry(block)
    for i in range(80):
        a = 0.3 * i
        wrapped = feed(odo, np.angle(np.exp(1j * a)), np.angle(np.exp(0.9j * a)), 0.2)
        np.testing.assert_allclose(wrapped["position"], feed(plain, a, 0.9 * a, 0.2)["position"], atol=1e-12)


@pytest.mark.parametrize("use_speeds", [False, True])
def test_odom_does_not_jump_over_a_break(block: Callable[..., Any], use_speeds: bool) -> None:
    odo = odometry(block, use_speeds=use_speeds, slip=0.01, speed_deviation=0.1)
    before = [feed(odo, 0.1 * i, 0.1 * i, 0.1) for i in range(20)][-1]
    odo.rest()
    after = feed(odo, 77.0, -5.0, -0.6)
    for name in ("position", "attitude", "covariance", "pose_covariance"):
        np.testing.assert_array_equal(after[name], before[name])
    # the curvature of before the break does not count
    assert after["twist_covariance"][0, 5] / after["twist_covariance"][0, 0] == pytest.approx(np.tan(-0.6) / BASE)
    if not use_speeds:
        assert after["linear"].tolist() == [0.0, 0.0, 0.0]
        moved = feed(odo, 77.1, -4.9, -0.6)
        assert 0.0 < np.hypot(*(moved["position"] - before["position"])[:2]) < 0.05
        assert moved["angular"][2] / moved["linear"][0] == pytest.approx(np.tan(-0.6) / BASE)
        zero = feed(odo, 77.1, -4.9, 0.0, reset=True)
        assert zero["position"].tolist() == [0.0] * 3 and not zero["covariance"].any() and zero["heading"] == 0.0
        assert zero["attitude"].tolist() == [1.0, 0.0, 0.0, 0.0]


def test_a_reset_counts_beside_a_lost_sample(block: Callable[..., Any]) -> None:
    odo = odometry(block, slip=0.01, planar_variance=0.5)
    for i in range(5):
        feed(odo, i, i, 0.1)
    out = feed(odo, float("nan"), 5.0, 0.1, reset=True)
    assert out["health"] == "degraded" and not out["position"].any() and not out["covariance"].any()
    np.testing.assert_array_equal(out["pose_covariance"], np.diag([0.0, 0.0, 0.5, 0.5, 0.5, 0.0]))
    out = feed(odo, 6.0, 6.0, 0.1)
    assert out["position"][0] == pytest.approx(2 * (L + R) / 2, rel=0.01) and out["health"] == "nominal"


@pytest.mark.parametrize("use_speeds", [False, True])
@pytest.mark.parametrize(
    ("lost", "value"), [(0, float("inf")), (1, float("nan")), (2, float("nan")), (2, float("inf"))]
)
def test_what_is_not_finite_is_passed_over_and_made_up_for(
    block: Callable[..., Any], use_speeds: bool, lost: int, value: float
) -> None:
    """Two lost samples: the pose is that without the loss, the twist covers the gap."""
    odo, whole = (odometry(block, use_speeds=use_speeds, slip=0.01) for _ in range(2))

    def at(i: int) -> list[float]:
        return [3.0, 3.5, 0.3] if use_speeds else [0.03 * i, 0.035 * i, 0.3]

    for i in range(5):
        before = feed(odo, *at(i))
        feed(whole, *at(i))
    for i in (5, 6):
        sample = at(i)
        sample[lost] = value
        bad = feed(odo, *sample)
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
    feed(odo, 0.0, 0.0, 0.0)
    odo.rest()
    assert feed(odo, float("nan"), 5.0, 0.0)["health"] == "degraded"
    assert feed(odo, 5.0, 5.0, 0.0)["position"].tolist() == [0.0, 0.0, 0.0]
    assert feed(odo, 5.1, 5.1, 0.0)["position"][0] > 0.0


@pytest.mark.parametrize("use_speeds", [False, True])
@pytest.mark.parametrize("front_drive", [False, True])
def test_nothing_poisons_it(block: Callable[..., Any], use_speeds: bool, front_drive: bool) -> None:
    noise: dict[str, Any] = dict.fromkeys(["slip", "steering_slip", "speed_deviation", "steering_deviation"], 0.01)
    size: dict[str, Any] = {"steering_track": KINGPINS, "traction_track": TRACK, "front_drive": front_drive}
    odo = odometry(block, use_speeds=use_speeds, angle_range=6.0, **noise, **size)
    rng = np.random.default_rng(8)
    for _ in range(300):
        out = feed(odo, *rng.choice(ODD, 4))
        assert all(np.isfinite(out[n]).all() for n in odo.outputs)
    assert odo.native.get_value("block.counters.faults") == 0
    last = [feed(odo, 1.0, 1.0, 0.1, reset=True) for _ in range(2)][-1]
    assert last["health"] == "nominal" and all(np.isfinite(last[n]).all() for n in odo.outputs)


def test_parameters_change_in_flight(block: Callable[..., Any]) -> None:
    odo = odometry(block)
    feed(odo, 0.0, 0.0, 0.3)
    odo.set(left_radius=0.2, right_radius=0.2, wheelbase=1.0)
    out = feed(odo, 1.0, 1.0, 0.3)
    bend = (np.tan(0.3) / BASE + np.tan(0.3)) / 2
    assert out["heading"] == pytest.approx(0.2 * bend)
