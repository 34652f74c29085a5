# SPDX-License-Identifier: Apache-2.0
"""The drivers that come with FCSL, and their signals: fcsl_hal/src/drivers/drivers_built_in.c."""

from __future__ import annotations

import re

from ..base.diagnostics import nearest
from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .limits import check_name

_SIGNAL = re.compile(r"[A-Za-z_]\w*", re.ASCII)


def _numbered(name: str, count: int) -> tuple[str, ...]:
    return tuple(f"{name}{i}" for i in range(count))


_IIO = ("gyro", "accel", "field", "pressure", "temperature", "distance", *_numbered("voltage", 8))
_LINES = _numbered("line", 64)
_RC = ("sticks", "failsafe")
_GNSS = (
    *("fix", "latitude", "longitude", "altitude", "height", "velocity", "satellites"),
    *("horizontal_accuracy", "vertical_accuracy", "speed_accuracy"),
)

#: Those of sensors that are read at a rate; the others wait for the next sample.
POLLED = {
    "iio": _IIO,
    "power_supply": ("voltage", "current", "charge", "temperature"),
    "thermal": ("value",),
    "adc": _numbered("counts", 16),
    "gpio": _LINES,
}
#: Waits, and the device samples at the rate that it is set to.
BUFFERED = {"iio_buffer": _IIO}
WAITING = {
    "evdev": _RC,
    "sbus": _RC,
    "crsf": (*_RC, "rssi", "link_quality"),
    "ubx": _GNSS,
    "nmea": _GNSS,
    "can": _numbered("value", 8),
}
SENSORS = {**POLLED, **BUFFERED, **WAITING}
#: The signals that an output can drive: one f64 each.
ACTUATORS = {"pwm": _numbered("pulse", 16), "gpio_out": _LINES, "log": ("number",)}
#: Signals by driver.
DRIVERS = {**SENSORS, **ACTUATORS}


def read_signal(node: JsonNode | None, what: str, reader: ConfigReader) -> str | None:
    """The name of a signal. None after reporting an error."""
    name = reader.string(node, what)
    if node is None or name is None:
        return None
    if not _SIGNAL.fullmatch(name):
        fix = "letters, digits and underscores, as the driver names it"
        reader.sink.error("E203", f"`{name}` is not the name of a signal", node.span, help=fix)
        return None
    return name if check_name(name, node.span, reader) else None


def check_signal(name: str, driver: str, span: Span, reader: ConfigReader) -> None:
    """Reports a signal that the driver does not have, or that no output can drive. Nothing is known of the drivers of libraries."""
    known = DRIVERS.get(driver)
    if known is not None and name not in known:
        hint = nearest(name, known) or f"it has {_listed(known)}"
        reader.sink.error("E521", f"driver `{driver}` has no signal `{name}`", span, help=hint)


def _listed(signals: tuple[str, ...]) -> str:
    """Ten names at most: numbered ones are many."""
    return ", ".join(signals) if len(signals) <= 10 else f"{', '.join(signals[:2])}, … {signals[-1]}"
