# SPDX-License-Identifier: Apache-2.0
"""Structs as values. The records of an algorithm (inputs, parameters, outputs, state) and its `self` are structs, too.

Member `x` is kept in the slot `_x`, which rewritten code uses where the types are known. The property `x` checks and
copies what is stored, also what a debugger's console assigns. No name of a program begins with `_`.
"""

from __future__ import annotations

from collections.abc import Mapping
from operator import attrgetter
from typing import Any, ClassVar

from .types import Type
from .values import IllTyped

_new = object.__new__


def slot(name: str) -> str:
    """The slot of a member."""
    return f"_{name}"


class Struct:
    """A value with named members. `__fcsl_type__` of its class is its StructType. Members may have any name."""

    __slots__ = ()
    __fcsl_type__: ClassVar[StructType]

    def __init__(self, *values: Any, **named: Any):
        members = self.__fcsl_type__.members
        given = dict(zip(members, values, strict=False)) | named
        if len(given) != len(members) or len(values) + len(named) != len(members):
            raise IllTyped(f"{self.__fcsl_type__.name}({', '.join(members)}) built of {', '.join(given)}")
        for name, type_ in members.items():
            setattr(self, slot(name), type_.store(given[name]))

    @property
    def __dict__(self) -> dict[str, Any]:  # type: ignore[override]
        """The members, for `vars` in a debugger."""
        return {name: getattr(self, name) for name in self.__fcsl_type__.members}

    def __repr__(self) -> str:
        parts = (f"{name}={getattr(self, name)!r}" for name in self.__fcsl_type__.members)
        return f"{self.__fcsl_type__.name}({', '.join(parts)})"


def _checked(name: str, type_: Type) -> property:
    """Member `name` for readers, and for writers whose value is not known to have its type."""

    def put(struct: Struct, value: Any) -> None:
        setattr(struct, slot(name), type_.store(value))

    return property(attrgetter(slot(name)), put)


class StructType:
    """Members by name, in order. `construct` is the class of its values and constructs one."""

    def __init__(self, name: str, members: Mapping[str, Type]):
        self.name, self.members = name, dict(members)
        self.arrays: dict[tuple[int, ...], Any] = {}
        own = {"__slots__": tuple(map(slot, members)), "__fcsl_type__": self}
        checked = {member: _checked(member, type_) for member, type_ in members.items()}
        self.construct: type[Struct] = type(name, (Struct,), own | checked)

    def of(self, values: Mapping[str, Any]) -> Struct:
        """A struct that holds exactly these objects, without copies or checks."""
        made = _new(self.construct)
        for name, value in values.items():
            setattr(made, slot(name), value)
        return made

    def zero(self) -> Struct:
        return self.of({name: type_.zero() for name, type_ in self.members.items()})

    def store(self, value: Any) -> Struct:
        if type(value) is not self.construct:
            raise IllTyped(f"{value!r} where {self.name} is needed")
        return self.of({name: type_.store(getattr(value, slot(name))) for name, type_ in self.members.items()})
