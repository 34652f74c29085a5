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
    paths += ["follow.outputs.cross_track", "follow.outputs.done", "mode.outputs.armed"]
    with SimTwin.from_config(SIM) as twin, twin.trace(*paths) as trace:
        twin.tick(42 * HZ)
    return trace


def at(t_s: float) -> int:
    return round(t_s * HZ)


def test_it_goes_through_its_states(drive: Any) -> None:
    states = drive["machine.state"]
    entered = [(k / HZ, str(states[k])) for k in range(1, len(states)) if states[k] != states[k - 1]]
    assert [state for _, state in entered] == ["MANUAL", "FOLLOW", "MANUAL", "EMERGENCY", "STOPPED"]
    assert [t for t, _ in entered] == pytest.approx([1.01, 4.01, 32.01, 36.01, 40.01], abs=0.021)


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


# ---- the machine alone ------------------------------------------------------------------------------------------------


@pytest.fixture
def twin() -> Iterator[AlgTwin]:
    with AlgTwin.from_config(MACHINE) as opened:
        for channel in opened.channels():
            if channel.direction == "sensor":
                opened.attach(channel.name)
        yield opened


def hands(twin: AlgTwin, ticks: int = 1, **lost: bool) -> None:
    """What the operator and the encoders send, for some ticks, without what is lost."""
    for _ in range(ticks):
        if "operator" not in lost:
            twin.sample("cmd_vel.speed", 0.5)
            twin.sample("cmd_vel.yaw_rate", 0.0)
        if "switches" not in lost:
            twin.sample("mode", 1)
            twin.sample("emergency_stop", False)
        if "wheels" not in lost:
            twin.sample("wheels.left", 0.0)
            twin.sample("wheels.right", 0.0)
        twin.tick()


def test_an_emergency_stop_disarms_in_the_same_tick(twin: AlgTwin) -> None:
    hands(twin, 3)
    assert twin.state() == "MANUAL" and twin.get_value("mode.outputs.armed")
    twin.sample("emergency_stop", True)
    twin.tick()
    assert not twin.get_value("mode.outputs.armed")
    twin.tick()
    assert twin.state() == "EMERGENCY"


@pytest.mark.parametrize(
    ("lost", "patience", "state"),
    [("operator", 50, "STOPPED"), ("switches", 50, "EMERGENCY"), ("wheels", 10, "EMERGENCY")],
)
def test_what_is_lost_stops_it(twin: AlgTwin, lost: str, patience: int, state: str) -> None:
    hands(twin, 20)
    hands(twin, patience, **{lost: True})
    assert twin.state() == "MANUAL"
    hands(twin, 2, **{lost: True})
    assert twin.state() == state
    hands(twin, 3)
    assert twin.state() == ("MANUAL" if state == "STOPPED" else "EMERGENCY")  # the switch is still at 1


def test_a_fault_of_an_algorithm_drives_nowhere(twin: AlgTwin) -> None:
    hands(twin, 200)
    assert twin.get_value("drive.outputs.left") == pytest.approx(5.0)
    twin.fault("mode")
    hands(twin)
    assert twin.get_value("drive.outputs.left") == pytest.approx(
        5.0
    )  # it has no effect of its own, and the next run is whole
    hands(twin, 2)
    assert twin.state() == "MANUAL"


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
