# SPDX-License-Identifier: Apache-2.0
"""Gains, margins and the plant behind them; the guidance law against the problem that it solves."""

from __future__ import annotations

import math
from collections.abc import Callable
from fractions import Fraction

import numpy as np
import pytest
from conftest import GRAVITY, Array, parameters
from design import Margins, loops, margins, regulator
from scipy.optimize import minimize_scalar

from fcsl_sim.config import SimConfig
from fcsl_sim.linear.linearise import linearise
from fcsl_sim.linear.plant import Plant
from simclient import AlgTwin, SimTwin

STATED = {  # crossover rad/s, phase margin degrees, gain margin
    "attitude": Margins(6.63, 62.2, 9.0, 1.20),
    "velocity": Margins(1.02, 67.2, 2.54, 1.73),
    "position": Margins(0.333, 70.2, 7.5, 1.29),
    "vertical": Margins(1.46, 50.2, 4.6, 1.57),
}


def test_the_gains_of_the_attitude_are_linear_quadratic() -> None:
    gains = parameters("attitude")
    assert [gains["k_integral"], gains["k"], gains["k_rate"]] == pytest.approx(regulator(), rel=1e-3)


@pytest.mark.parametrize("name", STATED)
def test_the_loops_have_the_stated_margins(name: str) -> None:
    found, stated = margins(loops()[name]), STATED[name]
    assert found.crossover == pytest.approx(stated.crossover, rel=0.02)
    assert found.phase == pytest.approx(stated.phase, abs=1.0)
    assert found.gain == pytest.approx(stated.gain, rel=0.03)
    assert found.sensitivity == pytest.approx(stated.sensitivity, rel=0.02)


def test_the_actuators_make_the_plant_a_double_integrator(calm: SimConfig, climbing: SimTwin) -> None:
    """The linearised plant turns by T l / I of an angle of its nozzle, within 2 % of what `Actuators` reckons with.

    It takes the drag of the climb for a lack of thrust.
    """
    with Plant(calm, Fraction(13)) as plant:  # about the moment of the twin
        linear = linearise(plant, [], [], ["servo_y.state.angle", "body.state.rate_body*"])
    names = [str(state.path) for state in linear.states]
    gain = linear.a[names.index("body.state.rate_body[1]"), names.index("servo_y.state.angle")]
    left, mass, thrust = (climbing.get(f"propulsion.outputs.{name}") for name in ("propellant", "mass", "thrust"))
    values = parameters("actuators")
    inertia = values["dry_inertia"] + values["full_inertia"] * left / values["full"]
    arm = values["pivot"] - values["tank"] * left / mass
    assert gain == pytest.approx(thrust * arm / inertia, rel=0.02)


def cost(path: Callable[[float], Array], t: float) -> float:
    """The integral of the square of the acceleration by the thrust, halved, which is linear in time."""
    begin, end = path(0.0), path(t)
    return float(t * (begin @ begin + begin @ end + end @ end) / 6.0)


def guided(fcsl: Callable[..., AlgTwin], position: list[float], velocity: list[float], thrust: float) -> AlgTwin:
    twin = fcsl("../fc/rocket_landing.json", instances=["descent"])
    values = {"position": position, "velocity": velocity, "mass": 100.0, "factor": 1.0}
    twin.set_many({f"descent.inputs.{name}": value for name, value in values.items()})
    twin.set_many({"descent.parameters.end_thrust": thrust, "descent.parameters.lead_s": 0.0})
    twin.tick()
    return twin


def test_the_guidance_law_takes_the_time_of_least_cost(fcsl: Callable[..., AlgTwin]) -> None:
    """Beside a search over all times (SciPy), and the closed form of ZEM and ZEV at that time."""
    position, velocity = np.array([-60.0, 20.0, -80.0]), np.array([1.0, -2.0, -5.0])
    values = parameters("descent")
    gate, end_velocity = np.array(values["gate"]), np.array(values["gate_velocity"])
    gravity = np.array([0.0, 0.0, GRAVITY])

    def thrust(t: float, now: float) -> Array:
        away = gate - position
        begin = 6.0 * away / t**2 - (4.0 * velocity + 2.0 * end_velocity) / t
        end = -6.0 * away / t**2 + (2.0 * velocity + 4.0 * end_velocity) / t
        return np.asarray(begin + (end - begin) * now / t - gravity)

    best = minimize_scalar(lambda t: cost(lambda now: thrust(t, now), t), bounds=(2.0, 40.0), method="bounded")
    twin = guided(fcsl, list(position), list(velocity), 1e6)
    t = twin.get_value("descent.outputs.time_left")
    assert t == pytest.approx(best.x, rel=1e-4)
    miss = gate - position - velocity * t - 0.5 * gravity * t**2
    lacking = end_velocity - velocity - gravity * t
    law = 6.0 * miss / t**2 - 2.0 * lacking / t
    assert twin.get_value("descent.outputs.acceleration") == pytest.approx(list(law), abs=1e-6)


def test_the_thrust_at_the_end_is_within_the_limit(fcsl: Callable[..., AlgTwin]) -> None:
    free = guided(fcsl, [-40.0, 0.0, -60.0], [0.0, 0.0, 10.0], 1e6).get_value("descent.outputs.time_left")
    twin = guided(fcsl, [-40.0, 0.0, -60.0], [0.0, 0.0, 10.0], 1400.0)
    t = twin.get_value("descent.outputs.time_left")
    assert t > 1.02 * free
    end = np.array(twin.get_value("descent.state.plan_acceleration")) + t * np.array(
        twin.get_value("descent.state.plan_jerk")
    )
    assert math.hypot(end[0], end[1], end[2] - GRAVITY) == pytest.approx(14.0, rel=1e-4)
