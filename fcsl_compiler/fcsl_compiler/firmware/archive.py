# SPDX-License-Identifier: Apache-2.0
"""Writes a static library as `ar` does, with its table of symbols: the `ar` of this computer does not know the objects of other
processors."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence

_MAGIC = b"!<arch>\n"
_HEADER_BYTES = 60


def archive(members: Mapping[str, bytes], exported: Mapping[str, Sequence[str]]) -> bytes:
    """The library of these objects by file name. `exported`: the symbols that each defines. The same objects make the same
    bytes."""
    names = b"".join(f"{name}/\n".encode() for name in members)
    symbols = [(symbol, name) for name in members for symbol in exported[name]]
    texts = b"".join(symbol.encode() + b"\0" for symbol, _ in symbols)
    table_bytes = 4 + 4 * len(symbols) + len(texts)
    at = len(_MAGIC) + _HEADER_BYTES + _even(table_bytes) + _HEADER_BYTES + _even(len(names))
    places: dict[str, int] = {}
    for name, content in members.items():
        places[name] = at
        at += _HEADER_BYTES + _even(len(content))
    table = struct.pack(f">I{len(symbols)}I", len(symbols), *(places[name] for _, name in symbols)) + texts
    parts = [_MAGIC, _member("/", table), _member("//", names)]
    start = 0
    for name, content in members.items():
        parts.append(_member(f"/{start}", content))
        start += len(name.encode()) + 2
    return b"".join(parts)


def _even(size: int) -> int:
    return size + size % 2


def _member(name: str, content: bytes) -> bytes:
    head = f"{name:<16}{0:<12}{0:<6}{0:<6}{'100644':<8}{len(content):<10}`\n".encode()
    return head + content + b"\n" * (len(content) % 2)
