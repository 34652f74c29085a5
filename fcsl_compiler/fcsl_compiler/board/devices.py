# SPDX-License-Identifier: Apache-2.0
"""The devices of a board: their drivers, addresses and rates."""

from __future__ import annotations

import re
from dataclasses import dataclass

from ..base.diagnostics import nearest
from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .drivers import ACTUATOR, BUFFERED, POLLED, WAITING, kind_of, known_drivers
from .limits import MAX_DEVICES, check_count, check_name, check_text

MIN_RATE_HZ, MAX_RATE_HZ = 0.001, 100_000.0

#: LIBRARY.so:NAME; the name of a library has a slash or ends in `.so`.
_OF_LIBRARY = re.compile(r"(?:\S*/\S*|\S+\.so):[A-Za-z_]\w*", re.ASCII)


@dataclass(frozen=True)
class Device:
    """`rate_hz`: nominal, of its readings; 0 if there is none, or none is known."""

    name: str
    driver: str
    address: str
    rate_hz: float
    span: Span

    @property
    def period_s(self) -> float:
        """0 if the rate is."""
        return 1.0 / self.rate_hz if self.rate_hz else 0.0


def read_devices(node: JsonNode | None, reader: ConfigReader) -> dict[str, Device | None]:
    """Devices by name. None for one with a reported error."""
    found: dict[str, Device | None] = {}
    for name, (definition, span) in reader.named(node, "`devices`").items():
        named = check_name(name, span, reader)
        device = _device(name, span, definition, reader)
        found[name] = device if named else None
    check_count(len(found), MAX_DEVICES, "devices", node, reader)
    return found


def read_device_name(
    node: JsonNode | None, devices: dict[str, Device | None], used: set[str], reader: ConfigReader
) -> str | None:
    """The name of one of `devices`, which is `used` then. None after reporting an error."""
    names = list(devices)
    index = reader.reference(node, "device", names)
    if node is None or index is None:
        return None
    used.add(names[index])
    return names[index]


def _device(name: str, span: Span, definition: JsonNode, reader: ConfigReader) -> Device | None:
    keys = reader.object(definition, f"device `{name}`", ("driver", "device"), ("rate_hz",))
    if keys is None:
        return None
    driver = _driver(keys.get("driver"), reader)
    address = check_text(keys.get("device"), "`device`", reader)
    rate_hz = reader.number(keys.get("rate_hz"), "`rate_hz`", MIN_RATE_HZ, MAX_RATE_HZ)
    if driver is None or not _check_rate(name, driver, definition, keys.get("rate_hz"), reader):
        return None
    if address is None or (rate_hz is None and "rate_hz" in keys):
        return None
    return Device(name, driver, address, rate_hz or 0.0, span)


def _driver(node: JsonNode | None, reader: ConfigReader) -> str | None:
    text = check_text(node, "`driver`", reader)
    if node is None or text is None or kind_of(text) or _OF_LIBRARY.fullmatch(text):
        return text
    if "/" in text or ".so" in text or ":" in text:
        hint = "write LIBRARY.so:NAME, without spaces"
    else:
        known = tuple(known_drivers())
        hint = nearest(text, known) or f"there are {', '.join(known)}; one of a library is LIBRARY.so:NAME"
    reader.sink.error("E503", f"no driver `{text}`", node.span, help=hint)
    return None


def _check_rate(name: str, driver: str, definition: JsonNode, node: JsonNode | None, reader: ConfigReader) -> bool:
    """Whether the device has a rate if and only if its driver needs one; that of a library may have one."""
    kind = kind_of(driver)
    if kind in (POLLED, BUFFERED) and node is None:
        why = "it is read at this rate" if kind == POLLED else "filters need to know how often it samples"
        fix = 'add `"rate_hz": …`'
        reader.sink.error("E504", f"device `{name}` has no `rate_hz`", definition.span, why=why, help=fix)
        return False
    if kind in (WAITING, ACTUATOR) and node is not None:
        waits = f"`{driver}` waits for the device, which sends when it likes"
        why = waits if kind == WAITING else f"`{driver}` is written as often as the guard writes"
        reader.sink.error("E504", f"device `{name}` has a rate", node.span, why=why, help="remove `rate_hz`")
        return False
    return True
