# SPDX-License-Identifier: Apache-2.0
"""Corrections of readings: corrected = rotation · scale · (raw - offset - per_kelvin · (temperature - celsius))."""

from __future__ import annotations

from dataclasses import dataclass

from ..model.types import F64, Array
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .kinds import KINDS, TEMPERATURE, Quantity
from .quantities import adjustable, by_quantity
from .rotations import IDENTITY, Matrix, determinant, product

Vector = tuple[float, ...]

_NOTHING: Vector = (0.0, 0.0, 0.0)
#: Where the term of the temperature is zero, without `celsius`.
CELSIUS = 25.0


@dataclass(frozen=True)
class Correction:
    """Of a scalar only the first element of each counts; the others are those of the identity."""

    matrix: Matrix = IDENTITY
    offset: Vector = _NOTHING
    per_kelvin: Vector = _NOTHING
    celsius: float = CELSIUS


def read_corrections(node: JsonNode | None, rotation: Matrix, kind: str, reader: ConfigReader) -> dict[str, Correction]:
    """Corrections by quantity, in the order of the kind; without those that change nothing."""
    given = {
        quantity.name: _correction(value, quantity, kind, reader)
        for quantity, value in by_quantity(node, "`correct`", adjustable(kind), reader)
    }
    found: dict[str, Correction] = {}
    for quantity in KINDS[kind]:
        own = given.get(quantity.name, Correction())
        matrix = product(rotation, own.matrix) if quantity.in_axes else own.matrix
        correction = Correction(matrix, own.offset, own.per_kelvin, own.celsius)
        if (correction.matrix, correction.offset, correction.per_kelvin) != (IDENTITY, _NOTHING, _NOTHING):
            found[quantity.name] = correction
    return found


def _correction(node: JsonNode, quantity: Quantity, kind: str, reader: ConfigReader) -> Correction:
    """Parts with a reported error are those of the identity."""
    what = f"the correction of `{quantity.name}`"
    keys = reader.object(node, what, (), ("offset", "scale", "per_kelvin", "celsius")) or {}
    per_kelvin = keys.get("per_kelvin")
    if per_kelvin is not None and (quantity == TEMPERATURE or TEMPERATURE not in KINDS[kind]):
        why = "its own sensor tells no temperature" if quantity != TEMPERATURE else "it is the temperature"
        message = f"`per_kelvin` of `{quantity.name}`"
        reader.sink.error("E511", message, per_kelvin.span, why=why, help="remove it")
    celsius = reader.number(keys.get("celsius"), "`celsius`", -273.15, 1000.0)
    return Correction(
        _scale(keys.get("scale"), quantity, reader),
        _elements(keys.get("offset"), quantity, "`offset`", reader),
        _elements(per_kelvin, quantity, "`per_kelvin`", reader),
        CELSIUS if celsius is None else celsius,
    )


def _elements(node: JsonNode | None, quantity: Quantity, what: str, reader: ConfigReader) -> Vector:
    """A number of a scalar, three of a vector."""
    if node is None:
        return _NOTHING
    values = reader.value(node, F64 if quantity.count == 1 else Array(F64, (3,)), what)
    return _NOTHING if values is None else (*map(float, values), *_NOTHING[quantity.count :])


def _scale(node: JsonNode | None, quantity: Quantity, reader: ConfigReader) -> Matrix:
    """A number; of a vector also one per axis, or a matrix."""
    if node is None:
        return IDENTITY
    if quantity.count == 1:
        values = reader.value(node, F64, "`scale`")
        matrix = None if values is None else (float(values[0]), *IDENTITY[1:])
    else:
        matrix = _scale_of_vector(node, reader)
    if matrix is None:
        return IDENTITY
    if determinant(matrix) == 0.0:
        why = "the reading could not be told from others: the scale is singular"
        reader.sink.error("E511", f"`scale` of `{quantity.name}` loses the reading", node.span, why=why)
    return matrix


def _scale_of_vector(node: JsonNode, reader: ConfigReader) -> Matrix | None:
    if node.kind == "array" and any(item.kind == "array" for item in node.items):
        values = reader.value(node, Array(F64, (3, 3)), "`scale`")
        return None if values is None else tuple(map(float, values))
    values = reader.value(node, Array(F64, (3,)) if node.kind == "array" else F64, "`scale`")
    if values is None:
        return None
    x, y, z = map(float, values if len(values) == 3 else 3 * values)
    return (x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z)
