# SPDX-License-Identifier: Apache-2.0
"""Whole flights in wind and turbulence: every seed, dispersed parameters, estimates within what the filter claims."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conftest import Array, angle_error, flown

from fcsl_sim import Simulation

MISSION = ["TAKE_OFF", "HOLD", "MISSION", "HOLD", "LAND", "STANDBY"]
CORNERS = np.array([[8.0, 0.0], [8.0, 8.0], [0.0, 8.0], [0.0, 0.0]])  # m, north and east
SOFT = 1.1  # m/s
HEADING_ERROR = 0.03  # rad, of hard iron and field model, a constant that no filter can observe


def check_mission(sim: Simulation, reach: float) -> None:
    """The states in their order, each corner passed within `reach`, a soft landing at home, motors off."""
    entered, path, touchdown = flown(sim)
    assert entered == MISSION and sim.get("ground.outputs.touching")
    nearest = np.linalg.norm(path[:, None, :2] - CORNERS, axis=2).min(axis=0)
    assert nearest.max() < reach
    assert -path[:, 2].min() == pytest.approx(5.0, abs=1.5)
    assert np.linalg.norm(path[-1, :2]) < reach
    assert 0.0 < touchdown < SOFT
    assert not sim.machine_value("mixer.outputs.running")


def test_twenty_seeds_fly_the_square_and_land(fly: Callable[..., Simulation]) -> None:
    for seed in range(1, 21):
        with fly(seed) as sim:
            check_mission(sim, reach=1.8)


@pytest.mark.parametrize(
    "sets",
    [
        ["mass.parameters.dry_mass=1.14", "rotor_1.parameters.thrust_coefficient=0.105"],
        ["mass.parameters.dry_mass=1.26", "rotor_3.parameters.thrust_coefficient=0.105"],
        ["mass.parameters.dry_inertia=[[0.015,0,0],[0,0.015,0],[0,0,0.026]]", "motor_2.parameters.resistance=0.15"],
        ["gusts.parameters.wind_speed_20ft=8.0", "wind.parameters.wind_east=[5.0]"],
        ["inertial_unit.parameters.gyroscope_noise_density=3e-4", "compass.parameters.sigma=1e-6"],
    ],
    ids=["light", "heavy", "inert", "windy", "noisy"],
)
def test_dispersed_vehicles_and_weather(fly: Callable[..., Simulation], sets: list[str]) -> None:
    with fly(5, sets=sets) as sim:
        check_mission(sim, reach=2.2)


def test_estimates_are_within_three_sigma(fly: Callable[..., Simulation]) -> None:
    """99 % of all samples of three flights, from a second after the alignment on, and errors of the stated size."""
    truth, estimate, sigma = {}, {}, {}
    names = {"position": "position_ned", "velocity": "velocity_ned", "attitude": "attitude_body_to_ned"}
    inside: dict[str, list[Array]] = {name: [] for name in names}
    errors: dict[str, list[Array]] = {name: [] for name in names}
    for seed in (1, 2, 3):
        with fly(seed) as sim:
            sim.run(500)
            while sim.status == "running":
                sim.run(25)
                for name, true_name in names.items():
                    truth[name] = np.array([sim.get(f"earth.outputs.{true_name}")])
                    estimate[name] = np.array([sim.machine_value(f"navigation.outputs.{name}")])
                    sigma[name] = np.array(sim.machine_value(f"navigation.outputs.{name}_sigma"))
                    error = truth[name] - estimate[name]
                    if name == "attitude":
                        error = angle_error(estimate[name], truth[name])
                        sigma[name] = np.hypot(sigma[name], [0.0, 0.0, HEADING_ERROR])
                    errors[name].append(error[0])
                    inside[name].append(np.abs(error[0]) < 3.0 * sigma[name])
            assert sim.status == "until"
    for name, rms in {"position": 0.6, "velocity": 0.03, "attitude": 0.02}.items():
        assert np.mean(inside[name]) > 0.99, name
        assert np.sqrt(np.mean(np.square(errors[name]))) < rms, name
    assert np.mean(sigma["velocity"]) < 0.02  # and they claim little
