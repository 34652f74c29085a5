# SPDX-License-Identifier: Apache-2.0
"""What may be mutated in a Python file: operators, constants, statements and results inside of functions (the module ast)."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from .mutants import Point, shown

_COMPARED: dict[type[ast.cmpop], tuple[tuple[str, type[ast.cmpop]], ...]] = {
    ast.Lt: (("boundary", ast.LtE), ("relation", ast.GtE)),
    ast.LtE: (("boundary", ast.Lt), ("relation", ast.Gt)),
    ast.Gt: (("boundary", ast.GtE), ("relation", ast.LtE)),
    ast.GtE: (("boundary", ast.Gt), ("relation", ast.Lt)),
    ast.Eq: (("relation", ast.NotEq),),
    ast.NotEq: (("relation", ast.Eq),),
    ast.Is: (("relation", ast.IsNot),),
    ast.IsNot: (("relation", ast.Is),),
    ast.In: (("relation", ast.NotIn),),
    ast.NotIn: (("relation", ast.In),),
}
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.FloorDiv,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.Mult,
    ast.LShift: ast.RShift,
    ast.RShift: ast.LShift,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
}
_SWITCH = "{switch}"


def points(source: bytes) -> list[Point]:
    """Of every function of the file. What runs at import (defaults, decorators, classes) is left out: every test reaches it."""
    return list(_File(source).module())


def _is_text(node: ast.expr) -> bool:
    return isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str))


def _is_strict(node: ast.AST) -> bool:
    """`strict=True` of zip asserts that the lengths are equal: without it, a right program does the same."""
    if not isinstance(node, ast.keyword) or node.arg != "strict":
        return False
    return isinstance(node.value, ast.Constant) and node.value.value is True


class _File:
    def __init__(self, source: bytes):
        self._source = source
        starts = [0]
        for line in source.splitlines(keepends=True):
            starts.append(starts[-1] + len(line))
        self._starts = starts

    def module(self) -> Iterator[Point]:
        yield from self._outside(ast.parse(self._source))

    def _outside(self, node: ast.AST) -> Iterator[Point]:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                for statement in child.body:
                    yield from self._inside(statement)
            else:
                yield from self._outside(child)

    def _inside(self, node: ast.AST) -> Iterator[Point]:
        if isinstance(node, (ast.JoinedStr, ast.pattern)):
            return  # Python 3.11 does not say where the parts of an f-string are
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
            yield from self._outside(ast.Module([node], []))
            return
        if isinstance(node, ast.AnnAssign):
            if node.value is not None:
                yield from self._inside(node.value)
            return
        yield from self._own(node)
        for child in ast.iter_child_nodes(node):
            if not _is_strict(child):
                yield from self._inside(child)

    def _span(self, node: ast.stmt | ast.expr) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        begin = self._starts[node.lineno - 1] + node.col_offset
        return begin, self._starts[node.end_lineno - 1] + node.end_col_offset

    def _point(self, node: ast.stmt | ast.expr, kind: str, after: str, both: str) -> Point:
        begin, end = self._span(node)
        before = self._source[begin:end].decode()
        return Point(begin, end, node.lineno, kind, shown(before), shown(after), both.replace("{before}", before))

    def _expression(self, node: ast.expr, kind: str, mutated: ast.expr) -> Point:
        after = ast.unparse(mutated)
        return self._point(node, kind, after, f"(({after}) if {_SWITCH} else ({{before}}))")

    def _own(self, node: ast.AST) -> Iterator[Point]:
        if isinstance(node, ast.Compare) and len(node.ops) == 1:
            for kind, operator in _COMPARED.get(type(node.ops[0]), ()):
                yield self._expression(node, kind, ast.Compare(node.left, [operator()], node.comparators))
        elif isinstance(node, ast.BinOp) and type(node.op) in _COMPUTED:
            if not _is_text(node.left) and not _is_text(node.right):
                mutated = ast.BinOp(node.left, _COMPUTED[type(node.op)](), node.right)
                yield self._expression(node, "arithmetic", mutated)
        elif isinstance(node, ast.BoolOp):
            other: ast.boolop = ast.Or() if isinstance(node.op, ast.And) else ast.And()
            yield self._expression(node, "logic", ast.BoolOp(other, node.values))
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.Not):
            yield self._expression(node, "logic", node.operand)
        elif isinstance(node, ast.Constant) and isinstance(node.value, (bool, int, float)):
            value = not node.value if isinstance(node.value, bool) else node.value + 1
            yield self._expression(node, "constant", ast.Constant(value))
        elif isinstance(node, ast.Return) and node.value is not None and not isinstance(node.value, ast.Constant):
            yield self._expression(node.value, "result", ast.Constant(None))
        elif isinstance(node, ast.stmt):
            yield from self._statement(node)

    def _statement(self, node: ast.stmt) -> Iterator[Point]:
        """Without it. A name that was never bound would be found at once, so assignments to names stay."""
        is_call = isinstance(node, ast.Expr) and isinstance(node.value, ast.Call)
        is_kept = isinstance(node, ast.Assign) and any(
            isinstance(t, (ast.Attribute, ast.Subscript)) for t in node.targets
        )
        if is_call or is_kept or isinstance(node, (ast.AugAssign, ast.Raise, ast.Continue, ast.Break)):
            yield self._point(node, "deletion", "", f"if not {_SWITCH}: {{before}}")
        if isinstance(node, ast.AugAssign) and isinstance(node.op, (ast.Add, ast.Sub)) and not _is_text(node.value):
            mutated = ast.AugAssign(node.target, _COMPUTED[type(node.op)](), node.value)
            sign, value = "+" if isinstance(node.op, ast.Add) else "-", ast.unparse(node.value)
            both = f"{ast.unparse(node.target)} {sign}= (-({value}) if {_SWITCH} else ({value}))"
            yield self._point(node, "arithmetic", ast.unparse(mutated), both)
