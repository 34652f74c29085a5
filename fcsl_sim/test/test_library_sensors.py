# SPDX-License-Identifier: Apache-2.0
"""The sensors of the model library: truth without errors, the statistics of each error, faults, dropouts and delays."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import ArrayLike, NDArray

from fcsl_sim.model_instance import ModelInstance
from fcsl_sim.model_list import find_model
from simclient import SimTwin

MODELS = Path(__file__).resolve().parents[1] / "models"
Values = dict[str, Any]

SILENT, STUCK, DEAD = 1, 2, 3
STEP_NS, STEP_S = 10_000_000, 0.01
#: Deviations that a statistic of a seeded run may be off.
DEVIATIONS = 5.0

#: Parameters that may not be zero.
NEEDED: dict[str, Values] = {
    "imu": {},
    "gnss": {},
    "magnetometer": {"soft_iron": [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]},
    "barometer": {"reference_pressure": 101325.0},
    "range_finder": {"beam_body": [0.0, 0.0, 1.0], "maximum_range": 1e3},
    "wheel_odometry": {"track_width": 0.5},
    "airspeed_sensor": {},
}


@cache
def library(model: str) -> Path:
    return find_model(str(MODELS / f"{model}.c")).table().library


@cache
def zero_parameters(model: str) -> Values:
    fields = ModelInstance(library(model), model).fields.values()
    return {
        f.path.removeprefix("parameters."): np.zeros(f.shape, int if f.type == "u32" else float).tolist()
        for f in fields
        if f.role == "parameter"
    }


def parameters(model: str, **changes: Any) -> Values:
    """Those of a sensor without errors, with these changes."""
    zeros = zero_parameters(model)
    changed = zeros | NEEDED[model] | changes
    assert changed.keys() == zeros.keys()
    return {name: np.reshape(value, np.shape(zeros[name])).tolist() for name, value in changed.items()}


def sensor(model: str, noise: Callable[[int], float] = lambda stream: 0.0, **changes: Any) -> ModelInstance:
    """An instance after `init`."""
    instance = ModelInstance(library(model), model, noise)
    for name, value in parameters(model, **changes).items():
        set_field(instance, f"parameters.{name}", value)
    instance.init()
    return instance


def set_field(instance: ModelInstance, path: str, value: Any) -> None:
    instance.set(path, np.ravel(value).tolist() if np.ndim(value) else value)


def sample(instance: ModelInstance, time_ns: int = 0, **inputs: Any) -> Values:
    """The outputs after an update with these inputs."""
    for name, value in inputs.items():
        set_field(instance, f"inputs.{name}", value)
    instance.update(time_ns)
    return outputs(instance)


def outputs(instance: ModelInstance) -> Values:
    return {p.removeprefix("outputs."): instance.get(p) for p, f in instance.fields.items() if f.role == "output"}


def quaternion(turn: ArrayLike) -> list[float]:
    """w, x, y, z of a turn about an axis, by an angle (rad) that is the length of `turn`."""
    turn = np.asarray(turn)
    angle = float(np.linalg.norm(turn))
    return [math.cos(angle / 2.0), *(math.sin(angle / 2.0) / angle * turn)] if angle else [1.0, 0.0, 0.0, 0.0]


def rotated(turn: ArrayLike, vector: ArrayLike) -> NDArray[np.float64]:
    """The vector after this turn, by the formula of Rodrigues."""
    turn, vector = np.asarray(turn), np.asarray(vector)
    angle = float(np.linalg.norm(turn))
    axis = turn / angle
    along = axis * float(axis @ vector)
    return math.cos(angle) * (vector - along) + math.sin(angle) * np.cross(axis, vector) + along


# ---- what all sensors have in common ---------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """Inputs of update k, integrals that end there, and what a sensor without errors makes of them."""

    inputs: Callable[[int], Values]
    expected: Callable[[int], Values]
    integrals: Callable[[int], list[float]] | None = None


def speed(k: int) -> float:
    return 1.0 + 0.125 * k if k > 0 else 0.0


CASES = {
    "imu": Case(
        lambda k: {"specific_force_body": [k, -2.5 * k, 9.8 + k], "rate_body": [0.1 * k, 0.2, -0.3 * k]},
        lambda k: {
            "accelerometer_body": [k, -2.5 * k, 9.8 + k],
            "gyroscope_body": [0.1 * k, 0.2, -0.3 * k],
            "delta_velocity_body": [0.01 * k, 0.02 * k, 0.03 * k],
            "delta_angle_body": [0.04 * k, 0.05 * k, 0.06 * k],
        },
        lambda k: [0.01 * k, 0.02 * k, 0.03 * k, 0.04 * k, 0.05 * k, 0.06 * k],
    ),
    "gnss": Case(
        lambda k: {
            "latitude": 0.8 + 1e-3 * k,
            "longitude": -1.0 - 1e-3 * k,
            "height": 10.0 * k,
            "velocity_ned": [k, 2, 3],
        },
        lambda k: {
            "latitude": 0.8 + 1e-3 * k,
            "longitude": -1.0 - 1e-3 * k,
            "height": 10.0 * k,
            "velocity_ned": [k, 2, 3],
        },
    ),
    "magnetometer": Case(
        lambda k: {"magnetic_field_ned": [1e-5 * k, 2e-5, 3e-5], "attitude_body_to_ned": [1, 0, 0, 0]},
        lambda k: {"magnetic_field_body": [1e-5 * k, 2e-5, 3e-5]},
    ),
    "barometer": Case(lambda k: {"pressure": 1e5 - k}, lambda k: {"pressure": 1e5 - k}),
    "range_finder": Case(
        lambda k: {"height_above_ground": 3.0 + k, "attitude_body_to_ned": [1, 0, 0, 0]}, lambda k: {"range": 3.0 + k}
    ),
    "wheel_odometry": Case(
        lambda k: {},
        lambda k: {"forward_speed": speed(k), "yaw_rate": 0.0, "x": 0.01 * sum(map(speed, range(k + 1))), "y": 0.0},
        lambda k: [0.01 * speed(k), 0.01 * speed(k)],
    ),
    "airspeed_sensor": Case(
        lambda k: {"dynamic_pressure": 50.0 * k**2, "density": 1.0},
        lambda k: {"differential_pressure": 50.0 * k**2, "true_airspeed": 10.0 * k},
    ),
}
EVERY_SENSOR = pytest.mark.parametrize("model", list(CASES))


def drive(instance: ModelInstance, case: Case, k: int) -> Values:
    if case.integrals:
        instance.continuous = case.integrals(k)
    return sample(instance, k * STEP_NS, **case.inputs(k))


@EVERY_SENSOR
@pytest.mark.parametrize("delay", [0, 1, 3])
def test_without_errors_it_shows_the_truth_of_its_delay(model: str, delay: int) -> None:
    case, instance = CASES[model], sensor(model, delay_samples=delay)
    for k in range(10):
        shown = drive(instance, case, k)
        assert shown["sampled"] == instance.sampled == (k >= delay)
        if k >= delay:
            for name, expected in case.expected(k - delay).items():
                exact = case.integrals is None or name.endswith(("accelerometer_body", "gyroscope_body"))
                assert shown[name] == (expected if exact else pytest.approx(expected, rel=1e-13, abs=0.0)), name


@EVERY_SENSOR
def test_faults_and_their_end(model: str) -> None:
    case, instance, healthy = CASES[model], sensor(model), sensor(model)
    before: Values = {}
    for k in range(9):
        fault = {3: SILENT, 4: SILENT, 5: STUCK, 6: STUCK}.get(k, 0)
        instance.set("parameters.fault", fault)
        truth, shown = drive(healthy, case, k), drive(instance, case, k)
        if fault == 0:
            assert shown == truth
        else:
            assert shown == before | {"sampled": fault == STUCK}
        before = shown


@EVERY_SENSOR
def test_stuck_before_its_first_sample_it_has_none(model: str) -> None:
    assert drive(sensor(model, fault=STUCK), CASES[model], 0)["sampled"] is False


@pytest.mark.parametrize(
    ("model", "changes", "expected"),
    [
        (
            "imu",
            {"accelerometer_bias": [0.5, 0.0, 0.0], "gyroscope_bias": [0.0, 0.25, 0.0]},
            {
                "accelerometer_body": [0.5, 0.0, 0.0],
                "gyroscope_body": [0.0, 0.25, 0.0],
                "delta_velocity_body": [0.005, 0.0, 0.0],
                "delta_angle_body": [0.0, 0.0025, 0.0],
            },
        ),
        (
            "gnss",
            {},
            {"latitude": 0.0, "longitude": 0.0, "height": 0.0, "velocity_ned": [0.0] * 3, "position_ned": [0.0] * 3},
        ),
        ("magnetometer", {"hard_iron_body": [1e-6, 0.0, 0.0]}, {"magnetic_field_body": [1e-6, 0.0, 0.0]}),
        ("barometer", {"bias": -5.0}, {"pressure": -5.0, "height": 288.15 / 0.0065}),
        ("range_finder", {"bias": 0.5}, {"range": 0.5}),
        ("airspeed_sensor", {"bias": -3.0}, {"differential_pressure": -3.0, "indicated_airspeed": 0.0}),
    ],
)
def test_dead_it_measures_zero_with_its_errors(model: str, changes: Values, expected: Values) -> None:
    instance = sensor(model, fault=DEAD, **changes)
    drive(instance, CASES[model], 1)
    shown = drive(instance, CASES[model], 2)
    assert shown["sampled"] is True
    assert {name: shown[name] for name in expected} == expected


def test_dead_wheels_count_nothing() -> None:
    case, instance = CASES["wheel_odometry"], sensor("wheel_odometry")
    for k in range(3):
        drive(instance, case, k)
    instance.set("parameters.fault", DEAD)
    x: Any = instance.get("outputs.x")
    shown = drive(instance, case, 3)
    assert (shown["forward_speed"], shown["x"], shown["sampled"]) == (0.0, x, True)
    instance.set("parameters.fault", 0)
    assert drive(instance, case, 4)["x"] == pytest.approx(x + 0.01 * speed(4), rel=1e-14)


def test_a_delay_that_an_event_sets_beyond_its_limit_is_the_limit() -> None:
    case, instance = CASES["barometer"], sensor("barometer")
    instance.set("parameters.delay_samples", 1000)
    shown = [drive(instance, case, k) for k in range(66)]
    assert [s["sampled"] for s in shown] == [False] * 64 + [True] * 2 and shown[65]["pressure"] == 1e5 - 1


NOT_NEGATIVE = {
    "imu": [
        f"{triad}_{name}"
        for triad in ("accelerometer", "gyroscope")
        for name in ("noise_density", "bias_walk", "drift_sigma", "drift_time_constant", "saturation", "quantum")
    ],
    "gnss": [
        "horizontal_sigma",
        "vertical_sigma",
        "horizontal_drift_sigma",
        "vertical_drift_sigma",
        "drift_time_constant",
        "horizontal_velocity_sigma",
        "vertical_velocity_sigma",
    ],
    "magnetometer": ["sigma", "saturation", "quantum"],
    "barometer": ["drift_sigma", "drift_time_constant", "sigma", "quantum"],
    "range_finder": ["minimum_range", "sigma", "quantum"],
    "wheel_odometry": ["slip", "tick_distance"],
    "airspeed_sensor": ["drift_sigma", "drift_time_constant", "sigma", "saturation", "quantum"],
}


@EVERY_SENSOR
def test_parameters_that_are_refused(model: str) -> None:
    instance = sensor(model)
    wrong: list[tuple[str, Any, str]] = [
        *((name, value, "must not be negative") for name in NOT_NEGATIVE[model] for value in (-1e-9, math.nan)),
        ("dropout_probability", -0.1, "must be from 0 to 1"),
        ("dropout_probability", 1.1, "must be from 0 to 1"),
        ("dropout_probability", math.nan, "must be from 0 to 1"),
        ("delay_samples", 65, "must be at most 64"),
        ("fault", 4, "must be 0 "),
    ]
    more: dict[str, list[tuple[str, Any, str]]] = {
        "gnss": [("reference_latitude", 48.0, "must be between the poles, in rad")],
        "barometer": [("reference_pressure", 0.0, "must be positive")],
        "range_finder": [
            ("beam_body", [0.0] * 3, "must not be zero"),
            ("maximum_range", 0.0, "must exceed parameters.minimum_range"),
        ],
        "wheel_odometry": [("track_width", 0.0, "must be positive")],
    }
    for name, value, reason in wrong + more.get(model, []):
        good = instance.get(f"parameters.{name}")
        set_field(instance, f"parameters.{name}", value)
        with pytest.raises(ValueError, match=f"parameters.{name} {reason}"):
            instance.init()
        set_field(instance, f"parameters.{name}", good)
    instance.init()


# ---- errors without chance -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("truth", "expected"),
    [(100.0, 104.0), (-100.0, -94.0), (301.0, 302.0), (303.0, 304.0), (5000.0, 502.0), (-5000.0, -502.0)],
)
def test_scale_error_bias_saturation_and_quantum_in_this_order(truth: float, expected: float) -> None:
    """0.99 truth + 5 Pa: 104, -94, 302.99, 304.97, and 501 or -501, which the steps of 2 Pa make 502 and -502."""
    pitot = sensor("airspeed_sensor", scale_error=-0.01, bias=5.0, saturation=501.0, quantum=2.0)
    shown = sample(pitot, dynamic_pressure=truth)["differential_pressure"]
    assert shown == expected


def test_the_drift_is_stationary_from_its_first_value() -> None:
    """With random numbers that are all 1: sigma, then sigma (a + sqrt(1 - a^2)), a = exp(-dt / tau)."""
    barometer = sensor("barometer", lambda stream: 1.0, drift_sigma=3.0, drift_time_constant=0.02)
    decay = math.exp(-0.5)
    assert sample(barometer, 0, pressure=0.0)["pressure"] == 3.0
    expected = 3.0 * (decay + math.sqrt(1.0 - decay * decay))
    assert sample(barometer, STEP_NS)["pressure"] == pytest.approx(expected, rel=1e-15)


def test_errors_of_an_imu() -> None:
    scale, turn, bias = np.array([0.01, -0.02, 0.03]), np.array([0.001, 0.002, -0.003]), np.array([0.1, 0.2, 0.3])
    force, rate = np.array([1.0, -2.0, 9.0]), np.array([0.3, 0.2, 0.1])
    errors: Values = {
        f"{triad}_{name}": value
        for triad in ("accelerometer", "gyroscope")
        for name, value in {"scale_error": scale, "misalignment": turn, "bias": bias}.items()
    }
    imu = sensor("imu", **errors)
    matrix = np.diag(1.0 + scale) - np.cross(turn, np.eye(3)).T
    sample(imu, 0)
    imu.continuous = [*(force * STEP_S), *(rate * STEP_S)]
    shown = sample(imu, STEP_NS, specific_force_body=force, rate_body=rate)
    # The axes of the sensor are turned by `turn`: a vector is turned back in them.
    assert rotated(-turn, force) == pytest.approx((matrix - np.diag(scale)) @ force, abs=1e-4)
    for name, truth in {"accelerometer_body": force, "gyroscope_body": rate}.items():
        assert shown[name] == pytest.approx(matrix @ truth + bias, rel=1e-14)
    for name, truth in {"delta_velocity_body": force, "delta_angle_body": rate}.items():
        assert shown[name] == pytest.approx((matrix @ truth + bias) * STEP_S, rel=1e-14)


def test_limits_of_an_imu_are_those_of_its_increments_too() -> None:
    limits: Values = {"accelerometer_saturation": 50.0, "accelerometer_quantum": 0.5}
    imu = sensor("imu", gyroscope_saturation=5.0, gyroscope_quantum=0.25, **limits)
    sample(imu, 0)
    imu.continuous = [0.7, -0.7, 0.0474, 0.07, -0.07, 0.0101]
    shown = sample(imu, STEP_NS, specific_force_body=[60.0, -60.0, 4.74], rate_body=[6.0, -6.0, 1.1])
    assert shown["accelerometer_body"] == [50.0, -50.0, 4.5] and shown["gyroscope_body"] == [5.0, -5.0, 1.0]
    assert shown["delta_velocity_body"] == pytest.approx([0.5, -0.5, 0.045], rel=1e-14)
    assert shown["delta_angle_body"] == pytest.approx([0.05, -0.05, 0.01], rel=1e-14)


def ecef(latitude: float, longitude: float, height: float) -> NDArray[np.float64]:
    """By the two axes of the ellipse, unlike in the model."""
    a, b = 6378137.0, 6356752.314245179
    normal = a * a / math.hypot(a * math.cos(latitude), b * math.sin(latitude))
    radius = (normal + height) * math.cos(latitude)
    z = (b * b / (a * a) * normal + height) * math.sin(latitude)
    return np.array([radius * math.cos(longitude), radius * math.sin(longitude), z])


@pytest.mark.parametrize("latitude", [-1.5, -0.6, 0.0, 0.8, 1.4])
@pytest.mark.parametrize("height", [0.0, 10_000.0])
def test_metres_of_a_gnss_receiver_are_metres_on_the_ellipsoid(latitude: float, height: float) -> None:
    """An error of 100 m to the north, or east, is that distance in Earth-fixed axes, in that direction."""
    place: Values = {"reference_latitude": latitude, "reference_longitude": 0.5, "reference_height": height}
    north = np.array([-math.sin(latitude) * math.cos(0.5), -math.sin(latitude) * math.sin(0.5), math.cos(latitude)])
    east = np.array([-math.sin(0.5), math.cos(0.5), 0.0])
    for bias, direction in {(100.0, 0.0, 0.0): north, (0.0, 100.0, 0.0): east}.items():
        gnss = sensor("gnss", bias_ned=bias, **place)
        shown = sample(gnss, latitude=latitude, longitude=0.5, height=height)
        moved = ecef(shown["latitude"], shown["longitude"], shown["height"]) - ecef(latitude, 0.5, height)
        assert moved == pytest.approx(100.0 * direction, abs=0.03)  # the curvature of the parallel; 1 mm on a meridian
        assert float(moved @ direction) == pytest.approx(100.0, abs=5e-5)
        assert shown["position_ned"] == pytest.approx(bias, abs=1e-7)
    shown = sample(sensor("gnss", bias_ned=[0.0, 0.0, 7.0], **place), latitude=latitude, longitude=0.5, height=height)
    assert shown["height"] == pytest.approx(height - 7.0) and shown["position_ned"] == pytest.approx([0.0, 0.0, 7.0])


def test_a_gnss_receiver_at_the_date_line() -> None:
    place: Values = {"reference_longitude": math.pi - 1e-6, "reference_latitude": 0.3}
    shown = sample(sensor("gnss", bias_ned=[0.0, 100.0, 0.0], **place), latitude=0.3, longitude=math.pi - 1e-6)
    assert -math.pi < shown["longitude"] < -3.14 and shown["position_ned"] == pytest.approx([0.0, 100.0, 0.0], abs=1e-6)


def test_a_magnetometer_turns_and_distorts_the_field() -> None:
    field_ned, iron = np.array([2.1e-5, 1.2e-6, 4.3e-5]), np.array([3e-6, -2e-6, 1e-6])
    soft = np.array([[1.05, 0.02, -0.01], [0.03, 0.97, 0.015], [-0.02, 0.01, 1.02]])
    turn = np.array([0.7, -0.4, 2.0])
    inputs: Values = {"magnetic_field_ned": field_ned, "attitude_body_to_ned": quaternion(turn)}
    body = rotated(-turn, field_ned)
    shown = sample(sensor("magnetometer"), **inputs)["magnetic_field_body"]
    assert shown == pytest.approx(body, rel=1e-14)
    shown = sample(sensor("magnetometer", soft_iron=soft, hard_iron_body=iron), **inputs)["magnetic_field_body"]
    assert shown == pytest.approx(soft @ body + iron, rel=1e-14)
    shown = sample(sensor("magnetometer", saturation=2e-5, quantum=1e-6), **inputs)["magnetic_field_body"]
    assert shown == pytest.approx(1e-6 * np.round(np.clip(body, -2e-5, 2e-5) / 1e-6), rel=1e-14)
    assert np.abs(body).max() > 2e-5


@pytest.mark.parametrize(
    ("height", "pressure"),
    [
        (-1000.0, 113929.0),
        (0.0, 101325.0),
        (1000.0, 89874.6),
        (2000.0, 79495.2),
        (5000.0, 54019.9),
        (10000.0, 26436.3),
        (11000.0, 22632.1),
    ],
)
def test_pressure_altitude_is_that_of_the_standard_atmosphere(height: float, pressure: float) -> None:
    """U.S. Standard Atmosphere, 1976, table I, by geopotential height."""
    barometer = sensor("barometer")
    assert sample(barometer, pressure=pressure)["height"] == pytest.approx(height, abs=0.05)


def test_pressure_altitude_is_zero_at_the_reference() -> None:
    barometer = sensor("barometer", reference_pressure=98000.0, quantum=10.0)
    shown = sample(barometer, pressure=98003.0)
    assert (shown["pressure"], shown["height"]) == (98000.0, 0.0)


@pytest.mark.parametrize("turn", [(0.5, 0.0, 0.0), (0.0, -0.7, 0.0), (0.3, 0.9, -0.5), (1.0, 0.2, 2.5)])
def test_a_range_finder_measures_along_its_beam(turn: tuple[float, ...]) -> None:
    attitude = quaternion(turn)
    straight = sample(sensor("range_finder"), height_above_ground=12.0, attitude_body_to_ned=attitude)
    assert straight["range"] == pytest.approx(12.0 / rotated(turn, [0.0, 0.0, 1.0])[2], rel=1e-14)
    # A beam that is turned the other way looks down again.
    back = rotated(np.negative(turn), [0.0, 0.0, 2.5])
    turned = sample(sensor("range_finder", beam_body=back), height_above_ground=12.0, attitude_body_to_ned=attitude)
    assert turned["range"] == pytest.approx(12.0, rel=1e-14)


def test_a_range_finder_has_a_sample_only_of_ground_within_its_range() -> None:
    finder = sensor("range_finder", minimum_range=0.5, maximum_range=20.0, scale_error=0.25)
    level, over = quaternion([0.0] * 3), quaternion([2.0, 0.0, 0.0])

    def is_seen(height: float, attitude: Any = level) -> bool:
        return bool(sample(finder, height_above_ground=height, attitude_body_to_ned=attitude)["sampled"])

    assert [is_seen(h) for h in (0.39, 0.4, 16.0, 16.01, -0.5)] == [False, True, True, False, False]
    assert finder.get("outputs.range") == 20.0  # the last sample
    assert not is_seen(5.0, over) and is_seen(5.0)
    assert sample(finder, height_above_ground=6.0)["range"] == 7.5
    finder.set("parameters.bias", 5.0)  # an error makes no ground where there is none
    assert [is_seen(1.0, over), is_seen(0.0, over), is_seen(-1.0)] == [False, False, False] and is_seen(0.0)


def test_a_sample_that_was_none_is_none_after_the_delay() -> None:
    finder = sensor("range_finder", maximum_range=10.0, delay_samples=1)
    heights = [1.0, 2.0, 30.0, 4.0, 5.0]
    shown = [sample(finder, height_above_ground=h, attitude_body_to_ned=[1.0, 0.0, 0.0, 0.0]) for h in heights]
    assert [s["sampled"] for s in shown] == [False, True, True, False, True]
    assert [s["range"] for s in shown[1:]] == [1.0, 2.0, 2.0, 4.0]


def test_airspeeds() -> None:
    shown = sample(sensor("airspeed_sensor"), dynamic_pressure=0.5 * 0.9 * 40.0**2, density=0.9)
    assert shown["true_airspeed"] == pytest.approx(40.0, rel=1e-15)
    assert shown["indicated_airspeed"] == pytest.approx(40.0 * math.sqrt(0.9 / 1.225), rel=1e-15)
    shown = sample(sensor("airspeed_sensor"), dynamic_pressure=-20.0)
    assert (shown["differential_pressure"], shown["indicated_airspeed"], shown["true_airspeed"]) == (-20.0, 0.0, 0.0)


def test_ticks_of_a_wheel_are_whole_and_none_is_lost() -> None:
    wheels = sensor("wheel_odometry", tick_distance=0.03)
    for k in range(101):
        wheels.continuous = [0.01, 0.01]
        shown = sample(wheels, k * STEP_NS)
        assert shown["x"] == pytest.approx(0.03 * math.floor(k / 3 + 1e-9), rel=1e-12)
        assert shown["forward_speed"] == pytest.approx(3.0 if k and k % 3 == 0 else 0.0, rel=1e-12)


def test_unequal_wheels_drive_a_circle() -> None:
    """Wheels 1 % too long and too short: yaw 0.02 s / b to the right, x = r sin(yaw), y = r (1 - cos(yaw))."""
    wheels = sensor("wheel_odometry", scale_error_left=0.01, scale_error_right=-0.01)
    sample(wheels)
    for k in range(1, 101):
        wheels.continuous = [0.2, 0.2]
        shown = sample(wheels, k * STEP_NS)
    yaw, radius = 0.02 * 20.0 / 0.5, 0.5 / 0.02
    found = [shown[name] for name in ("x", "y", "yaw")]
    assert found == pytest.approx([radius * math.sin(yaw), radius * (1.0 - math.cos(yaw)), yaw], rel=1e-12)


# ---- within simulations ----------------------------------------------------------------------------------------

#: Turns about z at cos(w t), with a force at cos(w t) along x and constant others; drives forward at cos(w t).
SHAKER = """
#include "fcsl/fcsl_model.h"

