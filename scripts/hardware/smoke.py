# SPDX-License-Identifier: Apache-2.0
"""Runs in the guest: sets every device of guest/, reads it back through its driver, and says what came."""

from __future__ import annotations

import os
import socket
import struct
import sys
import time
from collections.abc import Callable
from functools import partial

from . import readers
from .guest import battery, sysfs
from .guest.chips import Bmi160, Bmp280, Ina226, LidarLite, Lps22hh, Mag3110
from .guest.i2c import I2cBus
from .guest.joystick import Joystick
from .guest.lines import GpioChip
from .guest.pca9685 import Pca9685
from .guest.vcan import add_vcan
from .trials import Failed, expect, run_trials

_RATE_HZ = 500.0
_SCANS = 1000
_BTN_JOYSTICK = 0x120


def try_inertial(bus: I2cBus) -> str:
    imu = Bmi160(bus)
    imu.plug()
    sysfs.put(imu.iio / "in_accel_scale", "0.004788")
    accel, gyro = (1.5, -2.5, -9.81), (0.1, -0.2, 1.25)
    imu.set_motion(accel, gyro)
    for axis, a, w in zip("xyz", accel, gyro, strict=True):
        expect(f"accel {axis}", readers.channel(imu.iio, f"accel_{axis}"), a, 0.0025)
        expect(f"anglvel {axis}", readers.channel(imu.iio, f"anglvel_{axis}"), w, 0.0006)
    return f"{sysfs.get(imu.iio / 'name')}: accel {accel} m/s^2, gyro {gyro} rad/s"


def try_buffer(bus: I2cBus) -> str:
    imu = Bmi160(bus)
    imu.unplug()
    imu.plug()
    imu.set_motion((0.0, 0.0, 9.81), (0.5, 0.0, 0.0))
    timer = readers.add_timer("smoke", _RATE_HZ)
    axes = ("anglvel_x", "anglvel_y", "anglvel_z", "accel_x", "accel_y", "accel_z")
    scans = readers.capture(imu.iio, sysfs.get(timer / "name"), axes, _SCANS)
    expect("accel z of a scan", scans.values[-1][5] * readers.number(imu.iio / "in_accel_scale"), 9.81, 0.001)
    expect("time stamp", scans.stamps[-1], time.monotonic(), 1.0)
    delays = sorted(r - s for r, s in zip(scans.read, scans.stamps, strict=True))
    mean_hz = (_SCANS - 1) / (scans.stamps[-1] - scans.stamps[0])
    return f"{mean_hz:.1f} of {_RATE_HZ:.0f} Hz, read after {spread(delays)}"


def spread(seconds: list[float]) -> str:
    """Median, 99 % and largest of sorted times."""
    median, most, largest = (seconds[int(q * (len(seconds) - 1))] * 1e6 for q in (0.5, 0.99, 1.0))
    return f"{median:.0f} us (99 %: {most:.0f}, at most {largest:.0f})"


def try_air(bus: I2cBus) -> str:
    barometers = (Bmp280(bus), Lps22hh(bus))
    for barometer in barometers:
        barometer.plug()
        if isinstance(barometer, Lps22hh):
            sysfs.put(barometer.iio / "sampling_frequency", 200)
        for pressure, temperature in ((101325.0, 15.0), (70000.0, -20.0)):
            barometer.set_air(pressure, temperature)
            expect(barometer.NAME, readers.channel(barometer.iio, "pressure") * 1e3, pressure, 1.0)
            expect(barometer.NAME, readers.channel(barometer.iio, "temp") * 1e-3, temperature, 0.02)
    return "70000 and 101325 Pa, -20 and 15 degC, both barometers"


def try_field(bus: I2cBus) -> str:
    magnetometer = Mag3110(bus)
    magnetometer.plug()
    field = (20e-6, -5e-6, 43e-6)
    magnetometer.set_field(field)
    for axis, b in zip("xyz", field, strict=True):
        expect(f"magn {axis}", readers.channel(magnetometer.iio, f"magn_{axis}") * 1e-4, b, 1e-7)
    return f"{field} T"


def try_distance(bus: I2cBus) -> str:
    lidar = LidarLite(bus)
    lidar.plug()
    lidar.set_distance(12.34)
    expect("distance", readers.channel(lidar.iio, "distance"), 12.34, 0.005)
    lidar.set_distance(None)
    try:
        readers.channel(lidar.iio, "distance")
    except OSError as error:
        return f"12.34 m; nothing in front: {error.strerror}"
    raise Failed("the lidar measures where nothing reflects")


def try_supply(bus: I2cBus) -> str:
    monitor = Ina226(bus)
    monitor.plug()
    monitor.set_supply(22.2, 3.5)
    expect("voltage", readers.channel(monitor.iio, "voltage1") * 1e-3, 22.2, 0.001)
    expect("current", readers.channel(monitor.iio, "current3") * 1e-3, 3.5, 0.001)
    return "22.2 V, 3.5 A"


