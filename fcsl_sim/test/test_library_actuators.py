# SPDX-License-Identifier: Apache-2.0
"""Models of actuators: against closed forms, conservation laws, and NumPy's and SciPy's solvers."""

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
from scipy.linalg import expm
from scipy.optimize import brentq, fsolve
from scipy.spatial.transform import Rotation
from scipy.special import lambertw

from fcsl_sim.model_instance import ModelInstance
from fcsl_sim.model_list import find_model
from simclient import SimTwin

MODELS = Path(__file__).resolve().parents[1] / "models"
G0 = 9.80665
Vector = NDArray[np.float64]
Rows = dict[str, Vector]
Fly = Callable[..., Rows]
Matrix = list[list[float]]

#: A sine, and the time for which an input has been positive (the instant 0 counts).
TEST_MODELS = {
    "tone": """
#include "fcsl/fcsl_model.h"
typedef struct {
    struct { double amplitude, frequency; } parameters;
    struct { double value; } outputs;
} tone_t;
static void output(void *self, double t, const double *x)
{
    tone_t *tone = self;
    (void)x;
    tone->outputs.value = tone->parameters.amplitude * cr_sin(tone->parameters.frequency * t);
}
static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(tone_t, FCSL_ROLE_PARAMETER, parameters.amplitude, "", ""),
    FCSL_MODEL_SCALAR(tone_t, FCSL_ROLE_PARAMETER, parameters.frequency, "rad/s", ""),
    FCSL_MODEL_SCALAR(tone_t, FCSL_ROLE_OUTPUT, outputs.value, "", ""),
};
static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "tone", .doc = "a sine", .fields = fields,
    .field_count = sizeof fields / sizeof *fields, .size = sizeof(tone_t), .align = _Alignof(tone_t),
    .sampled_offset = FCSL_NO_OFFSET, .output = output,
};
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
""",
    "stopwatch": """
#include "fcsl/fcsl_model.h"
typedef struct {
    struct { double value; } inputs;
    struct { double time; } state;
    struct { double time; } outputs;
} stopwatch_t;
static void derivative(const void *self, double t, const double *x, double *dx)
{
    (void)x;
    dx[0] = ((const stopwatch_t *)self)->inputs.value > 0.0 || t == 0.0 ? 1.0 : 0.0;
}
static void output(void *self, double t, const double *x)
{
    (void)t;
    ((stopwatch_t *)self)->outputs.time = x[0];
}
static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(stopwatch_t, FCSL_ROLE_INPUT, inputs.value, "", ""),
    FCSL_MODEL_SCALAR(stopwatch_t, FCSL_ROLE_OUTPUT, outputs.time, "s", ""),
};
static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION, .name = "stopwatch", .doc = "a stopwatch", .fields = fields,
    .field_count = sizeof fields / sizeof *fields, .size = sizeof(stopwatch_t), .align = _Alignof(stopwatch_t),
    .continuous_offset = offsetof(stopwatch_t, state), .continuous_count = 1, .sampled_offset = FCSL_NO_OFFSET,
    .derivative = derivative, .output = output,
};
const fcsl_model_t *const fcsl_models[] = {&model, NULL};
""",
}

ENGINE: dict[str, Any] = {
    "max_thrust": 2000.0,
    "min_throttle": 0.4,
    "time_constant": 0.05,
    "specific_impulse": 300.0,
    "exit_area": 0.01,
    "direction_body": [2.0, 0.0, 0.0],
    "position_body": [-1.0, 0.0, 0.0],
    "propellant_mass": 10.0,
}
MOTOR: dict[str, Any] = {
    "kv": 96.0,
    "resistance": 0.11,
    "no_load_current": 0.6,
    "inertia": 4e-5,
    "controller_time_constant": 0.01,
    "winding_time_constant": 1e-3,
    "speed": 0.0,
}
ROTOR: dict[str, Any] = {
    "thrust_coefficient": 0.11,
    "torque_coefficient": 0.0065,
    "inflow_coefficient": 0.15,
    "drag_coefficient": 0.02,
    "diameter": 0.254,
    "inertia": 4e-5,
    "direction": 1.0,
    "position_body": [0.2, 0.15, -0.05],
    "axis_body": [0.0, 0.0, -1.0],
    "motor_reacts": False,
}
WHEEL: dict[str, Any] = {
    "axis_body": [1.0, 2.0, -2.0],
    "inertia": 0.01,
    "max_torque": 0.1,
    "max_speed": 50.0,
    "viscous_friction": 2e-4,
    "coulomb_friction": 4e-3,
    "speed": 0.0,
}
SERVO: dict[str, Any] = {
    "natural_frequency": 40.0,
    "damping": 0.6,
    "max_rate": 1e3,
    "min_angle": -0.5,
    "max_angle": 0.5,
    "backlash": 0.0,
    "angle": 0.0,
}
BATTERY: dict[str, Any] = {
    "capacity": 2.2,
    "cells": 4.0,
    "charge": [0.0, 0.1, 0.5, 0.9, 1.0],
    "open_circuit_voltage": [3.2, 3.6, 3.8, 4.05, 4.2],
    "resistance": 4e-3,
    "polarisation_resistance": 3e-3,
    "polarisation_time_constant": 8.0,
    "initial_charge": 0.9,
}
QUADROTOR = {
    "position": [[0.2, 0.15], [-0.2, -0.15], [0.2, -0.15], [-0.2, 0.15]],
    "direction": [1.0, 1.0, -1.0, -1.0],
    "torque_per_thrust": 0.02,
    "max_thrust": 5.0,
    "time_constant": 0.05,
}
DRIVE = {
    "wheel_separation": 0.5,
    "radius_left": 0.1,
    "radius_right": 0.12,
    "max_wheel_speed": 8.0,
    "time_constant": 0.2,
}
GIVEN = {
    "rocket_engine": ENGINE,
    "brushless_motor": MOTOR,
    "rotor": ROTOR,
    "reaction_wheel": WHEEL,
    "servo": SERVO,
    "battery": BATTERY,
    "quadrotor_thrust": QUADROTOR,
    "differential_drive": DRIVE,
}


@cache
def library(name: str) -> Path:
    return find_model(str(MODELS / f"{name}.c")).table().library


def model(name: str, **changes: Any) -> ModelInstance:
    """With the parameters of GIVEN and these, after init. The last value of a table fills its rest."""
    instance = ModelInstance(library(name), name)
    for key, value in (GIVEN[name] | changes).items():
        shape = instance.fields[f"parameters.{key}"].shape
        given = list(value) + [value[-1]] * (shape[0] - len(value)) if shape else value
        given = np.ravel(given).tolist() if len(shape) > 1 else given
        instance.set(f"parameters.{key}", given)
    instance.init()
    return instance


