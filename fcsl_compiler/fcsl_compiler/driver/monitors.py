# SPDX-License-Identifier: Apache-2.0
"""Compiles the monitor of a machine, as any machine is."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError, Severity
from ..requirements.monitor import Monitor, make_monitor
from .passes import Compilation, compile_machine


def compile_monitor(c: Compilation, until: str = "emit") -> None:
    """Sets `monitor` and `monitor_code` of a compiled machine with requirements."""
    if not c.requirements:
        return
    c.monitor = make_monitor(c.checked, c.requirements)
    with tempfile.TemporaryDirectory(prefix="fcsl-monitor-") as folder:
        config = _write(c.monitor, Path(folder))
        try:
            c.monitor_code = compile_machine(config, c.toolchain, until=until, backend=c.backend)
        except DiagnosticError as error:
            raise DiagnosticError([_explained(c, error.diagnostics[0])]) from None


def _explained(c: Compilation, found: Diagnostic) -> Diagnostic:
    """An error in a monitor, whose files are gone, at the requirement that it is of."""
    of = [r for r in c.requirements if r.instance in found.span.text + found.message]
    span = (of or c.requirements)[0].span
    fix = "write it as several requirements"
    return Diagnostic(Severity.ERROR, "E257", f"it cannot be compiled: {found.message}", span, "", fix)


def _write(monitor: Monitor, folder: Path) -> Path:
    """Writes its sources. Returns the machine JSON."""
    for name, text in monitor.sources.items():
        (folder / name).write_text(text, encoding="utf-8")
    config = folder / f"{monitor.name}.json"
    config.write_text(monitor.config, encoding="utf-8")
    return config
