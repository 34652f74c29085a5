# SPDX-License-Identifier: Apache-2.0
"""Conditions on a twin: a function, or an expression over paths in Python syntax, which is parsed but never executed.

nav.outputs.P[0][0] < 1e-3 and machine.state in ('COAST', 'DESCENT')
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ..errors import TwinError
from ..paths import Selection, resolve
from ..values import check_name, enumerators

if TYPE_CHECKING:
    from ..descriptor import Machine
    from .host import TwinHost

_Value = Callable[[], Any]
_MAX_NODES = 200

_BINARY: dict[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
}
_UNARY: dict[type[ast.unaryop], Callable[[Any], Any]] = {
    ast.UAdd: operator.pos,
    ast.USub: operator.neg,
    ast.Not: operator.not_,
}
_COMPARISONS: dict[type[ast.cmpop], Callable[[Any, Any], bool]] = {
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.In: lambda a, b: a in b,
    ast.NotIn: lambda a, b: a not in b,
}
#: These, and the elements of expressions, are also those of the variable server's `eval` (docs/protocol.md).
_TESTS: dict[str, Callable[..., bool]] = {"isnan": math.isnan, "isfinite": math.isfinite}
FUNCTIONS: dict[str, Callable[..., Any]] = {"abs": abs, "min": min, "max": max, "sqrt": math.sqrt, **_TESTS}
_WORDS = {"true": True, "false": False}


class Condition:
    """Callable that returns whether the condition holds now; `read` lists the values it used.

    Raises TwinError if invalid.
    """

    def __init__(self, condition: str | Callable[[Any], bool], twin: Any):
        self._twin: TwinHost = twin
        if isinstance(condition, str):
            self._text = f"`{condition}`"
            self._holds: _Value = _Reader(condition, twin.get_value, twin.machine).value
        elif callable(condition):
            self._text = getattr(condition, "__name__", repr(condition))
            self._holds = lambda: condition(twin)
        else:
            raise TwinError(
                f"{condition!r} is not a condition; write an expression as a text, or a function of the twin"
            )
        self._reads: dict[str, Any] = {}

    def __call__(self) -> bool:
        self._twin._reads = self._reads = {}
        try:
            holds = self._holds()
        except (TypeError, ValueError, ZeroDivisionError, OverflowError) as error:
            if self._text.startswith("`") and not isinstance(error, TwinError):
                raise TwinError(f"{self._text} cannot be evaluated: {error}{self.read()}") from None
            raise
        finally:
            self._twin._reads = None
        if not isinstance(holds, bool) and not _is_numpy_bool(holds):
            raise TwinError(f"{self._text} gave {holds!r}; a condition is True or False: let it return a comparison")
        return bool(holds)

    def __str__(self) -> str:
        return self._text

    def read(self) -> str:
        """The values used by the last evaluation, one per line with unit; empty if there are none."""
        fields = self._twin.machine.fields
        return "".join(
            f"\n  {path} = {value!r}" + (f" {fields[path].unit}" if path in fields and fields[path].unit else "")
            for path, value in self._reads.items()
        )


def _is_numpy_bool(value: Any) -> bool:
    import numpy as np  # imported here, because it takes long to load

    return isinstance(value, np.bool_)


class _Words(ast.NodeTransformer):
    """Replaces `true` and `false` by Python's constants."""

    def visit_Name(self, node: ast.Name) -> ast.expr:
        return ast.copy_location(ast.Constant(_WORDS[node.id]), node) if node.id in _WORDS else node


