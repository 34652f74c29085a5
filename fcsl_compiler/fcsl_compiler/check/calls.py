# SPDX-License-Identifier: Apache-2.0
"""Checks calls: builtins of the op table, array constructors, helpers and library functions."""

from __future__ import annotations

import ast
from dataclasses import replace
from typing import NoReturn

from ..base.diagnostics import nearest
from ..base.source import Span
from ..model import ir, ops
from ..model.effects import HARDWARE, can_fault
from ..model.events import EVENT, EVENT_DOC, MOST_TEXT, MOST_VALUES, SEVERITIES, is_event_value, is_text
from ..model.literals import fit
from ..model.types import MAX_ELEMENTS, Array, Scalar, Struct
from .algorithm_class import METHODS
from .checker import Checker, Stop
from .scope import CONSTRUCTORS
from .unsupported_python import MODULES, instead_of, instead_of_function


class CallChecker(Checker):
    """The part of the expression checker that checks calls."""

    def call(self, node: ast.Call) -> ir.Expr:
        """Checks a call of any kind."""
        span = self.span(node)
        if not isinstance(node.func, ast.Name):
            self._dotted(node.func, span)
        name = node.func.id
        if name in self.scope.wrong or name in self.scope.poisoned:
            raise Stop
        if self.is_event(node):
            self.fail("E421", "`event` returns nothing", span, help="call it in a separate statement: `event(…)`")
        outside = HARDWARE.get(name) or self.scope.functions.externs.get(name)
        if outside is not None:
            return self._outside(name, outside, node, span)
        if name in self.scope.names.structs:
            return self._struct(self.scope.names.structs[name], node, span)
        is_function = self.scope.functions.is_function(name)
        if node.keywords and not (is_function and self.scope.functions.arguments(name)):
            fix = "write the values in their order, all of them"
            self.fail("E410", "arguments are given by position", self.span(node.keywords[0]), help=fix)
        if name in self.scope.types or name in self.scope.arguments or name == "self":
            self.fail("E404", f"`{name}` is a value, not a function", span)
        if is_function:
            return self._function(name, node, span)
        if name in CONSTRUCTORS:
            return self._constructor(name, node, span)
        if name == "len":
            return self._length(node, span)
        if name in ops.BUILTINS:
            return self._builtin(name, node, span)
        known = self._functions()
        fix = instead_of_function(name, known)
        self.fail("E406", f"`{name}` is not a function of the language", self.span(node.func), help=fix)

    def is_event(self, node: ast.Call) -> bool:
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        return name == EVENT and name not in self.scope.types and name not in self.scope.arguments

    def event(self, node: ast.Call) -> ir.Event:
        """Checks a statement `event(text, *values, severity="info")`."""
        span = self.span(node)
        self._in_execute(EVENT, span)
        literal = node.args[0].value if node.args and isinstance(node.args[0], ast.Constant) else None
        if not isinstance(literal, str) or not is_text(literal):
            fix = f'write it as `event("gate passed", self.index)`, of 1 to {MOST_TEXT} printable characters of ASCII'
            at = self.span(node.args[0]) if node.args else span
            self.fail("E410", "the text of this event", at, why="it is compiled; values follow it", help=fix)
        if len(node.args) > 1 + MOST_VALUES:
            at = self.span(node.args[1 + MOST_VALUES])
            self.fail("E416", f"an event has at most {MOST_VALUES} values", at, help=EVENT_DOC)
        values = tuple(self._event_value(arg) for arg in node.args[1:])
        return ir.Event(literal, self._severity(node), values, span)

    def _event_value(self, node: ast.expr) -> ir.Expr:
        value = self.not_a_string(self.raw(node))
        if not is_event_value(value.type):
            fix = "write its elements or members, such as `x[0]`" if not isinstance(value.type, Scalar) else ""
            why = "an event has bools, numbers and healths"
            self.fail("E402", f"a value of an event is {value.type}", value.span, why=why, help=fix)
        return value

    def _severity(self, node: ast.Call) -> int:
        for keyword in node.keywords:
            given = keyword.value.value if isinstance(keyword.value, ast.Constant) else None
            if keyword.arg != "severity" or len(node.keywords) > 1:
                self.fail("E416", f"`{EVENT}` has no such argument", self.span(keyword), help=EVENT_DOC)
            if given not in SEVERITIES:
                fix = (
                    nearest(given, SEVERITIES) if isinstance(given, str) else ""
                ) or f"one of {', '.join(SEVERITIES)}"
                self.fail(
                    "E410", "the severity of this event", self.span(keyword.value), why="it is compiled", help=fix
                )
            return SEVERITIES.index(str(given))
        return SEVERITIES.index("info")

    def is_outside(self, node: ast.Call) -> bool:
        """Whether a call is one of an extern or a hardware builtin."""
        name = node.func.id if isinstance(node.func, ast.Name) else ""
        return name in HARDWARE or name in self.scope.functions.externs

    def statement(self, node: ast.Call) -> ir.Effect:
        """Checks a call of an extern or a hardware builtin that is a statement."""
        assert isinstance(node.func, ast.Name)
        name, span = node.func.id, self.span(node)
        function = HARDWARE.get(name) or self.scope.functions.externs[name]
        args = self._outside_arguments(name, function, node, span)
        if function.result is not None:
            fix = f"write `value = {name}(…)`"
            self.fail("E421", f"`{name}` has a result that is not used", span, help=fix)
        return ir.Effect(function, args, None, span)

    def _outside(self, name: str, function: ir.Extern, node: ast.Call, span: Span) -> ir.EffectCall:
        """Checks a call of an extern or a hardware builtin whose result is used."""
        args = self._outside_arguments(name, function, node, span)
        if function.result is None:
            self.fail("E421", f"`{name}` returns nothing", span, help=f"call it in a separate statement: `{name}(…)`")
        return ir.EffectCall(function.result, function, args, span)

    def _in_execute(self, name: str, span: Span) -> None:
        if self.scope.method != "execute":
            why = "`start` has no host yet" if self.scope.method else "helpers are pure"
            why = why if self.scope.method or self.scope.result else "constants are folded at compile time"
            self.fail("E434", f"`{name}` is called in `execute` only", span, why=why, help="call it there")

    def _outside_arguments(self, name: str, function: ir.Extern, node: ast.Call, span: Span) -> tuple[ir.Expr, ...]:
        self._in_execute(name, span)
        if self._conditions:
            why = "the line must show whether the call is made"
            fix = f"write `value = {name}(…)` before, or an `if` around"
            self.fail("E434", f"`{name}` where it may not be evaluated", span, why=why, help=fix)
        shown = f"{name}({', '.join(f'{n}: {t}' for n, t in function.arguments)})"
        if node.keywords or len(node.args) != len(function.arguments):
            message = f"`{name}` takes {len(function.arguments)} argument(s) by position"
            self.fail("E416", message, span, help=shown)
        return tuple(
            self.expect(a, t, f"`{n}` of `{name}`") for a, (n, t) in zip(node.args, function.arguments, strict=True)
        )

    def _functions(self) -> list[str]:
        own = (*self.scope.names.structs, *self.scope.functions.names())
        return [*ops.BUILTINS, *CONSTRUCTORS, *HARDWARE, EVENT, *own]

    def _dotted(self, function: ast.expr, span: Span) -> NoReturn:
        """Reports a call whose function is not a plain name, such as `math.sin(x)` or `x.copy()`."""
        owner, name = function, ""
        while isinstance(owner, ast.Attribute):
            name = name or owner.attr
            owner = owner.value
        root = owner.id if isinstance(owner, ast.Name) else ""
        fix = instead_of(name, self._functions()) or MODULES.get(root) or "write `name(…)`, without a dot"
        if root in self.scope.wrong or root in self.scope.poisoned:
            raise Stop
        if name and isinstance(owner, ast.Name) and not self.is_known(owner.id):
            message = f"`{ast.unparse(function)}` is not a function of the language"
            self.fail("E406", message, self.span(function), help=fix)
        why = "values have no methods" if name else ""
        if root == "self" and self.scope.algorithm is not None and owner is getattr(function, "value", None):
            why, fix = "an algorithm has no methods to call", f"make it a module-level function: `{name}(…)`"
            if name in METHODS:
                why, fix = (
                    "the machine calls it, once in each tick" if name == "execute" else "the machine calls it, once",
                    "",
                )
        self.fail("E410", "only plain functions can be called", span, why=why, help=fix)

    def _builtin(self, name: str, node: ast.Call, span: Span) -> ir.Expr:
        arity = ops.arity_of(name)
        variadic = name in ("min", "max")
        if variadic and len(node.args) == 1:
            return self._function(name, node, span)  # the least or greatest element of an array
        if len(node.args) != arity and not (variadic and len(node.args) > arity):
            wanted = f"at least {arity}" if variadic else str(arity)
            self.fail(
                "E416", f"`{name}` takes {wanted} argument(s), not {len(node.args)}", span, help=ops.BUILTINS[name]
            )
        args = [self.not_a_string(self.raw(a)) for a in node.args]
        result = self.elementwise(name, tuple(args[:arity]), name, span)
        for extra in args[arity:]:
            result = self.elementwise(name, (result, extra), name, span)
        return result

    def _constructor(self, name: str, node: ast.Call, span: Span) -> ir.Expr:
        sizes: list[int] = []
        for arg in node.args:
            size = self.folded(self.raw(arg))
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
        type_ = self.inference.variable_type(node)
        one, zero = ir.Const(type_, fit(1, type_), span), ir.Const(type_, fit(0, type_), span)
        items = tuple(one if name == "eye" and i % (sizes[0] + 1) == 0 else zero for i in range(count))
        return ir.ArrayValue(Array(type_, tuple(sizes)), items, span)

    def _length(self, node: ast.Call, span: Span) -> ir.Expr:
        """`len(x)`: the size of the first dimension, an integer literal."""
        if len(node.args) != 1:
            self.fail("E416", f"`len` takes 1 argument, not {len(node.args)}", span, help="len(x): rows of an array")
        array = self.raw(node.args[0])
        if not isinstance(array.type, Array):
            fix = "it has no elements"
            self.fail("E413", f"`len` of a {array.type}", array.span, help=fix, notes=self.origin(array))
        if not isinstance(array, ir.Place) or can_fault(array):
            why = "its size is known without computing it"
            self.fail("E413", "`len` of a value without a name", array.span, why=why, help="name an array")
        wanted = self.inference.variable_type(node)
        return ir.Const(wanted, fit(array.type.shape[0], wanted), span)

    def _struct(self, struct: Struct, node: ast.Call, span: Span) -> ir.Expr:
        """`Pose(position, attitude=q)`: each member exactly once, by position or by name, evaluated in the order
        written."""
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

    def _given(self, name: str, node: ast.Call, span: Span) -> list[ast.expr | None]:
        """The arguments of a call by position, None for one that has its default."""
        arguments = self.scope.functions.arguments(name)
        if arguments is None:
            return list(node.args)
        notes, names = ((arguments.at, "defined here"),), arguments.names
        given: list[ast.expr | None] = list(node.args)
        for keyword in node.keywords:
            word, at = keyword.arg or "**", self.span(keyword)
            if word not in names:
                fix = nearest(word, names) or arguments.shown
                self.fail("E416", f"`{name}` has no argument `{word}`", at, help=fix, notes=notes)
            position = names.index(word)
            if position < len(given):
                why = "arguments are given once, in the order of the definition"
                self.fail("E416", f"`{word}` comes too late", at, why=why, help=arguments.shown, notes=notes)
            given += [None] * (position - len(given)) + [keyword.value]
        missing = [a for a, value in zip(names, given, strict=False) if value is None] + list(names[len(given) :])
        missing = [a for a in missing if a not in arguments.defaults]
        if missing or len(given) > len(names):
            least = len(names) - len(arguments.defaults)
            count = f"{least} to {len(names)}" if least < len(names) else str(least)
            what = (
                f"not {len(given)}" if len(given) > len(names) or not node.keywords else f"without {', '.join(missing)}"
            )
            message = f"`{name}` takes {count} argument(s), {what}"
            self.fail("E416", message, span, help=arguments.shown, notes=notes)
        return given + [None] * (len(names) - len(given))

    def _function(self, name: str, node: ast.Call, span: Span) -> ir.Expr:
        given = self._given(name, node, span)
        declared, _ = self.scope.functions.declared(name, len(given))
        wanted = [None if isinstance(type_, str) else type_ for type_ in declared]
        args = [self.raw(a, type_) for a, type_ in zip(given, wanted, strict=True) if a is not None]
        defaults = self.scope.functions.arguments(name)
        if defaults is not None:
            for position, (argument, a) in enumerate(zip(defaults.names, given, strict=True)):
                if a is None:
                    args.insert(position, replace(defaults.defaults[argument], span=span))
        signature = self.scope.functions.resolve(name, args, span)
        if signature is None:
            raise Stop
        settled = tuple(self.settle(a, t) for a, t in zip(args, signature.arguments, strict=True))
        for position, (arg, type_) in enumerate(zip(settled, signature.arguments, strict=True)):
            if arg.type != type_:
                both = [t for t in (arg.type, type_) if isinstance(t, Scalar) and t.is_number]
                fix = f"convert: {type_}(…)" if len(both) == 2 else ""
                self.fail(
                    "E402",
                    f"argument {position + 1} of `{name}` is {type_}, not {arg.type}",
                    arg.span,
                    why="types never mix implicitly" if isinstance(arg.type, Scalar) else "",
                    help=fix,
                )
        if signature.name not in self.scope.calls:
            self.scope.calls.append(signature.name)
        self.scope.faults = self.scope.faults or signature.faults
        return ir.Call(signature.result, signature.name, settled, signature.faults, span)
