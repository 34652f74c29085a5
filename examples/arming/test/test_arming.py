# SPDX-License-Identifier: Apache-2.0
"""Pre-arm checks, arming, kill switch and takeover, flown by a remote control of the test."""

import runpy
import sys
from pathlib import Path

import pytest
from fcsl_builtins import u32

from fcsl_compiler.board.board import check_board
from simclient import AlgTwin

EXAMPLE = Path(__file__).resolve().parents[1]
CHANNELS = ("imu.gyro", "imu.accel", "battery.voltage", "range.distance", "rc.sticks")
HZ = 100
IDLE = [0.0, 0.0, -1.0, 0.0]
#: Of the remote control, as algorithms/rc.py has them.
ROLL, THROTTLE, ARM, MODE, KILL = 0, 2, 4, 5, 6


def reason_bits():
    """Bit → name of the constants of pre_arm.py. The folder must be found, because they import rc.py."""
    sys.path.insert(0, str(EXAMPLE / "algorithms"))
    try:
        module = runpy.run_path(str(EXAMPLE / "algorithms/pre_arm.py"))
    finally:
        sys.path.pop(0)
    return {module[name]: name for name, kind in module["__annotations__"].items() if kind is u32}


BITS = reason_bits()


class Vehicle:
    """The twin with sensors that measure in every tick; one whose sample is None is silent."""

    def __init__(self, twin):
        self.twin = twin
        self.samples = {
            "imu.gyro": [0.0, 0.0, 0.0],
            "imu.accel": [0.0, 0.0, 9.81],
            "battery.voltage": 16.0,
            "range.distance": 0.1,
            "rc.sticks": [0.0, 0.0, -1.0, 0.0, -1.0, -1.0, -1.0, 0.0],
        }
        twin.attach(*CHANNELS)

    def stick(self, channel, value):
        self.samples["rc.sticks"][channel] = value

    def tick(self, seconds=1 / HZ):
        for _ in range(round(seconds * HZ)):
            for channel, sample in self.samples.items():
                if sample is not None:
                    self.twin.sample(channel, sample)
            self.twin.tick()

    def reasons(self):
        bits = self.twin.get_value("pre_arm.outputs.reasons")
        return {name for bit, name in BITS.items() if bits & bit}

    def armed(self):
        return self.twin.get_value("arming.outputs.armed")

    def command(self):
        return self.twin.get_value("selector.outputs.command")

    def state(self):
        """The state that the next tick runs in."""
        return self.twin.get_value("machine.state")

    def arm(self):
        """Waits until arming is allowed, and moves the switch."""
        self.tick(4.0)
        assert self.reasons() == set()
        self.stick(ARM, 1.0)
        self.tick()
        assert self.armed()
        self.tick()
        assert self.state() == "MANUAL"

    def fly(self, state):
        """Brings it into a state: on the ground into STANDBY and SAFE, into the air otherwise."""
        if state == "STANDBY":
            self.tick(4.0)
        elif state == "SAFE":
            self.arm()
            self.stick(KILL, 1.0)
            self.tick(0.1)
            self.stick(KILL, -1.0)
            self.tick(0.1)
        else:
            self.arm()
            self.samples["range.distance"] = 20.0
            self.stick(THROTTLE, 0.2)
            self.tick(3.0)
            self.stick(MODE, 1.0 if state == "AUTO" else -1.0)
            self.tick(0.1)
        assert self.state() == state


@pytest.fixture
def vehicle():
    with AlgTwin.from_config("../arming.json") as twin:
        yield Vehicle(twin)


# ---- pre-arm checks --------------------------------------------------------------------------------------------------


def test_it_begins_disarmed(vehicle):
    assert not vehicle.armed()
    vehicle.twin.tick(50)  # no sensor has told anything
    assert {"NO_GYRO", "NO_ACCEL", "NO_RC", "GRAVITY", "BATTERY_LOW", "THROTTLE_UP"} <= vehicle.reasons()
    assert not vehicle.armed() and vehicle.command() == IDLE


def test_every_bit_is_documented():
    assert sorted(BITS) == [1 << n for n in range(len(BITS))]
    doc = (EXAMPLE / "README.md").read_text()
    for bit, name in BITS.items():
        assert f"| {bit} | `{name}` |" in doc


