# SPDX-License-Identifier: Apache-2.0
"""The configuration of a session: the sending machine, and the offset of each channel in a data packet
(docs/guide/monitoring.md).
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ..c_machine import HEALTH_NAMES, TYPE_FORMATS, TYPE_NAMES
from ..descriptor import Field, Machine
from ..paths import split_path
from .limits import BODY_BYTES_MAX, CHANNELS_MAX, PATH_CHARACTERS_MAX, RANK_MAX

#: Head of a data body: tick, time_ns, overwritten.
HEAD = struct.Struct("<QqQ")
#: ABI, tick_hz, every, wall_ns, bytes of a data body.
_FIXED = struct.Struct("<IQIqI")
_NAME = r"[^\s.\[\]]+(?:\[[0-9]+\])*"
_PATH = re.compile(rf"{_NAME}(?:\.{_NAME})*")
_ROLES = {
    "inputs": "input",
    "outputs": "output",
    "parameters": "parameter",
    "state": "state",
    "counters": "counter",
}


class Channel(NamedTuple):
    """A sent value. `labels` names the values 0, 1, 2, ... of a state, health or request; otherwise it is empty."""

    type: str
    shape: tuple[int, ...]
    unit: str
    labels: tuple[str, ...]


@dataclass(frozen=True)
class Configuration:
    """The sender's machine and rate. `machine` has the sent part only: name, hash, rate, views, and channels as fields.

    A field's `offset` is its place in a data body, in bytes. Every `every`-th tick has a packet. `wall_ns` is the UNIX
    time in ns of the machine's time 0, or 0 if unknown.
    """

    machine: Machine
    channels: dict[str, Channel]
    abi: int
    every: int
    wall_ns: int

    @property
    def body_bytes(self) -> int:
        """Size of a data packet's body."""
        return self.machine.size

    @property
    def period_s(self) -> float:
        """Time between two packets in s."""
        return self.every / self.machine.tick_hz


class _Contradiction(ValueError):
    """The bytes are not a valid configuration."""


def _demand(holds: object) -> None:
    if not holds:
        raise _Contradiction


def read_configuration(body: bytes) -> Configuration | None:
    """None if the bytes are not a configuration, or a contradictory one."""
    try:
        return _read(body)
    except (_Contradiction, struct.error, UnicodeDecodeError):
        return None


class _Cursor:
    """Reads the body sequentially. Raises struct.error, UnicodeDecodeError and _Contradiction."""

    def __init__(self, body: bytes):
        self._body = body
        self._labels: dict[int, tuple[bytes, tuple[str, ...]]] = {}
        self.at = 0

    def numbers(self, form: str) -> tuple[int, ...]:
        values = struct.unpack_from(f"<{form}", self._body, self.at)
        self.at += struct.calcsize(f"<{form}")
        return values

    def text(self) -> str:
        (size,) = self.numbers("H")
        raw = self._body[self.at : self.at + size]
        self.at += size  # may exceed a truncated body; _read checks that at the end
        text = raw.decode("utf-8")
        _demand(text.isprintable())
        return text

    def labels(self, kind: int) -> tuple[str, ...]:
        """The labels of a channel of this type: none, or those of the first such channel, which are sent only once."""
        begin = self.at
        (count,) = self.numbers("H")
        if kind in self._labels and count:
            raw, labels = self._labels[kind]
            _demand(self._body.startswith(raw, begin))
            self.at = begin + len(raw)
            return labels
        labels = tuple(self.text() for _ in range(count))
        if labels:
            self._labels[kind] = self._body[begin : self.at], labels
        return labels


def _read(body: bytes) -> Configuration:
    cursor = _Cursor(body)
    abi, tick_hz, every, wall_ns, body_bytes = cursor.numbers(_FIXED.format[1:])
    source_hash, name, views = cursor.text(), cursor.text(), cursor.text()
    (count,) = cursor.numbers("I")
    _demand(tick_hz and every and HEAD.size < body_bytes <= BODY_BYTES_MAX and 0 < count <= CHANNELS_MAX)
    fields: dict[str, Field] = {}
    channels: dict[str, Channel] = {}
    labels: dict[str, tuple[str, ...]] = {}
    offset = HEAD.size
    for index in range(count):
        path, channel = _channel(cursor)
        _demand(path not in fields)
        labels[channel.type] = channel.labels
        fields[path] = field = _field(index, path, channel, offset)
        channels[path] = channel
        offset += field.size
        _demand(offset <= body_bytes)
    _demand(offset == body_bytes and cursor.at == len(body))
    requests = tuple(label.removeprefix("tr_") for label in labels.get("TransitionRequest", ())[1:])
    machine = Machine(
        name=name,
        source_hash=source_hash,
        layout_hash="",
        build_hash="",
        tick_hz=tick_hz,
        size=body_bytes,
        fields=fields,
        instances=(),
        states=labels.get("state", ()),
        requests=requests,
        transitions=(),
        channels=(),
        views=views,
        partial=True,
    )
    return Configuration(machine, channels, abi, every, wall_ns)


def _channel(cursor: _Cursor) -> tuple[str, Channel]:
    """Reads a channel. A named type without labels (of a model, for example) becomes a number."""
    path = cursor.text()
    _demand(len(path) <= PATH_CHARACTERS_MAX and _PATH.fullmatch(path))
    number, rank = cursor.numbers("BB")
    _demand(number < len(TYPE_NAMES) and rank <= RANK_MAX)
    shape = cursor.numbers(f"{rank}I")
    _demand(all(shape))
    unit = cursor.text()
    labels = cursor.labels(number)
    kind = TYPE_NAMES[number]
    if not labels and kind in ("state", "TransitionRequest"):
        kind = "i32"
    _demand(_labelled(kind, labels))
    return path, Channel(kind, shape, unit, labels)


def _labelled(kind: str, labels: Sequence[str]) -> bool:
    """Whether these labels are valid for the type."""
    if kind == "Health":
        return labels == HEALTH_NAMES
    if kind == "TransitionRequest":
        return labels[:1] == ("",) and all(label.startswith("tr_") for label in labels[1:])
    return bool(labels) == (kind == "state")


def _field(index: int, path: str, channel: Channel, offset: int) -> Field:
    """The field as in a descriptor; attributes that the configuration lacks are empty."""
    instance, part, _ = split_path(path)
    role = _ROLES.get(part, "")
    count = math.prod(channel.shape)
    return Field(
        index=index,
        path=path,
        role=role or ("channel" if path.startswith("channels.") else "machine"),
        type=channel.type,
        shape=channel.shape,
        count=count,
        offset=offset,
        size=count * struct.calcsize(f"<{TYPE_FORMATS[channel.type]}"),
        instance=instance,
        connected_from="",
        unit=channel.unit,
        doc="",
        writable=False,
        frozen=False,
        impure=False,
    )
