# SPDX-License-Identifier: Apache-2.0
"""The satellite's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import HZ

from simclient import SimTwin
from simclient.requirements import Status

#: Flights: their simulation, and what fails beside. The third loses its gyroscope for 40 s.
FLIGHTS: dict[str, tuple[str, list[str]]] = {
    "nominal": ("satellite", []),
    "star_loss": ("star_loss", []),
    "gyroscope_loss": (
        "satellite",
        ["300.0 inertial_unit.parameters.fault=1", "340.0 inertial_unit.parameters.fault=0"],
    ),
}


def _verdicts(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Status]:
    sim, events = FLIGHTS[flight]
    twin = fcsl_sim(f"../sim/{sim}.sim.json", seed=3, events=events)
    twin.tick(500 * HZ)
    return {id_: verdict.status for id_, verdict in twin.requirements.items()}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_no_requirement_is_violated(fcsl_sim: Callable[..., SimTwin], flight: str) -> None:
    assert Status.VIOLATED not in _verdicts(fcsl_sim, flight).values()


def test_each_requirement_is_exercised_by_a_flight(fcsl_sim: Callable[..., SimTwin]) -> None:
    found = [_verdicts(fcsl_sim, flight) for flight in FLIGHTS]
    assert [id_ for id_ in found[0] if all(one[id_] is Status.NOT_EXERCISED for one in found)] == []


@pytest.mark.violates("SAT-1")
def test_without_stars_detumbling_takes_too_long(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a star tracker that is blind from the start."""
    twin = fcsl_sim("../sim/satellite.sim.json", seed=3, sets=["star_camera.parameters.blinded=true"])
    twin.tick(100 * HZ)
    assert twin.requirements["SAT-1"].first_tick == 90 * HZ
