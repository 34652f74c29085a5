# SPDX-License-Identifier: Apache-2.0
"""Ranges of parameters: `in 0..10` after a port's type and unit."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass

from .literals import LiteralError, fit
from .types import Struct, Type, TypeSyntaxError, element_of, scalar_of

_NUMBER = r"[+-]?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
#: Matches `in` followed by a range. `in` alone after a unit is the inch.
_BEHIND = re.compile(r"(?:^|(?<=[\s\])]))\bin\b\s*(?=\S*\.\.|[-+.0-9]|nan\b|inf\b)(?P<range>.*?)\s*$", re.IGNORECASE)
_RANGE = re.compile(r"(?P<low>\S*?)\s*\.\.\s*(?P<high>\S*)")


@dataclass(frozen=True)
class Range:
    """Values that a host may set: low <= value <= high. Both have the port's type; an infinite bound is no limit."""

    low: int | float = -math.inf
    high: int | float = math.inf
    text: str = ".."  # as written, with the values of constants

    def __contains__(self, value: object) -> bool:
        return isinstance(value, int | float) and self.low <= value <= self.high

    def __str__(self) -> str:
        return self.text


UNBOUNDED = Range()


def split_range(text: str) -> tuple[str, str | None, int]:
    """Splits `f64 N/rad in 0..10` into (`f64 N/rad`, `0..10`, its position). Without a range: (text, None, its
    length)."""
    match = _BEHIND.search(text)
    if not match:
        return text, None, len(text)
    return text[: match.start()], match["range"], match.start("range")


def parse_range(text: str, type_: Type, constants: Mapping[str, int | float]) -> Range:
    """Parses `0..10`, `0..`, `..5` or `-MOST..MOST`. Bounds are values of the parameter's type. Raises TypeSyntaxError."""
    example = "write it like `in 0..10`, `in 0..` or `in ..10`"
    if isinstance(element_of(type_), Struct):
        raise TypeSyntaxError(
            f"a range (`{text}`) after a struct", "declare the bounded members as separate parameters"
        )
    if not scalar_of(type_).is_number:
        raise TypeSyntaxError(f"a range (`{text}`) after {type_}", "only numbers have one; remove it")
    match = _RANGE.fullmatch(text.strip())
    if not match:
        raise TypeSyntaxError(f"`{text}` is not a range", example)
    if not match["low"] and not match["high"]:
        raise TypeSyntaxError("a range without bounds", f"{example}, or remove it")
    low_text, high_text = (_valued(match[side], constants) for side in ("low", "high"))
    low = _parse_bound(low_text, type_, -math.inf)
    high = _parse_bound(high_text, type_, math.inf)
    if low > high:
        fix = f"write the smaller bound first: `in {match['high']}..{match['low']}`"
        raise TypeSyntaxError(f"the range `{text}` is empty", fix)
    return Range(low, high, f"{low_text}..{high_text}")


def _valued(bound: str, constants: Mapping[str, int | float]) -> str:
    """A bound with the value of a constant in place of its name."""
    match = re.fullmatch(r"(?P<sign>[+-]?)(?P<name>[^\W\d]\w*)", bound)
    if not match or match["name"] not in constants:
        return bound
    value = constants[match["name"]]
    return repr(-value if match["sign"] == "-" else value)


def _parse_bound(text: str, type_: Type, absent: float) -> int | float:
    if not text:
        return absent
    scalar = scalar_of(type_)
    if text.lstrip("+-").lower() in ("inf", "infinity"):
        raise TypeSyntaxError(f"`{text}` as a bound", "omit a missing bound: `in 0..`")
    if not re.fullmatch(_NUMBER, text):
        raise TypeSyntaxError(
            f"the bound `{text}` is not a number",
            "write a literal, such as `-2.5`, or the name of a numeric constant above the class",
        )
    whole = re.fullmatch(r"[+-]?[0-9]+", text) is not None
    number: int | float = int(text) if whole else float(text)
    if math.isinf(number):
        raise TypeSyntaxError(f"the bound `{text}` is beyond the range of f64", "omit it")
    try:
        bound = fit(number, scalar)
    except LiteralError as error:
        raise TypeSyntaxError(f"the bound `{text}`: {error.args[0]}", f"a bound is a value of {scalar}") from None
    if isinstance(bound, int) and int(float(bound)) != bound:
        fix = "hosts compare as f64, which has 53 bits; round it"
        raise TypeSyntaxError(f"the bound `{text}` is not exactly representable in f64", fix)
    return bound
