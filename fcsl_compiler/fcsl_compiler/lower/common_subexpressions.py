# SPDX-License-Identifier: Apache-2.0
"""Removes repeated computations of arrays and temporaries for array sums. The arithmetic of each element does not
change.

- A library function called more than once with the same operands, none of which is written in between, is called once
  and its result kept in a local (H P in kf_gain
  and in kf_update_cov).
- `c = f(…) + q` becomes `c = f(…)`, then `c = c + q`, if nothing else in it reads c. This needs no temporary.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, cast

from ..model import ir
from ..model.effects import can_fault
from ..model.types import Array

Variable = tuple[str, str]
#: Key of an expression without its source position, with the number of earlier writes of each variable it reads.
Key = tuple[Any, ...]


def share_calls(f: ir.Function, is_library: Callable[[str], bool]) -> ir.Function:
    """Rewrites a function. Returns f itself if nothing changes. `is_library`: whether the function of a name is a
    (pure) library function."""
    found = _Sharing(f, is_library)
    body = found.block(f.body)
    return f if body == f.body else replace(f, body=body, locals=(*f.locals, *found.locals))


@dataclass(frozen=True)
class _Use:
    """A call in a statement of a block."""

    at: int
    call: ir.Call
    key: Key


class _Sharing:
    def __init__(self, f: ir.Function, is_library: Callable[[str], bool]):
        self.function, self.is_library = f, is_library
        self.locals: list[tuple[str, Array]] = []

    def block(self, body: tuple[ir.Stmt, ...]) -> tuple[ir.Stmt, ...]:
        """Rewrites the statements of one block, which are executed in sequence."""
        while (again := self._first_repeated(body)) is not None:
            body = self._called_once(body, again)
        done: list[ir.Stmt] = []
        for s in body:
            if isinstance(s, ir.If):
                done.append(replace(s, then=self.block(s.then), otherwise=self.block(s.otherwise)))
            elif isinstance(s, ir.For):
                done.append(replace(s, body=self.block(s.body)))
            else:
                done += _in_place(s) if isinstance(s, ir.Assign) else [s]
        return tuple(done)

    def _first_repeated(self, body: tuple[ir.Stmt, ...]) -> list[_Use] | None:
        """The uses of the first call that occurs twice. Outer calls precede the calls in their arguments."""
        uses = list(self._uses(body))
        counts = Counter(use.key for use in uses)
        key = next((use.key for use in uses if counts[use.key] > 1), None)
        return None if key is None else [use for use in uses if use.key == key]

    def _called_once(self, body: tuple[ir.Stmt, ...], uses: list[_Use]) -> tuple[ir.Stmt, ...]:
        first = uses[0]
        local = ir.Local(first.call.type, f"common.{len(self.locals) + 1}", first.call.span)
        self.locals.append((local.name, cast(Array, local.type)))
        calls = {id(use.call) for use in uses}
        changed = list(body)
        for at in {use.at for use in uses}:
            s = cast(ir.Assign, body[at])
            changed[at] = replace(s, value=_replaced(s.value, calls, local))
        changed.insert(first.at, ir.Assign(local, first.call, body[first.at].span))
        return tuple(changed)

    def _uses(self, body: tuple[ir.Stmt, ...]) -> Iterator[_Use]:
        """Calls in assignments that are always evaluated. Other statements may write any variable."""
        written: Counter[Variable] = Counter()
        others = 0
        for at, s in enumerate(body):
            if not isinstance(s, ir.Assign):
                others += 1
                continue
            for call in self._calls(s.value):
                versions = tuple((v, written[v]) for v in sorted(ir.variables(call)))
                yield _Use(at, call, (others, versions, _shape(call)))
            written[ir.variable(s.target)] += 1

    def _calls(self, e: ir.Expr) -> Iterator[ir.Call]:
        if isinstance(e, ir.Call) and isinstance(e.type, Array) and not e.fault and self._is_plain(e):
            yield e
        for part in _parts(e):
            yield from self._calls(part)

    def _is_plain(self, e: ir.Expr) -> bool:
        """Whether a call is one of a library function with whole variables as arguments."""
        if isinstance(e, ir.Call):
            return self.is_library(e.function) and all(map(self._is_plain, e.args))
        return isinstance(e, ir.Local | ir.Field | ir.ModuleConst)


def _shape(e: ir.Expr) -> Key:
    if isinstance(e, ir.Call):
        return (e.function, *map(_shape, e.args))
    assert isinstance(e, ir.Local | ir.Field | ir.ModuleConst)
    return (e.owner, e.name) if isinstance(e, ir.ModuleConst) else ("", *ir.variable(e))


def _parts(e: ir.Expr) -> tuple[ir.Expr, ...]:
    """Operands that are always evaluated. _replaced descends into the same operands."""
    if isinstance(e, ir.Adjust):
        return (e.base,)
    return e.args if isinstance(e, ir.Call | ir.Apply | ir.Elementwise) else ()


def _replaced(e: ir.Expr, calls: set[int], local: ir.Local) -> ir.Expr:
    if id(e) in calls:
        return replace(local, span=e.span)
    if isinstance(e, ir.Call | ir.Apply | ir.Elementwise):
        return replace(e, args=tuple(_replaced(a, calls, local) for a in e.args))
    if isinstance(e, ir.Adjust):
        return replace(e, base=_replaced(e.base, calls, local))
    return e


def _in_place(s: ir.Assign) -> list[ir.Stmt]:
    """Splits `c = f(…) + q` into two statements."""
    c, e = s.target, s.value
    if not (isinstance(c, ir.Local | ir.Field) and isinstance(e, ir.Elementwise) and e.op.result.is_float):
        return [s]
    calls = [a for a in e.args if isinstance(a, ir.Call) and a.type == e.type and not a.fault]
    if len(calls) != 1:
        return [s]
    if can_fault(calls[0]) and any(can_fault(a) for a in e.args if a is not calls[0]):
        return [s]  # the order of the two faults must not change
    written = ir.variable(c)
    if any(written in ir.variables(a) for a in e.args if a is not calls[0]):
        return [s]
    if any(isinstance(a, ir.Place) and ir.variable(a) == written for a in calls[0].args):
        return [s]  # the function reads it: its result would need a copy
    args = tuple(c if a is calls[0] else a for a in e.args)
    return [replace(s, value=calls[0]), replace(s, value=replace(e, args=args))]
