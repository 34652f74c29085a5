# SPDX-License-Identifier: Apache-2.0
"""What happens when sensors, the radio link or the battery fail in the middle of the mission."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from conftest import TICK_HZ

from fcsl_sim import Simulation
from simclient import AlgTwin, SimTwin

SILENT, STUCK, ZERO = 1, 2, 3
PATIENCE_S = 0.5  # of the monitor


def landed(twin: SimTwin, state: str) -> float:
    """Runs into the state and on until the motors stop. Returns the speed of the touchdown, m/s."""
    twin.run_until(f"machine.state == '{state}'", timeout_ticks=int(1.5 * TICK_HZ))
    assert twin.get("mixer.outputs.running")
    twin.run_until("ground.outputs.touching", timeout_ticks=20 * TICK_HZ)
    speed: float = twin.get("earth.outputs.velocity_ned")[2]
    twin.run_until("not mixer.outputs.running", timeout_ticks=25 * TICK_HZ)
    twin.tick(TICK_HZ)
    assert twin.get("ground.outputs.touching")
    assert np.linalg.norm(twin.get("earth.outputs.velocity_ned")) < 0.05
    return speed


@pytest.mark.parametrize("kind", [SILENT, STUCK, ZERO])
def test_without_gnss_it_sinks_level_and_stops_its_motors(mission: SimTwin, kind: int) -> None:
    begin = np.array(mission.get("earth.outputs.position_ned"))
    mission.set("receiver.parameters.fault", kind)
    assert 0.4 < landed(mission, "SAFE") < 1.1
    assert mission.state() == "SAFE"
    drift = np.array(mission.get("earth.outputs.position_ned")) - begin
    assert np.linalg.norm(drift[:2]) < 20.0  # the wind carries it for 7 s


def test_safe_comes_when_the_last_fix_is_too_old(mission: SimTwin) -> None:
    mission.run_until("navigation.outputs.aid_age[0] == 0.0", timeout_ticks=30)
    mission.set("receiver.parameters.fault", SILENT)
    taken = mission.run_until("machine.state == 'SAFE'", timeout_ticks=TICK_HZ)
    assert taken / TICK_HZ == pytest.approx(PATIENCE_S, abs=0.02)


def test_without_gnss_and_barometer_the_rotors_limit_the_fall(mission: SimTwin) -> None:
    mission.set_many({"receiver.parameters.fault": SILENT, "baro.parameters.fault": SILENT})
    assert 0.3 < landed(mission, "SAFE") < 1.5


@pytest.mark.parametrize("sensor, kind", [("baro", SILENT), ("baro", ZERO), ("compass", SILENT), ("compass", ZERO)])
def test_a_sensor_that_can_be_missed_ends_the_mission(mission: SimTwin, sensor: str, kind: int) -> None:
    mission.set(f"{sensor}.parameters.fault", kind)
    begin = np.array(mission.get("reference.outputs.target"))
    assert 0.4 < landed(mission, "LAND") < 1.1
    assert mission.state() == "STANDBY"
    assert np.linalg.norm((np.array(mission.get("earth.outputs.position_ned")) - begin)[:2]) < 3.5


@pytest.mark.parametrize("kind", [SILENT, STUCK, ZERO])
def test_without_imu_the_motors_stop_within_50_ms(mission: SimTwin, kind: int) -> None:
    mission.set("inertial_unit.parameters.fault", kind)
    mission.run_until("machine.state == 'SAFE'", timeout_ticks=int(0.05 * TICK_HZ))
    assert not mission.get("mixer.outputs.running")
    assert [mission.get(f"mixer.outputs.throttle_{k}") for k in range(1, 5)] == [0.0] * 4


def test_a_second_without_orders_ends_the_mission(fcsl: Callable[..., AlgTwin]) -> None:
    """In the monitor alone: the plant always brings orders."""
    twin = fcsl("../fc/quadrotor.json", instances=["operator", "monitor"])
    nominal = {"imu_valid": True, "aligned": True, "aid_age": [0.0] * 6, "voltage": 12.0}
    twin.set_many({f"monitor.inputs.{name}": value for name, value in nominal.items()})
    twin.attach("operator.order")
    twin.sample("operator.order", 2)
    twin.tick()
    assert twin.get_value("monitor.outputs.health") == "nominal"
    assert (
        twin.run_until("monitor.outputs.health != 'nominal'", timeout_ticks=300) == TICK_HZ + 1
    )  # the age that is too old
    assert twin.get_value("monitor.outputs.health") == "degraded"
    assert twin.get_value("monitor.outputs.transition_request") == "tr_LAND"


def test_a_low_battery_ends_the_mission(mission: SimTwin) -> None:
    mission.set("battery.state.charge", 0.03)
    mission.run_until("battery_sensor.outputs.voltage < 9.9", timeout_ticks=TICK_HZ)
    taken = mission.run_until("machine.state == 'LAND'", timeout_ticks=4 * TICK_HZ)
    assert taken / TICK_HZ == pytest.approx(2.0, abs=0.2)


def test_nothing_flies_before_the_filter_is_ready(fly: Callable[..., Simulation]) -> None:
    with fly(2, sets=["receiver.parameters.fault=1"]) as sim:
        sim.run(12 * TICK_HZ)
        assert sim.state == "STANDBY" and not sim.machine_value("monitor.outputs.ready")
        assert not sim.machine_value("mixer.outputs.running")
