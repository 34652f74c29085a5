# SPDX-License-Identifier: Apache-2.0
"""Resource report of a machine: `fcsl build --report`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..driver.passes import Compilation
from .facts import Facts, machine_facts
from .machine_code import MachineCode
from .objects import NotReadable
from .text import report_text

__all__ = ["compiled_facts", "document", "report_text"]

#: Identifies the JSON file of a report.
_KIND = "fcsl build report"


def compiled_facts(compilation: Compilation, compiled: Path, includes: Sequence[Path]) -> Facts:
    """Facts about a machine with object file `compiled`. Raises ToolchainError if the C compiler fails."""
    assert compilation.lowered is not None
    try:
        code: MachineCode | None = MachineCode(compilation.lowered, compiled, compiled.parent, includes)
        why = ""
    except NotReadable as error:
        code, why = None, str(error)
    return machine_facts(compilation.lowered, compilation.stack_bound, code, why)


def document(machines: Sequence[Facts], toolchain: str) -> dict[str, object]:
    """The report, to be written as JSON."""
    return {"kind": _KIND, "version": 1, "toolchain": toolchain, "machines": list(machines)}
