# SPDX-License-Identifier: Apache-2.0
"""The pages of diagnostic codes: title, reason for the rule, a wrong example and its correction.

`fcsl explain`, the SARIF report and docs/reference/diagnostics.md (generated) use the same table. Tests compile every example
and check that the table and the sources use the same codes. Rows: machine.py, ros.py, algorithm.py
and board.py.
"""

from __future__ import annotations

import re
import textwrap
from collections.abc import Mapping, Sequence

from ..diagnostics import nearest
from .algorithm import ALGORITHM_CODES
from .board import BOARD_CODES
from .code import Code, Kind
from .examples import EXAMPLE_CONTROL
from .machine import MACHINE_CODES
from .ros import ROS_CODES

_WIDTH = 100


def table() -> dict[str, Code]:
    """All codes, sorted: errors, then warnings."""
    return dict(sorted({**MACHINE_CODES, **ROS_CODES, **ALGORITHM_CODES, **BOARD_CODES}.items()))


class UnknownCode(ValueError):
    """A code that is not in the table. str() names it and suggests the nearest code."""


def pages(codes: Sequence[str], rows: Mapping[str, Code]) -> str:
    """The pages of the given codes, or one line for every row if none are given. Raises UnknownCode."""
    for code in map(str.upper, codes):
        if code not in rows:
            hint = nearest(code[:8].replace("O", "0"), list(rows))
            raise UnknownCode(
                f"there is no code or function `{code[:80]}`; {hint or 'without a code, `explain` lists all'}"
            )
    return "\n".join(explain(code.upper(), rows) for code in codes) if codes else overview(rows)


def explain(code: str, rows: Mapping[str, Code]) -> str:
    """The page of one code. Raises KeyError."""
    row = rows[code]
    parts = [
        f"{code}: {row.title}",
        textwrap.fill(row.explanation, _WIDTH),
        "Wrong:\n\n" + textwrap.indent(row.wrong, "    "),
        "Right:\n\n" + textwrap.indent(row.right, "    "),
    ]
    ports = _ports_used(row)
    if ports:
        parts.append(f"where {ports}.")
    return "\n\n".join(parts) + "\n"


def overview(rows: Mapping[str, Code]) -> str:
    """One line for every code."""
    return "".join(f"{code}  {row.title}\n" for code, row in rows.items())


def _ports_used(row: Code) -> str:
    """The types of the ports that a part of `execute` uses, as `self.speed is f64 m/s`."""
    if row.kind is not Kind.BODY:
        return ""
    declared = dict(re.findall(r'"(\w+)": "([^"]+)"', EXAMPLE_CONTROL))
    used = dict.fromkeys(re.findall(r"\bself\.(\w+)", f"{row.wrong}\n{row.right}"))
    return ", ".join(f"self.{name} is {declared[name]}" for name in used if name in declared)