@pytest.fixture(scope="module")
def fly(tmp_path_factory: pytest.TempPathFactory) -> Fly:
    """Flies a simulation of models as a user's own files. Returns `t` (s) and the traced paths, a row for each tick."""
    folder = tmp_path_factory.mktemp("actuators")
    for file in MODELS.glob("*.[ch]"):
        shutil.copy(file, folder)
    for name, text in TEST_MODELS.items():
        (folder / f"{name}.c").write_text(text)

    def run(
        instances: dict[str, Any],
        connections: dict[str, str],
        traced: Sequence[str],
        duration: float,
        events: Sequence[tuple[float, str, float]] = (),
        hz: int = 1000,
        tick_hz: int = 100,
    ) -> Rows:
        config = {
            "tick_hz": tick_hz,
            "seed": 1,
            "duration": duration,
            "integrator": {"method": "rk4", "hz": hz},
            "models": {name: {"source": f"{name}.c"} for name in {i["model"] for i in instances.values()}},
            "instances": instances,
            "connections": [{"from": source, "to": target} for target, source in connections.items()],
            "events": [{"at_s": at, "set": path, "value": value} for at, path, value in events],
        }
        path = folder / "actuators.sim.json"
        path.write_text(json.dumps(config))
        with SimTwin.from_config(path) as twin, twin.trace(*traced) as trace:
            twin.tick(round(duration * tick_hz))
            return {"t": np.asarray(trace.time_s)} | {name: np.asarray(trace[name]) for name in traced}

    return run


def use(name: str, inputs: dict[str, Any] | None = None, **changes: Any) -> dict[str, Any]:
    """An instance with the parameters of GIVEN and these."""
    return {"model": name, "parameters": GIVEN[name] | changes, "inputs": inputs or {}}


def body(inertia: Matrix, **changes: Any) -> dict[str, Any]:
    zero = [0.0, 0.0, 0.0]
    start = {
        "position_inertial": zero,
        "velocity_inertial": zero,
        "rate_body": zero,
        "roll": 0.3,
        "pitch": 0.2,
        "yaw": 0.1,
    }
    inputs = {"mass": 2.0, "inertia": inertia, "force_body": zero}
    return {"model": "rigid_body", "parameters": start | changes, "inputs": inputs}


def in_inertial(rows: Rows, momentum_body: Vector) -> Vector:
    """Vectors of `body`, one for each tick."""
    return Rotation.from_quat(np.roll(rows["body.outputs.attitude_body_to_inertial"], -1, axis=1)).apply(momentum_body)


BODY = ["body.outputs.attitude_body_to_inertial", "body.outputs.rate_body"]
INERTIA: Matrix = [[0.3, 0.02, -0.01], [0.02, 0.5, 0.03], [-0.01, 0.03, 0.6]]

REFUSED = [
    ("rocket_engine", {"max_thrust": -1.0}, "max_thrust must not be negative"),
    ("rocket_engine", {"min_throttle": 1.1}, "min_throttle must be from 0 to 1"),
    ("rocket_engine", {"time_constant": 0.0}, "time_constant must be positive"),
    ("rocket_engine", {"specific_impulse": 0.0}, "specific_impulse must be positive"),
    ("rocket_engine", {"exit_area": math.nan}, "exit_area must not be negative"),
    ("rocket_engine", {"direction_body": [0.0, 0.0, 0.0]}, "direction_body must not be zero"),
    ("rocket_engine", {"propellant_mass": -1.0}, "propellant_mass must not be negative"),
    ("brushless_motor", {"kv": 0.0}, "kv must be positive"),
    ("brushless_motor", {"resistance": 0.0}, "resistance must be positive"),
    ("brushless_motor", {"no_load_current": -0.1}, "no_load_current must not be negative"),
    ("brushless_motor", {"inertia": 0.0}, "inertia must be positive"),
    ("brushless_motor", {"controller_time_constant": 0.0}, "controller_time_constant must be positive"),
    ("brushless_motor", {"winding_time_constant": math.nan}, "winding_time_constant must be positive"),
    ("rotor", {"thrust_coefficient": -0.1}, "thrust_coefficient must not be negative"),
    ("rotor", {"torque_coefficient": -0.1}, "torque_coefficient must not be negative"),
    ("rotor", {"inflow_coefficient": -0.1}, "inflow_coefficient must not be negative"),
    ("rotor", {"drag_coefficient": math.nan}, "drag_coefficient must not be negative"),
    ("rotor", {"diameter": 0.0}, "diameter must be positive"),
    ("rotor", {"inertia": -1e-5}, "inertia must not be negative"),
    ("rotor", {"direction": 0.0}, "direction must be 1 or -1"),
    ("rotor", {"axis_body": [0.0, 0.0, 0.0]}, "axis_body must not be zero"),
    ("reaction_wheel", {"axis_body": [0.0, 0.0, 0.0]}, "axis_body must not be zero"),
    ("reaction_wheel", {"inertia": 0.0}, "inertia must be positive"),
    ("reaction_wheel", {"max_torque": -0.1}, "max_torque must not be negative"),
    ("reaction_wheel", {"max_speed": 0.0}, "max_speed must be positive"),
    ("reaction_wheel", {"viscous_friction": -1.0}, "viscous_friction must not be negative"),
    ("reaction_wheel", {"coulomb_friction": math.nan}, "coulomb_friction must not be negative"),
    ("reaction_wheel", {"speed": -50.1}, "speed must be within max_speed"),
    ("quadrotor_thrust", {"torque_per_thrust": -0.1}, "torque_per_thrust must not be negative"),
    ("quadrotor_thrust", {"max_thrust": 0.0}, "max_thrust must be positive"),
    ("quadrotor_thrust", {"time_constant": math.nan}, "time_constant must be positive"),
    ("quadrotor_thrust", {"direction": [1.0, 1.0, -1.0, 0.0]}, "direction must be 1 or -1 for each rotor"),
    ("quadrotor_thrust", {"thrust": [1.0, 1.0, 1.0, 5.1]}, "thrust must be within 0 and max_thrust"),
    ("differential_drive", {"wheel_separation": 0.0}, "wheel_separation must be positive"),
    ("differential_drive", {"radius_left": -0.1}, "radius_left must be positive"),
    ("differential_drive", {"radius_right": 0.0}, "radius_right must be positive"),
    ("differential_drive", {"max_wheel_speed": -1.0}, "max_wheel_speed must not be negative"),
    ("differential_drive", {"time_constant": 0.0}, "time_constant must be positive"),
    ("servo", {"natural_frequency": 0.0}, "natural_frequency must be positive"),
    ("servo", {"damping": -0.1}, "damping must not be negative"),
    ("servo", {"max_rate": 0.0}, "max_rate must be positive"),
    ("servo", {"min_angle": 0.5}, "min_angle must be below max_angle"),
    ("servo", {"backlash": -0.1}, "backlash must not be negative"),
    ("servo", {"angle": 0.6}, "angle must be from min_angle to max_angle"),
    ("battery", {"capacity": 0.0}, "capacity must be positive"),
    ("battery", {"cells": 0.0}, "cells must be positive"),
    ("battery", {"charge": [0.0, 0.5, 0.4, 1.0]}, "charge must increase from row to row"),
    ("battery", {"resistance": -1.0}, "resistance must not be negative"),
    ("battery", {"polarisation_resistance": -1.0}, "polarisation_resistance must not be negative"),
    ("battery", {"polarisation_time_constant": 0.0}, "polarisation_time_constant must be positive"),
    ("battery", {"initial_charge": 1.1}, "initial_charge must be from 0 to 1"),
]


