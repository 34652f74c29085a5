# SPDX-License-Identifier: Apache-2.0
"""All together, recorded and flown again."""

from __future__ import annotations

import math
import re
import subprocess
import time
from pathlib import Path

from ..guest import battery
from ..guest.chips import Bmi160, Bmp280, Mag3110
from ..guest.i2c import I2cBus
from ..trials import Failed, expect
from .craft import Craft
from .inertial import BOTTOM, TOP
from .others import joystick
from .outputs import Servos, plug
from .process import Flight, Guard, linux, until

_FLIGHT_S, _SCENES_HZ = 20.0, 20.0
_LOST_S, _BACK_S = 8.0, 10.0  # of the first inertial sensor
_DEVICES = ("top", "bottom", "barometer", "magnetometer", "battery", "joystick")
_DROPPED_MAX = 0.05
_REPLAY_LIMIT_S = 60.0


class World:
    """What the devices measure, by the time."""

    def __init__(self, bus: I2cBus) -> None:
        self.top, self.bottom = Bmi160(bus, TOP), Bmi160(bus, BOTTOM)
        self.air, self.magnetometer, self.sticks = Bmp280(bus), Mag3110(bus), joystick()
        for chip in (self.top, self.bottom, self.air, self.magnetometer):
            chip.replug()
        self._is_lost = False

    def set_time(self, now: float) -> None:
        self._lose_top(_LOST_S < now < _BACK_S)
        for imu in (self.bottom,) if self._is_lost else (self.top, self.bottom):
            imu.set_motion(
                (0.1 * math.sin(3.0 * now), 0.0, 9.81), (0.3 * math.sin(now), 0.5 * math.cos(2.0 * now), 0.1)
            )
        self.air.set_air(101325.0 - 12.0 * now, 20.0)
        self.magnetometer.set_field((20e-6 * math.cos(now), 20e-6 * math.sin(now), 43e-6))
        battery.set_battery(16.8 - 0.05 * now, -10.0, 0.9)
        self.sticks.move({0: round(500.0 * math.sin(now)), 1: round(500.0 * math.cos(now))})

    def _lose_top(self, is_lost: bool) -> None:
        if is_lost != self._is_lost:
            (self.top.unplug if is_lost else self.top.plug)()
            self._is_lost = is_lost


def fly(world: World, flight: Flight) -> None:
    begin = time.monotonic()
    scene = 0
    while (now := time.monotonic() - begin) < _FLIGHT_S:
        world.set_time(now)
        flight.set(throttle=0.5 + 0.5 * math.sin(now))
        scene += 1
        time.sleep(max(0.0, begin + scene / _SCENES_HZ - time.monotonic()))


def check(flight: Flight, servos: Servos) -> None:
    """The last values: those of a world that stands still now. The guest's processor may keep a tick waiting, which costs samples."""
    flight.set(throttle=0.25, steer=0.5)
    servos.until((1250.0, 1310.0))
    flight.until_output("pressure", 101325.0 - 12.0 * _FLIGHT_S, 5.0)
    flight.until_output("voltage", 16.8 - 0.05 * _FLIGHT_S, 0.01)
    for device in _DEVICES:
        samples, dropped = (flight.get(f"hal.devices.{device}.{name}") for name in ("samples", "dropped"))
        if flight.get(f"hal.devices.{device}.open") != 1 or dropped > _DROPPED_MAX * samples:
            raise Failed(f"device {device} is not open, or {dropped} of {samples} samples were dropped")
    flight.until_value("hal.sensors.imu.condition.top", 0)
    flight.until_value("machine.state", "FLIGHT")
    if "sensor 'imu': primary is device 'bottom'" not in flight.said():
        raise Failed("the second inertial sensor was never primary")
    on_its_head = flight.get("hal.sensors.imu.primary") == 2
    expect("accel z", flight.output("accel")[2], -9.81 if on_its_head else 9.81, 0.01)


def replay(craft: Craft, bag: Path) -> str:
    words = ["--library", craft.library("craft"), "--board", craft.plan("whole")]
    line = ["fcsl", "replay", str(bag), *map(str, words)]
    done = subprocess.run(line, capture_output=True, text=True, timeout=_REPLAY_LIMIT_S, check=False)
    if done.returncode != 0 or "identical" not in done.stdout:
        raise Failed(f"the replay says {done.stdout} {done.stderr}")
    return done.stdout.strip()


def describe(flight: Flight, guard: Guard) -> str:
    """How much the one processor of the guest missed."""
    ticks = re.search(r"\d+ ticks, \d+ deadlines missed", flight.said())
    periods = re.search(r"\d+ periods, \d+ missed", guard.said())
    if ticks is None or periods is None:
        raise Failed(f"no counters: {flight.said()} {guard.said()}")
    return f"{ticks[0]}; guard: {periods[0]}"


def try_whole(bus: I2cBus, craft: Craft) -> str:
    """Every sensor changes in flight, the servos follow, and one of two inertial sensors goes and comes back."""
    servos, world, bag = plug(bus), World(bus), Path("/tmp/whole")
    with (
        Guard(craft, craft.plan("whole")) as guard,
        linux(craft, "whole", "--guard", guard.slot, "--record", bag) as flight,
    ):
        until("the flight flies", lambda: flight.get("machine.state") == "FLIGHT")
        flight.set(arm=True)
        fly(world, flight)
        check(flight, servos)
        if flight.end() != 0 or guard.end() != 0:
            raise Failed(f"it ends with an error: {flight.said()} {guard.said()}")
        figures = describe(flight, guard)
    world.sticks.close()
    return (
        f"{_FLIGHT_S:g} s with {len(_DEVICES)} devices of sensors and 2 servos; {figures}; replay: {replay(craft, bag)}"
    )
