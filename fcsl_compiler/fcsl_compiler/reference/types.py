# SPDX-License-Identifier: Apache-2.0
"""Types while a program runs: each makes its zero, and the copy of a value that is stored in a place of this type."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from .values import F32, INTEGERS, IllTyped, as_bool, as_f32, as_f64


class Type(Protocol):
    """A scalar, array or struct type."""

    name: str

    def __hash__(self) -> int: ...

    def zero(self) -> Any:
        """The value of zeroed memory."""
        ...

    def store(self, value: Any) -> Any:
        """What a place of this type holds after `value` was assigned to it: a copy; literals adopt. Raises IllTyped, Fault."""
        ...


class Scalar:
    """A scalar type; `code` is the struct format of one in memory."""

    def __init__(self, name: str, code: str, zero: Any, store: Callable[[Any], Any], of: Callable[[Any], Any]):
        self.name, self.code, self.store = name, code, store
        self.of = of  # from the plain number in memory
        self._zero = zero

    def zero(self) -> Any:
        return self._zero

    def __repr__(self) -> str:
        return self.name


def _word(value: Any) -> str:
    """Health and requests are their names while a program runs; "" is no request."""
    if type(value) is str:
        return value
    raise IllTyped(f"{value!r} where a name is needed")


SCALARS: dict[str, Scalar] = {
    "bool": Scalar("bool", "?", False, as_bool, bool),
    "f32": Scalar("f32", "f", F32(0.0), as_f32, F32),
    "f64": Scalar("f64", "d", 0.0, as_f64, float),
    "Health": Scalar("Health", "i", "nominal", _word, str),
    "TransitionRequest": Scalar("TransitionRequest", "i", "", _word, str),
}
SCALARS |= {
    name: Scalar(name, code, cls(0), cls.adopt, cls)
    for (name, cls), code in zip(INTEGERS.items(), ("i", "q", "I", "Q"), strict=True)
}
