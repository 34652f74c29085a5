# SPDX-License-Identifier: Apache-2.0
"""The glider in flight: whole simulations, and twins at moments that many tests begin from."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import pytest
from flight_mechanics import EXAMPLE, Array
from plant import PLANT, Plant

from fcsl_sim import Simulation, load
from simclient import SimTwin

SIM = EXAMPLE / "sim" / "glider.sim.json"
CALM = EXAMPLE / "sim" / "calm.sim.json"
ENDLESS = EXAMPLE / "sim" / "endless.sim.json"
TICK_HZ = 50
SILENT, STUCK, ZERO = 1, 2, 3


def angle_error(estimate: Array, truth: Array) -> Array:
    """Rotation vector (rad, body axes) from an estimated to a true attitude, for small ones: 2 vec(q* p)."""
    sign = np.sign(estimate @ truth)
    error: Array = 2.0 * sign * (estimate[0] * truth[1:] - truth[0] * estimate[1:] - np.cross(estimate[1:], truth[1:]))
    return error


@pytest.fixture(scope="session")
def fly() -> Callable[..., Simulation]:
    """fly(seed, sets=[], events=[]): an opened simulation, at tick 0."""
    plain = load(SIM, seed=1)
    assert plain.warnings == ()

    def open_simulation(seed: int, sets: Sequence[str] = (), events: Sequence[str] = ()) -> Simulation:
        config = load(SIM, seed=seed, sets=list(sets), events=list(events)) if sets or events else plain
        config = config.with_seed(seed)
        return Simulation(config.plan, config.tables)

    return open_simulation


@pytest.fixture(scope="session")
def plant() -> Iterator[Plant]:
    """The glider alone, in still air."""
    with SimTwin.from_config(PLANT) as twin:
        yield Plant(twin)


@pytest.fixture(scope="session")
def gliding_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin in a steady glide, in still air and with sensors without noise. It stays in GLIDE."""
    with SimTwin.from_config(CALM) as twin:
        twin.run_until("machine.state == 'GLIDE'", timeout_ticks=2000)
        twin.set("glide.parameters.straight_s", 1e6)
        twin.set("glide.parameters.land_height", -1e6)
        twin.set("body.state.position_inertial", [0.0, 0.0, -300.0])
        twin.set("navigation.outputs.height", 300.0)
        twin.tick(25 * TICK_HZ)
        yield twin, twin.save()


@pytest.fixture(scope="session")
def mission_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin between its waypoints, in wind, turbulence and noise."""
    with SimTwin.from_config(ENDLESS, seed=2) as twin:
        twin.run_until("machine.state == 'WAYPOINT'", timeout_ticks=3000)
        twin.tick(8 * TICK_HZ)
        yield twin, twin.save()


@pytest.fixture
def gliding(gliding_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = gliding_once
    twin.restore(saved)
    return twin


@pytest.fixture
def mission(mission_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = mission_once
    twin.restore(saved)
    return twin
