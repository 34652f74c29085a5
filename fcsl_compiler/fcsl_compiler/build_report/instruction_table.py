# SPDX-License-Identifier: Apache-2.0
"""Instructions per call of library functions: fcsl_math, libm and libc."""

from __future__ import annotations

from collections.abc import Callable

from .instruction_counts import COUNTS

#: Maximum instructions of a call of these functions, plus one per byte ("rep movsb" counts every repetition).
_MEMORY = {"memcpy": 48, "memmove": 48, "memset": 48}

#: Price of a call: instructions of a function. The second argument is the size in bytes for memcpy and similar
#: functions, None if unknown. Raises Missing.
Price = Callable[[str, int | None], int]


class Missing(Exception):
    """No count exists for this function. str() says so."""


def most(name: str, size: int | None) -> int:
    """Instructions of a call in the worst case."""
    if name in COUNTS:
        return COUNTS[name].most
    if name not in _MEMORY:
        raise Missing(f"the number of instructions of `{name}` is unknown")
    if size is None:
        raise Missing(f"a call of `{name}` with a size that is unknown at compile time")
    return _MEMORY[name] + size


def usual(name: str, size: int | None) -> int:
    """Instructions of a call with common arguments. For memcpy and similar functions, the worst case."""
    return COUNTS[name].usual if name in COUNTS else most(name, size)


def shown_name(symbol: str) -> str:
    """Name in the source language. Binary32 variants end in f."""
    return symbol.removeprefix("cr_")
