# SPDX-License-Identifier: Apache-2.0
"""The value of a parameter that is a table: numbers in the simulation file, or a column of a CSV file."""

from __future__ import annotations

from fcsl_compiler.api.json_files import ConfigReader, JsonNode, read_column
from fcsl_compiler.api.types import Array, scalar_of, shape_of

from .models import ModelField

Value = bool | int | float | str
_FORM = '[0.0, 0.5, 1.0], or {"csv": "wing.csv", "column": "lift"}'


def read_table(node: JsonNode, field: ModelField, reader: ConfigReader) -> tuple[Value, ...] | None:
    """All values of the field; the last one given fills the rest. None: an error was reported."""
    what = f"parameter `{field.name}`"
    if node.kind not in ("array", "object"):
        reader.wrong(node, f"{what} is a table", _FORM)
        return None
    column = read_column(node, what, reader) if node.kind == "object" else None
    if node.kind == "object" and column is None:
        return None
    count = len(node.items) if column is None else len(column)
    (capacity,) = shape_of(field.type)
    if not 1 <= count <= capacity:
        reader.sink.error("E207", f"{what} has 1 to {capacity} values, not {count}", node.span)
        return None
    given = column or reader.value(node, Array(scalar_of(field.type), (count,)), what)
    return given + given[-1:] * (capacity - count) if given else None
