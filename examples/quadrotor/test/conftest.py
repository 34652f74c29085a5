# SPDX-License-Identifier: Apache-2.0
"""The quadrotor in flight: simulations of the whole, a twin that hovers in still air, and what they have in common."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from fcsl_sim import Simulation, load
from fcsl_sim.config import SimConfig
from simclient import SimTwin

EXAMPLE = Path(__file__).resolve().parents[1]
SIM = EXAMPLE / "sim" / "quadrotor.sim.json"
ENDLESS = EXAMPLE / "sim" / "endless.sim.json"
CALM = EXAMPLE / "sim" / "calm.sim.json"
TICK_HZ = 250
Array = NDArray[np.float64]


def parameters(instance: str) -> dict[str, Any]:
    """The parameters of an instance of the machine."""
    machine = json.loads((EXAMPLE / "fc" / "quadrotor.json").read_text())
    values: dict[str, Any] = machine["instances"][instance]["parameters"]
    return values


def angle_error(estimate: Array, truth: Array) -> Array:
    """Rotation vectors (rad, body axes) from estimated to true attitudes, for small ones: 2 vec(q* p)."""
    w = (estimate * truth).sum(axis=1, keepdims=True)
    vector = estimate[:, :1] * truth[:, 1:] - truth[:, :1] * estimate[:, 1:]
    return 2.0 * np.sign(w) * (vector - np.cross(estimate[:, 1:], truth[:, 1:]))


def flown(sim: Simulation) -> tuple[list[str], Array, float]:
    """Runs until a second after the landing: states entered, true positions every 0.2 s, touchdown speed (m/s)."""
    entered: list[str] = []
    path: list[Array] = []
    touchdown, airborne = 0.0, False
    while sim.status == "running" and entered[1:][-1:] != ["STANDBY"]:
        state = sim.state
        low = airborne and path[-1][2] > -0.5
        fall = sim.get("earth.outputs.velocity_ned")[2]
        sim.run(5 if low else 50)
        if sim.state != state:
            entered.append(sim.state)
        path.append(np.array(sim.get("earth.outputs.position_ned")))
        if airborne and touchdown == 0.0 and sim.get("ground.outputs.touching"):
            touchdown = fall
        airborne = airborne or path[-1][2] < -1.0
    sim.run(TICK_HZ)
    path.append(np.array(sim.get("earth.outputs.position_ned")))
    return entered, np.array(path), touchdown


@pytest.fixture(scope="session")
def fly() -> Callable[..., Simulation]:
    """fly(seed, sets=[], events=[]): an opened simulation, at tick 0."""
    plain = load(SIM, seed=1)
    assert plain.warnings == ()

    def open_simulation(seed: int, sets: Sequence[str] = (), events: Sequence[str] = ()) -> Simulation:
        config: SimConfig = load(SIM, seed=seed, sets=list(sets), events=list(events)) if sets or events else plain
        config = config.with_seed(seed)
        return Simulation(config.plan, config.tables)

    return open_simulation


@pytest.fixture(scope="session")
def hovering_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin in HOLD, in still air, with sensors without noise, and the checkpoint of that moment."""
    with SimTwin.from_config(CALM) as twin:
        twin.run_until("machine.state == 'HOLD'", timeout_ticks=5000)
        twin.tick(5 * TICK_HZ)
        yield twin, twin.save()


@pytest.fixture(scope="session")
def mission_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin in the middle of the mission, in wind and with noise, and the checkpoint of that moment."""
    with SimTwin.from_config(ENDLESS, seed=2) as twin:
        twin.run_until("machine.state == 'MISSION'", timeout_ticks=5000)
        twin.tick(5 * TICK_HZ)
        yield twin, twin.save()


@pytest.fixture
def mission(mission_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = mission_once
    twin.restore(saved)
    return twin


@pytest.fixture
def hovering(hovering_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = hovering_once
    twin.restore(saved)
    return twin
