# SPDX-License-Identifier: Apache-2.0
"""The lander's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from simclient import SimTwin
from simclient.requirements import Status

#: Simulations.
FLIGHTS = ("lander", "dropout")


def _verdicts(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Status]:
    twin = fcsl_sim(f"../sim/{flight}.sim.json", seed=3)
    twin.run_until("engine.outputs.landed", 12_000)
    return {id_: verdict.status for id_, verdict in twin.requirements.items()}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_no_requirement_is_violated(fcsl_sim: Callable[..., SimTwin], flight: str) -> None:
    assert Status.VIOLATED not in _verdicts(fcsl_sim, flight).values()


def test_each_requirement_is_exercised_by_a_flight(fcsl_sim: Callable[..., SimTwin]) -> None:
    found = [_verdicts(fcsl_sim, flight) for flight in FLIGHTS]
    assert [id_ for id_ in found[0] if all(one[id_] is Status.NOT_EXERCISED for one in found)] == []


@pytest.mark.violates("LND-3", "LND-4")
def test_a_weak_engine_violates_the_limit_of_speed(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by an engine of half the thrust."""
    twin = fcsl_sim("../sim/lander.sim.json", seed=3, sets=["lander.parameters.max_thrust=1000.0"])
    twin.run_until("lander.outputs.landed", 12_000)
    assert twin.requirements["LND-3"].first["filter.outputs.vel_z"] <= -5.0
