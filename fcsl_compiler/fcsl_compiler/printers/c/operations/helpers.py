# SPDX-License-Identifier: Apache-2.0
"""What C helpers of operations are written with."""

from __future__ import annotations

from ....model.types import Scalar


def c_function(signature: str, *body: str) -> str:
    """Definition of a C helper function."""
    lines = "\n".join("    " + line for line in body)
    return f"static inline {signature}\n{{\n{lines}\n}}\n"


def least(t: Scalar) -> str:
    """C name of the smallest value of an integer type."""
    return f"INT{t.size * 8}_MIN" if t.is_signed else "0"


def greatest(t: Scalar) -> str:
    return f"{'' if t.is_signed else 'U'}INT{t.size * 8}_MAX"


#: Every faulting operation calls it. It is cold, so that the C compiler optimises the path without a fault.
FAULT_HELPER = """static inline __attribute__((cold)) void fcsl_fault(uint32_t place, uint32_t *fault)
{
    if (*fault == 0u) { /* later faults follow from the first one */
        *fault = place;
    }
}
"""
