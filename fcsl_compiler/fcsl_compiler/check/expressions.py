# SPDX-License-Identifier: Apache-2.0
"""Checks expressions: syntax tree to typed IR. Every implicit rule becomes explicit."""

from __future__ import annotations

import ast

from ..base.source import Span
from ..model import ir
from ..model.effects import can_fault
from ..model.literals import STRING_LITERAL, LiteralError
from ..model.types import BOOL, HEALTH, REQUEST, Array, Scalar, Struct, Type, element_of, shape_of
from .calls import CallChecker
from .checker import is_mask
from .effect_order import reaches_outside
from .places import PlaceChecker

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
_OPERATORS = frozenset(_BINARY.values())
_COMPARE = {ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "==", ast.NotEq: "!="}
#: Of arrays of bools, element by element.
_MASKS = {
    **dict.fromkeys(("and", "&"), "`where(a, b, False)`"),
    **dict.fromkeys(("or", "|"), "`where(a, True, b)`"),
    **dict.fromkeys(("not", "~"), "`where(a, False, True)`"),
    "^": "`a != b`",
}

_INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.Lambda: ("`lambda`", "write a module-level function"),
    ast.ListComp: ("a list comprehension", "fill an array in a bounded `for` loop"),
    ast.SetComp: ("a set", "use an array"),
    ast.DictComp: ("a dict", "use ports or locals"),
    ast.GeneratorExp: ("a generator", "write a bounded `for` loop"),
    ast.Dict: ("a dict", "use ports or locals"),
    ast.Set: ("a set", "use an array"),
    ast.JoinedStr: ("an f-string", "the names of requests and healths are plain strings"),
    ast.NamedExpr: ("`:=`", "assign in a separate statement"),
    ast.Await: ("`await`", "an algorithm runs to completion in its tick"),
    ast.Yield: ("`yield`", "keep what the next tick needs in `state`"),
    ast.Starred: ("`*` unpacking", "name the elements"),
    ast.Tuple: ("a tuple", "write an array `[a, b]`, or assign one name a line"),
    ast.Slice: ("a slice here", "write a slice in brackets after an array: `x[1:3]`"),
}


