# SPDX-License-Identifier: Apache-2.0
"""What happens when a sensor is lost, or the propellant runs low, in the middle of the flight."""

from __future__ import annotations

import numpy as np
import pytest
from conftest import LEG, SILENT, STUCK, TICK_HZ, ZERO, Array, landed, parameters, tilt

from simclient import SimTwin


def touchdown(twin: SimTwin) -> Array:
    """Runs until the engine is off and a second on. Returns the velocity of the first contact, m/s."""
    twin.run_until("ground.outputs.touching", timeout_ticks=60 * TICK_HZ)
    velocity = np.array(twin.get("earth.outputs.velocity_ned"))
    twin.run_until("machine.state == 'TOUCHDOWN'", timeout_ticks=5 * TICK_HZ)
    twin.tick(3 * TICK_HZ)
    assert twin.get("actuators.outputs.throttle") == 0.0
    assert np.linalg.norm(twin.get("earth.outputs.velocity_ned")) < 0.1
    assert tilt(np.array(twin.get("earth.outputs.attitude_body_to_ned"))) < 1.0
    return velocity


@pytest.mark.parametrize("kind", [SILENT, STUCK, ZERO])
def test_without_gnss_it_lands_upright_where_it_is(descending: SimTwin, kind: int) -> None:
    """Softly; the speed over ground that the filter carries on for 12 s is off by less than 1.5 m/s."""
    descending.set("receiver.parameters.fault", kind)
    descending.run_until("machine.state == 'SAFE'", timeout_ticks=int(1.3 * TICK_HZ))
    velocity = touchdown(descending)
    assert 0.3 < velocity[2] < 1.2 and np.hypot(*velocity[:2]) < 1.5
    assert descending.get("engine.outputs.propellant_mass") > 5.0


def test_safe_comes_when_the_last_fix_is_too_old(descending: SimTwin) -> None:
    descending.run_until("estimate.outputs.gnss_age == 0.0", timeout_ticks=30)
    descending.set("receiver.parameters.fault", SILENT)
    taken = descending.run_until("machine.state == 'SAFE'", timeout_ticks=2 * TICK_HZ)
    assert taken / TICK_HZ == pytest.approx(parameters("monitor")["gnss_patience"], abs=0.03)


@pytest.mark.parametrize("kind", [SILENT, STUCK, ZERO])
def test_without_range_finder_it_lands_on_the_pad(descending: SimTwin, kind: int) -> None:
    """It sinks with the speed of the touchdown from 3 m on, and takes a second to know the ground."""
    descending.set("laser.parameters.fault", kind)
    descending.run_until("machine.state == 'TERMINAL'", timeout_ticks=20 * TICK_HZ)
    velocity = touchdown(descending)
    assert 0.3 < velocity[2] < 1.2 and np.hypot(*velocity[:2]) < 0.8
    assert np.hypot(*descending.get("earth.outputs.position_ned")[:2]) < 3.0


def test_without_both_it_still_lands_softly(descending: SimTwin) -> None:
    descending.set_many({"receiver.parameters.fault": SILENT, "laser.parameters.fault": SILENT})
    velocity = touchdown(descending)
    assert 0.2 < velocity[2] < 1.5 and np.hypot(*velocity[:2]) < 3.0


def test_the_last_seconds_need_no_gnss(descending: SimTwin) -> None:
    """From the gate on the filter carries the position: no change of state, and the pad is met."""
    descending.run_until("machine.state == 'TERMINAL'", timeout_ticks=20 * TICK_HZ)
    descending.set("receiver.parameters.fault", SILENT)
    velocity = touchdown(descending)
    assert 0.3 < velocity[2] < 1.2 and np.hypot(*descending.get("earth.outputs.position_ned")[:2]) < 3.0


@pytest.mark.parametrize("kind, ticks", [(SILENT, 8), (STUCK, 8), (ZERO, 22)])
def test_without_imu_the_engine_stops(descending: SimTwin, kind: int, ticks: int) -> None:
    """Within 80 ms; an accelerometer that measures zero, which a bounce does too, takes 0.22 s."""
    descending.set("inertial_unit.parameters.fault", kind)
    descending.run_until("machine.state == 'CUT'", timeout_ticks=ticks)
    assert descending.get("actuators.outputs.throttle") == 0.0
    descending.set("inertial_unit.parameters.fault", 0)
    descending.tick(TICK_HZ)
    assert descending.state() == "CUT" and descending.get("actuators.outputs.throttle") == 0.0


def test_nothing_starts_before_the_filter_is_ready(standing: SimTwin) -> None:
    standing.set("receiver.parameters.fault", SILENT)
    standing.tick(9 * TICK_HZ)
    assert standing.state() == "STANDBY" and not standing.get("estimate.outputs.ready")
    assert standing.get("actuators.outputs.throttle") == 0.0


def test_it_does_not_start_without_propellant(standing: SimTwin) -> None:
    standing.set("engine.state.propellant_mass", 13.0)
    standing.tick(9 * TICK_HZ)
    assert standing.state() == "STANDBY"


def test_it_ends_the_climb_when_propellant_runs_low(standing: SimTwin) -> None:
    """17 kg instead of 26: it turns to the pad at about half of the height, and lands on it."""
    standing.set("engine.state.propellant_mass", 17.0)
    standing.run_until("machine.state == 'DESCENT'", timeout_ticks=20 * TICK_HZ)
    assert 20.0 < standing.get("earth.outputs.height") < 60.0
    found = landed(standing)
    assert found.states == ["TERMINAL", "TOUCHDOWN"] and found.at_rest
    assert found.velocity[2] < 1.2 and found.miss < 3.0 and found.propellant > 4.0


def test_a_leak_ends_in_a_landing_where_it_is(descending: SimTwin) -> None:
    """1.5 kg less than what a vertical landing takes with the reserve: SAFE, and a soft touchdown."""
    needed = descending.get("monitor.outputs.needed") + parameters("monitor")["reserve"]
    descending.set("engine.state.propellant_mass", needed - 1.5)
    descending.run_until("machine.state == 'SAFE'", timeout_ticks=4 * TICK_HZ)
    assert descending.get("earth.outputs.height") > LEG + 20.0
    assert touchdown(descending)[2] < 1.2
    assert descending.get("engine.outputs.propellant_mass") > 0.5
