# SPDX-License-Identifier: Apache-2.0
"""Checks the statements of one function body: types of locals, definite assignment, bounded loops."""

from __future__ import annotations

import ast
from typing import NoReturn

from . import ir
from .check_expr import ExprChecker
from .checker import Stop
from .diagnostics import DiagnosticSink
from .effects import HARDWARE
from .intervals import interval, is_static
from .literals import is_literal
from .scope import LANGUAGE_NAMES, Scope
from .source import Span
from .types import BOOL, HEALTH, HEALTH_NAMES, I64, Array, Scalar, Type

#: Loops inside one another that run more often than this together do not belong in a tick.
MAX_ITERATIONS = 10_000_000

STALE = HEALTH_NAMES.index("stale")

_INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("`while`", "write a bounded loop: `for i in range(100):` with `if done: break`"),
    ast.Try: ("`try`", "faults are contained by the machine: health becomes failed, outputs stay as they were"),
    ast.Raise: ("`raise`", "report with `y.health = Health.failed`"),
    ast.Assert: ("`assert`", "report with `y.health = Health.failed`"),
    ast.With: ("`with`", "an algorithm has no resources to hold"),
    ast.FunctionDef: ("a nested function", "write it at module level"),
    ast.ClassDef: ("a class here", "ports are declared at module level"),
    ast.Import: ("an import here", "imports stand at the top of the file"),
    ast.ImportFrom: ("an import here", "imports stand at the top of the file"),
    ast.Global: ("`global`", "keep what the next tick needs in `State`"),
    ast.Nonlocal: ("`nonlocal`", "keep what the next tick needs in `State`"),
    ast.Delete: ("`del`", "leave the value unused"),
    ast.Match: ("`match`", "write `if` … `elif` …"),
}

_NOT_AUGMENTED = (ast.MatMult, ast.Pow)