@pytest.mark.parametrize(("name", "changes", "reason"), REFUSED)
def test_wrong_parameters_are_refused(name: str, changes: dict[str, Any], reason: str) -> None:
    with pytest.raises(ValueError, match=rf"^parameters\.{reason}$"):
        model(name, **changes)


# ---- rocket engine ---------------------------------------------------------------------------------------------------


def test_an_engine_follows_its_throttle_with_a_lag(fly: Fly) -> None:
    """Closed forms of a lag of first order. Below its least throttle the engine is off, above 1 it does what it can."""
    instances = {
        "engine": use("rocket_engine", {"throttle": 0.7}),
        "idle": use("rocket_engine", {"throttle": 0.39}),
        "full": use("rocket_engine", {"throttle": 7.0}),
    }
    traced = ["engine.outputs.thrust", "engine.outputs.mass_flow", "idle.outputs.thrust", "full.outputs.thrust"]
    rows = fly(instances, {}, traced, 0.4, [(0.2, "engine.inputs.throttle", 0.2)])
    t = rows["t"]
    up = 0.7 * (1.0 - np.exp(-np.minimum(t, 0.2) / 0.05))
    level = up * np.exp(-np.maximum(t - 0.2, 0.0) / 0.05)
    assert rows["engine.outputs.thrust"] == pytest.approx(2000.0 * level, abs=1e-5)
    assert rows["engine.outputs.mass_flow"] == pytest.approx(2000.0 * level / (300.0 * G0), abs=1e-8)
    assert (rows["idle.outputs.thrust"] == 0.0).all()
    assert rows["full.outputs.thrust"] == pytest.approx(2000.0 * (1.0 - np.exp(-t / 0.05)), abs=1e-5)


def test_an_engine_pushes_where_it_is_and_against_the_air() -> None:
    """Specific impulse at sea level by the pressure on the exit; never below zero."""
    direction, position = np.array([3.0, -0.4, 0.2]), np.array([-1.2, 0.1, 0.05])
    engine = model("rocket_engine", direction_body=direction, position_body=position)
    for pressure, throttle, thrust in ((0.0, 1.0, 2000.0), (101325.0, 0.9, 1800.0 - 1013.25), (101325.0, 0.5, 0.0)):
        engine.set("inputs.pressure", pressure)
        engine.output(0.0, [throttle, 5.0])
        force = thrust * direction / np.linalg.norm(direction)
        assert engine.get("outputs.thrust") == pytest.approx(thrust)
        assert engine.get("outputs.force_body") == pytest.approx(force)
        assert engine.get("outputs.torque_body") == pytest.approx(np.cross(position, force))
        assert engine.get("outputs.mass_flow") == pytest.approx(2000.0 * throttle / (300.0 * G0))


@pytest.mark.parametrize("throttle", [1.0, 0.5])
def test_a_rocket_gains_the_speed_of_tsiolkovsky_until_its_burnout(throttle: float, fly: Fly) -> None:
    """Whatever the lag. The burn time T solves T - tau (1 - exp(-T / tau)) = full, by Lambert's W function."""
    zero = np.zeros((3, 3)).tolist()
    vehicle = {"dry_mass": 30.0, "dry_inertia": INERTIA, "full_propellant_mass": 10.0, "propellant_inertia": zero}
    instances = {
        "engine": use("rocket_engine", {"throttle": throttle}),
        "masses": {"model": "mass_properties", "parameters": vehicle},
        "body": body(INERTIA, roll=0.0, pitch=0.0, yaw=0.0),
        "watch": {"model": "stopwatch"},
    }
    instances["body"]["inputs"] = {}
    connections = {
        "masses.propellant_mass": "engine.propellant_mass",
        "masses.mass_flow": "engine.mass_flow",
        "body.mass": "masses.mass",
        "body.inertia": "masses.inertia",
        "body.force_body": "engine.force_body",
        "body.torque_body": "engine.torque_body",
        "watch.value": "engine.mass_flow",
    }
    names = ["engine.outputs.propellant_mass", "engine.outputs.thrust", "engine.outputs.burnt_out"]
    traced = [*names, "body.outputs.velocity_inertial", "watch.outputs.time"]
    full = 10.0 * 300.0 * G0 / 2000.0 / throttle  # at constant flow
    tau = 0.05
    burn = full + tau + tau * lambertw(-math.exp(-(full + tau) / tau)).real
    rows = fly(instances, connections, traced, math.ceil(burn) + 1.0)
    assert rows["watch.outputs.time"][-1] == pytest.approx(burn, abs=3e-9)
    speed = 300.0 * G0 * math.log(40.0 / 30.0)
    assert rows["body.outputs.velocity_inertial"][-1] == pytest.approx([speed, 0.0, 0.0], rel=1e-9)
    after = rows["t"] > burn
    assert (rows["engine.outputs.burnt_out"] == after).all()
    assert (rows["engine.outputs.propellant_mass"][after] == 0.0).all()
    assert (rows["engine.outputs.thrust"][after] == 0.0).all()
    assert (rows["engine.outputs.thrust"][1:][~after[1:]] > 0.0).all()


# ---- motor -----------------------------------------------------------------------------------------------------------


def linear_motor() -> tuple[Vector, Vector, Callable[[float, float], Vector]]:
    """d/dt (speed, duty, current) = A x + b while current flows, at 15 V; b of throttle and load torque."""
    p, kt, voltage = MOTOR, 1.0 / MOTOR["kv"], 15.0
    winding, resistance, inertia = p["winding_time_constant"], p["resistance"], p["inertia"]
    a = np.array(
        [
            [0.0, 0.0, kt / inertia],
            [0.0, -1.0 / p["controller_time_constant"], 0.0],
            [-kt / resistance / winding, voltage / resistance / winding, -1.0 / winding],
        ]
    )

    def forced(throttle: float, load: float) -> Vector:
        lost = -(kt * p["no_load_current"] + load) / inertia
        return np.array([lost, throttle / p["controller_time_constant"], 0.0])

    return a, np.linalg.eigvals(a), forced


def test_a_motor_runs_at_the_speed_of_its_load(fly: Fly) -> None:
    """Drela: speed = kv (duty voltage - resistance i), i = no_load_current + kv load. A converter draws duty i."""
    load, throttle, voltage = 0.08, 0.6, 15.0
    motor = use("brushless_motor", {"throttle": throttle, "voltage": voltage, "load_torque": load}, speed=700.0)
    names = ["motor.outputs.speed", "motor.outputs.current", "motor.outputs.torque"]
    rows = fly({"motor": motor}, {}, names, 1.0, hz=5000)
    current = MOTOR["no_load_current"] + MOTOR["kv"] * load
    speed = MOTOR["kv"] * (throttle * voltage - MOTOR["resistance"] * current)
    assert [rows[name][-1] for name in names] == pytest.approx([speed, throttle * current, load], rel=1e-9)


