# SPDX-License-Identifier: Apache-2.0
"""What the results of an `execute` depend on: the fields that it reads as they are before it, by value or by condition.

A result that depends on no field of `state` and on no output has no memory: equal inputs give it anew in each run. The
answer errs towards more dependencies.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from ..model import ir

#: A field by record and name; a local has no record.
Variable = tuple[str, str]
Sources = frozenset[Variable]
#: Stands for what an extern returns, which may remember anything.
OUTSIDE: Variable = ("outside", "")
#: Each run finds these empty.
_PULSES = (("outputs", "transition_request"), ("outputs", "health"))
_NOTHING: Sources = frozenset()


def dependencies(execute: ir.Function) -> Mapping[Variable, Sources]:
    """For each variable that is written, the fields that it depends on."""
    walk = _Walk()
    walk.body(execute.body, _NOTHING)
    return walk.known


def _of(known: Mapping[Variable, Sources], variable: Variable) -> Sources:
    is_read_first = variable[0] and variable not in _PULSES
    return known.get(variable, frozenset({variable}) if is_read_first else _NOTHING)


class _Walk:
    def __init__(self) -> None:
        self.known: dict[Variable, Sources] = {}
        self.exits = _NOTHING  # what decides whether the rest of the body runs

    def body(self, statements: tuple[ir.Stmt, ...], condition: Sources) -> None:
        for s in statements:
            if isinstance(s, ir.Assign):
                self._write(s.target, self._read([s.value]) | condition)
            elif isinstance(s, ir.Effect):
                if s.target is not None:
                    result = self._read(s.args) if s.is_hardware else frozenset({OUTSIDE})
                    self._write(s.target, result | condition)
            elif isinstance(s, ir.Event):
                pass
            elif isinstance(s, ir.If):
                self._branch(s, condition | self._read([s.condition]))
            elif isinstance(s, ir.For):
                self._loop(s, condition | self._read([s.start, s.stop]))
            else:
                self.exits |= condition

    def _read(self, expressions: Iterable[ir.Expr]) -> Sources:
        return _NOTHING.union(*(_of(self.known, v) for e in expressions for v in ir.variables(e)))

    def _write(self, target: ir.Place, sources: Sources) -> None:
        is_whole = isinstance(target, ir.Local | ir.Field) and not self.exits
        kept = _NOTHING if is_whole else self._read([target]) | self.exits
        self.known[ir.variable(target)] = sources | kept

    def _branch(self, s: ir.If, condition: Sources) -> None:
        before = dict(self.known)
        self.body(s.then, condition)
        then, self.known = self.known, before
        self.body(s.otherwise, condition)
        self._join(then)

    def _loop(self, s: ir.For, condition: Sources) -> None:
        """Walks the body until nothing is new."""
        settled = False
        while not settled:
            before, exits = dict(self.known), self.exits
            self.body(s.body, condition)
            self._join(before)
            settled = (self.known, self.exits) == (before, exits)

    def _join(self, other: Mapping[Variable, Sources]) -> None:
        """What holds where either of two ways was taken."""
        self.known = {v: _of(self.known, v) | _of(other, v) for v in {**self.known, **other}}
