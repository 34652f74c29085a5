# SPDX-License-Identifier: Apache-2.0
"""Slow sensors, sticks, and a CAN bus that paces a machine."""

from __future__ import annotations

import socket
import struct
import subprocess
import time
from pathlib import Path

from ..guest import battery
from ..guest.chips import Bmp280, Ina226, LidarLite, Mag3110
from ..guest.i2c import I2cBus
from ..guest.joystick import Joystick
from ..guest.vcan import add_vcan
from ..trials import Failed, expect, expect_all
from .craft import Craft
from .process import Flight, after, in_ms, linux, until

_STICK = (-512, 511)
_STILL_S = 1.5
_FRAMES, _FRAMES_HZ = 400, 200.0
_LISTENERS = Path("/proc/net/can/rcvlist_sff")
_LIMIT_S = 10.0


def joystick() -> Joystick:
    return Joystick("flight joystick", {axis: _STICK for axis in range(4)}, ())


def try_slow(bus: I2cBus, craft: Craft) -> str:
    """Air, field, distance, battery, temperature, voltage: in the units of the channels."""
    air, magnetometer, lidar, monitor = Bmp280(bus), Mag3110(bus), LidarLite(bus), Ina226(bus)
    for chip in (air, magnetometer, lidar, monitor):
        chip.plug()
    battery.set_status("discharging")
    with linux(craft, "others") as flight:
        air.set_air(95000.0, 12.0)
        magnetometer.set_field((20e-6, -5e-6, 43e-6))
        lidar.set_distance(12.34)
        monitor.set_supply(22.2, 3.5)
        battery.set_battery(14.8, -6.5, 0.8)
        battery.set_temperature(45.5)
        flight.until_output("pressure", 95000.0, 1.0)
        flight.until_output("field", (-20e-6, -5e-6, -43e-6), 1e-12)  # turned by 180 degrees about y
        flight.until_output("distance", 12.34, 1e-9)
        flight.until_output("supply", 22.2, 1e-9)
        flight.until_output("voltage", 14.8, 1e-9)
        flight.until_output("current", 6.5, 1e-9)
        flight.until_output("charge", 0.8, 1e-9)
        flight.until_output("zone", 45.5, 1e-9)
        battery.set_status("charging")
        flight.until_output("current", -6.5, 1e-9)
        lidar.set_distance(None)
        flight.until_value("channels.range.distance.valid", False)
        lidar.set_distance(3.21)
        flight.until_value("channels.range.distance.valid", True)
        expect("distance", flight.output("distance"), 3.21, 1e-9)
        flight.until_said("device 'lidar' fails: in_distance: Invalid argument")
    return "Pa, T, m, V, A, charge, degC; nothing before the lidar: invalid, then valid again"


def try_rc(bus: I2cBus, craft: Craft) -> str:
    """Sticks from end to end; one that nobody moves; unplugged and plugged."""
    sticks = joystick()
    with linux(craft, "others") as flight:
        flight.until_value("hal.sensors.rc.primary", 1)
        sticks.move({0: -512, 1: 511, 2: 100, 3: -512})
        flight.until_output("sticks", (-1.0, 1.0, 2.0 * 612.0 / 1023.0 - 1.0, -1.0), 1e-6)
        move_s = after(lambda: sticks.move({3: 511}), lambda: flight.until_output("sticks", _moved(), 1e-6))
        check_still(flight)
        lost_s = after(sticks.close, lambda: flight.until_value("channels.rc.sticks.valid", False))
        sticks = joystick()
        back_s = flight.until_value("channels.rc.sticks.valid", True)
        expect_all("sticks", flight.output("sticks"), (-1.0 / 1023.0,) * 4, 1e-6)
    sticks.close()
    return (
        f"-1 to 1, {in_ms(move_s)} after a move; still for {_STILL_S} s: valid; "
        f"unplugged: invalid after {in_ms(lost_s)}; plugged: valid after {in_ms(back_s)}"
    )


def _moved() -> tuple[float, ...]:
    return (-1.0, 1.0, 2.0 * 612.0 / 1023.0 - 1.0, 1.0)


def check_still(flight: Flight) -> None:
    """A stick that nobody moves sends no event."""
    end = time.monotonic() + _STILL_S
    while time.monotonic() < end:
        if not flight.get("channels.rc.sticks.valid") or flight.get("hal.sensors.rc.condition.joystick") != 0:
            raise Failed("a stick that nobody moves is invalid")
        time.sleep(0.02)


def send_frames(interface: str) -> None:
    """Frames of the rate whose values count up."""
    begin = time.monotonic()
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as bus:
        bus.bind((interface,))
        for number in range(_FRAMES):
            time.sleep(max(0.0, begin + number / _FRAMES_HZ - time.monotonic()))
            data = struct.pack("<h", -number) + struct.pack(">H", number)
            bus.send(struct.pack("=IB3x8s", 0x124, 4, data))  # another one
            bus.send(struct.pack("=IB3x8s", 0x123, 4, data))


def try_can(bus: I2cBus, craft: Craft) -> str:
    """Each frame is a tick; silence ends the flight."""
    add_vcan("vcan0")
    with Flight(craft, "--hal", f"linux:{craft.plan('listener')}", machine="listener") as flight:
        until("the flight listens", lambda: " 123 " in _LISTENERS.read_text())
        begin = time.monotonic()
        send_frames("vcan0")
        took_s = time.monotonic() - begin
        until("all frames are ticks", lambda: flight.get("machine.tick") == _FRAMES)
        expect("sum", flight.get("listener.outputs.sum"), -0.25 * sum(range(_FRAMES)), 0.0)
        expect("last value", flight.get("listener.outputs.last_big"), 0.5 * (_FRAMES - 1) - 40.0, 0.0)
        try:
            status = flight.process.wait(_LIMIT_S)
        except subprocess.TimeoutExpired:
            raise Failed("silence does not end the flight") from None
        said = flight.said()
        if status != 1 or "device 'bus', which paces the loop, has given nothing for" not in said:
            raise Failed(f"silence ends the flight with {status}: {said}")
        if f"fcsl-fc: {_FRAMES} ticks," not in said:
            raise Failed(f"{_FRAMES} frames, and the flight says {said}")
    return f"{_FRAMES} frames in {took_s:.2f} s are {_FRAMES} ticks, sums exact; then silent: status 1 with the reason"
