# SPDX-License-Identifier: Apache-2.0
"""Inertial sensors: two that are polled, and one through its buffer."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

from ..guest.chips import Bmi160
from ..guest.i2c import I2cBus
from ..trials import Failed, expect_all
from .craft import Craft
from .process import Flight, after, in_ms, linux, until

Vector = tuple[float, float, float]

TOP, BOTTOM = 0x68, 0x69
_GYRO, _ACCEL = (0.3, 0.5, 0.7), (1.5, -2.5, 9.81)
#: Half a step of the chip, in rad/s and m/s^2.
_GYRO_STEP, _ACCEL_STEP = 0.00054, 0.0003
#: The guest has one processor, and the computer has other work: one window without that is enough.
_WINDOW_S, _WINDOWS = 1.0, 10
_LIMIT_S = 10.0
_LATE_PART, _RATE_PART, _SPAN_S = 0.05, 0.05, 0.05


@dataclass(frozen=True)
class Window:
    """`late` is the part of the ticks whose angular velocity is older than a tick; `turned` in rad, over `span` of the `took` s."""

    late: float
    rate: float
    took: float
    span: float
    turned: tuple[float, ...]

    def is_good(self, rate: float) -> bool:
        """Whether the device gave its rate."""
        in_time = self.late <= _LATE_PART and abs(self.span - self.took) <= _SPAN_S
        return in_time and abs(self.rate - rate) <= _RATE_PART * rate


def yawed(v: Vector) -> Vector:
    """As the body has it, by a device that is turned by 90 degrees about z."""
    return (-v[1], v[0], v[2])


def rolled(v: Vector) -> Vector:
    """The same of one that is turned by 180 degrees about x."""
    return (v[0], -v[1], -v[2])


def measure(flight: Flight) -> Window:
    """The next seconds of the device `top`."""
    ticks, late, spanned, turned, samples = paths = (
        *(f"odometer.outputs.{name}" for name in ("ticks", "late_ticks", "spanned", "turned")),
        "hal.devices.top.samples",
    )
    first, begin = flight.client.get(*paths), time.monotonic()
    time.sleep(_WINDOW_S)
    last, took = flight.client.get(*paths), time.monotonic() - begin
    return Window(
        late=(last[late] - first[late]) / (last[ticks] - first[ticks]),
        rate=(last[samples] - first[samples]) / took,
        took=took,
        span=last[spanned] - first[spanned],
        turned=tuple(b - a for a, b in zip(first[turned], last[turned], strict=True)),
    )


def measure_steady(flight: Flight, rate: float) -> Window:
    """Angles are exact in any window; the rate must be right in one."""
    gyro = flight.output("gyro")
    for _ in range(_WINDOWS):
        window = measure(flight)
        expect_all("mean angular velocity", [angle / window.span for angle in window.turned], tuple(gyro), 1e-9)
        if window.is_good(rate):
            return window
    raise Failed(f"the device does not give {rate:g} Hz: {window}")


def plug_and_move(imu: Bmi160) -> None:
    imu.plug()
    imu.set_motion(_ACCEL, _GYRO)


def check_motion(flight: Flight, turned: Callable[[Vector], Vector]) -> None:
    expect_all("gyro", flight.output("gyro"), turned(_GYRO), _GYRO_STEP)
    expect_all("accel", flight.output("accel"), turned(_ACCEL), _ACCEL_STEP)


def lose_both(flight: Flight, top: Bmi160, bottom: Bmi160) -> str:
    switch_s = after(top.unplug, lambda: flight.until_value("hal.sensors.imu.primary", 2))
    check_motion(flight, rolled)
    if flight.get("machine.state") != "FLIGHT":
        raise Failed("the loss of one of two changes the state")
    safe_s = after(bottom.unplug, lambda: flight.until_value("machine.state", "SAFE"))
    if flight.get("hal.sensors.imu.primary") != 0 or flight.get("channels.imu.gyro.valid"):
        raise Failed("without a device the channel is valid")
    return f"unplugged: other primary after {in_ms(switch_s)}, SAFE after {in_ms(safe_s)}"


def get_both_back(flight: Flight, top: Bmi160, bottom: Bmi160, number: str) -> str:
    """`number`: that of `top` before it went, which is the one of `bottom` now."""
    back_s = after(partial(plug_and_move, bottom), lambda: flight.until_value("machine.state", "FLIGHT"))
    check_motion(flight, rolled)
    if bottom.iio.name != number:
        raise Failed(f"the second chip is {bottom.iio.name}, not {number}")
    plug_and_move(top)
    flight.until_value("hal.sensors.imu.condition.top", 0)
    if flight.get("hal.sensors.imu.primary") != 2 or flight.get("hal.devices.top.lost") != 1:
        raise Failed("the first chip is primary again, or was not lost once")
    bottom.unplug()
    flight.until_value("hal.sensors.imu.primary", 1)
    check_motion(flight, yawed)
    return f"plugged: FLIGHT after {in_ms(back_s)}"


def try_inertial(bus: I2cBus, craft: Craft) -> str:
    """The primary changes and nothing else; then both have gone, and come back under other numbers."""
    top, bottom = Bmi160(bus, TOP), Bmi160(bus, BOTTOM)
    for imu in (top, bottom):
        plug_and_move(imu)
    with linux(craft, "inertial") as flight:
        flight.until_value("hal.sensors.imu.primary", 1)
        flight.until_value("machine.state", "FLIGHT")
        check_motion(flight, yawed)
        window = measure_steady(flight, 200.0)
        number = top.iio.name
        said = (lose_both(flight, top, bottom), get_both_back(flight, top, bottom, number))
    return f"2 x {window.rate:.1f} of 200 Hz, {window.late:.1%} of the ticks older than one; {'; '.join(said)}"


def try_pace(bus: I2cBus, craft: Craft) -> str:
    """Each scan is a tick; a device that goes ends the flight."""
    imu = Bmi160(bus, TOP)
    imu.replug()
    imu.set_motion(_ACCEL, _GYRO)
    with linux(craft, "paced") as flight:
        flight.until_value("machine.state", "FLIGHT")
        measured = measure_pace(flight)
        end_s = after(imu.unplug, lambda: flight.process.wait(_LIMIT_S))
        reason = "device 'top', which paces the loop, has given nothing for"
        if flight.process.returncode != 1 or reason not in flight.said():
            raise Failed(f"it ends with {flight.process.returncode}: {flight.said()}")
    imu.plug()
    return f"{measured}; unplugged: status 1 with the reason after {in_ms(end_s)}"


def measure_pace(flight: Flight) -> str:
    """A scan a tick, 100 a second: a guest that stands still for a while gives none, so this must hold in one window."""
    paths = ("machine.tick", "hal.devices.top.samples", "odometer.outputs.spanned")
    for _ in range(_WINDOWS):
        first, begin = flight.client.get(*paths), time.monotonic()
        time.sleep(_WINDOW_S)
        last, took = flight.client.get(*paths), time.monotonic() - begin
        ticks, samples, spanned = (last[path] - first[path] for path in paths)
        in_time = abs(ticks / took - 100.0) <= 100.0 * _RATE_PART and abs(spanned / ticks - 0.01) <= 0.0002
        if in_time and abs(samples - ticks) <= 1:  # one may wait for its tick
            return f"{ticks} ticks and {samples} scans in {took:.2f} s"
    raise Failed(f"{ticks} ticks, {samples} scans that span {spanned:g} s, in {took:.2f} s: not 100 of each a second")


def try_buffer(bus: I2cBus, craft: Craft) -> str:
    """Rate, ages, integrals; gone and back in flight."""
    imu = Bmi160(bus, TOP)
    imu.replug()
    imu.set_motion(_ACCEL, _GYRO)
    with linux(craft, "buffered") as flight:
        flight.until_output("gyro", _GYRO, _GYRO_STEP)
        flight.until_value("machine.state", "FLIGHT")
        window = measure_steady(flight, 400.0)
        safe_s = after(imu.unplug, lambda: flight.until_value("machine.state", "SAFE"))
        until("the device is missing", lambda: flight.get("hal.devices.top.open") == 0)
        back_s = after(partial(plug_and_move, imu), lambda: flight.until_value("machine.state", "FLIGHT"))
        flight.until_output("gyro", _GYRO, _GYRO_STEP)
        dropped, lost = flight.get("hal.devices.top.dropped"), flight.get("hal.devices.top.lost")
        if (dropped, lost) != (0, 1):
            raise Failed(f"{dropped} samples dropped, {lost} losses")
    return (
        f"{window.rate:.1f} of 400 Hz, {window.late:.1%} of the ticks older than one, angles exact to 1e-9 rad/s; "
        f"unplugged: SAFE after {in_ms(safe_s)}; plugged: FLIGHT after {in_ms(back_s)}"
    )
