# SPDX-License-Identifier: Apache-2.0
"""Structs as values. The records of an algorithm (inputs, parameters, outputs, state) and its `self` are structs,
too."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .types import Type
from .values import IllTyped

_put = object.__setattr__


class Struct:
    """A value with named members. `__fcsl_type__` of its class is its StructType. Members may have any name."""

    __slots__ = ()
    __fcsl_type__: StructType

    def __init__(self, *values: Any, **named: Any):
        members = self.__fcsl_type__.members
        given = dict(zip(members, values, strict=False)) | named
        if len(given) != len(members) or len(values) + len(named) != len(members):
            raise IllTyped(f"{self.__fcsl_type__.name}({', '.join(members)}) built of {', '.join(given)}")
        for name, type_ in members.items():
            _put(self, name, type_.store(given[name]))

    def __setattr__(self, name: str, value: Any) -> None:
        _put(self, name, self.__fcsl_type__.members[name].store(value))

    @property
    def __dict__(self) -> dict[str, Any]:  # type: ignore[override]
        """The members, for `vars` in a debugger."""
        return {name: getattr(self, name) for name in self.__fcsl_type__.members}

    def __repr__(self) -> str:
        parts = (f"{name}={getattr(self, name)!r}" for name in self.__fcsl_type__.members)
        return f"{self.__fcsl_type__.name}({', '.join(parts)})"


class StructType:
    """Members by name, in order. `construct` is the class of its values and constructs one."""

    def __init__(self, name: str, members: Mapping[str, Type]):
        self.name, self.members = name, dict(members)
        self.construct: type[Struct] = type(name, (Struct,), {"__slots__": tuple(members), "__fcsl_type__": self})

    def of(self, values: Mapping[str, Any]) -> Struct:
        """A struct that holds exactly these objects, without copies or checks."""
        made = self.construct.__new__(self.construct)
        for name, value in values.items():
            _put(made, name, value)
        return made

    def zero(self) -> Struct:
        return self.of({name: type_.zero() for name, type_ in self.members.items()})

    def store(self, value: Any) -> Struct:
        if type(value) is not self.construct:
            raise IllTyped(f"{value!r} where {self.name} is needed")
        return self.of({name: type_.store(getattr(value, name)) for name, type_ in self.members.items()})
