# SPDX-License-Identifier: Apache-2.0
"""The rocket in flight: whole simulations, and twins at moments that many tests begin from."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fcsl_sim import load
from fcsl_sim.config import SimConfig
from fcsl_sim.sim_run import SimRun
from simclient import SimTwin

EXAMPLE = Path(__file__).resolve().parents[1]
SIM = EXAMPLE / "sim" / "rocket_landing.sim.json"
CALM = EXAMPLE / "sim" / "calm.sim.json"
ENDLESS = EXAMPLE / "sim" / "endless.sim.json"
MACHINE: dict[str, Any] = json.loads((EXAMPLE / "fc" / "rocket_landing.json").read_text())
PLANT: dict[str, Any] = json.loads(SIM.read_text())["instances"]
TICK_HZ: int = MACHINE["tick_hz"]
GRAVITY = 9.80665
LEG = 1.2  # m
SILENT, STUCK, ZERO = 1, 2, 3
Array = NDArray[np.float64]


def parameters(instance: str) -> dict[str, Any]:
    """The parameters of an instance of the machine."""
    values: dict[str, Any] = MACHINE["instances"][instance]["parameters"]
    return values


def tilt(attitude: Array) -> float:
    """Between the axis of the body and the vertical, degrees."""
    return float(np.degrees(2.0 * np.arcsin(np.hypot(attitude[1], attitude[2]))))


def angle_error(estimate: Array, truth: Array) -> Array:
    """Rotation vector (rad, body axes) from an estimated to a true attitude, for small ones: 2 vec(q* p)."""
    sign = np.sign(estimate @ truth)
    error: Array = 2.0 * sign * (estimate[0] * truth[1:] - truth[0] * estimate[1:] - np.cross(estimate[1:], truth[1:]))
    return error


@dataclass(frozen=True)
class Landing:
    states: list[str]  # entered, in their order
    velocity: Array  # m/s, NED, at the first contact
    tilt: float  # degrees, then
    miss: float  # m, from the pad
    propellant: float  # kg
    at_rest: bool


def landed(twin: SimTwin, look: Callable[[SimTwin], None] = lambda twin: None) -> Landing:
    """Flies on until 2 s after the touchdown, for a minute at most. It looks 10 times a second, near the ground always."""
    entered, up, touched = [twin.state()], False, False
    velocity, attitude = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    ticks = 0
    while twin.state() != "TOUCHDOWN" and ticks < 60 * TICK_HZ:
        low = up and not touched and twin.get("earth.outputs.height") < LEG + 0.5
        if low:
            velocity = np.array(twin.get("earth.outputs.velocity_ned"))
            attitude = np.array(twin.get("earth.outputs.attitude_body_to_ned"))
        twin.tick(1 if low else 10)
        ticks += 1 if low else 10
        if not low:
            look(twin)
        if twin.state() != entered[-1]:
            entered.append(twin.state())
        up = up or twin.get("earth.outputs.height") > LEG + 2.0
        touched = touched or (low and twin.get("ground.outputs.touching"))
    twin.tick(2 * TICK_HZ)
    resting = touched and tilt(np.array(twin.get("earth.outputs.attitude_body_to_ned"))) < 1.0
    resting = resting and bool(np.linalg.norm(twin.get("earth.outputs.velocity_ned")) < 0.1)
    miss = np.hypot(*twin.get("earth.outputs.position_ned")[:2])
    left = twin.get("engine.outputs.propellant_mass")
    return Landing(
        entered[1:], velocity, tilt(attitude), float(miss), left, resting and not twin.get("actuators.outputs.throttle")
    )


@pytest.fixture(scope="session")
def weather() -> SimConfig:
    """The simulation of wind, turbulence and noise, without an end."""
    config: SimConfig = load(ENDLESS)
    assert config.warnings == ()
    return config


@pytest.fixture(scope="session")
def calm() -> SimConfig:
    """That of still air and sensors without errors."""
    return load(CALM)


@pytest.fixture(scope="session")
def standing_once(weather: SimConfig) -> Iterator[tuple[SimTwin, bytes]]:
    with SimTwin(SimRun(weather.with_seed(5))) as twin:
        yield twin, twin.save()


@pytest.fixture(scope="session")
def descending_once(weather: SimConfig) -> Iterator[tuple[SimTwin, bytes]]:
    with SimTwin(SimRun(weather.with_seed(2))) as twin:
        twin.run_until("machine.state == 'DESCENT'", timeout_ticks=3000)
        twin.tick(5 * TICK_HZ)
        yield twin, twin.save()


@pytest.fixture(scope="session")
def calm_once(calm: SimConfig) -> Iterator[tuple[SimTwin, dict[str, bytes]]]:
    with SimTwin(SimRun(calm)) as twin:
        twin.run_until("machine.state == 'ASCENT'", timeout_ticks=1000)
        saved = {"ascent": twin.save()}
        twin.tick(8 * TICK_HZ)
        lifted = twin.save()
        twin.set("ascent.parameters.top", 1e6)
        saved["climbing"] = twin.save()
        twin.restore(lifted)
        twin.set("terminal.parameters.pad", twin.get("navigation.outputs.position")[:2])
        twin.set_state("TERMINAL")
        twin.tick(9 * TICK_HZ)
        saved["sinking"] = twin.save()
        yield twin, saved


def restored(once: tuple[SimTwin, dict[str, bytes]], moment: str) -> SimTwin:
    twin, saved = once
    twin.restore(saved[moment])
    return twin


@pytest.fixture
def standing(standing_once: tuple[SimTwin, bytes]) -> SimTwin:
    """Before the first tick, in wind, turbulence and noise."""
    twin, saved = standing_once
    twin.restore(saved)
    return twin


@pytest.fixture
def descending(descending_once: tuple[SimTwin, bytes]) -> SimTwin:
    """In the middle of DESCENT, in wind, turbulence and noise."""
    twin, saved = descending_once
    twin.restore(saved)
    return twin


@pytest.fixture
def ascending(calm_once: tuple[SimTwin, dict[str, bytes]]) -> SimTwin:
    """At the take-off, in still air and with sensors without errors."""
    return restored(calm_once, "ascent")


@pytest.fixture
def climbing(calm_once: tuple[SimTwin, dict[str, bytes]]) -> SimTwin:
    """Climbing steadily, in still air. It stays in ASCENT."""
    return restored(calm_once, "climbing")


@pytest.fixture
def sinking(calm_once: tuple[SimTwin, dict[str, bytes]]) -> SimTwin:
    """In TERMINAL, high above the pad, in still air."""
    return restored(calm_once, "sinking")
