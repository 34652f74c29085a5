# SPDX-License-Identifier: Apache-2.0
"""Checks expressions: syntax tree to typed IR, with every implicit rule made explicit."""

from __future__ import annotations

import ast
from typing import NoReturn

from . import ir, ops
from .check_call import CallChecker
from .diagnostics import DiagnosticSink, nearest
from .intervals import exact, fits, interval
from .literals import FLOAT_LITERAL, INT_LITERAL, LiteralError, default_type, fit, fold, is_literal
from .pysource import span_of
from .scope import BUILTIN_CONSTANTS, ArrayConstant, Scope
from .source import Span
from .types import BOOL, F64, HEALTH, HEALTH_NAMES, I64, REQUEST, Array, Scalar, Type, shape_of

_BINARY = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.FloorDiv: "//",
    ast.Mod: "%",
    ast.Pow: "**",
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
    ast.Slice: ("a slice", "index the elements"),
}


class Stop(Exception):
    """This statement cannot be checked further; the reason has been reported."""


class ExprChecker(CallChecker):
    """Methods return typed IR or raise Stop."""

    def __init__(self, scope: Scope, sink: DiagnosticSink):
        self.scope, self.sink = scope, sink
        self._shared = 0

    # ---- reporting and coercion ------------------------------------------------------------------------------------

    def fail(
        self,
        code: str,
        message: str,
        span: Span,
        *,
        why: str = "",
        help: str = "",
        notes: tuple[tuple[Span, str], ...] = (),
    ) -> NoReturn:
        self.sink.error(code, message, span, why=why, help=help, notes=notes)
        raise Stop

    def span(self, node: ast.expr | ast.stmt | ast.keyword) -> Span:
        return span_of(self.scope.source, node)

    def settle(self, expr: ir.Expr, want: Type | None) -> ir.Expr:
        """Gives a literal its type: the wanted one when it is a number, else i64 or f64."""
        if isinstance(expr, ir.Const) and is_literal(expr.type):
            assert isinstance(expr.type, Scalar) and isinstance(expr.value, int | float)
            target = want if isinstance(want, Scalar) and want.is_number else default_type(expr.type)
            try:
                return ir.Const(target, fit(expr.value, expr.type, target), expr.span)
            except LiteralError as error:
                self.fail("E401", str(error.args[0]), expr.span, help=str(error.args[1]))
        if isinstance(want, Scalar) and want.is_integer and want != expr.type and isinstance(expr, ir.RangeVar):
            if want.low <= expr.low and expr.high <= want.high:
                op = ops.find(want.name, (I64,))
                assert op
                return ir.Apply(want, op, (expr,), False, expr.span)
        return expr

    def check(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """A settled expression; `want` only guides literals, the caller compares types."""
        return self.settle(self.raw(node, want), want)

    def expect(self, node: ast.expr, want: Type, what: str) -> ir.Expr:
        """An expression of exactly this type."""
        expr = self.check(node, want)
        if expr.type != want:
            self.mismatch(expr, want, what)
        return expr

    def mismatch(self, expr: ir.Expr, want: Type, what: str, notes: tuple[tuple[Span, str], ...] = ()) -> NoReturn:
        have = expr.type
        fix = ""
        if isinstance(have, Scalar) and isinstance(want, Scalar) and have.is_number and want.is_number:
            fix = f"convert: {want}(…)"
        elif want is BOOL:
            fix = "write a comparison, such as `x != 0`"
        elif isinstance(have, Scalar) and have is BOOL:
            fix = f"write `{_one(want)} if … else {_zero(want)}`" if isinstance(want, Scalar) and want.is_number else ""
        elif isinstance(have, Array) and isinstance(want, Array):
            fix = "the shapes and element types must be the same"
        why = "types never mix implicitly" if isinstance(have, Scalar) and isinstance(want, Scalar) else ""
        self.fail("E402", f"{what} is {want}, not {have}", expr.span, why=why, help=fix, notes=notes)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def raw(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        """As check, but a literal stays one."""
        if isinstance(node, ast.Constant):
            return self._constant(node)
        if isinstance(node, ast.Name):
            return self._name(node)
        if isinstance(node, ast.Attribute):
            return self._attribute(node)
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
                self.fail("E401", "the integer is too large", span)
            return ir.Const(INT_LITERAL, value, span)
        if isinstance(value, float):
            if value == float("inf"):
                self.fail("E401", "the literal is beyond the range of f64", span)
            return ir.Const(FLOAT_LITERAL, value, span)
        if isinstance(value, str):
            fix = "a request is written TransitionRequest.NAME, a health Health.degraded"
            self.fail("E410", "a string is not part of the language", span, help=fix)
        self.fail("E410", f"`{node.value!r}` is not part of the language", span, help="numbers, True and False are")

    def _name(self, node: ast.Name) -> ir.Expr:
        scope, name, span = self.scope, node.id, self.span(node)
        if name in scope.ranges:
            variable = scope.ranges[name]
            return ir.RangeVar(I64, name, variable.low, variable.high, span)
        if name in scope.poisoned:
            raise Stop
        if name in scope.types:
            type_, first = scope.types[name]
            if name not in scope.assigned and not scope.unreachable:
                self.fail(
                    "E403",
                    f"`{name}` may not have a value here",
                    span,
                    why="some path to this line does not assign it",
                    help=f"assign `{name}` before the branch",
                    notes=((first, "assigned here, on one path only"),),
                )
            return ir.Local(type_, name, span)
        if name in scope.arguments:
            return ir.Local(scope.arguments[name], name, span)
        if name in scope.sizes and name not in scope.constants:
            return ir.Const(INT_LITERAL, scope.sizes[name], span)
        constant = scope.constants.get(name)
        if isinstance(constant, ArrayConstant):
            scope.used_constants.add(name)
            return ir.ModuleConst(constant.type, name, span)
        if constant is not None:
            return ir.Const(constant.value.type, constant.value.value, span)
        if name in scope.wrong:
            raise Stop
        if name in scope.records:
            fix = f"name a field: `{name}.…`"
            self.fail("E404", f"`{name}` is a record, not a value", span, help=fix)
        if name in scope.dead_ranges:
            self.fail(
                "E405",
                f"`{name}` is the variable of a loop that has ended",
                span,
                why="a loop variable lives in its loop only",
                help="copy it into a local inside the loop",
            )
        if name in ops.BUILTINS or scope.functions.is_function(name):
            self.fail("E404", f"`{name}` is a function, not a value", span, help=f"call it: `{name}(…)`")
        if name in BUILTIN_CONSTANTS:
            return ir.Const(FLOAT_LITERAL, BUILTIN_CONSTANTS[name], span)
        known = [*scope.types, *scope.arguments, *scope.constants, *scope.records]
        self.fail("E406", f"`{name}` is not defined", span, help=nearest(name, known))

    def _attribute(self, node: ast.Attribute) -> ir.Expr:
        scope, span = self.scope, self.span(node)
        if not isinstance(node.value, ast.Name):
            self.fail("E410", "only `record.field` has a dot", span, help="structs are not part of the language yet")
        owner, name = node.value.id, node.attr
        if owner == "TransitionRequest":
            if name != "none":
                scope.requests.setdefault(name, span)
            return ir.Const(REQUEST, "" if name == "none" else name, span)
        if owner == "Health":
            if name not in HEALTH_NAMES:
                fix = nearest(name, HEALTH_NAMES) or f"one of {', '.join(HEALTH_NAMES)}"
                self.fail("E407", f"`{name}` is not a health", span, help=fix)
            return ir.Const(HEALTH, HEALTH_NAMES.index(name), span)
        record = scope.records.get(owner)
        if record is None:
            hint = nearest(owner, [*scope.records, "TransitionRequest", "Health"])
            self.fail("E406", f"`{owner}` is not a record of this function", span, help=hint or _records_hint(scope))
        port = scope.ports[record].get(name)
        if port is None and name in scope.wrong:
            raise Stop
        if port is None:
            hint = nearest(name, list(scope.ports[record]))
            self.fail(
                "E408", f"{record} has no field `{name}`", span, help=hint or f"declare it in its class: `{name}: f64`"
            )
        return ir.Field(port.type, record, owner, name, span)

    def subscript(self, node: ast.Subscript) -> ir.Element:
        """`base[i, j]`, `base[i][j]`; constant indices are checked here, others by the generated code unless proven."""
        base = node.value
        indices: list[ast.expr] = list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]
        while isinstance(base, ast.Subscript):
            inner = list(base.slice.elts) if isinstance(base.slice, ast.Tuple) else [base.slice]
            indices = inner + indices
            base = base.value
        array = self.raw(base)
        span = self.span(node)
        if not isinstance(array, ir.Local | ir.Field | ir.ModuleConst):
            self.fail("E411", "only a named array can be indexed", span, help="assign it to a local first")
        shape = shape_of(array.type)
        if not shape:
            self.fail("E411", f"a {array.type} cannot be indexed", span)
        if len(indices) > len(shape):
            self.fail("E411", f"{len(indices)} indices for a {array.type}", span)
        checked = [self._index(index, extent) for index, extent in zip(indices, shape, strict=False)]
        rest = shape[len(indices) :]
        assert isinstance(array.type, Array)
        type_: Type = Array(array.type.element, rest) if rest else array.type.element
        return ir.Element(type_, array, tuple(e for e, _ in checked), tuple(c for _, c in checked), span)

    def _index(self, node: ast.expr, extent: int) -> tuple[ir.Expr, bool]:
        if isinstance(node, ast.Slice):
            self.fail("E410", "a slice is not part of the language yet", self.span(node), help="index the elements")
        index = self.check(node, I64)
        if not (isinstance(index.type, Scalar) and index.type.is_integer):
            self.fail("E411", f"an index is an integer, not {index.type}", index.span, help="convert: i64(…)")
        if isinstance(index, ir.Const):
            assert isinstance(index.value, int)
            value = index.value + extent if -extent <= index.value < 0 else index.value
            if not 0 <= value < extent:
                self.fail("E412", f"index {index.value} is outside [0, {extent})", index.span)
            return ir.Const(index.type, value, index.span), False
        bounds = interval(index)
        if bounds and 0 <= bounds[0] and bounds[1] < extent:
            return index, False
        if bounds and (bounds[0] >= extent or bounds[1] < 0):
            self.fail("E412", f"the index lies in [{bounds[0]}, {bounds[1]}], outside [0, {extent})", index.span)
        self.scope.faults = True
        return index, True

    def _unary(self, node: ast.UnaryOp, want: Type | None) -> ir.Expr:
        span = self.span(node)
        if isinstance(node.op, ast.Not):
            return self.apply("not", (self.expect(node.operand, BOOL, "the operand of `not`"),), span)
        if not isinstance(node.op, ast.USub):
            self.fail("E410", "this unary operator is not part of the language", span, help="`-` and `not` are")
        operand = self.raw(node.operand, want)
        if isinstance(operand, ir.Const) and is_literal(operand.type):
            assert isinstance(operand.value, int | float)
            return ir.Const(operand.type, -operand.value, span)
        return self.elementwise("neg", (operand,), "-", span)

    def _binary(self, node: ast.BinOp, want: Type | None) -> ir.Expr:
        symbol, span = _BINARY.get(type(node.op)), self.span(node)
        if symbol is None:
            matrix = isinstance(node.op, ast.MatMult)
            fix = "write `matmul(a, b)`, `matvec(a, x)` or `dot(a, b)`" if matrix else "it comes with a later version"
            self.fail("E410", "this operator is not part of the language", span, help=fix)
        left, right = self.raw(node.left, want), self.raw(node.right, want)
        if symbol == "**":
            return self._power(left, right, span)
        left_literal, right_literal = is_literal(left.type), is_literal(right.type)
        if left_literal and right_literal:
            assert isinstance(left, ir.Const) and isinstance(right, ir.Const)
            assert isinstance(left.value, int | float) and isinstance(right.value, int | float)
            return self._fold(symbol, left.value, right.value, span)
        left, right = self.meet(left, right)
        return self.elementwise(symbol, (left, right), symbol, span)

    def _fold(self, symbol: str, left: int | float, right: int | float, span: Span) -> ir.Const:
        try:
            value, kind = fold(symbol, left, right)
        except LiteralError as error:
            self.fail("E401", str(error.args[0]), span, help=str(error.args[1]))
        return ir.Const(kind, value, span)

    def meet(self, left: ir.Expr, right: ir.Expr) -> tuple[ir.Expr, ir.Expr]:
        """A literal or loop variable adopts the other operand's scalar type."""
        left_type = left.type.element if isinstance(left.type, Array) else left.type
        right_type = right.type.element if isinstance(right.type, Array) else right.type
        if is_literal(left_type) and is_literal(right_type):
            both = F64 if FLOAT_LITERAL in (left_type, right_type) else I64
            return self.settle(left, both), self.settle(right, both)
        if is_literal(left_type) or (isinstance(left, ir.RangeVar) and not is_literal(right_type)):
            return self.settle(left, right_type), right
        return left, self.settle(right, left_type)

    def elementwise(self, name: str, args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ir.Expr:
        """A scalar operation, or the same on every element of arrays."""
        arrays = [a for a in args if isinstance(a.type, Array)]
        if not arrays:
            return self.apply(name, args, span)
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

    def find(self, name: str, scalars: tuple[Type, ...], args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ops.Op:
        op = ops.find(name, tuple(s for s in scalars if isinstance(s, Scalar)))
        if op is None:
            self._no_such_operation(symbol, args, span)
        return op

    def apply(self, name: str, args: tuple[ir.Expr, ...], span: Span, symbol: str = "") -> ir.Expr:
        """One operation of the op table on settled scalars."""
        op = self.find(name, tuple(a.type for a in args), args, symbol or name, span)
        fault = bool(op.faults)
        if fault and op.proven:
            bounds = exact(op, args)
            divisor = interval(args[1]) if op.name in ("//", "%") else None
            if divisor == (0, 0):
                self.fail("E414", "division by zero", span, help="the divisor is a constant zero")
            if (bounds and fits(op, bounds)) or (divisor and divisor[0] > 0):
                fault = False
        self.scope.faults = self.scope.faults or fault
        return ir.Apply(op.result, op, args, fault, span)

    def _no_such_operation(self, symbol: str, args: tuple[ir.Expr, ...], span: Span) -> NoReturn:
        types = [a.type for a in args]
        scalars = [t for t in types if isinstance(t, Scalar)]
        fix, why = "", ""
        if symbol == "/" and all(t.is_integer for t in scalars) and len(scalars) == 2:
            fix = "write `//` for the floor, or f64(a) / f64(b)"
            why = "`/` is for floats only"
        elif BOOL in scalars:
            fix = "write `1.0 if condition else 0.0`" if len(set(scalars)) > 1 or symbol in "+-*/" else ""
            why = "a bool has no arithmetic and no order"
        elif len(set(types)) > 1:
            if len(scalars) == len(types):
                fix = f"convert one side: {types[0]}(…) or {types[1]}(…)"
            why = "types never mix implicitly"
        listed = " and ".join(map(str, types))
        notes = tuple((a.span, f"this is {a.type}") for a in args) if len(set(types)) > 1 else ()
        verb = "between" if len(args) > 1 else "of"
        self.fail("E415", f"no `{symbol}` {verb} {listed}", span, why=why, help=fix, notes=notes)

    def _power(self, base: ir.Expr, exponent: ir.Expr, span: Span) -> ir.Expr:
        if isinstance(base.type, Array) or isinstance(exponent.type, Array):
            self.fail("E413", "`**` on an array", span, help="loop over the elements")
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
            if isinstance(left.type, Array) or isinstance(right.type, Array):
                self.fail("E413", f"`{symbol}` on arrays", span, help="compare the elements")
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
        if is_literal(then.type) and is_literal(otherwise.type) and isinstance(want, Scalar) and want.is_number:
            then, otherwise = self.settle(then, want), self.settle(otherwise, want)
        then, otherwise = self.meet(then, otherwise)
        if then.type != otherwise.type:
            notes = ((then.span, f"this is {then.type}"), (otherwise.span, f"this is {otherwise.type}"))
            self.fail("E402", "the two branches have different types", self.span(node), notes=notes)
        return ir.Choose(then.type, condition, then, otherwise, self.span(node))

    def _array(self, node: ast.List, want: Type | None) -> ir.Expr:
        span = self.span(node)
        if not node.elts:
            self.fail("E413", "an empty array", span, help="every array has at least one element")
        element = want.element if isinstance(want, Array) else None
        rows = isinstance(node.elts[0], ast.List)
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
                self.fail(
                    "E402", f"an element of type {item.type} in an array of {items[0].type}", item.span, notes=notes
                )
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


def _records_hint(scope: Scope) -> str:
    return (
        f"this function has {', '.join(scope.records)}" if scope.records else "a helper gets what it needs as arguments"
    )


def _array_hint(symbol: str) -> str:
    if symbol == "*":
        return "write `dot(a, b)`, `matvec(A, x)` or `matmul(A, B)`; `*` multiplies by a scalar"
    if symbol == "/":
        return "`/` divides an array by a scalar; write `solve(A, b)` for a system"
    return "arrays have `+`, `-`, unary `-`, and `*` and `/` by a scalar"


def _one(type_: Type) -> str:
    return "1.0" if isinstance(type_, Scalar) and type_.is_float else "1"


def _zero(type_: Type) -> str:
    return "0.0" if isinstance(type_, Scalar) and type_.is_float else "0"
