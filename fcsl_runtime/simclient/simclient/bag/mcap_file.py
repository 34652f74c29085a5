# SPDX-License-Identifier: Apache-2.0
"""MCAP files as bytes: their index, and a sequential pass that tolerates a missing end."""

from __future__ import annotations

import ctypes
import functools
import os
import struct
import zlib
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import mcap.records as records
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader

from ..errors import BagError
from ..library import runtime_library
from .unpack import LIMIT_BYTES, TooLarge, unlz4, unzstd

_MAGIC = b"\x89MCAP0\r\n"
#: First bytes of other bag formats.
_OTHER_BAGS = {
    b"SQLite": "a bag of sqlite3",
    b"#ROSBAG": "a bag of ROS 1",
    b"\x28\xb5\x2f\xfd": "a bag compressed with zstd",
}
_RECORD_HEAD = struct.Struct("<BQ")
#: Content of the footer record: start of the summary, start of its offsets, checksum.
_FOOTER = struct.Struct("<QQI")
#: Content of a chunk up to its compression name: first and last time, size, checksum, length of the name.
_CHUNK_HEAD = struct.Struct("<QQQII")
#: Most bytes of records outside chunks that are read in one call.
_BLOCK_BYTES = 1 << 20


#: A message: the number of its channel in its file, the time of recording, and the range of its bytes.
ENTRY = np.dtype([("number", "<i8"), ("log_ns", "<i8"), ("begin", "<i8"), ("end", "<i8")])
#: fcsl_mcap_record_t
_RECORD = np.dtype(
    [("begin", "<u8"), ("end", "<u8"), ("log_ns", "<i8"), ("channel", "<u4"), ("opcode", "<u4")], align=True
)
#: Records listed in one call.
_LISTED = 1 << 16


class Batch(NamedTuple):
    """Messages of one file in file order; each ENTRY gives a message's bytes as data[begin:end]."""

    data: bytes
    entries: np.ndarray[Any, Any]


class Scan:
    """One pass over one file without its index; it works on files whose end is missing."""

    def __init__(self, file: Path):
        self.file = file
        self.channels: dict[int, records.Channel] = {}
        self.schemas: dict[int, records.Schema] = {}
        self.damage = ""
        self._count = 0

    def messages(self, topics: Collection[str] | None) -> Iterator[tuple[int, int, bytes]]:
        """(channel number, log time, data) of `topics` (None: all)."""
        for data, entries in self.batches(topics):
            for number, log_ns, begin, end in entries.tolist():
                yield number, log_ns, data[begin:end]

    def batches(self, topics: Collection[str] | None) -> Iterator[Batch]:
        """The messages of `topics` (None: all), many at a time. Stops where the file is damaged, and sets `damage`."""
        intact, why = True, ""
        with self.file.open("rb") as stream:
            try:
                for data in _blocks(stream):
                    at = 0
                    while intact and at < len(data):
                        listed = _list(data, at)
                        intact = len(listed) > 0
                        at = int(listed["end"][-1]) if intact else at
                        entries = self._messages(data, listed, topics)
                        if len(entries):
                            yield Batch(data, entries)
                    if not intact:
                        break
            except TooLarge as error:
                intact, why = False, f" (a chunk {error})"
            except Exception:  # noqa: BLE001  damaged bytes can make mcap and the decompressors below it raise anything
                intact = False
        if not intact:
            self.damage = f"{self.file.name} breaks off after {self._count} messages{why}"

    def _definition(self, record: object) -> None:
        if isinstance(record, records.Channel):
            self.channels[record.id] = record
        elif isinstance(record, records.Schema):
            self.schemas[record.id] = record

    def _messages(self, data: bytes, listed: np.ndarray[Any, Any], topics: Collection[str] | None) -> Any:
        """The messages of `topics` among the records; also reads definitions.

        Raises mcap's errors for damaged records.
        """
        for record in listed[np.isin(listed["opcode"], (Opcode.CHANNEL, Opcode.SCHEMA))]:
            self._definition(_parse_definition(int(record["opcode"]), data[int(record["begin"]) : int(record["end"])]))
        messages = listed[listed["opcode"] == Opcode.MESSAGE]
        self._count += len(messages)
        numbers = np.unique(messages["channel"]).tolist()
        wanted = [n for n in numbers if topics is None or self.channels[n].topic in topics]
        if len(wanted) < len(numbers):
            messages = messages[np.isin(messages["channel"], wanted)]
        entries = np.empty(len(messages), ENTRY)
        for name, column in (("number", "channel"), ("log_ns", "log_ns"), ("begin", "begin"), ("end", "end")):
            entries[name] = messages[column]
        return entries


