# SPDX-License-Identifier: Apache-2.0
"""The coverage pass: adds probes that record which lines, outcomes and conditions of algorithms have run.

It works on checked IR, where every node has its location in the Python text. It runs before frozen parameters are folded,
so that all instances have the same conditions. Probes are calls of the functions in probes.py: a statement for a line,
and an identity on bool for a condition or a decision. They do not read or write the machine, and its results stay
bit-identical (test_cover.py compares them). Probes have effects, so this pass is the last.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from ..base.files import digest
from ..base.source import Span
from ..check.finite import with_finite_results
from ..check.frozen import Freezer
from ..check.intervals import interval
from ..model import ir, ops
from ..model.machine import Instance, Machine
from ..model.types import BOOL, I64, U64
from .probe_map import CoverMap, Decision, FileMap, Loop, location
from .probes import CONDITION, DECIDED, LINE, LOOP, SOUND

_ASSERTION = ops.assertion("").id
_COMPARISONS = frozenset(("<", "<=", ">", ">=", "==", "!="))


@dataclass(frozen=True)
class Covered:
    """The machine with its probes, and the meaning of each probe."""

    machine: Machine
    map: CoverMap


def instrument(machine: Machine, config: str) -> Covered:
    """Adds probes to every function of every algorithm. The numeric library and requirements have none. `config`: path of the machine
    JSON."""
    files: dict[str, FileMap] = {}
    for source in machine.sources:
        if source not in machine.made_sources and any(source.name in a.files for a in machine.algorithms):
            own = [a.name for a in machine.algorithms if a.source == source.name]  # empty for a file of helpers
            files[source.name] = FileMap(source.name, os.path.abspath(source.path), digest(source.text), own)
    found = CoverMap(machine.name, config, list(files.values()))

    def probed(function: ir.Function) -> ir.Function:
        file = files.get(function.span.source.name)
        return function if file is None else _Instrumenter(found, file, function).function()

    functions = {name: probed(f) for name, f in machine.program.functions.items()}
    entries = {f.name: probed(f) for a in machine.algorithms for f in (a.start, a.execute) if f is not None}
    instances = tuple(_instance(i, entries) for i in machine.instances)
    program = replace(machine.program, functions=functions)
    covered = replace(machine, program=program, instances=instances)
    _mark_constants(found, [*functions.values(), *(f for f, _ in covered.entries)])
    return Covered(covered, found)


def _instance(instance: Instance, entries: dict[str, ir.Function]) -> Instance:
    """The instance with the probed functions of its algorithm, as its own were made of them: frozen parameters folded, results
    checked."""
    algorithm = instance.algorithm
    execute = entries[algorithm.execute.name]
    start = entries[algorithm.start.name] if algorithm.start is not None else None
    values = {name: instance.parameters[name] for name in instance.frozen}
    if values:
        freezer = Freezer(algorithm, instance.identifier, values)
        execute, start = freezer.function(execute), freezer.function(start) if start is not None else None
    if instance.nan_fails:
        execute = with_finite_results(execute, algorithm)
        start = with_finite_results(start, algorithm) if start is not None else None
    return replace(instance, execute=execute, start=start)


# ---- one function ----------------------------------------------------------------------------------------------------


class _Instrumenter:
    """Rewrites one function. Its probes are recorded in the map of the file, which several algorithms share."""

    def __init__(self, found: CoverMap, file: FileMap, function: ir.Function):
        self.map, self.file, self.f = found, file, function
        self.locals: list[str] = []

    def function(self) -> ir.Function:
        body = self._body(self.f.body)
        return replace(self.f, body=body, locals=(*self.f.locals, *((name, U64) for name in self.locals)))

    def _take(self, count: int) -> int:
        """Allocates `count` words. Returns the first."""
        self.map.word_count += count
        return self.map.word_count - count

    # ---- statements ------------------------------------------------------------------------------------------------

    def _body(self, statements: tuple[ir.Stmt, ...]) -> tuple[ir.Stmt, ...]:
        out: list[ir.Stmt] = []
        for s in statements:
            if s.span.line not in self.file.lines:
                self.file.lines[s.span.line] = (location(s.span), self._take(1))
            word = self.file.lines[s.span.line][1]
            out.append(_probe(LINE, (_number(word, s.span), self._sound(s.span)), s.span))
            if isinstance(s, ir.For) and s.body and not _always_runs(s):
                out.append(self._loop(s))
            out.append(self._statement(s))
        return tuple(out)

    def _loop(self, s: ir.For) -> ir.Stmt:
        at = location(s.span)
        if at not in self.file.loops:
            self.file.loops[at] = Loop(at, self._take(2))
        operator = ops.find("<" if s.step > 0 else ">", (I64, I64))
        assert operator is not None
        enters = ir.Apply(BOOL, operator, (s.start, s.stop), False, s.span)
        return _probe(LOOP, (_number(self.file.loops[at].word, s.span), enters, self._sound(s.span)), s.span)

    def _sound(self, span: Span) -> ir.Expr:
        return ir.Apply(BOOL, SOUND, (), False, span) if self.f.faults else ir.Const(BOOL, True, span)

    def _statement(self, s: ir.Stmt) -> ir.Stmt:
        if isinstance(s, ir.If):
            condition = self._decision(s.condition, branch=True)
            return replace(s, condition=condition, then=self._body(s.then), otherwise=self._body(s.otherwise))
        if isinstance(s, ir.For):
            return replace(s, body=self._body(s.body))
        return _rebuilt(s, self._expr)

    # ---- expressions -----------------------------------------------------------------------------------------------

    def _expr(self, e: ir.Expr) -> ir.Expr:
        if isinstance(e, ir.Apply) and e.op.id == _ASSERTION:
            return e  # it decides nothing: no test can make it fail that should not
        if _operator(e) or _is_comparison(e):
            return self._decision(e, branch=False)
        if isinstance(e, ir.Choose):
            condition = self._decision(e.condition, branch=True)
            return replace(e, condition=condition, then=self._expr(e.then), otherwise=self._expr(e.otherwise))
        return _rebuilt(e, self._expr)

    def _decision(self, e: ir.Expr, *, branch: bool) -> ir.Expr:
        at = location(e.span)
        if at not in self.file.decisions:
            leaves: list[Span] = []
            tree = _tree(e, leaves)
            made = Decision(at, branch, tree, tuple(map(location, leaves)), self.map.word_count)
            self._take(made.words)
            self.file.decisions[at] = made
        decision = self.file.decisions[at]
        vector = ir.Local(U64, f"cover.{decision.word}", e.span)
        if vector.name not in self.locals:
            self.locals.append(vector.name)
        arguments = (_number(decision.word, e.span), _number(decision.slots, e.span))
        value = self._part(e, vector if decision.slots else None, iter(range(len(decision.conditions))))
        return ir.Apply(BOOL, DECIDED[self.f.faults], (vector, *arguments, value), False, e.span)

    def _part(self, e: ir.Expr, vector: ir.Local | None, numbers: Any) -> ir.Expr:
        """Keeps the operators of a decision. Each condition records its value in the vector."""
        if isinstance(e, ir.Let):
            return replace(e, value=self._expr(e.value), body=self._part(e.body, vector, numbers))
        operator = _operator(e)
        if operator == "not":
            assert isinstance(e, ir.Apply)
            return replace(e, args=(self._part(e.args[0], vector, numbers),))
        if operator:
            assert isinstance(e, ir.Choose)
            left = self._part(e.condition, vector, numbers)
            if operator == "and":
                return replace(e, condition=left, then=self._part(e.then, vector, numbers))
            return replace(e, condition=left, otherwise=self._part(e.otherwise, vector, numbers))
        value = _rebuilt(e, self._expr) if _is_comparison(e) else self._expr(e)
        if vector is None:
            return value
        return ir.Apply(BOOL, CONDITION, (vector, _number(next(numbers), e.span), value), False, e.span)


def _probe(name: str, args: tuple[ir.Expr, ...], span: Span) -> ir.Effect:
    arguments = tuple((f"a{n}", a.type) for n, a in enumerate(args))
    return ir.Effect(ir.Extern(name, "fcsl/fcsl_cover.h", arguments, None, span), args, None, span)


def _number(value: int, span: Span) -> ir.Const:
    return ir.Const(I64, value, span)


def _rebuilt(node: Any, rewrite: Callable[[ir.Expr], ir.Expr]) -> Any:
    """A statement or expression with its direct expressions rewritten."""

    def part(value: Any) -> Any:
        if isinstance(value, tuple):
            return tuple(map(part, value))
        return rewrite(value) if isinstance(value, ir.Expr) else value

    return replace(node, **{f.name: part(getattr(node, f.name)) for f in fields(node)})


def _always_runs(s: ir.For) -> bool:
    start, stop = interval(s.start), interval(s.stop)
    assert start and stop
    return stop[0] > start[1] if s.step > 0 else stop[1] < start[0]


def _is_comparison(e: ir.Expr) -> bool:
    return isinstance(e, ir.Apply) and e.op.name in _COMPARISONS


def _operator(e: ir.Expr) -> str:
    """`and`, `or`, `not`, or "" for a condition or a non-bool. A chain of comparisons is an `and` of them.

    The checker gives the constant of `and` and `or` the span of the whole expression; a constant in the source has its
    own span.
    """
    if isinstance(e, ir.Let):
        return _operator(e.body)
    if isinstance(e, ir.Apply) and e.op.name == "not":
        return "not"
    if isinstance(e, ir.Choose) and e.type == BOOL:
        for constant, value, word in ((e.otherwise, False, "and"), (e.then, True, "or")):
            if isinstance(constant, ir.Const) and constant.value is value and constant.span == e.span:
                return word
    return ""


def _tree(e: ir.Expr, leaves: list[Span], whole: Span | None = None) -> Any:
    """The decision as an mcdc.Tree. Appends the locations of its conditions. `whole`: the chain that e is a part of."""
    if isinstance(e, ir.Let):
        return _tree(e.body, leaves, whole)
    operator = _operator(e)
    if operator == "not":
        assert isinstance(e, ir.Apply)
        return ["not", _tree(e.args[0], leaves)]
    if operator:
        assert isinstance(e, ir.Choose)
        right = e.then if operator == "and" else e.otherwise
        return [operator, _tree(e.condition, leaves, e.span), _tree(right, leaves, e.span)]
    if e.span == whole and isinstance(e, ir.Apply):
        first, last = e.args[0].span, e.args[-1].span
        leaves.append(Span(first.source, first.line, first.column, last.end_line, last.end_column))
    else:
        leaves.append(e.span)
    return len(leaves) - 1


def _mark_constants(found: CoverMap, functions: list[ir.Function]) -> None:
    """Marks conditions that are constant in every function that evaluates them: literals, and parameters that all
    instances freeze."""
    constant: dict[str, set[int]] = {}
    varying: dict[str, set[int]] = {}

    def leaf(name: str, number: int, value: ir.Expr) -> None:
        (constant if isinstance(value, ir.Const) else varying).setdefault(name, set()).add(number)

    def walk(e: ir.Expr) -> None:
        if isinstance(e, ir.Apply) and (e.op is CONDITION or e.op in DECIDED.values()):
            assert isinstance(e.args[0], ir.Local)
            if e.op is CONDITION and isinstance(e.args[1], ir.Const):
                leaf(e.args[0].name, int(e.args[1].value), e.args[2])
            elif e.op in DECIDED.values() and isinstance(e.args[2], ir.Const) and e.args[2].value == 0:
                leaf(e.args[0].name, 0, e.args[3])
        for child in ir.children(e):
            walk(child)

    for function in functions:
        for s in ir.walk(function.body):
            for e in ir.expressions(s):
                walk(e)
    for file in found.files:
        for at, decision in file.decisions.items():
            name = f"cover.{decision.word}"
            only = constant.get(name, set()) - varying.get(name, set())
            file.decisions[at] = replace(decision, constant=tuple(sorted(only)))
