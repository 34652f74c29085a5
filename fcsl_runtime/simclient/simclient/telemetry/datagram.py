# SPDX-License-Identifier: Apache-2.0
"""One datagram of telemetry: a header of 40 bytes and a piece of a packet's body (docs/guide/monitoring.md)."""

from __future__ import annotations

import struct
import zlib
from typing import NamedTuple

from .limits import BODY_BYTES_MAX, DATAGRAM_BYTES_MAX

#: Magic, version, kind, stride, CRC-32, total, offset, configuration, session, sequence.
HEADER = struct.Struct("<4sBBHIIIIQQ")
MAGIC, VERSION = b"FCST", 2
CONFIGURATION, DATA = 1, 2
#: A sender at 1 MHz reaches it in 292 000 years. A sequence number, and the next one, fit NumPy's i64.
SEQUENCE_MAX = 2**63 - 2
_CRC_AT = 8
_ZEROS = bytes(4)


class Datagram(NamedTuple):
    """The header's fields and the piece. It is at `offset` of the body; all pieces but the last have `stride` bytes."""

    kind: int
    stride: int
    total: int
    offset: int
    configuration: int
    session: int
    sequence: int
    piece: bytes


def checksum(raw: bytes) -> int:
    """CRC-32 of a datagram, computed with its CRC field set to zero."""
    return zlib.crc32(raw[_CRC_AT + 4 :], zlib.crc32(_ZEROS, zlib.crc32(raw[:_CRC_AT])))


def parse(raw: bytes) -> Datagram | None:
    """None if it is not a datagram of this version, is damaged, or is inconsistent."""
    if not HEADER.size < len(raw) <= DATAGRAM_BYTES_MAX:
        return None
    magic, version, kind, stride, crc, total, offset, configuration, session, sequence = HEADER.unpack_from(raw)
    if magic != MAGIC or version != VERSION or (kind != DATA and kind != CONFIGURATION) or crc != checksum(raw):
        return None
    if not (0 < total <= BODY_BYTES_MAX and stride and session and sequence <= SEQUENCE_MAX and offset < total):
        return None
    if offset % stride or len(raw) - HEADER.size != min(stride, total - offset):
        return None
    return Datagram(kind, stride, total, offset, configuration, session, sequence, raw[HEADER.size :])
