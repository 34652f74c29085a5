# SPDX-License-Identifier: Apache-2.0
"""How Nim writes the operations of the op table."""

from __future__ import annotations

from ....model.ops import Op
from ...spelling import Spelling
from . import convert, floats, integers, ordered

_TABLE: dict[str, Spelling] = dict(
    entry for module in (floats, ordered, convert, integers) for entry in module.spellings()
)


def spelling_of(op: Op) -> Spelling:
    return _TABLE[op.id]
