# SPDX-License-Identifier: Apache-2.0
"""The quadrotor's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import TICK_HZ

from simclient import SimTwin
from simclient.requirements import Status

#: Name → what happens in the middle of the mission.
FLIGHTS = {
    "nominal": [],
    "no_gnss": ["18.0 receiver.parameters.fault=1"],
    "no_barometer": ["18.0 baro.parameters.fault=1"],
    "no_imu": ["18.0 inertial_unit.parameters.fault=1"],
    "old_battery": ["18.0 battery.parameters.resistance=0.1"],
}


def _verdicts(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Status]:
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, events=FLIGHTS[flight])
    twin.tick(44 * TICK_HZ)
    assert twin.get("ground.outputs.touching") and not twin.get("mixer.outputs.running")
    return {id_: verdict.status for id_, verdict in twin.requirements.items()}


@pytest.mark.parametrize("flight", FLIGHTS)
def test_no_requirement_is_violated(fcsl_sim: Callable[..., SimTwin], flight: str) -> None:
    assert Status.VIOLATED not in _verdicts(fcsl_sim, flight).values()


def test_each_requirement_is_exercised_by_a_flight(fcsl_sim: Callable[..., SimTwin]) -> None:
    found = [_verdicts(fcsl_sim, flight) for flight in FLIGHTS]
    assert [id_ for id_ in found[0] if all(one[id_] is Status.NOT_EXERCISED for one in found)] == []


@pytest.mark.violates("QUA-10")
def test_a_weak_motor_leaves_the_path(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a motor with eight times the resistance."""
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, events=["18.0 motor_1.parameters.resistance=1.0"])
    twin.tick(20 * TICK_HZ)
    assert 18 * TICK_HZ < (twin.requirements["QUA-10"].first_tick or 0) < 20 * TICK_HZ
