# SPDX-License-Identifier: Apache-2.0
"""The rows of a plan: numbers of a message and of a machine, related by a change of axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from fcsl_compiler.config.message_fields import FieldError, Kind, Selection, select
from fcsl_compiler.config.standard_messages import Definitions

from ..errors import MapError
from .axes import Matrix
from .native import SIZES, CRow, CTerm


@dataclass(frozen=True)
class Place:
    """A number to read: type `type` (fcsl_ros_scalar_t), `offset` bytes from anchor (or memory) number `anchor`."""

    anchor: int
    offset: int
    type: int

    def term(self, factor: float = 1.0) -> CTerm:
        return CTerm(factor, self.anchor, self.offset, self.type)


class Rows:
    """Collects the rows and terms of a plan."""

    def __init__(self) -> None:
        self.rows: list[CRow] = []
        self.terms: list[CTerm] = []

    def add(
        self,
        matrix: Matrix,
        sources: Sequence[Place],
        targets: Sequence[tuple[int, int]],
        scale: Sequence[float] = (),
        offset: Sequence[float] = (),
    ) -> None:
        """Target i, an (offset, type), becomes the sum over j of matrix[i][j] * sources[j]; then * scale + offset."""
        for i, (row, (at, type_)) in enumerate(zip(matrix, targets, strict=True)):
            terms = [place.term(factor) for factor, place in zip(row, sources, strict=True) if factor != 0.0]
            scaled = bool(scale or offset)
            factor = scale[i % len(scale)] if scale else 1.0
            bias = offset[i % len(offset)] if offset else 0.0
            self.rows.append(CRow(len(self.terms), len(terms), at, type_, scaled, factor, bias))
            self.terms += terms


def array_of(anchor: int, offset: int, type_: int, count: int) -> list[Place]:
    """`count` consecutive numbers."""
    return [Place(anchor, offset + i * SIZES[type_], type_) for i in range(count)]


def select_all(definitions: Definitions, message: str, fields: Sequence[str], count: int) -> Selection:
    """The `count` numbers that several fields select together. A whole sequence takes all of them. Raises MapError."""
    try:
        found = [select(definitions, message, field) for field in fields]
    except FieldError as error:
        raise MapError(f"{error.args[0]}; {error.args[1]}") from None
    pieces = tuple(piece for selection in found for piece in selection.pieces)
    kind = found[0].kind if len(found) == 1 else Kind.NUMBERS
    if len(pieces) == 1 and pieces[0].count == 0:
        pieces = (replace(pieces[0], count=count),)
    total = sum(piece.count for piece in pieces)
    if total != count or not all(piece.count for piece in pieces):
        what = ", ".join(f"`{field}`" for field in fields)
        raise MapError(f"{what} {'has' if len(fields) == 1 else 'have'} {total} numbers, not {count}")
    if kind is Kind.NUMBERS and count == 3 and all(piece.type.startswith("float") for piece in pieces):
        kind = Kind.VECTOR
    return Selection(kind, pieces)
