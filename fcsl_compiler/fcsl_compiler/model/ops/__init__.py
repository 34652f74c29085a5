# SPDX-License-Identifier: Apache-2.0
"""The op table: one entry per scalar operation of the language, found by name and operand types."""

from __future__ import annotations

from ..types import BOOL, Scalar
from . import convert, floats, integers, ordered
from .op import Doc, Op, assertion, op_id, requirement

__all__ = [
    "BUILTINS",
    "CONVERSIONS",
    "DOCS",
    "Doc",
    "Op",
    "all_ops",
    "arity_of",
    "assertion",
    "find",
    "is_test",
    "op_id",
    "requirement",
]

_TABLE: dict[tuple[str, tuple[Scalar, ...]], Op] = {
    (op.name, op.args): op for module in (floats, ordered, convert, integers) for op in module.operations()
}

#: Names callable as builtins, in table order, with their entries in the reference.
DOCS: dict[str, Doc] = {}
for _op in _TABLE.values():
    if _op.doc:
        DOCS.setdefault(_op.name, _op.doc)

#: The same names with one-line summaries.
BUILTINS: dict[str, str] = {name: doc.summary for name, doc in DOCS.items()}

#: Conversion functions: any type to the named type. A literal argument does not adopt the type of its context.
CONVERSIONS = frozenset(name for name, doc in DOCS.items() if doc.group == convert.GROUP)


def find(name: str, args: tuple[Scalar, ...]) -> Op | None:
    """The operation with this name and these operand types. None if there is none."""
    return _TABLE.get((name, args))


def all_ops() -> list[Op]:
    return list(_TABLE.values())


def is_test(name: str) -> bool:
    """Whether builtin `name` returns a bool."""
    return next(op.result is BOOL for (n, _), op in _TABLE.items() if n == name)


def arity_of(name: str) -> int:
    """Number of operands of builtin `name`."""
    return next(len(op.args) for (n, _), op in _TABLE.items() if n == name)
