# SPDX-License-Identifier: Apache-2.0
"""Conditions of requirements as expressions of the language.

A comparison with a NaN is neither true nor false, and `and`, `or`, `not` pass that on (Kleene's strong logic). So each
condition becomes two expressions: that it is true, and that it is false.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..expression.tree import Kind, Node

_OPPOSITE = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
_DEGREES = repr(180.0 / math.pi)


@dataclass(frozen=True)
class Truth:
    """Two conditions of the language, of which at most one holds."""

    true: str
    false: str

    @property
    def negated(self) -> Truth:
        return Truth(self.false, self.true)


def certain(condition: str) -> Truth:
    """A condition that is true or false."""
    return Truth(condition, f"not {condition}")


def all_of(parts: list[Truth]) -> Truth:
    return Truth(_joined("and", [p.true for p in parts]), _joined("or", [p.false for p in parts]))


def any_of(parts: list[Truth]) -> Truth:
    return all_of([part.negated for part in parts]).negated


#: Most parts of one chain: the language bounds the depth of a condition.
_CHAIN_MAX = 32


def _joined(word: str, parts: list[str]) -> str:
    while len(parts) > _CHAIN_MAX:
        groups = [parts[i : i + _CHAIN_MAX] for i in range(0, len(parts), _CHAIN_MAX)]
        parts = [_joined(word, group) for group in groups]
    return parts[0] if len(parts) == 1 else "(" + f" {word} ".join(parts) + ")"


def size(node: Node) -> int:
    """About how many values its code reads: a comparison of two conditions needs each four times."""
    parts = sum(map(size, node.parts))
    if node.operator == "compare" and all(part.quantity.kind is Kind.BOOL for part in node.parts):
        return 4 * parts
    if node.operator in ("in", "not in"):
        return parts + (len(node.parts) - 2) * size(node.parts[0])
    return max(parts, 1)


class Code:
    """`read`: the value of a field's scalar, as its type is; `past`: by id of a node, the name of the local that holds the
    value of an operator of the past; of a condition, there are two, with `_true` and `_false` behind it."""

    def __init__(self, read: Callable[[Node, int], str], past: dict[int, str]):
        self._read, self._past = read, past

    # ---- conditions -------------------------------------------------------------------------------------------------

    def truth(self, node: Node) -> Truth:
        if id(node) in self._past:
            name = self._past[id(node)]
            return Truth(f"{name}_true", f"{name}_false")
        if node.operator == "literal":
            return certain(str(node.value))
        if node.operator == "field":
            return certain(self._read(node, 0))
        if node.operator == "not":
            return self.truth(node.parts[0]).negated
        if node.operator in ("and", "or"):
            parts = [self.truth(part) for part in node.parts]
            return all_of(parts) if node.operator == "and" else any_of(parts)
        if node.operator == "compare":
            pairs = zip(node.parts, node.value, node.parts[1:], strict=False)
            return all_of([self._comparison(a, operator, b) for a, operator, b in pairs])
        if node.operator in ("in", "not in"):
            part, *items = node.parts
            found = any_of([self._comparison(part, "==", item) for item in items])
            return found if node.operator == "in" else found.negated
        (part,) = node.parts
        if part.quantity.kind is not Kind.FLOAT:
            return certain("False" if node.operator == "isnan" else "True")
        return certain(f"{node.operator}({self.number(part)})")

    def _comparison(self, a: Node, operator: str, b: Node) -> Truth:
        kinds = {a.quantity.kind, b.quantity.kind}
        if kinds == {Kind.NAME}:
            names = (a if a.operator != "literal" else b).quantity.names
            left, right = (str(names.index(n.value)) if n.operator == "literal" else self.name(n) for n in (a, b))
            return certain(f"({left} {operator} {right})")
        if kinds == {Kind.BOOL} and operator in ("==", "!="):
            one, other = self.truth(a), self.truth(b)
            both = any_of([all_of([one, other]), all_of([one.negated, other.negated])])
            return both if operator == "==" else both.negated
        if Kind.FLOAT not in kinds:
            return certain(f"({self.integer(a)} {operator} {self.integer(b)})")
        left, right = self.number(a), self.number(b)
        if operator in _OPPOSITE:
            return Truth(f"({left} {operator} {right})", f"({left} {_OPPOSITE[operator]} {right})")
        equal = Truth(f"({left} == {right})", f"({left} < {right} or {left} > {right})")
        return equal if operator == "==" else equal.negated

    def name(self, node: Node) -> str:
        """The number of the name that a field has."""
        return self._past[id(node)] if id(node) in self._past else self._read(node, 0)

    def _remembered(self, node: Node, element: int) -> str:
        return f"{self._past[id(node)]}_{element}" if node.quantity.shape else self._past[id(node)]

    # ---- numbers ----------------------------------------------------------------------------------------------------

    def scalar(self, node: Node, element: int = 0) -> str:
        """An f64 or an i64, as its kind is."""
        return (self.number if node.quantity.kind is Kind.FLOAT else self.integer)(node, element)

    def number(self, node: Node, element: int = 0) -> str:
        """An f64: of a vector its element."""
        if node.quantity.kind is not Kind.FLOAT:
            if node.operator == "literal":
                return repr(float(node.value))
            return f"f64({self.integer(node, element)})"
        if id(node) in self._past:
            return self._remembered(node, element)
        operator = node.operator
        if operator == "literal":
            return repr(node.value)
        if operator == "field":
            return self._read(node, element)
        if operator == "norm":
            (vector,) = node.parts
            squares = [self.number(vector, i) for i in range(vector.quantity.shape[0])]
            return "sqrt(" + " + ".join(f"{x} * {x}" for x in squares) + ")"
        parts = [self.number(part, element) for part in node.parts]
        if operator == "degrees":
            return f"({parts[0]} * {_DEGREES})"
        if operator == "**":
            base, exponent = node.parts
            if base.operator == "field" and exponent.operator == "literal" and exponent.value == 2:
                return f"({parts[0]} * {parts[0]})"  # the same bits: both are rounded correctly
            return f"pow({parts[0]}, {parts[1]})"
        if operator in ("min", "max"):
            return _nested("least" if operator == "min" else "greatest", parts)
        return self._arithmetic(operator, parts)

    def integer(self, node: Node, element: int = 0) -> str:
        """An i64."""
        if node.quantity.kind is Kind.BOOL:
            truth = "True" if node.operator == "literal" and node.value else self.truth(node).true
            return f"(i64(1) if {truth} else i64(0))"
        if id(node) in self._past:
            return self._remembered(node, element)
        if node.operator == "literal":
            return f"i64({node.value})"
        if node.operator == "field":
            return f"i64({self._read(node, element)})"
        parts = [self.integer(part, element) for part in node.parts]
        if node.operator in ("min", "max"):
            return _nested(node.operator, parts)
        return self._arithmetic(node.operator, parts)

    def _arithmetic(self, operator: str, parts: list[str]) -> str:
        if operator in ("negative", "positive"):
            return f"(-{parts[0]})" if operator == "negative" else parts[0]
        if operator in ("abs", "sqrt"):
            return f"{operator}({parts[0]})"
        return f"({parts[0]} {operator} {parts[1]})"


def _nested(function: str, parts: list[str]) -> str:
    found = parts[0]
    for part in parts[1:]:
        found = f"{function}({found}, {part})"
    return found
