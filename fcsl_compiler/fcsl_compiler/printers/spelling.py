# SPDX-License-Identifier: Apache-2.0
"""How a language writes one operation of the op table."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..model.ops import op_id
from ..model.types import BOOL, HEALTH, NUMBERS, REQUEST, Scalar


@dataclass(frozen=True)
class Spelling:
    """`text` is the expression. Placeholders: {0}, {1}, … for the operands, {place} for the place number of each cause
    of a fault, {fault} for the pointer that stores the first fault. `proven` is the expression if the operands are
    known not to fault. `helper` and `proven_helper` are the functions that these expressions call; each is written once
    per machine.
    """

    text: str
    helper: str = ""
    proven: str = ""
    proven_helper: str = ""


#: The id of an operation, and its spelling.
Entry = tuple[str, Spelling]


def entry(
    name: str, args: tuple[Scalar, ...], text: str, helper: str = "", proven: str = "", proven_helper: str = ""
) -> Entry:
    return op_id(name, args), Spelling(text, helper, proven, proven_helper)


def comparisons() -> Iterator[Entry]:
    """Order and equality, which all languages write alike."""
    for t in NUMBERS:
        for symbol in ("<", "<=", ">", ">=", "==", "!="):
            yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
    for t in (BOOL, REQUEST, HEALTH):
        for symbol in ("==", "!="):
            yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
