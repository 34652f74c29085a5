# SPDX-License-Identifier: Apache-2.0
"""Removes dead fills: `c = zeros(…)` if every element of c is assigned before any is read."""

from __future__ import annotations

from ..model import ir
from ..model.types import shape_of


def without_dead_fills(f: ir.Function) -> tuple[ir.Stmt, ...]:
    """The statements of a function without redundant fills. A fill at the beginning is redundant if the array is still
    zero, or if loops assign all its elements before it is returned."""
    body, returned = f.body, f.returned
    kept: list[ir.Stmt] = []
    for n, s in enumerate(body):
        if not (_is_fill(s) and (_is_fresh(s, returned, kept) or _is_covered(s, body, body[n + 1 :]))):
            kept.append(s)
    return body if len(kept) == len(body) else tuple(kept)


def _is_fresh(fill: ir.Stmt, returned: str, before: list[ir.Stmt]) -> bool:
    """Whether the array still has its declared value of zero. A returned array lies in the storage of the caller and is
    not known to be zero."""
    assert isinstance(fill, ir.Assign) and isinstance(fill.target, ir.Local)
    return not before and fill.target.name != returned


def _is_fill(s: ir.Stmt) -> bool:
    if not (isinstance(s, ir.Assign) and isinstance(s.target, ir.Local) and isinstance(s.value, ir.ArrayValue)):
        return False
    return all(isinstance(i, ir.Const) and i.value == 0 and str(i.value)[0] != "-" for i in s.value.items)


def _is_covered(fill: ir.Stmt, body: tuple[ir.Stmt, ...], after: tuple[ir.Stmt, ...]) -> bool:
    assert isinstance(fill, ir.Assign) and isinstance(fill.target, ir.Local)
    array = fill.target
    if sum(isinstance(s, ir.Return) for s in ir.walk(body)) != 1:
        return False
    loop = next((s for s in after if isinstance(s, ir.For) and _covers(s, array, {})), None)
    if loop is None:
        return False
    first = loop.body[0]
    by_rows = isinstance(first, ir.For) and _covers(first, array, {loop.variable: _extent(loop)})
    rest = tuple(s for s in body if s is not loop and not isinstance(s, ir.Return))
    reads = [*_reads(rest, array.name), *_reads(loop.body[:1], array.name)]
    later = _reads(loop.body[1:], array.name)
    # Later statements of the loop may read a row that its first statement has filled.
    return not reads and all(by_rows and row == loop.variable for row in later)


def _reads(body: tuple[ir.Stmt, ...], name: str) -> list[str]:
    """For each read of the array, its first index if that is a loop variable, else ""."""
    found: list[str] = []

    def visit(e: ir.Expr) -> None:
        if isinstance(e, ir.Element) and isinstance(e.base, ir.Local) and e.base.name == name:
            found.append(e.indices[0].name if isinstance(e.indices[0], ir.RangeVar) else "")
            subscripts = e.indices
        elif isinstance(e, ir.Local) and e.name == name:
            found.append("")
            subscripts = ()
        else:
            subscripts = ir.children(e)
        for child in subscripts:
            visit(child)

    for s in ir.walk(body):
        for e in ir.expressions(s):
            if isinstance(s, ir.Assign) and e is s.target:
                target = s.target.base if isinstance(s.target, ir.Element) else s.target
                if isinstance(target, ir.Local):  # the target is written, but its subscripts are read
                    for child in ir.children(s.target)[1:]:
                        visit(child)
                    continue
            visit(e)
    return found


def _extent(loop: ir.For) -> int:
    return int(loop.stop.value) if isinstance(loop.stop, ir.Const) else 0


def _covers(loop: ir.For, array: ir.Local, extents: dict[str, int]) -> bool:
    """Whether a loop, together with its enclosing loops, assigns every element."""
    start, stop = loop.start, loop.stop
    if not (isinstance(start, ir.Const) and start.value == 0 and isinstance(stop, ir.Const) and loop.step == 1):
        return False
    if any(isinstance(s, ir.Break | ir.Continue | ir.Return) for s in ir.walk(loop.body)):
        return False
    extents = {**extents, loop.variable: _extent(loop)}
    return any(
        _covers(s, array, extents) if isinstance(s, ir.For) else _assigns_all(s, array, extents) for s in loop.body
    )


def _assigns_all(s: ir.Stmt, array: ir.Local, extents: dict[str, int]) -> bool:
    """Whether a statement is `array[i, j] = …` or `array[i] = …` with indices that cover all their dimensions."""
    if not (isinstance(s, ir.Assign) and isinstance(s.target, ir.Element)):
        return False
    if not (isinstance(s.target.base, ir.Local) and s.target.base.name == array.name):
        return False
    indices = [i.name if isinstance(i, ir.RangeVar) else "" for i in s.target.indices]
    shape = shape_of(array.type)
    return len(set(indices)) == len(indices) and all(
        extents.get(name) == extent for name, extent in zip(indices, shape, strict=False)
    )
