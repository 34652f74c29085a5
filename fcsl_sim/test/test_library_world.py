# SPDX-License-Identifier: Apache-2.0
"""Models of the world around a vehicle: against published tables, closed forms, NumPy and SciPy."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from fcsl_sim.model_instance import ModelInstance
from fcsl_sim.model_list import find_model
from simclient import SimTwin

MODELS = Path(__file__).resolve().parents[1] / "models"
Vector = NDArray[np.float64]
Fly = Callable[[dict[str, Any]], SimTwin]


@cache
def library(name: str) -> Path:
    """The model, compiled once."""
    return find_model(str(MODELS / f"{name}.c")).table().library


def model(name: str, **parameters: Any) -> ModelInstance:
    """With these parameters, after init."""
    instance = ModelInstance(library(name), name)
    for key, value in parameters.items():
        instance.set(f"parameters.{key}", np.ravel(value).tolist() if np.ndim(value) else value)
    if instance.has("init"):
        instance.init()
    return instance


def outputs(instance: ModelInstance, *names: str, **inputs: Any) -> list[Vector]:
    """The named outputs for these inputs."""
    for key, value in inputs.items():
        instance.set(f"inputs.{key}", np.ravel(value).tolist() if np.ndim(value) else value)
    instance.output()
    return [np.array(instance.get(f"outputs.{name}")) for name in names]


def wxyz(rotation: Rotation) -> Vector:
    return np.roll(rotation.as_quat(), 1)


def rotation(quaternion: Vector) -> Rotation:
    """Of w, x, y, z."""
    return Rotation.from_quat(np.roll(quaternion, -1))


@pytest.fixture
def fly(tmp_path: Path) -> Fly:
    """Opens a simulation of models of the library."""

    def start(simulation: dict[str, Any]) -> SimTwin:
        for file in MODELS.glob("*.[ch]"):
            shutil.copy(file, tmp_path)
        path = tmp_path / "world.sim.json"
        path.write_text(json.dumps(simulation))
        return SimTwin.from_config(path)

    return start


# ---- magnetic field --------------------------------------------------------------------------------------------------

#: What pygeomag 1.1.0 (PyPI) computes with its WMM_2025.COF: year, height km, latitude and longitude deg, then north, east and
#: down in nT.
PYGEOMAG = [
    (2025.0, 0.0, 90.0, 0.0, 1734.7993, 432.7390, 56860.3794),
    (2025.0, 0.0, -90.0, 37.0, 6155.7947, -15648.9849, -51715.8368),
    (2025.0, 0.0, 0.0, 0.0, 27453.9287, -1927.5874, -16010.8070),
    (2026.3, 12.0, 51.5, -0.1, 19454.2563, 378.5536, 44800.1930),
    (2027.5, 400.0, -33.9, 151.2, 19839.0359, 4378.1674, -42221.0072),
    (2028.75, 0.5, 37.6, -122.4, 22341.7374, 4999.8296, 41047.1851),
    (2029.9, 850.0, 71.3, 25.8, 6935.6183, 1327.5767, 38114.7009),
    (2030.0, -1.0, -54.8, -68.3, 18932.4544, 3799.9108, -24157.0178),
    (2026.0, 35.0, 1.35, 103.8, 40285.6914, 113.4641, -9190.2854),
    (2029.0, 3.0, -78.0, -179.5, -5991.1031, 10079.7332, -59654.7536),
]


def field(year: float, height: float, latitude: float, longitude: float) -> Vector:
    """nT, from km and degrees, as the tables have them."""
    earth = model("magnetic_field_wmm2025", decimal_year=year)
    at = {"latitude": math.radians(latitude), "longitude": math.radians(longitude), "height": 1e3 * height}
    (tesla,) = outputs(earth, "magnetic_field_ned", **at)
    return 1e9 * tesla


@pytest.mark.parametrize("row", PYGEOMAG, ids=str)
def test_the_magnetic_field_is_that_of_another_implementation(row: tuple[float, ...]) -> None:
    np.testing.assert_allclose(field(*row[:4]), row[4:], rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("pole", [90.0, -90.0])
def test_the_magnetic_field_is_defined_and_steady_at_a_pole(pole: float) -> None:
    """North is along the meridian that one stands on, so another meridian turns the vector about the vertical."""
    there = field(2025.0, 0.0, pole, 0.0)
    for longitude in (37.0, 180.0, -90.0):
        expected = Rotation.from_euler("z", math.copysign(1.0, pole) * longitude, degrees=True).apply(there)
        np.testing.assert_allclose(field(2025.0, 0.0, pole, longitude), expected, rtol=0.0, atol=1e-6)
        near = field(2025.0, 0.0, pole * (1.0 - 1e-9), longitude)
        np.testing.assert_allclose(near, expected, rtol=0.0, atol=1e-3)


@pytest.mark.parametrize("year", [2024.9, 2030.1, math.nan])
def test_the_magnetic_field_knows_only_its_five_years(year: float) -> None:
    with pytest.raises(ValueError, match=r"parameters.decimal_year must be 2025.0 to 2030.0"):
        model("magnetic_field_wmm2025", decimal_year=year)


# ---- contact ---------------------------------------------------------------------------------------------------------

MASS, GRAVITY = 12.0, 9.81
INERTIA = np.array([[0.4, 0.02, -0.01], [0.02, 0.5, 0.03], [-0.01, 0.03, 0.6]])
CORNERS = np.array([[x, y, z] for x in (-0.3, 0.3) for y in (-0.2, 0.2) for z in (0.1, -0.1)])
FEET = np.vstack([CORNERS[CORNERS[:, 2] > 0], CORNERS[CORNERS[:, 2] < 0]])
CONTACT = {"stiffness": 2e4, "damping": 0.4, "friction": 0.6, "friction_speed": 0.02}


def points(count: int, at: Vector = FEET) -> dict[str, Any]:
    padded = np.zeros((8, 3))
    padded[: len(at)] = at
    return {"points": count} | {axis: padded[:, i].tolist() for i, axis in enumerate("xyz")}


def test_contact_forces_are_those_of_the_equations_at_each_point() -> None:
    """Random motions of a box, half in the ground, against the equations in north, east, down."""
    random = np.random.default_rng(1)
    contact = model("ground_contact", **points(8), **CONTACT)
    seen = set()
    for _ in range(200):
        turn = Rotation.random(rng=random)
        height, velocity, rate = random.uniform(-0.1, 0.5), random.normal(0.0, 2.0, 3), random.normal(0.0, 3.0, 3)
        if random.random() < 0.3:  # slow ones, for the linear part of the friction
            velocity, rate = 0.005 * velocity, 0.005 * rate
        ned = {"height": height, "attitude_body_to_ned": wxyz(turn), "velocity_ned": velocity, "rate_body": rate}
        force, torque, touching, normal = outputs(
            contact, "force_body", "torque_body", "touching", "normal_force", **ned
        )
        place = turn.apply(FEET) - [0.0, 0.0, height]
        speed = velocity + np.cross(turn.apply(rate), turn.apply(FEET))
        push = np.maximum(0.0, 1.0 + CONTACT["damping"] * speed[:, 2]) * CONTACT["stiffness"] * place[:, 2].clip(0.0)
        slip = speed * [1.0, 1.0, 0.0]
        full = np.maximum(np.linalg.norm(slip, axis=1), CONTACT["friction_speed"])
        each = -CONTACT["friction"] * (push / full)[:, None] * slip - push[:, None] * [0.0, 0.0, 1.0]
        moment = np.cross(turn.apply(FEET), each).sum(axis=0)
        np.testing.assert_allclose(force, turn.inv().apply(each.sum(axis=0)), rtol=1e-11, atol=1e-8)
        np.testing.assert_allclose(torque, turn.inv().apply(moment), rtol=1e-11, atol=1e-8)
        assert normal == pytest.approx(push.sum(), rel=1e-12) and touching == (place[:, 2] > 0.0).any()
        assert normal >= 0.0 and turn.apply(force)[2] <= 1e-9  # it does not pull
        seen |= {bool(touching), "rising" if (speed[:, 2] < -1.0 / CONTACT["damping"]).any() else "slow"}
    assert seen == {True, False, "rising", "slow"}


def test_only_the_points_that_there_are_touch() -> None:
    level = {"height": 0.05, "attitude_body_to_ned": [1.0, 0.0, 0.0, 0.0]}
    for count in (1, 3, 4):
        (normal,) = outputs(model("ground_contact", **points(count), **CONTACT), "normal_force", **level)
        assert normal == pytest.approx(count * CONTACT["stiffness"] * 0.05, rel=1e-12)


def box(gravity: float = GRAVITY, **change: Any) -> dict[str, Any]:
    """A rigid body over flat ground for 10 s. `change` are parameters of the body and of the contact."""
    zero = [0.0, 0.0, 0.0]
    body = {
        "position_inertial": zero,
        "velocity_inertial": zero,
        "rate_body": zero,
        "roll": 0.0,
        "pitch": 0.0,
        "yaw": 0.0,
    }
    contact = points(4) | CONTACT
    none = np.zeros((3, 3)).tolist()
    return {
        "tick_hz": 100,
        "seed": 1,
        "duration": 10.0,
        "integrator": {"method": "rk4", "hz": 2000},
        "models": {
            name: {"source": f"{name}.c"}
            for name in ("rigid_body", "earth_flat", "ground_contact", "force_sum", "mass_properties")
        },
        "instances": {
            "body": {"model": "rigid_body", "parameters": {k: change.get(k, v) for k, v in body.items()}},
            "contact": {"model": "ground_contact", "parameters": {k: change.get(k, v) for k, v in contact.items()}},
            "earth": {
                "model": "earth_flat",
                "parameters": {"gravity": gravity, "latitude": 0.8, "longitude": 0.1, "height": 0.0},
            },
            "sum": {"model": "force_sum"},
            "mass": {
                "model": "mass_properties",
                "parameters": {
                    "dry_mass": MASS,
                    "dry_inertia": INERTIA.tolist(),
                    "full_propellant_mass": 1.0,
                    "propellant_inertia": none,
                },
            },
        },
        "connections": [
            {"from": f"{source}.{left}", "to": f"{target}.{right or left}"}
            for source, left, target, right in (
                ("body", "position_inertial", "earth", ""),
                ("body", "velocity_inertial", "earth", ""),
                ("body", "attitude_body_to_inertial", "earth", ""),
                ("body", "rate_body", "contact", ""),
                ("earth", "gravity_inertial", "body", ""),
                ("earth", "height", "contact", ""),
                ("earth", "velocity_ned", "contact", ""),
                ("earth", "attitude_body_to_ned", "contact", ""),
                ("contact", "force_body", "sum", "force_3_body"),
                ("contact", "torque_body", "sum", "torque_3_body"),
                ("sum", "force_body", "body", ""),
                ("sum", "torque_body", "body", ""),
                ("mass", "mass", "body", ""),
                ("mass", "inertia", "body", ""),
                ("mass", "inertia_rate", "body", ""),
            )
        ],
    }


def test_a_body_rests_as_deep_as_its_weight_asks(fly: Fly) -> None:
    """m g / (n k) below the height of its feet; those are a rectangle about its centre of mass."""
    with fly(box(position_inertial=[0.0, 0.0, -0.15], damping=2.0)) as twin:
        twin.tick(1)
        assert not twin.get("contact.outputs.touching")
        twin.tick(799)
        assert twin.get("contact.outputs.touching")
        assert twin.get("contact.outputs.normal_force") == pytest.approx(MASS * GRAVITY, rel=1e-6)
        depth = 0.1 - twin.get("earth.outputs.height")
        assert depth == pytest.approx(MASS * GRAVITY / (4 * CONTACT["stiffness"]), rel=1e-6)


@pytest.mark.parametrize("speed", [0.5, 2.0])
def test_an_impact_loses_the_speed_that_hunt_and_crossley_say(fly: Fly, speed: float) -> None:
    """Without gravity, dv/dd = -k d (1 + c v) / (m v) can be integrated: c v - ln(1 + c v) is equal before and after."""
    c = CONTACT["damping"]
    start: dict[str, Any] = {"position_inertial": [0.0, 0.0, -0.11], "velocity_inertial": [0.0, 0.0, speed]}
    exact = {"method": "rk45", "rtol": 1e-10, "atol": 1e-12}
    with fly(box(gravity=0.0, **start) | {"integrator": exact}) as twin:
        twin.tick(60)
        assert not twin.get("contact.outputs.touching")
        after = -twin.get("earth.outputs.velocity_ned")[2]
    before = c * speed - math.log1p(c * speed)
    assert after == pytest.approx(brentq(lambda v: -c * v - math.log1p(-c * v) - before, 1e-6, speed), rel=1e-7)
    assert after / speed == pytest.approx(1.0 - 2.0 / 3.0 * c * speed, abs=0.45 * (c * speed) ** 2)


def test_a_sliding_body_stops_where_coulomb_says(fly: Fly) -> None:
    """(v^2 + v_s^2) / (2 mu g): constant deceleration down to v_s, then an exponential end. Feet at the height of the centre
    of mass keep it level."""
    flat = points(4, FEET[:4] * [1.0, 1.0, 0.0])
    depth = MASS * GRAVITY / (4 * CONTACT["stiffness"])
    start: dict[str, Any] = {"position_inertial": [0.0, 0.0, depth], "velocity_inertial": [1.2, -0.9, 0.0]}
    slow, mu = CONTACT["friction_speed"], CONTACT["friction"]
    with fly(box(**start, **{**flat, "damping": 1.0})) as twin:
        twin.tick(101)
        way = np.array(twin.get("earth.outputs.position_ned"))
        speed = np.linalg.norm(twin.get("earth.outputs.velocity_ned"))
    expected = (1.5**2 + slow**2) / (2.0 * mu * GRAVITY)
    assert math.hypot(way[0], way[1]) == pytest.approx(expected, rel=1e-3)
    assert way[1] / way[0] == pytest.approx(-0.75, rel=1e-3)
    assert speed < 1e-6


def test_a_tumbling_body_gains_no_energy_at_the_ground(fly: Fly) -> None:
    start: dict[str, Any] = {
        "position_inertial": [0.0, 0.0, -1.0],
        "velocity_inertial": [2.0, -1.0, 0.0],
        "rate_body": [3.0, -4.0, 2.0],
    }
    with (
        fly(box(roll=0.7, pitch=0.5, **start, **points(8))) as twin,
        twin.trace("body.outputs", "contact.outputs") as t,
    ):
        twin.tick(400)
    height, velocity = -t["body.outputs.position_inertial"][:, 2], t["body.outputs.velocity_inertial"]
    rate, attitude = t["body.outputs.rate_body"], t["body.outputs.attitude_body_to_inertial"]
    low = np.array([rotation(q).apply(FEET)[:, 2] for q in attitude])
    springs = 0.5 * CONTACT["stiffness"] * ((low - height[:, None]).clip(0.0) ** 2).sum(axis=1)
    kinetic = 0.5 * MASS * (velocity**2).sum(axis=1) + 0.5 * np.einsum("ti,ij,tj->t", rate, INERTIA, rate)
    energy = kinetic + springs + MASS * GRAVITY * height
    assert t["contact.outputs.touching"].sum() > 50
    assert np.diff(energy).max() < 1e-9 * energy[0]
    assert energy[-1] < 0.2 * energy[0]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("points", 0, "must be 1 to 8"),
        ("points", 9, "must be 1 to 8"),
        ("stiffness", 0.0, "must be positive"),
        ("damping", -0.1, "must not be negative"),
        ("friction", math.nan, "must not be negative"),
        ("friction_speed", 0.0, "must be positive"),
    ],
)
def test_contact_refuses(name: str, value: float, message: str) -> None:
    with pytest.raises(ValueError, match=f"parameters.{name} {message}"):
        model("ground_contact", **(points(4) | CONTACT | {name: value}))


# ---- sums and masses -------------------------------------------------------------------------------------------------


def test_forces_and_torques_are_summed_each_once() -> None:
    adder = model("force_sum")
    random = np.random.default_rng(2)
    forces, torques = random.integers(-1000, 1000, (2, 6, 3)).astype(float)
    given: dict[str, Any] = {}
    for i in range(6):
        given |= {f"force_{i + 1}_body": forces[i], f"torque_{i + 1}_body": torques[i]}
        force, torque = outputs(adder, "force_body", "torque_body", **given)
        assert force.tolist() == forces[: i + 1].sum(axis=0).tolist()
        assert torque.tolist() == torques[: i + 1].sum(axis=0).tolist()


def masses(dry: Any = INERTIA, propellant: Any = 0.5 * INERTIA) -> ModelInstance:
    return model(
        "mass_properties", dry_mass=20.0, dry_inertia=dry, full_propellant_mass=8.0, propellant_inertia=propellant
    )


def test_the_inertia_follows_the_propellant() -> None:
    tank = np.diag([1.0, 2.0, 2.5])
    vehicle = masses(propellant=tank)
    mass, inertia = outputs(vehicle, "mass", "inertia")
    assert mass == 20.0 and inertia.tolist() == INERTIA.ravel().tolist()
    mass, full = outputs(vehicle, "mass", "inertia", propellant_mass=8.0)
    assert mass == 28.0
    np.testing.assert_allclose(full, (INERTIA + tank).ravel(), rtol=1e-15)
    flow, step = 0.3, 0.5
    now, rate = outputs(vehicle, "inertia", "inertia_rate", propellant_mass=5.0, mass_flow=flow)
    (later,) = outputs(vehicle, "inertia", propellant_mass=5.0 - flow * step)
    np.testing.assert_allclose(rate, (later - now) / step, rtol=1e-12, atol=1e-15)


def test_an_inertia_is_accepted_if_and_only_if_a_body_can_have_it() -> None:
    """The principal moments of 300 random matrices, from NumPy, say whether."""
    random = np.random.default_rng(3)
    vehicle, accepted = masses(), 0
    for _ in range(300):
        turn = Rotation.random(rng=random).as_matrix()
        moments = np.sort(random.uniform(-0.2, 1.0, 3))
        dry = turn @ np.diag(moments) @ turn.T
        possible = moments[0] > 0.0 and moments[2] <= moments[0] + moments[1]
        vehicle.set("parameters.dry_inertia", np.ravel(0.5 * (dry + dry.T)).tolist())
        try:
            vehicle.init()
            assert possible, moments
            accepted += 1
        except ValueError as reason:
            assert not possible, moments
            wrong = "positive definite" if moments[0] < 0.0 else "that of no body"
            assert wrong in str(reason)
    assert 50 < accepted < 250


def test_a_thin_plate_and_a_point_mass_are_bodies() -> None:
    turn = Rotation.from_rotvec([0.3, -0.8, 0.5]).as_matrix()
    plate = turn @ np.diag([0.1, 0.3, 0.4]) @ turn.T
    rod = turn @ np.diag([0.0, 0.3, 0.3]) @ turn.T
    masses(dry=0.5 * (plate + plate.T), propellant=0.5 * (rod + rod.T))
    masses(propellant=np.zeros((3, 3)))
    with pytest.raises(ValueError, match="parameters.dry_inertia must be positive definite"):
        masses(dry=0.5 * (rod + rod.T))


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"dry_mass": 0.0}, "dry_mass must be positive"),
        ({"full_propellant_mass": -1.0}, "full_propellant_mass must not be negative"),
        ({"dry_inertia": INERTIA + np.eye(3, k=1)}, "dry_inertia must be symmetric"),
        ({"dry_inertia": np.full((3, 3), math.nan)}, "dry_inertia must be symmetric"),
        ({"propellant_inertia": INERTIA + np.eye(3, k=2)}, "propellant_inertia must be symmetric"),
        ({"propellant_inertia": np.diag([1.0, 1.0, 2.1])}, "propellant_inertia is that of no body"),
        ({"propellant_inertia": np.diag([-0.1, 1.0, 1.0])}, "propellant_inertia is that of no body"),
    ],
)
def test_masses_refuse(parameters: dict[str, Any], message: str) -> None:
    valid = {"dry_mass": 1.0, "dry_inertia": INERTIA, "full_propellant_mass": 1.0, "propellant_inertia": INERTIA}
    with pytest.raises(ValueError, match=f"parameters.{message}"):
        model("mass_properties", **(valid | parameters))


# ---- conversions -----------------------------------------------------------------------------------------------------

NED_TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
FRD_TO_FLU = np.diag([1.0, -1.0, -1.0])


@pytest.mark.parametrize(
    ("name", "source", "target", "matrix"),
    [("ned_to_enu", "vector_ned", "vector_enu", NED_TO_ENU), ("frd_to_flu", "vector_frd", "vector_flu", FRD_TO_FLU)],
)
def test_vectors_are_converted_to_the_axes_of_ros(name: str, source: str, target: str, matrix: Vector) -> None:
    (converted,) = outputs(model(name), target, **{source: [1.0, 2.0, 3.0]})
    assert converted.tolist() == (matrix @ [1.0, 2.0, 3.0]).tolist()


def test_vectors_are_turned_into_body_axes_and_out_of_them() -> None:
    random = np.random.default_rng(4)
    into, out_of = model("ned_to_body"), model("body_to_ned")
    for turn in Rotation.random(50, rng=random):
        vector = random.normal(0.0, 100.0, 3)
        (ned,) = outputs(out_of, "vector_ned", attitude_body_to_ned=wxyz(turn), vector_body=vector)
        (body,) = outputs(into, "vector_body", attitude_body_to_ned=wxyz(turn), vector_ned=vector)
        np.testing.assert_allclose(ned, turn.apply(vector), atol=1e-12)
        np.testing.assert_allclose(body, turn.inv().apply(vector), atol=1e-12)


def test_an_attitude_is_converted_to_the_axes_of_ros() -> None:
    conversion = model("attitude_ned_to_enu")
    for turn in Rotation.random(50, rng=np.random.default_rng(5)):
        (enu,) = outputs(conversion, "attitude_body_to_enu", attitude_body_to_ned=wxyz(turn))
        expected = NED_TO_ENU @ turn.as_matrix() @ FRD_TO_FLU
        np.testing.assert_allclose(rotation(enu).as_matrix(), expected, atol=1e-14)
        assert np.linalg.norm(enu) == pytest.approx(1.0, abs=1e-15)
    (north,) = outputs(conversion, "attitude_body_to_enu", attitude_body_to_ned=[1.0, 0.0, 0.0, 0.0])
    np.testing.assert_allclose(
        north, wxyz(Rotation.from_euler("z", 90.0, degrees=True)), atol=1e-15
    )  # to the left of east


def euler(turn: Rotation) -> list[float]:
    """Roll, pitch and yaw by the model."""
    return [
        float(angle)
        for angle in outputs(model("euler_angles"), "roll", "pitch", "yaw", attitude_body_to_ned=wxyz(turn))
    ]


def test_euler_angles_are_those_of_scipy() -> None:
    for turn in Rotation.random(100, rng=np.random.default_rng(6)):
        for sign in (1.0, -1.0):  # both quaternions of one attitude
            angles = outputs(model("euler_angles"), "roll", "pitch", "yaw", attitude_body_to_ned=sign * wxyz(turn))
            np.testing.assert_allclose(angles, turn.as_euler("ZYX")[::-1], atol=1e-12)
    for given in ([3.0, 0.1, -3.0], [-3.1, -1.5, 3.1], [math.pi, 0.0, 0.0], [0.0, 0.0, math.pi]):
        np.testing.assert_allclose(euler(Rotation.from_euler("ZYX", given[::-1])), given, atol=1e-12)


@pytest.mark.parametrize("below", [1e-3, 1e-6, 1e-9, 0.0])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_euler_angles_keep_the_attitude_when_the_nose_is_vertical(below: float, side: float) -> None:
    pitch = side * (0.5 * math.pi - below)
    for roll, yaw in ((0.3, 1.1), (-2.0, 3.0), (3.0, -2.9), (0.0, 0.0)):
        turn = Rotation.from_euler("ZYX", [yaw, pitch, roll])
        angles = euler(turn)
        assert angles[1] == pytest.approx(pitch, abs=1e-15 + 1e-15 / max(below, 1e-1))
        assert (turn.inv() * Rotation.from_euler("ZYX", angles[::-1])).magnitude() < 3e-15
        if below == 0.0:
            assert angles[0] == 0.0


# ---- pendulum --------------------------------------------------------------------------------------------------------

CART = {
    "cart_mass": 1.3,
    "pole_mass": 0.4,
    "pole_length": 0.5,
    "pole_inertia": 0.03,
    "cart_friction": 0.7,
    "pivot_friction": 0.02,
    "gravity": GRAVITY,
    "position": 0.2,
    "angle": 2.5,
}
FREE = CART | {"cart_friction": 0.0, "pivot_friction": 0.0}


def motion_by_multipliers(p: dict[str, float], force: float, x: Sequence[float]) -> list[float]:
    """Lagrange's equations of the first kind: cart and pole as separate bodies in the plane, held by the forces in the pivot."""
    _, angle, speed, rate = x
    m, length = p["pole_mass"], p["pole_length"]
    arm = length * np.array([math.sin(angle), math.cos(angle)])  # from the pivot to the centre of mass, right and up
    mass = np.diag([p["cart_mass"], m, m, p["pole_inertia"]])  # of cart, pole right, pole up, angle
    constraints = np.array([[-1.0, 1.0, 0.0, -arm[1]], [0.0, 0.0, 1.0, arm[0]]])
    forces = [force - p["cart_friction"] * speed, 0.0, -m * p["gravity"], -p["pivot_friction"] * rate]
    system = np.block([[mass, constraints.T], [constraints, np.zeros((2, 2))]])
    solved = np.linalg.solve(system, [*forces, *(-(rate**2) * arm)])
    return [speed, rate, solved[0], solved[3]]


