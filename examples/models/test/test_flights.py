# SPDX-License-Identifier: Apache-2.0
"""The models in simulations, as a user's own package would fly them."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from simclient import SimTwin


def open_model(folder: Path, name: str, parameters: dict[str, Any], **integrator: Any) -> SimTwin:
    """A simulation of one model of this package, without a controller, for 20 s."""
    path = folder / f"{name}.sim.json"
    path.write_text(
        json.dumps(
            {
                "tick_hz": 100,
                "seed": 1,
                "duration": 20.0,
                "integrator": integrator,
                "models": {name: {"library": f"package://models/{name}"}},
                "instances": {"it": {"model": name, "parameters": parameters}},
            }
        )
    )
    return SimTwin.from_config(path)


@pytest.mark.parametrize("integrator", [{"method": "rk4", "hz": 100}, {"method": "rk45"}])
def test_the_ball_bounces_until_it_rests(integrator: dict[str, Any], tmp_path: Path) -> None:
    """Speeds fall by the restitution: 7.67 m/s, then 0.7 of it each time, until less than 0.5 m/s is left."""
    ball = {"gravity": 9.81, "restitution": 0.7, "rest_speed": 0.5, "height": 3.0, "speed": 0.0}
    with open_model(tmp_path, "bouncing_ball", ball, **integrator) as twin:
        twin.run_until("it.outputs.resting", 1000)
        landing = math.sqrt(2 * 9.81 * 3.0)
        assert twin.get("it.outputs.bounces") == math.ceil(math.log(0.5 / landing) / math.log(0.7))
        assert twin.get("it.outputs.height") == 0.0


def test_a_tank_drains_as_torricelli_says(tmp_path: Path) -> None:
    """sqrt(level) falls by hole sqrt(2 gravity) / (2 area) each second."""
    tank = {"area": 0.05, "hole": 1e-3, "gravity": 9.81, "rim": 2.0, "level": 1.25}
    with open_model(tmp_path, "tank", tank, method="rk4", hz=100) as twin:
        with twin.trace("it.outputs.level") as trace:
            twin.step(1000)
        rate = 1e-3 * math.sqrt(2 * 9.81) / (2 * 0.05)
        for k, level in enumerate(trace["it.outputs.level"]):
            assert level == pytest.approx((math.sqrt(1.25) - rate * k / 100) ** 2, rel=1e-9)


def test_a_small_swing_has_the_period_of_its_length(tmp_path: Path) -> None:
    """T = 2 pi sqrt(I / (m g l)), here 1.006 s; an amplitude of 0.01 rad makes it longer by 6e-6."""
    pendulum = {
        "mass": 1.0,
        "length": 0.25,
        "inertia": 0.0629,
        "damping": 0.0,
        "gravity": 9.81,
        "angle": 0.01,
        "rate": 0.0,
    }
    with open_model(tmp_path, "pendulum", pendulum, method="rk45", rtol=1e-10, atol=1e-12) as twin:
        period = 2 * math.pi * math.sqrt(0.0629 / (9.81 * 0.25))
        with twin.trace("it.outputs.angle") as trace:
            twin.step(1000)
        for k, angle in enumerate(trace["it.outputs.angle"]):
            assert angle == pytest.approx(0.01 * math.cos(2 * math.pi * k / 100 / period), abs=1e-5)


def test_two_bodies_keep_their_energy(tmp_path: Path) -> None:
    """By velocity Verlet, which a system of second order allows: the error of the energy does not grow."""
    orbit = {"mass": [2e11, 1e11], "position": [[-1.0, 0.0], [2.0, 0.0]], "velocity": [[0.0, -0.8], [0.0, 1.6]]}
    with open_model(tmp_path, "orbit", orbit, method="verlet", hz=1000) as twin:
        with twin.trace("it.outputs.energy") as trace:
            twin.step(2000)
        error = abs(trace["it.outputs.energy"] / trace["it.outputs.energy"][0] - 1.0)
        assert error.max() < 1e-4 and error[-500:].max() < 1.2 * error[:500].max()
