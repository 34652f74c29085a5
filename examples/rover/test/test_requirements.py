# SPDX-License-Identifier: Apache-2.0
"""The rover's requirements (fc/requirements.json) over whole drives: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

HZ = 100

#: Drives, and what fails in them: the left encoder along the route; cmd_vel, from 2 s on for ten ticks.
EVENTS: dict[str, list[str]] = {
    "nominal": [],
    "encoder_loss": ["20.0 encoder_left.parameters.dropout=true", "22.0 encoder_left.parameters.dropout=false"],
    "command_loss": [],
}


def _fly(fcsl_sim: Callable[..., SimTwin], drive: str) -> dict[str, Verdict]:
    twin = fcsl_sim("../sim/rover.sim.json", seed=3, events=EVENTS[drive])
    twin.tick(2 * HZ)
    for _ in range(10):
        if drive == "command_loss":
            twin.fault("operator")
        twin.tick()
    twin.tick(40 * HZ - 10)
    return twin.requirements


def test_each_requirement_is_exercised_by_a_drive_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, drive) for drive in EVENTS) == []


@pytest.mark.violates("ROV-11")
def test_motors_that_run_on_violate_the_standstill(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by motors that take seconds to stop, from the emergency stop on."""
    twin = fcsl_sim("../sim/rover.sim.json", seed=3, events=["36.0 rover.parameters.time_constant=2.0"])
    twin.tick(40 * HZ)
    assert twin.requirements["ROV-11"].first_tick >= 37 * HZ
