# SPDX-License-Identifier: Apache-2.0
"""Checks names, fields, members, elements and slices: everything that has storage."""

from __future__ import annotations

import ast

from . import ir, ops
from .checker import Checker, Stop
from .diagnostics import nearest
from .effects import HARDWARE
from .intervals import interval
from .literals import FLOAT_LITERAL, INT_LITERAL
from .python_habits import instead_of
from .scope import BUILTIN_CONSTANTS, Scope, StoredConstant
from .source import Span
from .types import HEALTH, HEALTH_NAMES, I64, REQUEST, Array, Scalar, Struct, Type


class PlaceChecker(Checker):
    """The part of the expression checker that knows what names mean."""

    def name(self, node: ast.Name) -> ir.Expr:
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
        if name in scope.names.sizes and name not in scope.constants:
            return ir.Const(INT_LITERAL, scope.names.sizes[name], span)
        constant = scope.constants.get(name)
        if isinstance(constant, StoredConstant):
            return ir.ModuleConst(constant.type, constant.owner, name, span)
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
        if name in {*ops.BUILTINS, *HARDWARE, *scope.functions.externs} or scope.functions.is_function(name):
            self.fail("E404", f"`{name}` is a function, not a value", span, help=f"call it: `{name}(…)`")
        if name in BUILTIN_CONSTANTS:
            return ir.Const(FLOAT_LITERAL, BUILTIN_CONSTANTS[name], span)
        known = [*scope.types, *scope.arguments, *scope.constants, *scope.records]
        fix = nearest(name, known) or "assign it first; ports are read as `u.name`, by the argument they come in"
        self.fail("E406", f"`{name}` is not defined", span, help=fix)

    def attribute(self, node: ast.Attribute) -> ir.Expr:
        scope, span = self.scope, self.span(node)
        if not isinstance(node.value, ast.Name) or self._is_variable(node.value.id):
            return self._member(node, span)
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
        if owner in scope.wrong:
            raise Stop
        record = scope.records.get(owner)
        if record is None:
            constant = name in BUILTIN_CONSTANTS or owner in ("math", "np", "numpy")
            hint = instead_of(name, self.scope.functions.names()) if constant else ""
            hint = hint or nearest(owner, [*scope.records, "TransitionRequest", "Health"]) or _records_hint(scope)
            self.fail("E406", f"`{owner}` is not a record of this function", span, help=hint)
        port = scope.ports[record].get(name)
        if port is None and name in scope.wrong:
            raise Stop
        if port is None:
            fields = [p.name for p in scope.ports[record].values() if p.type is not REQUEST]
            if not set(fields) - {"health"}:
                fix = f"declare them: `class {record.capitalize()}:` with lines such as `{name}: f64`"
                self.fail("E408", f"this file declares no {record}", span, help=fix)
            hint = nearest(name, fields) or f"declare it in its class: `{name}: f64`"
            self.fail("E408", f"{record} has no field `{name}`", span, help=hint)
        return ir.Field(port.type, record, owner, name, span)

    def _is_variable(self, name: str) -> bool:
        scope = self.scope
        return name in scope.types or name in scope.arguments or name in scope.constants or name in scope.poisoned

    def _member(self, node: ast.Attribute, span: Span) -> ir.Member:
        """`place.name`, a member of a struct."""
        base, name = self.raw(node.value), node.attr
        if not isinstance(base, ir.Place):
            fix = "assign it to a local first"
            self.fail("E411", f"`.{name}` of a value without a name", span, why="members are read by name", help=fix)
        if not isinstance(base.type, Struct):
            fix = (
                "index an element first: `x[i].…`"
                if isinstance(base.type, Array)
                else "it is a scalar: leave out the dot"
            )
            fix = instead_of(name, ()) or fix
            self.fail("E408", f"a {base.type} has no members", span, help=fix)
        member = base.type.member(name)
        if member is None and base.type.partial:
            raise Stop
        if member is None:
            members = [m.name for m in base.type.members]
            hint = nearest(name, members) or f"it has {', '.join(members)}"
            self.fail("E408", f"{base.type} has no member `{name}`", span, help=hint)
        return ir.Member(member.type, base, name, span)

    def subscript(self, node: ast.Subscript) -> ir.Element | ir.Slice:
        """`base[i, j]`, `base[i][j]`, `base[a:b, i]`; constant indices are checked here, others by the generated code unless
        proven.
        """
        span, base, indices = self.span(node), node.value, _subscripts(node)
        while isinstance(base, ast.Subscript):
            if any(isinstance(i, ast.Slice) for i in _subscripts(base)):
                fix = "write one pair of brackets: `x[1:3, 0]`"
                self.fail("E438", "a slice is not indexed again", span, help=fix)
            indices = _subscripts(base) + indices
            base = base.value
        array = self.raw(base)
        if not isinstance(array, ir.Place):
            self.fail("E411", "only a named array can be indexed", span, help="assign it to a local first")
        if not isinstance(array.type, Array):
            fix = "it has no elements; leave out the brackets"
            self.fail("E411", f"a {array.type} cannot be indexed", span, help=fix, notes=self.origin(array))
        shape = array.type.shape
        if len(indices) > len(shape):
            fix = f"it has {len(shape)}"
            self.fail("E411", f"{len(indices)} indices for a {array.type}", span, help=fix, notes=self.origin(array))
        if any(isinstance(i, ast.Slice) for i in indices):
            return self._slice(array, array.type, indices, span)
        checked = [self._index(index, extent) for index, extent in zip(indices, shape, strict=False)]
        rest = shape[len(indices) :]
        type_: Type = Array(array.type.element, rest) if rest else array.type.element
        return ir.Element(type_, array, tuple(e for e, _ in checked), tuple(c for _, c in checked), span)

    def element(self, base: ir.Place, type_: Type, position: int) -> ir.Element | ir.Slice:
        """Element or row `position` of a named array."""
        index = ir.Const(I64, position, base.span)
        if isinstance(base, ir.Slice):
            return _row(base, type_, position)
        if isinstance(base, ir.Element):
            return ir.Element(type_, base.base, (*base.indices, index), (*base.checked, False), base.span)
        return ir.Element(type_, base, (index,), (False,), base.span)

    def _slice(self, base: ir.Place, type_: Array, indices: list[ast.expr], span: Span) -> ir.Slice:
        subscripts: list[ir.Expr | ir.Window] = []
        checked: list[bool] = []
        for index, extent in zip(indices, type_.shape, strict=False):
            if isinstance(index, ast.Slice):
                subscripts.append(self._window(index, extent))
                checked.append(False)
            else:
                one, check = self._index(index, extent)
                subscripts.append(one)
                checked.append(check)
        for extent in type_.shape[len(indices) :]:
            subscripts.append(ir.Window(0, extent))
            checked.append(False)
        kept = tuple(s.count for s in subscripts if isinstance(s, ir.Window))
        return ir.Slice(Array(type_.element, kept), base, tuple(subscripts), tuple(checked), span)

    def _window(self, node: ast.Slice, extent: int) -> ir.Window:
        """`a:b` of a dimension; both ends are constants, so that the result has a shape."""
        if node.step is not None:
            fix = "copy the elements in a bounded `for` loop"
            self.fail("E438", "a slice with a step", self.span(node.step), help=fix)
        start = self._end(node.lower, 0, extent)
        stop = self._end(node.upper, extent, extent)
        if not 0 <= start < stop <= extent:
            at = self.span(node.lower or node.upper or node)
            fix = f"0 <= start < stop <= {extent} must hold; Python would cut it off in silence"
            self.fail("E438", f"the slice [{start}:{stop}] of a dimension of {extent}", at, help=fix)
        return ir.Window(start, stop - start)

    def _end(self, node: ast.expr | None, default: int, extent: int) -> int:
        if node is None:
            return default
        end = self.raw(node)
        if not (isinstance(end, ir.Const) and isinstance(end.value, int) and not isinstance(end.value, bool)):
            fix = "index the elements in a bounded `for` loop"
            why = "the shape of a value is known at compile time"
            self.fail("E438", "the ends of a slice are integer constants", self.span(node), why=why, help=fix)
        return end.value + extent if end.value < 0 else end.value

    def _index(self, node: ast.expr, extent: int) -> tuple[ir.Expr, bool]:
        index = self.check(node, I64)
        if not (isinstance(index.type, Scalar) and index.type.is_integer):
            self.fail("E411", f"an index is an integer, not {index.type}", index.span, help="convert: i64(…)")
        if isinstance(index, ir.Const):
            assert isinstance(index.value, int)
            value = index.value + extent if -extent <= index.value < 0 else index.value
            if not 0 <= value < extent:
                fix = f"the last index is {extent - 1}; -1 is the last too, as a constant"
                self.fail("E412", f"index {index.value} is outside [0, {extent})", index.span, help=fix)
            return ir.Const(index.type, value, index.span), False
        bounds = interval(index)
        if bounds and 0 <= bounds[0] and bounds[1] < extent:
            return index, False
        if bounds and (bounds[0] >= extent or bounds[1] < 0):
            message = f"the index lies in [{bounds[0]}, {bounds[1]}], outside [0, {extent})"
            self.fail("E412", message, index.span, help=f"the last index is {extent - 1}")
        self.scope.faults = True
        return index, True


def _records_hint(scope: Scope) -> str:
    return (
        f"this function has {', '.join(scope.records)}" if scope.records else "a helper gets what it needs as arguments"
    )


def _subscripts(node: ast.Subscript) -> list[ast.expr]:
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def _row(base: ir.Slice, type_: Type, position: int) -> ir.Element | ir.Slice:
    """One index of the first dimension that a slice keeps."""
    at = next(n for n, s in enumerate(base.subscripts) if isinstance(s, ir.Window))
    window = base.subscripts[at]
    assert isinstance(window, ir.Window)
    index = ir.Const(I64, window.start + position, base.span)
    subscripts = (*base.subscripts[:at], index, *base.subscripts[at + 1 :])
    if isinstance(type_, Array) and any(isinstance(s, ir.Window) for s in subscripts):
        return ir.Slice(type_, base.base, subscripts, base.checked, base.span)
    indices = tuple(s for s in subscripts if not isinstance(s, ir.Window))
    return ir.Element(type_, base.base, indices, base.checked, base.span)
