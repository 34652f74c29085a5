# SPDX-License-Identifier: Apache-2.0
"""What of `pass` did not hold in a flight, and by how much."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from fcsl_compiler.api.expressions import Node
from simclient.twin.trace import Columns

from .metric import Metric


def shortfall(passes: Metric, columns: Columns, metrics: Mapping[str, Any]) -> str:
    """touchdown_speed = 2.31, not < 2.0: by 0.31"""

    def unmet(node: Node) -> list[str]:
        if bool(value(node)):
            return []
        if node.operator in ("and", "or"):
            return [line for part in node.parts for line in unmet(part)]
        if node.operator == "compare":
            pairs = zip(node.parts, node.value, node.parts[1:], strict=False)
            return [line for left, operator, right in pairs for line in unmet_pair(node, left, operator, right)]
        return [f"`{node.text}` does not hold"]

    def unmet_pair(chain: Node, left: Node, operator: str, right: Node) -> list[str]:
        if bool(value(replace(chain, parts=(left, right), value=(operator,)))):
            return []
        a, b = value(left), value(right)
        limit = right.text if right.operator == "literal" else f"{right.text} = {_shown(b)}"
        distance = abs(float(a) - float(b)) if operator not in ("==", "!=") else 0.0
        by = f": by {distance:.3g}" if distance > 0.0 else ""
        return [f"{left.text} = {_shown(a)}, not {operator} {limit}{by}"]

    def value(node: Node) -> Any:
        return passes.part(node, columns, metrics)

    return "; ".join(unmet(passes.root))


def _shown(value: Any) -> str:
    """A number as short as it is exact in nine digits; a name as it is."""
    if np.asarray(value).dtype.kind == "f":
        return f"{float(value):.9g}"
    return str(np.asarray(value).item())
