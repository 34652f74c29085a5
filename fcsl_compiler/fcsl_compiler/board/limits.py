# SPDX-License-Identifier: Apache-2.0
"""Limits of the plan of a board, which fcsl_runtime/board/board_plan.h defines."""

from __future__ import annotations

from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode

MAX_DEVICES = 32
MAX_SENSORS = 32
MAX_OUTPUTS = 16
#: Elements of one output.
MAX_PULSES = 16
MAX_PINS = 64
#: Inputs of converters.
MAX_CONVERTERS = 32
#: Windows of registers.
MAX_REGISTERS = 8
MAX_PLAN_NAME = 64
#: Of a driver or an address, in bytes.
MAX_TEXT = 500


def check_name(name: str, span: Span, reader: ConfigReader) -> bool:
    """Whether the name of a device, a sensor or a signal is short enough. `reader` has checked its letters."""
    if len(name) <= MAX_PLAN_NAME:
        return True
    message = f"`{name}` is longer than {MAX_PLAN_NAME} characters"
    reader.sink.error("E505", message, span, help="shorten it")
    return False


def check_text(node: JsonNode | None, what: str, reader: ConfigReader) -> str | None:
    """A text that fits on a line of the plan. None after reporting an error."""
    text = reader.string(node, what)
    if node is None or text is None:
        return None
    if not text.strip():
        problem = "is empty"
    elif any(ord(c) < 0x20 or ord(c) == 0x7F for c in text):
        problem = "has a control character"
    elif len(text.encode()) > MAX_TEXT:
        problem = f"is longer than {MAX_TEXT} bytes"
    else:
        return text
    reader.sink.error("E505", f"{what} {problem}", node.span, why="it becomes a line of the plan")
    return None


def check_count(count: int, maximum: int, what: str, node: JsonNode | None, reader: ConfigReader) -> None:
    if node is not None and count > maximum:
        reader.sink.error("E505", f"{count} {what}", node.span, help=f"a board has {maximum} at most")
