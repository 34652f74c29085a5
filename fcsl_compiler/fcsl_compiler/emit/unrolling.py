# SPDX-License-Identifier: Apache-2.0
"""Selects loops that the C compiler must unroll: short loops over few elements.

By default gcc first vectorises a loop over two or three elements and then unrolls it. The elements then stay in memory.
Pairs are loaded across elements that were stored one by one, which stalls the processor (measured: the lander's
algorithms take 107 ns this way and 87 ns unrolled). If unrolled first, the elements stay in registers.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..model import ir
from ..model.types import count_of

_MOST_ROUNDS = 4
#: Maximum number of operations over all iterations, inner loops included.
_MOST_OPERATIONS = 256


def unrolled(rounds: int) -> int:
    """How many iterations of a loop with so many, and a single operation, the compiler should write out; 0: as it
    likes."""
    return _MOST_ROUNDS if rounds <= _MOST_ROUNDS else 0


def unrolled_for(loop: ir.For) -> int:
    """The same for a loop of the language, if it is short, or updates eight elements."""
    if _updates_eight(loop):
        return _MOST_ROUNDS
    return _MOST_ROUNDS if 0 < _operations(loop) <= _MOST_OPERATIONS else 0


def _updates_eight(loop: ir.For) -> bool:
    """Whether it updates each of eight elements of a local array, as a sum does. gcc makes vectors of such a loop only if
    it writes out a part of it (measured: matmul of 8 × 8 matrices takes 60 ns instead of 174)."""
    if ir.constant_rounds(loop) != 8 or len(loop.body) != 1:
        return False
    match loop.body[0]:
        case ir.Assign(
            target=ir.Element(base=ir.Local(name=row), indices=(ir.RangeVar(name=j),)),
            value=ir.Apply(args=(ir.Element(base=ir.Local(name=again), indices=(ir.RangeVar(name=same),)), _)),
        ):
            return (row, j) == (again, same)
    return False


def _operations(loop: ir.For) -> int:
    """Approximate number of operations over all iterations, inner loops included. 0 if a loop is not short or contains
    a call."""
    rounds, total = _rounds(loop), 0
    for s in _own(loop.body):
        if isinstance(s, ir.Effect | ir.Event) or any(map(_calls, ir.expressions(s))):
            return 0
        inner = _operations(s) if isinstance(s, ir.For) else 1
        if inner == 0:
            return 0
        total += inner + sum(map(_nodes, ir.expressions(s)))
    return rounds * total


def _own(body: tuple[ir.Stmt, ...]) -> Iterator[ir.Stmt]:
    """Statements of one iteration, branches included, inner loops excluded."""
    for s in body:
        yield s
        if isinstance(s, ir.If):
            yield from _own(s.then)
            yield from _own(s.otherwise)


def _rounds(loop: ir.For) -> int:
    """Number of iterations of a short loop with constant bounds, else 0."""
    rounds = ir.constant_rounds(loop)
    return rounds if rounds is not None and rounds <= _MOST_ROUNDS else 0


def _calls(e: ir.Expr) -> bool:
    return isinstance(e, ir.Call) or any(map(_calls, ir.children(e)))


def _nodes(e: ir.Expr) -> int:
    own = count_of(e.type) if isinstance(e, ir.Elementwise) else 1
    return own + sum(map(_nodes, ir.children(e)))
