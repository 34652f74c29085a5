# SPDX-License-Identifier: Apache-2.0
"""Injected dropouts: sensor channels without samples for some ticks."""

from __future__ import annotations

import struct
import zlib

from simclient.descriptor import Machine
from simclient.errors import did_you_mean

from .errors import BridgeError

#: fcsl_codec.h: offset of the count of entries; the count; the bytes up to the entries; an entry's header.
_HEAD_BYTES = 24
_COUNT = struct.Struct("<H")
_COUNT_OFFSET = 20
_ENTRY = struct.Struct("<HH")
_CRC = struct.Struct("<I")


class Dropouts:
    """The channels that get no sample in the next tick."""

    def __init__(self, machine: Machine):
        self._ids = {c.name: c.id for c in machine.channels if c.direction == "sensor"}
        self._left: dict[str, int] = {}

    def add(self, channel: str, ticks: int) -> None:
        """The channel gets no sample in the next `ticks` ticks. Raises BridgeError for an unknown one."""
        if channel not in self._ids:
            hint = did_you_mean(channel, self._ids) or f"; there are {', '.join(self._ids) or 'none'}"
            raise BridgeError(f"no sensor channel `{channel}`{hint}")
        self._left[channel] = ticks

    def clear(self) -> None:
        """Ends all dropouts."""
        self._left = {}

    def missing(self) -> frozenset[str]:
        """The channels without a sample in the next tick; call once per tick."""
        if not self._left:
            return frozenset()
        names = frozenset(name for name, ticks in self._left.items() if ticks > 0)
        self._left = {name: ticks - 1 for name, ticks in self._left.items() if ticks > 1}
        return names

    def strip(self, frame: bytes) -> bytes:
        """A sensor frame (fcsl_codec.h) without the channels that are missing in its tick.

        Other bytes are returned unchanged.
        """
        missing = {self._ids[name] for name in self.missing()}
        if not missing:
            return frame
        try:
            return _without(frame, missing)
        except struct.error:
            return frame


def _without(frame: bytes, ids: set[int]) -> bytes:
    (count,) = _COUNT.unpack_from(frame, _COUNT_OFFSET)
    kept, at = [], _HEAD_BYTES
    for _ in range(count):
        number, size = _ENTRY.unpack_from(frame, at)
        if number not in ids:
            kept.append(frame[at : at + _ENTRY.size + size])
        at += _ENTRY.size + size
    head = frame[:_COUNT_OFFSET] + _COUNT.pack(len(kept)) + frame[_COUNT_OFFSET + _COUNT.size : _HEAD_BYTES]
    body = head + b"".join(kept)
    return body + _CRC.pack(zlib.crc32(body))
