# SPDX-License-Identifier: Apache-2.0
"""How fcsl var prints values."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any


def show_value(value: Any) -> str:
    """Shortest exact digits; texts without quotes, except the empty one."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, list):
        return f"[{', '.join(show_value(item) for item in value)}]"
    if isinstance(value, str):
        return value or '""'
    return repr(value)


def with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def jsonable(value: Any) -> Any:
    """Replaces NaN and infinities by strings, as the protocol does."""
    if isinstance(value, Mapping):
        return {key: jsonable(member) for key, member in value.items()}
    if isinstance(value, list):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows with aligned columns; the last column is not padded."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)] if rows else []
    lines = []
    for row in rows:
        cells = [f"{cell:{width}}" for cell, width in zip(row, widths, strict=False)]
        lines.append("  ".join([*cells, row[-1]]).rstrip())
    return "\n".join(lines)


def flat(path: str, value: Any) -> list[tuple[str, Any]]:
    """The fields and values below a path."""
    if not isinstance(value, dict):
        return [(path, value)]
    below = []
    for name, member in value.items():
        below += flat(path + ("" if name.startswith("[") else ".") + name, member)
    return below
