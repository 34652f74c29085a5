# SPDX-License-Identifier: Apache-2.0
"""What a campaign measures in a flight: expressions over paths.

max(abs(body.outputs.rate_body[0]))          the largest value of all ticks
lander.outputs.touchdown_speed               a path by itself: its last value
time(machine.state == 'SAFE')                when that began, s; NaN: never
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from fcsl_compiler.api.expressions import (
    FUNCTIONS,
    SERIES_FUNCTIONS,
    ExpressionError,
    Kind,
    Node,
    Quantity,
    evaluator,
    parse,
    unit_text,
)
from simclient.descriptor import Machine
from simclient.quantities import quantity, selection
from simclient.twin.trace import Columns

from .column_arithmetic import column_arithmetic, widest

#: What leaves a value in its unit.
_SAME_UNIT = ("*", "+", "-", "negative", "positive", "abs", "norm", "min", "max", "first", "last", "mean", "std", "rms")
#: Names that no metric may have.
RESERVED = tuple(dict.fromkeys((*FUNCTIONS, *SERIES_FUNCTIONS)))


class MetricError(ValueError):
    """The expression, or a part of it, is wrong."""


class Metric:
    """An expression. `paths` are what it reads, `quantity` what it is, `unit` that of its value, as fields have it, or empty;
    `all_ticks`: not only the last values.

    metrics: those that it may use, by name. condition: it must be true or false. Raises MetricError.
    """

    def __init__(
        self, text: str, machine: Machine, metrics: Mapping[str, Metric] | None = None, condition: bool = False
    ):
        self.text = text
        known = {name: metric.quantity for name, metric in (metrics or {}).items()}
        try:
            self.root = parse(
                text, lambda path: quantity(path, machine), series=True, metrics=known, condition=condition
            )
        except ExpressionError as error:
            raise MetricError(str(error)) from None
        self.quantity: Quantity = self.root.quantity
        if self.quantity.kind is Kind.NAME:
            raise MetricError(f"`{text}` is a name, not a number: compare it")
        self._arithmetic = column_arithmetic(machine.tick_hz)
        leaves = list(self.root.walk())
        self.paths = {
            selection(node.value, machine).field.path for node in leaves if node.operator in ("field", "column")
        }
        self.unit = _unit(self.root, machine, metrics or {})
        self.all_ticks = any(node.operator == "column" for node in leaves)

    def __call__(self, columns: Columns, metrics: Mapping[str, Any]) -> float | bool:
        """Its value in a flight."""
        value = self.part(self.root, columns, metrics)
        return bool(value) if self.quantity.kind is Kind.BOOL else float(value)

    def part(self, node: Node, columns: Columns | Mapping[str, Any], metrics: Mapping[str, Any]) -> Any:
        """The value of a part of `root` in a flight. Raises MetricError where an integer does not fit."""

        def source(leaf: Node) -> Any:
            if leaf.operator == "metric":
                return metrics[leaf.value]
            column = widest(columns[leaf.value])
            return column if leaf.operator == "column" else column[-1]

        try:
            with np.errstate(all="ignore"):
                return evaluator(node, self._arithmetic)(source)
        except ExpressionError as error:
            raise MetricError(f"`{self.text}` has no value: {error}") from None


def _unit(node: Node, machine: Machine, metrics: Mapping[str, Metric]) -> str:
    """The unit of a part, as a path in it has it; else that of its quantity. A condition as a factor has no unit."""
    if node.quantity.kind in (Kind.BOOL, Kind.NAME):
        return ""
    if node.operator == "metric":
        return metrics[node.value].unit
    if node.operator in ("field", "column"):
        return selection(node.value, machine).field.unit
    parts = [part for part in node.parts if part.quantity.kind is not Kind.BOOL]
    if node.operator in _SAME_UNIT and (node.operator != "*" or len(parts) == 1):
        found = next(filter(None, (_unit(part, machine, metrics) for part in parts)), "")
        if found:
            return found
    return unit_text(node.quantity.unit) if node.quantity.unit else ""
