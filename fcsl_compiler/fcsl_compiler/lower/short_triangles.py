# SPDX-License-Identifier: Apache-2.0
"""Writes out short loops of the library where the bounds of an inner loop depend on an outer one, as when a 3 × 3 matrix
is eliminated.

C compilers do not know the length of such inner loops, so that the elements stay in memory. Written out, all indices are
constants and the elements are in registers (measured: ldl_solve of 3 rows and 6 columns takes 71 cycles instead of 165).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from itertools import islice
from typing import Any

from ..check.folding import fold
from ..model import ir

#: Loops with more iterations stay.
_MOST_ROUNDS = 8
#: Loops that would become more statements stay.
_MOST_STATEMENTS = 256


def without_short_triangles(body: tuple[ir.Stmt, ...]) -> tuple[ir.Stmt, ...]:
    """The statements of a function, with such loops written out."""
    return tuple(made for s in body for made in _statement(s))


def taken(body: tuple[ir.Stmt, ...]) -> tuple[ir.Stmt, ...]:
    """The statements of a function, with the branch that is taken in place of an `if` on its sizes."""
    made: list[ir.Stmt] = []
    for s in body:
        condition = fold(s.condition) if isinstance(s, ir.If) else None
        if isinstance(s, ir.If) and isinstance(condition, ir.Const):
            made += s.then if condition.value else s.otherwise
        else:
            made.append(s)
    return tuple(made)


def _statement(s: ir.Stmt) -> tuple[ir.Stmt, ...]:
    if not isinstance(s, ir.For):
        return (s,)
    if _is_short(s) and _bounds_another(s):
        made = tuple(islice(_turns(s), _MOST_STATEMENTS + 1))
        if sum(1 for _ in ir.walk(made)) <= _MOST_STATEMENTS:
            return made
    body = without_short_triangles(s.body)
    return (s if body == s.body else replace(s, body=body),)


def _is_short(loop: ir.For) -> bool:
    rounds = ir.constant_rounds(loop)
    leaves = any(isinstance(s, ir.Break | ir.Continue | ir.Return) for s in ir.walk(loop.body))
    return rounds is not None and rounds <= _MOST_ROUNDS and not leaves


def _bounds_another(loop: ir.For) -> bool:
    """Whether the bounds of a loop in it depend on its variable."""
    inner = (s for s in ir.walk(loop.body) if isinstance(s, ir.For))
    return any(_reads(bound, loop.variable) for s in inner for bound in (s.start, s.stop))


def _reads(e: ir.Expr, variable: str) -> bool:
    return (isinstance(e, ir.RangeVar) and e.name == variable) or any(_reads(c, variable) for c in ir.children(e))


def _turns(loop: ir.For) -> Iterator[ir.Stmt]:
    """The iterations of a loop one after the other. Short loops in them are written out, too."""
    assert isinstance(loop.start, ir.Const) and isinstance(loop.stop, ir.Const)
    for value in range(int(loop.start.value), int(loop.stop.value), loop.step):
        for s in loop.body:
            turn = _put_in(s, loop.variable, value)
            if isinstance(turn, ir.For) and _is_short(turn):
                yield from _turns(turn)
            else:
                yield from _statement(turn)


def _put_in(node: Any, variable: str, value: int) -> Any:
    """The IR with the variable of a loop replaced by its value."""
    if isinstance(node, ir.RangeVar) and node.name == variable:
        return ir.Const(node.type, value, node.span)
    if isinstance(node, tuple):
        return tuple(_put_in(n, variable, value) for n in node)
    if not is_dataclass(node) or isinstance(node, type) or type(node).__module__ != ir.__name__:
        return node
    made: Any = replace(node, **{f.name: _put_in(getattr(node, f.name), variable, value) for f in fields(node)})
    return fold(made) if isinstance(made, ir.Apply) and made.op.result.is_integer else made
