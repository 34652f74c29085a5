# SPDX-License-Identifier: Apache-2.0
"""ROS 1 bags as bytes, with or without an index: a recorder that was killed wrote none, and a file may be cut off.

A file is a row of records: chunks, each followed by indexes of its messages by connection, and at the end all
connections once more. A record is a header of `name=value` fields and data, each behind its length. A chunk holds
records, too; the one that was being written when the recorder was killed has the length zero, so its records follow it.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rosbags.typesys.msg import normalize_msgtype

from ..errors import BagError
from . import unpack
from .batch import Message

MAGIC = b"#ROSBAG V2.0\n"
#: Values of a header's field `op`.
_MESSAGE, _BAG, _INDEX, _CHUNK, _CONNECTION = b"\2", b"\3", b"\4", b"\5", b"\7"
_SIZE, _TIME = struct.Struct("<I"), struct.Struct("<II")
#: An entry of a chunk's index.
_INDEXED = np.dtype([("sec", "<u4"), ("nanosec", "<u4"), ("offset", "<u4")])
#: Most bytes of a record's header, and about those of messages outside chunks that are read in one call.
_HEADER_BYTES_MAX, _LOOSE_BYTES = 1 << 20, 1 << 20
_UNPACK: dict[bytes, Any] = {b"none": None, b"bz2": unpack.unbz2, b"lz4": unpack.unlz4}
#: (position, number) to the bytes there, fewer at the end.
_Read = Callable[[int, int], bytes]


class Damaged(ValueError):
    """Bytes are not what the format says."""


class Connection(NamedTuple):
    """What a publisher sends; several may send the same topic."""

    topic: str
    type: str
    definition: str


class Piece(NamedTuple):
    """file[begin:end]: the packed records of a chunk, or messages outside chunks. None is earlier than `first_ns`.
    `is_part`: the file ends within it.
    """

    begin: int
    end: int
    compression: bytes = b"none"
    first_ns: int | None = None
    is_part: bool = False


class _Record(NamedTuple):
    """The fields of a record's header, and where its data begin and end."""

    fields: Mapping[bytes, bytes]
    begin: int
    end: int

    def number(self, name: bytes) -> int:
        value = self.fields.get(name, b"")
        if len(value) != _SIZE.size:
            raise Damaged
        return int(_SIZE.unpack(value)[0])


def _record(read: _Read, at: int, size: int) -> _Record:
    """The record at `at` of `size` bytes, which its data may exceed. Raises Damaged if its header is not there."""
    header = at + _SIZE.size
    behind = header + _length(read, at)
    if behind - header > _HEADER_BYTES_MAX or behind > size:
        raise Damaged
    begin = behind + _SIZE.size
    return _Record(_fields(read(header, behind - header)), begin, begin + _length(read, behind))


def _length(read: _Read, at: int) -> int:
    data = read(at, _SIZE.size)
    if len(data) < _SIZE.size:
        raise Damaged
    return int(_SIZE.unpack(data)[0])


def _fields(header: bytes) -> dict[bytes, bytes]:
    found, at = {}, 0
    while at < len(header):
        if at + _SIZE.size > len(header):
            raise Damaged
        begin = at + _SIZE.size
        at = begin + _SIZE.unpack_from(header, at)[0]
        name, sign, value = header[begin:at].partition(b"=")
        if at > len(header) or not sign:
            raise Damaged
        found[name] = value
    return found


