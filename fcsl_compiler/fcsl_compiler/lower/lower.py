# SPDX-License-Identifier: Apache-2.0
"""Lowers typed IR. Propagates constant arrays into the functions that take them as arguments.

An array is *constant* if it is a whole module constant or a whole frozen parameter, transpose(…) of one, or an argument
that is constant in a specialised function. By the rule of structural zeros (docs/reference/language.md), matmul, matvec, sums and
differences of arrays omit terms with its zeros.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, cast

from ..model import ir
from ..model.machine import Machine, Values
from ..model.types import Array
from .common_subexpressions import share_calls
from .dead_fills import without_dead_fills
from .short_triangles import taken, without_short_triangles
from .structural_zeros import PRODUCTS, Constant, product
from .undo import with_undo

#: A sum with more non-zero elements than this becomes a loop over a table with a test.
_WRITTEN_ELEMENTS = 128


def lower(machine: Machine) -> Machine:
    """The machine with lowered functions. Functions that are no longer needed stay in the program."""
    lowering = _Lowering(machine)
    program = machine.program
    for name, function in program.functions.items():
        lowering.functions[name] = lowering.function(function)
    entries: dict[str, ir.Function] = {}  # by name: instances that are alike share them
    for i in machine.instances:
        if i.execute.name not in entries:
            entries[i.execute.name] = with_undo(lowering.function(i.execute))
        if i.start is not None and i.start.name not in entries:
            entries[i.start.name] = lowering.function(i.start)
    instances = tuple(
        replace(i, execute=entries[i.execute.name], start=None if i.start is None else entries[i.start.name])
        for i in machine.instances
    )
    return replace(machine, instances=instances, program=replace(program, functions=lowering.functions))


class _Lowering:
    def __init__(self, machine: Machine):
        #: Values of constant arrays by owner and name.
        self.values: dict[tuple[str, str], Values] = {}
        self.values |= {key: values for key, (_, values) in machine.program.constants.items()}
        for i in machine.instances:
            owner = f"{i.algorithm.owner}__{i.identifier}"
            self.values |= {(owner, name): i.parameters[name] for name in i.frozen if name in i.parameters}
        self.functions: dict[str, ir.Function] = dict(machine.program.functions)
        #: The functions before lowering. Specialised functions are derived from these.
        self._written = machine.program.functions
        #: The specialised function for a callee and its constant arguments. None if it would be identical.
        self._made: dict[tuple[str, tuple[Constant | None, ...]], ir.Function | None] = {}

    def function(self, f: ir.Function, known: dict[str, Constant] | None = None) -> ir.Function:
        """Lowers a function whose arguments `known` are constant. Returns f itself if nothing changes."""
        if _is_library(f) and f.source_name in PRODUCTS:
            f = product(f, f.name, {})
        simple = replace(f, body=taken(f.body)) if _is_library(f) else f
        body = _Body(self, known or {}).rewrite(without_dead_fills(simple))
        if _is_library(f):
            body = without_short_triangles(body)
        made = share_calls(replace(f, body=body), self._is_library)
        return f if made.body == f.body else replace(made, calls=_calls(made.body))

    def _is_library(self, name: str) -> bool:
        return _is_library(self.functions[name])

    def special(self, name: str, known: tuple[Constant | None, ...]) -> ir.Function | None:
        """The function `name`, specialised for these constant arguments."""
        key = (name, known)
        if key not in self._made:
            self._made[key] = None
            f = self._written.get(name) or self.functions[name]
            given = {a: c for (a, _), c in zip(f.arguments, known, strict=True) if c is not None}
            unique = self._unique(name, known)
            if _is_library(f) and f.source_name in PRODUCTS:
                made = product(f, unique, given)
            else:
                made = self.function(f, given)
            if made is not f:
                self._made[key] = self.functions[unique] = replace(made, name=unique)
        return self._made[key]

    def _unique(self, name: str, known: tuple[Constant | None, ...]) -> str:
        """Name of a specialised function, such as `matmul_9_9_9__f_x`: the names of constants, x for unknown
        arguments."""
        text = f"{name}__{'_'.join('x' if c is None else c.name for c in known)}"
        taken, count = text, 2
        while taken in self.functions:
            taken, count = f"{text}_{count}", count + 1
        return taken


class _Body:
    """Rewrites the body of one function. Unchanged parts are shared, not copied."""

    def __init__(self, lowering: _Lowering, known: dict[str, Constant]):
        self.lowering, self.known = lowering, known

    def rewrite(self, node: Any) -> Any:
        if isinstance(node, tuple):
            items = tuple(map(self.rewrite, node))
            return node if all(new is old for new, old in zip(items, node, strict=True)) else items
        if not is_dataclass(node) or isinstance(node, type) or type(node).__module__ != ir.__name__:
            return node
        old = {f.name: getattr(node, f.name) for f in fields(node)}
        changed = {name: new for name, value in old.items() if (new := self.rewrite(value)) is not value}
        if changed:
            node = replace(node, **changed)
        if isinstance(node, ir.Call):
            return self._call(node)
        return self._sum(node) if isinstance(node, ir.Elementwise) else node

    def _call(self, e: ir.Call) -> ir.Expr:
        formula = self._formula(e)
        if formula is not None:
            return cast(ir.Expr, self.rewrite(formula))
        known = tuple(map(self.constant, e.args))
        if not any(known):
            return e
        made = self.lowering.special(e.function, known)
        if made is None:
            return e
        kept = {name for name, _ in made.arguments}
        all_names = [name for name, _ in self.lowering.functions[e.function].arguments]
        args = tuple(arg for name, arg in zip(all_names, e.args, strict=True) if name in kept)
        return replace(e, function=made.name, args=args)

    def _formula(self, e: ir.Call) -> ir.Expr | None:
        """Inlines a library function that is a single expression of whole arrays (kf_predict_cov). Its arguments must
        be places, so that nothing is computed twice."""
        f = self.lowering.functions[e.function]
        if not (
            _is_library(f) and len(f.body) == 1 and isinstance(f.body[0], ir.Return) and f.body[0].value is not None
        ):
            return None
        given = dict(zip((name for name, _ in f.arguments), e.args, strict=True))
        if not all(isinstance(a, ir.Local | ir.Field | ir.ModuleConst) for a in given.values()):
            return None
        return _put_in(f.body[0].value, given)

    def _sum(self, e: ir.Elementwise) -> ir.Expr:
        """a + c, c + a and a - c with a constant c: only the non-zero elements of c are applied."""
        if e.op.name not in ("+", "-") or len(e.args) != 2 or not e.op.result.is_float:
            return e
        for number in (1, 0) if e.op.name == "+" else (1,):
            constant = self.constant(e.args[number])
            if constant is not None and constant.has_zeros:
                many = sum(v != 0.0 for v in constant.values) > _WRITTEN_ELEMENTS
                table = e.args[number] if many else None
                return ir.Adjust(e.type, e.op, e.args[1 - number], constant.values, table, e.span)
        return e

    def constant(self, e: ir.Expr) -> Constant | None:
        """The value of an array that is known here. Integer arrays are not considered."""
        if isinstance(e, ir.Local):
            return self.known.get(e.name)
        if isinstance(e, ir.ModuleConst) and isinstance(e.type, Array) and (e.owner, e.name) in self.lowering.values:
            if getattr(e.type.element, "is_float", False):
                return Constant(e.name, e.type, cast(tuple[float, ...], self.lowering.values[e.owner, e.name]))
        if isinstance(e, ir.Call):
            f = self.lowering.functions[e.function]
            if _is_library(f) and f.source_name == "transpose":
                inner = self.constant(e.args[0])
                return None if inner is None else inner.transposed
        return None


def _put_in(e: ir.Expr, given: dict[str, ir.Expr]) -> ir.Expr | None:
    """The expression with its locals replaced. None if it contains anything but calls, sums and products of whole
    arrays."""
    if isinstance(e, ir.Local):
        return given[e.name]
    if not isinstance(e, ir.Call | ir.Elementwise):
        return None
    args = tuple(found for a in e.args if (found := _put_in(a, given)) is not None)
    return replace(e, args=args) if len(args) == len(e.args) else None


def _is_library(f: ir.Function) -> bool:
    return f.span.source.name.startswith("<library>/")


def _calls(body: tuple[ir.Stmt, ...]) -> tuple[str, ...]:
    """All functions that a body calls, each once."""
    found: dict[str, None] = {}

    def visit(e: ir.Expr) -> None:
        if isinstance(e, ir.Call):
            found[e.function] = None
        for child in ir.children(e):
            visit(child)

    for s in ir.walk(body):
        for e in ir.expressions(s):
            visit(e)
    return tuple(found)
