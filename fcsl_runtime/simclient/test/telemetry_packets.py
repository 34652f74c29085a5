# SPDX-License-Identifier: Apache-2.0
"""A sender of telemetry made of docs/guide/monitoring.md alone: datagrams to test a receiver with, whose truth is known."""

from __future__ import annotations

import random
import struct
import zlib
from dataclasses import dataclass
from functools import cache, cached_property

SIZES = {0: "B", 1: "i", 2: "q", 3: "I", 4: "Q", 5: "f", 6: "d", 7: "i", 8: "i", 9: "i"}
LABELS = {
    7: ("", "tr_GO", "tr_STOP"),
    8: ("nominal", "degraded", "failed", "stale"),
    9: ("IDLE", "RUN", "DONE"),
}


@dataclass(frozen=True)
class Channel:
    path: str
    type: int
    shape: tuple[int, ...] = ()
    unit: str = ""

    @property
    def count(self) -> int:
        count = 1
        for extent in self.shape:
            count *= extent
        return count

    def packed(self) -> bytes:
        labels = LABELS.get(self.type, ())
        return (
            text(self.path)
            + struct.pack(f"<BB{len(self.shape)}I", self.type, len(self.shape), *self.shape)
            + text(self.unit)
            + struct.pack("<H", len(labels))
            + b"".join(map(text, labels))
        )

    def values(self, source: random.Random) -> list[float]:
        """Flat; every one is exactly of the channel's type."""
        if self.type == 0:
            return [source.getrandbits(1) for _ in range(self.count)]
        if self.type in LABELS:
            return [source.randrange(len(LABELS[self.type])) for _ in range(self.count)]
        if self.type in (5, 6):
            return [source.randrange(-(2**20), 2**20) / 64 for _ in range(self.count)]
        return [source.randrange(2**31) for _ in range(self.count)]


CHANNELS = (
    Channel("machine.state", 9),
    Channel("nav.outputs.angle", 6, (), "rad"),
    Channel("nav.outputs.P", 5, (2, 3), "m"),
    Channel("nav.outputs.health", 8),
    Channel("nav.outputs.transition_request", 7),
    Channel("nav.outputs.on", 0, (3,)),
    Channel("nav.counters.faults", 4),
    Channel("nav.outputs.targets[0].position", 6, (3,), "m"),
    Channel("nav.outputs.targets[1].position", 6, (3,), "m"),
)


def text(words: str) -> bytes:
    raw = words.encode()
    return struct.pack("<H", len(raw)) + raw


def datagram(
    kind: int, stride: int, total: int, offset: int, configuration: int, session: int, sequence: int, piece: bytes
) -> bytes:
    """With the right CRC, whatever the rest is."""
    before = struct.pack("<4sBBH", b"FCST", 2, kind, stride)
    behind = struct.pack("<IIIQQ", total, offset, configuration, session, sequence) + piece
    return before + struct.pack("<I", zlib.crc32(before + bytes(4) + behind)) + behind


@dataclass(frozen=True)
class Sender:
    """Its packet `s` is of tick s * every, with values drawn from `s`."""

    session: int = 1
    channels: tuple[Channel, ...] = CHANNELS
    stride: int = 1360
    every: int = 1
    tick_hz: int = 1000
    name: str = "probe"
    views: str = ""

    @property
    def body_bytes(self) -> int:
        return 24 + sum(c.count * struct.calcsize(f"<{SIZES[c.type]}") for c in self.channels)

    @cached_property
    def announcement(self) -> bytes:
        """The configuration's body."""
        head = struct.pack("<IQIqI", 5, self.tick_hz, self.every, 0, self.body_bytes)
        return (
            head
            + text("ab" * 32)
            + text(self.name)
            + text(self.views)
            + struct.pack("<I", len(self.channels))
            + b"".join(c.packed() for c in self.channels)
        )

    def configuration(self, sequence: int = 0) -> list[bytes]:
        return self.cut(1, sequence, self.announcement)

    @cache  # noqa: B019
    def values(self, sequence: int) -> list[list[float]]:
        """Flat, for each channel."""
        source = random.Random(sequence * 1_000_003 + self.session)
        return [c.values(source) for c in self.channels]

    def body(self, sequence: int, overwritten: int = 0) -> bytes:
        tick = sequence * self.every
        packed = [
            struct.pack(f"<{c.count}{SIZES[c.type]}", *values)
            for c, values in zip(self.channels, self.values(sequence), strict=True)
        ]
        return struct.pack("<QqQ", tick, tick * 10**9 // self.tick_hz, overwritten) + b"".join(packed)

    def data(self, sequence: int, overwritten: int = 0) -> list[bytes]:
        return self.cut(2, sequence, self.body(sequence, overwritten))

    def cut(self, kind: int, sequence: int, body: bytes) -> list[bytes]:
        number = zlib.crc32(self.announcement)
        return [
            datagram(kind, self.stride, len(body), at, number, self.session, sequence, body[at : at + self.stride])
            for at in range(0, len(body), self.stride)
        ]
