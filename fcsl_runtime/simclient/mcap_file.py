# SPDX-License-Identifier: Apache-2.0
"""MCAP files as bytes: their index, and a pass over one file that survives a missing end."""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import mcap.records as records
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.stream_reader import get_chunk_data_stream

from .errors import BagError

_MAGIC = b"\x89MCAP0\r\n"
_RECORD_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
#: Content of the footer record: start of the summary, start of its offsets, checksum.
_FOOTER = struct.Struct("<QQI")
#: Of records outside chunks that are read at once.
_BLOCK_BYTES = 1 << 20


#: (number of the channel in its file, time of recording in ns, begin, end) of a message.
Entry = tuple[int, int, int, int]


class Batch(NamedTuple):
    """Messages of one file, in its order; the bytes of each are data[begin:end]."""

    data: bytes
    entries: list[Entry]


class Scan:
    """One pass over one file, without its index: works on files whose end is missing."""

    def __init__(self, file: Path):
        self.file = file
        self.channels: dict[int, records.Channel] = {}
        self.schemas: dict[int, records.Schema] = {}
        self.damage = ""
        self._count = 0

    def messages(self, topics: Collection[str] | None) -> Iterator[tuple[int, int, bytes]]:
        """(channel number, log time, data) of `topics` (None: all)."""
        for data, entries in self.batches(topics):
            for number, log_ns, begin, end in entries:
                yield number, log_ns, data[begin:end]

    def batches(self, topics: Collection[str] | None) -> Iterator[Batch]:
        """The messages of `topics` (None: all), many at a time. Ends where the file is damaged, and sets `damage`."""
        intact = True
        with self.file.open("rb") as stream:
            try:
                for data in _blocks(stream):
                    entries: list[Entry] = []
                    intact = self._walk(data, topics, entries)
                    if entries:
                        yield Batch(data, entries)
                    if not intact:
                        break
            except Exception:  # noqa: BLE001  damaged bytes can make mcap and the decompressors below it raise anything
                intact = False
        if not intact:
            self.damage = f"{self.file.name} breaks off after {self._count} messages"

    def _definition(self, record: object) -> None:
        if isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Schema):
            self.schemas[record.id] = record

    def _walk(self, data: bytes, topics: Collection[str] | None, entries: list[Entry]) -> bool:
        """Appends the messages among the records of `data`; False where damage ends it."""
        at, end = 0, len(data)
        wanted: dict[int, bool] = {}
        try:
            while at < end:
                opcode, size = _RECORD_HEAD.unpack_from(data, at)
                at += _RECORD_HEAD.size
                if opcode == Opcode.MESSAGE:
                    number, _, log_ns, _ = _MESSAGE_HEAD.unpack_from(data, at)
                    if number not in wanted:
                        wanted[number] = topics is None or self.channels[number].topic in topics
                    self._count += 1
                    if wanted[number]:
                        entries.append((number, log_ns, at + _MESSAGE_HEAD.size, at + size))
                elif opcode in (Opcode.CHANNEL, Opcode.SCHEMA):
                    self._definition(_parse_definition(opcode, data[at : at + size]))
                at += size
        except Exception:  # noqa: BLE001  as above
            return False
        return True


def _blocks(stream: BinaryIO) -> Iterator[bytes]:
    """The records of a file in blocks: the content of each chunk, and what stands between chunks, gathered."""
    loose = bytearray()
    damage: Exception | None = None
    try:
        for opcode, data in _records(stream):
            if opcode != Opcode.CHUNK:
                loose += _RECORD_HEAD.pack(opcode, len(data)) + data
            if loose and (opcode == Opcode.CHUNK or len(loose) > _BLOCK_BYTES):
                yield bytes(loose)
                loose.clear()
            if opcode == Opcode.CHUNK:
                chunk = records.Chunk.read(ReadDataStream(BytesIO(data)))
                yield get_chunk_data_stream(chunk, validate_crc=True)[0].read(chunk.uncompressed_size)
    except Exception as error:  # noqa: BLE001  as above
        damage = error
    if loose:
        yield bytes(loose)
    if damage is not None:
        raise damage


#: Records that matter to a pass; the others are indexes and statistics.
_READ = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA)


def _records(stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """(opcode, content) of the top-level records of an MCAP file up to its footer. Raises EOFError when it has none."""
    if stream.read(len(_MAGIC)) != _MAGIC:
        raise EOFError
    size = os.fstat(stream.fileno()).st_size
    while True:
        opcode, length = _RECORD_HEAD.unpack(stream.read(_RECORD_HEAD.size))
        if opcode == Opcode.FOOTER:
            return
        if length > size - stream.tell():
            raise EOFError
        if opcode in _READ:
            yield opcode, stream.read(length)
        else:
            stream.seek(length, os.SEEK_CUR)


def _parse_definition(opcode: int, data: bytes) -> records.Channel | records.Schema:
    stream = ReadDataStream(BytesIO(data))
    return records.Channel.read(stream) if opcode == Opcode.CHANNEL else records.Schema.read(stream)


def read_summary(file: Path) -> Any:
    """The file's index, or None when it is missing, damaged or without statistics."""
    try:
        with file.open("rb") as stream:
            if not _summary_intact(stream):
                return None
            stream.seek(0)
            summary = SeekingReader(stream).get_summary()
    except Exception:  # noqa: BLE001  a damaged end can make mcap raise anything; the file is then read from its start
        return None
    return summary if summary is not None and summary.statistics is not None else None


def _summary_intact(stream: BinaryIO) -> bool:
    """Whether the checksum in the footer, if its writer made one, is that of the summary."""
    end = stream.seek(-len(_MAGIC) - _FOOTER.size, os.SEEK_END)
    start, _, checksum = _FOOTER.unpack(stream.read(_FOOTER.size))
    if checksum == 0 or start == 0:
        return True
    stream.seek(start)
    # It covers everything from the summary's start up to itself, the last field of the footer.
    return zlib.crc32(stream.read(end + _FOOTER.size - 4 - start)) == checksum


def check_begin(file: Path) -> None:
    """Raises BagError for a file that cannot be MCAP, or that ends before it says so."""
    with file.open("rb") as stream:
        begin = stream.read(len(_MAGIC))
    if not begin:
        raise BagError(f"{file}: empty; nothing was written before the recording was cut off")
    if begin[:5] != _MAGIC[: len(begin)][:5]:
        raise BagError(f"{file}: not an MCAP file")
    if len(begin) < len(_MAGIC):
        raise BagError(f"{file}: cut off after {len(begin)} bytes; nothing of the recording is left")
