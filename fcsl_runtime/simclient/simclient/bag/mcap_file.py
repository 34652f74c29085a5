# SPDX-License-Identifier: Apache-2.0
"""MCAP files as bytes: their index, and a sequential pass that goes on behind damage."""

from __future__ import annotations

import ctypes
import functools
import os
import struct
import zlib
from collections.abc import Callable, Collection, Generator, Iterable, Iterator
from contextlib import closing, contextmanager
from functools import partial
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import mcap.records as records
import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader

from ..errors import BagError
from ..library import Prototypes, bind_runtime, runtime_library
from .batch import ENTRY, Batch
from .losses import Loss, Losses
from .mcap_walk import CHUNK_HEAD, LOST, LOST_MARK, MAGIC, RECORD_HEAD, Gap, Record, Walk
from .read_ahead import ahead
from .time_order import sorted_by_time
from .unpack import LIMIT_BYTES, TooLarge, unlz4, unzstd

#: First bytes of other bag formats.
_OTHER_BAGS = {
    b"SQLite": "a bag of sqlite3",
    b"#ROSBAG": "a bag of ROS 1",
    b"\x28\xb5\x2f\xfd": "a bag compressed with zstd",
}
#: Content of the footer record: start of the summary, start of its offsets, checksum.
_FOOTER = struct.Struct("<QQI")
#: An end without a summary: the records DataEnd and Footer, and the magic.
BARE_END_BYTES = RECORD_HEAD.size + 4 + RECORD_HEAD.size + _FOOTER.size + len(MAGIC)
#: Records outside chunks that a pass uses; the others are indexes and statistics.
_LOOSE = (Opcode.MESSAGE, Opcode.CHANNEL, Opcode.SCHEMA)
#: Most bytes that all chunks of a file unpack to: some in any case, and this many times the file's size. Recordings stay
#: far below the ratio, but for such as hold little else than large messages of one value.
_FREE_BYTES, _RATIO = 1 << 30, 1000
#: Most bytes of records outside chunks that are read in one call.
_BLOCK_BYTES = 1 << 20
#: Content of a message record up to its data: channel, number, times of recording and of publishing.
_MESSAGE_HEAD = struct.Struct("<HIQQ")
#: No message is earlier.
_FIRST_NS = -(1 << 63)


#: fcsl_mcap_record_t
_RECORD = np.dtype(
    [("begin", "<u8"), ("end", "<u8"), ("log_ns", "<i8"), ("channel", "<u4"), ("opcode", "<u4")], align=True
)
#: Records listed in one call.
_LISTED = 1 << 16


