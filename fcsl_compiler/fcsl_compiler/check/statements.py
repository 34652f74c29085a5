# SPDX-License-Identifier: Apache-2.0
"""Checks the statements of one function body: types of locals, definite assignment, bounded loops."""

from __future__ import annotations

import ast
from collections import Counter
from typing import NoReturn

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model import ir, ops
from ..model.effects import can_fault
from ..model.events import MOST_TEXT, is_text
from ..model.types import BOOL, HEALTH_NAMES, I64, Array, Results, Scalar, Type
from .annotations import annotation_type
from .checker import Stop
from .effect_order import Hoister, reaches_outside
from .expressions import ExprChecker
from .folding import fold
from .intervals import always, interval, is_static
from .library_files import library_names
from .loop_bounds import BEYOND, MAX_BOUND, MAX_ITERATIONS, TOO_MANY, parameters_in
from .scope import LANGUAGE_NAMES, SHADOWABLE, Scope

STALE = HEALTH_NAMES.index("stale")

_INSTEAD: dict[type[ast.AST], tuple[str, str]] = {
    ast.While: ("`while`", "write a bounded loop: `for i in range(100):` with `if done: break`"),
    ast.Try: ("`try`", "faults are contained by the machine: health becomes failed, outputs stay as they were"),
    ast.Raise: ("`raise`", 'report with `self.health = "failed"`'),
    ast.With: ("`with`", "an algorithm has no resources"),
    ast.FunctionDef: ("a nested function", "write it at module level"),
    ast.ClassDef: ("a class here", "define algorithms at module level"),
    ast.Import: ("an import here", "write imports at the top of the file"),
    ast.ImportFrom: ("an import here", "write imports at the top of the file"),
    ast.Global: ("`global`", "keep what the next tick needs in `state`"),
    ast.Nonlocal: ("`nonlocal`", "keep what the next tick needs in `state`"),
    ast.Delete: ("`del`", "leave the value unused"),
    ast.Match: ("`match`", "write `if` … `elif` …"),
}


