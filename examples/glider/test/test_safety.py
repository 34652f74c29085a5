# SPDX-License-Identifier: Apache-2.0
"""What happens when the airspeed, the satellites, the barometer or the IMU are lost in the middle of the flight."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from conftest import SILENT, STUCK, TICK_HZ, ZERO
from design import parameters

from fcsl_sim import Simulation
from simclient import AlgTwin, SimTwin


@pytest.mark.parametrize("kind, within_s", [(SILENT, 0.4), (STUCK, 0.6), (ZERO, 1.8)])
def test_without_airspeed_it_holds_its_pitch_and_lands(mission: SimTwin, kind: int, within_s: float) -> None:
    """Wings level, the pitch within 2 degrees, above the stall, down to the ground, where it stands."""
    mission.set("pitot_tube.parameters.fault", kind)
    mission.run_until("machine.state == 'SAFE'", timeout_ticks=int(within_s * TICK_HZ))
    mission.tick(4 * TICK_HZ)
    with mission.trace("angles.outputs.pitch", "angles.outputs.roll", "air.outputs.airspeed") as trace:
        mission.tick(20 * TICK_HZ)
    wanted = parameters("safe")["pitch"]
    assert np.abs(trace["angles.outputs.pitch"] - wanted).max() < math.radians(2.0)
    assert np.abs(trace["angles.outputs.roll"]).max() < math.radians(6.0)
    assert 10.0 < trace["air.outputs.airspeed"].min() and trace["air.outputs.airspeed"].max() < 15.0
    mission.run_until("ground.outputs.touching", timeout_ticks=200 * TICK_HZ)
    assert 0.2 < mission.get("earth.outputs.velocity_ned")[2] < 2.0
    mission.run_until("machine.state == 'STANDBY'", timeout_ticks=30 * TICK_HZ)


def test_an_airspeed_that_is_far_off_is_refused_by_the_filter(mission: SimTwin) -> None:
    """Water in the tube: 5 % of the pressure, from one moment to the next. Not silent, not stuck."""
    mission.set("pitot_tube.parameters.scale_error", -0.95)
    mission.run_until("machine.state == 'SAFE'", timeout_ticks=4 * TICK_HZ)
    assert mission.get("airspeed.outputs.valid")


def test_it_goes_on_when_the_tube_is_free_again(mission: SimTwin) -> None:
    mission.set("pitot_tube.parameters.fault", STUCK)
    mission.run_until("machine.state == 'SAFE'", timeout_ticks=TICK_HZ)
    mission.tick(5 * TICK_HZ)
    mission.set("pitot_tube.parameters.fault", 0)
    taken = mission.run_until("machine.state == 'GLIDE'", timeout_ticks=5 * TICK_HZ)
    assert taken / TICK_HZ == pytest.approx(parameters("safe")["good_s"], abs=0.5)
    mission.run_until("machine.state == 'WAYPOINT'", timeout_ticks=15 * TICK_HZ)


def test_the_filter_knows_the_airspeed_for_a_while(mission: SimTwin) -> None:
    """From velocity and wind, within 1.5 m/s RMS for 20 s: `airspeed` goes on for the schedule of the gains."""
    mission.set("pitot_tube.parameters.fault", SILENT)
    mission.tick(TICK_HZ)
    with mission.trace("air.outputs.airspeed", "navigation.outputs.airspeed") as trace:
        mission.tick(20 * TICK_HZ)
    error = trace["navigation.outputs.airspeed"] - trace["air.outputs.airspeed"]
    assert np.sqrt(np.mean(error**2)) < 1.5


@pytest.mark.parametrize("kind", [SILENT, STUCK, ZERO])
def test_without_satellites_it_glides_straight_and_lands(mission: SimTwin, kind: int) -> None:
    mission.set("receiver.parameters.fault", kind)
    mission.run_until("machine.state == 'GLIDE'", timeout_ticks=5 * TICK_HZ)
    mission.tick(10 * TICK_HZ)
    assert mission.state() == "GLIDE"
    mission.run_until("machine.state == 'FLARE'", timeout_ticks=200 * TICK_HZ)
    mission.run_until("ground.outputs.touching", timeout_ticks=30 * TICK_HZ)
    assert 0.0 < mission.get("earth.outputs.velocity_ned")[2] < 2.0


@pytest.mark.parametrize("kind", [SILENT])
def test_without_imu_the_surfaces_are_neutral(mission: SimTwin, kind: int) -> None:
    mission.set("inertial_unit.parameters.fault", kind)
    mission.run_until("machine.state == 'SAFE'", timeout_ticks=TICK_HZ // 5)
    assert [mission.get(f"surfaces.outputs.{name}") for name in ("elevator", "aileron", "rudder")] == [0.0] * 3


def test_nothing_starts_before_the_filter_is_ready(fly: Callable[..., Simulation]) -> None:
    with fly(2, sets=["receiver.parameters.fault=1"]) as sim:
        sim.run(10 * TICK_HZ)
        assert sim.state == "STANDBY" and not sim.machine_value("navigation.outputs.ready")
        assert sim.machine_value("surfaces.outputs.elevator") == 0.0


def test_the_airspeed_of_the_tube(fcsl: Callable[..., AlgTwin]) -> None:
    """V = sqrt(2 p / density); not valid after 15 equal samples, nor while the tube is silent."""
    twin = fcsl("../fc/glider.json", instances=["pitot", "airspeed"])
    twin.attach("pitot.pressure")
    for sample in (80.0, 81.0):
        twin.sample("pitot.pressure", sample)
        twin.tick()
    assert twin.get_value("airspeed.outputs.airspeed") == pytest.approx(math.sqrt(2.0 * 81.0 / 1.225))
    for _ in range(14):
        twin.sample("pitot.pressure", 81.0)
        twin.tick()
        assert twin.get_value("airspeed.outputs.valid")
    twin.sample("pitot.pressure", 81.0)
    twin.tick()
    assert not twin.get_value("airspeed.outputs.valid")
    twin.sample("pitot.pressure", 82.0)
    twin.tick()
    assert twin.get_value("airspeed.outputs.valid")
    twin.tick(11)
    assert not twin.get_value("airspeed.outputs.valid")
