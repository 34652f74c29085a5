# SPDX-License-Identifier: Apache-2.0
"""The value of a parameter that is a table: numbers in the simulation file, or a column of a CSV file."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from fcsl_compiler.api.diagnostics import nearest
from fcsl_compiler.api.json_files import ConfigReader, JsonNode, SourcePathError, resolve_source
from fcsl_compiler.api.types import Array, scalar_of, shape_of

from .extends import file_of
from .models import ModelField

Value = bool | int | float | str
_FORM = '[0.0, 0.5, 1.0], or {"csv": "wing.csv", "column": "lift"}'
_MAX_BYTES = 1 << 20


def read_table(node: JsonNode, field: ModelField, reader: ConfigReader) -> tuple[Value, ...] | None:
    """All values of the field; the last one given fills the rest. None: an error was reported."""
    what = f"parameter `{field.name}`"
    if node.kind not in ("array", "object"):
        reader.wrong(node, f"{what} is a table", _FORM)
        return None
    column = _column(node, what, reader) if node.kind == "object" else None
    if node.kind == "object" and column is None:
        return None
    count = len(node.items) if column is None else len(column)
    (capacity,) = shape_of(field.type)
    if not 1 <= count <= capacity:
        reader.sink.error("E207", f"{what} has 1 to {capacity} values, not {count}", node.span)
        return None
    given = column or reader.value(node, Array(scalar_of(field.type), (count,)), what)
    return given + given[-1:] * (capacity - count) if given else None


def _column(node: JsonNode, what: str, reader: ConfigReader) -> tuple[float, ...] | None:
    keys = reader.object(node, what, ("csv", "column"))
    text = reader.string(keys.get("csv"), "`csv`") if keys else None
    column = reader.string(keys.get("column"), "`column`") if keys else None
    if keys is None or text is None or column is None:
        return None
    try:
        rows = _rows(resolve_source(text, config=file_of(node.span)))
    except (SourcePathError, ValueError) as error:
        reader.sink.error("E809", f"`{text}` cannot be used: {error}", keys["csv"].span)
        return None
    names = rows[0][1] if rows else []
    if column not in names:
        hint = nearest(column, names) or f"it has {', '.join(f'`{name}`' for name in names)}"
        reader.sink.error("E809", f"`{text}` has no column `{column}`", keys["column"].span, help=hint)
        return None
    index = names.index(column)
    values = []
    for line, row in rows[1:]:
        cell = row[index] if index < len(row) else ""
        try:
            values.append(float(cell))
        except ValueError:
            values.append(math.nan)
        if not math.isfinite(values[-1]):
            message = f"line {line} of `{text}`: `{cell}` in column `{column}` is no finite number"
            reader.sink.error("E809", message, node.span)
            return None
    return tuple(values)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Line numbers and cells of the rows that are not empty. Raises ValueError with what is wrong."""
    try:
        if path.stat().st_size > _MAX_BYTES:
            raise ValueError(f"it is larger than {_MAX_BYTES} bytes")
        with path.open(encoding="utf-8-sig", newline="") as stream:
            reader = csv.reader(stream, strict=True)
            return [(reader.line_num, [cell.strip() for cell in row]) for row in reader if any(map(str.strip, row))]
    except FileNotFoundError:
        raise ValueError(f"no such file: {path}") from None
    except UnicodeDecodeError:
        raise ValueError("it is no text in UTF-8") from None
    except (OSError, csv.Error) as error:
        raise ValueError(str(error)) from None
