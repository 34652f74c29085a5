# SPDX-License-Identifier: Apache-2.0
"""Counts the operations of an algorithm in its lowered IR: without terms of structural zeros, and before any
optimisation by the C compiler."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import replace

from ..check.intervals import interval
from ..model import ir
from ..model.events import MOST_VALUES
from ..model.ops import Op
from ..model.program import Program
from ..model.types import Scalar, count_of

#: Kinds listed in every count, in display order. Functions are counted by name.
KINDS = ("add", "multiply", "divide", "compare", "bits", "convert", "branch", "load", "store")

_PLAIN = {
    "add": ("+", "-", "neg", "abs", "wrap_add", "wrap_sub", "sat_add", "sat_sub"),
    "multiply": ("*", "wrap_mul", "sat_mul"),
    "divide": ("/", "//", "%"),
    "compare": ("==", "!=", "<", "<=", ">", ">=", "min", "max", "isnan", "isinf", "isfinite"),
    "bits": ("&", "|", "^", "~", "<<", ">>", "not"),
    "convert": tuple(p + t for p in ("", "wrap_", "sat_") for t in ("i32", "i64", "u32", "u64", "f32", "f64")),
}
_KIND_OF = {name: Counter({kind: 1}) for kind, names in _PLAIN.items() for name in names}
_KIND_OF |= {
    "clamp": Counter(compare=2),
    "assert": Counter(branch=1),
    "sign": Counter(compare=2),
    "where": Counter(compare=1),
    "**0": Counter(),
    "**2": Counter(multiply=1),
    "**3": Counter(multiply=2),
    "**4": Counter(multiply=3),
}


def operations(function: ir.Function, program: Program) -> Counter[str]:
    """Maximum number of operations of each kind in one call, callees included.

    Loops count with their number of iterations. Of two branches, the one with more operations of a kind counts. Checks
    of indices and overflows are not counted. `load` and `store` are scalars read from and written to arrays, structs
    and the fields of an instance. Scalar locals are free, and so are array arguments, which C passes by address.
    """
    return _Counting(program).of(function)


class _Counting:
    def __init__(self, program: Program):
        self.program = program
        self.known: dict[str, Counter[str]] = {}

    def of(self, f: ir.Function) -> Counter[str]:
        if f.name not in self.known:
            self.known[f.name] = self._body(f.body, {})
        return self.known[f.name]

    def _body(self, statements: Iterable[ir.Stmt], turn: dict[str, int]) -> Counter[str]:
        total: Counter[str] = Counter()
        for s in statements:
            total += self._statement(s, turn)
        return total

    def _statement(self, s: ir.Stmt, turn: dict[str, int]) -> Counter[str]:
        if isinstance(s, ir.Assign):
            return self._value(s.value) + self._store(s.target, s.value)
        if isinstance(s, ir.If):
            branches = self._body(s.then, turn) | self._body(s.otherwise, turn)
            return self._value(s.condition) + branches + Counter(branch=1)
        if isinstance(s, ir.For):
            return self._for(s, turn)
        if isinstance(s, ir.Effect):
            target = self._store(s.target, None) if s.target is not None else Counter()
            return sum(map(self._argument, s.args), Counter({s.function.name: 1})) + target
        if isinstance(s, ir.Event):
            return sum(map(self._value, s.args), Counter(store=1 + MOST_VALUES, branch=1))
        if isinstance(s, ir.Return) and s.value is not None:
            written = 0 if isinstance(s.value.type, Scalar) or isinstance(s.value, ir.Call) else count_of(s.value.type)
            return self._value(s.value) + Counter(store=written)
        return Counter()

    def _for(self, s: ir.For, turn: dict[str, int]) -> Counter[str]:
        turns = range(_at(s.start, turn), _at(s.stop, turn), s.step)
        if not any(isinstance(inner, ir.For) and _reads(inner, s.variable) for inner in ir.walk(s.body)):
            once = self._body(s.body, turn)
            return _times(len(turns), once)
        return sum((self._body(s.body, turn | {s.variable: value}) for value in turns), Counter())

    def _store(self, target: ir.Place, value: ir.Expr | None) -> Counter[str]:
        """Stores of an assignment. A function stores its result directly in the target, and its own count includes
        this."""
        plain = isinstance(target, ir.Local) and isinstance(target.type, Scalar)
        given = isinstance(value, ir.Call) and not isinstance(value.type, Scalar)
        return self._subscripts(target) + Counter(store=0 if plain or given else count_of(target.type))

    def _subscripts(self, place: ir.Place) -> Counter[str]:
        total: Counter[str] = Counter()
        while isinstance(place, ir.Member | ir.Element | ir.Slice):
            total += sum(map(self._value, ir.children(place)[1:]), Counter())
            place = place.base
        return total

    def _argument(self, e: ir.Expr) -> Counter[str]:
        if isinstance(e, ir.Place) and not isinstance(e.type, Scalar):
            return self._subscripts(e)
        return self._value(e)

    def _value(self, e: ir.Expr) -> Counter[str]:
        if isinstance(e, ir.Place):
            free = isinstance(e, ir.Local) and isinstance(e.type, Scalar)
            return self._subscripts(e) + Counter(load=0 if free else count_of(e.type))
        if isinstance(e, ir.Choose):
            return self._value(e.condition) + (self._value(e.then) | self._value(e.otherwise)) + Counter(branch=1)
        if isinstance(e, ir.Call):
            return sum(map(self._argument, e.args), Counter()) + self.of(self.program.functions[e.function])
        own: Counter[str] = Counter()
        if isinstance(e, ir.Apply):
            own = _kind(e.op)
        elif isinstance(e, ir.Elementwise):
            own = _times(count_of(e.type), _kind(e.op))
        elif isinstance(e, ir.Adjust):
            own = _times(sum(v != 0.0 for v in e.values), _kind(e.op))
            if e.constant is not None:  # a loop over a table that tests each element
                own += Counter(compare=len(e.values), branch=len(e.values))
        return sum(map(self._value, ir.children(e)), Counter()) + own


def _times(factor: int, counts: Counter[str]) -> Counter[str]:
    return Counter({kind: factor * n for kind, n in counts.items()})


def _kind(op: Op) -> Counter[str]:
    return _KIND_OF.get(op.name) or (Counter() if op.name == "**0" else Counter({op.name: 1}))


def _reads(loop: ir.For, variable: str) -> bool:
    def read(e: ir.Expr) -> bool:
        return isinstance(e, ir.RangeVar) and e.name == variable or any(map(read, ir.children(e)))

    return read(loop.start) or read(loop.stop)


def _at(bound: ir.Expr, turn: dict[str, int]) -> int:
    """Value of a loop bound, for given values of outer loop variables."""
    found = interval(_pinned(bound, turn))
    assert found is not None and found[0] == found[1], "the checker rejects other bounds"
    return found[0]


def _pinned(e: ir.Expr, turn: dict[str, int]) -> ir.Expr:
    if isinstance(e, ir.RangeVar) and e.name in turn:
        return replace(e, low=turn[e.name], high=turn[e.name])
    return replace(e, args=tuple(_pinned(a, turn) for a in e.args)) if isinstance(e, ir.Apply) else e
