# SPDX-License-Identifier: Apache-2.0
"""Every vehicle flies on the library of the Nim backend as on that of the C backend: the last state of plant and machine is
the same, bit for bit."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest

from fcsl_compiler.driver.cache import build_machine
from fcsl_sim.config import SimConfig, load
from fcsl_sim.sim_run import SimRun
from fcsl_sim.sim_twin import SimTwin
from simclient import AlgTwin

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
#: The simulation and the machine of each vehicle, and how long it flies, s.
FLIGHTS = {
    "lander": ("sim/lander.sim.json", "fc/lander_control.json", 25),
    "quadrotor": ("sim/quadrotor.sim.json", "fc/quadrotor.json", 10),
    "glider": ("sim/glider.sim.json", "fc/glider.json", 15),
    "inverted_pendulum": ("sim/inverted_pendulum.sim.json", "fc/inverted_pendulum.json", 20),
    "rocket_landing": ("sim/rocket_landing.sim.json", "fc/rocket_landing.json", 30),
    "satellite": ("sim/satellite.sim.json", "fc/satellite.json", 100),
}


def flown(config: SimConfig) -> dict[str, bytes]:
    """The bytes of every field of plant and machine at the end."""
    with SimTwin(SimRun(config)) as twin:
        twin.tick(config.ticks)
        return {path: np.asarray(twin.get(path)).tobytes() for path in twin.machine.fields}


@pytest.mark.parametrize("vehicle", FLIGHTS)
def test_vehicles_fly_alike(vehicle: str) -> None:
    sim, machine, duration = FLIGHTS[vehicle]
    nim = build_machine(EXAMPLES / vehicle / machine, backend="nim")
    by_c = load(EXAMPLES / vehicle / sim, duration_s=Fraction(duration))
    by_nim = load(EXAMPLES / vehicle / sim, duration_s=Fraction(duration), machine=(nim.library, nim.name))
    assert flown(by_nim) == flown(by_c)


def test_a_twin_opens_either() -> None:
    config = EXAMPLES / "ahrs/ahrs.json"
    found = []
    for backend in ("c", "nim"):
        with AlgTwin.from_config(config, backend=backend) as twin:
            twin.tick(100)
            found.append((twin.machine.source_hash, {path: str(twin.get_value(path)) for path in twin.machine.fields}))
    assert found[0] == found[1]
