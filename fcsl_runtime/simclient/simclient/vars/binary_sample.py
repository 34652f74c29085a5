# SPDX-License-Identifier: Apache-2.0
"""The values of a binary sample (docs/reference/variables.md)."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable
from typing import Any

from ..c_machine import HEALTH_NAMES, TYPE_FORMATS
from ..values import nest


class Layout:
    """Layout of a path's scalars in a binary sample.

    `now` is a current value, which gives the shape: a path may be a slice.
    """

    def __init__(self, path: str, kind: str, now: Any, machine: dict[str, Any]):
        self.path = path
        self._shape: tuple[int, ...] = ()
        while isinstance(now, list):
            self._shape += (len(now),)
            now = now[0] if now else None
        count = 1
        for extent in self._shape:
            count *= extent
        scalar = re.split(r"[\[ ]", kind)[0]
        self._format = struct.Struct(f"<{count}{TYPE_FORMATS[scalar]}")
        self.size = self._format.size
        self._scalar = _reader(scalar, machine)

    def read(self, payload: bytes, at: int) -> Any:
        flat = [self._scalar(value) for value in self._format.unpack_from(payload, at)]
        return nest(flat, self._shape) if self._shape else flat[0]


def _reader(scalar: str, machine: dict[str, Any]) -> Callable[[Any], Any]:
    names = {
        "Health": HEALTH_NAMES,
        "state": machine.get("states", []),
        "TransitionRequest": ["", *(f"tr_{request}" for request in machine.get("requests", []))],
    }.get(scalar)
    if names is not None:
        return lambda index: names[index] if 0 <= index < len(names) else f"<invalid {index}>"
    return bool if scalar == "bool" else lambda value: value
