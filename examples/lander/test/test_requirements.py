# SPDX-License-Identifier: Apache-2.0
"""The lander's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Simulations.
FLIGHTS = ("lander", "dropout")


def _fly(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Verdict]:
    twin = fcsl_sim(f"../sim/{flight}.sim.json", seed=3)
    twin.run_until("engine.outputs.landed", 12_000)
    return twin.requirements


def test_each_requirement_is_exercised_by_a_flight_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, flight) for flight in FLIGHTS) == []


@pytest.mark.violates("LND-3", "LND-4")
def test_a_weak_engine_violates_the_limit_of_speed(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by an engine of half the thrust."""
    twin = fcsl_sim("../sim/lander.sim.json", seed=3, sets=["lander.parameters.max_thrust=1000.0"])
    twin.run_until("lander.outputs.landed", 12_000)
    assert twin.requirements["LND-3"].first["filter.outputs.vel_z"] <= -5.0