class _Reader:
    """Compiles an expression to nested functions, whose leaves read the twin; paths are checked immediately."""

    def __init__(self, text: str, get: Callable[[str], Any], machine: Machine):
        self._text, self._get, self._machine = text, get, machine
        try:
            tree = _Words().visit(ast.parse(text.strip(), mode="eval")).body
        except (SyntaxError, ValueError) as error:
            raise TwinError(f"`{text}` is not a condition: {error}") from None
        if sum(1 for _ in ast.walk(tree)) > _MAX_NODES:
            raise TwinError(f"`{text}` is too long for a condition; give a function instead")
        self.value = self._bool(tree)

    def _part(self, node: ast.AST) -> str:
        return ast.get_source_segment(self._text.strip(), node) or type(node).__name__

    def _wrong(self, node: ast.AST) -> TwinError:
        return TwinError(
            f"`{self._text}` is not a condition: `{self._part(node)}` is neither path, number, name in quotes, arithmetic, comparison, "
            f"and/or/not nor one of {', '.join(FUNCTIONS)}; for more give a function: lambda twin: …"
        )

    def _node(self, node: ast.expr) -> _Value:
        if isinstance(node, ast.Constant) and isinstance(node.value, bool | int | float | str):
            constant = node.value
            return lambda: constant
        if isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
            return self._path(node)
        if isinstance(node, ast.List | ast.Tuple):
            items = [self._node(item) for item in node.elts]
            return lambda: [item() for item in items]
        if isinstance(node, ast.BoolOp):
            parts = [self._bool(part) for part in node.values]
            every = isinstance(node.op, ast.And)
            return lambda: (all if every else any)(part() for part in parts)
        if isinstance(node, ast.UnaryOp) and type(node.op) in _UNARY:
            apply = _UNARY[type(node.op)]
            operand = self._bool(node.operand) if apply is operator.not_ else self._node(node.operand)
            return lambda: apply(operand())
        if isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
            combine, left, right = _BINARY[type(node.op)], self._node(node.left), self._node(node.right)
            return lambda: combine(left(), right())
        if isinstance(node, ast.Compare):
            return self._comparison(node)
        if isinstance(node, ast.Call) and not node.keywords and isinstance(node.func, ast.Name):
            if node.func.id in FUNCTIONS:
                function, arguments = FUNCTIONS[node.func.id], [self._node(argument) for argument in node.args]
                return lambda: function(*[argument() for argument in arguments])
        raise self._wrong(node)

    def _bool(self, node: ast.expr) -> _Value:
        """A part that must be True or False. Other values would make the condition true by accident."""
        value, part = self._node(node), self._part(node)
        if isinstance(node, ast.Constant | ast.Name | ast.Attribute | ast.Subscript):
            is_bool, what = isinstance(value(), bool), repr(value())
        else:
            is_test = isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in _TESTS
            is_not = isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not)
            is_bool = is_test or is_not or isinstance(node, ast.BoolOp | ast.Compare)
            what = "a list" if isinstance(node, ast.List | ast.Tuple) else "a number"
        if not is_bool:
            compared = f"… == {part}" if isinstance(node, ast.Constant) else f"{part} == …"
            raise TwinError(
                f"`{self._text}` is not a condition: `{part}` is {what}, neither True nor False; compare it: `{compared}`"
            )
        return value

    def _comparison(self, node: ast.Compare) -> _Value:
        first = self._node(node.left)
        rest = [(_COMPARISONS.get(type(op)), self._node(n)) for op, n in zip(node.ops, node.comparators, strict=True)]
        if any(compare is None for compare, _ in rest):
            raise self._wrong(node)
        operands = [node.left, *node.comparators]
        for left, op, right in zip(operands, node.ops, node.comparators, strict=False):
            self._check_names(left, op, right)

        def holds() -> bool:
            left = first()
            for compare, right in rest:
                value = right()
                if compare is None or not compare(left, value):
                    return False
                left = value
            return True

        return holds

    def _check_names(self, left: ast.expr, op: ast.cmpop, right: ast.expr) -> None:
        """Rejects names of a state, health or request that do not exist, which would never match."""
        if isinstance(op, ast.Eq | ast.NotEq):
            pairs = [(left, [right]), (right, [left])]
        elif isinstance(op, ast.In | ast.NotIn) and isinstance(right, ast.List | ast.Tuple):
            pairs = [(left, right.elts)]
        else:
            return
        for path, items in pairs:
            leaf = self._leaf(path)
            if leaf is not None and enumerators(leaf.field.type, self._machine):
                for item in items:
                    if isinstance(item, ast.Constant):
                        check_name(item.value, leaf.field, leaf.path, self._machine)

    def _leaf(self, node: ast.expr) -> Selection | None:
        """The scalar or array that a node names by its path; None for other nodes."""
        if not isinstance(node, ast.Name | ast.Attribute | ast.Subscript):
            return None
        found = resolve(self._path_text(node), self._machine)
        return found if isinstance(found, Selection) else None

    def _path(self, node: ast.expr) -> _Value:
        path = self._path_text(node)
        self._get(path)  # rejects an invalid path before the first tick
        return lambda: self._get(path)

    def _path_text(self, node: ast.expr) -> str:
        if isinstance(node, ast.Name):
            return node.id
        if isinstance(node, ast.Attribute):
            return f"{self._path_text(node.value)}.{node.attr}"
        if isinstance(node, ast.Subscript):
            index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
            if all(isinstance(i, ast.Constant) and type(i.value) is int for i in index):
                return f"{self._path_text(node.value)}[{', '.join(str(i.value) for i in index)}]"  # type: ignore[attr-defined]
        raise self._wrong(node)
