# SPDX-License-Identifier: Apache-2.0
"""Types at run time. Each creates its zero value, and the copy of a value that is stored in a place of this type."""

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
        """The value of a place of this type after assignment of `value`: a copy; literals adopt the type. Raises
        IllTyped, Fault."""
        ...


class Element(Type, Protocol):
    """A scalar or struct type: one of which there are arrays."""

    @property
    def arrays(self) -> dict[tuple[int, ...], Any]:
        """The types of arrays of it by their shape, as far as they are made (arrays.py)."""
        ...


class Scalar:
    """A scalar type. `code`: its format for the struct module."""

    def __init__(self, name: str, code: str, zero: Any, store: Callable[[Any], Any], of: Callable[[Any], Any]):
        self.name, self.code, self.store = name, code, store
        self.of = of  # converts the plain number in memory to the value
        self.arrays: dict[tuple[int, ...], Any] = {}
        self._zero = zero

    def zero(self) -> Any:
        return self._zero

    def __repr__(self) -> str:
        return self.name


def _word(value: Any) -> str:
    """A health or request, represented by its name at run time; "" is no request."""
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
