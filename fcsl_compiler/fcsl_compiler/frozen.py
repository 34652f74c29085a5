# SPDX-License-Identifier: Apache-2.0
"""Frozen parameters: the functions of an instance with its own parameter values in place of the parameters."""

from __future__ import annotations

from dataclasses import fields, is_dataclass, replace
from typing import Any

from . import ir
from .types import Scalar


class Freezer:
    """Rewrites the functions of one instance. Its constants are called `alg_<algorithm>__<instance>`."""

    def __init__(self, algorithm: ir.Algorithm, instance: str, values: dict[str, tuple[bool | int | float, ...]]):
        self.owner, self.values = f"{algorithm.owner}__{instance}", values

    def function(self, f: ir.Function) -> ir.Function:
        """The function, under a name of its own."""
        frozen: ir.Function = self._rewrite(replace(f, name=f"{self.owner}__{f.source_name}"))
        return frozen

    def _rewrite(self, node: Any) -> Any:
        """IR is a tree of frozen dataclasses and tuples; all but the frozen fields stays what it is."""
        if isinstance(node, ir.Field) and node.record == "parameters" and node.name in self.values:
            return self._constant(node)
        if isinstance(node, tuple):
            return tuple(map(self._rewrite, node))
        if not is_dataclass(node) or isinstance(node, type) or type(node).__module__ != ir.__name__:
            return node
        return replace(node, **{f.name: self._rewrite(getattr(node, f.name)) for f in fields(node)})

    def _constant(self, field: ir.Field) -> ir.Expr:
        if isinstance(field.type, Scalar):
            return ir.Const(field.type, self.values[field.name][0], field.span)
        return ir.ModuleConst(field.type, self.owner, field.name, field.span)
