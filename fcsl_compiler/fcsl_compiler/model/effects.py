# SPDX-License-Identifier: Apache-2.0
"""Effects of an algorithm outside the machine, and faults that can follow them."""

from __future__ import annotations

from ..base.diagnostics import DiagnosticSink
from ..base.source import SourceFile
from . import ir
from .types import BOOL, U32, Scalar


def _builtin(name: str, arguments: dict[str, Scalar], result: Scalar | None, doc: str) -> tuple[str, ir.Extern, str]:
    header = ir.HARDWARE_HEADER
    declared = SourceFile(header, "").whole()
    return name, ir.Extern(f"fcsl_{name}", header, tuple(arguments.items()), result, declared), doc


_BUILTINS = (
    _builtin("hw_read_gpio", {"pin": U32}, BOOL, "level of a digital input; false without hardware."),
    _builtin("hw_write_gpio", {"pin": U32, "level": BOOL}, None, "sets a digital output."),
    _builtin("hw_read_adc", {"channel": U32}, U32, "raw counts of an analogue input; 0 without hardware."),
    _builtin("hw_read_u32", {"address": U32}, U32, "value of a board register or port; 0 without hardware."),
    _builtin("hw_write_u32", {"address": U32, "value": U32}, None, "sets a board register or port."),
)

#: The hardware builtins by name.
HARDWARE: dict[str, ir.Extern] = {name: function for name, function, _ in _BUILTINS}
HARDWARE_DOC: dict[str, str] = {name: doc for name, _, doc in _BUILTINS}


def warn_fault_after_effect(body: tuple[ir.Stmt, ...], sink: DiagnosticSink) -> None:
    """W302: an `execute` that faults after an external write restores its outputs, but cannot undo the write."""
    _Walk(sink).body(body, None)


class _Walk:
    def __init__(self, sink: DiagnosticSink):
        self.sink = sink

    def body(self, statements: tuple[ir.Stmt, ...], written: ir.Effect | None) -> ir.Effect | None:
        """The first effect that may have occurred by the end of these statements."""
        for s in statements:
            if written is not None and any(map(can_fault, ir.expressions(s))):
                self._warn(s, written)
            if isinstance(s, ir.Effect) and s.function.result is None:
                written = written or s
            elif isinstance(s, ir.If):
                then, otherwise = self.body(s.then, written), self.body(s.otherwise, written)
                written = then or otherwise
            elif isinstance(s, ir.For):
                # A statement before an effect in a loop runs after it in the next iteration.
                inside = (e for e in ir.walk(s.body) if isinstance(e, ir.Effect) and e.function.result is None)
                written = written or next(inside, None)
                self.body(s.body, written)
        return written

    def _warn(self, s: ir.Stmt, written: ir.Effect) -> None:
        self.sink.warning(
            "W302",
            "this may fault after something was written outside the machine",
            s.span,
            why="a fault restores outputs and state, but not a write outside the machine",
            help="compute first, write last",
            notes=[(written.span, "written here")],
        )


def can_fault(e: ir.Expr) -> bool:
    """Whether evaluating this expression or a part of it may fault."""
    if isinstance(e, ir.Apply | ir.Call) and e.fault:
        return True
    if isinstance(e, ir.Elementwise) and e.op.faults:
        return True
    if isinstance(e, ir.Element | ir.Slice) and any(e.checked):
        return True
    return any(map(can_fault, ir.children(e)))
