# SPDX-License-Identifier: Apache-2.0
"""Checks expressions: syntax tree to typed IR, with every implicit rule made explicit."""

from __future__ import annotations

import ast

from . import ir
from .check_call import CallChecker
from .check_place import PlaceChecker
from .literals import FLOAT_LITERAL, INT_LITERAL, LiteralError, fold, is_literal
from .source import Span
from .types import BOOL, F64, I64, Array, Scalar, Struct, Type, shape_of

_BINARY = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.Pow: "**",
    ast.LShift: "<<",
    ast.RShift: ">>",
    ast.BitAnd: "&",
    ast.BitOr: "|",
    ast.BitXor: "^",
}
_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}

_INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lambda: ("`lambda`", "write a module-level function"),
    ast.ListComp: ("a list comprehension", "fill an array in a bounded `for` loop"),
    ast.SetComp: ("a set", "use an array"),
    ast.DictComp: ("a dict", "use ports or locals"),
    ast.GeneratorExp: ("a generator", "write a bounded `for` loop"),
    ast.Dict: ("a dict", "use ports or locals"),
    ast.Set: ("a set", "use an array"),
    ast.JoinedStr: ("a string", "algorithms compute with numbers; use health and outputs to report"),
    ast.NamedExpr: ("`:=`", "assign on a line of its own"),
    ast.Await: ("`await`", "an algorithm runs to completion in its tick"),
    ast.Yield: ("`yield`", "keep what the next tick needs in `State`"),
    ast.Starred: ("`*` unpacking", "name the elements"),
    ast.Tuple: ("a tuple", "write an array `[a, b]`, or assign one name a line"),
    ast.Slice: ("a slice here", "a slice stands in brackets behind an array: `x[1:3]`"),
}


