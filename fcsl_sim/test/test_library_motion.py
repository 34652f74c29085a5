# SPDX-License-Identifier: Apache-2.0
"""Models of motion and of the Earth: against closed forms, published constants of WGS-84, and SciPy."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from fcsl_sim.model_instance import ModelInstance
from simclient import SimTwin

MODELS = Path(__file__).resolve().parents[1] / "models"
WGS84 = {"equatorial_radius": 6378137.0, "flattening": 1 / 298.257223563, "rotation_rate": 7.292115e-5}
GM = 3.986004418e14
INERTIA = np.array([[0.3, 0.02, -0.01], [0.02, 0.5, 0.03], [-0.01, 0.03, 0.6]])


def model(name: str, **values: float | Sequence[float]) -> ModelInstance:
    instance = ModelInstance.load(str(MODELS / f"{name}.c"))
    for path, value in values.items():
        instance.set(path.replace("__", "."), value)
    if instance.has("init"):
        instance.init()
    return instance


def rotation(quaternion: Sequence[float]) -> Rotation:
    """Of w, x, y, z."""
    return Rotation.from_quat(np.roll(quaternion, -1))


# ---- rigid body ----------------------------------------------------------------------------------------------------


def free_body(**parameters: Any) -> dict[str, Any]:
    """A rigid body alone, in a simulation of 10 s."""
    zero = [0.0, 0.0, 0.0]
    start = {
        "position_inertial": zero,
        "velocity_inertial": zero,
        "rate_body": zero,
        "roll": 0.0,
        "pitch": 0.0,
        "yaw": 0.0,
    }
    return {
        "tick_hz": 10,
        "seed": 1,
        "duration": 10.0,
        "integrator": {"method": "rk45", "rtol": 1e-10, "atol": 1e-12},
        "models": {"rigid_body": {"source": "rigid_body.c"}},
        "instances": {
            "body": {
                "model": "rigid_body",
                "parameters": start | parameters,
                "inputs": {"mass": 2.0, "inertia": INERTIA.tolist(), "force_body": zero},
            }
        },
    }


@pytest.fixture
def fly(tmp_path: Path) -> Callable[[dict[str, Any]], SimTwin]:
    def start(simulation: dict[str, Any]) -> SimTwin:
        for file in MODELS.glob("*.[ch]"):
            shutil.copy(file, tmp_path)
        path = tmp_path / "flight.sim.json"
        path.write_text(json.dumps(simulation))
        return SimTwin.from_config(path)

    return start


def test_a_free_body_keeps_its_angular_momentum_and_its_energy(fly: Callable[[dict[str, Any]], SimTwin]) -> None:
    rate = np.array([0.5, 2.0, -1.0])
    with fly(free_body(rate_body=rate.tolist(), roll=0.3, pitch=-0.2, yaw=1.0)) as twin:
        start = rotation(twin.get("body.state.attitude_body_to_inertial")).apply(INERTIA @ rate)
        twin.step(100)
        last = np.array(twin.get("body.outputs.rate_body"))
        attitude = twin.get("body.outputs.attitude_body_to_inertial")
        assert rotation(attitude).apply(INERTIA @ last) == pytest.approx(start, abs=1e-8)
        assert last @ INERTIA @ last == pytest.approx(rate @ INERTIA @ rate, rel=1e-9)
        assert np.linalg.norm(twin.get("body.state.attitude_body_to_inertial")) == pytest.approx(1.0, abs=1e-9)


def test_forces_and_torques_move_it_as_scipy_says(fly: Callable[[dict[str, Any]], SimTwin]) -> None:
    force, torque, gravity = np.array([1.0, -2.0, 0.5]), np.array([0.02, -0.01, 0.03]), np.array([0.0, 0.0, 9.8])
    change = 0.01 * np.eye(3)

    def equations(_: float, x: np.ndarray) -> np.ndarray:
        w, q = x[10:], rotation(x[6:10])
        turn = np.array(
            [[0, -w[0], -w[1], -w[2]], [w[0], 0, w[2], -w[1]], [w[1], -w[2], 0, w[0]], [w[2], w[1], -w[0], 0]]
        )
        spin = np.linalg.solve(INERTIA, torque - np.cross(w, INERTIA @ w) - change @ w)
        return np.concatenate([x[3:6], gravity + q.apply(force) / 2.0, 0.5 * turn @ x[6:10], spin])

    simulation = free_body(rate_body=[0.1, 0.2, 0.3], velocity_inertial=[1.0, 2.0, 3.0])
    given = {"force_body": force, "torque_body": torque, "gravity_inertial": gravity, "inertia_rate": change}
    simulation["instances"]["body"]["inputs"] |= {name: value.tolist() for name, value in given.items()}
    with fly(simulation) as twin:
        start = [0, 0, 0, 1, 2, 3, 1, 0, 0, 0, 0.1, 0.2, 0.3]
        last = solve_ivp(equations, (0, 9.9), start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]
        twin.step(100)
        found = [twin.get(f"body.outputs.{name}") for name in ("position_inertial", "velocity_inertial", "rate_body")]
        assert np.concatenate(found) == pytest.approx(np.concatenate([last[:6], last[10:]]), abs=2e-6)
        assert twin.get("body.outputs.specific_force_body") == pytest.approx(force / 2.0)


# ---- the Earth -----------------------------------------------------------------------------------------------------

PLACES = [(0.0, 0.0, 0.0), (0.7, 1.2, 3000.0), (-1.1, -2.9, -50.0), (math.pi / 2, 0.0, 100.0), (0.3, 3.1, 4e7)]


def ecef(latitude: float, longitude: float, height: float) -> np.ndarray:
    """By the definition of geodetic coordinates: the foot point on the ellipsoid, then along its normal."""
    a, b = WGS84["equatorial_radius"], WGS84["equatorial_radius"] * (1 - WGS84["flattening"])
    c, s = math.cos(latitude), math.sin(latitude)
    normal = np.array([c * math.cos(longitude), c * math.sin(longitude), s])
    foot = np.array([a * a * normal[0], a * a * normal[1], b * b * s]) / math.hypot(a * c, b * s)
    return foot + height * normal


@pytest.mark.parametrize(("latitude", "longitude", "height"), PLACES)
def test_geodetic_coordinates(latitude: float, longitude: float, height: float) -> None:
    where = ecef(latitude, longitude, height)
    earth = model("earth_wgs84", inputs__position_inertial=where.tolist())
    earth.output(0.0)
    assert earth.get("outputs.latitude") == pytest.approx(latitude, abs=1e-12)
    assert earth.get("outputs.height") == pytest.approx(height, abs=2e-8)
    if abs(latitude) < 1.5:
        assert earth.get("outputs.longitude") == pytest.approx(longitude, abs=1e-12)
    start = model(
        "rigid_body_geodetic",
        parameters__latitude=latitude,
        parameters__longitude=longitude,
        parameters__height=height,
        **{f"parameters__{name}": value for name, value in WGS84.items()},
    )
    assert start.continuous[:3] == pytest.approx(where, abs=1e-6)


def test_gravity_of_wgs84() -> None:
    """Normal gravity of TR8350.2, table 3.4, is gravitation less the centrifugal acceleration, and has a J4 of -2.37e-6, too,
    which P4 weighs by 3/8 at the equator and by 1 at the pole."""
    for latitude, published, weight in ((0.0, 9.7803253359, 3 / 8), (math.pi / 2, 9.8321849378, 1.0)):
        where = ecef(latitude, 0.0, 0.0)
        distance = float(np.linalg.norm(where))
        published -= 5 * 2.370912e-6 * weight * GM / distance**2 * (WGS84["equatorial_radius"] / distance) ** 4
        earth = model("earth_wgs84", inputs__position_inertial=where.tolist())
        earth.output(0.0)
        spin = WGS84["rotation_rate"] ** 2 * math.hypot(where[0], where[1])
        assert earth.get("outputs.gravity") - spin == pytest.approx(published, abs=1e-6)
        down = rotation(ned(latitude, 0.0)).inv().apply(earth.get("outputs.gravity_inertial"))
        assert down[2] > 9.7 and abs(down[0]) < 1e-3


def ned(latitude: float, longitude: float) -> list[float]:
    """The turn from north, east, down to Earth-fixed axes, as w, x, y, z."""
    q = (Rotation.from_euler("z", longitude) * Rotation.from_euler("y", -latitude - math.pi / 2)).as_quat()
    return [q[3], q[0], q[1], q[2]]


def test_gravity_is_the_gradient_of_the_potential() -> None:
    """V = GM/r (1 - J2 (a/r)^2 (3 sin^2 - 1) / 2), differentiated numerically."""
    a, j2 = WGS84["equatorial_radius"], 1.08262982131e-3

    def potential(r: np.ndarray) -> float:
        distance = float(np.linalg.norm(r))
        return GM / distance * (1 - j2 * (a / distance) ** 2 * (3 * (r[2] / distance) ** 2 - 1) / 2)

    where = np.array([4e6, -3e6, 5e6])
    earth = model("earth_wgs84", inputs__position_inertial=where.tolist())
    earth.output(0.0)
    gradient = [(potential(where + 10 * e) - potential(where - 10 * e)) / 20 for e in np.eye(3)]
    assert earth.get("outputs.gravity_inertial") == pytest.approx(gradient, abs=1e-6)


@pytest.mark.parametrize("t", [0.0, 5000.0])
def test_velocity_and_attitude_over_the_turning_earth(t: float) -> None:
    """What the rigid body takes apart at its start, the Earth puts together again."""
    euler, velocity, rate = (0.2, -0.4, 2.5), [30.0, -40.0, 5.0], [0.1, -0.2, 0.3]
    place = {"latitude": 0.8, "longitude": -1.9, "height": 1500.0, "roll": euler[0], "pitch": euler[1], "yaw": euler[2]}
    body = ModelInstance.load(str(MODELS / "rigid_body_geodetic.c"))
    for name, value in (place | WGS84 | {"velocity_ned": velocity, "rate_over_ground_body": rate}).items():
        body.set(f"parameters.{name}", value)
    body.init(time_ns=int(t * 1e9))
    x = body.continuous
    earth = model(
        "earth_wgs84",
        inputs__position_inertial=x[:3],
        inputs__velocity_inertial=x[3:6],
        inputs__attitude_body_to_inertial=x[6:10],
        inputs__rate_body=x[10:],
    )
    earth.output(t)
    assert earth.get("outputs.velocity_ned") == pytest.approx(velocity, abs=1e-8)
    assert earth.get("outputs.rate_over_ground_body") == pytest.approx(rate, abs=1e-15)
    assert (earth.get("outputs.latitude"), earth.get("outputs.longitude")) == pytest.approx((0.8, -1.9), abs=1e-12)
    found = rotation(earth.get("outputs.attitude_body_to_ned"))
    assert found.as_euler("ZYX") == pytest.approx(euler[::-1], abs=1e-12)


def test_a_round_earth_is_an_ellipsoid_without_flattening() -> None:
    earth = model(
        "earth_round",
        parameters__radius=6371000.0,
        parameters__gm=GM,
        inputs__position_inertial=[0.0, 6371000.0 * 0.6, 6371000.0 * 0.8],
    )
    earth.output(0.0)
    assert earth.get("outputs.latitude") == pytest.approx(math.asin(0.8), abs=1e-14)
    assert earth.get("outputs.longitude") == pytest.approx(math.pi / 2)
    assert earth.get("outputs.height") == pytest.approx(0.0, abs=1e-8)
    assert earth.get("outputs.gravity") == pytest.approx(GM / 6371000.0**2, rel=1e-15)


def test_a_flat_earth_agrees_with_the_ellipsoid_nearby() -> None:
    """One kilometre north and east of the origin, to the curvature: d^2 / (2 R) in height."""
    latitude, longitude, height = 0.8, 0.2, 300.0
    flat = model(
        "earth_flat",
        parameters__gravity=9.81,
        parameters__latitude=latitude,
        parameters__longitude=longitude,
        parameters__height=height,
        inputs__position_inertial=[1000.0, 1000.0, -50.0],
    )
    flat.output()
    offset = rotation(ned(latitude, longitude)).apply([1000.0, 1000.0, -50.0])
    curved = model("earth_wgs84", inputs__position_inertial=(ecef(latitude, longitude, height) + offset).tolist())
    curved.output()
    assert flat.get("outputs.latitude") == pytest.approx(curved.get("outputs.latitude"), abs=0.2 / 6.4e6)
    assert flat.get("outputs.longitude") == pytest.approx(curved.get("outputs.longitude"), abs=0.3 / 6.4e6)
    assert curved.get("outputs.height") - flat.get("outputs.height") == pytest.approx(2e6 / 2 / 6.38e6, abs=0.01)
    assert flat.get("outputs.height") == 350.0
    assert flat.get("outputs.gravity_inertial") == [0.0, 0.0, 9.81]


def test_an_attitude_that_nothing_feeds_is_none() -> None:
    flat = model("earth_flat", parameters__gravity=9.81)
    flat.output()
    assert flat.get("outputs.attitude_body_to_ned") == [1.0, 0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("name", "parameter", "value", "reason"),
    [
        ("earth_flat", "latitude", 1.57, "parameters.latitude must be within 1.5533 rad"),
        ("earth_round", "radius", 0.0, "parameters.radius must be positive"),
        ("rigid_body_geodetic", "flattening", math.nan, "parameters.flattening must be in"),
    ],
)
def test_wrong_parameters(name: str, parameter: str, value: float, reason: str) -> None:
    instance = ModelInstance.load(str(MODELS / f"{name}.c"))
    for path, field in instance.fields.items():
        if field.role == "parameter" and not field.shape:
            instance.set(path, 0.1)
    instance.set(f"parameters.{parameter}", value)
    with pytest.raises(ValueError, match=f"^{reason}"):
        instance.init()
