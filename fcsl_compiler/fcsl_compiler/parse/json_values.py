# SPDX-License-Identifier: Apache-2.0
"""Literals of a type in JSON configuration (ConfigReader.value)."""

from __future__ import annotations

import json
import math
from decimal import Decimal
from typing import TYPE_CHECKING

from ..base.source import Span
from ..model.literals import LiteralError, fit
from ..model.types import BOOL, HEALTH, HEALTH_NAMES, REQUEST, Array, Scalar, Struct, Type, scalar_of
from .json_source import JsonNode, Member, article

if TYPE_CHECKING:
    from .json_reader import ConfigReader

#: How an expression of constants is an integer.
INTEGERS = "make it of constants that are integers; `//` divides them, `/` gives a float"

#: Scalars in the order of a type's leaves.
Value = tuple[bool | int | float | str, ...]


def read_value(reader: ConfigReader, node: JsonNode, type_: Type, what: str, unit: str = "") -> Value | None:
    """A literal of type `type_`, as scalars in the order of its leaves."""
    if isinstance(type_, Struct):
        return _struct(reader, node, type_, what)
    if isinstance(type_, Array):
        if node.kind == "object" and "csv" in node.members and not isinstance(type_.element, Struct):
            return _column(reader, node, type_, what)
        if node.kind != "array" or len(node.items) != type_.shape[0]:
            have = f"a list of {len(node.items)}" if node.kind == "array" else article(node.kind)
            reader.sink.error("E207", f"{what} is {type_}, not {have}", node.span, help=f"write {example(type_)}")
            return None
        if len(type_.shape) == 1 and any(item.kind == "array" for item in node.items):
            reader.sink.error(
                "E207", f"{what} is {type_}, not a list of lists", node.span, help=f"write {example(type_)}"
            )
            return None
        rest: Type = Array(type_.element, type_.shape[1:]) if len(type_.shape) > 1 else type_.element
        parts = [read_value(reader, item, rest, what, unit) for item in node.items]
        return None if any(p is None for p in parts) else tuple(v for p in parts if p is not None for v in p)
    return _scalar(reader, node, type_, what, unit)


def _column(reader: ConfigReader, node: JsonNode, type_: Array, what: str) -> Value | None:
    """A column of a CSV file as a vector."""
    from .csv_column import read_cells

    cells = read_cells(node, what, reader)
    if cells is None:
        return None
    if type_.shape != (len(cells),):
        reader.sink.error(
            "E207", f"{what} is {type_}, not a column of {len(cells)}", node.span, help="use another size"
        )
        return None
    element = scalar_of(type_)
    values: list[int | float] = []
    found: list[bool | int | float | str] = []
    for line, cell in cells:
        values.append(_cell(cell) if element.is_integer else float(cell))
        literal = JsonNode("int" if isinstance(values[-1], int) else "float", node.span, values[-1], cell)
        part = _scalar(reader, literal, element, f"line {line} of `{node.members['csv'].value.value}`: {what}", "")
        if part is None:
            return None
        found += part
    reader.columns.append(f"{what} {tuple(values)}")
    return tuple(found)


def _cell(text: str) -> int | float:
    """An integer where the number is one, however it is written."""
    number = Decimal(text)
    return int(number) if number == number.to_integral_value() else float(text)


def _struct(reader: ConfigReader, node: JsonNode, type_: Struct, what: str) -> Value | None:
    if type_.partial:
        return None
    if node.kind != "object":
        fix = "write {" + ", ".join(f'"{m.name}": …' for m in type_.members) + "}"
        reader.sink.error("E207", f"{what} is {type_}, not {article(node.kind)}", node.span, help=fix)
        return None
    keys = reader.object(node, f"{what} ({type_})", [m.name for m in type_.members]) or {}
    values: list[bool | int | float | str] = []
    complete = keys.keys() == node.members.keys() and len(keys) == len(type_.members)
    for member in type_.members:
        part = (
            read_value(reader, keys[member.name], member.type, f"{what}.{member.name}", member.unit)
            if member.name in keys
            else None
        )
        complete &= part is not None
        values += part or ()
    return tuple(values) if complete else None


def _scalar(reader: ConfigReader, node: JsonNode, type_: Scalar, what: str, unit: str) -> Value | None:
    given = node
    if type_.is_number:
        number = reader.computed(node, what, unit)
        if number is None:
            return None
        node = number
    if type_ is BOOL:
        if node.kind == "bool":
            return (bool(node.value),)
    elif type_ is REQUEST:
        name = reader.string(node, what)
        name = reader.scope(node).requests.get(name, name) if name else name
        if name:
            reader.use_request(name, node.span)
        return None if name is None else (name,)
    elif type_ is HEALTH:
        word = reader.choice(node, what, HEALTH_NAMES)
        return None if word is None else (HEALTH_NAMES.index(word),)
    elif node.is_number and isinstance(node.value, int | float):
        try:
            fitting = fit(node.value, type_)
            if not isinstance(fitting, float) or math.isfinite(fitting):
                return (fitting,)
        except LiteralError as error:
            if type_.is_integer and node.kind == "float":
                fix = f"write {int(node.value)}" if node.value == int(node.value) else "write an integer"
                fix = INTEGERS if given.kind == "string" else fix
                reader.sink.error("E207", f"{what} is {type_}, not a number with a point", node.span, help=fix)
                return None
            reader.sink.error("E207", f"{what}: {error.args[0]}", node.span, help=str(error.args[1]))
            return None
    fix = "true or false" if type_ is BOOL else "an integer" if type_.is_integer else "a finite number"
    reader.sink.error("E207", f"{what} is {type_}, not {article(node.kind)}", node.span, help=f"write {fix}")
    return None


def read_literal(text: str, span: Span) -> JsonNode | None:
    """A value in JSON within another text, all of it at this span. None if the text is no JSON."""
    try:
        return _node(json.loads(text), span)
    except (ValueError, RecursionError):
        return None


def _node(value: object, span: Span) -> JsonNode:
    if isinstance(value, dict):
        return JsonNode("object", span, {key: Member(key, span, _node(v, span)) for key, v in value.items()})
    if isinstance(value, list):
        return JsonNode("array", span, [_node(item, span) for item in value])
    kinds = {bool: "bool", int: "int", float: "float", str: "string"}
    return JsonNode(kinds.get(type(value), "null"), span, value, str(value))


def example(type_: Scalar | Array) -> str:
    """A value of this type, to write in the JSON."""
    element, shape = (type_, ()) if isinstance(type_, Scalar) else (type_.element, type_.shape)
    if isinstance(element, Struct) or math.prod(shape) > 16:
        return f"a list of {shape[0]}"
    inner = "0.0" if element.is_float else {BOOL: "false", HEALTH: '"nominal"', REQUEST: '""'}.get(element, "0")
    for extent in reversed(shape):
        inner = "[" + ", ".join([inner] * extent) + "]"
    return inner
