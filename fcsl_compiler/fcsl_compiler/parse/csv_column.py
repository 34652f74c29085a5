# SPDX-License-Identifier: Apache-2.0
"""A column of a CSV file in the place of a list of numbers."""

from __future__ import annotations

import csv
import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.diagnostics import nearest
from ..base.files import SourceError, read_regular
from .json_source import JsonNode
from .source_path import SourcePathError, resolve_source

if TYPE_CHECKING:
    from .json_reader import ConfigReader

_MAX_BYTES = 1 << 20


def read_column(node: JsonNode, what: str, reader: ConfigReader) -> tuple[float, ...] | None:
    """The numbers of `{"csv": "wing.csv", "column": "lift"}`; the file is beside that of the node. None after reporting what
    is wrong with it."""
    cells = read_cells(node, what, reader)
    return None if cells is None else tuple(float(cell) for _, cell in cells)


def read_cells(node: JsonNode, what: str, reader: ConfigReader) -> list[tuple[int, str]] | None:
    """The same as texts, each a finite number, with the lines that they stand in."""
    keys = reader.object(node, what, ("csv", "column"))
    text = reader.string(keys.get("csv"), "`csv`") if keys else None
    column = reader.string(keys.get("column"), "`column`") if keys else None
    if keys is None or text is None or column is None:
        return None
    try:
        rows = _rows(resolve_source(text, config=Path(node.span.source.path)))
    except (SourcePathError, ValueError) as error:
        fix = "it is UTF-8 text of numbers, with names in its first line"
        reader.sink.error("E253", f"`{text}` cannot be used: {error}", keys["csv"].span, help=fix)
        return None
    names = rows[0][1] if rows else []
    if column not in names:
        hint = nearest(column, names) or f"it has {', '.join(f'`{name}`' for name in names)}"
        reader.sink.error("E253", f"`{text}` has no column `{column}`", keys["column"].span, help=hint)
        return None
    index = names.index(column)
    cells = []
    for line, row in rows[1:]:
        cell = row[index] if index < len(row) else ""
        if not _is_finite(cell):
            message = f"line {line} of `{text}`: `{cell}` in column `{column}` is no finite number"
            reader.sink.error("E253", message, node.span, help="write a number there")
            return None
        cells.append((line, cell))
    return cells


def _is_finite(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of the rows that are not empty. Raises ValueError with what is wrong."""
    try:
        text = read_regular(path, _MAX_BYTES).decode("utf-8-sig")
        reader = csv.reader(io.StringIO(text, newline=""), strict=True)
        return [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except FileNotFoundError:
        raise ValueError(f"no such file: {path}") from None
    except UnicodeDecodeError:
        raise ValueError("it is no text in UTF-8") from None
    except (SourceError, OSError, csv.Error) as error:
        raise ValueError(str(error)) from None
