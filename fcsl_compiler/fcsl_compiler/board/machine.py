# SPDX-License-Identifier: Apache-2.0
"""The machine that a board names."""

from __future__ import annotations

from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError
from ..base.files import SourceError
from ..base.source import SourceFile
from ..driver.passes import compile_machine
from ..model.machine import Machine
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from ..parse.source_path import SourcePathError, resolve_source
from .limits import MAX_PLAN_NAME

MAX_PATH = 1000


def load_machine(
    node: JsonNode | None, board: Path, reader: ConfigReader
) -> tuple[Machine | None, tuple[Diagnostic, ...]]:
    """The checked machine, or None and its own errors.

    Unlike sources, a machine may be outside of the board's folder; otherwise the same rules apply.
    """
    text = reader.string(node, "`machine`")
    if node is None or text is None:
        return None, ()
    try:
        path = _path(text, board)
        if len(path.stem) > MAX_PLAN_NAME:
            raise SourcePathError(f"its name is longer than {MAX_PLAN_NAME} characters")
        SourceFile.read(path, path.name)
    except (SourceError, SourcePathError) as error:
        reader.sink.error("E502", f"the machine `{text}` cannot be used: {error}", node.span)
        return None, ()
    try:
        return compile_machine(path, "", until="verify").checked, ()
    except DiagnosticError as error:
        return None, error.diagnostics


def _path(text: str, board: Path) -> Path:
    """Raises SourcePathError."""
    if text.startswith("package://"):
        return resolve_source(text, config=board)
    if not text or len(text) > MAX_PATH or "\0" in text:
        raise SourcePathError(f"a path has 1 to {MAX_PATH} characters")
    return board.parent / text