def try_pwm(bus: I2cBus) -> str:
    chip = Pca9685(bus)
    chip.plug()
    for channel in (0, 5):
        sysfs.put(chip.pwmchip / "export", channel)
        output = chip.pwmchip / f"pwm{channel}"
        sysfs.put(output / "period", 20_000_000)
        sysfs.put(output / "duty_cycle", 1_500_000 + 100_000 * channel)
        sysfs.put(output / "enable", 1)
    expect("period", chip.period, 0.02, 1e-4)
    step = chip.period / 4096
    expect("pulse 0", chip.pulses()[0], 1.5e-3, step)
    expect("pulse 5", chip.pulses()[5], 2.0e-3, step)
    sysfs.put(chip.pwmchip / "pwm0/enable", 0)
    expect("pulse 0", chip.pulses()[0], 0.0, 0.0)
    return f"1.5 and 2.0 ms in steps of {step * 1e6:.1f} us, then off"


def try_unplugging(bus: I2cBus) -> str:
    imu = Bmi160(bus)
    raw = (imu.iio / "in_accel_z_raw").open()
    imu.unplug()
    try:
        raw.read()
    except OSError as error:
        imu.plug()
        return f"an open file says {error.strerror}; the chip is back as {imu.iio.name}"
    raise Failed("a chip that is gone is read")


def try_sticks() -> str:
    joystick = Joystick("smoke joystick", {0: (-512, 511), 1: (-512, 511)}, (_BTN_JOYSTICK,))
    file = os.open(joystick.path, os.O_RDONLY)
    joystick.move({0: 100, 1: -200}, {_BTN_JOYSTICK: True})
    event = struct.Struct("llHHi")
    got = {(kind, code): value for _, _, kind, code, value in event.iter_unpack(os.read(file, 4 * event.size))}
    if got != {(3, 0): 100, (3, 1): -200, (1, _BTN_JOYSTICK): 1, (0, 0): 0}:
        raise Failed(f"the events are {got}")
    joystick.close()
    try:
        os.read(file, event.size)
    except OSError as error:
        return f"two axes and a button; unplugged: {error.strerror}"
    raise Failed("a joystick that is gone is read")


def try_battery() -> str:
    battery.set_battery(22.2, -3.5, 0.8)
    expect("voltage", readers.number(battery.SUPPLY / "voltage_now"), 22.2e6, 0)
    expect("current", readers.number(battery.SUPPLY / "current_now"), -3.5e6, 0)
    expect("capacity", readers.number(battery.SUPPLY / "capacity"), 80, 0)
    battery.set_temperature(45.5)
    expect("temperature", readers.number(battery.thermal_zone() / "temp"), 45500, 0)
    return "22.2 V, -3.5 A, 80 %, 45.5 degC"


def try_lines() -> str:
    chip = GpioChip("smoke", 8)
    chip.pull(3, True)
    if not chip.path.exists() or [chip.level(line) for line in (2, 3)] != [False, True]:
        raise Failed("gpio-sim's lines are not as they were pulled")
    chip.remove()
    return f"{chip.path}, line 3 high"


def try_can() -> str:
    add_vcan("vcan0")
    frame = struct.pack("IB3x8s", 0x123, 4, b"FCSL")
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as one:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as other:
            one.bind(("vcan0",))
            other.bind(("vcan0",))
            one.send(frame)
            if other.recv(16) != frame:
                raise Failed("another frame came")
    return "vcan0, a frame from one socket to another"


def try_clock() -> str:
    """How late a loop of 1 kHz wakes up."""
    start = time.monotonic()
    late = []
    for tick in range(1, 1001):
        time.sleep(max(0.0, start + tick * 1e-3 - time.monotonic()))
        late.append(time.monotonic() - start - tick * 1e-3)
    return f"1000 ticks in {time.monotonic() - start:.3f} s, late by {spread(sorted(late))}"


def main() -> int:
    chips = (Bmi160, Bmp280, Lps22hh, Mag3110, LidarLite, Ina226, Pca9685)
    bus = I2cBus(*(chip.ADDRESS for chip in chips))
    on_bus: tuple[Callable[[I2cBus], str], ...] = (
        try_inertial, try_buffer, try_air, try_field, try_distance, try_supply, try_pwm, try_unplugging,
    )  # fmt: skip
    others: tuple[Callable[[], str], ...] = (try_sticks, try_battery, try_lines, try_can, try_clock)
    trials = {f.__name__: partial(f, bus) for f in on_bus} | {f.__name__: f for f in others}
    return run_trials({name.removeprefix("try_"): trial for name, trial in trials.items()})


if __name__ == "__main__":
    sys.exit(main())
