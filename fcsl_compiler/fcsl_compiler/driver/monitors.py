# SPDX-License-Identifier: Apache-2.0
"""Compiles the monitor of a machine, as any machine is."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..requirements.monitor import Monitor, make_monitor
from .passes import Compilation, compile_machine


def compile_monitor(c: Compilation, until: str = "emit") -> None:
    """Sets `monitor` and `monitor_code` of a compiled machine with requirements."""
    if not c.requirements:
        return
    c.monitor = make_monitor(c.checked, c.requirements)
    with tempfile.TemporaryDirectory(prefix="fcsl-monitor-") as folder:
        config = write_monitor(c.monitor, Path(folder))
        c.monitor_code = compile_machine(config, c.toolchain, until=until, backend=c.backend)


def write_monitor(monitor: Monitor, folder: Path) -> Path:
    """Writes its sources. Returns the machine JSON."""
    (folder / f"{monitor.name}.py").write_text(monitor.source, encoding="utf-8")
    config = folder / f"{monitor.name}.json"
    config.write_text(monitor.config, encoding="utf-8")
    return config