class BodyChecker:
    """Checks one body. After a failed statement, checking continues with the next."""

    def __init__(self, scope: Scope, sink: DiagnosticSink):
        self.scope = scope
        self.expr = ExprChecker(scope, sink)
        self.sink = sink
        self._hoister = Hoister(scope)
        self._jumped = False
        self._hidden = 0
        self._for_other_sizes = False  # the rest of the function is reached with other sizes only
        self._iterations = 1  # product of the iteration counts of the enclosing loops

    def function(self, statements: list[ast.stmt]) -> tuple[ir.Stmt, ...]:
        """Checks the body of a function. A leading docstring is skipped."""
        statements = statements[1:] if _is_docstring(statements[0]) else statements
        self.expr.inference.function(statements)
        nodes = (n for s in statements for n in ast.walk(s))
        stores = Counter(n.id for n in nodes if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store))
        self.scope.single = {name for name, count in stores.items() if count == 1}
        return self.body(statements)

    def body(self, statements: list[ast.stmt]) -> tuple[ir.Stmt, ...]:
        out: list[ir.Stmt] = []
        for node in statements:
            if self.scope.unreachable:
                if not self._for_other_sizes:
                    at = self.expr.span(node)
                    self.sink.error("E420", "this line is never reached", at, help="remove it")
                break
            self._for_other_sizes = False
            made: list[ir.Stmt] = []
            requests = len(self.scope.requests)
            try:
                self._statement(node, made)
            except Stop:
                self._poison(node)
                for name in list(self.scope.requests)[requests:]:  # possibly not requests
                    del self.scope.requests[name]
            out += self._hoister.statements(made)
        return tuple(out)

    def _poison(self, node: ast.stmt) -> None:
        """Suppresses errors about names that the failed statement would have assigned, so that one mistake gives one
        message."""
        for n in ast.walk(node):
            name = n.id if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Store) else getattr(n, "name", None)
            if isinstance(name, str) and (name not in self.scope.types or self.expr.inference.reason(name) is None):
                self.scope.poisoned.add(name)
            elif isinstance(name, str):
                self.scope.assigned.add(name)

    def _fail(self, code: str, message: str, span: Span, *, why: str = "", help: str = "") -> NoReturn:
        self.expr.fail(code, message, span, why=why, help=help)

    def _statement(self, node: ast.stmt, out: list[ir.Stmt]) -> None:
        span = self.expr.span(node)
        if isinstance(node, ast.Pass) or _is_ellipsis(node):
            return
        if isinstance(node, ast.Assign):
            self._assign(node, span, out)
        elif isinstance(node, ast.AnnAssign):
            out.append(self._annotated(node, span))
        elif isinstance(node, ast.AugAssign):
            out.append(self._augmented(node, span, out))
        elif isinstance(node, ast.If):
            out.append(self._if(node, span))
        elif isinstance(node, ast.Assert):
            self._assert(node, span, out)
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
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) and self.expr.is_event(node.value):
            out.append(self.expr.event(node.value))
        elif isinstance(node, ast.Expr) and isinstance(node.value, ast.Call) and self.expr.is_outside(node.value):
            out.append(self.expr.statement(node.value))
        elif isinstance(node, ast.Expr):
            if isinstance(node.value, ast.Call):
                self.expr.raw(node.value)  # an error in the call itself is reported first
            fix = "functions are pure: use the result, `x = f(…)`" if isinstance(node.value, ast.Call) else "remove it"
            self._fail("E421", "an expression whose value is not used", span, help=fix)
        else:
            what, instead = _INSTEAD.get(type(node), ("this statement", "use what docs/reference/language.md lists"))
            self._fail("E410", f"{what} is not part of the language", span, help=instead)

    # ---- assignment ------------------------------------------------------------------------------------------------

    def _assign(self, node: ast.Assign, span: Span, out: list[ir.Stmt]) -> None:
        if len(node.targets) != 1:
            self._fail("E410", "chained assignment is not part of the language", span, help="assign one name a line")
        target = node.targets[0]
        if self._assigns_initial(target, node.value):
            return
        if isinstance(target, ast.Tuple | ast.List):
            self._unpack(target.elts, node.value, span, out)
        else:
            out.append(self._store(target, node.value, span))

    def _assigns_initial(self, target: ast.expr, value: ast.expr) -> bool:
        """Whether the statement is `self.health = "nominal"` or `self.transition_request = ""` in `start`. It has no
        effect: both hold before every `execute`."""
        first = {"health": "nominal", "transition_request": ""}
        if self.scope.method != "start" or not (isinstance(target, ast.Attribute) and isinstance(value, ast.Constant)):
            return False
        algorithm, name = self.scope.algorithm, target.attr
        if algorithm is None or algorithm.find(name) is None or ast.unparse(target.value) != "self":
            return False
        return first.get(name) == value.value

    def _unpack(self, targets: list[ast.expr], value: ast.expr, span: Span, out: list[ir.Stmt]) -> None:
        """`a, b = …`: evaluates all values into hidden locals first, then assigns the targets from left to right."""
        wanted = [self._known_type(t) for t in targets]
        if isinstance(value, ast.Tuple | ast.List):
            if len(value.elts) != len(targets):
                fix = "write as many names as values"
                self._fail("E437", f"{len(value.elts)} values for {len(targets)} names", span, help=fix)
            values = [self.expr.check(v, want) for v, want in zip(value.elts, wanted, strict=True)]
        else:
            whole = self.expr.check(value)
            whole_is_new = reaches_outside(whole) or not isinstance(whole, ir.Place)
            if isinstance(whole.type, Array | Results) and whole_is_new:
                whole = self._to_local(whole, out)  # computed once, however many targets there are
            values = self._rows(whole, len(targets), span)
        if (
            self._reads_a_target(targets, values)
            or any(map(reaches_outside, values))
            or (any(map(can_fault, values[1:])) and any(map(self._may_fault, targets[:-1])))
        ):
            values = [self._to_local(v, out) for v in values]
        for target, item in zip(targets, values, strict=True):
            out.append(self._put(target, item, span))

    def _may_fault(self, target: ast.expr) -> bool:
        return isinstance(target, ast.Subscript | ast.Attribute) and can_fault(self._place(target))

    def _reads_a_target(self, targets: list[ast.expr], values: list[ir.Expr]) -> bool:
        """Whether assigning one target could change a value that a later target needs."""
        written = {("", t.id) if isinstance(t, ast.Name) else ir.variable(self._place(t)) for t in targets}
        return any(written & ir.variables(v) for v in values)

    def _to_local(self, value: ir.Expr, out: list[ir.Stmt], name: str = "unpacked") -> ir.Expr:
        """Stores a value in a hidden local."""
        self._hidden += 1
        local = ir.Local(value.type, f"{name}.{self._hidden}", value.span)
        self.scope.types[local.name] = (value.type, value.span)
        out.append(ir.Assign(local, value, value.span))
        return local

    def _rows(self, value: ir.Expr, count: int, span: Span) -> list[ir.Expr]:
        """The elements or rows of an array, or the results of a helper, one per target."""
        if isinstance(value.type, Results) and isinstance(value, ir.Place):
            if len(value.type.members) != count:
                fix = "write a name for each"
                self._fail("E437", f"{len(value.type.members)} results for {count} names", span, help=fix)
            return [ir.Member(m.type, value, m.name, value.span) for m in value.type.members]
        if not isinstance(value.type, Array) or not isinstance(value, ir.Place):
            fix = "write as many values"
            self._fail("E437", f"a {value.type} is not unpacked here", value.span, help=fix)
        if value.type.shape[0] != count:
            fix = "write a name for each, or take a slice: `a, b = x[0:2]`"
            self._fail("E437", f"{value.type.shape[0]} elements for {count} names", span, help=fix)
        rest = value.type.shape[1:]
        type_: Type = Array(value.type.element, rest) if rest else value.type.element
        return [self.expr.element(value, type_, position) for position in range(count)]

    def _known_type(self, target: ast.expr) -> Type | None:
        """The type of an assignment target, None for a new local. Strings assigned to it take this type."""
        if isinstance(target, ast.Name):
            known = self.scope.types.get(target.id)
            return known[0] if known else None
        return self._place(target).type

    def _store(self, target: ast.expr, value: ast.expr, span: Span) -> ir.Stmt:
        if isinstance(target, ast.Name) and target.id not in self.scope.types:
            return self._first(target, self.expr.check(value), span)
        return self._put(target, self.expr.check(value, self._place(target).type), span)

    def _put(self, target: ast.expr, stored: ir.Expr, span: Span) -> ir.Stmt:
        """Assigns a value to its target. A new local takes the type of the value."""
        if isinstance(target, ast.Name) and target.id not in self.scope.types:
            return self._first(target, stored, span)
        place = self._place(target)
        if stored.type != place.type:
            what = f"`{ast.unparse(target)}`"
            notes: tuple[tuple[Span, str], ...] = ()
            root = ir.root(place)
            if isinstance(root, ir.Local):
                notes = self.expr.local_origin(root.name)
            elif isinstance(root, ir.Field):
                notes = self.expr.origin(root)
            self.expr.mismatch(stored, place.type, what, notes)
        word = isinstance(place, ir.Field) and (place.record, place.name) == ("outputs", "health")
        stale = _stale(stored) if word else None
        if stale is not None:
            self._fail("E407", "an algorithm that runs is not stale", stale.span, help='report "failed"')
        if isinstance(place, ir.Local):
            self.scope.assigned.add(place.name)
        return ir.Assign(place, stored, span)

    def _first(self, target: ast.Name, value: ir.Expr, span: Span) -> ir.Stmt:
        local = self._bind(target, value.type)
        bounds = interval(value) if local.name in self.scope.single else None
        if bounds is not None:
            self.scope.bounds[local.name] = bounds
        return ir.Assign(local, value, span)

    def _bind(self, target: ast.Name, type_: Type) -> ir.Local:
        """Defines a new local with the given type."""
        name, at = target.id, self.expr.span(target)
        self._may_bind(name, at)
        if isinstance(type_, Results):
            names = ", ".join("abcdefgh"[: len(type_.members)])
            self._fail("E437", f"{len(type_.members)} results for one name", at, help=f"write `{names} = …`")
        self.scope.types[name] = (type_, at)
        self.scope.assigned.add(name)
        return ir.Local(type_, name, at)

    def _may_bind(self, name: str, span: Span) -> None:
        scope = self.scope
        if name in scope.poisoned:
            raise Stop
        if name == "self" and scope.algorithm is not None:
            self._fail("E422", "`self` is the algorithm itself", span, help="assign a field: `self.… = …`")
        if name in scope.arguments:
            self._fail("E422", f"`{name}` is an argument, and arguments are read-only", span, help="use another name")
        if name in scope.ranges:
            self._fail("E422", f"`{name}` is the variable of the loop", span, why="loop variables are read-only")
        if name in scope.constants or name in scope.names.sizes:
            what = "a module constant" if name in scope.constants else "a size"
            self._fail("E422", f"`{name}` is {what}", span, help="use another name")
        if (name in SHADOWABLE or name in library_names()) and not scope.uses_library(name):
            return
        if name in LANGUAGE_NAMES or name in scope.names.structs:
            whose = "the language" if name in LANGUAGE_NAMES else "the machine: a struct"
            self._fail("E422", f"`{name}` is a name of {whose}", span, help="use another name")
        if scope.functions.is_function(name) or name in scope.functions.externs:
            self._fail("E422", f"`{name}` is a function", span, help="use another name")

    def _place(self, target: ast.expr) -> ir.Place:
        """An assignable place. In `x[i]`, x must already have a value."""
        span = self.expr.span(target)
        if isinstance(target, ast.Name):
            self._may_bind(target.id, span)
            return ir.Local(self.scope.types[target.id][0], target.id, span)
        if isinstance(target, ast.Tuple | ast.List | ast.Starred):
            what = "`*` in front of a name" if isinstance(target, ast.Starred) else "unpacking inside unpacking"
            self._fail("E437", what, span, help="assign one name a line")
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
            fix = "copy it into a local" if root.record == "inputs" else "keep what changes in `state`"
            self._fail("E422", f"{root.record} are read-only", span, help=fix)
        if isinstance(root, ir.ModuleConst):
            self._fail("E422", f"`{root.name}` is a module constant", span, help="copy it into a local")
        if isinstance(root, ir.Local) and root.name in self.scope.arguments:
            fix = f"copy it first: `copy = {root.name}`"
            self._fail("E422", f"`{root.name}` is an argument, and arguments are read-only", span, help=fix)
        return place

    def _annotated(self, node: ast.AnnAssign, span: Span) -> ir.Stmt:
        if not isinstance(node.target, ast.Name) and node.value is not None:
            fix = f"write `{ast.unparse(node.target)} = {ast.unparse(node.value)[:60]}`"
            self._fail("E410", "a type annotation on an assignment to a declared port", span, help=fix)
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
        return self._first(node.target, self.expr.expect(node.value, declared[0], f"`{name}`"), span)

    def _augmented(self, node: ast.AugAssign, span: Span, out: list[ir.Stmt]) -> ir.Stmt:
        if isinstance(node.op, ast.MatMult):
            name = ast.unparse(node.target)
            fix = f"write `{name} = matmul({name}, …)` or `{name} = matvec(…, {name})`"
            self._fail("E410", "`@=` is not part of the language", span, help=fix)
        if isinstance(node.target, ast.Name) and node.target.id not in self.scope.types:
            self.expr.raw(node.target)  # reports an undefined or read-only name
            self._may_bind(node.target.id, self.expr.span(node.target))
        target = self._settled_target(node.target, out)
        combined = ast.BinOp(left=target, op=node.op, right=node.value)
        ast.copy_location(combined, node)
        return self._store(target, combined, span)

    def _settled_target(self, target: ast.expr, out: list[ir.Stmt]) -> ast.expr:
        """The target with its subscripts in hidden locals if one of them reaches outside. An augmented assignment reads
        and writes the target, but must make these calls once."""
        if isinstance(target, ast.Attribute):
            inner = self._settled_target(target.value, out)
            return ast.copy_location(ast.Attribute(inner, target.attr, target.ctx), target)
        if not isinstance(target, ast.Subscript):
            return target
        base: ast.expr = target
        parts: list[ast.expr] = []
        while isinstance(base, ast.Subscript):
            parts = [*(base.slice.elts if isinstance(base.slice, ast.Tuple) else [base.slice]), *parts]
            base = base.value
        base = self._settled_target(base, out)
        if any(isinstance(n, ast.Call) and self.expr.is_outside(n) for part in parts for n in ast.walk(part)):
            place = self.expr.raw(base)
            if isinstance(place, ir.Place):
                self._hoister.read_checked(place, out)
            parts = [self._settled_index(part, out) for part in parts]
        index = parts[0] if len(parts) == 1 else ast.copy_location(ast.Tuple(parts, ast.Load()), target.slice)
        return ast.copy_location(ast.Subscript(base, index, target.ctx), target)

    def _settled_index(self, node: ast.expr, out: list[ir.Stmt]) -> ast.expr:
        """The index in a hidden local, if it reaches outside or may fault."""
        if isinstance(node, ast.Slice):
            return node
        index = self.expr.check(node, I64)
        if not (reaches_outside(index) or can_fault(index)):
            return node
        local = self._to_local(index, out)
        assert isinstance(local, ir.Local)
        self.scope.assigned.add(local.name)
        return ast.copy_location(ast.Name(local.name, ast.Load()), node)

    # ---- control flow ----------------------------------------------------------------------------------------------

    def _if(self, node: ast.If, span: Span) -> ir.Stmt:
        scope = self.scope
        condition = self.expr.expect(node.test, BOOL, "the condition")
        taken = self._taken(node, condition)
        if taken is not None:
            body = self.body(node.body if taken else node.orelse)
            self._for_other_sizes = scope.unreachable
            return ir.If(condition, body if taken else (), () if taken else body, span)
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

    def _assert(self, node: ast.Assert, span: Span, out: list[ir.Stmt]) -> None:
        """A fault unless the condition holds. None if it is certain to."""
        condition = self.expr.expect(node.test, BOOL, "the condition")
        literal = node.msg.value if isinstance(node.msg, ast.Constant) else None
        text = literal if isinstance(literal, str) else ""
        if node.msg is not None and not is_text(literal):
            fix = f'write it as `assert …, "dry mass"`, of 1 to {MOST_TEXT} printable characters of ASCII'
            self._fail("E410", "the text of this assertion", self.expr.span(node.msg), why="it is compiled", help=fix)
        if not always(fold(condition)):
            self.scope.faults = True
            failing = ir.Apply(BOOL, ops.assertion(text), (condition,), True, span)
            self._to_local(failing, out, "asserted")

    def _taken(self, node: ast.If, condition: ir.Expr) -> bool | None:
        """Whether a condition on size variables holds. The other branch is for other sizes: its indices may be out of range
        here, so it is not checked. None for any other condition."""
        names = {n.id for n in ast.walk(node.test) if isinstance(n, ast.Name)}
        known = condition if names.isdisjoint(self.scope.variables) else fold(condition)
        return bool(known.value) if known is not condition and isinstance(known, ir.Const) else None

    def _for(self, node: ast.For, span: Span) -> ir.Stmt:
        if node.orelse:
            self._fail("E410", "`else` of a loop is not part of the language", span, help="set a bool before `break`")
        if not isinstance(node.target, ast.Name):
            self._fail("E410", "a loop has one variable", self.expr.span(node.target), help="for i in range(n):")
        start, stop, step = self._range(node.iter)
        scope, name = self.scope, node.target.id
        at = self.expr.span(node.target)
        if name in scope.types:
            self._fail("E422", f"`{name}` is a local already", at, help="give the loop variable another name")
        self._may_bind(name, at)
        # A loop that never runs (triangular loops over small matrices) is not checked: its indices may be out of range.
        first, last = _bounds(start), _bounds(stop)
        runs = last[1] > first[0] if step > 0 else last[0] < first[1]
        if not runs:
            return ir.For(name, start, stop, step, (), span)
        always = last[0] > first[1] if step > 0 else last[1] < first[0]
        low, high = (first[0], last[1] - 1) if step > 0 else (last[0] + 1, first[1])
        outside = self._iterations
        known = is_static(start) and is_static(stop)  # else: loop_bounds.py
        self._iterations *= (high - low) // abs(step) + 1 if known else 1
        if self._iterations > MAX_ITERATIONS:
            total, self._iterations = self._iterations, outside
            self._fail("E424", f"a loop of {total} iterations", span, why=TOO_MANY, help="spread the work over ticks")
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
            bound = self._wide(self.expr.check(arg))
            if isinstance(bound.type, Scalar) and not bound.type.is_integer:
                fix = f"write {int(arg.value)}" if isinstance(arg, ast.Constant) and type(arg.value) is float else ""
                self._fail("E424", f"a bound of a loop is an integer, not {bound.type}", self.expr.span(arg), help=fix)
            parameters = parameters_in(bound)
            if bound.type != I64 or parameters is None:
                self._fail(
                    "E424",
                    "the bounds of a loop are known at compile time",
                    self.expr.span(arg),
                    why="a tick has a worst-case time only if every loop has a bound",
                    help="loop to the largest bound and `break`; a `frozen` parameter may be a bound",
                )
            for parameter in parameters:
                self.scope.loop_parameters.setdefault(parameter.name, parameter.span)
            bounds.append(bound)
        if len(bounds) == 1:
            bounds.insert(0, ir.Const(I64, 0, span))
        step = bounds[2] if len(bounds) == 3 else ir.Const(I64, 1, span)
        if not isinstance(step, ir.Const) or not isinstance(step.value, int) or step.value == 0:
            self._fail("E424", "the step of a loop is a constant other than 0", step.span)
        if any(abs(edge) > MAX_BOUND for bound in bounds if is_static(bound) for edge in _bounds(bound)):
            self._fail("E424", BEYOND, span, help="count from 0, and add what it begins with inside")
        return bounds[0], bounds[1], step.value

    def _wide(self, bound: ir.Expr) -> ir.Expr:
        """Converts a bound of a smaller integer type to i64."""
        type_ = bound.type
        if not (isinstance(type_, Scalar) and type_.is_integer) or type_ == I64 or type_.high > I64.high:
            return bound
        op = ops.find("i64", (type_,))
        assert op is not None
        return ir.Apply(I64, op, (bound,), False, bound.span)

    def _return(self, node: ast.Return, span: Span) -> ir.Stmt:
        wanted: Type | None = self.scope.result
        if wanted is None:
            if node.value is not None and not (isinstance(node.value, ast.Constant) and node.value.value is None):
                self._fail("E425", "execute and start return nothing", span, help="write results to outputs")
            return ir.Return(None, span)
        if node.value is None:
            self._fail("E425", f"this function returns {wanted}", span, help="write `return …` with a value")
        if isinstance(wanted, Results) and isinstance(node.value, ast.Tuple):
            return ir.Return(self._results(node.value, wanted, span), span)
        if isinstance(node.value, ast.Tuple):
            fix = f"a helper with several results has them in its type: `-> tuple[{wanted}, …]`"
            self._fail("E425", f"{len(node.value.elts)} results, where this function returns {wanted}", span, help=fix)
        return ir.Return(self.expr.expect(node.value, wanted, "the result"), span)

    def _results(self, node: ast.Tuple, wanted: Results, span: Span) -> ir.Expr:
        """`return a, b`."""
        if len(node.elts) != len(wanted.members):
            self._fail("E425", f"this function returns {wanted}", span, help=f"write {len(wanted.members)} values")
        pairs = zip(node.elts, wanted.members, strict=True)
        items = tuple(self.expr.expect(e, m.type, f"result {n}") for n, (e, m) in enumerate(pairs, 1))
        return ir.StructValue(wanted, items, self.expr.span(node))


def _bounds(expr: ir.Expr) -> tuple[int, int]:
    bounds = interval(expr)
    assert bounds
    return bounds


def _stale(value: ir.Expr) -> ir.Expr | None:
    """The literal "stale", if the value can be it."""
    if isinstance(value, ir.Choose):
        return _stale(value.then) or _stale(value.otherwise)
    return value if isinstance(value, ir.Const) and value.value == STALE else None


def _is_ellipsis(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and node.value.value is ...


def _is_docstring(node: ast.stmt) -> bool:
    return isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str)