REASONS = [
    ("NO_GYRO", "imu.gyro", None),
    ("NO_ACCEL", "imu.accel", None),
    ("NO_BATTERY", "battery.voltage", None),
    ("NO_RANGE", "range.distance", None),
    ("NO_RC", "rc.sticks", None),
    ("GRAVITY", "imu.accel", [0.0, 0.0, 10.3]),
    ("GYRO_BIAS", "imu.gyro", [0.0, 0.03, 0.0]),
    ("BATTERY_LOW", "battery.voltage", 14.0),
    ("BATTERY_LOW", "battery.voltage", float("nan")),
    ("THROTTLE_UP", THROTTLE, -0.5),
    ("KILL_ON", KILL, 1.0),
]


@pytest.mark.parametrize(("reason", "what", "value"), REASONS, ids=[f"{name}-{value}" for name, _, value in REASONS])
def test_each_reason_alone_keeps_it_disarmed(vehicle, reason, what, value):
    vehicle.tick(2.0)
    if isinstance(what, int):
        vehicle.stick(what, value)
    else:
        vehicle.samples[what] = value
    vehicle.tick(8.0)
    assert vehicle.reasons() == {reason}
    if reason != "NO_RC":  # without it there is no switch
        vehicle.stick(ARM, 1.0)
    vehicle.tick(1.0)
    assert not vehicle.armed() and vehicle.command() == IDLE


@pytest.mark.parametrize(("channel", "size"), [("imu.gyro", 0.1), ("imu.accel", 1.0)])
def test_moving_alone_keeps_it_disarmed(vehicle, channel, size):
    vehicle.tick(4.0)
    rest = vehicle.samples[channel]
    for n in range(200):
        vehicle.samples[channel] = [rest[0] + (size if n % 2 else -size), *rest[1:]]
        vehicle.stick(ARM, 1.0 if n > 100 else -1.0)
        vehicle.tick()
        assert not vehicle.armed()
    assert vehicle.reasons() == {"MOVING"}


def test_a_sample_that_is_no_number_does_not_stay(vehicle):
    vehicle.tick(4.0)
    vehicle.samples["imu.gyro"] = [float("nan"), 0.0, 0.0]
    vehicle.tick()
    assert vehicle.reasons() == {"MOVING", "GYRO_BIAS"}
    vehicle.samples["imu.gyro"] = [0.0, 0.0, 0.0]
    vehicle.tick(3.0)
    assert vehicle.reasons() == set()


# ---- arming ----------------------------------------------------------------------------------------------------------


def test_a_rising_edge_arms(vehicle):
    vehicle.arm()


def test_a_switch_that_is_on_already_does_not(vehicle):
    vehicle.stick(ARM, 1.0)
    vehicle.tick(6.0)
    assert vehicle.reasons() == set() and not vehicle.armed()
    vehicle.stick(ARM, -1.0)
    vehicle.tick()
    vehicle.stick(ARM, 1.0)
    vehicle.tick()
    assert vehicle.armed()


def test_arming_must_have_been_allowed_for_a_while(vehicle):
    vehicle.tick(4.0)
    vehicle.stick(THROTTLE, 0.0)
    vehicle.tick(0.1)
    vehicle.stick(THROTTLE, -1.0)
    vehicle.tick(0.5)
    vehicle.stick(ARM, 1.0)
    vehicle.tick(2.0)  # the edge came too early, and is lost
    assert vehicle.reasons() == set() and not vehicle.armed()


def test_an_edge_during_a_loss_of_the_remote_control_does_not_arm(vehicle):
    vehicle.tick(4.0)
    sticks, vehicle.samples["rc.sticks"] = vehicle.samples["rc.sticks"], None
    vehicle.tick(0.5)
    sticks[ARM] = 1.0
    vehicle.samples["rc.sticks"] = sticks
    vehicle.tick(3.0)
    assert not vehicle.armed() and vehicle.state() == "STANDBY"


def test_the_switch_disarms_on_the_ground_alone(vehicle):
    vehicle.fly("MANUAL")
    vehicle.stick(ARM, -1.0)
    vehicle.tick(1.0)
    assert vehicle.armed() and vehicle.state() == "MANUAL"
    vehicle.samples["range.distance"] = 0.1
    vehicle.tick()
    assert not vehicle.armed()
    vehicle.tick()
    assert vehicle.state() == "STANDBY" and vehicle.command() == IDLE


