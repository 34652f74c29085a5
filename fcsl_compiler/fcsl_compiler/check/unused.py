# SPDX-License-Identifier: Apache-2.0
"""Reports unused declarations: helpers (W301), locals (W303), outputs (W304), other ports (W305).

The check uses the syntax trees. Checked IR lacks the bodies of loops that never run, and therefore what they read.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from typing import TypeGuard

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..parse.python_source import span_of
from .algorithm_class import AlgorithmClass
from .declarations import Declarations

#: Message and reason for an unused port, by record.
_UNUSED = {
    "inputs": ("input `{}` is never read", "a connection to it has no effect"),
    "parameters": ("parameter `{}` is never read", "tuning it has no effect"),
    "state": ("state `{}` is neither written nor read", "it only takes memory"),
}


def warn_unused_helpers(declarations: Declarations, imported: Collection[str], sink: DiagnosticSink) -> None:
    """W301 for every helper that is never called. `imported`: helpers that other files import."""
    methods = (m for c in declarations.classes.values() for m in c.methods.values())
    called = {
        n.func.id
        for function in (*declarations.functions.values(), *methods)
        for n in ast.walk(function)
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
    }
    for name, node in declarations.functions.items():
        if name not in called and name not in imported:
            sink.warning("W301", f"`{name}` is never called", span_of(declarations.source, node), help="remove it")


def warn_unused_names(
    declarations: Declarations, used: Collection[str], filled: Collection[Span], sink: DiagnosticSink
) -> None:
    """W303 in the helpers of a file and in its classes that the machine uses; W304 and W305 for the ports of these
    classes.

    `filled`: declarations of the outputs that channels write.
    """
    for node in declarations.functions.values():
        _warn_unread_locals(declarations, None, _Uses.of([node]), sink)
    for class_ in (c for name, c in declarations.classes.items() if name in used):
        for method in class_.methods.values():
            _warn_unread_locals(declarations, class_, _Uses.of([method]), sink)
        execute = class_.methods.get("execute")
        if execute is not None and not all(map(_does_nothing, execute.body)):  # else a host writes them
            _warn_unused_ports(class_, _Uses.of(class_.methods.values()), filled, sink)


def _warn_unread_locals(
    declarations: Declarations, class_: AlgorithmClass | None, uses: _Uses, sink: DiagnosticSink
) -> None:
    for name, first in uses.bound.items():
        if name in uses.read or name.startswith("_"):
            continue
        found = class_.find(name) if class_ is not None else None
        if found is not None and found[0] in ("outputs", "state"):
            fix = f"did you mean `self.{name}`?"
        elif name in uses.given:
            fix = f"use it, or call it `_{name}`, where it is of no interest"
        else:
            fix = "remove it"
        sink.warning("W303", f"the local `{name}` is never read", span_of(declarations.source, first), help=fix)


def _warn_unused_ports(class_: AlgorithmClass, uses: _Uses, filled: Collection[Span], sink: DiagnosticSink) -> None:
    if class_.requests is not None and "transition_request" not in uses.written:
        why, fix = "the algorithm requests nothing", 'write `self.transition_request = "…"`, or remove it'
        sink.warning("W304", "output `transition_request` is never written", class_.requests, why=why, help=fix)
    for port in class_.ports["outputs"]:
        if port.name in uses.written or port.name in ("transition_request", "health") or port.span in filled:
            continue
        why, fix = "it stays zero", f"write `self.{port.name} = …`, or remove it"
        sink.warning("W304", f"output `{port.name}` is never written", port.span, why=why, help=fix)
    for record, (message, why) in _UNUSED.items():
        for port in class_.ports[record]:
            if port.name not in uses.fields and port.name not in uses.written:
                fix = f"use `self.{port.name}`, or remove it"
                sink.warning("W305", message.format(port.name), port.span, why=why, help=fix)


@dataclass
class _Uses:
    """Names that functions read and write. `x += 1` and `x[0] = 1` count as writes of x only."""

    bound: dict[str, ast.Name] = field(default_factory=dict)  # locals, at their first assignment
    given: set[str] = field(default_factory=set)  # locals assigned by unpacking or from a call
    read: set[str] = field(default_factory=set)
    written: set[str] = field(default_factory=set)  # fields
    fields: set[str] = field(default_factory=set)  # fields that are read

    @classmethod
    def of(cls, functions: Iterable[ast.FunctionDef]) -> _Uses:
        uses = cls()
        for function in functions:
            nodes = list(ast.walk(function))
            roots: set[int] = set()
            for node in nodes:
                if isinstance(node, ast.Assign | ast.AugAssign | ast.AnnAssign):
                    targets = node.targets if isinstance(node, ast.Assign) else [node.target]
                    roots.update(id(uses._write(target, node)) for target in _flat(targets))
            for node in nodes:
                if id(node) in roots:
                    continue
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Load):
                    uses.read.add(node.id)
                elif _is_field(node):
                    uses.fields.add(node.attr)
        return uses

    def _write(self, target: ast.expr, by: ast.Assign | ast.AugAssign | ast.AnnAssign) -> ast.expr:
        """Records an assignment. Returns the node of the variable that it changes, wholly or in part."""
        root = target
        while isinstance(root, ast.Attribute | ast.Subscript) and not _is_field(root):
            root = root.value
        if isinstance(root, ast.Name):
            if (root.lineno, root.col_offset) < _location(self.bound.get(root.id)):
                self.bound[root.id] = root
            if isinstance(by.value, ast.Call) or (isinstance(by, ast.Assign) and target not in by.targets):
                self.given.add(root.id)
        elif isinstance(root, ast.Attribute):
            self.written.add(root.attr)
        return root


def _flat(targets: Iterable[ast.expr]) -> Iterable[ast.expr]:
    """The targets, with `a, b = …` expanded."""
    for target in targets:
        yield from target.elts if isinstance(target, ast.Tuple | ast.List) else (target,)


def _location(node: ast.Name | None) -> tuple[float, float]:
    return (node.lineno, node.col_offset) if node is not None else (float("inf"), 0)


def _is_field(node: ast.AST) -> TypeGuard[ast.Attribute]:
    """Whether a node is `self.name`."""
    return isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name) and node.value.id == "self"


def _does_nothing(node: ast.stmt) -> bool:
    """Whether a statement is `pass`, `...` or a docstring."""
    return isinstance(node, ast.Pass) or (isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant))
