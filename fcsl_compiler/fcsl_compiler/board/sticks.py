# SPDX-License-Identifier: Apache-2.0
"""Sticks of a remote control: which pulses are their ends and their middle."""

from __future__ import annotations

from dataclasses import dataclass

from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .kinds import STICKS

_MAX_PULSE_US = 10_000.0


@dataclass(frozen=True)
class Stick:
    """Pulses in us. `maximum` below `minimum`: the stick is reversed."""

    minimum: float = 1000.0
    middle: float = 1500.0
    maximum: float = 2000.0
    deadband: float = 0.0


def read_sticks(node: JsonNode | None, kind: str, reader: ConfigReader) -> tuple[Stick, ...]:
    """Stick k is that of channel k."""
    if node is None:
        return ()
    if kind != "rc":
        reader.sink.error(
            "E512", f"`sticks` of a sensor of kind `{kind}`", node.span, help="remove it; `rc` has sticks"
        )
        return ()
    items = reader.list(node, "`sticks`")
    if len(items) > STICKS.count:
        reader.sink.error("E512", f"{len(items)} sticks", node.span, help=f"there are {STICKS.count} at most")
    return tuple(_stick(item, reader) for item in items[: STICKS.count])


def _stick(node: JsonNode, reader: ConfigReader) -> Stick:
    keys = reader.object(node, "a stick", (), ("minimum", "middle", "maximum", "deadband")) or {}

    def pulse(key: str, default: float) -> float:
        value = reader.number(keys.get(key), f"`{key}`", 0.0, _MAX_PULSE_US)
        return default if value is None else value

    default = Stick()
    stick = Stick(
        pulse("minimum", default.minimum),
        pulse("middle", default.middle),
        pulse("maximum", default.maximum),
        pulse("deadband", default.deadband),
    )
    low, high = sorted((stick.minimum, stick.maximum))
    if not low < stick.middle < high:
        message = f"the middle ({stick.middle:g}) is not between {low:g} and {high:g}"
        reader.sink.error("E512", message, node.span, help="measure the pulses of the stick at both ends and released")
    elif stick.deadband >= min(stick.middle - low, high - stick.middle):
        message = f"a deadband of {stick.deadband:g} leaves nothing of the stick"
        reader.sink.error("E512", message, node.span, help="it is smaller than the way from the middle to either end")
    return stick
