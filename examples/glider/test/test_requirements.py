# SPDX-License-Identifier: Apache-2.0
"""The glider's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import TICK_HZ

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Flights: their simulation, and what fails beside. In the third the satellites are lost at 60 s.
FLIGHTS: dict[str, tuple[str, list[str]]] = {
    "nominal": ("glider", []),
    "airspeed_loss": ("airspeed_loss", []),
    "gnss_loss": ("glider", ["60.0 receiver.parameters.fault=1"]),
}


def _fly(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Verdict]:
    sim, events = FLIGHTS[flight]
    twin = fcsl_sim(f"../sim/{sim}.sim.json", seed=3, events=events)
    twin.run_until("machine.state == 'FLARE'", timeout_ticks=250 * TICK_HZ)
    twin.tick(12 * TICK_HZ)  # touches down and, with satellites, stands
    return twin.requirements


def test_each_requirement_is_exercised_by_a_flight_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, flight) for flight in FLIGHTS) == []


@pytest.mark.violates("GLI-7")
def test_a_glide_near_the_stall_violates_the_least_speed(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a glide at 9.2 m/s, the speed of the least sink."""
    twin = fcsl_sim("../sim/glider.sim.json", seed=3)
    twin.set("glide.parameters.speed", 9.2)
    twin.tick(36 * TICK_HZ)
    assert twin.requirements["GLI-7"].first["machine.state"] == "GLIDE"