class Scan:
    """One pass over one file without its index; it works on files that are damaged or whose end is missing.

    `known` are definitions from elsewhere, the file's index for one: a damaged chunk may hold the only others.
    """

    def __init__(self, file: Path, known: Any = None):
        self.file = file
        self.channels: dict[int, records.Channel] = dict(known.channels) if known else {}
        self.schemas: dict[int, records.Schema] = dict(known.schemas) if known else {}
        #: Bytes read so far.
        self.position = 0
        #: Whether the file has an end of its data section; None before the pass is over.
        self.ended: bool | None = None
        #: Bytes from there up to the end of the file.
        self.behind = 0
        self.count = 0
        self._losses = Losses()

    @property
    def damage(self) -> str:
        """What the pass up to now could not read, as text; empty if there is nothing of that kind."""
        end = "" if self.ended is not False else f"breaks off after {self.count} messages"
        text = "; ".join(part for part in (str(self._losses), end) if part)
        return f"{self.file.name} {text}" if text else ""

    @property
    def lost(self) -> int:
        """Parts that the pass up to now could not read."""
        return len(self._losses.parts) + bool(self._losses.undefined)

    @property
    def parts(self) -> list[Loss]:
        """Those parts that the file has, but that cannot be read."""
        return self._losses.parts

    def messages(self, topics: Collection[str] | None) -> Iterator[tuple[int, int, bytes]]:
        """(channel number, log time, data) of `topics` (None: all)."""
        for data, entries in self.batches(topics):
            for number, log_ns, begin, end in entries.tolist():
                yield number, log_ns, data[begin:end]

    def batches(self, topics: Collection[str] | None, begin: int = 0) -> Iterator[Batch]:
        """The messages of `topics` (None: all) in the order of the file, many at a time, from the record at `begin` on; some
        batches are empty.
        """
        with self.file.open("rb") as stream:
            walk = Walk(stream, begin)
            with closing(_read_ahead(self.file, _pieces(stream, walk))) as blocks:
                for block in blocks:
                    self.position = block.end
                    yield from self._listed(block, topics)
        self._ends(walk)

    def chunk(self, begin: int, topics: Collection[str] | None) -> Iterator[Batch]:
        """Those of the chunk at `begin` alone."""
        with self.file.open("rb") as stream:
            pieces = [next(_pieces(stream, Walk(stream, begin)))]
        for block in _blocks(self.file, pieces):
            yield from self._listed(block, topics)

    @contextmanager
    def parts_by_time(
        self, topics: Collection[str] | None
    ) -> Iterator[list[tuple[int, Callable[[], Iterator[Batch]]]]]:
        """The parts of the file in the order in which they must be read: the time of the first message, and a function
        that gives the messages of `topics` (None: all) in the order of time.
        """
        with self.file.open("rb") as stream:
            walk = Walk(stream)
            pieces = sorted(_pieces(stream, walk), key=lambda piece: piece.first_ns)
        self._ends(walk)
        with closing(_read_ahead(self.file, pieces)) as blocks:
            yield [(p.first_ns, partial(self._by_time, blocks, p.first_ns, topics)) for p in pieces]

    def _by_time(self, blocks: Iterator[_Block], first_ns: int, topics: Collection[str] | None) -> Iterator[Batch]:
        block = next(blocks)
        self.position += block.end - block.begin
        found = [batch.entries for batch in self._listed(block, topics)]
        if found:
            batch = sorted_by_time(Batch(block.data, np.concatenate(found)))
            self._losses.misdated += int(np.count_nonzero(batch.entries["log_ns"] < first_ns))
            yield batch

    def _ends(self, walk: Walk) -> None:
        self.ended, self.behind = walk.ended, self.file.stat().st_size - walk.end

    def _listed(self, block: _Block, topics: Collection[str] | None) -> Iterator[Batch]:
        """The messages of a block up to where it is damaged."""
        if block.why:
            self._losses.parts.append(Loss(block.begin, block.end, block.why, block.span_ns))
        at = 0
        while at < len(block.data):
            listed = _list(block.data, at)
            try:
                entries = self._messages(block.data, listed, topics)
            except Exception:  # noqa: BLE001  damaged definitions can make mcap raise anything
                listed = listed[:0]
            if not len(listed):
                self._losses.parts.append(Loss(block.begin, block.end, "a record in it is damaged", block.span_ns))
                return
            at = int(listed["end"][-1])
            yield Batch(block.data, entries)

    def _definition(self, record: object) -> None:
        """The first definition of a number counts: MCAP has no other, so that a second one is damage."""
        if isinstance(record, records.Channel):
            self.channels.setdefault(record.id, record)
        elif isinstance(record, records.Schema):
            self.schemas.setdefault(record.id, record)

    def _messages(self, data: bytes, listed: np.ndarray[Any, Any], topics: Collection[str] | None) -> Any:
        """The messages of `topics` among the records; also reads definitions.

        Raises mcap's errors for damaged records.
        """
        is_message = listed["opcode"] == Opcode.MESSAGE
        if not is_message.all():
            for record in listed[np.isin(listed["opcode"], (Opcode.CHANNEL, Opcode.SCHEMA))]:
                content = data[int(record["begin"]) : int(record["end"])]
                self._definition(_parse_definition(int(record["opcode"]), content))
            listed = _chosen(listed, is_message)
        channels = listed["channel"]
        numbers = distinct(channels)
        defined = [n for n in numbers if n in self.channels]
        wanted = [n for n in defined if topics is None or self.channels[n].topic in topics]
        undefined = 0 if len(defined) == len(numbers) else int((~np.isin(channels, defined)).sum())
        self._losses.undefined += undefined
        self.count += len(listed) - undefined
        if len(wanted) < len(numbers):
            listed = _chosen(listed, np.isin(channels, wanted))
        return listed.view(ENTRY)