class ExprChecker(CallChecker, PlaceChecker):
    """The whole expression checker: operators here, calls and places in its bases."""

    def raw(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        if isinstance(node, ast.Constant):
            return self._constant(node)
        if isinstance(node, ast.Name):
            return self.name(node)
        if isinstance(node, ast.Attribute):
            return self.attribute(node)
        if isinstance(node, ast.Subscript):
            return self.subscript(node)
        if isinstance(node, ast.UnaryOp):
            return self._unary(node, want)
        if isinstance(node, ast.BinOp):
            return self._binary(node, want)
        if isinstance(node, ast.BoolOp):
            return self._boolean(node)
        if isinstance(node, ast.Compare):
            return self._compare(node)
        if isinstance(node, ast.IfExp):
            return self._choose(node, want)
        if isinstance(node, ast.Call):
            return self.call(node, want)
        if isinstance(node, ast.List):
            return self._array(node, want)
        what, instead = _INSTEAD.get(type(node), ("this expression", "use what docs/language.md lists"))
        self.fail("E410", f"{what} is not part of the language", self.span(node), help=instead)

    def _constant(self, node: ast.Constant) -> ir.Expr:
        span, value = self.span(node), node.value
        if isinstance(value, bool):
            return ir.Const(BOOL, value, span)
        if isinstance(value, int):
            if value.bit_length() > 4096:
                self.fail("E401", "the integer is too large", span, help="no type of the language holds it")
            return ir.Const(INT_LITERAL, value, span)
        if isinstance(value, float):
            if value == float("inf"):
                self.fail("E401", "the literal is beyond the range of f64", span, help="an infinity is written `inf`")
            return ir.Const(FLOAT_LITERAL, value, span)
        if isinstance(value, str):
            fix = "a request is written TransitionRequest.NAME, a health Health.degraded"
            self.fail("E410", "a string is not part of the language", span, help=fix)
        self.fail("E410", f"`{node.value!r}` is not part of the language", span, help="numbers, True and False are")

    def _unary(self, node: ast.UnaryOp, want: Type | None) -> ir.Expr:
        span = self.span(node)
        if isinstance(node.op, ast.Not):
            return self.apply("not", (self.expect(node.operand, BOOL, "the operand of `not`"),), span)
        if isinstance(node.op, ast.UAdd):
            self.fail("E410", "unary `+` is not part of the language", span, help="leave it out")
        operand = self.raw(node.operand, want)
        if isinstance(operand, ir.Const) and is_literal(operand.type):
            assert isinstance(operand.value, int | float)
            if isinstance(node.op, ast.USub):
                return ir.Const(operand.type, -operand.value, span)
            if isinstance(operand.value, int):
                return ir.Const(operand.type, ~operand.value, span)
        operand = self.settle(operand, want)
        if isinstance(node.op, ast.Invert):
            return self.apply("~", (operand,), span)
        return self.elementwise("neg", (operand,), "-", span)

    def _binary(self, node: ast.BinOp, want: Type | None) -> ir.Expr:
        symbol, span = _BINARY.get(type(node.op)), self.span(node)
        if symbol is None:
            fix = "write `matmul(a, b)`, `matvec(a, x)` or `dot(a, b)`"
            self.fail("E410", "`@` is not part of the language", span, help=fix)
        left, right = self.raw(node.left, want), self.raw(node.right, want)
        if symbol == "**":
            return self._power(left, right, span)
        if is_literal(left.type) and is_literal(right.type):
            if isinstance(left, ir.Const) and isinstance(right, ir.Const):
                assert isinstance(left.value, int | float) and isinstance(right.value, int | float)
                return self._fold(symbol, left.value, right.value, span)
            left = self.settle(left, want)
        if symbol not in ("<<", ">>") or is_literal(left.type) or is_literal(right.type):
            left, right = self.meet(left, right)
        return self.elementwise(symbol, (left, right), symbol, span)

    def _fold(self, symbol: str, left: int | float, right: int | float, span: Span) -> ir.Const:
        try:
            value, kind = fold(symbol, left, right)
        except LiteralError as error:
            self.fail("E401", str(error.args[0]), span, help=str(error.args[1]))
        return ir.Const(kind, value, span)

    def elementwise(self, name: str, args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ir.Expr:
        """A scalar operation, or the same on every element of arrays."""
        arrays = [a for a in args if isinstance(a.type, Array)]
        if not arrays:
            return self.apply(name, args, span, symbol)
        shapes = {shape_of(a.type) for a in arrays}
        allowed = name == "neg" or (symbol in "+-" and len(arrays) == 2) or (symbol in "*/" and len(arrays) == 1)
        if symbol == "/" and isinstance(args[-1].type, Array):
            allowed = False
        if not allowed:
            self.fail("E413", f"`{symbol}` between {args[0].type} and {args[-1].type}", span, help=_array_hint(symbol))
        if len(shapes) > 1:
            self.fail("E413", f"`{symbol}` between {args[0].type} and {args[-1].type}", span, why="the shapes differ")
        scalars = tuple(a.type.element if isinstance(a.type, Array) else a.type for a in args)
        op = self.find(name, scalars, args, symbol, span)
        if op.faults:
            self.scope.faults = True
        return ir.Elementwise(Array(op.result, shapes.pop()), op, args, span)

    def _power(self, base: ir.Expr, exponent: ir.Expr, span: Span) -> ir.Expr:
        if isinstance(base.type, Array) or isinstance(exponent.type, Array):
            self.fail("E413", "`**` on an array", span, help="loop over the elements")
        base = base if isinstance(base, ir.Const) else self.settle(base, None)
        small = isinstance(exponent, ir.Const) and exponent.type is INT_LITERAL
        if small and isinstance(exponent, ir.Const) and exponent.value in (0, 1, 2, 3, 4):
            if isinstance(base, ir.Const) and is_literal(base.type):
                assert isinstance(base.value, int | float) and isinstance(exponent.value, int)
                power = self._fold("*", base.value, base.value, span) if exponent.value > 1 else base
                for _ in range(exponent.value - 2):
                    power = self._fold("*", power.value, base.value, span)  # type: ignore[arg-type]
                return power if exponent.value else ir.Const(base.type, type(base.value)(1), span)
            assert isinstance(base.type, Scalar)
            if not base.type.is_number:
                self._no_such_operation("**", (base,), span)
            return base if exponent.value == 1 else self.apply(f"**{exponent.value}", (base,), span, "**")
        left, right = self.meet(base, exponent)
        if isinstance(left.type, Scalar) and left.type.is_integer:
            fix = "an integer's exponent is a literal from 0 to 4; convert to f64 for others"
            self.fail("E415", "`**` with this exponent", span, help=fix)
        return self.apply("pow", (left, right), span, "**")

    def _boolean(self, node: ast.BoolOp) -> ir.Expr:
        word = "and" if isinstance(node.op, ast.And) else "or"
        operands = [self.expect(v, BOOL, f"the operand of `{word}`") for v in node.values]
        result = operands[-1]
        for left in reversed(operands[:-1]):
            span = self.span(node)
            if word == "and":
                result = ir.Choose(BOOL, left, result, ir.Const(BOOL, False, span), span)
            else:
                result = ir.Choose(BOOL, left, ir.Const(BOOL, True, span), result, span)
        return result

    def _compare(self, node: ast.Compare) -> ir.Expr:
        span = self.span(node)
        operands = [self.raw(n) for n in (node.left, *node.comparators)]
        tests: list[ir.Expr] = []
        names: dict[int, ir.Expr] = {}  # operands of two comparisons, evaluated once
        for position in range(1, len(operands) - 1):
            shared = operands[position]
            if isinstance(shared, ir.Choose):
                shared = operands[position] = self.settle(shared, None)
            if not isinstance(shared, ir.Const | ir.Local | ir.RangeVar | ir.Field):
                self._shared += 1
                names[position] = shared
                operands[position] = ir.Local(shared.type, f"shared.{self._shared}", shared.span)
        for position, operator in enumerate(node.ops):
            symbol = _COMPARE.get(type(operator))
            if symbol is None:
                fix = "`==` compares values" if isinstance(operator, ast.Is | ast.IsNot) else "loop over the elements"
                self.fail("E410", "this comparison is not part of the language", span, help=fix)
            left, right = self.meet(operands[position], operands[position + 1])
            if isinstance(left.type, Array | Struct) or isinstance(right.type, Array | Struct):
                what = "arrays" if isinstance(left.type, Array) or isinstance(right.type, Array) else "structs"
                self.fail("E413", f"`{symbol}` on {what}", span, help="compare their numbers")
            # A chain a < b < c shares b: what b became for its left side must hold for its right side too.
            operands[position], operands[position + 1] = left, right
            tests.append(self.apply(symbol, (left, right), span))
        result = tests[-1]
        for position in reversed(range(len(tests) - 1)):
            result = ir.Choose(BOOL, tests[position], result, ir.Const(BOOL, False, span), span)
            if position + 1 in names:
                local = operands[position + 1]
                assert isinstance(local, ir.Local)
                result = ir.Let(BOOL, local.name, names[position + 1], result, span)
        return result

    def _choose(self, node: ast.IfExp, want: Type | None) -> ir.Expr:
        condition = self.expect(node.test, BOOL, "the condition")
        then, otherwise = self.raw(node.body, want), self.raw(node.orelse, want)
        if is_literal(then.type) and is_literal(otherwise.type):
            kind = FLOAT_LITERAL if FLOAT_LITERAL in (then.type, otherwise.type) else INT_LITERAL
            return ir.Choose(kind, condition, then, otherwise, self.span(node))
        then, otherwise = self.meet(then, otherwise)
        if then.type != otherwise.type:
            notes = ((then.span, f"this is {then.type}"), (otherwise.span, f"this is {otherwise.type}"))
            why, fix = "a value has one type, whichever branch is taken", "convert one of the two"
            self.fail("E402", "the two branches have different types", self.span(node), why=why, help=fix, notes=notes)
        return ir.Choose(then.type, condition, then, otherwise, self.span(node))

    def _array(self, node: ast.List, want: Type | None) -> ir.Expr:
        span = self.span(node)
        if not node.elts:
            self.fail("E413", "an empty array", span, help="every array has at least one element")
        element = want.element if isinstance(want, Array) and isinstance(want.element, Scalar) else None
        rows = any(isinstance(e, ast.List) for e in node.elts)
        inner: Type | None = element
        if rows and isinstance(want, Array):
            inner = Array(want.element, want.shape[1:] or (1,))
        items = [self.raw(e, inner) for e in node.elts]
        if all(is_literal(i.type) for i in items):
            mixed = F64 if any(i.type is FLOAT_LITERAL for i in items) else I64
            target = element if element is not None and element.is_number else mixed
            items = [self.settle(i, target) for i in items]
        else:
            typed = next(i for i in items if not is_literal(i.type))
            items = [self.settle(i, typed.type) for i in items]
        for item in items[1:]:
            if item.type != items[0].type:
                notes = ((items[0].span, f"this is {items[0].type}"),)
                message = f"an element of type {item.type} in an array of {items[0].type}"
                self.fail("E402", message, item.span, help="the elements of an array have one type", notes=notes)
        first = items[0].type
        if isinstance(first, Array):
            flat: list[ir.Expr] = []
            for item in items:
                if not isinstance(item, ir.ArrayValue):
                    self.fail(
                        "E413", "rows of an array literal are literals themselves", item.span, help="copy by element"
                    )
                flat.extend(item.items)
            return ir.ArrayValue(Array(first.element, (len(items), *first.shape)), tuple(flat), span)
        return ir.ArrayValue(Array(first, (len(items),)), tuple(items), span)


def _array_hint(symbol: str) -> str:
    if symbol == "*":
        return "write `dot(a, b)`, `matvec(A, x)` or `matmul(A, B)`; `*` multiplies by a scalar"
    if symbol == "/":
        return "`/` divides an array by a scalar; write `solve(A, b)` for a system"
    return "arrays have `+`, `-`, unary `-`, and `*` and `/` by a scalar"
