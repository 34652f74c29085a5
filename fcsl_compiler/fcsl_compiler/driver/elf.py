# SPDX-License-Identifier: Apache-2.0
"""ELF files of any processor: their symbols, as nm lists them, sections, and references. Where a C compiler comes from PyPI
there is no nm, and that of this computer reads no objects of others."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

_TABLE, _DYNAMIC_TABLE = 2, 11  # sh_type
_RELOCATIONS = {4: 1, 9: 0}  # sh_type: RELA and REL; with an addend or without
_NO_BITS = 8
_WRITTEN, _ALLOCATED, _EXECUTED = 1, 2, 4  # sh_flags
_GLOBAL = 1  # binding; a weak symbol that nobody defines is a hook of the loader
_FUNCTION, _SECTION, _FILE = 2, 3, 4  # type
_UNDEFINED = 0  # section of a symbol
_X86_64 = 62


class Symbols(NamedTuple):
    """Names that a file needs from others, and names that it defines."""

    needed: set[str]
    defined: set[str]


class Section(NamedTuple):
    """A section that is loaded. `kind` is "code", "constants", "data" (from flash to RAM) or "zeros"."""

    kind: str
    bytes: int


class ObjectFile(NamedTuple):
    """An object: sections by number; symbols that it offers to others, and functions of its own, by name; and for each section
    those that it refers to, as numbers, or as names where they are elsewhere."""

    sections: dict[int, Section]
    exported: dict[str, int]
    functions: dict[str, int]
    sizes: dict[str, int]  # of the symbols
    references: dict[int, set[int | str]]
    is_x86_64: bool


class _Symbol(NamedTuple):
    name: str
    binding: int
    type: int
    section: int
    size: int


def read_symbols(path: Path, dynamic: bool) -> Symbols:
    """The symbols of an object or, `dynamic`, those that a library shares with others. Raises OSError, and ValueError
    for a file that is not ELF or is damaged."""
    file = _Elf(path.read_bytes())
    found = Symbols(set(), set())
    with _damage():
        for symbol in file.symbols(_DYNAMIC_TABLE if dynamic else _TABLE):
            if symbol.section == _UNDEFINED and symbol.binding == _GLOBAL:
                found.needed.add(symbol.name)
            elif symbol.section != _UNDEFINED and symbol.type not in (_SECTION, _FILE):
                found.defined.add(symbol.name)
    return found


def read_object(path: Path) -> ObjectFile:
    """Raises OSError, and ValueError for a file that is not ELF or is damaged."""
    file = _Elf(path.read_bytes())
    found = ObjectFile({}, {}, {}, {}, {}, file.machine == _X86_64)
    with _damage():
        for number, (kind, flags, _, size, _, _) in enumerate(file.sections):
            if flags & _ALLOCATED:
                data = "zeros" if kind == _NO_BITS else "data"
                found.sections[number] = Section(
                    "code" if flags & _EXECUTED else data if flags & _WRITTEN else "constants", size
                )
        symbols = list(file.symbols(_TABLE))
        for symbol in symbols:
            if symbol.section in found.sections and symbol.name:
                found.sizes[symbol.name] = symbol.size
                if symbol.binding >= _GLOBAL:
                    found.exported[symbol.name] = symbol.section
                if symbol.type == _FUNCTION:
                    found.functions[symbol.name] = symbol.section
        for section, index in file.references():
            to = symbols[index]
            if section in found.sections and (to.section in found.sections or (to.section == _UNDEFINED and to.name)):
                of = found.references.setdefault(section, set())
                of.add(to.name if to.section == _UNDEFINED else to.section)
    return found


@contextmanager
def _damage() -> Iterator[None]:
    """Makes ValueError of what reading a damaged file raises."""
    try:
        yield
    except (struct.error, IndexError, ValueError):
        raise ValueError("a damaged ELF file") from None


class _Elf:
    """The tables of a file. `sections`: type, flags, offset, size, link, info."""

    def __init__(self, data: bytes):
        if data[:4] != b"\x7fELF" or len(data) < 6 or data[4] not in (1, 2) or data[5] not in (1, 2):
            raise ValueError("not an ELF file")
        self._data, self._wide, self._order = data, data[4] == 2, "<>"[data[5] - 1]
        header = struct.Struct(f"{self._order}18xH20xQ10xHH" if self._wide else f"{self._order}18xH12xI10xHH")
        section = struct.Struct(f"{self._order}4xIQ8xQQII8x8x" if self._wide else f"{self._order}4xII4xIIII4x4x")
        with _damage():
            self.machine, start, size, count = header.unpack_from(data)
            self.sections = [section.unpack_from(data, start + size * i) for i in range(count)]

    def symbols(self, table: int) -> Iterator[_Symbol]:
        entry = struct.Struct(f"{self._order}IBxH8xQ" if self._wide else f"{self._order}I4xIBxH")
        for kind, _, offset, length, link, _ in self.sections:
            if kind != table:
                continue
            names = self.sections[link][2]
            for fields in entry.iter_unpack(self._data[offset : offset + length]):
                name, info, section, size = fields if self._wide else (fields[0], fields[2], fields[3], fields[1])
                text = self._data[names + name : self._data.index(0, names + name)].decode("utf-8", "replace")
                yield _Symbol(text, info >> 4, info & 15, section, size)

    def references(self) -> Iterator[tuple[int, int]]:
        """The section that refers, and the index of the symbol, of every relocation."""
        for kind, _, offset, length, _, info in self.sections:
            if kind not in _RELOCATIONS:
                continue
            entry = struct.Struct(
                f"{self._order}{'8xQ8x' if self._wide else '4xI4x'}"[: None if _RELOCATIONS[kind] else -2]
            )
            for (word,) in entry.iter_unpack(self._data[offset : offset + length]):
                yield info, word >> (32 if self._wide else 8)
