# SPDX-License-Identifier: Apache-2.0
"""The rover: driven by hand and along its route in the simulation, and what stops it."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from simclient import AlgTwin, SimTwin

EXAMPLE = Path(__file__).resolve().parents[1]
MACHINE, SIM = EXAMPLE / "fc/rover.json", EXAMPLE / "sim/rover.sim.json"
HZ = 100


@pytest.fixture(scope="module")
def drive() -> Any:
    """The whole run: by hand from 1 s on, along the route from 4 s to 32 s, by hand, emergency stop from 36 s to 38 s."""
    paths = [f"rover.outputs.{name}" for name in ("x", "y", "heading", "forward_speed", "yaw_rate", "speed_left")]
    paths += ["machine.state", "odometry.outputs.position", "odometry.outputs.heading", "odometry.outputs.covariance"]
    paths += ["follow.outputs.cross_track", "follow.outputs.done", "mode.outputs.armed", "rover.inputs.command_left"]
    with SimTwin.from_config(SIM) as twin, twin.trace(*paths) as trace:
        twin.tick(42 * HZ)
    return trace


def at(t_s: float) -> int:
    return round(t_s * HZ)


def test_it_goes_through_its_states(drive: Any) -> None:
    states = drive["machine.state"]
    entered = [(k / HZ, str(states[k])) for k in range(1, len(states)) if states[k] != states[k - 1]]
    assert [state for _, state in entered] == ["STOPPED", "MANUAL", "FOLLOW", "MANUAL", "EMERGENCY", "STOPPED"]
    assert [t for t, _ in entered] == pytest.approx([0.01, 1.01, 4.01, 32.01, 36.01, 40.01], abs=0.021)


def test_by_hand_it_drives_the_circle_that_was_asked_for(drive: Any) -> None:
    """v = 0.6 m/s, w = 0.4 rad/s: a radius of 1.5 m; the limiter takes 0.75 s to 0.6 m/s."""
    settled = slice(at(2.5), at(4.0))
    assert drive["rover.outputs.forward_speed"][settled] == pytest.approx(0.6, abs=1e-3)
    assert drive["rover.outputs.yaw_rate"][settled] == pytest.approx(0.4, abs=1e-3)
    acceleration = np.diff(drive["rover.outputs.forward_speed"]) * HZ
    assert acceleration[: at(4.0)].max() < 0.8 + 1e-9


def test_it_follows_the_route_to_its_end_and_stops(drive: Any) -> None:
    joined = slice(at(14.0), at(32.0))
    assert np.abs(drive["follow.outputs.cross_track"][joined]).max() < 0.12
    arrived = np.argmax(drive["follow.outputs.done"])
    assert at(18.0) < arrived < at(24.0)
    k = at(31.9)
    assert np.hypot(drive["rover.outputs.x"][k], drive["rover.outputs.y"][k] - 4.0) < 0.15
    assert abs(drive["rover.outputs.forward_speed"][k]) < 1e-3


def test_odometry_is_the_truth_within_its_deviation(drive: Any) -> None:
    """The encoders have noise of 2 mrad and the wheels no slip: far better than the deviation that it states."""
    position, covariance = drive["odometry.outputs.position"], drive["odometry.outputs.covariance"]
    off = np.column_stack([drive["rover.outputs.x"], drive["rover.outputs.y"]]) - position[:, :2]
    assert np.abs(off).max() < 0.01
    turns = drive["rover.outputs.heading"] - drive["odometry.outputs.heading"]
    assert np.abs(np.angle(np.exp(1j * turns))).max() < 0.01
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    assert (np.abs(off) <= 3.0 * sigma[:, :2] + 1e-3).all() and (np.diff(sigma[at(1.5) : at(4.0), 2]) >= 0.0).all()
    assert 0.05 < sigma[-1, 2] < 1.0


def test_the_emergency_stop_locks_until_the_switch_was_at_0(drive: Any) -> None:
    armed = drive["mode.outputs.armed"]
    assert not armed[at(36.05) : at(40.0)].any() and armed[at(40.1) :].all()
    speed = np.abs(drive["rover.outputs.speed_left"])
    assert speed[at(35.9)] > 3.0 and speed[at(36.5) : at(40.0)].max() < 0.05
    assert speed[at(38.5)] < 1e-6  # released, and the lever still asks for 0.6 m/s
    assert not drive["rover.inputs.command_left"][at(36.1) :].any()  # nor does an old command come when it unlocks


# ---- the machine alone ------------------------------------------------------------------------------------------------


NAN, INF = float("nan"), float("inf")


@pytest.fixture
def twin() -> Iterator[AlgTwin]:
    """Unlocked, and at rest."""
    with AlgTwin.from_config(MACHINE) as opened:
        for channel in opened.channels():
            if channel.direction == "sensor":
                opened.attach(channel.name)
        drive_by(opened, 3, mode=0)
        yield opened


def drive_by(twin: AlgTwin, ticks: int = 1, **sent: Any) -> None:
    """What operator and encoders send for some ticks, in place of half a metre per second by hand; None: it is lost."""
    usual = {"speed": 0.5, "yaw_rate": 0.0, "mode": 1, "stop": False, "left": 0.0, "right": 0.0}
    channels = {"speed": "cmd_vel.speed", "yaw_rate": "cmd_vel.yaw_rate", "mode": "mode", "stop": "emergency_stop"}
    channels |= {"left": "wheels.left", "right": "wheels.right"}
    for _ in range(ticks):
        for name, value in {**usual, **sent}.items():
            if value is not None:
                twin.sample(channels[name], value)
        twin.tick()


def actuated(twin: AlgTwin) -> float:
    """The larger command that the motors get."""
    armed = twin.get_value("mode.outputs.armed")
    return max(abs(twin.get_value(f"drive.outputs.{side}")) for side in ("left", "right")) if armed else 0.0


def test_it_begins_locked() -> None:
    with AlgTwin.from_config(MACHINE) as twin:
        drive_by(twin, 20)
        assert twin.state() == "EMERGENCY" and not twin.get_value("mode.outputs.armed")
        drive_by(twin, 3, mode=0)
        drive_by(twin, 100)
        assert twin.state() == "MANUAL" and actuated(twin) == pytest.approx(5.0)


def test_an_emergency_stop_disarms_in_the_same_tick(twin: AlgTwin) -> None:
    drive_by(twin, 100)
    assert actuated(twin) == pytest.approx(5.0)
    drive_by(twin, stop=True)
    assert not twin.get_value("mode.outputs.armed")
    drive_by(twin)
    assert twin.state() == "EMERGENCY"


@pytest.mark.parametrize(
    ("lost", "patience", "state"),
    [
        ({"speed": None, "yaw_rate": None}, 50, "STOPPED"),
        ({"mode": None, "stop": None}, 50, "EMERGENCY"),
        ({"left": None, "right": None}, 10, "EMERGENCY"),
        ({"speed": NAN}, 0, "STOPPED"),
        ({"yaw_rate": INF}, 0, "STOPPED"),
        ({"left": NAN}, 0, "EMERGENCY"),
        ({"mode": 3}, 0, "STOPPED"),
        ({"mode": -1}, 0, "STOPPED"),
    ],
)
def test_what_is_lost_or_no_number_stops_it(twin: AlgTwin, lost: dict[str, Any], patience: int, state: str) -> None:
    drive_by(twin, 100)
    drive_by(twin, patience, **lost)
    assert twin.state() == "MANUAL"
    drive_by(twin, 2, **lost)
    assert twin.state() == state
    drive_by(twin, 70, **lost)
    assert actuated(twin) < 1e-9
    drive_by(twin, 3)
    assert twin.state() == ("MANUAL" if state == "STOPPED" else "EMERGENCY")  # the switch is at 1


def test_encoders_without_numbers_end_the_route(twin: AlgTwin) -> None:
    drive_by(twin, 100, mode=2)
    assert twin.state() == "FOLLOW" and actuated(twin) > 5.0
    drive_by(twin, 3, mode=2, left=NAN, right=NAN)
    assert twin.state() == "EMERGENCY" and actuated(twin) == 0.0


@pytest.mark.parametrize(
    "instance", ["mode", "command", "follow", "drive", "odometry", "operator", "switches", "wheels"]
)
@pytest.mark.parametrize("mode", [1, 2])
def test_a_fault_that_lasts_brings_it_to_rest(twin: AlgTwin, instance: str, mode: int) -> None:
    """With the lever far over, and the emergency stop pressed while `mode` cannot see it."""
    drive_by(twin, 100, mode=mode)
    assert actuated(twin) > 3.0
    takes_part = (instance, mode) not in (("follow", 1), ("operator", 2))
    for _ in range(150):
        twin.fault(instance)
        drive_by(twin, mode=mode, speed=-0.9, yaw_rate=1.0, stop=instance == "mode")
        assert actuated(twin) <= 8.0 + 1e-9 or not takes_part  # 0.8 m/s, which the route may have
    assert actuated(twin) < 1e-9 or not takes_part


def test_machine_and_plant_have_one_geometry() -> None:
    geometry = json.loads((EXAMPLE / "fc/geometry.json").read_text())
    with SimTwin.from_config(SIM) as twin:
        separation = geometry["wheel_separation"]["value"]
        assert twin.get("rover.parameters.wheel_separation") == separation
        for instance in ("drive", "odometry"):
            assert twin.get_value(f"{instance}.parameters.wheel_separation") == separation
        assert (
            twin.get_value("drive.parameters.max_wheel_speed") == 15.0 == twin.get("rover.parameters.max_wheel_speed")
        )
