# SPDX-License-Identifier: Apache-2.0
"""The rocket's requirements (fc/requirements.json) over whole flights: met, and each exercised by one of them."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conftest import TICK_HZ, tilt

from simclient import SimTwin, not_exercised
from simclient.requirements import Verdict

#: Name → events in the middle of the flight, and parameters of the start.
FLIGHTS: dict[str, dict[str, list[str]]] = {
    "nominal": {},
    "no_gnss": {"events": ["20.0 receiver.parameters.fault=1"]},
    "no_gnss_no_range": {"events": ["20.0 receiver.parameters.fault=1", "20.0 laser.parameters.fault=1"]},
    "no_imu": {"events": ["20.0 inertial_unit.parameters.fault=1"]},
    "17_kg": {"sets": ["engine.parameters.propellant_mass=17.0"]},
}


def _fly(fcsl_sim: Callable[..., SimTwin], flight: str) -> dict[str, Verdict]:
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, **FLIGHTS[flight])
    twin.run_until("machine.state in ('TOUCHDOWN', 'CUT')", timeout_ticks=60 * TICK_HZ)
    twin.tick(3 * TICK_HZ)
    return twin.requirements


def test_each_requirement_is_exercised_by_a_flight_and_none_is_violated(fcsl_sim: Callable[..., SimTwin]) -> None:
    """The fixture fails a test that violates one."""
    assert not_exercised(_fly(fcsl_sim, flight) for flight in FLIGHTS) == []


@pytest.mark.violates("RKT-9", "RKT-15")
def test_a_rocket_that_falls_over_stops_its_engine(fcsl_sim: Callable[..., SimTwin]) -> None:
    """Two thirds of the thrust are lost over the gate: it hits the pad, and topples. RKT-15 leads to CUT."""
    twin = fcsl_sim("../sim/endless.sim.json", seed=3, events=["26.0 engine.parameters.max_thrust=600.0"])
    twin.run_until("ground.outputs.touching and machine.state == 'TERMINAL'", timeout_ticks=40 * TICK_HZ)
    assert twin.requirements["RKT-9"].first["navigation.outputs.velocity[2]"] > 10.0
    twin.run_until("machine.state == 'CUT'", timeout_ticks=3 * TICK_HZ)
    assert tilt(np.array(twin.get("earth.outputs.attitude_body_to_ned"))) == pytest.approx(45.0, abs=2.0)
    assert twin.get("actuators.outputs.throttle") == 0.0
