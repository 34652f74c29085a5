# SPDX-License-Identifier: Apache-2.0
"""The flat plan, the input of the native simulator; src/plan/plan.h defines its format."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from simclient.parameters import Parameters

from .errors import SimError

#: Instance, path of a parameter or input of its model, and number of the element.
Target = tuple[str, str, str]

#: struct format of one scalar, and the width of its zero-extended bits.
_FORMATS = {"bool": "<B", "i32": "<i", "i64": "<q", "u32": "<I", "u64": "<Q", "f32": "<f", "f64": "<d"}


def bits(type_name: str, value: bool | int | float | str) -> str:
    """16 hexadecimal digits: the bits of `value` as a `type_name`.

    The value must be in range; models have no enumerations.
    """
    return struct.pack(_FORMATS[type_name], value)[::-1].hex().rjust(16, "0")


@dataclass(frozen=True)
class Statement:
    """One line of the plan. The last word may hold spaces: a path, or views."""

    keyword: str
    words: tuple[str, ...]

    def __str__(self) -> str:
        return " ".join((self.keyword, *self.words))


def statement(keyword: str, *words: object) -> Statement:
    return Statement(keyword, tuple(map(str, words)))


def library_statement(keyword: str, *words: object, library: Path) -> Statement:
    """`machine`, `companion` or `model`: the path extends to the end of the line.

    Raises SimError for paths with control characters.
    """
    path = str(library)
    if any(ord(c) < 0x20 or ord(c) == 0x7F for c in path):
        raise SimError(f"{path!r}: a path with control characters")
    return statement(keyword, *words, path)


@dataclass(frozen=True)
class Plan:
    """What the native simulator opens: its statements, in the order in which it reads them."""

    statements: tuple[Statement, ...]
    #: With which the controllers begin; None: the compiled ones.
    parameters: Parameters | None = None

    @property
    def text(self) -> str:
        """As the native simulator reads it."""
        return "\n".join(["fcsl-sim-plan 3", *map(str, self.statements), "end", ""])

    def of(self, *keywords: str) -> Iterator[Statement]:
        return (s for s in self.statements if s.keyword in keywords)

    def targets(self) -> set[Target]:
        """The parameters and inputs that have a value."""
        return {target_of(s) for s in self.of("set")}

    def flown_with(self, seed: int, values: Mapping[Target, str]) -> Plan:
        """With this seed, and other bits for some of `values`."""

        def changed(one: Statement) -> Statement:
            if one.keyword == "seed":
                return statement("seed", seed)
            new = values.get(target_of(one)) if one.keyword == "set" else None
            return one if new is None else statement("set", *target_of(one), new)

        return replace(self, statements=tuple(map(changed, self.statements)))


def target_of(one: Statement) -> Target:
    """Of a `set`."""
    instance, path, element, _ = one.words
    return instance, path, element
