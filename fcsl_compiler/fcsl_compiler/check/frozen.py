# SPDX-License-Identifier: Apache-2.0
"""Frozen parameters: replaces parameters by their values in the functions of one instance."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from ..model import ir
from ..model.effects import can_fault
from ..model.types import Scalar, shape_of
from .folding import DoesNotFit, fold
from .intervals import exact, fits, interval, is_static


class Freezer:
    """Rewrites the functions of one instance. Array constants get the owner `alg_<algorithm>__<instance>`."""

    def __init__(self, algorithm: ir.Algorithm, instance: str, values: dict[str, tuple[bool | int | float | str, ...]]):
        self.owner, self.values = f"{algorithm.owner}__{instance}", values
        self._ranges: dict[str, tuple[int, int]] = {}  # bounds of loop variables that the frozen values determine

    def function(self, f: ir.Function) -> ir.Function:
        """The rewritten function, with a name of its instance."""
        body: tuple[ir.Stmt, ...] = self._rewrite(f.body)
        faults = any(can_fault(e) or _reads_fault(e) for s in ir.walk(body) for e in ir.expressions(s))
        return replace(f, name=f"{self.owner}__{f.source_name}", body=body, faults=faults)

    def _rewrite(self, node: Any) -> Any:
        """Rewrites IR (a tree of frozen dataclasses and tuples). Only frozen fields change."""
        if isinstance(node, ir.Field) and node.record == "parameters" and node.name in self.values:
            return self._constant(node)
        if isinstance(node, ir.For) and not (is_static(node.start) and is_static(node.stop)):
            return self._loop(node)
        if isinstance(node, ir.RangeVar) and node.name in self._ranges:
            low, high = self._ranges[node.name]
            return replace(node, low=low, high=high)
        if isinstance(node, tuple):
            return self._tuple(node)
        if not is_dataclass(node) or isinstance(node, type) or type(node).__module__ != ir.__name__:
            return node
        return self._narrowed(_folded(self._parts(node)))

    def _parts(self, node: Any) -> Any:
        return replace(node, **{f.name: self._rewrite(getattr(node, f.name)) for f in fields(node)})

    def _loop(self, node: ir.For) -> ir.For:
        """A loop whose bounds depend on a frozen parameter: sets the bounds of its variable. A loop that never runs
        gets an empty body."""
        node = replace(node, start=self._rewrite(node.start), stop=self._rewrite(node.stop))
        start, stop = interval(node.start), interval(node.stop)
        assert start and stop
        low, high = (start[0], stop[1] - 1) if node.step > 0 else (stop[0] + 1, start[1])
        if low > high:
            return replace(node, body=())
        self._ranges[node.variable] = low, high
        body = self._tuple(node.body)
        del self._ranges[node.variable]
        return replace(node, body=body)

    def _narrowed(self, node: Any) -> Any:
        """Removes checks in such a loop that the bounds prove unnecessary."""
        if not self._ranges:
            return node
        if isinstance(node, ir.Element):
            pairs = zip(node.indices, node.checked, shape_of(node.base.type), strict=False)
            return replace(node, checked=tuple(c and not _is_within(i, extent) for i, c, extent in pairs))
        if isinstance(node, ir.Apply) and node.fault:
            bounds = exact(node.op, node.args)
            return replace(node, fault=not (bounds and fits(node.op, bounds)))
        return node

    def _tuple(self, items: tuple[Any, ...]) -> tuple[Any, ...]:
        """Rewrites a sequence. In a body, an `if` with a constant condition is replaced by the branch taken; statements
        after a jump are removed."""
        out: list[Any] = []
        for item in items:
            new = self._rewrite(item)
            if isinstance(new, ir.If) and isinstance(new.condition, ir.Const):
                out += new.then if new.condition.value else new.otherwise
            else:
                out.append(new)
            if out and isinstance(out[-1], ir.Return | ir.Break | ir.Continue):
                break
        return tuple(out)

    def _constant(self, field: ir.Field) -> ir.Expr:
        if isinstance(field.type, Scalar):
            return ir.Const(field.type, self.values[field.name][0], field.span)
        return ir.ModuleConst(field.type, self.owner, field.name, field.span)


def _is_within(index: ir.Expr, extent: int) -> bool:
    bounds = interval(index)
    return bounds is not None and 0 <= bounds[0] and bounds[1] < extent


def _reads_fault(e: ir.Expr) -> bool:
    """Whether the expression reads the fault flag without faulting itself. Only coverage probes do."""
    if isinstance(e, ir.Apply) and e.op.sees_fault:
        return True
    return any(map(_reads_fault, ir.children(e)))


def _folded(node: Any) -> Any:
    """Folds an operation on constants or a choice by a constant. An operation that would fault stays and faults at run
    time."""
    if isinstance(node, ir.Choose) and isinstance(node.condition, ir.Const) and isinstance(node.type, Scalar):
        return node.then if node.condition.value else node.otherwise  # a chosen array is not constant: see lower/
    try:
        return fold(node) if isinstance(node, ir.Apply) else node
    except DoesNotFit:
        return node