def test_a_pendulum_moves_as_two_bodies_with_a_pivot_do() -> None:
    pendulum = model("inverted_pendulum", **CART)
    assert pendulum.continuous == [0.2, 2.5, 0.0, 0.0]
    random = np.random.default_rng(7)
    for x in random.normal(0.0, 3.0, (100, 4)):
        force = random.normal(0.0, 10.0)
        pendulum.set("inputs.force", force)
        np.testing.assert_allclose(
            pendulum.derivative(0.0, x.tolist()), motion_by_multipliers(CART, force, x), rtol=1e-10, atol=1e-10
        )


def test_a_pendulum_in_a_simulation_goes_where_scipy_goes(fly: Fly) -> None:
    with fly(
        {
            "tick_hz": 100,
            "seed": 1,
            "duration": 5.0,
            "integrator": {"method": "rk4", "hz": 1000},
            "models": {"pendulum": {"source": "inverted_pendulum.c"}},
            "instances": {
                "pendulum": {"model": "pendulum", "parameters": CART | {"angle": 0.4}, "inputs": {"force": 1.5}}
            },
        }
    ) as twin:
        twin.tick(301)
        reached = [twin.get(f"pendulum.outputs.{name}") for name in ("position", "angle", "speed", "angle_rate")]
    start = [CART["position"], 0.4, 0.0, 0.0]
    solution = solve_ivp(
        lambda t, x: motion_by_multipliers(CART, 1.5, x), (0.0, 3.0), start, method="DOP853", rtol=1e-10, atol=1e-10
    )
    np.testing.assert_allclose(reached, solution.y[:, -1], rtol=0.0, atol=1e-7)


