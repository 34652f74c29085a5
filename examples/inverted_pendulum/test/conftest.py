# SPDX-License-Identifier: Apache-2.0
"""Cart and pole: the machine's parameters, twins of whole runs, and one that balances without noise."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from simclient import SimTwin

EXAMPLE = Path(__file__).resolve().parents[1]
MACHINE = EXAMPLE / "fc" / "inverted_pendulum.json"
SIM = EXAMPLE / "sim" / "inverted_pendulum.sim.json"
CALM = EXAMPLE / "sim" / "calm.sim.json"
HZ = 200
Array = NDArray[np.float64]
TRUTH = [f"pendulum.outputs.{name}" for name in ("position", "angle", "speed", "angle_rate")]


def parameters(instance: str) -> dict[str, Any]:
    """The parameters of an instance of the machine."""
    values: dict[str, Any] = json.loads(MACHINE.read_text())["instances"][instance]["parameters"]
    return values


def flown(ticks: int, *paths: str, sim: Path = SIM, **options: Any) -> Any:
    """The trace of a simulation."""
    with SimTwin.from_config(sim, **options) as twin, twin.trace(*paths) as trace:
        twin.tick(ticks)
    return trace


def changes(states: Any) -> list[tuple[int, str]]:
    """The tick and the name of each state that is entered after the first."""
    return [(i, str(states[i])) for i in range(1, len(states)) if states[i] != states[i - 1]]


@pytest.fixture(scope="session")
def calm_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin that balances at rest in the middle, without noise, and the checkpoint of that moment."""
    with SimTwin.from_config(CALM) as twin:
        twin.run_until("machine.state == 'BALANCE'", timeout_ticks=8 * HZ)
        twin.tick(20 * HZ)
        yield twin, twin.save()


@pytest.fixture
def calm(calm_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = calm_once
    twin.restore(saved)
    return twin


@pytest.fixture(scope="session")
def balancing_once() -> Iterator[tuple[SimTwin, bytes]]:
    """A twin that balances in the middle, with ripple and counting encoders, and the checkpoint of that moment."""
    nowhere = "desk.parameters.times=[-1.0, -1.0, -1.0, -1.0]"
    with SimTwin.from_config(SIM, seed=3, duration=100.0, sets=[nowhere]) as twin:
        twin.tick(9 * HZ)
        assert twin.state() == "BALANCE"
        yield twin, twin.save()


@pytest.fixture
def balancing(balancing_once: tuple[SimTwin, bytes]) -> SimTwin:
    twin, saved = balancing_once
    twin.restore(saved)
    return twin
