# SPDX-License-Identifier: Apache-2.0
"""Which channels of the machine get the quantities of a sensor."""

from __future__ import annotations

from dataclasses import dataclass

from ..base.source import Span
from ..model.machine import Channel, Machine
from ..model.types import Scalar, count_of, element_of
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .kinds import STICKS, Quantity
from .quantities import all_of, by_quantity


@dataclass(frozen=True)
class Binding:
    quantity: Quantity
    channel: Channel
    span: Span


class ChannelBinder:
    """Binds each sensor channel to one quantity at most. `machine` is None if it has an error."""

    def __init__(self, machine: Machine | None, reader: ConfigReader):
        self.machine, self.reader = machine, reader
        self._bound: dict[str, Span] = {}

    def read(self, node: JsonNode | None, kind: str) -> tuple[Binding, ...]:
        """Bindings in the order of the file."""
        if node is not None and node.kind == "object" and not node.members:
            fix = 'write quantity and channel: `{"…": "…"}`'
            self.reader.sink.error("E509", "a sensor without channels", node.span, help=fix)
        quantities = by_quantity(node, "`channels`", all_of(kind), self.reader)
        bindings = [self._binding(quantity, value) for quantity, value in quantities]
        return tuple(b for b in bindings if b is not None)

    def warn_unbound(self, node: JsonNode) -> None:
        """The sensor channels without a quantity. `node`: of `machine`."""
        for channel in self.machine.channels if self.machine else ():
            if channel.direction == "sensor" and channel.name not in self._bound:
                message = f"no sensor feeds channel `{channel.name}`"
                notes = [(channel.span, "the channel")]
                self.reader.sink.warning("W502", message, node.span, why="it never gets a sample", notes=notes)

    def _binding(self, quantity: Quantity, node: JsonNode) -> Binding | None:
        text = self.reader.string(node, f"the channel of `{quantity.name}`")
        if self.machine is None or text is None:
            return None
        index = self.reader.reference(node, "channel", [c.name for c in self.machine.channels])
        if index is None:
            return None
        channel = self.machine.channels[index]
        if not self._fits(quantity, channel, node.span):
            return None
        first = self._bound.setdefault(channel.name, node.span)
        if first is not node.span:
            message, notes = f"two sources for channel `{channel.name}`", [(first, "the other")]
            self.reader.sink.error("E508", message, node.span, help="a channel has one; remove this", notes=notes)
        return Binding(quantity, channel, node.span)

    def _fits(self, quantity: Quantity, channel: Channel, span: Span) -> bool:
        """Reports a channel that the quantity cannot go to; warns of one that is valid for ever."""
        sink, notes = self.reader.sink, [(channel.span, "the channel")]
        problem = _misfit(quantity, channel)
        if problem:
            sink.error("E507", f"`{quantity.name}` cannot be channel `{channel.name}`: {problem}", span, notes=notes)
            return False
        if channel.max_age_ticks is None:
            why = "without a healthy backend it keeps its last value, and nothing makes it invalid"
            fix = "add `max_age_ticks` to the channel"
            sink.warning(
                "W503", f"channel `{channel.name}` has no `max_age_ticks`", span, why=why, help=fix, notes=notes
            )
        return True


def _misfit(quantity: Quantity, channel: Channel) -> str:
    """Why the quantity cannot go to the channel; "" if it can."""
    element, count = element_of(channel.port.type), count_of(channel.port.type)
    if channel.direction != "sensor":
        return f"that is {'an actuator' if channel.direction == 'actuator' else 'a report'}"
    if not isinstance(element, Scalar) or not element.is_float:
        return f"it is a floating-point number, and the channel is {channel.port.type}"
    if count != quantity.count and not (quantity == STICKS and count < quantity.count):
        return f"it has {quantity.count} elements, and the channel {count}"
    if quantity.unit is not None and channel.port.unit not in ("", quantity.unit):
        return f"it is in {quantity.unit or 'no unit'}, and the channel in {channel.port.unit}"
    return ""
