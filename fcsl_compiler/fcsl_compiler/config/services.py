# SPDX-License-Identifier: Apache-2.0
"""Reads the ROS 2 services whose calls are samples of channels. Their conditions are checked by requirements/services.py,
which knows all fields of the machine."""

from __future__ import annotations

import re
from collections.abc import Iterable

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.machine import SERVICE_TYPES, Channel, PortRef, Service
from ..model.types import BOOL
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .times import read_ticks

_NAME = re.compile(r"/?[A-Za-z]\w*(/[A-Za-z]\w*)*", re.ASCII)
#: Ticks that a call may wait at most, and how long it may where `within_s` is not given, in s.
_WITHIN_MAX = 2**32 - 1
_WITHIN_S = 1


def read_service(node: JsonNode, tick_hz: int, reader: ConfigReader) -> Service | None:
    """Reads a `ros` entry that has the key `service`. None after reporting an error."""
    before = reader.sink.errors
    keys = reader.object(node, "`ros` of a service", ("type", "service", "accepted"), ("refused", "within_s"))
    if keys is None:
        return None
    type_ = reader.choice(keys.get("type"), "`type`", SERVICE_TYPES)
    name = reader.string(keys.get("service"), "`service`", "arm")
    if name is not None and not _NAME.fullmatch(name):
        fix = "write it relative to the namespace, such as arm"
        reader.sink.error("E203", f"`{name}` is not a service", keys["service"].span, help=fix)
    accepted = reader.string(keys.get("accepted"), "`accepted`", "machine.state == 'FLY'")
    refused = reader.string(keys.get("refused"), "`refused`", "mode.outputs.refused") or ""
    within: int | None = max(1, tick_hz * _WITHIN_S)
    if "within_s" in keys:
        why = "a call waits for a whole number of ticks"
        within = read_ticks(keys["within_s"], "within_s", tick_hz, _WITHIN_MAX, why, reader)
    if type_ is None or name is None or accepted is None or within is None or reader.sink.errors != before:
        return None
    return Service(type_, name, accepted, refused, within, {key: keys[key].span for key in keys})


def check_service_channel(keys: dict[str, JsonNode], direction: str, port: PortRef, reader: ConfigReader) -> bool:
    """Whether the channel of a service can have its calls. Reports an error."""
    if direction != "sensor":
        message, at = f"a service on {'an' if direction == 'actuator' else 'a'} {direction}", keys["direction"].span
        reader.sink.error("E259", message, at, help='calls come in: write "direction": "sensor"')
    elif port.type != BOOL:
        message, at = f"a service on `{keys['field'].written}`, which is {port.type}", keys["field"].span
        reader.sink.error("E259", message, at, help="declare it bool")
    elif "max_age_ticks" in keys:
        why = "its value holds until the next call"
        reader.sink.error("E259", "`max_age_ticks` of a service", keys["max_age_ticks"].span, why=why, help="remove it")
    else:
        return True
    return False


def check_service_names(channels: Iterable[Channel], sink: DiagnosticSink) -> None:
    """Checks that no two channels are of one service."""
    first: dict[str, Span] = {}
    for service in (c.service for c in channels if c.service is not None):
        at = service.spans["service"]
        other = first.setdefault(service.name, at)
        if other is not at:
            notes = [(other, "the other")]
            sink.error("E259", f"two services `{service.name}`", at, help="give each its own name", notes=notes)