class Ros1File:
    """One file: its connections by number, the number of messages of each, and its pieces in the order of the file.

    `broken` says that its end is missing. Raises BagError.
    """

    def __init__(self, path: Path):
        self.path = path
        self.connections: dict[int, Connection] = {}
        self.counts: dict[int, int] = {}
        self.pieces: list[Piece] = []
        self.broken = False
        self._size = path.stat().st_size
        self._survey()
        self._complete()

    def _survey(self) -> None:
        """Goes from record to record. Fills `pieces`, and `counts` from the indexes."""
        with self.path.open("rb") as stream:

            def read(begin: int, count: int) -> bytes:
                stream.seek(begin)
                return stream.read(count)

            if read(0, len(MAGIC)) != MAGIC:
                raise BagError(f"{self.path}: not a ROS 1 bag of version 2.0, or damaged at its beginning")
            at = len(MAGIC)
            while at < self._size and not self.broken:
                try:
                    record = _record(read, at, self._size)
                    self.broken = record.end > self._size
                    self._take(at, record, read)
                    at = record.end
                except Damaged:
                    self.broken = True

    def _take(self, at: int, record: _Record, read: _Read) -> None:
        op = record.fields.get(b"op", b"")
        if op == _BAG and record.fields.get(b"encryptor"):
            raise BagError(f"{self.path}: it is encrypted; `rosbag decrypt` of ROS 1 writes one that is not")
        if op == _CHUNK:
            end, compression = min(record.end, self._size), record.fields.get(b"compression", b"")
            self.pieces.append(Piece(record.begin, end, compression, is_part=self.broken))
        elif self.broken:
            return
        elif op == _INDEX and self.pieces:
            self._take_index(record, read(record.begin, record.end - record.begin))
        elif op == _CONNECTION:
            self._define(record, read(record.begin, record.end - record.begin))
        elif op == _MESSAGE:
            last = self.pieces[-1] if self.pieces else Piece(0, 0)
            grows = last.end == at and last.begin < at and last.end - last.begin < _LOOSE_BYTES
            self.pieces[-1:] = [Piece(last.begin, record.end)] if grows else [last, Piece(at, record.end)]

    def _take_index(self, record: _Record, data: bytes) -> None:
        number, count, chunk = record.number(b"conn"), record.number(b"count"), self.pieces[-1]
        if count * _INDEXED.itemsize != len(data):
            raise Damaged
        self.counts[number] = self.counts.get(number, 0) + count
        times = np.frombuffer(data, _INDEXED)
        if count:
            first_ns = int((times["sec"] * np.int64(10**9) + times["nanosec"]).min())
            self.pieces[-1] = chunk._replace(first_ns=min(first_ns, chunk.first_ns or first_ns))

    def _define(self, record: _Record, data: bytes) -> None:
        about = _fields(data)
        try:
            topic, kind, text = (record.fields[b"topic"], about[b"type"], about[b"message_definition"])
            name = "/".join(part for part in topic.decode().split("/") if part)
            found = Connection("/" * topic.startswith(b"/") + name, normalize_msgtype(kind.decode()), text.decode())
        except (KeyError, ValueError):  # bytes that are no UTF-8 are a ValueError
            raise Damaged from None
        self.connections.setdefault(record.number(b"conn"), found)

    def _complete(self) -> None:
        """Finds what is usually in indexes and at the end of the file by reading the pieces that need it."""
        for place, piece in enumerate(self.pieces):
            if piece.first_ns is not None and self.counts.keys() <= self.connections.keys():
                continue
            times = []
            try:
                for number, log_ns, _ in self.messages(piece):
                    times.append(log_ns)
                    if piece.first_ns is None:
                        self.counts[number] = self.counts.get(number, 0) + 1
            except (Damaged, unpack.TooLarge):
                pass  # whoever reads it is told
            self.pieces[place] = piece._replace(first_ns=min(times, default=0))

    def messages(self, piece: Piece) -> Iterator[Message]:
        """(number of the connection, time of recording, bytes of ROS 1); connections become known.

        Raises Damaged or TooLarge behind the last one that can be read.
        """
        data = self._unpacked(piece)
        at = 0
        while at < len(data):
            try:
                record = _record(lambda begin, count: data[begin : begin + count], at, len(data))
                if record.end > len(data):
                    raise Damaged
            except Damaged:
                if piece.is_part:
                    return
                raise
            op, at = record.fields.get(b"op", b""), record.end
            if op == _CONNECTION:
                self._define(record, data[record.begin : record.end])
            elif op == _MESSAGE:
                time = record.fields.get(b"time", b"")
                if len(time) != _TIME.size:
                    raise Damaged
                seconds, rest = _TIME.unpack(time)
                yield record.number(b"conn"), seconds * 10**9 + rest, data[record.begin : record.end]

    def _unpacked(self, piece: Piece) -> bytes:
        with self.path.open("rb") as stream:
            stream.seek(piece.begin)
            packed = stream.read(piece.end - piece.begin)
        if len(packed) > unpack.LIMIT_BYTES:
            raise unpack.TooLarge
        try:
            unpacked = _UNPACK[piece.compression]
            return unpacked(packed, part=piece.is_part) if unpacked else packed
        except unpack.TooLarge:
            raise
        except Exception:  # noqa: BLE001  damaged bytes can make the decompressors raise anything
            raise Damaged from None