class ExprChecker(CallChecker, PlaceChecker):
    """The complete expression checker: operators here, calls and places in the base classes."""

    def raw(self, node: ast.expr, want: Type | None = None) -> ir.Expr:
        literal = self.inference.literal_type(node)
        if literal is not None:
            return self._literal(node, literal)
        if isinstance(node, ast.Constant):
            return self._constant(node, want)
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
            return self.call(node)
        if isinstance(node, ast.List):
            return self._array(node, want)
        what, instead = _INSTEAD.get(type(node), ("this expression", "use what docs/reference/language.md lists"))
        self.fail("E410", f"{what} is not part of the language", self.span(node), help=instead)

    def _literal(self, node: ast.expr, type_: Scalar) -> ir.Const:
        """An expression of literals only, with the type of its group (inference.py)."""
        span = self.span(node)
        try:
            return ir.Const(type_, self.inference.names.value(node, type_), span)
        except LiteralError as error:
            notes = self.because(node, span)
            self.fail("E401", str(error.args[0]), span, help=str(error.args[1]), notes=notes)

    def _constant(self, node: ast.Constant, want: Type | None) -> ir.Expr:
        span, value = self.span(node), node.value
        if isinstance(value, bool):
            return ir.Const(BOOL, value, span)
        if isinstance(value, str):
            return ir.Const(STRING_LITERAL, value, span)
        fix = "numbers, True, False and the names of requests and healths are"
        fix = 'no request is `""`' if value is None and want == REQUEST else fix
        self.fail("E410", f"`{node.value!r}` is not part of the language", span, help=fix)

    def _unary(self, node: ast.UnaryOp, want: Type | None) -> ir.Expr:
        span = self.span(node)
        if isinstance(node.op, ast.Not):
            return self.apply("not", (self._truth(node.operand, "not"),), span)
        if isinstance(node.op, ast.UAdd):
            self.fail("E410", "unary `+` is not part of the language", span, help="leave it out")
        operand = self.not_a_string(self.raw(node.operand))
        if isinstance(node.op, ast.Invert):
            if is_mask(operand.type):
                self.fail("E415", f"no `~` of {operand.type}", span, help=f"write {_MASKS['~']}")
            return self.apply("~", (operand,), span)
        return self.elementwise("neg", (operand,), "-", span)

    def _binary(self, node: ast.BinOp, want: Type | None) -> ir.Expr:
        symbol, span = _BINARY.get(type(node.op)), self.span(node)
        if symbol is None:
            fix = "write `matmul(a, b)`, `matvec(a, x)` or `dot(a, b)`"
            self.fail("E410", "`@` is not part of the language", span, help=fix)
        left, right = (self.not_a_string(self.raw(n)) for n in (node.left, node.right))
        if symbol == "**":
            return self._power(left, right, self.inference.exponent(node.right), span)
        return self.elementwise(symbol, (left, right), symbol, span)

    def elementwise(self, name: str, args: tuple[ir.Expr, ...], symbol: str, span: Span) -> ir.Expr:
        """A scalar operation, applied element by element if an operand is an array."""
        arrays = [a for a in args if isinstance(a.type, Array)]
        if not arrays:
            return self.apply(name, args, span, symbol)
        shapes = {shape_of(a.type) for a in arrays}
        if symbol in _OPERATORS and not _is_elementwise(symbol, args, max(map(len, shapes))):
            self.fail(
                "E413", f"`{symbol}` between {args[0].type} and {args[-1].type}", span, help=_array_hint(symbol, args)
            )
        if len(shapes) > 1:
            both = f"{arrays[0].type} and {next(a.type for a in arrays if a.type != arrays[0].type)}"
            self.fail("E413", f"`{symbol}` between {both}", span, why="the shapes differ")
        scalars = tuple(a.type.element if isinstance(a.type, Array) else a.type for a in args)
        op = self.find(name, scalars, args, symbol, span)
        if op.faults:
            self.scope.faults = True
        return ir.Elementwise(Array(op.result, shapes.pop()), op, args, span)

    def _power(self, base: ir.Expr, exponent: ir.Expr, small: int | None, span: Span) -> ir.Expr:
        """`small`: the value of an exponent for which the power becomes repeated multiplication, else None."""
        if isinstance(base.type, Array) or isinstance(exponent.type, Array):
            self.fail("E413", "`**` on an array", span, help="loop over the elements")
        if small is not None:
            assert isinstance(base.type, Scalar)
            if not base.type.is_number:
                self._no_such_operation("**", (base,), span)
            return base if small == 1 else self.apply(f"**{small}", (base,), span, "**")
        if isinstance(base.type, Scalar) and base.type.is_integer:
            fix = "an integer's exponent is a literal from 0 to 4; convert to f64 for others"
            self.fail("E415", "`**` with this exponent", span, help=fix)
        return self.apply("pow", (base, exponent), span, "**")

    def _boolean(self, node: ast.BoolOp) -> ir.Expr:
        word = "and" if isinstance(node.op, ast.And) else "or"
        operands = [self._truth(node.values[0], word)]
        with self.conditional():
            operands += [self._truth(v, word) for v in node.values[1:]]
        result = operands[-1]
        for left in reversed(operands[:-1]):
            span = self.span(node)
            if word == "and":
                result = ir.Choose(BOOL, left, result, ir.Const(BOOL, False, span), span)
            else:
                result = ir.Choose(BOOL, left, ir.Const(BOOL, True, span), result, span)
        return result

    def _truth(self, node: ast.expr, word: str) -> ir.Expr:
        """An operand of `and`, `or` or `not`."""
        operand, what = self.check(node, BOOL), f"the operand of `{word}`"
        if is_mask(operand.type):
            fix = f"element by element, write {_MASKS[word]}; of all elements, `all(…)` or `any(…)`"
            self.fail("E402", f"{what} is bool, not {operand.type}", operand.span, help=fix, notes=self.origin(operand))
        if operand.type != BOOL:
            self.mismatch(operand, BOOL, what)
        return operand

    def _compare(self, node: ast.Compare) -> ir.Expr:
        span = self.span(node)
        for operator, comparator in zip(node.ops, node.comparators, strict=True):
            if type(operator) not in _COMPARE:
                fix = "`==` compares values" if isinstance(operator, ast.Is | ast.IsNot) else "loop over the elements"
                if isinstance(operator, ast.In | ast.NotIn) and isinstance(comparator, ast.List | ast.Tuple | ast.Set):
                    fix = "write `x == a or x == b`"
                self.fail("E410", "this comparison is not part of the language", span, help=fix)
        operands = [self.raw(n) for n in (node.left, node.comparators[0])]
        with self.conditional():
            operands += [self.raw(n) for n in node.comparators[1:]]
        tests: list[ir.Expr] = []
        names: dict[int, ir.Expr] = {}  # operands of two comparisons, evaluated once
        # A shared operand is evaluated first. If one of the first two operands reaches outside, or both can fault, the
        # first operand must keep its place before the second.
        ordered = any(map(reaches_outside, operands[:2])) or all(map(can_fault, operands[:2]))
        first = 0 if len(operands) > 2 and ordered else 1
        if first == 0:
            operands[:2] = self.meet(*operands[:2])
        for position in range(first, len(operands) - 1):
            shared = operands[position]
            if not isinstance(shared, ir.Const | ir.Local | ir.RangeVar | ir.Field):
                names[position] = shared
                operands[position] = self.shared(shared)
        for position, operator in enumerate(node.ops):
            symbol = _COMPARE[type(operator)]
            left, right = self.meet(operands[position], operands[position + 1])
            parts = [element_of(t) for t in (left.type, right.type)]
            if any(isinstance(part, Struct) for part in parts):
                self.fail("E413", f"`{symbol}` on structs", span, help="compare their numbers")
            if len(node.ops) > 1 and any(isinstance(t, Array) for t in (left.type, right.type)):
                fix = "write two comparisons, and `where(first, second, False)`"
                self.fail("E413", "a chain of comparisons on arrays", span, help=fix)
            # A chain a < b < c shares b: the type that b gets from a must also be its type for c.
            operands[position], operands[position + 1] = left, right
            tests.append(self.elementwise(symbol, (left, right), symbol, span))
        result = tests[-1]
        for position in reversed(range(len(tests) - 1)):
            result = ir.Choose(BOOL, tests[position], result, ir.Const(BOOL, False, span), span)
            if position + 1 in names:
                local = operands[position + 1]
                assert isinstance(local, ir.Local)
                result = ir.Let(BOOL, local.name, names[position + 1], result, span)
        if 0 in names:
            local = operands[0]
            assert isinstance(local, ir.Local)
            result = ir.Let(BOOL, local.name, names[0], result, span)
        return result

    def _choose(self, node: ast.IfExp, want: Type | None) -> ir.Expr:
        condition = self.expect(node.test, BOOL, "the condition")
        with self.conditional():
            then, otherwise = self.raw(node.body, want), self.raw(node.orelse, want)
        if then.type is STRING_LITERAL and otherwise.type is STRING_LITERAL:
            return ir.Choose(STRING_LITERAL, condition, then, otherwise, self.span(node))
        for one, other in ((then, otherwise), (otherwise, then)):
            if one.type is STRING_LITERAL and other.type not in (REQUEST, HEALTH):
                why = "a value has one type, whichever branch is taken"
                self.fail("E402", f"a string beside {other.type}", one.span, why=why)
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
        words = want.element if isinstance(want, Array) and isinstance(want.element, Scalar) else None
        items = [self.raw(e, want) for e in node.elts]
        words = next((i.type for i in items if i.type in (REQUEST, HEALTH)), words)
        items = [self.settle(i, words) for i in items]
        for item in items[1:]:
            if item.type != items[0].type:
                notes = ((items[0].span, f"this is {items[0].type}"),)
                message = f"an element of type {item.type} in an array of {items[0].type}"
                self.fail("E402", message, item.span, help="the elements of an array have one type", notes=notes)
        first = items[0].type
        if isinstance(first, Array):
            return self._matrix(items, first, span)
        return ir.ArrayValue(Array(first, (len(items),)), tuple(items), span)

    def _matrix(self, rows: list[ir.Expr], type_: Array, span: Span) -> ir.Expr:
        """`[r0, r1]` from rows. Computed rows are evaluated first, left to right, each once."""
        written = all(isinstance(row, ir.ArrayValue) for row in rows)
        held: list[tuple[ir.Local, ir.Expr]] = []
        items: list[ir.Expr] = []
        for row in rows:
            lies = isinstance(row, ir.ArrayValue | ir.Place) and not can_fault(row) and not reaches_outside(row)
            if not (written or lies):
                held.append((self.shared(row), row))
                row = held[-1][0]
            items += row.items if isinstance(row, ir.ArrayValue) else self._scalars(row)
        result: ir.Expr = ir.ArrayValue(Array(type_.element, (len(rows), *type_.shape)), tuple(items), span)
        for local, value in reversed(held):
            result = ir.Let(result.type, local.name, value, result, span)
        return result

    def _scalars(self, place: ir.Expr) -> list[ir.Expr]:
        """All elements of a stored array, row-major."""
        assert isinstance(place, ir.Place) and isinstance(place.type, Array)
        rest = place.type.shape[1:]
        type_: Type = Array(place.type.element, rest) if rest else place.type.element
        rows = [self.element(place, type_, n) for n in range(place.type.shape[0])]
        return [s for row in rows for s in self._scalars(row)] if rest else list(rows)


def _is_elementwise(symbol: str, args: tuple[ir.Expr, ...], rank: int) -> bool:
    """Whether an operator of these operands is that of their elements. Of two matrices, `*` and `/` could mean their
    product or quotient as well."""
    arrays = sum(isinstance(a.type, Array) for a in args)
    if len(args) == 1 or symbol in "+-":
        return arrays == len(args) and symbol in "+-"
    return symbol in "*/" and (rank == 1 or (arrays == 1 and (symbol == "*" or isinstance(args[0].type, Array))))


def _array_hint(symbol: str, args: tuple[ir.Expr, ...]) -> str:
    if symbol in _MASKS and any(is_mask(a.type) for a in args):
        return f"write {_MASKS[symbol]}"
    if symbol == "*":
        return "write `matmul(A, B)`, `matvec(A, x)` or `dot(a, b)`; `*` is elementwise for vectors only"
    if symbol == "/":
        return "write `solve(A, b)` for a system; `/` is elementwise for vectors only"
    return "arrays have `+`, `-`, unary `-`, `*` and `/`; loop over the elements"
