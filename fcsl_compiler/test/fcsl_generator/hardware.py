# SPDX-License-Identifier: Apache-2.0
"""A board for generated machines. The result of a read depends on the number of earlier calls, so that every call and
its order matter."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from typing import Any

from .externs import Calls, CCalls
from .tree import HARDWARE


class Board:
    """Hardware functions by name. `calls` records each call with arguments and result.

    An absent board returns zeros and records nothing. A present board refuses some numbers, for which a read returns
    zero. `externs` belong to the same machine: the order between both kinds of calls matters, too.
    """

    def __init__(self, present: bool, externs: Calls | CCalls):
        self.present, self.externs = present, externs
        self.calls: list[str] = []

    def call(self, name: str, *args: Any) -> bool | int | None:
        """Result of a read; None for a write and for a refused call."""
        if not self.present:
            return None
        text = f"{name}({', '.join(str(int(a)) for a in args)})"
        behind = self.externs.count()
        text += f" behind {behind} externs" if behind else ""
        noise = zlib.crc32(f"{len(self.calls)} {text}".encode())
        refused = int(args[0]) % 7 == 3
        value: bool | int | None = None
        if not refused and name.startswith("hw_read"):
            numbers = {"hw_read_gpio": noise % 3 > 0, "hw_read_adc": noise % 4096, "hw_read_u32": noise >> noise % 32}
            value = numbers[name]
        self.calls.append(f"{text}: {'refused' if refused else '' if value is None else int(value)}")
        return value

    def functions(self) -> dict[str, Callable[..., Any]]:
        """The functions by the names of the builtins, without `hw_`."""

        def bind(name: str) -> Callable[..., Any]:
            return lambda *args: self.call(name, *args)

        return {name.removeprefix("hw_"): bind(name) for name in HARDWARE}