@pytest.mark.parametrize(("angle", "sign"), [(math.pi, -1.0), (0.0, 1.0)])
def test_a_pendulum_has_the_frequency_of_its_small_motions(angle: float, sign: float) -> None:
    """w^2 = m g l (M + m) / ((M + m)(I + m l^2) - (m l)^2) hanging; upright, that is the rate of falling over."""
    p = FREE
    m, l, total = p["pole_mass"], p["pole_length"], p["cart_mass"] + p["pole_mass"]  # noqa: E741
    squared = m * GRAVITY * l * total / (total * (p["pole_inertia"] + m * l * l) - (m * l) ** 2)
    pendulum = model("inverted_pendulum", **p)
    step = 1e-5

    def slope(x: Vector) -> list[float]:
        return pendulum.derivative(0.0, x.tolist())

    rates = np.eye(4) * step
    there = np.array([0.0, angle, 0.0, 0.0])
    jacobian = np.array([(np.subtract(slope(there + d), slope(there - d))) / (2 * step) for d in rates]).T
    eigenvalues = np.linalg.eigvals(jacobian)
    fastest = eigenvalues[np.abs(eigenvalues).argmax()]
    assert (fastest**2).real == pytest.approx(sign * squared, rel=1e-7)


def test_a_pendulum_without_friction_keeps_its_energy() -> None:
    pendulum = model("inverted_pendulum", **FREE)
    start = pendulum.continuous
    solution = solve_ivp(
        lambda t, x: pendulum.derivative(t, x.tolist()), (0.0, 5.0), start, method="DOP853", rtol=1e-10, atol=1e-10
    )
    _, angle, speed, rate = solution.y
    right, up = speed + FREE["pole_length"] * rate * np.cos(angle), -FREE["pole_length"] * rate * np.sin(angle)
    energy = 0.5 * FREE["cart_mass"] * speed**2 + 0.5 * FREE["pole_mass"] * (right**2 + up**2)
    energy += 0.5 * FREE["pole_inertia"] * rate**2 + FREE["pole_mass"] * GRAVITY * FREE["pole_length"] * np.cos(angle)
    np.testing.assert_allclose(energy, energy[0], rtol=1e-7)
    assert np.ptp(angle) > 1.0


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("cart_mass", "must be positive"),
        ("pole_mass", "must be positive"),
        ("pole_length", "must be positive"),
        ("pole_inertia", "must not be negative"),
        ("cart_friction", "must not be negative"),
        ("pivot_friction", "must not be negative"),
    ],
)
def test_a_pendulum_refuses(name: str, message: str) -> None:
    for value in (-1.0, math.nan):
        with pytest.raises(ValueError, match=f"parameters.{name} {message}"):
            model("inverted_pendulum", **(CART | {name: value}))


