# SPDX-License-Identifier: Apache-2.0
"""Model plugins: their descriptions in the front end."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.api.types import SCALARS, Array, Type, count_of, scalar_of, shape_of

#: A value of a model's field.
Scalar = bool | int | float

_FORMATS = {"bool": "B", "i32": "i", "i64": "q", "u32": "I", "u64": "Q", "f32": "f", "f64": "d"}
#: What a field of a model may be, or an array of it.
FIELD_TYPES = tuple(_FORMATS)


@dataclass(frozen=True)
class ModelField:
    """One leaf of a model's struct. `role` is input, output, parameter or state; `offset` is in bytes; `feedthrough`: an
    output that depends on an input of the same instant; `optional`: an input that may stay unconnected, a parameter that may be left out; `table`:
    a vector parameter of at most so many values."""

    path: str
    role: str
    feedthrough: bool
    optional: bool
    table: bool
    type: Type
    offset: int
    unit: str
    doc: str

    @property
    def name(self) -> str:
        """The path without its role: `pos_z`."""
        return self.path.partition(".")[2]

    @property
    def format(self) -> str:
        """struct format of the whole field, without byte order."""
        return f"{count_of(self.type)}{_FORMATS[scalar_of(self.type).name]}"

    def decode(self, data: bytes) -> Scalar | list[Scalar]:
        """The value in its native bytes; an array as a flat list, row-major."""
        values = struct.unpack(f"={self.format}", data)
        plain = [bool(v) for v in values] if scalar_of(self.type).name == "bool" else list(values)
        return plain if shape_of(self.type) else plain[0]


@dataclass(frozen=True)
class ModelEvent:
    """`crossing` is falling, rising or either."""

    name: str
    crossing: str
    doc: str


@dataclass(frozen=True)
class ModelTable:
    """A model: `fields` by path, in the table's order; integrated if it has continuous states, which lie together at
    `continuous_offset`. `second_order`: these are positions, then their velocities. `tick_hz`: of a machine as a model, whose
    parameters have values already; 0 for others."""

    name: str
    library: Path
    continuous_offset: int
    continuous_count: int
    has_output: bool
    has_update: bool
    second_order: bool
    has_next_time: bool
    doc: str
    events: tuple[ModelEvent, ...]
    fields: dict[str, ModelField]
    tick_hz: int = 0

    @property
    def integrated(self) -> bool:
        return self.continuous_count > 0

    def continuous(self) -> dict[str, range]:
        """The numbers of the continuous states of each field that has some."""
        found = {}
        for field in self.of_role("state"):
            first = (field.offset - self.continuous_offset) // 8
            if scalar_of(field.type).name == "f64" and 0 <= first < self.continuous_count:
                found[field.path] = range(first, min(first + count_of(field.type), self.continuous_count))
        return found

    def of_role(self, *roles: str) -> list[ModelField]:
        return [field for field in self.fields.values() if field.role in roles]


def type_of(scalar: str, shape: tuple[int, ...]) -> Type:
    """The dialect's type of this scalar and shape (() for a scalar)."""
    return Array(SCALARS[scalar], shape) if shape else SCALARS[scalar]


def with_unit(type_: Type, unit: str) -> str:
    """As a port is declared: `f64[3] rad/s`."""
    return f"{type_} {unit}" if unit else str(type_)


def parse_description(text: str, library: Path) -> ModelTable:
    """Parses the text of fcsl_sim_describe_model (src/output/describe_model.c)."""
    head, *rows = (line.split("\t") for line in text.splitlines())
    _, name, offset, count, functions, doc = head
    events = tuple(ModelEvent(*row[1:]) for row in rows if row[0] == "event")
    fields = {}
    for row in rows:
        if row[0] == "field":
            _, path, role, feedthrough, optional, is_table, scalar, shape, at, unit, field_doc = row
            extents = tuple(int(extent) for extent in shape.split(",")) if shape else ()
            type_ = type_of(scalar, extents)
            through, may_stay_free, holds_any = (flag == "1" for flag in (feedthrough, optional, is_table))
            marks = through, may_stay_free, holds_any
            fields[path] = ModelField(path, role, *marks, type_, int(at), unit, field_doc)
    has = functions.split(",")
    return ModelTable(
        name,
        library,
        int(offset),
        int(count),
        "output" in has,
        "update" in has,
        "second_order" in has,
        "next_time" in has,
        doc,
        events,
        fields,
    )
