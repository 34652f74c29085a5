# SPDX-License-Identifier: Apache-2.0
"""A reader of telemetry written from docs/guide/monitoring.md alone: plain, strict and slow. It shares nothing with the sender and
nothing with simclient.Telemetry."""

from __future__ import annotations

import re
import socket
import struct
import zlib
from dataclasses import dataclass, field
from pathlib import Path

_HEADER = struct.Struct("<4sBBHIIIIQQ")
_FORMATS = "?iqIQfdiii"

PAGE = Path(__file__).resolve().parents[3] / "docs/guide/monitoring.md"


class Malformed(Exception):
    """What the page says that a receiver drops."""


def need(holds: bool, what: str) -> None:
    if not holds:
        raise Malformed(what)


@dataclass(frozen=True)
class Datagram:
    kind: int
    stride: int
    total: int
    offset: int
    configuration: int
    session: int
    sequence: int
    payload: bytes


def read_datagram(data: bytes) -> Datagram:
    need(len(data) > _HEADER.size, "short")
    magic, version, kind, stride, crc, total, offset, configuration, session, sequence = _HEADER.unpack_from(data)
    need(magic == b"FCST" and version == 2 and kind in (1, 2), "another format")
    need(zlib.crc32(data[:8] + bytes(4) + data[12:]) == crc, "CRC")
    need(session > 0 and stride > 0 and 0 < total <= 1 << 24 and offset % stride == 0 and offset < total, "header")
    need(len(data) - _HEADER.size == min(stride, total - offset), "length")
    return Datagram(kind, stride, total, offset, configuration, session, sequence, data[_HEADER.size :])


@dataclass(frozen=True)
class Channel:
    path: str
    type: int
    shape: tuple[int, ...]
    unit: str
    labels: tuple[str, ...]

    @property
    def format(self) -> str:
        count = 1
        for extent in self.shape:
            count *= extent
        return f"{count}{_FORMATS[self.type]}"


@dataclass(frozen=True)
class Configuration:
    abi: int
    tick_hz: int
    every: int
    wall_ns: int
    data_bytes: int
    source_hash: str
    machine: str
    views: str
    channels: tuple[Channel, ...]


class _Body:
    def __init__(self, data: bytes):
        self.data, self.at = data, 0

    def take(self, count: int) -> bytes:
        need(self.at + count <= len(self.data), "the body ends early")
        self.at += count
        return self.data[self.at - count : self.at]

    def number(self, code: str) -> int:
        return int(struct.unpack(f"<{code}", self.take(struct.calcsize(f"<{code}")))[0])

    def text(self) -> str:
        return self.take(self.number("H")).decode()

    def channel(self) -> Channel:
        path, kind, rank = self.text(), self.number("B"), self.number("B")
        need(kind < len(_FORMATS) and rank <= 8, "type or rank")
        shape = tuple(self.number("I") for _ in range(rank))
        return Channel(path, kind, shape, self.text(), tuple(self.text() for _ in range(self.number("H"))))


def read_configuration(data: bytes) -> Configuration:
    body = _Body(data)
    abi, tick_hz, every, wall_ns, data_bytes = (body.number(code) for code in "IQIqI")
    texts = body.text(), body.text(), body.text()
    channels = tuple(body.channel() for _ in range(body.number("I")))
    need(body.at == len(data) and channels != (), "more or less than the channels")
    need(data_bytes == 24 + sum(struct.calcsize(f"<{c.format}") for c in channels), "bytes of a data packet")
    return Configuration(abi, tick_hz, every, wall_ns, data_bytes, *texts, channels)


@dataclass(frozen=True)
class Packet:
    """Values by path; an array is a flat tuple, labels are texts."""

    sequence: int
    tick: int
    time_ns: int
    overwritten: int
    values: dict[str, object]


def read_data(configuration: Configuration, sequence: int, body: bytes) -> Packet:
    need(len(body) == configuration.data_bytes, "bytes of a data packet")
    tick, time_ns, overwritten = struct.unpack_from("<QqQ", body)
    at, values = 24, {}
    for channel in configuration.channels:
        found = struct.unpack_from(f"<{channel.format}", body, at)
        at += struct.calcsize(f"<{channel.format}")
        found = tuple(channel.labels[v] for v in found) if channel.labels else found
        values[channel.path] = found if channel.shape else found[0]
    return Packet(sequence, tick, time_ns, overwritten, values)


@dataclass
class Reading:
    """What datagrams amount to."""

    datagrams: list[Datagram]
    configurations: list[Configuration] = field(default_factory=list)
    #: Numbers of the data packets that configurations were sent before.
    announced: list[int] = field(default_factory=list)
    packets: list[Packet] = field(default_factory=list)

    @property
    def sessions(self) -> list[int]:
        return list(dict.fromkeys(d.session for d in self.datagrams))


def _join(datagrams: list[Datagram], kind: int) -> list[tuple[Datagram, bytes]]:
    """The packets of a kind, each with its last datagram. The datagrams of each must be there, in order."""
    whole = []
    parts: dict[tuple[int, int], bytes] = {}
    for d in datagrams:
        if d.kind == kind:
            body = parts.pop((d.session, d.sequence), b"")
            need(len(body) == d.offset, "a datagram is missing")
            body += d.payload
            if len(body) == d.total:
                whole.append((d, body))
            else:
                parts[d.session, d.sequence] = body
    need(not parts, "a datagram is missing")
    return whole


def read(datagrams: list[bytes]) -> Reading:
    """Of a run whose datagrams have all arrived, in order, as loopback has it."""
    reading = Reading([read_datagram(d) for d in datagrams])
    known: dict[int, Configuration] = {}
    for d, body in _join(reading.datagrams, 1):
        need(zlib.crc32(body) == d.configuration, "CRC of the configuration")
        known[d.configuration] = read_configuration(body)
        reading.configurations.append(known[d.configuration])
        reading.announced.append(d.sequence)
    for d, body in _join(reading.datagrams, 2):
        need(d.configuration in known, "no configuration")
        reading.packets.append(read_data(known[d.configuration], d.sequence, body))
    return reading


class Port:
    """A port on loopback with room for what a test sends; `datagrams` are read when the sender has ended."""

    def __init__(self, address: tuple[str, int] = ("127.0.0.1", 0)) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 << 20)
        self.socket.bind(address)
        self.address = f"udp:127.0.0.1:{self.socket.getsockname()[1]}"

    def __enter__(self) -> Port:
        return self

    def __exit__(self, *error: object) -> None:
        self.socket.close()

    def datagrams(self) -> list[bytes]:
        """All that has arrived."""
        self.socket.setblocking(False)
        found = []
        try:
            while True:
                found.append(self.socket.recv(65536))
        except BlockingIOError:
            return found

    def until(self, kind: int) -> list[bytes]:
        """Waits for a datagram of this kind: all from here to it."""
        self.socket.settimeout(20)
        found = [self.socket.recv(65536)]
        while read_datagram(found[-1]).kind != kind:
            found.append(self.socket.recv(65536))
        return found


def example(language: str) -> str:
    """The page's example: the text of its block in this language."""
    part = PAGE.read_text()
    found = re.search(rf"```{language}\n(.*?)```", part[part.index("### Example packets") :], re.DOTALL)
    assert found, f"docs/guide/monitoring.md has no example in {language}"
    return found[1]


def dumps() -> list[bytes]:
    """The datagrams of the page's example."""
    blocks = re.findall(r"```\n(0000  .*?)```", PAGE.read_text(), re.DOTALL)
    return [bytes.fromhex("".join(line[6:41] for line in block.splitlines())) for block in blocks]
