# SPDX-License-Identifier: Apache-2.0
"""The quadrotor's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conftest import TICK_HZ

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Name → what happens in the middle of the mission.
FLIGHTS = {
    "nominal": [],
    "no_gnss": ["18.0 receiver.parameters.fault=1"],
    "no_barometer": ["18.0 baro.parameters.fault=1"],
    "no_imu": ["18.0 inertial_unit.parameters.fault=1"],
    "old_battery": ["18.0 battery.parameters.resistance=0.1"],
}


def _fly(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Verdict]:
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, events=FLIGHTS[flight])
    twin.tick(44 * TICK_HZ)
    assert twin.get("ground.outputs.touching") and not twin.get("mixer.outputs.running")
    return twin.requirements


def test_each_requirement_is_exercised_by_a_flight_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, flight) for flight in FLIGHTS) == []


@pytest.mark.violates("QUA-10")
def test_a_weak_motor_leaves_the_path(fcsl_sim: Callable[..., SimTwin]) -> None:
    """A requirement can be violated: here by a motor with eight times the resistance."""
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, events=["18.0 motor_1.parameters.resistance=1.0"])
    twin.tick(20 * TICK_HZ)
    assert 18 * TICK_HZ < (twin.requirements["QUA-10"].first_tick or 0) < 20 * TICK_HZ
