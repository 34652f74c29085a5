# SPDX-License-Identifier: Apache-2.0
"""The program: everything that the algorithms of a machine share."""

from __future__ import annotations

from dataclasses import dataclass, field

from . import ir
from .types import Array, Struct

#: Constant arrays and structs of modules by owner and name: type, and values in the order of the leaves.
StoredConstants = dict[tuple[str, str], tuple[Array | Struct, tuple[bool | int | float | str, ...]]]


@dataclass
class Program:
    """Structs, constants and functions of a machine. Functions are in order, callees first."""

    structs: dict[str, Struct] = field(default_factory=dict)
    functions: dict[str, ir.Function] = field(default_factory=dict)
    constants: StoredConstants = field(default_factory=dict)
    #: Checked helpers of all files. Those that an algorithm reaches are also in `functions`.
    helpers: dict[str, ir.Function] = field(default_factory=dict)

    def use(self, names: tuple[str, ...]) -> None:
        """Adds helpers and their callees to the functions of the program."""
        for name in names:
            if name in self.helpers and name not in self.functions:
                self.use(self.helpers[name].calls)
                self.functions[name] = self.helpers[name]
