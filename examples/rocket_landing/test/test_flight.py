# SPDX-License-Identifier: Apache-2.0
"""Whole flights in wind and turbulence: every seed, dispersed parameters, estimates within what the filter claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pytest
from conftest import Array, Landing, angle_error, landed

from fcsl_sim.config import SimConfig
from fcsl_sim.sim_run import SimRun
from simclient import SimTwin

FLIGHT = ["ASCENT", "DESCENT", "TERMINAL", "TOUCHDOWN"]
ESTIMATES = {"position": "position_ned", "velocity": "velocity_ned", "attitude": "attitude_body_to_ned"}


def check_landing(found: Landing) -> None:
    """The states in their order, soft, upright, on the pad, with propellant left."""
    assert found.states == FLIGHT and found.at_rest
    assert 0.3 < found.velocity[2] < 1.2 and np.hypot(*found.velocity[:2]) < 0.8
    assert found.tilt < 4.0 and found.miss < 3.0 and found.propellant > 5.0


@pytest.fixture(scope="module")
def flights(weather: SimConfig) -> tuple[list[Landing], dict[str, Array], dict[str, Array]]:
    """Six seeds: how they land, and of each estimate errors and sigmas, ten times a second from take-off on."""
    found: list[Landing] = []
    errors: dict[str, list[Array]] = {name: [] for name in ESTIMATES}
    sigmas: dict[str, list[Array]] = {name: [] for name in ESTIMATES}

    def look(twin: SimTwin) -> None:
        if twin.state() == "STANDBY":
            return
        for name, true_name in ESTIMATES.items():
            truth = np.array(twin.get(f"earth.outputs.{true_name}"))
            estimate = np.array(twin.get(f"navigation.outputs.{name}"))
            errors[name].append(angle_error(estimate, truth) if name == "attitude" else truth - estimate)
            sigmas[name].append(np.array(twin.get(f"navigation.outputs.{name}_sigma")))

    for seed in range(1, 7):
        with SimTwin(SimRun(weather.with_seed(seed))) as twin:
            found.append(landed(twin, look))
    columns = [{name: np.array(values) for name, values in part.items()} for part in (errors, sigmas)]
    return found, columns[0], columns[1]


def test_six_seeds_land_on_the_pad(flights: Any) -> None:
    for found in flights[0]:
        check_landing(found)


def test_estimates_are_within_three_sigma(flights: Any) -> None:
    """99 % of the samples of all flights, and errors of the stated size, not much less than what the filter claims."""
    _, errors, sigmas = flights
    rms = {name: np.sqrt(np.mean(np.square(values), axis=0)) for name, values in errors.items()}
    for name in ESTIMATES:
        assert np.mean(np.abs(errors[name]) < 3.0 * sigmas[name]) > 0.99, name
        assert np.all(rms[name] > 0.3 * np.sqrt(np.mean(np.square(sigmas[name]), axis=0))), name
    assert rms["position"].max() < 0.8 and rms["velocity"].max() < 0.06
    assert np.degrees(rms["attitude"][:2]).max() < 0.3 and np.degrees(rms["attitude"][2]) < 2.0


@pytest.mark.parametrize(
    "values",
    [
        {"mass.parameters.dry_mass": 90.0, "engine.parameters.max_thrust": 1800.0, "engine.parameters.time_constant": 0.14},
        {"mass.parameters.dry_mass": 80.0, "engine.parameters.max_thrust": 2000.0, "engine.parameters.time_constant": 0.07},
        {"gimbal.parameters.dry_offset_body": [0.02, -0.02, 0.05], "servo_x.parameters.natural_frequency": 45.0},
        {"gusts.parameters.wind_speed_20ft": 9.0, "wind.parameters.wind_east": [0.0, 6.0, 8.0, 10.0] + [12.0] * 12},
        {"receiver.parameters.horizontal_velocity_sigma": 0.15, "laser.parameters.sigma": 0.15},
    ],
    ids=["heavy_weak", "light_strong", "bent", "windy", "noisy"],
)  # fmt: skip
def test_dispersed_rockets_and_weather(standing: SimTwin, values: Mapping[str, Any]) -> None:
    standing.set_many(values)
    check_landing(landed(standing))


@pytest.mark.fcsl_campaign("../sim/wind_and_mass.study.json", cases=2)
def test_cases_of_the_study(fcsl_case: Any) -> None:
    assert fcsl_case.verdict == "passed", fcsl_case
