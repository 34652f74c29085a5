# SPDX-License-Identifier: Apache-2.0
"""The flat plan, the input of the native simulator; src/plan/plan.h defines its format."""

from __future__ import annotations

import struct
from pathlib import Path

from .errors import SimError

#: struct format of one scalar, and the width of its zero-extended bits.
_FORMATS = {"bool": "<B", "i32": "<i", "i64": "<q", "u32": "<I", "u64": "<Q", "f32": "<f", "f64": "<d"}


def bits(type_name: str, value: bool | int | float | str) -> str:
    """16 hexadecimal digits: the bits of `value` as a `type_name`.

    The value must be in range; models have no enumerations.
    """
    return struct.pack(_FORMATS[type_name], value)[::-1].hex().rjust(16, "0")


def statement(*words: object) -> str:
    """One line of a plan."""
    return " ".join(str(word) for word in words)


def library_statement(keyword: str, name: str, library: Path) -> str:
    """`machine` or `model`: the path extends to the end of the line.

    Raises SimError for paths with control characters.
    """
    path = str(library)
    if any(ord(c) < 0x20 or ord(c) == 0x7F for c in path):
        raise SimError(f"{path!r}: a path with control characters")
    return statement(keyword, name, path)


def document(lines: list[str]) -> str:
    """The whole text."""
    return "\n".join(["fcsl-sim-plan 2", *lines, "end", ""])
