# SPDX-License-Identifier: Apache-2.0
"""The rows of a conversion: numbers of a message and of a machine, related by a change of axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from .axes import Matrix
from .conversion import SIZES, ConversionError, Row, Term
from .message_fields import FieldError, Kind, Selection, select
from .standard_messages import STANDARD, Definitions

#: The scalar type of each type in messages; of the smaller integers it is i32.
_SCALARS = {"bool": "bool", "uint32": "u32", "int64": "i64", "uint64": "u64", "float32": "f32", "float64": "f64"}


#: What an index stands for: a text of a string, or a number.
Choice = str | int


@dataclass(frozen=True)
class Place:
    """A number to read: type `type` (fcsl_ros_scalar_t), `offset` bytes from anchor (or memory) number `anchor`."""

    anchor: int
    offset: int
    type: int

    def term(self, factor: float = 1.0) -> Term:
        return Term(factor, self.anchor, self.offset, self.type)


class Rows:
    """Collects the rows and terms of a conversion."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self.terms: list[Term] = []

    def add(
        self,
        matrix: Matrix | None,
        sources: Sequence[Place],
        targets: Sequence[tuple[int, int]],
        scale: Sequence[float] = (),
        offset: Sequence[float] = (),
    ) -> None:
        """Target i, an (offset, type), becomes the sum over j of matrix[i][j] * sources[j]; then * scale + offset.
        Without a matrix it becomes sources[i]."""
        first = len(self.rows)
        for i, (at, type_) in enumerate(targets):
            if matrix is None:
                terms = [sources[i].term()]
            else:
                terms = [place.term(factor) for factor, place in zip(matrix[i], sources, strict=True) if factor != 0.0]
            scaled = bool(scale or offset)
            factor = scale[i % len(scale)] if scale else 1.0
            bias = offset[i % len(offset)] if offset else 0.0
            row = Row(len(self.terms), len(terms), at, type_, scaled, factor, bias, 0)
            if len(self.rows) > first and self._continues(self.rows[-1], row, terms):
                self.rows[-1] = replace(self.rows[-1], more=self.rows[-1].more + 1)
            else:
                self.rows.append(row)
                self.terms += terms

    def _continues(self, last: Row, row: Row, terms: Sequence[Term]) -> bool:
        """Whether a row of these terms is the next number of the last one."""
        if last.term_count != 1 or len(terms) != 1:
            return False
        number, before = last.more + 1, self.terms[last.first_term]
        here = replace(before, offset=before.offset + number * SIZES[before.type])
        there = replace(last, offset=last.offset + number * SIZES[last.type], first_term=row.first_term, more=0)
        return terms[0] == here and row == there


def array_of(anchor: int, offset: int, type_: int, count: int) -> list[Place]:
    """`count` consecutive numbers."""
    return [Place(anchor, offset + i * SIZES[type_], type_) for i in range(count)]


def select_all(
    definitions: Definitions, message: str, fields: Sequence[str], count: int, choices: Sequence[Choice] = ()
) -> Selection:
    """The `count` numbers that several fields select together. A whole sequence takes all of them. A string has
    `choices`. Raises ConversionError."""
    found = _each(definitions, message, fields)
    for field, selection in zip(fields, found, strict=True):
        if selection.kind is Kind.TEXT and not choices:
            raise ConversionError(f"`{field}` is text, not a number; a channel carries numbers and bools")
    pieces = tuple(piece for selection in found for piece in selection.pieces)
    kind = found[0].kind if len(found) == 1 else Kind.NUMBERS
    if len(pieces) == 1 and pieces[0].count == 0:
        pieces = (replace(pieces[0], count=count),)
    total = sum(piece.count for piece in pieces)
    if total != count or not all(piece.count for piece in pieces):
        what = ", ".join(f"`{field}`" for field in fields)
        raise ConversionError(f"{what} {'has' if len(fields) == 1 else 'have'} {total} numbers, not {count}")
    if kind is Kind.NUMBERS and count == 3 and all(piece.type.startswith("float") for piece in pieces):
        kind = Kind.VECTOR
    return Selection(kind, pieces)


def scalars_of(definitions: Definitions, message: str, fields: Sequence[str]) -> tuple[str, int]:
    """The scalar type that has all numbers of these fields, and how many they are. Raises ConversionError."""
    found = _each(definitions, message, fields)
    for field, selection in zip(fields, found, strict=True):
        if not selection.count:
            raise ConversionError(f"the length of `{field}` differs from message to message; take one: {field}[0]")
        if selection.kind is Kind.TEXT:
            raise ConversionError(f"`{field}` is text, not a number")
    types = {_SCALARS.get(piece.type, "i32") for selection in found for piece in selection.pieces}
    return types.pop() if len(types) == 1 else "f64", sum(selection.count for selection in found)


def unit_of(message: str, fields: Sequence[str]) -> str:
    """The unit that the numbers of these fields have in a standard message; "" where it gives none, or several."""
    try:
        units = {selection.unit for selection in _each(STANDARD, message, fields)}
    except (ConversionError, KeyError):
        return ""
    return units.pop() if len(units) == 1 else ""


def _each(definitions: Definitions, message: str, fields: Sequence[str]) -> list[Selection]:
    try:
        return [select(definitions, message, field) for field in fields]
    except FieldError as error:
        raise ConversionError(f"{error.args[0]}; {error.args[1]}") from None