def test_a_motor_answers_small_steps_as_its_linear_model(fly: Fly) -> None:
    """SciPy's matrix exponential, whose slowest mode is near resistance inertia kv^2."""
    load = 0.08
    a, modes, forced = linear_motor()
    start = np.linalg.solve(a, -forced(0.6, load))
    motor = use("brushless_motor", {"throttle": 0.6, "voltage": 15.0, "load_torque": load}, speed=start[0])
    names = ["motor.outputs.speed", "motor.outputs.current", "motor.outputs.torque"]
    rows = fly({"motor": motor}, {}, names, 1.2, [(1.0, "motor.inputs.throttle", 0.63)], 5000)
    end = np.linalg.solve(a, -forced(0.63, load))
    for row in range(100, 120):
        x = end + expm(a * (rows["t"][row] - 1.0)) @ (start - end)
        torque = (x[2] - MOTOR["no_load_current"]) / MOTOR["kv"]
        assert [rows[name][row] for name in names] == pytest.approx([x[0], x[1] * x[2], torque], rel=1e-7)
    mechanical = MOTOR["resistance"] * MOTOR["inertia"] * MOTOR["kv"] ** 2
    assert -1.0 / modes.real.max() == pytest.approx(mechanical, rel=0.05)


def test_a_motor_without_throttle_draws_nothing_and_comes_to_rest(fly: Fly) -> None:
    """Friction alone: the speed falls linearly, below 10 rad/s exponentially. No current ever flows back."""
    motor = use("brushless_motor", {"throttle": 0.8, "voltage": 15.0})
    names = ["motor.outputs.speed", "motor.outputs.current"]
    rows = fly({"motor": motor}, {}, names, 16.0, [(0.5, "motor.inputs.throttle", 0.0)])
    t, speed, current = rows["t"], *(rows[name] for name in names)
    assert (current >= 0.0).all() and (speed >= 0.0).all()
    slope = MOTOR["no_load_current"] / MOTOR["kv"] / MOTOR["inertia"]
    i = int(np.searchsorted(t, 1.0))
    assert current[i:].max() < 1e-9
    rest = t[i] + (speed[i] - 10.0) / slope  # from here on exponentially
    expected = np.where(t < rest, speed[i] - slope * (t - t[i]), 10.0 * np.exp(-slope / 10.0 * (t - rest)))
    assert speed[i:] == pytest.approx(expected[i:], abs=1e-4)
    assert rest < 8.0 and speed[-1] < 1e-3
    alone = model("brushless_motor")
    alone.output(0.0, [100.0, 0.1, -1e-6])
    assert alone.get("outputs.current") == 0.0


# ---- rotor -----------------------------------------------------------------------------------------------------------


def rotor_outputs(inputs: dict[str, Any], **changes: Any) -> dict[str, Vector]:
    rotor = model("rotor", **changes)
    for name, value in ({"density": 1.2} | inputs).items():
        rotor.set(f"inputs.{name}", np.ravel(value).tolist() if np.ndim(value) else value)
    rotor.output()
    names = ("force_body", "torque_body", "thrust", "load_torque")
    return {name: np.array(rotor.get(f"outputs.{name}")) for name in names}


@pytest.mark.parametrize("speed", [500.0, -300.0, 0.0])
def test_a_rotor_that_hovers_has_the_thrust_and_torque_of_its_coefficients(speed: float) -> None:
    """T = Ct rho n^2 D^4, Q = Cq rho n^2 D^5. To the left, seen from above, it turns the body to the right."""
    n = speed / (2.0 * math.pi)
    thrust = 0.11 * 1.2 * n * abs(n) * 0.254**4
    torque = 0.0065 * 1.2 * n * abs(n) * 0.254**5
    for direction in (1.0, -1.0):
        y = rotor_outputs({"speed": speed}, direction=direction)
        assert y["force_body"] == pytest.approx([0.0, 0.0, -thrust])
        assert y["load_torque"] == pytest.approx(torque)
        assert y["torque_body"] == pytest.approx([-0.15 * thrust, 0.2 * thrust, direction * torque])


def test_a_quadrotor_that_hovers_has_no_torque() -> None:
    places = [([0.2, 0.2, 0.0], 1.0), ([-0.2, -0.2, 0.0], 1.0), ([0.2, -0.2, 0.0], -1.0), ([-0.2, 0.2, 0.0], -1.0)]
    torques = [
        rotor_outputs({"speed": 500.0}, position_body=position, direction=direction)["torque_body"]
        for position, direction in places
    ]
    assert sum(torques) == pytest.approx([0.0, 0.0, 0.0], abs=1e-15)
    assert np.abs(torques).min() > 0.01


def test_a_rotor_moves_through_the_air() -> None:
    """Thrust is gone at the advance ratio Ct / Ci of the hub; drag is against its velocity across the axis."""
    n, diameter = 100.0, 0.254
    speed = 2.0 * math.pi * n
    climb = 0.11 / 0.15 * n * diameter
    hover = rotor_outputs({"speed": speed})["thrust"]
    assert rotor_outputs({"speed": speed, "velocity_air_body": [0.0, 0.0, -climb]})["thrust"] == pytest.approx(
        0.0, abs=1e-9
    )
    half = rotor_outputs({"speed": speed, "velocity_air_body": [0.0, 0.0, -climb / 2.0]})["thrust"]
    assert half == pytest.approx(hover / 2.0)
    drag = 0.02 * 1.2 * n * diameter**3
    moved = rotor_outputs({"speed": speed, "velocity_air_body": [3.0, -4.0, 0.0]})
    assert moved["force_body"] == pytest.approx([-3.0 * drag, 4.0 * drag, -hover])
    slower = rotor_outputs({"speed": speed / 2.0, "velocity_air_body": [3.0, -4.0, 0.0]})
    assert slower["force_body"][:2] == pytest.approx([-1.5 * drag, 2.0 * drag])
    climbing = rotor_outputs({"speed": speed, "velocity_air_body": [3.0, -4.0, -climb / 2.0]})
    assert climbing["force_body"] == pytest.approx([-3.0 * drag, 4.0 * drag, -hover / 2.0])
    turning = rotor_outputs(
        {"speed": speed, "rate_body": [0.0, 0.0, 2.0]}
    )  # the hub at (0.2, 0.15) moves by (-0.3, 0.4)
    assert turning["force_body"] == pytest.approx([0.3 * drag, -0.4 * drag, -hover])


