# SPDX-License-Identifier: Apache-2.0
"""From the typed IR to IR that is nearer to good C: what is known of constant arrays goes into the functions that they are given to.

An array is *constant* where it is a whole constant of the module or a whole frozen parameter, named in place, or transpose(…)
of one, and where such an array is the argument of a function, in there. By the rule of structural zeros (docs/language.md),
matmul and matvec leave out products with their zeros, and so do sums and differences of arrays.
"""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any, cast

from ..model import ir
from ..model.machine import Machine, Values
from ..model.types import Array
from .common_subexpressions import share_calls
from .dead_stores import without_dead_stores
from .structural_zeros import PRODUCTS, Constant, product

#: Sums with more elements than this that are not zero are loops over a table, with a test.
_WRITTEN_ELEMENTS = 128


def lower(machine: Machine) -> Machine:
    """The machine with lowered functions; those that its entries do not need any more are still among them."""
    lowering = _Lowering(machine)
    program = machine.program
    for name, function in program.functions.items():
        lowering.functions[name] = lowering.function(function)
    instances = tuple(
        replace(i, execute=lowering.function(i.execute), start=None if i.start is None else lowering.function(i.start))
        for i in machine.instances
    )
    return replace(machine, instances=instances, program=replace(program, functions=lowering.functions))


class _Lowering:
    def __init__(self, machine: Machine):
        #: What constant arrays hold, by owner and name.
        self.values: dict[tuple[str, str], Values] = {}
        self.values |= {key: values for key, (_, values) in machine.program.constants.items()}
        for i in machine.instances:
            owner = f"{i.algorithm.owner}__{i.name}"
            self.values |= {(owner, name): i.parameters[name] for name in i.frozen if name in i.parameters}
        self.functions: dict[str, ir.Function] = dict(machine.program.functions)
        #: Before anything was lowered: what is made for constants starts from here.
        self._written = machine.program.functions
        #: The function made for a callee and the constants that it is given; None where it would be the same.
        self._made: dict[tuple[str, tuple[Constant | None, ...]], ir.Function | None] = {}

    def function(self, f: ir.Function, known: dict[str, Constant] | None = None) -> ir.Function:
        """The function, where some of its arguments may be known; f itself where nothing comes of it."""
        if _is_library(f) and f.source_name in PRODUCTS:
            f = product(f, f.name, {})
        body = _Body(self, known or {}).rewrite(without_dead_stores(f))
        made = share_calls(replace(f, body=body), self._is_library)
        return f if made.body == f.body else replace(made, calls=_calls(made.body))

    def _is_library(self, name: str) -> bool:
        return _is_library(self.functions[name])

    def special(self, name: str, known: tuple[Constant | None, ...]) -> ir.Function | None:
        """The function of this name for these constant arguments."""
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
        """`matmul_9_9_9__f_x`: the constants by name, x for what is not known."""
        text = f"{name}__{'_'.join('x' if c is None else c.name for c in known)}"
        taken, count = text, 2
        while taken in self.functions:
            taken, count = f"{text}_{count}", count + 1
        return taken


class _Body:
    """Rewrites the body of one function. Nothing that it does not change is copied."""

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
        """A library function that is one expression of whole arrays (kf_predict_cov), with its arguments put in: where those are
        places, so that nothing is computed twice."""
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
        """a + c, c + a and a - c for a constant c: what is added where c is not zero."""
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
        """The value of an array that is known here; of integers nothing is asked."""
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
    """The expression with its locals replaced; None where it has other parts than calls, sums and products of whole arrays."""
    if isinstance(e, ir.Local):
        return given[e.name]
    if not isinstance(e, ir.Call | ir.Elementwise):
        return None
    args = tuple(found for a in e.args if (found := _put_in(a, given)) is not None)
    return replace(e, args=args) if len(args) == len(e.args) else None


def _is_library(f: ir.Function) -> bool:
    return f.span.source.name.startswith("<library>/")


def _calls(body: tuple[ir.Stmt, ...]) -> tuple[str, ...]:
    """Every function that a body calls, each once."""
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
