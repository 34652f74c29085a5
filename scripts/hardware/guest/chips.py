# SPDX-License-Identifier: Apache-2.0
"""Sensors on i2c-stub. Each sets the registers that its driver in the kernel reads, as the data sheet of the chip has them.

Units are SI, and axes are the chip's own. What is beyond the range of a chip saturates, as its converter does.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from pathlib import Path

from .i2c import I2cBus


def saturate(value: float, bits: int, *, signed: bool = True) -> int:
    least, most = (-(1 << bits - 1), (1 << bits - 1) - 1) if signed else (0, (1 << bits) - 1)
    return min(max(round(value), least), most)


class Chip:
    """A chip on the bus. `plug` resets its registers and brings its driver; `unplug` is a connector pulled."""

    NAME = ""
    ADDRESS = 0

    def __init__(self, bus: I2cBus, address: int | None = None) -> None:
        self._bus, self.address = bus, self.ADDRESS if address is None else address

    def reset(self) -> None:
        """Sets the registers that are not 0 when power comes on."""
        raise NotImplementedError

    def plug(self) -> None:
        self.reset()
        self._bus.plug(self.address, self.NAME)

    def unplug(self) -> None:
        self._bus.unplug(self.address)

    @property
    def is_plugged(self) -> bool:
        return self._bus.device(self.address).exists()

    def replug(self) -> None:
        """Plugged in, with the registers of a chip that has just got its power."""
        if self.is_plugged:
            self.unplug()
        self.plug()

    @property
    def iio(self) -> Path:
        """Its IIO folder; another one after each `plug`."""
        return next(self._bus.device(self.address).glob("iio:device*"))

    def _write(self, register: int, values: bytes) -> None:
        self._bus.write(self.address, register, values)

    def _read(self, register: int) -> int:
        return self._bus.read(self.address, register)[0]


class Bmi160(Chip):
    """Bosch BMI160: accelerometer and gyroscope. Buffered, with any trigger. Its driver sets the range; the least is on at first."""

    NAME = "bmi160"
    ADDRESS = 0x68
    #: Of the range registers, as the driver has them in its scale attributes: m/s^2 and rad/s.
    _ACCEL_LSB = {0x03: 0.000598, 0x05: 0.001197, 0x08: 0.002394, 0x0C: 0.004788}
    _GYRO_LSB = {0x00: 0.001065, 0x01: 0.000532, 0x02: 0.000266, 0x03: 0.000133, 0x04: 0.000066}
    _ID, _GYRO_DATA, _ACCEL_CONFIG, _ACCEL_RANGE, _GYRO_RANGE = 0x00, 0x0C, 0x40, 0x41, 0x43

    def reset(self) -> None:
        self._write(self._ID, b"\xd1")
        self._write(self._ACCEL_CONFIG, bytes([0x28, 0x03, 0x28, 0x00]))
        self.set_motion((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))

    def set_motion(self, accel: Sequence[float], gyro: Sequence[float]) -> None:
        """Specific force in m/s^2 and angular velocity in rad/s, in one transfer."""
        accel_lsb = self._ACCEL_LSB[self._read(self._ACCEL_RANGE)]
        gyro_lsb = self._GYRO_LSB[self._read(self._GYRO_RANGE)]
        words = [saturate(w / gyro_lsb, 16) for w in gyro] + [saturate(a / accel_lsb, 16) for a in accel]
        self._write(self._GYRO_DATA, struct.pack("<6h", *words))


class Bmp280(Chip):
    """Bosch BMP280: pressure and temperature, polled only.

    The calibration is one for which the data sheet's compensation is linear and free of the temperature: all of its constants are 0
    but T1, T2 and P1.
    """

    NAME = "bmp280"
    ADDRESS = 0x76
    _ID, _CALIBRATION, _DATA = 0xD0, 0x88, 0xF7
    _T1, _T2, _P1 = 25600, 8192, 32768
    _SKIPPED = 0x80000  # stands for no measurement

    def reset(self) -> None:
        self._write(self._ID, b"\x58")
        self._write(self._CALIBRATION, struct.pack("<12H", self._T1, self._T2, 0, self._P1, *[0] * 8))
        self.set_air(101325.0, 20.0)

    def set_air(self, pressure: float, temperature: float) -> None:
        """Pressure in Pa, to 200 kPa; temperature in degC, from -40 to 62."""
        fine = temperature * 5120.0
        temperature_code = saturate((fine * 2048.0 / self._T2 + 2.0 * self._T1) * 8.0, 20, signed=False)
        # p * 65536 = (2^20 - code) * 2^31 * 3125 / (2^14 * P1)
        pressure_code = (1 << 20) - pressure * 65536.0 * self._P1 / (3125.0 * (1 << 17))
        codes = [saturate(pressure_code, 20, signed=False), temperature_code]
        high = [(code + (code == self._SKIPPED)) << 4 for code in codes]
        self._write(self._DATA, b"".join(code.to_bytes(3, "big") for code in high))


class Lps22hh(Chip):
    """ST LPS22HH: pressure and temperature. Buffered, with any trigger; a single reading takes two periods of its sampling_frequency."""

    NAME = "lps22hh"
    ADDRESS = 0x5C
    _ID, _DATA = 0x0F, 0x28

    def reset(self) -> None:
        self._write(self._ID, b"\xb3")
        self.set_air(101325.0, 20.0)

    def set_air(self, pressure: float, temperature: float) -> None:
        """Pressure in Pa, temperature in degC."""
        pressure_code = saturate(pressure * 40.96, 24)
        temperature_code = saturate(temperature * 100.0, 16)
        self._write(self._DATA, pressure_code.to_bytes(3, "little", signed=True) + struct.pack("<h", temperature_code))


class Mag3110(Chip):
    """Freescale MAG3110: magnetometer. Buffered, with any trigger."""

    NAME = "mag3110"
    ADDRESS = 0x0E
    _STATUS, _DATA, _ID = 0x00, 0x01, 0x07
    _READY = 0x0F
    _LSB = 1e-7

    def reset(self) -> None:
        self._write(self._STATUS, bytes([self._READY]))
        self._write(self._ID, b"\xc4")
        self.set_field((0.0, 0.0, 0.0))

    def set_field(self, field: Sequence[float]) -> None:
        """Magnetic flux density in T."""
        self._write(self._DATA, struct.pack(">3h", *(saturate(b / self._LSB, 16) for b in field)))


class LidarLite(Chip):
    """PulsedLight LIDAR-Lite v2: distance in cm. Buffered; a measurement takes 2 ms, and 20 ms more where the last was 1 s ago."""

    NAME = "lidar-lite-v2"
    ADDRESS = 0x62
    _STATUS, _DATA = 0x01, 0x0F
    _INVALID = 0x08

    def reset(self) -> None:
        self.set_distance(1.0)

    def set_distance(self, distance: float | None) -> None:
        """In m; None: nothing reflects, and the driver's reading fails with EINVAL."""
        if distance is not None:
            self._write(self._DATA, struct.pack(">H", saturate(distance * 100.0, 16, signed=False)))
        self._write(self._STATUS, bytes([self._INVALID if distance is None else 0]))


class Ina226(Chip):
    """TI INA226 with a shunt of 10 mOhm: in_voltage1 is the bus, in_voltage0 the shunt, in_current3 the current."""

    NAME = "ina226"
    ADDRESS = 0x40
    _SHUNT, _BUS, _POWER, _CURRENT = 1, 2, 3, 4
    _BUS_LSB, _CURRENT_LSB, _POWER_LSB = 1.25e-3, 0.25e-3, 6.25e-3

    def reset(self) -> None:
        self.set_supply(0.0, 0.0)

    def set_supply(self, voltage: float, current: float) -> None:
        """Voltage of the bus in V, current in A."""
        current_code = saturate(current / self._CURRENT_LSB, 16)
        codes = {
            self._SHUNT: current_code,
            self._BUS: saturate(voltage / self._BUS_LSB, 15, signed=False),
            self._POWER: saturate(abs(voltage * current) / self._POWER_LSB, 16, signed=False),
            self._CURRENT: current_code,
        }
        for register, code in codes.items():
            self._bus.write_word(self.address, register, code)