def test_a_rotor_looks_the_same_from_every_side() -> None:
    """Turned as a whole with its air, it has the same forces and torques, turned."""
    random = np.random.default_rng(7)
    wind, rate, place = random.normal(size=(3, 3))
    wind *= 5.0
    axis = np.array([0.1, -0.3, -1.0])
    inputs = {"speed": 600.0, "motor_torque": 0.05}
    for motor_reacts in (False, True):
        y = rotor_outputs(
            inputs | {"velocity_air_body": wind, "rate_body": rate},
            axis_body=axis,
            position_body=place,
            motor_reacts=motor_reacts,
        )
        for turn in Rotation.random(5, random):
            z = rotor_outputs(
                inputs | {"velocity_air_body": turn.apply(wind), "rate_body": turn.apply(rate)},
                axis_body=3.0 * turn.apply(axis),
                position_body=turn.apply(place),
                motor_reacts=motor_reacts,
            )
            assert z["force_body"] == pytest.approx(turn.apply(y["force_body"]), abs=1e-12)
            assert z["torque_body"] == pytest.approx(turn.apply(y["torque_body"]), abs=1e-12)


@pytest.mark.parametrize("direction", [1.0, -1.0])
def test_a_motor_spins_its_rotor_up_against_the_body(direction: float, fly: Fly) -> None:
    """Without air their angular momentum is conserved in the inertial frame, whatever the motor does."""
    axis, rate = np.array([0.0, 0.6, -0.8]), np.array([0.4, -0.2, 0.3])
    inertia = 2e-4
    instances = {
        "motor": use("brushless_motor", {"voltage": 15.0, "throttle": 1.0}, inertia=inertia),
        "rotor": use("rotor", {"density": 0.0}, inertia=inertia, axis_body=axis.tolist(), direction=direction)
        | {"model": "rotor"},
        "body": body((0.01 * np.array(INERTIA)).tolist(), rate_body=rate.tolist()),
    }
    instances["rotor"]["parameters"]["motor_reacts"] = True
    connections = {
        "rotor.speed": "motor.speed",
        "rotor.motor_torque": "motor.torque",
        "rotor.rate_body": "body.rate_body",
        "motor.load_torque": "rotor.load_torque",
        "body.torque_body": "rotor.torque_body",
    }
    traced = [*BODY, "motor.outputs.speed"]
    rows = fly(instances, connections, traced, 1.0, [(0.5, "motor.inputs.throttle", 0.0)], 5000)
    spin = direction * inertia * rows["motor.outputs.speed"][:, None] * axis
    momentum = in_inertial(rows, rows["body.outputs.rate_body"] @ (0.01 * np.array(INERTIA)) + spin)
    assert np.linalg.norm(spin, axis=1).max() > 20.0 * np.linalg.norm(momentum[0])
    assert momentum == pytest.approx(np.broadcast_to(momentum[0], momentum.shape), abs=1e-8)


# ---- reaction wheel --------------------------------------------------------------------------------------------------


def test_a_wheel_and_its_body_keep_their_angular_momentum(fly: Fly) -> None:
    """In the inertial frame, while the wheel turns back, sticks, breaks away, and is held at its limits."""
    instances = {
        "tone": {"model": "tone", "parameters": {"amplitude": 0.2, "frequency": 0.7}},
        "wheel": use("reaction_wheel", max_speed=9.0, speed=-3.0, coulomb_friction=0.02),
        "body": body(INERTIA, rate_body=[0.1, 0.3, -0.2]),
    }
    connections = {
        "wheel.torque_command": "tone.value",
        "wheel.rate_body": "body.rate_body",
        "body.torque_body": "wheel.torque_body",
    }
    traced = [*BODY, "wheel.outputs.speed", "wheel.outputs.momentum", "wheel.outputs.saturated"]
    rows = fly(instances, connections, traced, 20.0)
    speed = rows["wheel.outputs.speed"]
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    assert rows["wheel.outputs.momentum"] == pytest.approx(0.01 * speed)
    momentum = rows["body.outputs.rate_body"] @ np.array(INERTIA) + rows["wheel.outputs.momentum"][:, None] * axis
    assert in_inertial(rows, momentum) == pytest.approx(
        np.broadcast_to(in_inertial(rows, momentum)[0], momentum.shape), abs=1e-9
    )
    assert speed.min() == -9.0 and speed.max() == 9.0
    assert (rows["wheel.outputs.saturated"] == (abs(speed) == 9.0)).all()
    assert np.ptp(rows["body.outputs.rate_body"], axis=0).min() > 0.05


def test_a_wheel_spins_down_by_its_friction_and_stays_at_rest(fly: Fly) -> None:
    """b w + c = (b w0 + c) exp(-b t / I), until that is c. A command below the friction moves nothing."""
    b, c, inertia, start = 2e-4, 4e-3, 0.01, 40.0
    stop = inertia / b * math.log(1.0 + b * start / c)
    events = [(60.0, "wheel.inputs.torque_command", 0.003), (61.0, "wheel.inputs.torque_command", -0.005)]
    for sign in (1.0, -1.0):
        wheel = use("reaction_wheel", {"torque_command": 0.0}, speed=sign * start)
        rows = fly(
            {"wheel": wheel},
            {},
            ["wheel.outputs.speed", "wheel.outputs.torque_body"],
            62.0,
            [(at, path, sign * value) for at, path, value in events],
        )
        t, speed = rows["t"], sign * rows["wheel.outputs.speed"]
        slides = t < stop
        assert speed[slides] == pytest.approx((start + c / b) * np.exp(-b * t[slides] / inertia) - c / b, abs=1e-9)
        assert (speed[~slides & (t <= 61.0)] == 0.0).all() and 50.0 < stop < 60.0
        moves = t > 61.0
        forward = (0.005 - c) / b * (1.0 - np.exp(-b * (t[moves] - 61.0) / inertia))
        assert speed[moves] == pytest.approx(-forward, abs=1e-9)
        axis = np.array([1.0, 2.0, -2.0]) / 3.0
        assert rows["wheel.outputs.torque_body"][0] == pytest.approx(sign * (b * start + c) * axis)
        assert (rows["wheel.outputs.torque_body"][-200] == 0.0).all()


def test_a_wheel_breaks_away_with_the_command() -> None:
    """At the instant at which the command exceeds the friction, before the event is handled."""
    axis = np.array([1.0, 2.0, -2.0]) / 3.0
    wheel = model("reaction_wheel")
    for command, torque in ((0.03, 0.026), (-0.03, -0.026), (0.004, 0.0), (-0.004, 0.0), (-7.0, -0.096)):
        wheel.set("inputs.torque_command", command)
        wheel.output(0.0, [0.0])
        assert wheel.get("outputs.torque_body") == pytest.approx(-torque * axis)
        assert wheel.derivative(0.0, [0.0]) == pytest.approx([torque / 0.01])


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_wheel_turns_back_through_zero_against_its_friction(sign: float, fly: Fly) -> None:
    """Two closed forms: friction helps to slow it, then is against the drive. From rest, the second one."""
    b, c, inertia, start, torque = 2e-4, 4e-3, 0.01, 5.0, 0.03
    wheels = {
        "wheel": use("reaction_wheel", {"torque_command": -sign * torque}, speed=sign * start),
        "rest": use("reaction_wheel", {"torque_command": -sign * torque}),
    }
    rows = fly(wheels, {}, ["wheel.outputs.speed", "rest.outputs.speed"], 4.0)
    t = rows["t"]
    turns = inertia / b * math.log(1.0 + b * start / (torque + c))
    slows = (start + (torque + c) / b) * np.exp(-b * t / inertia) - (torque + c) / b
    end = (torque - c) / b
    back = -end * (1.0 - np.exp(-b * (t - turns) / inertia))
    assert sign * rows["wheel.outputs.speed"] == pytest.approx(np.where(t < turns, slows, back), abs=1e-8)
    assert sign * rows["rest.outputs.speed"] == pytest.approx(-end * (1.0 - np.exp(-b * t / inertia)), abs=1e-7)
    assert 1.0 < turns < 2.0


