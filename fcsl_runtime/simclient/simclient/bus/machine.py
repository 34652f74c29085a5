# SPDX-License-Identifier: Apache-2.0
"""The machine behind a descriptor of the bus, and the values of its channels as bytes."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from ..c_machine import DIRECTION_NAMES
from ..errors import BusError
from .payload import Payload

#: A scalar's letter for `struct`.
_FORMATS = {"bool": "?", "i32": "i", "i64": "q", "u32": "I", "u64": "Q", "f32": "f", "f64": "d"}
_AS = ("field", "quaternion", "blob")
#: Most values of a channel, those of the longest message, and most axes.
_COUNT_MAX, _RANK_MAX = 1 << 20, 32

Value = bool | int | float | str | list[Any]


@dataclass(frozen=True)
class BusChannel:
    """A channel. `type` is a scalar's; `shape` () for a scalar, (N,) for a blob of at most N bytes."""

    index: int
    name: str
    direction: str
    type: str
    shape: tuple[int, ...]
    is_blob: bool
    unit: str
    doc: str
    payload: Payload | None = None  # None: the values lie under its key as they are

    def values(self, data: bytes) -> bytes | None:
        """The values in what lies under the channel's key, little-endian; None if there are none."""
        values = data if self.payload is None else self.payload.read(data)
        return values if values is not None and self.decode(values) is not None else None

    @property
    def ros_type(self) -> str:
        """Of the message under its key; "" where the values lie there as they are."""
        return self.payload.ros_type if self.payload is not None else ""

    @property
    def type_text(self) -> str:
        """The type as a user writes it: `f64[3]`; of a blob `blob[512]`."""
        return ("blob" if self.is_blob else self.type) + "".join(f"[{extent}]" for extent in self.shape)

    @property
    def format(self) -> str:
        """Of all its values, for `struct`."""
        return f"<{math.prod(self.shape)}{_FORMATS[self.type]}"

    def decode(self, data: bytes) -> Value | None:
        """The value that these bytes are, an array as nested lists, a blob in hex; None if they are none."""
        if self.is_blob:
            return data.hex() if len(data) <= self.shape[0] else None
        if len(data) != struct.calcsize(self.format) or (self.type == "bool" and not set(data) <= {0, 1}):
            return None
        return _nested(struct.unpack(self.format, data), self.shape)

    def encode(self, value: Any) -> bytes:
        """What lies under the channel's key for a value; numbers, true and false, lists of them, of a blob hex digits.
        Raises BusError."""
        if self.is_blob:
            values = self._encode_blob(value)
        else:
            flat: list[Any] = []
            self._flatten(value, self.shape, flat)
            values = struct.pack(self.format, *flat)
        return values if self.payload is None else self.payload.write(values)

    def _encode_blob(self, value: Any) -> bytes:
        try:
            data = bytes.fromhex(str(value))
        except ValueError:
            raise BusError(f"`{self.name}` is a blob: write its bytes in hex, like 00ff12, not {value}") from None
        if len(data) > self.shape[0]:
            raise BusError(f"`{self.name}` is a blob of at most {self.shape[0]} bytes, not {len(data)}")
        return data

    def _flatten(self, value: Any, shape: Sequence[int], flat: list[Any]) -> None:
        if not shape:
            flat.append(self._scalar(value))
        elif isinstance(value, list) and len(value) == shape[0]:
            for item in value:
                self._flatten(item, shape[1:], flat)
        else:
            example = json.dumps(_nested([self._example()] * math.prod(self.shape), self.shape))
            raise BusError(f"`{self.name}` is {self.type_text}: write {example}")

    def _example(self) -> Any:
        return False if self.type == "bool" else 0.0 if self.type.startswith("f") else 0

    def _scalar(self, value: Any) -> Any:
        if self.type == "bool":
            if isinstance(value, bool):
                return value
            raise BusError(f"`{self.name}` is {self.type_text}: write true or false, not {value}")
        if isinstance(value, bool) or not isinstance(value, int if self.type[0] in "iu" else (int, float)):
            kind = "a whole number" if self.type[0] in "iu" else "a number"
            raise BusError(f"`{self.name}` is {self.type_text}: write {kind}, not {value}")
        try:
            struct.pack(f"<{_FORMATS[self.type]}", value)
        except (struct.error, OverflowError):
            raise BusError(f"`{self.name}` is {self.type_text}: {value} is outside its range{self._range()}") from None
        return value

    def _range(self) -> str:
        if self.type[0] not in "iu":
            return ""
        bits = int(self.type[1:])
        least, most = (0, 2**bits - 1) if self.type[0] == "u" else (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
        return f", {least} to {most}"


def _nested(flat: Sequence[Any], shape: Sequence[int]) -> Any:
    """Row by row, as lists within lists."""
    if not shape:
        return flat[0]
    step = len(flat) // shape[0] if shape[0] else 0
    return [_nested(flat[i * step : (i + 1) * step], shape[1:]) for i in range(shape[0])]


@dataclass(frozen=True)
class BusMachine:
    """A machine. `prefix` is what its keys begin with: `[NAMESPACE/]MACHINE`; `text` its descriptor."""

    prefix: str
    name: str
    source_hash: str
    table_hash: int
    tick_hz: int
    channels: tuple[BusChannel, ...]
    text: str


#: What lies under a channel's key.
_PAYLOADS = ("raw", "cdr")


def read_machine(prefix: str, text: str) -> BusMachine:
    """The machine that a descriptor describes. Raises BusError: anybody may answer on a bus."""
    try:
        found = json.loads(text)
        if found["version"] != 1:
            raise BusError(f"{prefix} has a descriptor of version {found['version']}, and this fcsl bus reads 1")
        if found["payload"] not in _PAYLOADS:
            raise BusError(f"{prefix} has the payload {found['payload']!r}, and this fcsl bus reads raw and cdr")
        cdr = found["payload"] == "cdr"
        machine = BusMachine(
            prefix=prefix,
            name=_name(found["machine"]),
            source_hash=_printable(found["source_hash"]),
            table_hash=_integer(found["table_hash"], 1 << 32),
            tick_hz=_integer(found["tick_hz"], 1 << 32, least=1),
            channels=tuple(_read_channel(i, channel, cdr) for i, channel in enumerate(found["channels"])),
            text=text,
        )
    except (ValueError, LookupError, TypeError, RecursionError) as error:
        if isinstance(error, BusError):
            raise
        raise BusError(f"the descriptor of {prefix} is not one of docs/reference/transports.md") from None
    return machine


def _read_channel(index: int, found: dict[str, Any], cdr: bool) -> BusChannel:
    shape = tuple(_integer(extent, _COUNT_MAX) for extent in found["shape"])
    words_fit = found["type"] in _FORMATS and found["as"] in _AS and found["direction"] in DIRECTION_NAMES
    shape_fits = len(shape) == 1 if found["as"] == "blob" else len(shape) <= _RANK_MAX
    if not words_fit or not shape_fits or math.prod(shape) > _COUNT_MAX:
        raise ValueError
    return BusChannel(
        index=index,
        name=_name(found["name"]),
        direction=found["direction"],
        type=found["type"],
        shape=shape,
        is_blob=found["as"] == "blob",
        unit=_printable(found["unit"]),
        doc=_printable(found["doc"]),
        payload=_read_payload(found, math.prod(shape)) if cdr else None,
    )


def _read_payload(found: dict[str, Any], count: int) -> Payload:
    ros = {key: _printable(found["ros"][key]) for key in ("type", "field", "frame", "child_frame", "axes")}
    return Payload(
        name=_name(found["name"]),
        ros_type=ros["type"],
        field=ros["field"],
        frame=ros["frame"],
        child_frame=ros["child_frame"],
        axes=ros["axes"],
        type=found["type"],
        count=count,
        is_blob=found["as"] == "blob",
    )


def _integer(value: Any, limit: int, least: int = 0) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value < limit:
        raise ValueError
    return value


def _name(text: Any) -> str:
    """A part of a key."""
    if not isinstance(text, str) or not text or not text.isprintable() or set(text) & set("*$?#/ "):
        raise ValueError
    return text


def _printable(text: Any) -> str:
    """Nothing of it moves the cursor of a terminal."""
    return "".join(letter if letter.isprintable() else " " for letter in str(text))
