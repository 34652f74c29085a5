# SPDX-License-Identifier: Apache-2.0
"""The device that paces the loop: each of its samples is a tick."""

from __future__ import annotations

from dataclasses import dataclass

from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .devices import Device
from .drivers import POLLED, kind_of

MIN_TIMEOUT_S, MAX_TIMEOUT_S = 0.001, 60.0


@dataclass(frozen=True)
class Pace:
    """`timeout_s`: for how long the device may be silent before the flight ends."""

    device: Device
    timeout_s: float


def read_pace(
    node: JsonNode | None,
    devices: dict[str, Device | None],
    sensed: set[str],
    tick_hz: int | None,
    reader: ConfigReader,
) -> Pace | None:
    """`sensed`: the names of devices that are backends of sensors. None without a node, or after reporting an error."""
    keys = reader.object(node, "`pace`", ("device", "timeout_s")) if node is not None else None
    if keys is None:
        return None
    names = list(devices)
    timeout_s = reader.number(keys.get("timeout_s"), "`timeout_s`", MIN_TIMEOUT_S, MAX_TIMEOUT_S)
    index = reader.reference(keys["device"], "device", names) if "device" in keys else None
    if index is None or timeout_s is None:
        return None
    device = devices[names[index]]
    # A sensor with an error may be the one that uses it.
    if device is not None and device.name not in sensed and not reader.sink.failed:
        why = "a tick is a sample of a sensor"
        message, fix = f"device `{device.name}` paces the loop, and no sensor uses it", "make it a backend of a sensor"
        reader.sink.error("E520", message, keys["device"].span, why=why, help=fix)
        return None
    if device is not None and kind_of(device.driver) == POLLED:
        why = f"`{device.driver}` is read by a clock of this computer, so that paces the loop already"
        message, fix = (
            f"device `{device.name}` cannot pace the loop",
            "remove `pace`, or name a device that sends by itself",
        )
        reader.sink.error("E520", message, keys["device"].span, why=why, help=fix)
        return None
    if device is not None and tick_hz is not None and device.rate_hz not in (0.0, tick_hz):
        message = f"device `{device.name}` has {device.rate_hz:g} samples a second, and the machine {tick_hz} ticks"
        notes = [(device.span, "the device")]
        reader.sink.error("E520", message, keys["device"].span, why="each sample is a tick", notes=notes)
        return None
    return Pace(device, timeout_s) if device is not None else None