# ---- together --------------------------------------------------------------------------------------------------------


def test_all_of_them_run_in_one_simulation(fly: Fly) -> None:
    """A run tries that functions are pure and that feed-through is declared. The conversions take vectors of any unit."""
    simulation = box(position_inertial=[0.0, 0.0, -0.12], rate_body=[0.1, 0.2, 0.3], yaw=0.5)
    conversions = ("ned_to_enu", "frd_to_flu", "body_to_ned", "ned_to_body", "attitude_ned_to_enu", "euler_angles")
    for name in conversions:
        simulation["models"][name] = {"source": f"{name}.c"}
        simulation["instances"][name] = {"model": name}
    simulation["models"] |= {
        "magnetic": {"source": "magnetic_field_wmm2025.c"},
        "pendulum": {"source": "inverted_pendulum.c"},
    }
    simulation["instances"] |= {
        "magnetic": {"model": "magnetic", "parameters": {"decimal_year": 2026.0}},
        "pendulum": {"model": "pendulum", "parameters": CART},
    }
    simulation["connections"] += [
        {"from": "earth.velocity_ned", "to": "ned_to_enu.vector_ned"},
        {"from": "contact.force_body", "to": "frd_to_flu.vector_frd"},
        {"from": "body.rate_body", "to": "body_to_ned.vector_body"},
        {"from": "magnetic.magnetic_field_ned", "to": "ned_to_body.vector_ned"},
        {"from": "contact.normal_force", "to": "pendulum.force"},
    ]
    simulation["connections"] += [
        {"from": "earth.attitude_body_to_ned", "to": f"{name}.attitude_body_to_ned"} for name in conversions[2:]
    ]
    simulation["connections"] += [
        {"from": f"earth.{name}", "to": f"magnetic.{name}"} for name in ("latitude", "longitude", "height")
    ]
    with fly(simulation) as twin:
        twin.tick(100)
        turn = rotation(np.array(twin.get("earth.outputs.attitude_body_to_ned")))
        place = [twin.get(f"earth.outputs.{name}") for name in ("height", "latitude", "longitude")]
        expected = field(2026.0, 1e-3 * place[0], *np.degrees(place[1:]).tolist())
        body = 1e9 * np.array(twin.get("ned_to_body.outputs.vector_body"))
        np.testing.assert_allclose(body, turn.inv().apply(expected), rtol=1e-9)
        assert twin.get("euler_angles.outputs.yaw") == pytest.approx(turn.as_euler("ZYX")[0], abs=1e-12)
        assert twin.get("pendulum.outputs.speed") > 0.0
