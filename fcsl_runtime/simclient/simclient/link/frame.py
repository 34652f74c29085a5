# SPDX-License-Identifier: Apache-2.0
"""Frames of the link layer (docs/reference/transports.md#frames)."""

from __future__ import annotations

import binascii
import enum
import struct
from dataclasses import dataclass

VERSION = 1
PAYLOAD_MAX = 240
_SHORT, _LONG, _CRC = struct.Struct("<BBHH"), struct.Struct("<BBHHHH"), struct.Struct("<H")


class Kind(enum.IntEnum):
    HELLO = 0
    LATEST = 1
    SEQUENCED = 2
    DATA = 3
    ACKNOWLEDGEMENT = 4


class Flag(enum.IntFlag):
    NONE = 0
    FIRST = 1
    LAST = 2
    CONNECTED = 4


#: Flags that each kind may have.
_ALLOWED = {Kind.HELLO: Flag.CONNECTED, Kind.DATA: Flag.FIRST | Flag.LAST}
_HEADERS = {Kind.LATEST: _SHORT, Kind.SEQUENCED: _SHORT}
FRAME_MAX = _LONG.size + PAYLOAD_MAX + _CRC.size


class FrameError(Exception):
    """Bytes that are no frame. `reason`: malformed, wrong_crc or other_version."""

    def __init__(self, reason: str):
        super().__init__(reason)
        self.reason = reason


def crc16(data: bytes) -> int:
    """CRC-16/CCITT-FALSE."""
    return binascii.crc_hqx(data, 0xFFFF)


@dataclass(frozen=True)
class Frame:
    """`to` and `acknowledge` are 0 in frames of kinds LATEST and SEQUENCED, which have none."""

    kind: Kind
    session: int
    sequence: int = 0
    to: int = 0
    acknowledge: int = 0
    port: int = 0
    flags: Flag = Flag.NONE
    payload: bytes = b""

    def to_bytes(self) -> bytes:
        first, second = VERSION << 4 | self.kind, self.flags << 4 | self.port
        numbers = (first, second, self.session, self.sequence, self.to, self.acknowledge)
        header = _HEADERS.get(self.kind, _LONG)
        body = header.pack(*numbers[: 6 if header is _LONG else 4]) + self.payload
        return body + _CRC.pack(crc16(body))

    @staticmethod
    def from_bytes(data: bytes) -> Frame:
        """Raises FrameError."""
        if not _SHORT.size + _CRC.size <= len(data) <= FRAME_MAX:
            raise FrameError("malformed")
        body = data[: -_CRC.size]
        if crc16(body) != _CRC.unpack(data[-_CRC.size :])[0]:
            raise FrameError("wrong_crc")
        if body[0] >> 4 != VERSION:
            raise FrameError("other_version")
        if body[0] & 15 not in list(Kind):
            raise FrameError("malformed")
        kind = Kind(body[0] & 15)
        header = _HEADERS.get(kind, _LONG)
        if len(body) < header.size:
            raise FrameError("malformed")
        _, second, session, sequence, to, acknowledge = (*header.unpack_from(body), 0, 0)[:6]
        frame = Frame(kind, session, sequence, to, acknowledge, second & 15, Flag(second >> 4 & 7), body[header.size :])
        strange = second >> 4 & ~_ALLOWED.get(kind, Flag.NONE)
        empty = kind in (Kind.HELLO, Kind.ACKNOWLEDGEMENT)
        if strange or not session or len(frame.payload) > (0 if empty else PAYLOAD_MAX):
            raise FrameError("malformed")
        if kind is Kind.HELLO and frame.port:
            raise FrameError("malformed")
        return frame
