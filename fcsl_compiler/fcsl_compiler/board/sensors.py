# SPDX-License-Identifier: Apache-2.0
"""The sensors of a board."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .backends import Backend, BackendReader
from .channels import Binding, ChannelBinder
from .filters import Filter, read_filters
from .health import Health, read_health
from .kinds import KINDS
from .limits import MAX_SENSORS, check_count, check_name

#: Instantaneous values of a device that may be faster than the ticks; sums over a tick lose nothing.
_SAMPLED = ("gyro", "accel")


@dataclass(frozen=True)
class Sensor:
    name: str
    kind: str
    health: Health
    bindings: tuple[Binding, ...]
    backends: tuple[Backend, ...]


def read_sensors(
    node: JsonNode | None, channels: ChannelBinder, backends: BackendReader, reader: ConfigReader
) -> tuple[Sensor, ...]:
    """Sensors in the order of the file; those with errors may be missing."""
    found = reader.named(node, "`sensors`")
    check_count(len(found), MAX_SENSORS, "sensors", node, reader)
    sensors = [_sensor(name, *place, channels, backends, reader) for name, place in found.items()]
    return tuple(s for s in sensors if s is not None)


def _sensor(
    name: str,
    node: JsonNode,
    span: Span,
    channels: ChannelBinder,
    backend_reader: BackendReader,
    reader: ConfigReader,
) -> Sensor | None:
    required, optional = ("kind", "channels", "backends"), ("health", "low_pass_hz", "notch")
    keys = reader.object(node, f"sensor `{name}`", required, optional)
    kind = reader.choice(keys.get("kind"), "`kind`", tuple(KINDS)) if keys else None
    named = check_name(name, span, reader)
    if keys is None or kind is None or not named:
        return None
    filters = read_filters(keys.get("low_pass_hz"), keys.get("notch"), kind, reader)
    bindings = channels.read(keys.get("channels"), kind)
    backends = backend_reader.read(keys.get("backends"), kind, filters)
    tick_hz = channels.machine.tick_hz if channels.machine else None
    health = read_health(keys.get("health"), kind, [b.device for b in backends], tick_hz, reader)
    sensor = Sensor(name, kind, health, bindings, backends)
    if tick_hz is not None:
        _warn_aliasing(sensor, filters, tick_hz, reader)
    return sensor


def _warn_aliasing(sensor: Sensor, filters: tuple[Filter, ...], tick_hz: int, reader: ConfigReader) -> None:
    """Warns of values that are sampled again, at the slower rate of the ticks, with nothing to limit their band."""
    filtered = {f.quantity for f in filters if not f.width_hz}
    fastest = max((b.device for b in sensor.backends), key=lambda d: d.rate_hz, default=None)
    if sensor.kind != "inertial" or fastest is None or fastest.rate_hz <= tick_hz:
        return
    for binding in sensor.bindings:
        quantity = binding.quantity.name
        if quantity in _SAMPLED and quantity not in filtered:
            message = f"`{quantity}` of `{fastest.name}` comes at {fastest.rate_hz:g} Hz, and a tick at {tick_hz}"
            why = "vibration above half the tick rate would look like motion (aliasing)"
            fix = "add `low_pass_hz`, or bind delta_angle and delta_velocity"
            reader.sink.warning("W504", message, binding.span, why=why, help=fix)
