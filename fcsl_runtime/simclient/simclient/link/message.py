# SPDX-License-Identifier: Apache-2.0
"""Messages of channels, as docs/reference/transports.md defines them: encodes, checks and decodes them."""

from __future__ import annotations

import enum
import math
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

#: Formats of the scalars by number.
_FORMATS = "?iqIQfd"
_BOOL, _U32, _U64, _F32, _F64 = 0, 3, 4, 5, 6
_VECTOR, _QUATERNION, _ARRAY, _BLOB = 1, 2, 3, 4
#: Values of the shapes without a count.
_COUNTS = (1, 3, 4)
_HEAD, _COUNT, _ROW = struct.Struct("<HB"), struct.Struct("<H"), struct.Struct("<HBBI")
_TABLE, _ARMED, _TIME, _CRC = 0xFF03, 0xFF04, 0xFF05, 0xFFFF
_CRC_BYTES = _HEAD.size + 4

Value = bool | int | float


class Kind(enum.IntEnum):
    """What a message is: the id of its first entry."""

    SENSORS = 0xFF00
    ACTUATORS = 0xFF01
    TIME = 0xFF02


#: The reserved entries behind the hash that only this kind has.
_EXTRA = {Kind.SENSORS: (), Kind.ACTUATORS: ((_ARMED, _BOOL),), Kind.TIME: ((_TIME, _U64),)}
_RESERVED = {*Kind, _TABLE, _ARMED, _TIME, _CRC}


class MessageError(Exception):
    """Bytes that are no message of this kind and table. `reason`: short, kind, crc, table, entry, type or value."""

    def __init__(self, reason: str):
        super().__init__(reason)
        self.reason = reason


class Entry(NamedTuple):
    """An entry in a message: bytes [start, end), of which the values begin at `values`; `elements`: how many."""

    id: int
    type: int
    elements: int
    start: int
    values: int
    end: int


@dataclass(frozen=True)
class Channel:
    """A row of the channel table. `scalar`: 0 to 6; `shape`: that of the field, () for a scalar. `kind`: field,
    quaternion, or blob: scalar 0 and shape (bytes at most,)."""

    id: int
    actuator: bool
    scalar: int
    shape: tuple[int, ...] = ()
    kind: str = "field"

    @property
    def count(self) -> int:
        return math.prod(self.shape)

    @property
    def type(self) -> int:
        shape = _VECTOR if self.shape == (3,) else _ARRAY if self.shape else 0
        return {"quaternion": _QUATERNION, "blob": _BLOB}.get(self.kind, shape) << 4 | self.scalar


@dataclass(frozen=True)
class Message:
    """`values`: by channel id, as many as the channel has, row by row; of a blob its bytes. `skipped`: entries that the
    table does not have, and of sensors rotations of length zero."""

    kind: Kind
    tick: int
    values: Mapping[int, Sequence[Value]] = field(default_factory=dict)
    armed: bool = False
    time_ns: int = 0
    skipped: int = 0


def table_hash(table: Sequence[Channel]) -> int:
    """The hash by which messages name their channel table."""
    return zlib.crc32(b"".join(_ROW.pack(c.id, c.actuator, c.type, c.count) for c in table))


def encode(message: Message, table: Sequence[Channel]) -> bytes:
    """The one encoding of the message. Raises KeyError where an actuator lacks a value, struct.error for a value out
    of range."""
    body = _entry(message.kind, _U64, [message.tick]) + _entry(_TABLE, _U32, [table_hash(table)])
    for number, kind in _EXTRA[message.kind]:
        body += _entry(number, kind, [message.armed if number == _ARMED else message.time_ns])
    for channel in table:
        if _carries(message.kind, channel) and (channel.actuator or channel.id in message.values):
            body += _entry(channel.id, channel.type, message.values[channel.id])
    body += _HEAD.pack(_CRC, _U32)
    return body + struct.pack("<I", zlib.crc32(body))


