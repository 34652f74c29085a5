# SPDX-License-Identifier: Apache-2.0
"""The battery of the kernel's test_power, and the thermal zone that the kernel makes of its temperature."""

from __future__ import annotations

from pathlib import Path

from . import sysfs

SUPPLY = Path("/sys/class/power_supply/test_battery")
_PARAMETERS = Path("/sys/module/test_power/parameters")
_ZONES = Path("/sys/class/thermal")


def set_battery(voltage: float, current: float, charge: float) -> None:
    """In V, in A (negative: out of the battery, as the kernel has it), and from 0 to 1. Its `temp` is always 2.6 degC."""
    sysfs.put(_PARAMETERS / "battery_voltage", round(voltage * 1e6))
    sysfs.put(_PARAMETERS / "battery_current", round(current * 1e6))
    sysfs.put(_PARAMETERS / "battery_capacity", round(charge * 100.0))


def set_status(status: str) -> None:
    """charging, discharging, not-charging or full."""
    sysfs.put(_PARAMETERS / "battery_status", status)


def thermal_zone() -> Path:
    return sysfs.find(_ZONES, "type", "test_battery")


def set_temperature(temperature: float) -> None:
    """Of the thermal zone, in degC; 0 gives it back to the battery."""
    sysfs.put(thermal_zone() / "emul_temp", round(temperature * 1e3))