# ---- kill switch -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [1.0, float("nan")])
@pytest.mark.parametrize("state", ["STANDBY", "MANUAL", "AUTO", "SAFE"])
def test_the_kill_switch_disarms_in_the_same_tick(vehicle, state, value):
    vehicle.fly(state)
    vehicle.stick(KILL, value)
    vehicle.tick()
    assert not vehicle.armed()
    vehicle.tick(0.1)
    assert vehicle.state() == "SAFE" and vehicle.command() == IDLE


def test_safe_lasts_until_both_switches_are_off(vehicle):
    vehicle.fly("MANUAL")
    vehicle.stick(KILL, 1.0)
    vehicle.tick(1.0)
    vehicle.samples["range.distance"] = 0.1
    vehicle.stick(KILL, -1.0)
    vehicle.stick(THROTTLE, -1.0)
    vehicle.tick(5.0)
    assert vehicle.reasons() == set() and vehicle.state() == "SAFE" and not vehicle.armed()
    vehicle.stick(ARM, -1.0)
    vehicle.tick(0.1)
    assert vehicle.state() == "STANDBY"
    vehicle.arm()


# ---- takeover --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("channel", "value"), [(ROLL, 0.4), (THROTTLE, -0.2), (MODE, -1.0)])
def test_a_stick_or_the_switch_takes_over(vehicle, channel, value):
    vehicle.fly("AUTO")
    vehicle.stick(ROLL, 0.2)  # it moves, not far enough
    vehicle.tick(1.0)
    assert vehicle.state() == "AUTO"
    before = vehicle.command()
    vehicle.stick(channel, value)
    vehicle.tick(2 / HZ)
    assert vehicle.state() == "MANUAL" and vehicle.command() == pytest.approx(before)  # no step
    vehicle.tick(5.0)
    assert vehicle.state() == "MANUAL" and vehicle.armed()
    assert vehicle.command() == pytest.approx(vehicle.samples["rc.sticks"][:4], abs=1e-3)


def test_after_a_takeover_the_mode_switch_must_be_moved(vehicle):
    vehicle.fly("AUTO")
    vehicle.stick(ROLL, 1.0)
    vehicle.tick(2.0)
    vehicle.stick(MODE, -1.0)
    vehicle.tick(0.1)
    assert vehicle.state() == "MANUAL"
    vehicle.stick(MODE, 1.0)
    vehicle.tick(0.1)
    assert vehicle.state() == "AUTO"


def test_auto_keeps_the_throttle(vehicle):
    vehicle.fly("MANUAL")
    vehicle.stick(MODE, 1.0)
    vehicle.tick(0.1)
    assert vehicle.state() == "AUTO" and vehicle.command()[THROTTLE] == pytest.approx(0.2, abs=0.01)


# ---- loss of the remote control --------------------------------------------------------------------------------------


def test_on_the_ground_a_loss_disarms(vehicle):
    vehicle.arm()
    vehicle.samples["rc.sticks"] = None
    vehicle.tick(1.0)
    assert vehicle.armed()
    vehicle.tick(0.5)
    assert not vehicle.armed() and vehicle.state() == "SAFE"


@pytest.mark.parametrize("state", ["MANUAL", "AUTO"])
def test_in_the_air_a_loss_leads_to_auto(vehicle, state):
    vehicle.fly(state)
    sticks, vehicle.samples["rc.sticks"] = vehicle.samples["rc.sticks"], None
    vehicle.tick(1.5)
    assert vehicle.armed() and vehicle.state() == "AUTO"
    sticks[ROLL] = 0.9  # where the stick is when the remote control is back takes nothing over
    vehicle.samples["rc.sticks"] = sticks
    vehicle.tick(0.5)
    assert vehicle.armed() and vehicle.state() == state  # the mode switch still counts


def test_a_range_finder_that_fails_in_the_air_is_no_ground(vehicle):
    vehicle.fly("MANUAL")
    vehicle.samples["range.distance"] = None
    vehicle.samples["rc.sticks"] = None
    vehicle.tick(2.0)
    assert vehicle.armed() and vehicle.state() == "AUTO"


# ---- board -----------------------------------------------------------------------------------------------------------


def test_the_board_has_no_warnings():
    board = check_board(EXAMPLE / "board.json")
    assert board.warnings == () and board.undriven == ()
    assert {channel.name for channel in board.machine.channels} == {*CHANNELS, "surfaces"}
