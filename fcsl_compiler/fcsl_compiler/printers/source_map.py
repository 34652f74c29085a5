# SPDX-License-Identifier: Apache-2.0
"""Source map of a generated file."""

from __future__ import annotations

import json

from ..model import code
from .writer import Writer


def source_map(program: code.Program, writer: Writer, file: str) -> str:
    """The Python (or JSON) line of every generated line as JSON, as runs [first, last, file, line], and the externs
    that the file calls."""
    runs: list[list[object]] = []
    for number, origin in enumerate(writer.origins, start=1):
        if origin is None:
            continue
        source, line = origin.source.name, origin.line
        if runs and runs[-1][1] == number - 1 and runs[-1][2:] == [source, line]:
            runs[-1][1] = number
        else:
            runs.append([number, number, source, line])
    externs = [e.name for e in program.externs]
    return json.dumps({"version": 1, "generated": file, "externs": externs, "runs": runs}, indent=1) + "\n"
