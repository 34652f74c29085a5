# SPDX-License-Identifier: Apache-2.0
"""The satellite's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import HZ

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Flights: their simulation, and what fails beside. The third loses its gyroscope for 40 s.
FLIGHTS: dict[str, tuple[str, list[str]]] = {
    "nominal": ("satellite", []),
    "star_loss": ("star_loss", []),
    "gyroscope_loss": (
        "satellite",
        ["300.0 inertial_unit.parameters.fault=1", "340.0 inertial_unit.parameters.fault=0"],
    ),
}


def _fly(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Verdict]:
    sim, events = FLIGHTS[flight]
    twin = fcsl_sim(f"../sim/{sim}.sim.json", seed=3, events=events)
    twin.tick(500 * HZ)
    return twin.requirements


def test_each_requirement_is_exercised_by_a_flight_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, flight) for flight in FLIGHTS) == []


@pytest.mark.violates("SAT-1")
def test_without_stars_detumbling_takes_too_long(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a star tracker that is blind from the start."""
    twin = fcsl_sim("../sim/satellite.sim.json", seed=3, sets=["star_camera.parameters.blinded=true"])
    twin.tick(100 * HZ)
    assert twin.requirements["SAT-1"].first_tick == 90 * HZ
