# SPDX-License-Identifier: Apache-2.0
"""Checks everything that has storage: names, fields, members, elements and slices."""

from __future__ import annotations

import ast
from typing import NoReturn

from ..base.diagnostics import misspelt, nearest
from ..base.source import Span
from ..model import ir, ops
from ..model.effects import HARDWARE
from ..model.events import EVENT
from ..model.types import BOOL, HEALTH_NAMES, I64, REQUEST, SCALARS, Array, Scalar, Struct, Type
from .algorithm_class import METHODS, AlgorithmClass
from .checker import Checker, Stop
from .intervals import interval
from .scope import BUILTIN_CONSTANTS, ScalarConstant, StoredConstant
from .unsupported_python import instead_of


class PlaceChecker(Checker):
    """The part of the expression checker that resolves names."""

    def name(self, node: ast.Name) -> ir.Expr:
        scope, name, span = self.scope, node.id, self.span(node)
        if name in scope.ranges:
            variable = scope.ranges[name]
            return self._variable(node, ir.RangeVar(I64, name, variable.low, variable.high, span))
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
            return ir.Local(type_, name, span, scope.bounds.get(name))
        if name in scope.arguments:
            return ir.Local(scope.arguments[name], name, span)
        constant = scope.constants.get(name)
        if isinstance(constant, StoredConstant):
            self._requests(constant.values, span)
            return ir.ModuleConst(constant.type, constant.owner, name, span)
        if isinstance(constant, ScalarConstant):
            self._requests((constant.value.value,) if constant.value.type is REQUEST else (), span)
            return ir.Const(constant.value.type, constant.value.value, span)
        if name in scope.wrong:
            raise Stop
        if name == "self" and scope.algorithm is not None:
            self.fail("E404", "`self` is not a value", span, help="name a field: `self.…`")
        if name in scope.dead_ranges:
            self.fail(
                "E405",
                f"`{name}` is the variable of a loop that has ended",
                span,
                why="a loop variable lives in its loop only",
                help="copy it into a local inside the loop",
            )
        if name in {EVENT, *ops.BUILTINS, *HARDWARE, *scope.functions.externs} or scope.functions.is_function(name):
            self.fail("E404", f"`{name}` is a function, not a value", span, help=f"call it: `{name}(…)`")
        if name in SCALARS:
            self.fail("E404", f"`{name}` is a type, not a value", span, help="convert with it: `f64(x)`")
        port = scope.algorithm is not None and scope.algorithm.find(name) is not None
        fix = f"a port is a field: write `self.{name}`" if port else nearest(name, self._known_names())
        fix = fix or ("assign it first; ports are fields: `self.<name>`" if scope.algorithm else "make it an argument")
        self.fail("E406", f"`{name}` is not defined", span, help=fix)

    def _variable(self, node: ast.Name, variable: ir.RangeVar) -> ir.Expr:
        """A loop variable, converted to the integer type of its group if its bounds fit that type."""
        wanted = self.inference.variable_type(node)
        if not wanted.is_integer or wanted == I64 or not wanted.low <= variable.low <= variable.high <= wanted.high:
            return variable
        op = ops.find(wanted.name, (I64,))
        assert op
        return ir.Apply(wanted, op, (variable,), False, variable.span)

    def _requests(self, values: tuple[bool | int | float | str, ...], span: Span) -> None:
        """Adds the requests that a constant contains to those of the function that uses it."""
        for value in values:
            if isinstance(value, str) and value:
                self.scope.requests.setdefault(value, span)

    def attribute(self, node: ast.Attribute) -> ir.Expr:
        span = self.span(node)
        if isinstance(node.value, ast.Name):
            owner = node.value.id
            if owner == "self" and self.scope.algorithm is not None and owner not in self.scope.types:
                return self._field(self.scope.algorithm, node.attr, span)
            if not self._is_variable(owner):
                self._no_owner(owner, node.attr, span)
        return self._member(node, span)

    def _field(self, algorithm: AlgorithmClass, name: str, span: Span) -> ir.Field:
        """Checks `self.name`."""
        scope = self.scope
        found = algorithm.find(name)
        if found is None and (algorithm.partial or name in algorithm.wrong):
            raise Stop
        if found is None:
            known = algorithm.names()
            declared = f'declare it: `outputs = {{"{name}": "f64"}}`, or in another of the four dictionaries'
            fix = nearest(name, known) or (f"it has {', '.join(known)}" if name in ("inputs", *METHODS) else declared)
            if name == "transition_request":
                fix = 'declare it in `outputs`: `"transition_request": "TransitionRequest"`'
            elif name in ir.RECORDS:
                fix = "a field is named without its dictionary: `self.<name>`"
            self.fail("E408", f"`{algorithm.name}` declares no `{name}`", span, help=fix)
        record, port = found
        if scope.method == "start" and record == "inputs":
            fix = "use parameters, or do it in the first `execute`"
            self.fail(
                "E409",
                f"`start` has no inputs, such as `{name}`",
                span,
                why="no connection has been copied yet",
                help=fix,
            )
        if scope.method == "start" and name in ("health", "transition_request"):
            why = "it belongs to one tick, and `start` does not run in a tick"
            self.fail("E433", f"`{name}` in `start`", span, why=why, help="set it in `execute`")
        return ir.Field(port.type, record, name, span)

    def _no_owner(self, owner: str, name: str, span: Span) -> NoReturn:
        """Reports `owner.name` where `owner` is not a value."""
        scope = self.scope
        if owner in scope.wrong or owner in scope.poisoned:
            raise Stop
        if owner == "self":
            why, fix = "a helper is pure: values in, one value out", "pass the field as an argument"
            self.fail("E406", "there is no `self` in a helper", span, why=why, help=fix)
        if owner in SCALARS:
            words = HEALTH_NAMES if owner == "Health" else ()
            meant = (misspelt(name, words) or name) if owner in ("Health", "TransitionRequest") else ""
            fix = f'write it as a string: `"{meant}"`' if meant else "remove the dot and the name after it"
            if words and meant not in words:
                fix = f"healths are the strings {', '.join(words)}"
            self.fail("E404", f"`{owner}` is a type, and has no `{name}`", span, help=fix)
        known = self._known_names()
        constant = name in BUILTIN_CONSTANTS or owner in ("math", "np", "numpy")
        fix = instead_of(name, scope.functions.names()) if constant else ""
        fix = fix or nearest(owner, known) or "fields are `self.<name>`; locals are assigned first"
        self.fail("E406", f"`{owner}` is not defined", span, help=fix)

    def _known_names(self) -> list[str]:
        scope = self.scope
        own = ["self"] if scope.algorithm is not None else []
        return [*own, *scope.types, *scope.arguments, *scope.constants]

    def _is_variable(self, name: str) -> bool:
        scope = self.scope
        return name in scope.types or name in scope.arguments or name in scope.constants or name in scope.ranges

    def _member(self, node: ast.Attribute, span: Span) -> ir.Expr:
        """`value.name`, a member of a struct."""
        base, name = self.raw(node.value), node.attr
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
        type_ = member.type
        return self.part_of(base, lambda place: ir.Member(type_, place, name, span), span)

    def subscript(self, node: ast.Subscript) -> ir.Expr:
        """`base[i, j]`, `base[i][j]`, `base[a:b, i]`. Constant indices are checked here. The generated code checks all
        others that are not proven in range."""
        span, base, indices = self.span(node), node.value, _subscripts(node)
        while isinstance(base, ast.Subscript):
            if any(isinstance(i, ast.Slice) for i in _subscripts(base)):
                fix = "write one pair of brackets: `x[1:3, 0]`"
                self.fail("E438", "a slice is not indexed again", span, help=fix)
            indices = _subscripts(base) + indices
            base = base.value
        array = self.raw(base)
        if not isinstance(array.type, Array):
            fix = "it has no elements; leave out the brackets"
            self.fail("E411", f"a {array.type} cannot be indexed", span, help=fix, notes=self.origin(array))
        if len(indices) > len(array.type.shape):
            fix = f"it has {len(array.type.shape)}"
            self.fail("E411", f"{len(indices)} indices for a {array.type}", span, help=fix, notes=self.origin(array))
        type_ = array.type
        return self.part_of(array, lambda place: self._indexed(place, type_, indices, span), span)

    def _indexed(self, array: ir.Place, type_: Array, indices: list[ast.expr], span: Span) -> ir.Element | ir.Slice:
        if any(isinstance(i, ast.Slice) for i in indices):
            return self._slice(array, type_, indices, span)
        checked = [self._index(index, extent) for index, extent in zip(indices, type_.shape, strict=False)]
        rest = type_.shape[len(indices) :]
        part: Type = Array(type_.element, rest) if rest else type_.element
        return ir.Element(part, array, tuple(e for e, _ in checked), tuple(c for _, c in checked), span)

    def element(self, base: ir.Place, type_: Type, position: int) -> ir.Element | ir.Slice:
        """Element or row `position` of a stored array."""
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
        """`a:b` in one dimension. Both ends must be constants, so that the shape of the result is known."""
        if node.step is not None:
            fix = "copy the elements in a bounded `for` loop"
            self.fail("E438", "a slice with a step", self.span(node.step), help=fix)
        start = self._end(node.lower, 0, extent)
        stop = self._end(node.upper, extent, extent)
        if not 0 <= start < stop <= extent:
            at = self.span(node.lower or node.upper or node)
            fix = f"0 <= start < stop <= {extent} is required; Python would silently truncate the slice"
            self.fail("E438", f"the slice [{start}:{stop}] of a dimension of {extent}", at, help=fix)
        return ir.Window(start, stop - start)

    def _end(self, node: ast.expr | None, default: int, extent: int) -> int:
        if node is None:
            return default
        end = self.folded(self.raw(node))
        if not (isinstance(end, ir.Const) and isinstance(end.value, int) and not isinstance(end.value, bool)):
            fix = "index the elements in a bounded `for` loop"
            why = "the shape of a value is known at compile time"
            self.fail("E438", "the ends of a slice are integer constants", self.span(node), why=why, help=fix)
        return end.value + extent if end.value < 0 else end.value

    def _index(self, node: ast.expr, extent: int) -> tuple[ir.Expr, bool]:
        index = self.check(node, I64)
        if not (isinstance(index.type, Scalar) and index.type.is_integer):
            fix = "convert: i64(…)" if isinstance(index.type, Scalar) and index.type.is_float else ""
            fix = "write `1 if … else 0`" if index.type is BOOL else fix
            notes = self.origin(index)
            self.fail("E411", f"an index is an integer, not {index.type}", index.span, help=fix, notes=notes)
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
            message = f"the index is in [{bounds[0]}, {bounds[1]}], outside [0, {extent})"
            self.fail("E412", message, index.span, help=f"the last index is {extent - 1}")
        self.scope.faults = True
        return index, True


def _subscripts(node: ast.Subscript) -> list[ast.expr]:
    return list(node.slice.elts) if isinstance(node.slice, ast.Tuple) else [node.slice]


def _row(base: ir.Slice, type_: Type, position: int) -> ir.Element | ir.Slice:
    """Row `position` of a slice: replaces its first window by an index."""
    at = next(n for n, s in enumerate(base.subscripts) if isinstance(s, ir.Window))
    window = base.subscripts[at]
    assert isinstance(window, ir.Window)
    index = ir.Const(I64, window.start + position, base.span)
    subscripts = (*base.subscripts[:at], index, *base.subscripts[at + 1 :])
    if isinstance(type_, Array) and any(isinstance(s, ir.Window) for s in subscripts):
        return ir.Slice(type_, base.base, subscripts, base.checked, base.span)
    indices = tuple(s for s in subscripts if not isinstance(s, ir.Window))
    return ir.Element(type_, base.base, indices, base.checked, base.span)
