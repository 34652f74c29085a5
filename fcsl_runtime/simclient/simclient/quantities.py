# SPDX-License-Identifier: Apache-2.0
"""What the fields of a machine are in an expression: kind, shape and unit of a path."""

from __future__ import annotations

from fcsl_compiler.api.expressions import ExpressionError, Kind, Quantity, read_unit

from .descriptor import Machine
from .errors import TwinError
from .paths import Selection, resolve
from .values import INTEGER_RANGES, enumerators


def selection(path: str, machine: Machine) -> Selection:
    """The field, or the part of one, that an expression reads. Raises ExpressionError."""
    try:
        part = resolve(path, machine)
    except TwinError as error:
        raise ExpressionError(str(error)) from None
    if not isinstance(part, Selection):
        raise ExpressionError(f"`{path}` is a struct: name one of its fields")
    return part


def quantity(path: str, machine: Machine) -> Quantity:
    """Raises ExpressionError."""
    part = selection(path, machine)
    type_ = part.field.type
    names = tuple(enumerators(type_, machine))
    if names:
        return Quantity(Kind.NAME, part.shape, names=names)
    kind = Kind.BOOL if type_ == "bool" else Kind.INTEGER if type_ in INTEGER_RANGES else Kind.FLOAT
    return Quantity(kind, part.shape, read_unit(part.field.unit))