def decode(data: bytes, kind: Kind, table: Sequence[Channel]) -> Message:
    """Raises MessageError."""
    end = len(data) - _CRC_BYTES
    head = [(int(kind), _U64), (_TABLE, _U32), *_EXTRA[kind]]
    if end < sum(_HEAD.size + _size(scalar) for _, scalar in head):
        raise MessageError("short")
    if _HEAD.unpack_from(data) != head[0]:
        raise MessageError("kind")
    if _HEAD.unpack_from(data, end) != (_CRC, _U32):
        raise MessageError("short")
    if zlib.crc32(data[:-4]) != int.from_bytes(data[-4:], "little"):
        raise MessageError("crc")
    reserved: dict[int, Value] = {}
    at = 0
    for number, scalar in head:
        if _HEAD.unpack_from(data, at) != (number, scalar):
            raise MessageError("entry")
        begin, at = at + _HEAD.size, at + _HEAD.size + _size(scalar)
        (reserved[number],) = _values(data, scalar, 1, begin)
        if reserved.get(_TABLE, table_hash(table)) != table_hash(table):
            raise MessageError("table")
    values, skipped = _channels(data, at, end, kind, table)
    armed, time_ns = bool(reserved.get(_ARMED, False)), int(reserved.get(_TIME, 0))
    return Message(kind, int(reserved[kind]), values, armed, time_ns, skipped)


def entries(data: bytes, start: int = 0) -> Iterator[Entry]:
    """The entries in `data` from `start` on, not looked into. Raises MessageError: short or type."""
    while start < len(data):
        if len(data) - start < _HEAD.size:
            raise MessageError("short")
        number, kind = _HEAD.unpack_from(data, start)
        shape, scalar = kind >> 4, kind & 15
        if shape > _BLOB or scalar >= len(_FORMATS) or (shape == _BLOB and scalar):
            raise MessageError("type")
        at = start + _HEAD.size
        if shape < _ARRAY:
            count = _COUNTS[shape]
        elif len(data) - at < _COUNT.size:
            raise MessageError("short")
        else:
            (count,), at = _COUNT.unpack_from(data, at), at + _COUNT.size
        end = at + count * _size(scalar)
        if end > len(data):
            raise MessageError("short")
        yield Entry(number, kind, count, start, at, end)
        start = end


def without(data: bytes, ids: set[int]) -> bytes:
    """The message without the entries of these channels. Raises MessageError: short or type."""
    kept = b"".join(data[e.start : e.end] for e in entries(data) if e.id not in ids)[:-4]
    return kept + struct.pack("<I", zlib.crc32(kept))


def _carries(kind: Kind, channel: Channel) -> bool:
    return kind == (Kind.ACTUATORS if channel.actuator else Kind.SENSORS)


def _entry(number: int, kind: int, values: Sequence[Value]) -> bytes:
    """An entry with these values; every NaN is the same one."""
    scalar = kind & 15
    if scalar in (_F32, _F64):
        values = [math.nan if math.isnan(value) else value for value in values]
    count = _COUNT.pack(len(values)) if kind >> 4 >= _ARRAY else b""
    return _HEAD.pack(number, kind) + count + struct.pack(f"<{len(values)}{_format(kind)}", *values)


def _format(kind: int) -> str:
    """The format of one value of this type."""
    return "B" if kind >> 4 == _BLOB else _FORMATS[kind & 15]


def _size(scalar: int) -> int:
    return struct.calcsize(f"<{_FORMATS[scalar]}")


def _values(data: bytes, kind: int, count: int, at: int) -> tuple[Value, ...]:
    if kind & 15 == _BOOL and kind >> 4 != _BLOB and any(byte > 1 for byte in data[at : at + count]):
        raise MessageError("value")
    return struct.unpack_from(f"<{count}{_format(kind)}", data, at)


def _channels(
    data: bytes, start: int, end: int, kind: Kind, table: Sequence[Channel]
) -> tuple[dict[int, Sequence[Value]], int]:
    """The values of the channels in [start, end), and how many entries are of none, or rotations of length zero."""
    channels = {channel.id: channel for channel in table}
    values: dict[int, Sequence[Value]] = {}
    taken: set[int] = set()
    skipped = 0
    for entry in entries(data[:end], start):
        channel = channels.get(entry.id)
        if channel is None and entry.id not in _RESERVED:
            skipped += 1
            continue
        if channel is None or not _carries(kind, channel):
            raise MessageError("entry")
        fits = entry.elements <= channel.count if channel.kind == "blob" else entry.elements == channel.count
        if entry.type != channel.type or not fits:
            raise MessageError("type")
        found = _values(data, channel.type, entry.elements, entry.values)
        if entry.id in taken:
            raise MessageError("entry")
        taken.add(entry.id)
        if channel.kind == "quaternion" and not channel.actuator and not any(found):
            skipped += 1
            continue
        values[entry.id] = found
    if kind is Kind.ACTUATORS and any(channel.actuator and channel.id not in values for channel in table):
        raise MessageError("entry")
    return values, skipped
