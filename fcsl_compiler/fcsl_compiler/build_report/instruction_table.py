# SPDX-License-Identifier: Apache-2.0
"""Instructions of one call of a function that is not the machine's own: of fcsl_math, libm and libc."""

from __future__ import annotations

from collections.abc import Callable

from .instruction_counts import COUNTS

#: A call of these executes at most so many instructions, and one for each byte ("rep movsb" counts every repetition).
_MEMORY = {"memcpy": 48, "memmove": 48, "memset": 48}

#: Instructions of a call of this function; the second is the size of what memcpy and its kind work on, bytes, or None where the
#: code does not tell it. Raises Missing.
Price = Callable[[str, int | None], int]


class Missing(Exception):
    """No count for this function; str() says so."""


def most(name: str, size: int | None) -> int:
    """Of a call on its slowest way."""
    if name in COUNTS:
        return COUNTS[name].most
    if name not in _MEMORY:
        raise Missing(f"nothing tells how many instructions `{name}` takes")
    if size is None:
        raise Missing(f"a call of `{name}` with a size that the code does not tell")
    return _MEMORY[name] + size


def usual(name: str, size: int | None) -> int:
    """Of a call with an argument that is nothing special; the most, of memcpy and its kind."""
    return COUNTS[name].usual if name in COUNTS else most(name, size)


def shown_name(symbol: str) -> str:
    """As users call it; the name of the one for binary32 ends in f."""
    return symbol.removeprefix("cr_")
