# SPDX-License-Identifier: Apache-2.0
"""Checks calls: builtins of the op table, array constructors, helpers and library functions."""

from __future__ import annotations

import ast
from typing import NoReturn

from . import ir, ops
from .checker import Checker, Stop
from .diagnostics import nearest
from .effects import HARDWARE
from .literals import is_literal
from .python_habits import MODULES, instead_of, instead_of_function
from .scope import CONSTRUCTORS
from .source import Span
from .types import F64, I64, MAX_ELEMENTS, Array, Scalar, Struct, Type


class CallChecker(Checker):
    """The part of the expression checker that knows functions."""

    def call(self, node: ast.Call, want: Type | None) -> ir.Expr:
        """A call of any kind; a literal argument adopts the type of the others, or the wanted one."""
        span = self.span(node)
        if not isinstance(node.func, ast.Name):
            self._dotted(node.func, span)
        name = node.func.id
        if name in self.scope.wrong or name in self.scope.poisoned:
            raise Stop
        if name in HARDWARE or name in self.scope.functions.externs:
            self.fail(
                "E434",
                f"`{name}` inside an expression",
                span,
                why="it reaches outside the machine: a line of its own makes its order, and what follows a fault, plain",
                help=f"write `value = {name}(…)` first, and use the local",
            )
        if name in self.scope.names.structs:
            return self._struct(self.scope.names.structs[name], node, span)
        if node.keywords:
            fix = "write the values in their order, all of them"
            self.fail("E410", "arguments are given by position", self.span(node.keywords[0]), help=fix)
        if name in self.scope.types or name in self.scope.arguments or name in self.scope.records:
            self.fail("E404", f"`{name}` is a value, not a function", span)
        if self.scope.functions.is_function(name):
            return self._function(name, node, span)
        if name in CONSTRUCTORS:
            return self._constructor(name, node, span)
        if name in ops.BUILTINS:
            return self._builtin(name, node, want, span)
        known = self._functions()
        fix = instead_of_function(name, known)
        self.fail("E406", f"`{name}` is not a function of the language", self.span(node.func), help=fix)

    def _functions(self) -> list[str]:
        return [*ops.BUILTINS, *CONSTRUCTORS, *HARDWARE, *self.scope.names.structs, *self.scope.functions.names()]

    def _dotted(self, function: ast.expr, span: Span) -> NoReturn:
        """`math.sin(x)`, `x.copy()` and whatever else is called by no plain name."""
        owner, name = function, ""
        while isinstance(owner, ast.Attribute):
            name = name or owner.attr
            owner = owner.value
        root = owner.id if isinstance(owner, ast.Name) else ""
        fix = instead_of(name, self._functions()) or MODULES.get(root) or "write `name(…)`, without a dot"
        if name and isinstance(owner, ast.Name) and not self.is_known(owner.id):
            message = f"`{ast.unparse(function)}` is not a function of the language"
            self.fail("E406", message, self.span(function), help=fix)
        why = "values and records have no methods" if name else ""
        self.fail("E410", "only plain functions can be called", span, why=why, help=fix)

    def _builtin(self, name: str, node: ast.Call, want: Type | None, span: Span) -> ir.Expr:
        arity = ops.arity_of(name)
        variadic = name in ("min", "max")
        if len(node.args) != arity and not (variadic and len(node.args) > arity):
            wanted = f"at least {arity}" if variadic else str(arity)
            self.fail(
                "E416", f"`{name}` takes {wanted} argument(s), not {len(node.args)}", span, help=ops.BUILTINS[name]
            )
        conversion = name in ops.CONVERSIONS
        args = [self.raw(a, None if conversion else want) for a in node.args]
        if conversion:
            literal = args[0]
            # i32(3) and f32(0.1) are typed literals; i32(3.7) truncates like any other f64.
            target = next(op.result for op in ops.all_ops() if op.name == name)
            exact = target.is_float or isinstance(getattr(literal, "value", None), int)
            adopt = name == target.name and is_literal(literal.type) and exact
            return self.apply(name, (self.settle(literal, target if adopt else None),), span)
        for arg in args:
            if isinstance(arg.type, Array):
                fix = f"`{name}` works on scalars; loop over the elements"
                self.fail("E413", f"`{name}` of a {arg.type}", arg.span, help=fix)
        settled_type = self._operand_type(name, arity, args, want)
        settled = [self.settle(a, settled_type) for a in args]
        result = self.apply(name, tuple(settled[:arity]), span)
        for extra in settled[arity:]:
            result = self.apply(name, (result, extra), span)
        return result

    def _operand_type(self, name: str, arity: int, args: list[ir.Expr], want: Type | None) -> Type | None:
        """What literals among the arguments become: the type of the others, else the wanted one, else a bare literal's."""
        typed = [a for a in args if not is_literal(a.type)]
        for arg in sorted(typed, key=lambda a: isinstance(a, ir.RangeVar)):
            return arg.type
        bare = I64 if all(isinstance(a, ir.Const) and isinstance(a.value, int) for a in args) else F64
        for candidate in (want, bare, F64):
            if isinstance(candidate, Scalar) and ops.find(name, (candidate,) * arity):
                return candidate
        return None

    def _constructor(self, name: str, node: ast.Call, span: Span) -> ir.Expr:
        sizes: list[int] = []
        for arg in node.args:
            size = self.raw(arg)
            if not (isinstance(size, ir.Const) and isinstance(size.value, int) and not isinstance(size.value, bool)):
                self.fail("E417", f"a size of `{name}` is not a constant", self.span(arg), help=CONSTRUCTORS[name])
            sizes.append(size.value)
        count = 1
        for size_value in sizes:
            if size_value < 1:
                self.fail("E417", "an array without elements", span)
            count *= size_value
        if name == "eye" and len(sizes) == 1:
            sizes, count = [sizes[0], sizes[0]], sizes[0] * sizes[0]
        elif name == "eye" or not sizes:
            self.fail("E416", f"`{name}` with {len(node.args)} argument(s)", span, help=CONSTRUCTORS[name])
        if count > MAX_ELEMENTS:
            self.fail("E417", f"an array of {count} elements", span, help=f"at most {MAX_ELEMENTS} fit")
        one, zero = ir.Const(F64, 1.0, span), ir.Const(F64, 0.0, span)
        items = tuple(one if name == "eye" and i % (sizes[0] + 1) == 0 else zero for i in range(count))
        return ir.ArrayValue(Array(F64, tuple(sizes)), items, span)

    def _struct(self, struct: Struct, node: ast.Call, span: Span) -> ir.Expr:
        """`Pose(position, attitude=q)`: every member once, by position or by name, evaluated as written."""
        if struct.partial:
            raise Stop
        shown = f"{struct}({', '.join(f'{m.name}: {m.type}' for m in struct.members)})"
        given: dict[str, ast.expr] = {}
        if len(node.args) > len(struct.members):
            self.fail("E436", f"`{struct}` has {len(struct.members)} members, not {len(node.args)}", span, help=shown)
        for member, arg in zip(struct.members, node.args, strict=False):
            given[member.name] = arg
        for keyword in node.keywords:
            name, at = keyword.arg or "**", self.span(keyword)
            if struct.member(name) is None:
                hint = nearest(name, [m.name for m in struct.members]) or shown
                self.fail("E436", f"`{struct}` has no member `{name}`", at, help=hint)
            if name in given:
                notes = ((self.span(given[name]), "first here"),)
                self.fail("E436", f"`{name}` is given twice", at, help="remove one of the two", notes=notes)
            given[name] = keyword.value
        missing = [m.name for m in struct.members if m.name not in given]
        if missing:
            self.fail(
                "E436", f"`{struct}` without {', '.join(missing)}", span, why="every member has a value", help=shown
            )
        items = tuple(self.expect(given[m.name], m.type, f"`{m.name}` of `{struct}`") for m in struct.members)
        return ir.StructValue(struct, items, span)

    def _function(self, name: str, node: ast.Call, span: Span) -> ir.Expr:
        guides = self.scope.functions.guides(name, len(node.args))
        args = [self.raw(a, guide) for a, guide in zip(node.args, guides, strict=True)]
        signature = self.scope.functions.resolve(name, args, span)
        if signature is None:
            raise Stop
        settled = tuple(self.settle(a, t) for a, t in zip(args, signature.arguments, strict=True))
        for position, (arg, wanted) in enumerate(zip(settled, signature.arguments, strict=True)):
            if arg.type != wanted:
                fix = f"convert: {wanted}(…)" if isinstance(arg.type, Scalar) and isinstance(wanted, Scalar) else ""
                self.fail(
                    "E402", f"argument {position + 1} of `{name}` is {wanted}, not {arg.type}", arg.span, help=fix
                )
        if signature.name not in self.scope.calls:
            self.scope.calls.append(signature.name)
        self.scope.faults = self.scope.faults or signature.faults
        return ir.Call(signature.result, signature.name, settled, signature.faults, span)
