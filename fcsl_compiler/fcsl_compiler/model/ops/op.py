# SPDX-License-Identifier: Apache-2.0
"""What one operation is, and what the reference says of it."""

from __future__ import annotations

from dataclasses import dataclass

from ..types import Scalar


@dataclass(frozen=True)
class Doc:
    """A function's entry in the reference (docs/library.md). No part is empty."""

    group: str  # heading that it stands under
    call: str  # "atan2(y, x)"
    meaning: str  # the equation
    order: str  # order of the operations, and what is rounded
    singular: str  # where the equation ends

    @property
    def summary(self) -> str:
        """One line for editors and messages."""
        return f"{self.call}: {self.meaning}."


@dataclass(frozen=True)
class Op:
    """An operation is selected by its source name and the scalar types of its operands.

    `c` is the C expression, with {0}, {1}, … for the operands, {place} for the number of the place of each cause to fault
    (fault_places.py) and {fault} for the pointer to where the first one is kept; `proven` is the expression where the checker knows that the operands cannot fault. `helper` and `proven_helper` are the
    C functions they call, emitted once into a machine.
    """

    name: str  # as written: "+", "sin", "i32"
    args: tuple[Scalar, ...]
    result: Scalar
    c: str
    faults: tuple[str, ...] = ()  # the causes for which it faults
    helper: str = ""
    doc: Doc | None = None
    proven: str = ""
    proven_helper: str = ""

    @property
    def id(self) -> str:
        """Unique name in IR dumps."""
        return f"{self.name}:{','.join(map(str, self.args))}"


def c_function(signature: str, *body: str) -> str:
    """Text of a helper."""
    lines = "\n".join("    " + line for line in body)
    return f"static inline {signature}\n{{\n{lines}\n}}\n"


#: What every faulting operation calls; cold, so that the C compiler lays out code for the way without fault.
FAULT_HELPER = """static inline __attribute__((cold)) void fcsl_fault(uint32_t place, uint32_t *fault)
{
    if (*fault == 0u) { /* what follows the first one computes with what it left */
        *fault = place;
    }
}
"""


def overflow(t: Scalar) -> str:
    """The cause of a fault: a result that its type does not hold."""
    return f"the result does not fit {t}"