def _list(data: bytes, begin: int) -> np.ndarray[Any, Any]:
    """The first _LISTED records of `data` from `begin` on; stops at a record that is incomplete."""
    records = np.empty(_LISTED, _RECORD)
    count = _native().fcsl_mcap_records(data, len(data), begin, records.ctypes.data, _LISTED)
    return records[:count]


@functools.cache
def _native() -> ctypes.CDLL:
    library = ctypes.CDLL(str(runtime_library()))
    library.fcsl_mcap_records.restype = ctypes.c_size_t
    library.fcsl_mcap_records.argtypes = [
        ctypes.c_char_p,
        ctypes.c_size_t,
        ctypes.c_size_t,
        ctypes.c_void_p,
        ctypes.c_size_t,
    ]
    return library


def _blocks(stream: BinaryIO) -> Iterator[bytes]:
    """The records of a file in blocks: the content of each chunk, and the records between chunks, collected."""
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
                yield _unpacked(data)
    except Exception as error:  # noqa: BLE001  as above
        damage = error
    if loose:
        yield bytes(loose)
    if damage is not None:
        raise damage


def _unpacked(chunk: bytes) -> bytes:
    """The records of a chunk. Raises TooLarge, ValueError, or the decompressor's errors for damaged data."""
    _, _, size, checksum, name_bytes = _CHUNK_HEAD.unpack_from(chunk)
    if size > LIMIT_BYTES:
        raise TooLarge
    at = _CHUNK_HEAD.size + name_bytes
    compression = chunk[_CHUNK_HEAD.size : at]
    packed = memoryview(chunk)[at + 8 : at + 8 + int.from_bytes(chunk[at : at + 8], "little")]
    if compression == b"zstd":
        data = unzstd(packed)
    elif compression == b"lz4":
        data = unlz4(packed)
    elif compression == b"":
        data = bytes(packed)
    else:
        raise ValueError(f"a chunk is compressed with {compression!r}")
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        raise ValueError("a chunk is damaged")
    return bytes(data)


#: Records that a pass uses; the others are indexes and statistics.
_READ = (Opcode.CHUNK, Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA)


def _records(stream: BinaryIO) -> Iterator[tuple[int, bytes]]:
    """(opcode, content) of the top-level records of an MCAP file up to its footer.

    Raises EOFError if it has no footer.
    """
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
    """The file's index, or None if it is missing, damaged or without statistics."""
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
    """Whether the summary matches the checksum in the footer, if the writer stored one."""
    end = stream.seek(-len(_MAGIC) - _FOOTER.size, os.SEEK_END)
    start, _, checksum = _FOOTER.unpack(stream.read(_FOOTER.size))
    if checksum == 0 or start == 0:
        return True
    stream.seek(start)
    # The checksum covers the file from the summary's start up to the checksum, which is the footer's last field.
    return zlib.crc32(stream.read(end + _FOOTER.size - 4 - start)) == checksum


def check_begin(file: Path) -> None:
    """Raises BagError for a file that is not MCAP, or too short to identify."""
    with file.open("rb") as stream:
        begin = stream.read(len(_MAGIC))
    if not begin:
        raise BagError(f"{file}: empty; nothing was written before the recording was cut off")
    if begin[:5] != _MAGIC[: len(begin)][:5]:
        other = next((name for magic, name in _OTHER_BAGS.items() if begin.startswith(magic)), "")
        hint = f"; it looks like {other}, which simclient.bag reads, and simclient.replay with --map" if other else ""
        raise BagError(f"{file}: not an MCAP file{hint}")
    if len(begin) < len(_MAGIC):
        raise BagError(f"{file}: cut off after {len(begin)} bytes; nothing of the recording is left")
