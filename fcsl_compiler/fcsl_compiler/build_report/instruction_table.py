# SPDX-License-Identifier: Apache-2.0
"""Instructions of one call of a function that is not the machine's own: of fcsl_math, libm and libc."""

from __future__ import annotations

from .instruction_counts import COUNTS

#: A call of these executes at most so many instructions, and one for each byte ("rep movsb" counts every repetition).
_MEMORY = {"memcpy": 48, "memmove": 48, "memset": 48}


class Missing(Exception):
    """No count for this function; str() says so."""


def foreign_bound(name: str, size: int | None) -> int:
    """`size`: of what memcpy and its kind work on, bytes; None where the code does not tell it. Raises Missing."""
    if name in COUNTS:
        return COUNTS[name]
    if name not in _MEMORY:
        raise Missing(f"nothing tells how many instructions `{name}` takes")
    if size is None:
        raise Missing(f"a call of `{name}` with a size that the code does not tell")
    return _MEMORY[name] + size
