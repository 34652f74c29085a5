# SPDX-License-Identifier: Apache-2.0
"""Resource report of a machine: `fcslc build --report`."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

from ..base.json_file import read_json
from ..base.usage_error import UsageError
from ..driver.passes import Compilation
from .facts import Facts, machine_facts
from .machine_code import MachineCode
from .objects import NotReadable
from .text import report_text

__all__ = ["compiled_facts", "document", "refuse_foreign", "report_text"]

#: Identifies the JSON file of a report.
_KIND = "fcslc build report"


def compiled_facts(compilation: Compilation, compiled: Path, includes: Sequence[Path]) -> Facts:
    """Facts about a machine with object file `compiled`. Raises ToolchainError if the C compiler fails."""
    assert compilation.lowered is not None
    try:
        code: MachineCode | None = MachineCode(compilation.lowered, compiled, compiled.parent, includes)
        why = ""
    except NotReadable as error:
        code, why = None, str(error)
    return machine_facts(compilation.lowered, compilation.stack_bound, code, why)


def document(machines: Sequence[Facts], toolchain: str) -> str:
    """The report as JSON."""
    return (
        json.dumps({"kind": _KIND, "version": 1, "toolchain": toolchain, "machines": list(machines)}, indent=1) + "\n"
    )


def refuse_foreign(path: Path) -> None:
    """Raises UsageError if `path` exists and is not a report. The argument of `--report` could otherwise overwrite a
    machine."""
    if not path.exists():
        return
    try:
        is_ours = read_json(path).get("kind") == _KIND
    except (OSError, ValueError, AttributeError):
        is_ours = False
    if not is_ours:
        raise UsageError(f"--report `{path}` exists and is not a report; name another file, or put --report last")
