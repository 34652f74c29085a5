# SPDX-License-Identifier: Apache-2.0
"""Every vehicle flies on the library of the Nim backend as on that of the C backend: the last state of plant and
machine is the same, bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from fcsl_compiler.model.choices import BACKENDS
from fcsl_sim.sim_twin import SimTwin
from simclient.twin.twin import Twin

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
#: The simulation of each vehicle, and how long it flies, s.
FLIGHTS = {
    "lander": ("sim/lander.sim.json", 25),
    "quadrotor": ("sim/quadrotor.sim.json", 10),
    "glider": ("sim/glider.sim.json", 15),
    "inverted_pendulum": ("sim/inverted_pendulum.sim.json", 20),
    "rocket_landing": ("sim/rocket_landing.sim.json", 30),
    "rover": ("sim/rover.sim.json", 42),
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


def test_the_fixtures_open_either(fcsl: Callable[..., Twin], fcsl_sim: Callable[..., SimTwin]) -> None:
    """With every kind of twin (--fcsl-twin)."""
    for twins in (
        [fcsl(EXAMPLES / "ahrs/ahrs.json", backend=backend) for backend in BACKENDS],
        [fcsl_sim(EXAMPLES / "lander/sim/lander.sim.json", backend=backend) for backend in BACKENDS],
    ):
        for twin in twins:
            twin.tick(100)
        c, nim = (twin.machine for twin in twins)
        assert c.build_hash != nim.build_hash and c.source_hash == nim.source_hash
        by_c, by_nim = ({path: str(twin.get_value(path)) for path in c.fields} for twin in twins)
        assert by_nim == by_c
