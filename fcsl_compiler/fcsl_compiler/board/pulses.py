# SPDX-License-Identifier: Apache-2.0
"""How an element of an actuator channel becomes a signal of its device, such as a pulse.

A command from `low` over the middle to `high` goes to `minimum`, `middle`, `maximum` in straight lines, and stays at the
ends beyond them; fcsl_runtime/board/output_map.c computes the same.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..model.machine import Channel
from ..model.types import F64, Array
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .drivers import read_signal

#: Of commands and outputs; the guard refuses more.
MAX_NUMBER = 1e9
_COMMAND = (-1.0, 1.0)


@dataclass(frozen=True)
class Line:
    """Outputs in the unit of the signal. `maximum` below `minimum`: reversed."""

    low: float
    high: float
    minimum: float
    middle: float
    maximum: float

    def contains(self, output: float) -> bool:
        return min(self.minimum, self.maximum) <= output <= max(self.minimum, self.maximum)

    def at(self, command: float) -> float:
        """The output of a command."""
        center = (self.low + self.high) / 2.0
        if command <= self.low:
            return self.minimum
        if command >= self.high:
            return self.maximum
        if command < center:
            return _between(command, self.low, self.minimum, center, self.middle)
        return _between(command, center, self.middle, self.high, self.maximum)


@dataclass(frozen=True)
class Pulse:
    """`slew`: change of the output per second at most; 0: at once."""

    signal: str
    line: Line
    slew: float
    safe: float


def read_pulse(node: JsonNode, channel: Channel | None, index: int, reader: ConfigReader) -> Pulse | None:
    """Element `index` of a channel. None after reporting an error. Without a channel its `safe` is unknown."""
    keys = reader.object(node, "an element", ("signal", "output"), ("command", "slew_per_s", "safe_output"))
    if keys is None:
        return None
    signal = read_signal(keys.get("signal"), "`signal`", reader)
    line = _line(keys.get("command"), keys.get("output"), reader)
    slew = reader.number(keys.get("slew_per_s"), "`slew_per_s`", 0.0, MAX_NUMBER)
    safe_node = keys.get("safe_output")
    safe = reader.number(safe_node, "`safe_output`", -MAX_NUMBER, MAX_NUMBER)
    if line is None or (safe_node is not None and not _check_safe(safe_node, safe, line, slew or 0.0, reader)):
        return None
    if safe_node is None and channel is not None:
        safe = _safe_of_channel(node, channel, index, line, reader)
    return None if signal is None or safe is None else Pulse(signal, line, slew or 0.0, safe)


def _line(command_node: JsonNode | None, output_node: JsonNode | None, reader: ConfigReader) -> Line | None:
    command = _numbers(command_node, "`command`", 2, reader) if command_node is not None else _COMMAND
    three = output_node is not None and output_node.kind == "array" and len(output_node.items) == 3
    output = _numbers(output_node, "`output`", 3 if three else 2, reader)
    if command is None or output is None or output_node is None:
        return None
    if command_node is not None and not command[0] < command[1]:
        message, fix = f"no command is between {command[0]:g} and {command[1]:g}", "the lower one comes first"
        reader.sink.error("E516", message, command_node.span, help=f"{fix}; an `output` may be reversed")
        return None
    minimum, maximum = output[0], output[-1]
    low, high = command
    line = Line(low, high, minimum, output[1] if three else (minimum + maximum) / 2.0, maximum)
    if minimum == maximum:
        reader.sink.error("E516", f"the output is always {minimum:g}", output_node.span, help="write both ends")
        return None
    if not line.contains(line.middle):
        message = f"the middle ({line.middle:g}) is not between {minimum:g} and {maximum:g}"
        reader.sink.error("E516", message, output_node.span, help="write [minimum, middle, maximum]")
        return None
    return line


def _numbers(node: JsonNode | None, what: str, count: int, reader: ConfigReader) -> tuple[float, ...] | None:
    values = None if node is None else reader.value(node, Array(F64, (count,)), what)
    if node is None or values is None:
        return None
    checked = [reader.number(item, what, -MAX_NUMBER, MAX_NUMBER) for item in node.items]
    return None if None in checked else tuple(map(float, values))


def _check_safe(node: JsonNode, safe: float | None, line: Line, slew: float, reader: ConfigReader) -> bool:
    """Whether the output is possible, or 0: no pulse. Reports another one, unless it is None."""
    if safe is None:
        return False
    if line.contains(safe):
        return True
    if safe != 0.0:
        message = f"`safe_output` ({safe:g}) is not between {line.minimum:g} and {line.maximum:g}"
        why = "it is an output, not a command"
        reader.sink.error("E516", message, node.span, why=why, help="an end, or 0 for no pulse")
        return False
    if slew:
        message, why = "`slew_per_s` with a `safe_output` of 0", "between 0 and its ends the output has no values"
        reader.sink.error("E516", message, node.span, why=why, help="remove one of them")
        return False
    return True


def _safe_of_channel(node: JsonNode, channel: Channel, index: int, line: Line, reader: ConfigReader) -> float | None:
    if not channel.safe:
        message, fix = f"element {index} of channel `{channel.name}` has no safe value", "add `safe_output`"
        why, notes = "the channel has no `safe`", [(channel.span, "the channel")]
        reader.sink.error("E517", message, node.span, why=why, help=f"{fix}, or `safe` to the channel", notes=notes)
        return None
    return line.at(float(channel.safe[index]))


def _between(x: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """On the line from (x0, y0) to (x1, y1); rounding leads to no value beyond the ends."""
    y = y0 + (y1 - y0) * ((x - x0) / (x1 - x0))
    return max(min(y0, y1), min(max(y0, y1), y))
