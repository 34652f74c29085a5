# SPDX-License-Identifier: Apache-2.0
"""The records of an MCAP file one after another, and what lies between two of them where the file is damaged."""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from typing import BinaryIO, NamedTuple

from mcap.opcode import Opcode

MAGIC = b"\x89MCAP0\r\n"
#: Opcode and length.
RECORD_HEAD = struct.Struct("<BQ")
#: Content of a chunk up to its compression name: first and last time, size, checksum, length of the name.
CHUNK_HEAD = struct.Struct("<QQQII")
#: The private record, which readers pass over, that repair.py makes of a part that cannot be read; its content ends so.
LOST, LOST_MARK = 0x81, b"fcsl: lost"
#: What stands in the header of a chunk, RECORD_HEAD.size + CHUNK_HEAD.size - 4 bytes behind its beginning.
_COMPRESSIONS = (b"\x04\0\0\0zstd", b"\x03\0\0\0lz4")
_MARK_AT = RECORD_HEAD.size + CHUNK_HEAD.size - 4
#: Bytes of a file in which the next chunk is looked for at a time, and those that two looks share.
_LOOK_BYTES, _SHARED_BYTES = 1 << 20, 256


class Record(NamedTuple):
    """A record at file[begin:end], whose content begins at `content`."""

    opcode: int
    begin: int
    content: int
    end: int


class Gap(NamedTuple):
    """file[begin:end], which is no record."""

    begin: int
    end: int


class Walk:
    """The data section of a file, or from the record at `begin` on. `ended`: it has its end, which is at `end`; otherwise it
    breaks off there.
    """

    def __init__(self, stream: BinaryIO, begin: int = 0):
        self._stream = stream
        self._begin = begin
        self._size = os.fstat(stream.fileno()).st_size
        self.ended = False
        self.end = 0

    def __iter__(self) -> Iterator[Record | Gap]:
        at = self._begin
        self._stream.seek(0)
        if at == 0 and self._stream.read(len(MAGIC)) == MAGIC:
            at = len(MAGIC)
        while True:
            record = self._record(at)
            if record is not None and record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self.ended, self.end = True, at
                return
            if record is None:
                chunk = self._next_chunk(at + 1)
                if chunk is None:
                    self.end = at
                    return
                yield Gap(at, chunk)
                at = chunk
            else:
                yield record
                at = record.end

    def _record(self, at: int) -> Record | None:
        """The record at `at`, or None if there is none that the file holds whole."""
        self._stream.seek(at)
        head = self._stream.read(RECORD_HEAD.size)
        if at == 0 or len(head) < RECORD_HEAD.size:
            return None
        opcode, length = RECORD_HEAD.unpack(head)
        content = at + RECORD_HEAD.size
        if opcode == 0 or length > self._size - content:
            return None
        return Record(opcode, at, content, content + length)

    def _next_chunk(self, begin: int) -> int | None:
        """Where the next compressed chunk begins at or after `begin`."""
        for look in range(begin, self._size, _LOOK_BYTES - _SHARED_BYTES):
            self._stream.seek(look)
            data = self._stream.read(_LOOK_BYTES)
            found = [at for mark in _COMPRESSIONS for at in _marks(data, mark) if self._is_chunk(look + at)]
            if found:
                return look + min(found)
        return None

    def _is_chunk(self, at: int) -> bool:
        """Whether a chunk begins at `at`, whose compression has a name of up to 4 bytes."""
        record = self._record(at)
        if record is None or record.opcode != Opcode.CHUNK:
            return False
        self._stream.seek(record.content)
        head = self._stream.read(CHUNK_HEAD.size + 12)
        if len(head) < CHUNK_HEAD.size + 12:
            return False
        behind = CHUNK_HEAD.size + CHUNK_HEAD.unpack_from(head)[4]
        packed = int.from_bytes(head[behind : behind + 8], "little")
        return behind + 8 + packed == record.end - record.content


def _marks(data: bytes, mark: bytes) -> Iterator[int]:
    """Where chunks would begin, going by the name of their compression."""
    at = data.find(mark)
    while at >= 0:
        if at >= _MARK_AT:
            yield at - _MARK_AT
        at = data.find(mark, at + 1)
