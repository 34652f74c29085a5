# SPDX-License-Identifier: Apache-2.0
"""How a language writes one operation of the op table."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.ops import op_id
from ..model.types import Scalar


@dataclass(frozen=True)
class Spelling:
    """`text` is the expression. Placeholders: {0}, {1}, … for the operands, {place} for the place number of each cause of a
    fault, {fault} for the pointer that stores the first fault. `proven` is the expression if the operands are known not
    to fault. `helper` and `proven_helper` are the functions that these expressions call; each is written once per
    machine.
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