def test_a_wheel_is_held_at_its_limits_of_torque_and_speed(fly: Fly) -> None:
    """Without friction: a ramp up to the limit, where the torque is 0, and down from the instant of the reversal."""
    wheel = use("reaction_wheel", {"torque_command": 3.0}, viscous_friction=0.0, coulomb_friction=0.0)
    events = [(7.003, "wheel.inputs.torque_command", -0.05)]
    traced = ["wheel.outputs.speed", "wheel.outputs.saturated", "wheel.outputs.torque_body"]
    rows = fly({"wheel": wheel}, {}, traced, 30.0, events)
    t, speed = rows["t"], rows["wheel.outputs.speed"]
    up = np.minimum(0.1 * t / 0.01, 50.0)
    assert speed == pytest.approx(np.maximum(np.where(t < 7.003, up, 50.0 - 5.0 * (t - 7.003)), -50.0), abs=1e-6)
    held = (t > 5.0) & (t < 7.003) | (t > 27.003)
    assert (rows["wheel.outputs.saturated"] == held).all()
    assert (rows["wheel.outputs.torque_body"][held] == 0.0).all()
    assert (abs(speed) <= 50.0).all()


def test_a_wheel_at_its_limit_is_slowed_by_friction_that_its_drive_does_not_balance(fly: Fly) -> None:
    """w = (torque - c) / b + (limit - that) exp(-b t / I), once the command is below the friction at the limit."""
    b, c, inertia = 2e-4, 4e-3, 0.01
    wheel = use("reaction_wheel", {"torque_command": 0.1}, speed=49.0)
    rows = fly({"wheel": wheel}, {}, ["wheel.outputs.speed"], 3.0, [(1.0, "wheel.inputs.torque_command", 0.01)])
    t, speed = rows["t"], rows["wheel.outputs.speed"]
    end = (0.01 - c) / b
    assert (speed[(t > 0.5) & (t <= 1.0)] == 50.0).all()
    assert speed[t >= 1.0] == pytest.approx(end + (50.0 - end) * np.exp(-b * (t[t >= 1.0] - 1.0) / inertia), abs=1e-9)


# ---- servo -----------------------------------------------------------------------------------------------------------


def oscillator(t: Vector | float, angle: float, rate: float, damping: float = 0.6, frequency: float = 40.0) -> Any:
    """Angle and rate of a free oscillator, by the closed form of its three cases."""
    if damping == 1.0:
        c = rate + frequency * angle
        decay = np.exp(-frequency * t)
        return decay * (angle + c * t), decay * (c - frequency * (angle + c * t))
    roots = np.roots([1.0, 2.0 * damping * frequency, frequency**2]).astype(complex)
    first = (rate - roots[1] * angle) / (roots[0] - roots[1])
    second = angle - first
    modes = first * np.exp(roots[0] * t), second * np.exp(roots[1] * t)
    return (modes[0] + modes[1]).real, (roots[0] * modes[0] + roots[1] * modes[1]).real


SERVO_OUTPUTS = ["servo.outputs.angle", "servo.outputs.rate"]


@pytest.mark.parametrize("damping", [0.0, 0.6, 1.0, 1.7])
def test_a_servo_is_a_second_order_lag(damping: float, fly: Fly) -> None:
    rows = fly({"servo": use("servo", {"command": 0.2}, damping=damping, angle=-0.1)}, {}, SERVO_OUTPUTS, 0.5)
    angle, rate = oscillator(rows["t"], -0.3, 0.0, damping)
    assert rows["servo.outputs.angle"] == pytest.approx(0.2 + angle, abs=2e-7)
    assert rows["servo.outputs.rate"] == pytest.approx(rate, abs=1e-5)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_servo_moves_at_its_maximum_rate_in_between(sign: float, fly: Fly) -> None:
    """Three closed forms: the lag up to the limit, a ramp, and the lag from the angle at which it would slow down."""
    w, damping, limit, target = 40.0, 0.6, 2.0, 0.45
    servo = use("servo", {"command": sign * target}, max_rate=limit, min_angle=-1.0, max_angle=1.0)
    rows = fly({"servo": servo}, {}, SERVO_OUTPUTS, 0.6, tick_hz=1000)
    reaches = brentq(lambda t: oscillator(t, -target, 0.0)[1] - limit, 0.0, 0.01)
    at = target + oscillator(reaches, -target, 0.0)[0]
    leaves = reaches + (target - 2.0 * damping * limit / w - at) / limit
    t = rows["t"]
    first, second = oscillator(t, -target, 0.0), oscillator(t - leaves, -2.0 * damping * limit / w, limit)
    angle = np.select([t < reaches, t < leaves], [target + first[0], at + limit * (t - reaches)], target + second[0])
    rate = np.select([t < reaches, t < leaves], [first[1], np.full_like(t, limit)], second[1])
    assert leaves - reaches > 0.1
    assert sign * rows["servo.outputs.angle"] == pytest.approx(angle, abs=2e-8)
    assert sign * rows["servo.outputs.rate"] == pytest.approx(rate, abs=1e-6)
    assert (abs(rows["servo.outputs.rate"]) <= limit).all()


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_servo_stops_at_the_end_of_its_travel(sign: float, fly: Fly) -> None:
    """A command beyond counts as the end, and an overshoot stops there: from the stop on, the lag starts anew."""
    servo = use("servo", {"command": sign * 0.9}, damping=0.2)
    rows = fly({"servo": servo}, {}, SERVO_OUTPUTS, 1.5, [(0.5, "servo.inputs.command", sign * 0.47)])
    t, angle, rate = rows["t"], *(sign * rows[name] for name in SERVO_OUTPUTS)
    reaches = brentq(lambda at: oscillator(at, -0.5, 0.0, 0.2)[0], 0.02, 0.06)
    expected = np.where(t < reaches, 0.5 + oscillator(t, -0.5, 0.0, 0.2)[0], 0.5)
    expected = np.where(t < 0.5, expected, 0.47 + oscillator(t - 0.5, 0.03, 0.0, 0.2)[0])
    assert angle == pytest.approx(expected, abs=1e-6)
    assert (angle[(t > reaches) & (t <= 0.5)] == 0.5).all() and (rate[(t > reaches) & (t < 0.5)] == 0.0).all()
    assert angle.max() == 0.5

    # An overshoot of a command within the travel hits the stop, and goes back from there with no rate.
    rows = fly({"servo": use("servo", {"command": sign * 0.48}, damping=0.2)}, {}, SERVO_OUTPUTS, 1.0, tick_hz=1000)
    t, angle = rows["t"], sign * rows["servo.outputs.angle"]
    hits = brentq(lambda at: oscillator(at, -0.48, 0.0, 0.2)[0] - 0.02, 0.02, 0.06)
    expected = np.where(t < hits, oscillator(t, -0.48, 0.0, 0.2)[0], oscillator(t - hits, 0.02, 0.0, 0.2)[0])
    assert angle == pytest.approx(0.48 + expected, abs=1e-6)
    assert angle.max() <= 0.5


