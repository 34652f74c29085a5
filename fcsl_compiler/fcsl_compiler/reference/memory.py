# SPDX-License-Identifier: Apache-2.0
"""Reads and writes values in the flat memory of a machine by paths of its field table."""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .arrays import Array, ArrayType
from .structs import StructType
from .types import SCALARS, Scalar, Type

#: Offsets (bytes) of every field by its path (fcsl_machine.h), and of items that the table does not list:
#: `machine.current`, `<instance>.inject_overrun|inject_fault`, `channels.<channel>.attached|fresh|sample_age`.
Layout = Mapping[str, int]
Memory = bytearray | memoryview

HEALTH = ("nominal", "degraded", "failed", "stale")


@dataclass(frozen=True)
class Codec:
    """Reads and writes a value of one type at one path."""

    read: Callable[[Memory], Any]
    write: Callable[[Memory, Any], None]


def codec(type_: Type, path: str, layout: Layout, requests: Sequence[str]) -> Codec:
    """Codec for a scalar, array or struct whose leaves are below `path`. `requests`: the machine's requests in
    order."""
    if isinstance(type_, StructType):
        return _of_struct(type_, path, layout, requests)
    if isinstance(type_, ArrayType):
        if type_.element is SCALARS["Health"]:
            return _of_words(type_, layout[path], HEALTH)
        if type_.element is SCALARS["TransitionRequest"]:
            return _of_words(type_, layout[path], ("", *requests))
        if isinstance(type_.element, Scalar):
            return _of_numbers(type_, type_.element, layout[path])
        return _of_structs(type_, path, layout, requests)
    assert isinstance(type_, Scalar)
    if type_ is SCALARS["Health"]:
        return _of_word(layout[path], HEALTH)
    if type_ is SCALARS["TransitionRequest"]:
        return _of_word(layout[path], ("", *requests))
    return _of_number(type_, layout[path])


def _of_number(type_: Scalar, offset: int) -> Codec:
    one, of = struct.Struct(f"={type_.code}"), type_.of

    def read(memory: Memory) -> Any:
        return of(one.unpack_from(memory, offset)[0])

    def write(memory: Memory, value: Any) -> None:
        one.pack_into(memory, offset, value)

    return Codec(read, write)


def _of_word(offset: int, words: Sequence[str]) -> Codec:
    one = struct.Struct("=i")

    def read(memory: Memory) -> Any:
        return words[one.unpack_from(memory, offset)[0]]

    def write(memory: Memory, value: Any) -> None:
        one.pack_into(memory, offset, words.index(value))

    return Codec(read, write)


def _of_words(type_: ArrayType, offset: int, words: Sequence[str]) -> Codec:
    all_ = struct.Struct(f"={type_.count}i")

    def read(memory: Memory) -> Any:
        return Array(type_.element, type_.shape, [words[n] for n in all_.unpack_from(memory, offset)])

    def write(memory: Memory, value: Any) -> None:
        all_.pack_into(memory, offset, *map(words.index, value.data))

    return Codec(read, write)


def _of_numbers(type_: ArrayType, element: Scalar, offset: int) -> Codec:
    all_, of = struct.Struct(f"={type_.count}{element.code}"), element.of
    plain = of in (float, bool)  # unpacking already returns this type

    def read(memory: Memory) -> Any:
        found = all_.unpack_from(memory, offset)
        return Array(element, type_.shape, list(found) if plain else [of(v) for v in found])

    def write(memory: Memory, value: Any) -> None:
        all_.pack_into(memory, offset, *value.data)

    return Codec(read, write)


def _of_structs(type_: ArrayType, path: str, layout: Layout, requests: Sequence[str]) -> Codec:
    indices = [""]
    for extent in type_.shape:
        indices = [f"{index}[{i}]" for index in indices for i in range(extent)]
    parts = [codec(type_.element, path + index, layout, requests) for index in indices]

    def read(memory: Memory) -> Any:
        return Array(type_.element, type_.shape, [part.read(memory) for part in parts])

    def write(memory: Memory, value: Any) -> None:
        for part, item in zip(parts, value.data, strict=True):
            part.write(memory, item)

    return Codec(read, write)


class RecordCodec:
    """Reads and writes the fields of an instance's record below `path`."""

    def __init__(self, type_: StructType, path: str, layout: Layout, requests: Sequence[str]):
        self._parts = [(n, codec(member, f"{path}.{n}", layout, requests)) for n, member in type_.members.items()]

    def values(self, memory: Memory) -> dict[str, Any]:
        return {name: part.read(memory) for name, part in self._parts}

    def write(self, memory: Memory, value: Any) -> None:
        """Writes the record's fields from `value`, which may have additional fields."""
        for name, part in self._parts:
            part.write(memory, getattr(value, name))


def _of_struct(type_: StructType, path: str, layout: Layout, requests: Sequence[str]) -> Codec:
    parts = {name: codec(member, f"{path}.{name}", layout, requests) for name, member in type_.members.items()}

    def read(memory: Memory) -> Any:
        return type_.of({name: part.read(memory) for name, part in parts.items()})

    def write(memory: Memory, value: Any) -> None:
        for name, part in parts.items():
            part.write(memory, getattr(value, name))

    return Codec(read, write)


def from_json(type_: Type, value: Any) -> Any:
    """Converts a value of the machine JSON: nested lists for arrays, objects for structs, names for healths."""
    if isinstance(type_, StructType):
        return type_.of({name: from_json(member, value[name]) for name, member in type_.members.items()})
    if isinstance(type_, ArrayType):
        flat = [value]
        for _ in type_.shape:
            flat = [item for row in flat for item in row]
        return Array(type_.element, type_.shape, [from_json(type_.element, item) for item in flat])
    return type_.store(value)
