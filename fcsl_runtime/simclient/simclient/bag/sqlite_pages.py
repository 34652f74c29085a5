# SPDX-License-Identifier: Apache-2.0
"""The messages in the pages of a damaged sqlite3 file, for which sqlite itself has no way: the pages that lead to the
others may be those that are lost.

Rows of a table are in its leaf pages. A row is a record of columns, whose types tell rows of `messages` from others: id
(null, because it is the number of the row), topic_id, timestamp, data. What does not fit the leaf is in a chain of further
pages. The format: https://www.sqlite.org/fileformat2.html
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

_HEADER_BYTES, _LEAF, _LEAF_HEAD_BYTES = 100, 13, 8
#: Bytes of an integer column by its type; the types 8 and 9 are 0 and 1.
_INTEGERS = {1: 1, 2: 2, 3: 3, 4: 4, 5: 6, 6: 8, 8: 0, 9: 0}
_VARINT_BYTES_MAX = 9


class Row(NamedTuple):
    """A message: the number of its row, its topic, its time of recording, and where its data are."""

    row: int
    topic: int
    log_ns: int
    parts: tuple[tuple[int, int], ...]


class SqlitePages:
    """A file that begins as an sqlite3 file does. `rows` are those of its messages that are whole, by their number."""

    def __init__(self, path: Path):
        with path.open("rb") as stream:
            self._file = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
        size = int.from_bytes(self._file[16:18], "big")
        self._page_bytes = 1 << 16 if size == 1 else size
        self._usable = self._page_bytes - self._file[20]
        self.rows: dict[int, Row] = {}
        # Chains that meet, or go round in circles, are damage: no page is in two of them.
        self._links_left = 2 * len(self._file) // self._page_bytes if self._page_bytes else 0
        if self._page_bytes < 512 or self._usable < 480:  # the smallest that there are
            return
        for begin in range(0, len(self._file) - self._page_bytes + 1, self._page_bytes):
            for row in self._rows_of(begin):
                self.rows.setdefault(row.row, row)
        self.rows = dict(sorted(self.rows.items()))

    def data(self, row: int) -> bytes:
        return b"".join(self._file[begin:end] for begin, end in self.rows[row].parts)

    def _rows_of(self, page: int) -> Iterator[Row]:
        """The messages that begin in a page."""
        head = page + (_HEADER_BYTES if page == 0 else 0)
        if self._file[head] != _LEAF:
            return
        count = int.from_bytes(self._file[head + 3 : head + 5], "big")
        cells = head + _LEAF_HEAD_BYTES
        for at in range(cells, min(cells + 2 * count, page + self._page_bytes - 1), 2):
            try:
                row = self._row(page, page + int.from_bytes(self._file[at : at + 2], "big"))
            except (IndexError, KeyError):
                row = None  # no row of a message
            if row is not None:
                yield row

    def _row(self, page: int, cell: int) -> Row | None:
        """The message in a cell. Raises IndexError or KeyError where there is none."""
        payload, at = self._varint(cell)
        number, at = self._varint(at)
        parts = self._parts(page, at, payload)
        header, behind = self._varint(at)
        body, types = min(at + header, page + self._usable), []
        while behind < body:
            kind, behind = self._varint(behind)
            types.append(kind)
        if number >= 1 << 63 or len(types) != 4 or types[0] != 0 or types[3] < 12 or types[3] % 2 or not parts:
            return None
        sizes = [_INTEGERS[kind] for kind in types[1:3]]
        if payload != header + sum(sizes) + (types[3] - 12) // 2 or body + sum(sizes) > parts[0][1]:
            return None
        topic = self._integer(types[1], body)
        log_ns = self._integer(types[2], body + sizes[0])
        return Row(number, topic, log_ns, ((body + sum(sizes), parts[0][1]), *parts[1:]))

    def _parts(self, page: int, at: int, payload: int) -> list[tuple[int, int]]:
        """Where the payload of a cell is, in the leaf and in further pages; empty if some of it is not there."""
        usable = self._usable
        local, most, least = payload, usable - 35, (usable - 12) * 32 // 255 - 23
        if payload > most:
            local = least + (payload - least) % (usable - 4)
            local = local if local <= most else least
        parts = [(at, at + local)]
        if at + local > page + usable:
            return []
        left, link = payload - local, at + local
        while left > 0:
            begin = (int.from_bytes(self._file[link : link + 4], "big") - 1) * self._page_bytes
            self._links_left -= 1
            if begin < self._page_bytes or begin + self._page_bytes > len(self._file) or self._links_left < 0:
                return []
            part = min(left, usable - 4)
            parts.append((begin + 4, begin + 4 + part))
            left, link = left - part, begin
        return parts

    def _varint(self, at: int) -> tuple[int, int]:
        """(value, position behind it)"""
        value = 0
        for place in range(_VARINT_BYTES_MAX):
            byte = self._file[at + place]
            if place == _VARINT_BYTES_MAX - 1:
                return value << 8 | byte, at + place + 1
            value = value << 7 | byte & 0x7F
            if byte < 0x80:
                break
        return value, at + place + 1

    def _integer(self, kind: int, at: int) -> int:
        size = _INTEGERS[kind]
        return int.from_bytes(self._file[at : at + size], "big", signed=True) if size else kind - 8