def test_a_servo_that_stops_is_not_at_its_rate_limit() -> None:
    """Also where both happen at once: the stop is handled first."""
    servo = model("servo", max_rate=6.0)
    stop, rate_limit = (
        next(i for i, event in enumerate(servo.events) if event.name == name) for name in ("stop", "rate_limit")
    )
    servo.continuous = [0.51, 6.1]
    servo.set("state.limited", 1)
    servo.reset(stop)
    assert servo.continuous == [0.5, 0.0] and servo.get("state.limited") == 0
    servo.reset(rate_limit)
    assert servo.continuous == [0.5, 0.0] and servo.get("state.limited") == 0
    servo.continuous = [0.1, -6.1]
    servo.reset(rate_limit)
    assert servo.continuous == [0.1, -6.0] and servo.get("state.limited") == -1


def play(angle: Vector, width: float) -> Vector:
    """The play operator on samples."""
    moved = np.empty_like(angle)
    at = angle[0]
    for i, value in enumerate(angle):
        at = min(max(at, value - width / 2.0), value + width / 2.0)
        moved[i] = at
    return moved


@pytest.mark.parametrize("width", [0.1, 0.02, 1e-6])
def test_the_backlash_of_a_servo_is_the_play_operator(width: float, fly: Fly) -> None:
    """Of the angle of a servo without. Samples miss extremes of that by at most rate' dt^2 / 8, or 0.3 9^2 dt^2 / 8."""
    instances = {
        "tone": {"model": "tone", "parameters": {"amplitude": 0.3, "frequency": 9.0}},
        "servo": use("servo", {}, backlash=width),
        "ideal": use("servo", {}),
    }
    connections = {"servo.command": "tone.value", "ideal.command": "tone.value"}
    rows = fly(instances, connections, [*SERVO_OUTPUTS, "ideal.outputs.angle", "ideal.outputs.rate"], 2.0, tick_hz=1000)
    ideal = rows["ideal.outputs.angle"]
    expected = play(ideal, width)
    assert rows["servo.outputs.angle"] == pytest.approx(expected, abs=0.3 * 81.0 * 1e-6 / 8.0)
    moves = rows["servo.outputs.rate"] != 0.0
    assert (rows["servo.outputs.rate"][moves] == rows["ideal.outputs.rate"][moves]).all()
    up, down = moves & (rows["servo.outputs.rate"] > 0.0), moves & (rows["servo.outputs.rate"] < 0.0)
    lag = ideal - rows["servo.outputs.angle"]
    assert lag[up] == pytest.approx(np.full(up.sum(), width / 2.0), abs=1e-12)
    assert lag[down] == pytest.approx(np.full(down.sum(), -width / 2.0), abs=1e-12)
    assert up.sum() > 500 and down.sum() > 500 and (~moves).sum() > 1000.0 * width


def test_a_servo_with_everything_keeps_its_limits_for_long(fly: Fly) -> None:
    """Rate limit, stops and backlash at once, and then rest: no chattering."""
    instances = {
        "tone": {"model": "tone", "parameters": {"amplitude": 0.8, "frequency": 25.0}},
        "servo": use("servo", {}, damping=0.1, max_rate=6.0, backlash=0.01),
        "rest": use("servo", {"command": 0.3}, damping=0.05, max_rate=6.0, backlash=1e-9),
    }
    traced = [*SERVO_OUTPUTS, "rest.outputs.angle"]
    rows = fly(instances, {"servo.command": "tone.value"}, traced, 40.0)
    assert (abs(rows["servo.outputs.angle"]) <= 0.495 + 1e-12).all()
    assert (abs(rows["servo.outputs.rate"]) <= 6.0).all()
    assert rows["servo.outputs.angle"].max() > 0.49
    assert rows["rest.outputs.angle"][-1] == pytest.approx(0.3, abs=1e-9)


# ---- battery ---------------------------------------------------------------------------------------------------------

BATTERY_OUTPUTS = ["battery.outputs.voltage", "battery.outputs.charge"]


def test_a_battery_discharges_and_recovers_by_its_closed_form(fly: Fly) -> None:
    """20 A in three parts for 100 s: charge by counting, the RC pair by exp; then none."""
    battery = use("battery", {"current": 12.0, "current_2": 5.0, "current_8": 3.0})
    events = [(100.0, f"battery.inputs.{name}", 0.0) for name in ("current", "current_2", "current_8")]
    rows = fly({"battery": battery}, {}, BATTERY_OUTPUTS, 150.0, events, hz=100, tick_hz=10)
    t = rows["t"]
    current = np.where(t < 100.0, 20.0, 0.0)
    charge = 0.9 - 20.0 * np.minimum(t, 100.0) / 3600.0 / 2.2
    over = 0.06 * (1.0 - np.exp(-np.minimum(t, 100.0) / 8.0)) * np.exp(-np.maximum(t - 100.0, 0.0) / 8.0)
    table = np.interp(charge, BATTERY["charge"], BATTERY["open_circuit_voltage"])
    assert rows["battery.outputs.charge"] == pytest.approx(charge, abs=1e-12)
    assert rows["battery.outputs.voltage"] == pytest.approx(4.0 * (table - over - 0.004 * current), abs=1e-9)


def test_a_battery_ends_at_empty_and_at_full(fly: Fly) -> None:
    """36 A from 2.2 Ah take 22 s from 0.1 to 0; then there is no voltage, until it is charged, which ends at 1."""
    events = [(40.0, "battery.inputs.current", -36.0), (300.0, "battery.inputs.current", 36.0)]
    rows = fly(
        {"battery": use("battery", {"current": 36.0}, initial_charge=0.1)},
        {},
        BATTERY_OUTPUTS,
        310.0,
        events,
        hz=100,
        tick_hz=10,
    )
    t, voltage, charge = rows["t"], *(rows[name] for name in BATTERY_OUTPUTS)
    expected = np.clip(0.1 - t / 220.0, 0.0, 1.0)
    expected = np.where(t > 40.0, np.clip((t - 40.0) / 220.0, 0.0, 1.0), expected)
    expected = np.where(t > 300.0, 1.0 - (t - 300.0) / 220.0, expected)
    assert charge == pytest.approx(expected, abs=1e-9)
    assert ((voltage == 0.0) == ((t > 22.0) & (t <= 40.0))).all()
    assert charge.min() == 0.0 and charge.max() == 1.0


