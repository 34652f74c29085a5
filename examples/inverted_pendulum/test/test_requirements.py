# SPDX-License-Identifier: Apache-2.0
"""The pendulum's requirements (fc/requirements.json) over whole runs: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import HZ

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Runs: their simulation, and what happens beside. In the third a push that the motor cannot bear.
RUNS: dict[str, tuple[str, list[str]]] = {
    "nominal": ("inverted_pendulum", []),
    "encoder_loss": ("encoder_loss", []),
    "push": ("inverted_pendulum", ["9.0 push.parameters.bias=12.0", "9.8 push.parameters.bias=0.0"]),
}


def _fly(fcsl_sim: Callable[..., SimTwin], run: str) -> dict[str, Verdict]:
    sim, events = RUNS[run]
    twin = fcsl_sim(f"../sim/{sim}.sim.json", seed=3, events=events)
    twin.tick(24 * HZ)
    return twin.requirements


def test_each_requirement_is_exercised_by_a_run_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, run) for run in RUNS) == []


@pytest.mark.violates("PEN-6")
def test_a_weak_motor_never_swings_it_up(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a motor of 1 N instead of 10 N."""
    twin = fcsl_sim("../sim/inverted_pendulum.sim.json", seed=3, sets=["drive.parameters.force_limit=1.0"])
    twin.tick(10 * HZ)
    assert twin.requirements["PEN-6"].first == {"machine.state": "SWING_UP"}