class BodyChecker:
    """Checks one body; every statement is checked even when an earlier one failed."""

    def __init__(self, scope: Scope, sink: DiagnosticSink):
        self.scope = scope
        self.expr = ExprChecker(scope, sink)
        self.sink = sink
        self._jumped = False
        self._unpacked = 0
        self._iterations = 1  # of the loops around the statement being checked, together

    def body(self, statements: list[ast.stmt], docstring: bool = False) -> tuple[ir.Stmt, ...]:
        out: list[ir.Stmt] = []
        for position, node in enumerate(statements):
            if docstring and position == 0 and _is_docstring(node):
                continue
            if self.scope.unreachable:
                self.sink.error("E420", "this line is never reached", self.expr.span(node), help="remove it")
                break
            try:
                self._statement(node, out)
            except Stop:
                self._poison(node)
        return tuple(out)

    def _poison(self, node: ast.stmt) -> None:
        """Names a failed statement would have assigned stay silent, so that one mistake gives one message."""
        for n in ast.walk(node):
            name = n.id if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) else getattr(n, "name", None)
            if isinstance(name, str) and (name not in self.scope.types or name in self.scope.bare):
                self.scope.poisoned.add(name)
            elif isinstance(name, str):
                self.scope.assigned.add(name)

    def _fail(self, code: str, message: str, span: Span, *, why: str = "", help: str = "") -> NoReturn:
        self.expr.fail(code, message, span, why=why, help=help)

    def _statement(self, node: ast.stmt, out: list[ir.Stmt]) -> None:
        span = self.expr.span(node)
        if isinstance(node, ast.Pass):
            return
        if isinstance(node, ast.Expr) and self._effect_of(node.value) is not None:
            out.append(self._effect(node.value, None, span))
        elif isinstance(node, ast.Assign):
            self._assign(node, span, out)
        elif isinstance(node, ast.AnnAssign):
            out.append(self._annotated(node, span))
        elif isinstance(node, ast.AugAssign):
            out.append(self._augmented(node, span))
        elif isinstance(node, ast.If):
            out.append(self._if(node, span))
        elif isinstance(node, ast.For):
            out.append(self._for(node, span))
        elif isinstance(node, ast.Break | ast.Continue):
            if not self.scope.ranges:
                word = "break" if isinstance(node, ast.Break) else "continue"
                self._fail("E410", f"`{word}` outside a loop", span, help="`return` ends the function")
            self.scope.unreachable = self._jumped = True
            out.append(ir.Break(span) if isinstance(node, ast.Break) else ir.Continue(span))
        elif isinstance(node, ast.Return):
            try:
                out.append(self._return(node, span))
            finally:
                self.scope.unreachable = self._jumped = True
        elif isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Call):
                self.expr.raw(node.value)  # what is wrong with the call itself comes first
            fix = "functions are pure: use the result, `x = f(…)`" if isinstance(node.value, ast.Call) else "remove it"
            self._fail("E421", "an expression whose value is not used", span, help=fix)
        else:
            what, instead = _INSTEAD.get(type(node), ("this statement", "use what docs/language.md lists"))
            self._fail("E410", f"{what} is not part of the language", span, help=instead)

    # ---- assignment ------------------------------------------------------------------------------------------------

    def _assign(self, node: ast.Assign, span: Span, out: list[ir.Stmt]) -> None:
        if len(node.targets) != 1:
            self._fail("E410", "chained assignment is not part of the language", span, help="assign one name a line")
        target = node.targets[0]
        if isinstance(target, ast.Tuple | ast.List):
            self._unpack(target.elts, node.value, span, out)
        elif self._effect_of(node.value) is not None:
            out.append(self._effect(node.value, target, span))
        else:
            out.append(self._store(target, node.value, span))

    def _effect_of(self, node: ast.expr) -> ir.Extern | None:
        """What is called, where that is an extern or a hardware builtin."""
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            return None
        return HARDWARE.get(node.func.id) or self.scope.functions.externs.get(node.func.id)

    def _effect(self, node: ast.expr, target: ast.expr | None, span: Span) -> ir.Stmt:
        """`f(a)` or `x = f(a)`, where f reaches outside the machine."""
        function = self._effect_of(node)
        assert function is not None and isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        name = node.func.id
        if not self.scope.effects:
            why = "`start` has no host yet, and helpers are pure"
            self._fail("E434", f"`{name}` is called in `execute` only", span, why=why, help="call it there")
        shown = f"{name}({', '.join(f'{n}: {t}' for n, t in function.arguments)})"
        if node.keywords or len(node.args) != len(function.arguments):
            message = f"`{name}` takes {len(function.arguments)} argument(s) by position"
            self._fail("E416", message, span, help=shown)
        args = tuple(
            self.expr.expect(a, t, f"`{n}` of `{name}`")
            for a, (n, t) in zip(node.args, function.arguments, strict=True)
        )
        if (target is None) != (function.result is None):
            fix = f"write `value = {name}(…)`" if target is None else "leave out the `… =`"
            what = "has a result that is not used" if target is None else "returns nothing"
            self._fail("E421", f"`{name}` {what}", span, help=fix)
        place = None
        if target is not None and function.result is not None:
            place = self._result_place(target, function.result)
            if place.type != function.result:
                self._fail("E402", f"`{ast.unparse(target)}` is {place.type}, not {function.result}", span)
        return ir.Effect(function, args, place, span)

    def _result_place(self, target: ast.expr, type_: Type) -> ir.Place:
        if isinstance(target, ast.Name) and target.id not in self.scope.types:
            return self._bind(target, type_)
        place = self._place(target)
        if isinstance(place, ir.Local):
            self.scope.assigned.add(place.name)
        return place

    def _unpack(self, targets: list[ast.expr], value: ast.expr, span: Span, out: list[ir.Stmt]) -> None:
        """`a, b = …`: every value first, into locals that no program can name, then the targets from left to right."""
        wanted = [self._known_type(t) for t in targets]
        if isinstance(value, ast.Tuple | ast.List):
            if len(value.elts) != len(targets):
                fix = "write as many names as values"
                self._fail("E437", f"{len(value.elts)} values for {len(targets)} names", span, help=fix)
            values = [self.expr.check(v, want) for v, want in zip(value.elts, wanted, strict=True)]
        else:
            values = self._rows(self.expr.check(value), len(targets), span)
        if self._reads_a_target(targets, values):
            values = [self._aside(v, out) for v in values]
        for target, item in zip(targets, values, strict=True):
            out.append(self._put(target, item, span))

    def _reads_a_target(self, targets: list[ast.expr], values: list[ir.Expr]) -> bool:
        """Whether assigning one target could change a value that is still to come."""
        written = {("", t.id) if isinstance(t, ast.Name) else ir.variable(self._place(t)) for t in targets}
        return any(written & ir.variables(v) for v in values)

    def _aside(self, value: ir.Expr, out: list[ir.Stmt]) -> ir.Expr:
        """The value in a local that no program can name."""
        self._unpacked += 1
        local = ir.Local(value.type, f"unpacked.{self._unpacked}", value.span)
        self.scope.types[local.name] = (value.type, value.span)
        out.append(ir.Assign(local, value, value.span))
        return local

    def _rows(self, value: ir.Expr, count: int, span: Span) -> list[ir.Expr]:
        """The elements or rows of an array, one for each name."""
        if not isinstance(value.type, Array) or not isinstance(value, ir.Place):
            fix = "name it first, then unpack the name" if isinstance(value.type, Array) else "write as many values"
            self._fail("E437", f"a {value.type} is not unpacked here", value.span, help=fix)
        if value.type.shape[0] != count:
            fix = "write a name for each, or take a slice: `a, b = x[0:2]`"
            self._fail("E437", f"{value.type.shape[0]} elements for {count} names", span, help=fix)
        rest = value.type.shape[1:]
        type_: Type = Array(value.type.element, rest) if rest else value.type.element
        return [self.expr.element(value, type_, position) for position in range(count)]

    def _known_type(self, target: ast.expr) -> Type | None:
        """What literals for this target become: its type, where it has one already."""
        if isinstance(target, ast.Name):
            known = self.scope.types.get(target.id)
            return known[0] if known else None
        return self._place(target).type

    def _store(self, target: ast.expr, value: ast.expr, span: Span) -> ir.Stmt:
        if isinstance(target, ast.Name) and target.id not in self.scope.types:
            first = self.expr.raw(value)
            if is_literal(first.type):
                self.scope.bare.add(target.id)
            return self._first(target, self.expr.settle(first, None), span)
        return self._put(target, self.expr.check(value, self._place(target).type), span)

    def _put(self, target: ast.expr, stored: ir.Expr, span: Span) -> ir.Stmt:
        """A value into its target, which may be a local seen for the first time."""
        if isinstance(target, ast.Name) and target.id not in self.scope.types:
            return self._first(target, stored, span)
        place = self._place(target)
        if stored.type != place.type:
            what = f"`{ast.unparse(target)}`"
            notes: tuple[tuple[Span, str], ...] = ()
            root = ir.root(place)
            if isinstance(root, ir.Local):
                notes = ((self.scope.types[root.name][1], f"`{root.name}` became {root.type} here"),)
            elif isinstance(root, ir.Field):
                port = self.scope.ports[root.record][root.name]
                notes = ((port.span, "declared here"),)
            begin = ""
            if isinstance(place, ir.Local) and place.name in self.scope.bare and isinstance(stored.type, Scalar):
                begin = f"where `{place.name}` begins, write `{place.name}: {stored.type} = …`"
            self.expr.mismatch(stored, place.type, what, notes, begin)
        if place.type == HEALTH and isinstance(stored, ir.Const) and stored.value == STALE:
            self._fail("E407", "an algorithm that runs is not stale", stored.span, help="report Health.failed")
        if isinstance(place, ir.Local):
            self.scope.assigned.add(place.name)
        return ir.Assign(place, stored, span)

    def _first(self, target: ast.Name, value: ir.Expr, span: Span) -> ir.Stmt:
        return ir.Assign(self._bind(target, value.type), value, span)

    def _bind(self, target: ast.Name, type_: Type) -> ir.Local:
        """A local seen for the first time: its value gives it its type."""
        name, at = target.id, self.expr.span(target)
        self._may_bind(name, at)
        self.scope.types[name] = (type_, at)
        self.scope.assigned.add(name)
        return ir.Local(type_, name, at)

    def _may_bind(self, name: str, span: Span) -> None:
        scope = self.scope
        if name in scope.poisoned:
            raise Stop
        if name in scope.arguments or name in scope.records:
            self._fail("E422", f"`{name}` is an argument, and arguments are read-only", span, help="use another name")
        if name in scope.ranges:
            self._fail("E422", f"`{name}` is the variable of the loop", span, why="loop variables are read-only")
        if name in scope.constants or name in scope.names.sizes:
            self._fail("E422", f"`{name}` is a module constant", span, help="use another name")
        if name in LANGUAGE_NAMES or name in scope.names.structs:
            whose = "the language" if name in LANGUAGE_NAMES else "the machine: a struct"
            self._fail("E422", f"`{name}` is a name of {whose}", span, help="use another name")
        if scope.functions.is_function(name) or name in scope.functions.externs:
            self._fail("E422", f"`{name}` is a function", span, help="use another name")

    def _place(self, target: ast.expr) -> ir.Place:
        """An assignable place; `x[i]` needs x to have a value already."""
        span = self.expr.span(target)
        if isinstance(target, ast.Name):
            self._may_bind(target.id, span)
            return ir.Local(self.scope.types[target.id][0], target.id, span)
        if isinstance(target, ast.Tuple | ast.List | ast.Starred):
            self._fail("E437", "unpacking inside unpacking", span, help="assign one name a line")
        if not isinstance(target, ast.Attribute | ast.Subscript):
            self._fail(
                "E410", "this cannot be assigned", span, help="assign a local, an output, state, or parts of them"
            )
        place = self.expr.raw(target)
        if not isinstance(place, ir.Place):
            self._fail(
                "E410", "this cannot be assigned", span, help="assign a local, an output, state, or parts of them"
            )
        root = ir.root(place)
        if isinstance(root, ir.Field) and root.record in ("inputs", "parameters"):
            fix = "copy it into a local" if root.record == "inputs" else "keep what changes in `State`"
            self._fail("E422", f"{root.record} are read-only", span, help=fix)
        if isinstance(root, ir.ModuleConst):
            self._fail("E422", f"`{root.name}` is a module constant", span, help="copy it into a local")
        if isinstance(root, ir.Local) and root.name in self.scope.arguments:
            fix = f"copy it first: `copy = {root.name}`"
            self._fail("E422", f"`{root.name}` is an argument, and arguments are read-only", span, help=fix)
        return place

    def _annotated(self, node: ast.AnnAssign, span: Span) -> ir.Stmt:
        from .declarations import annotation_type

        if not isinstance(node.target, ast.Name) or node.value is None:
            self._fail(
                "E410", "a local is declared by its first value", span, help="write `x: f64 = 0.0`, or `x = 0.0`"
            )
        declared = annotation_type(self.scope.source, node.annotation, self.scope.names, False, self.sink)
        if declared is None:
            raise Stop
        name, at = node.target.id, self.expr.span(node.target)
        if name in self.scope.types:
            self._fail("E423", f"`{name}` is declared twice", at, help="a local has one type; assign without `:`")
        if self._effect_of(node.value) is not None:
            stored = self._effect(node.value, node.target, span)
            if self.scope.types[name][0] != declared[0]:
                self._fail("E402", f"`{name}` is {declared[0]}, not {self.scope.types[name][0]}", span)
            return stored
        return self._first(node.target, self.expr.expect(node.value, declared[0], f"`{name}`"), span)

    def _augmented(self, node: ast.AugAssign, span: Span) -> ir.Stmt:
        if isinstance(node.op, _NOT_AUGMENTED):
            self._fail("E410", "this operator is not part of the language", span, help="write it out: x = x ** 2")
        if isinstance(node.target, ast.Name) and node.target.id not in self.scope.types:
            self.expr.raw(node.target)  # reports an undefined or read-only name
            self._may_bind(node.target.id, self.expr.span(node.target))
        combined = ast.BinOp(left=node.target, op=node.op, right=node.value)
        ast.copy_location(combined, node)
        return self._store(node.target, combined, span)

    # ---- control flow ----------------------------------------------------------------------------------------------

    def _if(self, node: ast.If, span: Span) -> ir.Stmt:
        scope = self.scope
        condition = self.expr.expect(node.test, BOOL, "the condition")
        before = set(scope.assigned)
        then = self.body(node.body)
        then_assigned, then_ended = scope.assigned, scope.unreachable
        scope.assigned, scope.unreachable = set(before), False
        otherwise = self.body(node.orelse)
        else_assigned, else_ended = scope.assigned, scope.unreachable
        scope.unreachable = then_ended and else_ended
        if then_ended:
            scope.assigned = else_assigned
        elif else_ended:
            scope.assigned = then_assigned
        else:
            scope.assigned = then_assigned & else_assigned
        return ir.If(condition, then, otherwise, span)

    def _for(self, node: ast.For, span: Span) -> ir.Stmt:
        if node.orelse:
            self._fail("E410", "`else` of a loop is not part of the language", span, help="set a bool before `break`")
        if not isinstance(node.target, ast.Name):
            self._fail("E410", "a loop has one variable", self.expr.span(node.target), help="for i in range(n):")
        start, stop, step = self._range(node.iter)
        scope, name = self.scope, node.target.id
        at = self.expr.span(node.target)
        if name in scope.types:
            self._fail("E422", f"`{name}` is a local already", at, help="give the loop variable a name of its own")
        self._may_bind(name, at)
        # A loop that cannot run (triangular loops over small matrices) has no body to check: its indices mean nothing.
        first, last = _bounds(start), _bounds(stop)
        runs = last[1] > first[0] if step > 0 else last[0] < first[1]
        if not runs:
            return ir.For(name, start, stop, step, (), span)
        always = last[0] > first[1] if step > 0 else last[1] < first[0]
        low, high = (first[0], last[1] - 1) if step > 0 else (last[0] + 1, first[1])
        outside = self._iterations
        self._iterations *= (high - low) // abs(step) + 1
        if self._iterations > MAX_ITERATIONS:
            total, self._iterations = self._iterations, outside
            why = f"a tick has time for {MAX_ITERATIONS}, counted over the loops around this one"
            self._fail("E424", f"a loop of {total} iterations", span, why=why, help="spread the work over ticks")
        before, jumped = set(scope.assigned), self._jumped
        scope.ranges[name] = ir.RangeVar(I64, name, low, high, at)
        self._jumped = False
        body = self.body(node.body)
        self._iterations = outside
        del scope.ranges[name]
        scope.dead_ranges.add(name)
        if not always or self._jumped:
            scope.assigned = before
        scope.unreachable, self._jumped = False, jumped
        return ir.For(name, start, stop, step, body, span)

    def _range(self, node: ast.expr) -> tuple[ir.Expr, ir.Expr, int]:
        span = self.expr.span(node)
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range"):
            self._fail(
                "E424", "a loop runs over a `range`", span, help="write `for i in range(n):` and index the array"
            )
        if node.keywords or not 1 <= len(node.args) <= 3:
            self._fail(
                "E424", "`range` takes one to three arguments", span, help="range(stop), range(start, stop, step)"
            )
        bounds: list[ir.Expr] = []
        for arg in node.args:
            bound = self.expr.check(arg, I64)
            if bound.type != I64 or not is_static(bound):
                self._fail(
                    "E424",
                    "the bounds of a loop are known at compile time",
                    self.expr.span(arg),
                    why="a tick has a worst case only if every loop has one",
                    help="loop to the largest bound and `break`",
                )
            bounds.append(bound)
        if len(bounds) == 1:
            bounds.insert(0, ir.Const(I64, 0, span))
        step = bounds[2] if len(bounds) == 3 else ir.Const(I64, 1, span)
        if not isinstance(step, ir.Const) or not isinstance(step.value, int) or step.value == 0:
            self._fail("E424", "the step of a loop is a constant other than 0", step.span)
        if any(abs(edge) > 2**31 for bound in bounds for edge in _bounds(bound)):
            self._fail("E424", "a loop bound beyond 2^31", span, help="no tick has time for so many iterations")
        return bounds[0], bounds[1], step.value

    def _return(self, node: ast.Return, span: Span) -> ir.Stmt:
        wanted: Type | None = self.scope.result
        if wanted is None:
            if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
                self._fail("E425", "execute and start return nothing", span, help="write results to outputs")
            return ir.Return(None, span)
        if node.value is None:
            self._fail("E425", f"this function returns {wanted}", span, help="write `return …` with a value")
        return ir.Return(self.expr.expect(node.value, wanted, "the result"), span)


def _bounds(expr: ir.Expr) -> tuple[int, int]:
    bounds = interval(expr)
    assert bounds
    return bounds


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
