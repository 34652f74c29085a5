# SPDX-License-Identifier: Apache-2.0
"""Which loops the C compiler is told to unroll: short ones over few elements.

Left alone, gcc turns a loop over two or three elements into vector instructions and only then unrolls it. The elements then
live in memory, and are loaded in pairs across the places that they were stored to one by one, for which the processor waits
(measured: the bodies of the lander take 107 ns so, and 87 ns unrolled). Unrolled first, they stay in registers.
"""

from __future__ import annotations

from collections.abc import Iterator

from ..model import ir
from ..model.types import count_of
from .c_writer import CWriter

_MOST_ROUNDS = 4
#: Operations of all rounds together, those of inner loops too.
_MOST_OPERATIONS = 256


def unroll(w: CWriter, rounds: int) -> None:
    """On the line before a loop of so many rounds, which does one thing."""
    if rounds <= _MOST_ROUNDS:
        w.line(f"#pragma GCC unroll {_MOST_ROUNDS}")


def unroll_for(w: CWriter, loop: ir.For) -> None:
    """On the line before a loop of the language."""
    if 0 < _operations(loop) <= _MOST_OPERATIONS:
        w.line(f"#pragma GCC unroll {_MOST_ROUNDS}")


def _operations(loop: ir.For) -> int:
    """What all rounds come to, about, inner loops unrolled too; 0 where one of these loops is not short, or calls something."""
    rounds, total = _rounds(loop), 0
    for s in _own(loop.body):
        if isinstance(s, ir.Effect) or any(map(_calls, ir.expressions(s))):
            return 0
        inner = _operations(s) if isinstance(s, ir.For) else 1
        if inner == 0:
            return 0
        total += inner + sum(map(_nodes, ir.expressions(s)))
    return rounds * total


def _own(body: tuple[ir.Stmt, ...]) -> Iterator[ir.Stmt]:
    """The statements of one round, those of branches too, but not those of inner loops."""
    for s in body:
        yield s
        if isinstance(s, ir.If):
            yield from _own(s.then)
            yield from _own(s.otherwise)


def _rounds(loop: ir.For) -> int:
    """Of a loop with constant bounds, and few of them; else 0."""
    if not (isinstance(loop.start, ir.Const) and isinstance(loop.stop, ir.Const)):
        return 0
    assert isinstance(loop.start.value, int) and isinstance(loop.stop.value, int)
    rounds = len(range(loop.start.value, loop.stop.value, loop.step))
    return rounds if rounds <= _MOST_ROUNDS else 0


def _calls(e: ir.Expr) -> bool:
    return isinstance(e, ir.Call) or any(map(_calls, ir.children(e)))


def _nodes(e: ir.Expr) -> int:
    own = count_of(e.type) if isinstance(e, ir.Elementwise) else 1
    return own + sum(map(_nodes, ir.children(e)))
