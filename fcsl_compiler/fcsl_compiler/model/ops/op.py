# SPDX-License-Identifier: Apache-2.0
"""The description of one operation, and its entry in the reference."""

from __future__ import annotations

from dataclasses import dataclass

from ..types import Scalar


@dataclass(frozen=True)
class Doc:
    """A function's entry in the reference (docs/library.md). No field is empty."""

    group: str  # heading of its section
    call: str  # "atan2(y, x)"
    meaning: str  # the equation
    order: str  # order of the operations, and what is rounded
    singular: str  # where the equation does not apply

    @property
    def summary(self) -> str:
        """One line for editors and messages."""
        return f"{self.call}: {self.meaning}."


@dataclass(frozen=True)
class Op:
    """One operation, selected by its source name and the scalar types of its operands.

    `c` is the C expression. Placeholders: {0}, {1}, … for the operands, {place} for the place number of each cause of a
    fault (fault_places.py), {fault} for the pointer that stores the first fault. `proven` is the expression if the
    operands are known not to fault. `helper` and `proven_helper` are the C functions that these expressions call; each
    is emitted once per machine.
    """

    name: str  # as in the source: "+", "sin", "i32"
    args: tuple[Scalar, ...]
    result: Scalar
    c: str
    faults: tuple[str, ...] = ()  # causes of faults
    helper: str = ""
    doc: Doc | None = None
    proven: str = ""
    proven_helper: str = ""

    @property
    def id(self) -> str:
        """Unique name in IR dumps."""
        return f"{self.name}:{','.join(map(str, self.args))}"


def c_function(signature: str, *body: str) -> str:
    """Definition of a C helper function."""
    lines = "\n".join("    " + line for line in body)
    return f"static inline {signature}\n{{\n{lines}\n}}\n"


#: Every faulting operation calls it. It is cold, so that the C compiler optimises the path without a fault.
FAULT_HELPER = """static inline __attribute__((cold)) void fcsl_fault(uint32_t place, uint32_t *fault)
{
    if (*fault == 0u) { /* later faults follow from the first one */
        *fault = place;
    }
}
"""


def overflow(t: Scalar) -> str:
    """Cause of a fault: the result does not fit its type."""
    return f"the result does not fit {t}"
