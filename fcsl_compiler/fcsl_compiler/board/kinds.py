# SPDX-License-Identifier: Apache-2.0
"""The kinds of sensors and what each of them measures; fcsl_hal/src/frontends/kinds.c has the same table."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A value that a kind of sensor has.

    `unit`: "" for a number without one, None if any unit is possible. `measured`: devices measure it; the frontend
    computes the others. `adjustable`: it can be corrected and filtered. `in_axes`: a vector along the device's axes.
    """

    name: str
    unit: str | None
    count: int = 1
    measured: bool = True
    adjustable: bool = True
    in_axes: bool = False


def _word(name: str, count: int = 1) -> Quantity:
    """A count, a flag or a pulse, which is used as it is measured."""
    return Quantity(name, "", count, adjustable=False)


def _axes(name: str, unit: str) -> Quantity:
    return Quantity(name, unit, 3, in_axes=True)


def _computed(name: str, unit: str, count: int) -> Quantity:
    return Quantity(name, unit, count, measured=False, adjustable=False)


TEMPERATURE = Quantity("temperature", "degC")
#: A remote control may have fewer channels: the machine can take the first ones.
STICKS = _word("sticks", 18)

#: Quantities by kind.
KINDS: dict[str, tuple[Quantity, ...]] = {
    "inertial": (
        _axes("gyro", "rad/s"),
        _axes("accel", "m/s^2"),
        TEMPERATURE,
        _computed("delta_angle", "rad", 3),
        _computed("delta_velocity", "m/s", 3),
        _computed("delta_time", "s", 1),
    ),
    "compass": (_axes("field", "T"), TEMPERATURE),
    "barometer": (Quantity("pressure", "Pa"), TEMPERATURE),
    "gnss": (
        _word("fix"),
        Quantity("latitude", "deg"),
        Quantity("longitude", "deg"),
        Quantity("altitude", "m"),
        Quantity("height", "m"),
        Quantity("velocity", "m/s", 3),
        _word("satellites"),
        Quantity("horizontal_accuracy", "m"),
        Quantity("vertical_accuracy", "m"),
        Quantity("speed_accuracy", "m/s"),
    ),
    "range_finder": (Quantity("distance", "m"),),
    "rc": (STICKS, _word("failsafe")),
    "battery": (Quantity("voltage", "V"), Quantity("current", "A"), Quantity("charge", ""), TEMPERATURE),
    "value": (Quantity("value", None),),
}

#: Limits of fcsl_frontend.h.
MAX_BACKENDS = 4
MAX_SECTIONS = 8