def _chosen(listed: np.ndarray[Any, Any], mask: np.ndarray[Any, Any]) -> np.ndarray[Any, Any]:
    """listed[mask]; NumPy copies the fields of structures one by one, but rows of bytes as a whole."""
    return listed.view(f"V{_RECORD.itemsize}")[mask].view(_RECORD)


def distinct(numbers: np.ndarray[Any, Any]) -> list[int]:
    """The different ones among these, ascending. Often there is but one, which is soon found."""
    if len(numbers) and (numbers == numbers[0]).all():
        return [int(numbers[0])]
    found: list[int] = np.unique(numbers).tolist()
    return found


def _list(data: bytes, begin: int) -> np.ndarray[Any, Any]:
    """The first _LISTED records of `data` from `begin` on; stops at a record that is incomplete."""
    records = np.empty(_LISTED, _RECORD)
    count = _native().fcsl_mcap_records(data, len(data), begin, records.ctypes.data, _LISTED)
    return records[:count]


_PROTOTYPES: Prototypes = {
    "fcsl_mcap_records": (
        ctypes.c_size_t,
        [ctypes.c_char_p, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t],
    )
}


@functools.cache
def _native() -> ctypes.CDLL:
    return bind_runtime(runtime_library(), _PROTOTYPES)


class _Piece(NamedTuple):
    """file[begin:end]: a chunk, records outside chunks, or what cannot be read. No message is earlier than `first_ns`."""

    begin: int
    end: int
    first_ns: int = _FIRST_NS
    chunk: Record | None = None
    why: str = ""


class _Block(NamedTuple):
    """The records of file[begin:end], or `why` they cannot be read; `span_ns` are the times that their chunk gives."""

    begin: int
    end: int
    data: bytes
    why: str = ""
    span_ns: tuple[int, int] | None = None


def _pieces(stream: BinaryIO, walk: Walk) -> Iterator[_Piece]:
    """The pieces of a file in its order."""
    loose: _Piece | None = None
    for part in walk:
        opcode = part.opcode if isinstance(part, Record) else None
        if loose and (opcode not in _LOOSE or loose.end - loose.begin > _BLOCK_BYTES):
            yield loose
            loose = None
        if isinstance(part, Gap):
            yield _Piece(part.begin, part.end, why="no record of MCAP")
        elif opcode == LOST and _content(stream, part).endswith(LOST_MARK):
            yield _Piece(part.begin, part.end, why="damaged before a repair")
        elif opcode == Opcode.CHUNK:
            span_ns = _span_ns(_content(stream, part, CHUNK_HEAD.size))
            yield _Piece(part.begin, part.end, span_ns[0] if span_ns else _FIRST_NS, part)
        elif opcode in _LOOSE:
            first_ns = _first_ns(stream, part)
            loose = loose or _Piece(part.begin, part.end, first_ns)
            loose = _Piece(loose.begin, part.end, min(loose.first_ns, first_ns))
    if loose:
        yield loose


def _first_ns(stream: BinaryIO, record: Record) -> int:
    """The time of a message outside of chunks. Definitions have none: they come before all messages."""
    content = _content(stream, record, _MESSAGE_HEAD.size) if record.opcode == Opcode.MESSAGE else b""
    log_ns = int(_MESSAGE_HEAD.unpack(content)[2]) if len(content) == _MESSAGE_HEAD.size else 0
    return log_ns if 0 < log_ns < 1 << 63 else _FIRST_NS


def _span_ns(chunk: bytes) -> tuple[int, int] | None:
    """The first and the last time that a chunk gives, if they make sense."""
    if len(chunk) < CHUNK_HEAD.size:
        return None
    first_ns, last_ns, *_ = CHUNK_HEAD.unpack_from(chunk)
    return (first_ns, last_ns) if first_ns <= last_ns < 1 << 63 else None