typedef struct {
    struct { double frequency; } parameters;
    struct {
        double specific_force_body[3], rate_body[3], angular_acceleration_body[3], velocity_body[3];
    } outputs;
} shaker_t;

static void output(void *self, double t, const double *x)
{
    shaker_t *s = self;
    (void)x;
    const double w = s->parameters.frequency, c = cr_cos(w * t), d = cr_sin(w * t);
    s->outputs.specific_force_body[0] = c;
    s->outputs.specific_force_body[1] = 2.0;
    s->outputs.specific_force_body[2] = -9.75;
    s->outputs.rate_body[0] = 0.0;
    s->outputs.rate_body[1] = 0.0;
    s->outputs.rate_body[2] = c;
    s->outputs.angular_acceleration_body[0] = 0.0;
    s->outputs.angular_acceleration_body[1] = 0.0;
    s->outputs.angular_acceleration_body[2] = -w * d;
    s->outputs.velocity_body[0] = c;
    s->outputs.velocity_body[1] = 5.0;
    s->outputs.velocity_body[2] = 6.0;
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(shaker_t, FCSL_ROLE_PARAMETER, parameters.frequency, "rad/s", ""),
    FCSL_MODEL_VECTOR(shaker_t, FCSL_ROLE_OUTPUT, outputs.specific_force_body, "m/s^2", ""),
    FCSL_MODEL_VECTOR(shaker_t, FCSL_ROLE_OUTPUT, outputs.rate_body, "rad/s", ""),
    FCSL_MODEL_VECTOR(shaker_t, FCSL_ROLE_OUTPUT, outputs.angular_acceleration_body, "rad/s^2", ""),
    FCSL_MODEL_VECTOR(shaker_t, FCSL_ROLE_OUTPUT, outputs.velocity_body, "m/s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "shaker", .doc = "", .fields = fields,
    .field_count = sizeof fields / sizeof *fields, .size = sizeof(shaker_t), .align = _Alignof(shaker_t),
    .sampled_offset = FCSL_NO_OFFSET, .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
"""
RK4: Values = {"method": "rk4", "hz": 1000}


def instance_of(model: str, inputs: Values | None = None, **changes: Any) -> Values:
    return {"model": model, "parameters": parameters(model, **changes), "inputs": inputs or {}}


def open_twin(folder: Path, instances: Mapping[str, Values], rates: Mapping[str, int], **keys: Any) -> SimTwin:
    """A plant alone, of copies of the models."""
    names = {instance["model"] for instance in instances.values()}
    for name in (*(f"{name}.c" for name in names if name in NEEDED), "sensor_errors.h", "vectors.h"):
        shutil.copy(MODELS / name, folder)
    (folder / "shaker.c").write_text(SHAKER)
    simulation = {
        "tick_hz": 100,
        "seed": 1,
        "duration": 1000.0,
        "integrator": RK4,
        "models": {name: {"source": f"{name}.c"} for name in names},
        "instances": instances,
        "rates": rates,
    }
    path = folder / "sensors.sim.json"
    path.write_text(json.dumps(simulation | keys))
    return SimTwin.from_config(path)


@pytest.mark.parametrize("integrator", [RK4, {"method": "rk45", "rtol": 1e-12, "atol": 1e-14}], ids=["rk4", "rk45"])
def test_increments_are_integrals_and_the_lever_arm_counts(tmp_path: Path, integrator: Values) -> None:
    """Closed forms, with r = (0.5, -0.25, 2): the turn adds (-a y - w^2 x, a x - w^2 y, 0)."""
    frequency, rate, ticks = 7.0, 25, 200
    x, y = 0.5, -0.25
    instances = {
        "shaker": {"model": "shaker", "parameters": {"frequency": frequency}},
        "imu": instance_of("imu", position_body=[x, y, 2.0]),
        "wheels": instance_of("wheel_odometry"),
    }
    ports = [("imu", port) for port in ("specific_force_body", "rate_body", "angular_acceleration_body")]
    connections = [
        {"from": f"shaker.{port}", "to": f"{to}.{port}"} for to, port in (*ports, ("wheels", "velocity_body"))
    ]
    keys = {"connections": connections, "integrator": integrator}
    with open_twin(tmp_path, instances, {"imu": rate, "wheels": rate}, **keys) as twin, twin.trace() as trace:
        twin.tick(ticks)
    t = np.arange(0, ticks, 100 // rate) / 100
    turn, acceleration = np.cos(frequency * t), -frequency * np.sin(frequency * t)
    flat = np.stack([np.zeros_like(t), np.zeros_like(t), turn], axis=1)
    place = np.array([x, y, 2.0])
    felt = np.stack([np.cos(frequency * t), np.full_like(t, 2.0), np.full_like(t, -9.75)], axis=1)
    felt = felt + np.cross(acceleration[:, None] * [0.0, 0.0, 1.0], place) + np.cross(flat, np.cross(flat, place))
    angle = np.sin(frequency * t) / frequency
    squared = 0.5 * t + np.sin(2.0 * frequency * t) / (4.0 * frequency)  # the integral of cos^2
    velocity = np.stack([angle - turn * y - squared * x, 2.0 * t + turn * x - squared * y, -9.75 * t], axis=1)

    def at_updates(path: str) -> NDArray[np.float64]:
        return np.asarray(trace[path])[:: 100 // rate]

    tolerance: Values = {"rtol": 0.0, "atol": 1e-12}
    np.testing.assert_allclose(at_updates("imu.outputs.accelerometer_body"), felt, **tolerance)
    np.testing.assert_allclose(at_updates("imu.outputs.gyroscope_body"), flat, **tolerance)
    np.testing.assert_allclose(
        at_updates("imu.outputs.delta_velocity_body")[1:], np.diff(velocity, axis=0), **tolerance
    )
    np.testing.assert_allclose(at_updates("imu.outputs.delta_angle_body")[1:, 2], np.diff(angle), **tolerance)
    assert (at_updates("imu.outputs.delta_velocity_body")[0] == 0.0).all()
    np.testing.assert_allclose(at_updates("wheels.outputs.x"), angle, **tolerance)
    np.testing.assert_allclose(at_updates("wheels.outputs.forward_speed")[1:], np.diff(angle) * rate, **tolerance)
    assert (at_updates("wheels.outputs.y") == 0.0).all()


def test_wheels_without_errors_find_the_circle_that_they_drive(tmp_path: Path) -> None:
    inputs = {"velocity_body": [2.0, 0.0, 0.0], "rate_body": [3.0, 4.0, 0.8]}
    with open_twin(tmp_path, {"wheels": instance_of("wheel_odometry", inputs)}, {"wheels": 10}) as twin:
        twin.tick(1001)
        found = twin.get_many([f"wheels.outputs.{name}" for name in ("x", "y", "yaw", "forward_speed", "yaw_rate")])
    yaw, radius = 8.0, 2.5
    expected = [radius * math.sin(yaw), radius * (1.0 - math.cos(yaw)), yaw - 2.0 * math.pi, 2.0, 0.8]
    values = [found[f"wheels.outputs.{name}"] for name in ("x", "y", "yaw", "forward_speed", "yaw_rate")]
    assert values == pytest.approx(expected, rel=1e-11)


TICKS = 40_000
N, K = 2e-3, 3.5e-3  # noise density and walk: their Allan variances are equal at about 1 s
LEVEL = {"attitude_body_to_ned": [1.0, 0.0, 0.0, 0.0]}
TRIADS: Values = {
    f"{triad}_{name}": value
    for triad in ("accelerometer", "gyroscope")
    for name, value in (("noise_density", N), ("bias_walk", K))
}
NOISY: dict[str, tuple[int, Values]] = {
    "imu": (100, instance_of("imu", **TRIADS)),
    "slow_imu": (25, instance_of("imu", gyroscope_noise_density=N, accelerometer_noise_density=N)),
    "drifting_imu": (
        100,
        instance_of(
            "imu",
            gyroscope_drift_sigma=0.5,
            gyroscope_drift_time_constant=0.1,
            accelerometer_drift_sigma=0.25,
            accelerometer_drift_time_constant=0.2,
        ),
    ),
    "gnss": (
        100,
        instance_of(
            "gnss", horizontal_sigma=1.5, vertical_sigma=3.0, horizontal_velocity_sigma=0.1, vertical_velocity_sigma=0.2
        ),
    ),
    "drifting_gnss": (
        100,
        instance_of("gnss", horizontal_drift_sigma=2.0, vertical_drift_sigma=5.0, drift_time_constant=0.3),
    ),
    "magnetometer": (100, instance_of("magnetometer", LEVEL, sigma=2e-7)),
    "barometer": (100, instance_of("barometer", {"pressure": 1e5}, sigma=3.0, bias=2.0)),
    "drifting_barometer": (25, instance_of("barometer", drift_sigma=4.0, drift_time_constant=0.1)),
    "drifting_pitot": (100, instance_of("airspeed_sensor", drift_sigma=1.0, drift_time_constant=0.05)),
    "pitot": (100, instance_of("airspeed_sensor", {"dynamic_pressure": 200.0}, sigma=2.0, bias=-1.0)),
    "range_finder": (100, instance_of("range_finder", LEVEL | {"height_above_ground": 10.0}, sigma=0.05, bias=0.1)),
    "wheels": (100, instance_of("wheel_odometry", {"velocity_body": [-4.0, 0.0, 0.0]}, slip=0.05)),
    "slow_wheels": (25, instance_of("wheel_odometry", {"velocity_body": [-4.0, 0.0, 0.0]}, slip=0.05)),
    "losing": (100, instance_of("barometer", {"pressure": 1e5}, dropout_probability=0.2)),
}
Run = Callable[[str, str], NDArray[np.float64]]


@pytest.fixture(scope="module")
def noisy(tmp_path_factory: pytest.TempPathFactory) -> Run:
    """Samples of a run of 400 s, by instance and output."""
    instances = {name: instance for name, (_, instance) in NOISY.items()}
    rates = {name: rate for name, (rate, _) in NOISY.items()}
    with open_twin(tmp_path_factory.mktemp("noisy"), instances, rates) as twin:
        with twin.trace(*(f"{name}.outputs" for name in NOISY)) as trace:
            twin.tick(TICKS)
    return lambda name, output: np.asarray(trace[f"{name}.outputs.{output}"])[:: 100 // rates[name]]


def assert_white(noise: NDArray[np.float64], sigma: float) -> None:
    """Mean, deviation, kurtosis and neighbours of each column."""
    noise = noise.reshape(len(noise), -1) / sigma
    count = len(noise)
    assert (np.abs(noise.mean(axis=0)) < DEVIATIONS / math.sqrt(count)).all()
    assert (np.abs(noise.var(axis=0) - 1.0) < DEVIATIONS * math.sqrt(2.0 / count)).all()
    assert (np.abs((noise**4).mean(axis=0) - 3.0) < DEVIATIONS * math.sqrt(96.0 / count)).all()
    for lag in (1, 2):
        assert (np.abs((noise[lag:] * noise[:-lag]).mean(axis=0)) < DEVIATIONS / math.sqrt(count)).all()
    for i in range(noise.shape[1]):
        for j in range(i):
            assert abs((noise[:, i] * noise[:, j]).mean()) < DEVIATIONS / math.sqrt(count)


def assert_gauss_markov(drift: NDArray[np.float64], sigma: float, time_constant: float, interval: float) -> None:
    """What is new in each value is white. The whole has its deviation, and e^-1 of its variance after tau."""
    decay = math.exp(-interval / time_constant)
    drift = drift.reshape(len(drift), -1)
    assert_white(drift[1:] - decay * drift[:-1], sigma * math.sqrt(1.0 - decay * decay))
    # The variance of the mean of x^2, by the sum of the squared autocorrelation.
    spread = DEVIATIONS * math.sqrt(2.0 * (1.0 + decay**2) / (1.0 - decay**2) / len(drift))
    assert (np.abs((drift**2).mean(axis=0) / sigma**2 - 1.0) < spread).all() and spread < 0.3
    lag = round(time_constant / interval)
    correlation = (drift[lag:] * drift[:-lag]).mean(axis=0) / (drift**2).mean(axis=0)
    assert (np.abs(correlation - decay**lag) < spread).all()


@pytest.mark.parametrize(
    ("instance", "output", "truth", "sigma"),
    [
        ("slow_imu", "gyroscope_body", 0.0, N * 5.0),
        ("slow_imu", "accelerometer_body", 0.0, N * 5.0),
        ("slow_imu", "delta_angle_body", 0.0, N / 5.0),
        ("slow_imu", "delta_velocity_body", 0.0, N / 5.0),
        ("gnss", "position_ned", 0.0, [1.5, 1.5, 3.0]),
        ("gnss", "velocity_ned", 0.0, [0.1, 0.1, 0.2]),
        ("magnetometer", "magnetic_field_body", 0.0, 2e-7),
        ("barometer", "pressure", 1e5 + 2.0, 3.0),
        ("pitot", "differential_pressure", 199.0, 2.0),
        ("range_finder", "range", 10.1, 0.05),
    ],
)
def test_white_noise_has_its_deviation_about_truth_and_bias(
    noisy: Run, instance: str, output: str, truth: float, sigma: float | list[float]
) -> None:
    """That of an IMU: N sqrt(rate), and N / sqrt(rate) of an increment, but for the first sample."""
    first = 1 if instance == "slow_imu" else 0
    assert_white((noisy(instance, output) - truth)[first:] / sigma, 1.0)


@pytest.mark.parametrize(
    ("instance", "output", "sigma", "time_constant", "interval"),
    [
        ("drifting_imu", "gyroscope_body", 0.5, 0.1, 0.01),
        ("drifting_imu", "accelerometer_body", 0.25, 0.2, 0.01),
        ("drifting_gnss", "position_ned", [2.0, 2.0, 5.0], 0.3, 0.01),
        ("drifting_barometer", "pressure", 4.0, 0.1, 0.04),
        ("drifting_pitot", "differential_pressure", 1.0, 0.05, 0.01),
    ],
)
def test_drift_is_a_gauss_markov_process(
    noisy: Run, instance: str, output: str, sigma: float | list[float], time_constant: float, interval: float
) -> None:
    assert_gauss_markov(noisy(instance, output) / sigma, 1.0, time_constant, interval)


@pytest.mark.parametrize("triad", ["gyroscope_body", "accelerometer_body"])
def test_allan_variance_of_an_imu_is_that_of_its_noise_density_and_walk(noisy: Run, triad: str) -> None:
    """N^2 / T + K^2 T / 3 (IEEE Std 952-1997, annex C). The walk is sampled: 3 becomes 6 m^2 / (2 m^2 + 1)."""
    rates = noisy("imu", triad)
    for size in (1, 10, 100, 1000):
        duration = size * STEP_S
        means = rates[: len(rates) // size * size].reshape(-1, size, 3).mean(axis=1)
        allan = 0.5 * (np.diff(means, axis=0) ** 2).mean()
        expected = N**2 / duration + K**2 * duration * (2.0 * size**2 + 1.0) / (6.0 * size**2)
        # Differences of neighbours correlate by at most -1/2: the variance of their mean square is at most 3 / count.
        spread = DEVIATIONS * math.sqrt(3.0 / (3 * (len(means) - 1)))
        assert allan == pytest.approx(expected, rel=spread), size


def test_an_increment_has_the_noise_of_its_sample(noisy: Run) -> None:
    for delta, rate in (("delta_angle_body", "gyroscope_body"), ("delta_velocity_body", "accelerometer_body")):
        np.testing.assert_allclose(noisy("imu", delta)[1:], noisy("imu", rate)[1:] * STEP_S, rtol=1e-12)
        assert (noisy("imu", rate)[0] == 0.0).all() and (noisy("imu", delta)[0] == 0.0).all()


@pytest.mark.parametrize("instance", ["wheels", "slow_wheels"])
def test_slip_grows_with_the_distance_and_not_with_the_rate(noisy: Run, instance: str) -> None:
    """A wheel's distance D has the variance slip^2 D, the mean of both slip^2 D / 2, the turn 2 slip^2 D / b^2."""
    interval = 1.0 / NOISY[instance][0]
    deviation = 0.05 * math.sqrt(4.0 * interval)
    assert_white(noisy(instance, "forward_speed")[1:] * interval + 4.0 * interval, deviation / math.sqrt(2.0))
    assert_white(noisy(instance, "yaw_rate")[1:] * interval, deviation * math.sqrt(2.0) / 0.5)


def test_dropouts_have_their_probability_and_no_memory(noisy: Run) -> None:
    standardized = (noisy("losing", "sampled").astype(float) - 0.8) / 0.4
    bound = DEVIATIONS / math.sqrt(TICKS)
    assert abs(standardized.mean()) < bound
    assert abs((standardized[1:] * standardized[:-1]).mean()) < bound


# ---- what goes on after a failure ------------------------------------------------------------------------------

#: Every sensor with every error.
FULL: dict[str, Values] = {
    "imu": instance_of(
        "imu",
        {"specific_force_body": [1.0, 2.0, -9.8], "rate_body": [0.1, 0.2, 0.3]},
        **TRIADS,
        accelerometer_drift_sigma=0.1,
        accelerometer_drift_time_constant=3.0,
        gyroscope_drift_sigma=0.01,
        gyroscope_drift_time_constant=2.0,
        gyroscope_quantum=1e-4,
        delay_samples=2,
    ),
    "gnss": instance_of(
        "gnss",
        {"latitude": 0.8, "longitude": 0.2, "height": 100.0, "velocity_ned": [1.0, 2.0, 3.0]},
        reference_latitude=0.8,
        reference_longitude=0.2,
        horizontal_sigma=1.0,
        vertical_sigma=2.0,
        horizontal_drift_sigma=3.0,
        vertical_drift_sigma=4.0,
        drift_time_constant=10.0,
        horizontal_velocity_sigma=0.1,
        vertical_velocity_sigma=0.2,
        delay_samples=1,
    ),
    "magnetometer": instance_of("magnetometer", LEVEL, sigma=1e-7),
    "barometer": instance_of("barometer", {"pressure": 9e4}, sigma=2.0, drift_sigma=5.0, drift_time_constant=60.0),
    "range_finder": instance_of("range_finder", LEVEL | {"height_above_ground": 4.0}, sigma=0.1),
    "wheels": instance_of(
        "wheel_odometry",
        {"velocity_body": [1.0, 0.0, 0.0], "rate_body": [0.0, 0.0, 0.5]},
        slip=0.02,
        tick_distance=1e-3,
        delay_samples=3,
    ),
    "pitot": instance_of("airspeed_sensor", {"dynamic_pressure": 200.0, "density": 1.1}, sigma=1.0, drift_sigma=1.0),
}


Trace = dict[str, NDArray[Any]]


def fly(folder: Path, instances: Mapping[str, Values] = FULL, events: Sequence[Values] = ()) -> Trace:
    """All outputs of 200 ticks, by path."""
    with open_twin(folder, instances, dict.fromkeys(FULL, 100), events=list(events)) as twin:
        with twin.trace(*(f"{name}.outputs" for name in FULL)) as trace:
            twin.tick(200)
    return {f.path: np.asarray(trace[f.path]) for name in FULL for f in twin.fields(f"{name}.outputs")}


def between(begin_s: float, end_s: float, path: str, value: Any, after: Any) -> list[Values]:
    return [{"at_s": at_s, "set": path, "value": v} for at_s, v in ((begin_s, value), (end_s, after))]


def faults(fault: int) -> list[Values]:
    return [event for name in FULL for event in between(0.5, 1.0, f"{name}.parameters.fault", fault, 0)]


@pytest.fixture(scope="module")
def healthy(tmp_path_factory: pytest.TempPathFactory) -> Trace:
    return fly(tmp_path_factory.mktemp("healthy"))


def sampled_of(trace: Trace, path: str) -> NDArray[np.bool_]:
    return trace[path.partition(".")[0] + ".outputs.sampled"]


def values_of(trace: Trace) -> list[str]:
    return [path for path in trace if not path.endswith("sampled")]


def test_dropouts_change_no_sample_that_is_not_lost(tmp_path: Path, healthy: Trace) -> None:
    """The same seed with and without: the same bits."""
    lossy = {i: d | {"parameters": d["parameters"] | {"dropout_probability": 0.3}} for i, d in FULL.items()}
    trace = fly(tmp_path, lossy)
    for path in values_of(trace):
        sampled = sampled_of(trace, path)
        assert 0.5 < sampled.mean() < 0.85
        assert (trace[path][sampled] == healthy[path][sampled]).all(), path
        lost = np.flatnonzero(~sampled[1:]) + 1
        assert (trace[path][lost] == trace[path][lost - 1]).all(), path


@pytest.mark.parametrize("fault", [SILENT, STUCK])
def test_a_fault_that_ends_changes_no_later_sample(tmp_path: Path, healthy: Trace, fault: int) -> None:
    trace = fly(tmp_path, events=faults(fault))
    for path in values_of(trace):
        sampled = sampled_of(trace, path)
        assert sampled[50:100].tolist() == [fault == STUCK] * 50 and sampled[100:].all()
        assert (trace[path][50:100] == healthy[path][49]).all(), path
        for part in (slice(0, 50), slice(100, None)):
            assert (trace[path][part] == healthy[path][part]).all(), path


def test_a_dead_sensor_comes_back_as_it_was(tmp_path: Path, healthy: Trace) -> None:
    """But for the wheels, whose count lacks what they rolled. Samples of a dead sensor may be 2 ticks late."""
    trace = fly(tmp_path, events=faults(DEAD))
    for path in values_of(trace):
        if not path.startswith("wheels."):
            for part in (slice(0, 50), slice(102, None)):
                assert (trace[path][part] == healthy[path][part]).all(), path
    assert abs(trace["pitot.outputs.differential_pressure"][50:100]).max() < 10.0
    assert abs(trace["imu.outputs.accelerometer_body"][52:102]).max() < 0.5
    assert (trace["wheels.outputs.x"][53:103] == trace["wheels.outputs.x"][53]).all()


def test_more_noise_for_a_while_changes_no_later_sample(tmp_path: Path, healthy: Trace) -> None:
    trace = fly(tmp_path, events=between(0.5, 1.0, "barometer.parameters.sigma", 50.0, 2.0))
    for path in values_of(trace):
        changed = np.flatnonzero(trace[path] != healthy[path])
        assert changed.tolist() == (list(range(50, 100)) if path.startswith("barometer.") else []), path
