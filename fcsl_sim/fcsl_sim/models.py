# SPDX-License-Identifier: Apache-2.0
"""Model plugins: their descriptions in the front end."""

from __future__ import annotations

import struct
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.model.types import SCALARS, Array, Type, count_of, scalar_of, shape_of

#: A value of a model's field.
Scalar = bool | int | float

_FORMATS = {"bool": "B", "i32": "i", "i64": "q", "u32": "I", "u64": "Q", "f32": "f", "f64": "d"}


@dataclass(frozen=True)
class ModelField:
    """One leaf of a model's struct. `role` is input, output, parameter or state; `offset` is in bytes."""

    path: str
    role: str
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
class ModelTable:
    """A model: `fields` by path, in the table's order; integrated if it has continuous states."""

    name: str
    library: Path
    continuous_count: int
    doc: str
    fields: dict[str, ModelField]

    @property
    def integrated(self) -> bool:
        return self.continuous_count > 0

    def of_role(self, *roles: str) -> list[ModelField]:
        return [field for field in self.fields.values() if field.role in roles]


def type_of(scalar: str, shape: tuple[int, ...]) -> Type:
    """The dialect's type of this scalar and shape (() for a scalar)."""
    return Array(SCALARS[scalar], shape) if shape else SCALARS[scalar]


def with_unit(type_: Type, unit: str) -> str:
    """As a port is declared: `f64[3] rad/s`."""
    return f"{type_} {unit}" if unit else str(type_)


def parse_description(text: str, library: Path) -> ModelTable:
    """Parses the text of fcsl_sim_describe_model (src/describe.c)."""
    head, *rows = (line.split("\t") for line in text.splitlines())
    fields = {}
    for _, path, role, scalar, shape, offset, unit, doc in rows:
        extents = tuple(int(extent) for extent in shape.split(",")) if shape else ()
        fields[path] = ModelField(path, role, type_of(scalar, extents), int(offset), unit, doc)
    return ModelTable(head[1], library, int(head[2]), head[3], fields)