def test_the_voltage_of_a_battery_is_not_negative() -> None:
    battery = model("battery")
    battery.set("inputs.current", 1e4)
    battery.output(0.0, [0.5, 0.0])
    assert battery.get("outputs.voltage") == 0.0


# ---- all together ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("motors", [1, 4])
def test_battery_motors_and_rotors_come_to_rest_where_scipy_says(motors: int, fly: Fly) -> None:
    """Unknown: voltage, speed and current of the windings. The battery is so large that its charge stays."""
    throttle, density = 0.7, 1.2
    instances = {"battery": use("battery", {}, capacity=1e9, polarisation_time_constant=0.1)}
    connections: dict[str, str] = {}
    for i in range(motors):
        instances[f"motor{i}"] = use("brushless_motor", {"throttle": throttle})
        instances[f"rotor{i}"] = use("rotor", {"density": density}, motor_reacts=True)
        connections |= {
            f"motor{i}.voltage": "battery.voltage",
            f"battery.current{f'_{i + 1}' if i else ''}": f"motor{i}.current",
            f"motor{i}.load_torque": f"rotor{i}.load_torque",
            f"rotor{i}.speed": f"motor{i}.speed",
            f"rotor{i}.motor_torque": f"motor{i}.torque",
        }
    names = ["battery.outputs.voltage", "motor0.outputs.speed", "motor0.outputs.current"]
    traced = [*names, "rotor0.outputs.torque_body", "rotor0.outputs.load_torque"]
    rows = fly(instances, connections, traced, 3.0)

    def equations(unknown: Vector) -> list[float]:
        voltage, speed, current = unknown
        load = 0.0065 * density * (speed / (2.0 * math.pi)) ** 2 * 0.254**5
        return [
            voltage - 4.0 * (4.05 - (0.004 + 0.003) * motors * throttle * current),
            current - (throttle * voltage - speed / MOTOR["kv"]) / MOTOR["resistance"],
            (current - MOTOR["no_load_current"]) / MOTOR["kv"] - load,
        ]

    voltage, speed, current = fsolve(equations, [15.0, 700.0, 10.0], xtol=1e-13)
    assert [rows[name][-1] for name in names] == pytest.approx([voltage, speed, throttle * current], rel=1e-7)
    assert speed > 500.0 and current > 5.0
    assert rows["rotor0.outputs.torque_body"][-1][2] == pytest.approx(rows["rotor0.outputs.load_torque"][-1], rel=1e-6)


# ---- rotors in one model, a vehicle on wheels -------------------------------------------------------------------------


def test_four_rotors_follow_their_commands_with_a_lag_within_their_limits(fly: Fly) -> None:
    command = [1.0, 2.0, 9.0, -1.0]
    rotors = use("quadrotor_thrust", {"command": command}, thrust=[0.0, 3.0, 1.0, 2.0])
    names = [f"rotors.outputs.{name}" for name in ("thrust", "force_body", "torque_body")]
    rows = fly({"rotors": rotors}, {}, names, 0.3)
    goal, start = np.array([1.0, 2.0, 5.0, 0.0]), np.array([0.0, 3.0, 1.0, 2.0])
    expected = goal + np.exp(-rows["t"] / 0.05)[:, None] * (start - goal)
    np.testing.assert_allclose(rows[names[0]], expected, atol=1e-9)
    # The force of each acts at its place, and it turns the body against its own direction.
    places = np.array([[*xy, 0.0] for xy in QUADROTOR["position"]])
    forces = np.stack([0.0 * expected, 0.0 * expected, -expected], axis=2)
    torque = np.cross(places, forces).sum(axis=1)
    torque[:, 2] += 0.02 * expected @ QUADROTOR["direction"]
    np.testing.assert_allclose(rows[names[1]], forces.sum(axis=1), atol=1e-9)
    np.testing.assert_allclose(rows[names[2]], torque, atol=1e-9)


def test_four_rotors_turn_a_body_as_four_rotors_do() -> None:
    """The signs are those of `rotor`: a faster rotor to the left rolls to the right, one that turns clockwise yaws left."""
    for i, (xy, direction) in enumerate(zip(QUADROTOR["position"], QUADROTOR["direction"], strict=True)):
        thrust = [0.0] * 4
        thrust[i] = 2.0
        together = model("quadrotor_thrust", thrust=thrust)
        together.output()
        one = rotor_outputs({"speed": 500.0}, position_body=[*xy, 0.0], direction=direction)
        scale = 2.0 / one["thrust"]
        mine = np.array(together.get("outputs.torque_body"))
        assert mine[:2] == pytest.approx(scale * one["torque_body"][:2])
        assert np.sign(mine[2]) == np.sign(one["torque_body"][2])


def test_a_vehicle_on_wheels_drives_its_circle(fly: Fly) -> None:
    """SciPy's integrator, of other equations: the circle about the instantaneous centre."""
    drive = use(
        "differential_drive",
        {"command_left": 3.0, "command_right": 20.0, "slip_right": 0.25},
        x=1.0,
        y=-2.0,
        heading=2.5,
    )
    names = [
        f"drive.outputs.{n}"
        for n in (
            "x",
            "y",
            "heading",
            "forward_speed",
            "yaw_rate",
            "speed_left",
            "speed_right",
            "angle_left",
            "angle_right",
        )
    ]
    rows = fly({"drive": drive}, {}, names, 4.0)
    x, y, heading, forward, yaw_rate, left, right, angle_left, angle_right = (rows[name] for name in names)
    lag = 1.0 - np.exp(-rows["t"] / 0.2)
    np.testing.assert_allclose(left, 3.0 * lag, atol=1e-9)
    np.testing.assert_allclose(right, 8.0 * lag, atol=1e-9)  # its limit
    turned = rows["t"] - 0.2 * lag
    np.testing.assert_allclose(angle_left, 3.0 * turned, atol=1e-8)
    np.testing.assert_allclose(angle_right, 8.0 * turned, atol=1e-8)
    way_left, way_right = 0.1 * 3.0 * turned, 0.75 * 0.12 * 8.0 * turned
    np.testing.assert_allclose(heading, 2.5 + (way_right - way_left) / 0.5, atol=1e-8)
    # Both wheels have one lag, so the curvature is constant: a circle.
    radius = 0.5 * (0.3 + 0.72) / 2.0 / (0.72 - 0.3)
    centre = np.array([1.0 - radius * np.sin(2.5), -2.0 + radius * np.cos(2.5)])
    np.testing.assert_allclose(x, centre[0] + radius * np.sin(heading), atol=1e-8)
    np.testing.assert_allclose(y, centre[1] - radius * np.cos(heading), atol=1e-8)
    np.testing.assert_allclose(forward, radius * yaw_rate, atol=1e-12)
