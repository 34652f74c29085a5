# SPDX-License-Identifier: Apache-2.0
"""How fcsl-var writes values, and reads them from the command line."""

from __future__ import annotations

import contextlib
import json
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

_SCALAR = re.compile(r'"(?:[^"\\]|\\.)*"|[^\s,\[\]"]+')
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf, "True": True, "False": False}


def show_value(value: Any) -> str:
    """Shortest digits that are exact; texts without quotes, but for the empty one."""
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
    """What JSON has no numbers for is a word, as in the protocol."""
    if isinstance(value, Mapping):
        return {key: jsonable(member) for key, member in value.items()}
    if isinstance(value, list):
        return [jsonable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0 else "-inf"
    return value


def read_value(text: str) -> Any:
    """A number, true, false, nan, inf, a name, with or without quotes, or a list of those."""
    for json_text in (text, _SCALAR.sub(_as_json, text)):
        with contextlib.suppress(ValueError):
            return json.loads(json_text)
    return text


def _as_json(scalar: re.Match[str]) -> str:
    try:
        return json.dumps(json.loads(scalar[0]))
    except ValueError:
        return json.dumps(_WORDS.get(scalar[0], scalar[0]))


def table(rows: Sequence[Sequence[str]]) -> str:
    """Rows with columns of one width, but for the last."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]) - 1)] if rows else []
    lines = []
    for row in rows:
        cells = [f"{cell:{width}}" for cell, width in zip(row, widths, strict=False)]
        lines.append("  ".join([*cells, row[-1]]).rstrip())
    return "\n".join(lines)


def flat(path: str, value: Any) -> list[tuple[str, Any]]:
    """The fields below a path that names several."""
    if not isinstance(value, dict):
        return [(path, value)]
    below = []
    for name, member in value.items():
        below += flat(path + ("" if name.startswith("[") else ".") + name, member)
    return below
