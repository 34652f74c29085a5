# SPDX-License-Identifier: Apache-2.0
"""Expressions over fields: text to a checked expression, and its value."""

from ..expression.evaluate import SCALARS, Arithmetic, evaluator
from ..expression.parse import FUNCTIONS, SERIES_FUNCTIONS, parse
from ..expression.tree import ExpressionError, Kind, Node, Quantity
from ..expression.units import read as read_unit
from ..expression.units import text as unit_text

__all__ = [
    "FUNCTIONS",
    "SCALARS",
    "SERIES_FUNCTIONS",
    "Arithmetic",
    "ExpressionError",
    "Kind",
    "Node",
    "Quantity",
    "evaluator",
    "parse",
    "read_unit",
    "unit_text",
]
