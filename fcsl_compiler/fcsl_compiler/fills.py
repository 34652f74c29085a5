# SPDX-License-Identifier: Apache-2.0
"""Leaves out `c = zeros(…)` where every element of c is assigned before anything reads one."""

from __future__ import annotations

from . import ir
from .types import shape_of


def without_fills(f: ir.Function) -> tuple[ir.Stmt, ...]:
    """The statements of a function but for the fills that change nothing, at its beginning, and those that nothing sees: the
    array is only returned, after loops over all of it."""
    body, returned = f.body, f.returned
    kept: list[ir.Stmt] = []
    for n, s in enumerate(body):
        if not (_is_fill(s) and (_is_fresh(s, returned, kept) or _is_covered(s, body, body[n + 1 :]))):
            kept.append(s)
    return body if len(kept) == len(body) else tuple(kept)


def _is_fresh(fill: ir.Stmt, returned: str, before: list[ir.Stmt]) -> bool:
    """Whether the array is still as it was declared, all zero; what is returned lies in the storage of the caller."""
    assert isinstance(fill, ir.Assign) and isinstance(fill.target, ir.Local)
    return not before and fill.target.name != returned


def _is_fill(s: ir.Stmt) -> bool:
    if not (isinstance(s, ir.Assign) and isinstance(s.target, ir.Local) and isinstance(s.value, ir.ArrayValue)):
        return False
    return all(isinstance(i, ir.Const) and i.value == 0 and str(i.value)[0] != "-" for i in s.value.items)


def _is_covered(fill: ir.Stmt, body: tuple[ir.Stmt, ...], after: tuple[ir.Stmt, ...]) -> bool:
    assert isinstance(fill, ir.Assign) and isinstance(fill.target, ir.Local)
    if sum(isinstance(s, ir.Return) for s in ir.walk(body)) != 1 or _reads(body, fill.target.name):
        return False
    return any(isinstance(s, ir.For) and _covers(s, fill.target, {}) for s in after)


def _reads(body: tuple[ir.Stmt, ...], name: str) -> bool:
    """Whether a statement that is no `return name` reads the array or a part of it."""

    def reads(e: ir.Expr) -> bool:
        return (isinstance(e, ir.Local) and e.name == name) or any(map(reads, ir.children(e)))

    for s in ir.walk(body):
        if isinstance(s, ir.Return) and isinstance(s.value, ir.Local):
            continue
        read = ir.expressions(s)
        if isinstance(s, ir.Assign):
            target = s.target
            subscripts = ir.children(target)[1:] if isinstance(target, ir.Element) else ()
            whole = isinstance(target, ir.Local) or (
                isinstance(target, ir.Element) and isinstance(target.base, ir.Local)
            )
            read = (s.value, *subscripts) if whole else read
        if any(map(reads, read)):
            return True
    return False


def _covers(loop: ir.For, array: ir.Local, extents: dict[str, int]) -> bool:
    """Whether a loop, with those around it, assigns every element."""
    start, stop = loop.start, loop.stop
    if not (isinstance(start, ir.Const) and start.value == 0 and isinstance(stop, ir.Const) and loop.step == 1):
        return False
    if any(isinstance(s, ir.Break | ir.Continue | ir.Return) for s in ir.walk(loop.body)):
        return False
    extents = {**extents, loop.variable: int(stop.value)}
    return any(
        _covers(s, array, extents) if isinstance(s, ir.For) else _assigns_all(s, array, extents) for s in loop.body
    )


def _assigns_all(s: ir.Stmt, array: ir.Local, extents: dict[str, int]) -> bool:
    """`array[i, j] = …` or `array[i] = …` where i and j run over all of their dimensions."""
    if not (isinstance(s, ir.Assign) and isinstance(s.target, ir.Element)):
        return False
    if not (isinstance(s.target.base, ir.Local) and s.target.base.name == array.name):
        return False
    indices = [i.name if isinstance(i, ir.RangeVar) else "" for i in s.target.indices]
    shape = shape_of(array.type)
    return len(set(indices)) == len(indices) and all(
        extents.get(name) == extent for name, extent in zip(indices, shape, strict=False)
    )
