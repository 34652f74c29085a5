# SPDX-License-Identifier: Apache-2.0
"""What of `pass` did not hold in a flight, and by how much."""

from __future__ import annotations

import ast
from collections.abc import Mapping
from typing import Any

import numpy as np

from simclient.twin.trace import Columns

from .metric import Metric

_BOUNDS = ast.Lt | ast.LtE | ast.Gt | ast.GtE


def shortfall(passes: Metric, columns: Columns, metrics: Mapping[str, Any]) -> str:
    """touchdown_speed = 2.31, not < 2.0: by 0.31"""

    def unmet(node: ast.expr) -> list[str]:
        if bool(value(node)):
            return []
        if isinstance(node, ast.BoolOp):
            return [line for part in node.values for line in unmet(part)]
        if isinstance(node, ast.Compare):
            pairs = zip([node.left, *node.comparators], node.ops, node.comparators, strict=False)
            return [line for pair in pairs for line in unmet_pair(*pair)]
        return [f"`{passes.text_of(node)}` does not hold"]

    def unmet_pair(left: ast.expr, op: ast.cmpop, right: ast.expr) -> list[str]:
        pair = ast.Compare(left, [op], [right])
        if bool(value(pair)):
            return []
        a, b = value(left), value(right)
        sign = ast.unparse(ast.Compare(ast.Name(""), [op], [ast.Name("")])).strip()
        limit = passes.text_of(right) if isinstance(right, ast.Constant) else f"{passes.text_of(right)} = {_shown(b)}"
        distance = abs(float(a) - float(b)) if isinstance(op, _BOUNDS) else 0.0
        by = f": by {distance:.3g}" if distance > 0.0 else ""
        return [f"{passes.text_of(left)} = {_shown(a)}, not {sign} {limit}{by}"]

    def value(node: ast.expr) -> Any:
        return passes.part(node, columns, metrics)

    return "; ".join(unmet(passes.tree))


def _shown(value: Any) -> str:
    """A number as short as it is exact in nine digits; a name as it is."""
    if np.asarray(value).dtype.kind == "f":
        return f"{float(value):.9g}"
    return str(np.asarray(value).item())
