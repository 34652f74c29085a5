# SPDX-License-Identifier: Apache-2.0
"""All devices of this computer that FCSL may drive, as sysfs shows them."""

from __future__ import annotations

import struct
from collections.abc import Callable

from fcsl_compiler.api.board import known_drivers

from .found import Candidate, Found, first_unique
from .found_gpio import find_gpio
from .found_iio import find_iio
from .sysfs import attribute, dev_root, folders, link_name, names_in


def _pwm() -> list[Found]:
    chips = folders("class/pwm", "pwmchip")
    names = {path: [link_name(path / "device"), path.name] for path in chips}
    found = []
    for path in chips:
        device = first_unique(names[path], names.values())
        count = attribute(path, "npwm")
        measures = [f"{count} pulses" if count != "1" else "1 pulse"] if count else []
        found.append(Found("PWM chip", path.name, str(path), measures, [Candidate("pwm", device)]))
    return found


_POWER = {"voltage_now": "voltage", "current_now": "current", "capacity": "charge", "temp": "temperature"}


def _power_supplies() -> list[Found]:
    found = []
    for path in folders("class/power_supply"):
        measures = [signal for name, signal in _POWER.items() if name in names_in(path)]
        candidates = [Candidate("power_supply", path.name)] if measures else []
        name = f"{path.name} ({attribute(path, 'type') or 'of unknown type'})"
        found.append(
            Found("power supply", name, str(path), measures, candidates, "it tells no voltage, current or charge")
        )
    return found


def _thermal_zones() -> list[Found]:
    zones = folders("class/thermal", "thermal_zone")
    names = {path: [attribute(path, "type"), path.name] for path in zones}
    found = []
    for path in zones:
        candidates = [Candidate("thermal", first_unique(names[path], names.values()))]
        found.append(Found("thermal zone", names[path][0] or path.name, str(path), ["value"], candidates))
    return found


#: Axes below those of touch pads (ABS_MT_SLOT).
_AXES_END = 0x2F
_LONG_BITS = 8 * struct.calcsize("P")


def _axis_count(words: str) -> int:
    """Of capabilities/abs: hexadecimal words of the size of a long, the highest first."""
    bits = 0
    try:
        for word in words.split():
            bits = bits << _LONG_BITS | int(word, 16)
    except ValueError:
        return 0
    return (bits & ((1 << _AXES_END) - 1)).bit_count()


def _input_devices() -> list[Found]:
    events = folders("class/input", "event")
    names = {}
    for path in events:
        texts = [attribute(path, f"device/{name}") for name in ("name", "uniq", "phys")]
        # For the driver, what begins with a slash is a path.
        names[path] = [*(text for text in texts if not text.startswith("/")), str(dev_root() / "input" / path.name)]
    found = []
    for path in events:
        axes = _axis_count(attribute(path, "device/capabilities/abs"))
        device = first_unique(names[path], names.values())
        candidates = [Candidate("evdev", device)] if axes else []
        measures = [f"sticks ({axes} axes)"] if axes else []
        name = names[path][0] or path.name
        found.append(
            Found("input device", name, str(path), measures, candidates, "it has no axes, so it is no joystick")
        )
    return found


#: PORT_UNKNOWN: a place for a port that the computer does not have.
_NO_UART = "0"


def _serial_ports() -> list[Found]:
    found = []
    drivers = [name for name, driver in known_drivers().items() if driver.serial]
    links = [dev_root() / "serial/by-id" / name for name in sorted(names_in(dev_root() / "serial/by-id"))]
    by_id = {link_name(link): str(link) for link in links}
    for path in folders("class/tty"):
        if not (path / "device").exists() or attribute(path, "type") == _NO_UART:
            continue
        device = by_id.get(path.name, str(dev_root() / path.name))
        found.append(Found("serial port", path.name, str(path), [], [Candidate(driver, device) for driver in drivers]))
    return found


#: ARPHRD_CAN
_CAN = "280"


def _can_interfaces() -> list[Found]:
    found = []
    for path in folders("class/net"):
        if attribute(path, "type") == _CAN:
            candidate = Candidate("can", f"{path.name}:1A0/16:12@1-*0.1", probed=f"{path.name}:000/0:8@1+")
            found.append(
                Found("CAN interface", path.name, str(path), ["the signals that the device names"], [candidate])
            )
    return found


_CLASSES: tuple[Callable[[], list[Found]], ...] = (
    find_iio,
    _pwm,
    _power_supplies,
    _thermal_zones,
    _input_devices,
    _serial_ports,
    _can_interfaces,
    find_gpio,
)


def find_devices() -> list[Found]:
    """All that sysfs shows. Nothing is taken into use or changed."""
    return [found for of_class in _CLASSES for found in of_class()]
