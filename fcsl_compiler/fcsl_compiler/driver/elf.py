# SPDX-License-Identifier: Apache-2.0
"""The symbols of an ELF file of any processor, as nm lists them: where a C compiler comes from PyPI there is no nm."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import NamedTuple

_TABLE, _DYNAMIC_TABLE = 2, 11  # sh_type
_GLOBAL = 1  # binding; a weak symbol that nobody defines is a hook of the loader
_SECTION, _FILE = 3, 4  # type
_UNDEFINED = 0  # section of a symbol


class Symbols(NamedTuple):
    """Names that a file needs from others, and names that it defines."""

    needed: set[str]
    defined: set[str]


def read_symbols(path: Path, dynamic: bool) -> Symbols:
    """The symbols of an object or, `dynamic`, those that a library shares with others. Raises OSError, and ValueError
    for a file that is not ELF or is damaged."""
    data = path.read_bytes()
    if data[:4] != b"\x7fELF" or len(data) < 6 or data[4] not in (1, 2) or data[5] not in (1, 2):
        raise ValueError("not an ELF file")
    wide, order = data[4] == 2, "<>"[data[5] - 1]
    header = struct.Struct(f"{order}40xQ10xHH" if wide else f"{order}32xI10xHH")
    section = struct.Struct(f"{order}4xI16xQQI12x8x" if wide else f"{order}4xI8xIII12x")
    symbol = struct.Struct(f"{order}IBxH16x" if wide else f"{order}I8xBxH")
    found = Symbols(set(), set())
    try:
        start, size, count = header.unpack_from(data)
        sections = [section.unpack_from(data, start + size * i) for i in range(count)]
        for kind, offset, length, link in sections:
            if kind != (_DYNAMIC_TABLE if dynamic else _TABLE):
                continue
            names = sections[link][1]
            for name, info, place in symbol.iter_unpack(data[offset : offset + length]):
                text = data[names + name : data.index(0, names + name)].decode("utf-8", "replace")
                if place == _UNDEFINED and info >> 4 == _GLOBAL:
                    found.needed.add(text)
                elif place != _UNDEFINED and info & 15 not in (_SECTION, _FILE):
                    found.defined.add(text)
    except (struct.error, IndexError, ValueError):
        raise ValueError("a damaged ELF file") from None
    return found
