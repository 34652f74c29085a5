# SPDX-License-Identifier: Apache-2.0
"""Every vehicle flies on the library of the Nim backend as on that of the C backend: the last state of plant and
machine is the same, bit for bit."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fcsl_compiler.model.target import BACKENDS
from fcsl_sim.sim_twin import SimTwin
from simclient import AlgTwin

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
#: The simulation of each vehicle, and how long it flies, s.
FLIGHTS = {
    "lander": ("sim/lander.sim.json", 25),
    "quadrotor": ("sim/quadrotor.sim.json", 10),
    "glider": ("sim/glider.sim.json", 15),
    "inverted_pendulum": ("sim/inverted_pendulum.sim.json", 20),
    "rocket_landing": ("sim/rocket_landing.sim.json", 30),
    "satellite": ("sim/satellite.sim.json", 100),
}


def flown(sim: Path, duration: int, backend: str) -> tuple[Path, dict[str, bytes]]:
    """The library of the machine, and the bytes of every field of plant and machine at the end."""
    with SimTwin.from_config(sim, backend=backend, duration=duration) as twin:
        twin.tick(twin.config.ticks)
        return twin.config.library, {path: np.asarray(twin.get(path)).tobytes() for path in twin.machine.fields}


@pytest.mark.parametrize("vehicle", FLIGHTS)
def test_vehicles_fly_alike(vehicle: str) -> None:
    sim, duration = FLIGHTS[vehicle]
    (c, by_c), (nim, by_nim) = (flown(EXAMPLES / vehicle / sim, duration, backend) for backend in BACKENDS)
    assert nim != c
    assert by_nim == by_c


def test_a_twin_opens_either() -> None:
    config = EXAMPLES / "ahrs/ahrs.json"
    found = []
    for backend in BACKENDS:
        with AlgTwin.from_config(config, backend=backend) as twin:
            twin.tick(100)
            found.append((twin.machine.source_hash, {path: str(twin.get_value(path)) for path in twin.machine.fields}))
    assert found[0] == found[1]
