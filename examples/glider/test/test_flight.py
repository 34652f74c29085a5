# SPDX-License-Identifier: Apache-2.0
"""Whole flights in wind and turbulence: every seed, dispersed gliders, estimates within what the filter claims."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from conftest import TICK_HZ, Array, angle_error
from plant import rotation

from fcsl_sim import Simulation

FLIGHT = ["LAUNCH", "GLIDE", "WAYPOINT", "LOITER", "LAND", "FLARE", "STANDBY"]
WAYPOINTS = np.array([[350.0, 150.0], [100.0, 250.0], [0.0, 120.0]])  # m, north and east


def check_flight(sim: Any, sink: float = 1.5) -> None:
    """The states in their order, each waypoint passed within 35 m, no stall, a soft touchdown with level wings."""
    entered, path, angles = [sim.state], [], []
    touched = False
    while sim.status == "running" and entered[1:][-1:] != ["STANDBY"]:
        flares = entered[-1] == "FLARE" and not touched
        fall, roll = sim.get("earth.outputs.velocity_ned")[2], sim.get("angles.outputs.roll")
        sim.run(2 if flares else 25)
        if sim.state != entered[-1]:
            entered.append(sim.state)
        if flares and sim.get("ground.outputs.touching"):
            touched = True
            assert 0.0 < fall < sink and abs(roll) < 0.15
        path.append(sim.get("earth.outputs.position_ned")[:2])
        if entered[-1] in ("GLIDE", "WAYPOINT", "LOITER"):
            angles.append(sim.get("air.outputs.angle_of_attack"))
    assert entered[1:] == FLIGHT and touched
    nearest = np.linalg.norm(np.array(path)[:, None] - WAYPOINTS, axis=2).min(axis=0)
    assert nearest.max() < 35.0
    assert np.degrees(max(angles)) < 12.0


def test_twenty_seeds_fly_the_waypoints_and_land(fly: Callable[..., Simulation]) -> None:
    for seed in range(1, 21):
        with fly(seed) as sim:
            check_flight(sim)


@pytest.mark.parametrize(
    "sets",
    [
        ["body.inputs.mass=3.2", "wing.parameters.moment_reference_body=[0.018,0,0]",
         "wing.parameters.pitch_from_elevator=-1.45", "wing.parameters.pitch_from_pitch_rate=-9.0"],
        ["body.inputs.mass=3.8", "wing.parameters.moment_reference_body=[0.03,0,0]",
         "wing.parameters.pitch_from_elevator=-0.97", "wing.parameters.roll_from_aileron=0.28"],
        ["gusts.parameters.wind_speed_20ft=6.0", "wind.parameters.wind_east=[0,3,4,5]"],
        ["pitot_tube.parameters.bias=-4.0", "receiver.parameters.horizontal_velocity_sigma=0.2"],
    ],
    ids=["light_strong_elevator", "heavy_weak_surfaces", "windy", "noisy"],
)  # fmt: skip
def test_dispersed_gliders_and_weather(fly: Callable[..., Simulation], sets: list[str]) -> None:
    with fly(5, sets=sets) as sim:
        check_flight(sim, sink=2.0)


def test_estimates_are_within_three_sigma(fly: Callable[..., Simulation]) -> None:
    """99 % of the samples of three flights, and errors of the stated size. Wind: with the gusts, 97 %."""
    inside: dict[str, list[Array]] = {"attitude": [], "velocity": [], "wind": []}
    errors: dict[str, list[Array]] = {name: [] for name in inside}
    for seed in (1, 2, 3):
        with fly(seed) as sim:
            sim.run(14 * TICK_HZ)
            while sim.state != "FLARE":
                sim.run(25)
                truth = np.array(sim.get("earth.outputs.attitude_body_to_ned"))
                angles: list[Any] = [sim.get(f"angles.outputs.{name}") for name in ("roll", "pitch", "yaw")]
                wind = np.array(sim.get("wind.outputs.wind_ned"))
                wind += rotation(*angles) @ np.array(sim.get("gusts.outputs.gust_body"))
                found = {
                    "attitude": angle_error(np.array(sim.machine_value("navigation.outputs.attitude")), truth),
                    "velocity": np.array(sim.get("earth.outputs.velocity_ned"))
                    - np.array(sim.machine_value("navigation.outputs.velocity")),
                    "wind": wind[:2] - np.array(sim.machine_value("navigation.outputs.wind")),
                }
                for name, error in found.items():
                    sigma = np.array(sim.machine_value(f"navigation.outputs.{name}_sigma"))
                    inside[name].append(np.abs(error) < 3.0 * sigma)
                    errors[name].append(error)
    for name, share in {"attitude": 0.99, "velocity": 0.99, "wind": 0.97}.items():
        assert np.mean(inside[name]) > share, name
    rms = {name: np.sqrt(np.mean(np.square(values), axis=0)) for name, values in errors.items()}
    assert np.degrees(rms["attitude"][:2]).max() < 0.3 and np.degrees(rms["attitude"][2]) < 1.0
    assert rms["velocity"].max() < 0.05 and rms["wind"].max() < 0.8
