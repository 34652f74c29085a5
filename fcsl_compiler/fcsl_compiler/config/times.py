# SPDX-License-Identifier: Apache-2.0
"""Times in seconds of the machine JSON, as numbers of ticks."""

from __future__ import annotations

from fractions import Fraction

from ..model.machine import nearest_seconds
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode


def read_ticks(
    node: JsonNode, key: str, tick_hz: int, most: int, why: str, reader: ConfigReader, may_be_zero: bool = False
) -> int | None:
    """Number of ticks, at most `most`, of a time in s, computed exactly from its decimal text. None after reporting an
    error. `why` says what lasts a whole number of ticks."""
    computed = reader.computed(node, f"`{key}`", "s")
    if computed is None:
        return None
    node = computed
    if not node.is_number:
        reader.wrong(node, f"`{key}` is a number", "a time in s, such as 5.0")
        return None
    if not tick_hz:  # reported earlier
        return None
    assert isinstance(node.value, int | float)
    least = "0 or more" if may_be_zero else "positive"
    if node.value < 0 or (not node.value and not may_be_zero) or Fraction(node.text) > Fraction(most, tick_hz):
        fix = f"it is {least} and at most {most // tick_hz} s, {most} ticks"
        reader.sink.error("E204", f"`{key}` is {node.text}", node.span, help=fix)
        return None
    ticks = Fraction(node.text) * tick_hz
    if ticks.denominator == 1:
        return ticks.numerator
    fix = f"write {' or '.join(nearest_seconds(ticks, tick_hz))}"
    message = f"{node.text} s is not a whole number of ticks at {tick_hz} Hz"
    reader.sink.error("E244", message, node.span, why=why, help=fix)
    return None
