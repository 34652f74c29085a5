# SPDX-License-Identifier: Apache-2.0
"""The two models of this vehicle alone, against their vector equations, and the table against its method."""

from __future__ import annotations

import math
import sys
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLE, Array
from scipy.spatial.transform import Rotation

from fcsl_sim.model_instance import ModelInstance

sys.path.insert(0, str(EXAMPLE / "sim"))
import aerodynamics as method  # noqa: E402

TABLE: Any = np.genfromtxt(EXAMPLE / "sim" / "body.csv", delimiter=",", names=True)


def vector(instance: ModelInstance, path: str) -> Array:
    return np.array(instance.get(path), dtype=float)


def test_the_gimballed_engine_is_its_vector_equations() -> None:
    """Force by two rotations (SciPy), torque by cross products, jet damping from the Coriolis force of the flow."""
    engine = ModelInstance.load(str(EXAMPLE / "sim" / "gimballed_engine.c"))
    thrust, x, y, left, mass, flow = 1000.0, 0.1, -0.07, 20.0, 105.0, 0.6
    rate, offset = np.array([0.2, -0.3, 0.5]), np.array([0.01, -0.02, 0.03])
    values = {
        "inputs.thrust": thrust, "inputs.angle_x": x, "inputs.angle_y": y, "inputs.propellant_mass": left,
        "inputs.mass": mass, "inputs.mass_flow": flow, "inputs.rate_body": list(rate), "parameters.pivot": 0.9,
        "parameters.tank": -0.35, "parameters.dry_offset_body": list(offset),
    }  # fmt: skip
    for path, value in values.items():
        engine.set(path, value)
    engine.output()
    inner = Rotation.from_euler("x", -x).apply(
        [0.0, 0.0, -thrust]
    )  # the nozzle turns about x in a ring that turns about y
    force = Rotation.from_euler("y", -y).apply(inner)
    centre = ((mass - left) * offset + left * np.array([0.0, 0.0, -0.35])) / mass
    arm = np.array([0.0, 0.0, 0.9]) - centre
    assert vector(engine, "outputs.force_body") == pytest.approx(force)
    assert vector(engine, "outputs.centre_of_mass_body") == pytest.approx(centre)
    torque = np.cross(arm, force) - flow * np.cross(arm, np.cross(rate, arm))
    assert vector(engine, "outputs.torque_body") == pytest.approx(torque)
    assert torque[0] > 0.0 and -0.07 * torque[1] > 0.0  # a positive angle makes a positive torque


@pytest.fixture
def body() -> ModelInstance:
    instance = ModelInstance.load(str(EXAMPLE / "sim" / "slender_body.c"))
    for name in ("angle", "axial", "normal"):
        column = [float(v) for v in TABLE[name]]
        instance.set(f"parameters.{name}", column + [column[-1]] * (40 - len(column)))
    for name, value in {"area": 0.28274, "centre_of_pressure": -0.25}.items():
        instance.set(f"parameters.{name}", value)
    instance.set("inputs.density", 1.2)
    instance.init()
    return instance


def test_the_force_of_the_air_is_against_the_motion(body: ModelInstance) -> None:
    """It takes energy from every motion through still air, for all angles; along the axis it is drag alone."""
    for angle in np.linspace(0.0, math.pi, 37):
        velocity = 20.0 * np.array([0.6 * math.sin(angle), 0.8 * math.sin(angle), math.cos(angle)])
        body.set("inputs.velocity_air_body", list(velocity))
        body.output()
        force, torque = vector(body, "outputs.force_body"), vector(body, "outputs.torque_body")
        assert force @ velocity < 0.0
        assert torque == pytest.approx(np.cross([0.0, 0.0, -0.25], force), abs=1e-9)
        axial, normal = method.coefficients(float(angle))
        push = 0.5 * 1.2 * 400.0 * 0.28274
        assert force[2] == pytest.approx(-push * axial, abs=0.003 * push)
        assert np.hypot(*force[:2]) == pytest.approx(push * normal, abs=0.003 * push)


def test_the_table_is_what_the_method_gives() -> None:
    for row in TABLE:
        assert (row["axial"], row["normal"]) == pytest.approx(method.coefficients(float(row["angle"])), abs=2e-5)
