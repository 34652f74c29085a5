# SPDX-License-Identifier: Apache-2.0
"""The description of one operation, and its entry in the reference."""

from __future__ import annotations

from dataclasses import dataclass

from ..types import BOOL, Scalar


@dataclass(frozen=True)
class Doc:
    """A function's entry in the reference (docs/reference/library.md). No field is empty."""

    group: str  # heading of its section
    call: str  # "atan2(y, x)"
    meaning: str  # the equation
    order: str  # order of the operations, and what is rounded
    singular: str  # where the equation does not apply

    @property
    def summary(self) -> str:
        """One line for editors and messages."""
        return f"{self.call}: {self.meaning}."


def op_id(name: str, args: tuple[Scalar, ...]) -> str:
    """Unique name of an operation."""
    return f"{name}:{','.join(map(str, args))}"


@dataclass(frozen=True)
class Op:
    """One operation, selected by its source name and the scalar types of its operands. Printers know how a language
    writes it."""

    name: str  # as in the source: "+", "sin", "i32"
    args: tuple[Scalar, ...]
    result: Scalar
    faults: tuple[str, ...] = ()  # causes of faults
    doc: Doc | None = None
    sees_fault: bool = False  # it reads whether an earlier operation has faulted

    @property
    def id(self) -> str:
        """Unique name in IR dumps."""
        return op_id(self.name, self.args)


def requirement(cause: str) -> Op:
    """It faults unless its operand is true."""
    return Op("assert", (BOOL,), BOOL, (cause,))


def assertion(text: str) -> Op:
    """`assert condition, text`. text: "" for none."""
    return requirement(f"assertion failed: {text}" if text else "assertion failed")


def overflow(t: Scalar) -> str:
    """Cause of a fault: the result does not fit its type."""
    return f"the result does not fit {t}"