def _read_ahead(file: Path, pieces: Iterable[_Piece]) -> Generator[_Block, None, None]:
    return ahead(_blocks(file, pieces), lambda block: len(block.data))


def _blocks(file: Path, pieces: Iterable[_Piece]) -> Iterator[_Block]:
    """The records in each piece."""
    with file.open("rb") as stream:
        allowance = _FREE_BYTES + _RATIO * os.fstat(stream.fileno()).st_size
        for piece in pieces:
            if piece.chunk is not None:
                block = _unpacked(piece.chunk, _content(stream, piece.chunk), allowance)
                allowance -= len(block.data)
                yield block
            else:
                stream.seek(piece.begin)
                data = b"" if piece.why else stream.read(piece.end - piece.begin)
                yield _Block(piece.begin, piece.end, data, piece.why)


def _content(stream: BinaryIO, record: Record, size: int | None = None) -> bytes:
    """The content of a record, or its first bytes."""
    stream.seek(record.content)
    return stream.read(min(record.end - record.content, record.end if size is None else size))


def _unpacked(record: Record, chunk: bytes, allowance: int) -> _Block:
    """The records of a chunk, if there are no more bytes of them than `allowance`."""
    data, why = b"", ""
    try:
        data = _records_of(chunk, allowance)
    except TooLarge as error:
        why = f"a chunk that {error}"
    except Exception:  # noqa: BLE001  damaged bytes can make the decompressors raise anything
        why = "a damaged chunk"
    return _Block(record.begin, record.end, data, why, _span_ns(chunk))


def _records_of(chunk: bytes, allowance: int) -> bytes:
    """Raises TooLarge, ValueError, or the decompressor's errors for damaged data."""
    _, _, size, checksum, name_bytes = CHUNK_HEAD.unpack_from(chunk)
    if size > LIMIT_BYTES:
        raise TooLarge
    if size > allowance:
        raise TooLarge(text=f"takes the file beyond {_FREE_BYTES >> 30} GiB and {_RATIO} times its size when unpacked")
    at = CHUNK_HEAD.size + name_bytes
    compression = chunk[CHUNK_HEAD.size : at]
    packed = memoryview(chunk)[at + 8 : at + 8 + int.from_bytes(chunk[at : at + 8], "little")]
    if compression == b"zstd":
        data = unzstd(packed, size)
    elif compression == b"lz4":
        data = unlz4(packed, size)
    elif compression == b"":
        data = bytes(packed)
    else:
        raise ValueError(f"a chunk is compressed with {compression!r}")
    if len(data) != size or (checksum and zlib.crc32(data) != checksum):
        raise ValueError("a chunk is damaged")
    return bytes(data)


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
    end = stream.seek(-len(MAGIC) - _FOOTER.size, os.SEEK_END)
    start, _, checksum = _FOOTER.unpack(stream.read(_FOOTER.size))
    if checksum == 0 or start == 0:
        return True
    stream.seek(start)
    # The checksum covers the file from the summary's start up to the checksum, which is the footer's last field.
    return zlib.crc32(stream.read(end + _FOOTER.size - 4 - start)) == checksum


def check_begin(file: Path) -> None:
    """Raises BagError for a file that is not MCAP, or too short to identify."""
    with file.open("rb") as stream:
        begin = stream.read(len(MAGIC))
    if not begin:
        raise BagError(f"{file}: empty; nothing was written before the recording was cut off")
    if begin[:5] != MAGIC[: len(begin)][:5]:
        other = next((name for magic, name in _OTHER_BAGS.items() if begin.startswith(magic)), "")
        hint = f"; it looks like {other}, which `fcsl bag` reads, and `fcsl replay` with --map" if other else ""
        raise BagError(f"{file}: not an MCAP file{hint}")
    if len(begin) < len(MAGIC):
        raise BagError(f"{file}: cut off after {len(begin)} bytes; nothing of the recording is left")
