# SPDX-License-Identifier: Apache-2.0
"""Messages of channels in C and in Python, both made of docs/reference/transports.md: the same bytes, the same values, the same refusals."""

from __future__ import annotations

import ctypes
import json
import math
import re
import struct
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simclient.c_machine import CChannel, CField, CMachine
from simclient.c_run import CMessage
from simclient.link.message import Channel, Kind, Message, MessageError, decode, encode, entries, table_hash, without

ROOT = Path(__file__).resolve().parents[3]
REASONS = ("", "short", "kind", "crc", "table", "entry", "type", "value")
KINDS = tuple(Kind)
FORMATS, SIZES = "?iqIQfd", (1, 4, 8, 4, 8, 4, 8)
U32 = 3
#: fcsl_channel_as_t
KINDS_OF = {"field": 0, "quaternion": 1, "blob": 2}
#: Behind the fields, for the bytes that a sensor has in a machine.
SPARE = 32


class CTable(ctypes.Structure):
    """fcsl_channel_table_t"""

    _fields_ = [("machine", ctypes.POINTER(CMachine)), ("hash", ctypes.c_uint32)]


@pytest.fixture(scope="session")
def native(tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    """The C implementation as a library."""
    library = tmp_path_factory.mktemp("codec") / "libcodec.so"
    sources = sorted((ROOT / "fcsl_hal/src/codec").glob("*.c"))
    folders = (ROOT / "fcsl_hal/include", ROOT / "fcsl_hal/src", ROOT / "fcsl_compiler/include")
    include = [f"-I{folder}" for folder in folders]
    subprocess.run(["cc", "-std=c11", "-O1", "-fPIC", "-shared", *include, *sources, "-o", library], check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.fcsl_channel_table.restype = CTable
    loaded.fcsl_message_capacity.restype = ctypes.c_size_t
    return loaded


class Native:
    """The C implementation with a machine that has this table, and the same methods as the Python one."""

    def __init__(self, lib: ctypes.CDLL, table: list[Channel]):
        fields, channels, self._at = [], [], {}
        offset = SPARE
        for index, c in enumerate(table):
            scalar, extents = (U32, (1 + c.count,)) if c.kind == "blob" else (c.scalar, c.shape)
            count = math.prod(extents)
            size = count * SIZES[scalar]
            shape = (ctypes.c_uint32 * max(len(extents), 1))(*extents)
            fields.append(CField(type=scalar, rank=len(extents), shape=shape, count=count, offset=offset, size=size))
            stamps = {"fresh_offset": 0, "sample_age_offset": 4, "stamp_offset": 8}
            channels.append(CChannel(id=c.id, direction=c.actuator, field=index, as_=KINDS_OF[c.kind], **stamps))
            self._at[c.id] = (offset, size, f"<{count}{FORMATS[scalar]}")
            offset += size
        self._lib, self._table, self._size = lib, table, offset
        self._machine = CMachine(
            fields=(CField * len(fields))(*fields),
            field_count=len(fields),
            channels=(CChannel * len(channels))(*channels),
            channel_count=len(channels),
            arm_field=-1,
        )
        self._channels = lib.fcsl_channel_table(ctypes.byref(self._machine))

    @property
    def hash(self) -> int:
        return int(self._channels.hash)

    def encode(self, message: Message, capacity: int) -> bytes | None:
        """The bytes, or None where they need more than `capacity`."""
        data, select = bytearray(self._size), bytearray(len(self._table))
        for index, channel in enumerate(self._table):
            if channel.id in message.values:
                offset, size, layout = self._at[channel.id]
                values = message.values[channel.id]
                if channel.kind == "blob":
                    values = [len(values), *values, *[0] * (channel.count - len(values))]
                data[offset : offset + size] = struct.pack(layout, *values)
                select[index] = 1
        out, made = ctypes.create_string_buffer(capacity), CMessage()
        ends = (out, ctypes.c_size_t(capacity), ctypes.byref(made))
        table, tick = ctypes.byref(self._channels), ctypes.c_uint64(message.tick)
        if message.kind is Kind.SENSORS:
            status = self._lib.fcsl_message_encode_sensors(table, bytes(data), tick, bytes(select), *ends)
        elif message.kind is Kind.ACTUATORS:
            status = self._lib.fcsl_message_encode_actuators(table, bytes(data), tick, int(message.armed), *ends)
        else:
            status = self._lib.fcsl_message_encode_time(table, tick, ctypes.c_uint64(message.time_ns), *ends)
        assert REASONS[status] in ("", "short")
        return out.raw[: made.size] if status == 0 else None

    def decode(self, data: bytes, kind: Kind) -> Message:
        checked, exact = CMessage(), (ctypes.c_char * max(len(data), 1)).from_buffer_copy(data or b"\0")
        number = kind - Kind.SENSORS
        status = self._lib.fcsl_message_check(
            ctypes.byref(self._channels), number, exact, ctypes.c_size_t(len(data)), ctypes.byref(checked)
        )
        if status:
            raise MessageError(REASONS[status])
        assert checked.kind == number
        blank, other = (
            ctypes.create_string_buffer(self._size),
            ctypes.create_string_buffer(b"\1" * self._size, self._size),
        )
        for image in (blank, other):
            self._lib.fcsl_message_apply(ctypes.byref(self._machine), image, ctypes.byref(checked))
        values = {}
        for channel in self._table:
            offset, size, layout = self._at[channel.id]
            found = blank.raw[offset : offset + size]
            if found == other.raw[offset : offset + size]:
                values[channel.id] = struct.unpack(layout, found)
                if channel.kind == "blob":
                    count, *elements = values[channel.id]
                    assert not any(elements[count:])
                    values[channel.id] = tuple(elements[:count])
        return Message(kind, checked.tick, values, bool(checked.armed), checked.time_ns, checked.skipped)


def same(left: Message, right: Message) -> bool:
    """Equal, NaNs too."""
    return repr(plain(left)) == repr(plain(right))


def plain(message: Message) -> Message:
    values = {
        channel: tuple(math.nan if isinstance(v, float) and math.isnan(v) else v for v in message.values[channel])
        for channel in sorted(message.values)
    }
    return Message(message.kind, message.tick, values, message.armed, message.time_ns, message.skipped)


def outcome(decoder: Any, data: bytes, kind: Kind) -> tuple[str, Message | None]:
    try:
        return "", decoder(data, kind)
    except MessageError as e:
        return e.reason, None


SCALARS = (
    st.booleans(),
    st.integers(-(2**31), 2**31 - 1),
    st.integers(-(2**63), 2**63 - 1),
    st.integers(0, 2**32 - 1),
    st.integers(0, 2**64 - 1),
    st.floats(width=32),
    st.floats(),
)
SHAPES = st.sampled_from([(), (3,), (1,), (4,), (3, 3), (1, 3), (2, 2, 2), (40,)])
IDS = st.one_of(st.integers(0, 9), st.integers(0, 0xFEFF))
CHANNELS = st.one_of(
    st.builds(Channel, IDS, st.booleans(), st.integers(0, 6), SHAPES),
    st.builds(Channel, IDS, st.booleans(), st.integers(5, 6), st.just((4,)), st.just("quaternion")),
    st.builds(Channel, IDS, st.booleans(), st.just(0), st.tuples(st.integers(1, 40)), st.just("blob")),
)
TABLES = st.lists(CHANNELS, max_size=8, unique_by=lambda c: c.id)
U64 = st.integers(0, 2**64 - 1)


@st.composite
def messages(draw: st.DrawFn) -> tuple[list[Channel], Message]:
    table, kind = draw(TABLES), draw(st.sampled_from(KINDS))
    values = {}
    for c in table:
        carried = kind is (Kind.ACTUATORS if c.actuator else Kind.SENSORS)
        if carried and (c.actuator or draw(st.booleans())):
            if c.kind == "blob":
                values[c.id] = draw(st.lists(st.integers(0, 255), max_size=c.count))
            else:
                values[c.id] = draw(st.lists(SCALARS[c.scalar], min_size=c.count, max_size=c.count))
    armed = kind is Kind.ACTUATORS and draw(st.booleans())
    return table, Message(kind, draw(U64), values, armed, draw(U64) if kind is Kind.TIME else 0)


UNKNOWN = st.one_of(
    st.tuples(st.integers(0, 0xFEFF), st.sampled_from([0x00, 0x05, 0x16, 0x26, 0x34, 0x40])),
    st.tuples(st.sampled_from([0xFF06, 0xFFFE]), st.just(0x04)),
)


def taken(message: Message, table: list[Channel]) -> Message:
    """What a receiver makes of it: a sensor's quaternion of length zero is skipped."""
    rotations = {c.id for c in table if c.kind == "quaternion" and not c.actuator}
    null = {number for number, values in message.values.items() if number in rotations and not any(values)}
    kept = {number: values for number, values in message.values.items() if number not in null}
    return replace(message, values=kept, skipped=message.skipped + len(null))


def unknown_entry(number: int, kind: int, count: int) -> bytes:
    shape, scalar = kind >> 4, kind & 15
    values = (1, 3, 4)[shape] if shape < 3 else count
    return (
        struct.pack("<HB", number, kind)
        + (struct.pack("<H", count) if shape >= 3 else b"")
        + b"\xff" * (values * SIZES[scalar])
    )


def sealed(body: bytes) -> bytes:
    body += b"\xff\xff\x03"
    return body + struct.pack("<I", zlib.crc32(body))


@settings(max_examples=150)
@given(messages())
def test_both_write_the_same_bytes_and_read_the_same_values(
    native: ctypes.CDLL, case: tuple[list[Channel], Message]
) -> None:
    table, message = case
    c = Native(native, table)
    data = encode(message, table)
    assert c.hash == table_hash(table)
    assert c.encode(message, len(data)) == data
    assert c.encode(message, len(data) - 1) is None
    assert same(decode(data, message.kind, table), taken(message, table))
    assert same(c.decode(data, message.kind), taken(message, table))


@settings(max_examples=150)
@given(messages(), st.lists(st.tuples(UNKNOWN, st.integers(0, 3)), max_size=3), st.randoms(use_true_random=False))
def test_both_take_channels_in_any_order_and_skip_what_they_do_not_know(
    native: ctypes.CDLL,
    case: tuple[list[Channel], Message],
    strange: list[tuple[tuple[int, int], int]],
    r: Any,
) -> None:
    table, message = case
    data = encode(message, table)
    parts = [data[e.start : e.end] for e in entries(data)]
    head = 2 if message.kind is Kind.SENSORS else 3
    known = {c.id for c in table}
    added = [unknown_entry(*kind, count) for kind, count in strange if kind[0] not in known]
    middle = parts[head:-1] + added
    r.shuffle(middle)
    other = sealed(b"".join(parts[:head] + middle))
    expected = taken(replace(message, skipped=len(added)), table)
    assert same(decode(other, message.kind, table), expected)
    assert same(Native(native, table).decode(other, message.kind), expected)


@settings(max_examples=300)
@given(messages(), st.sampled_from(KINDS), st.data())
def test_both_refuse_alike(
    native: ctypes.CDLL, case: tuple[list[Channel], Message], asked: Kind, data: st.DataObject
) -> None:
    """Entries changed, repeated, taken away and cut, with a right checksum; and bytes of any kind."""
    table, message = case
    whole = encode(message, table)
    parts = [whole[e.start : e.end] for e in entries(whole)][:-1]
    for _ in range(data.draw(st.integers(0, 2), "changes")):
        at = data.draw(st.integers(0, len(parts) - 1), "entry")
        how = data.draw(st.sampled_from(["byte", "repeat", "drop", "cut", "swap"]), "how")
        if how == "byte" and parts[at]:
            place, byte = data.draw(st.integers(0, min(len(parts[at]), 8) - 1)), data.draw(st.integers(0, 255))
            parts[at] = parts[at][:place] + bytes([byte]) + parts[at][place + 1 :]
        elif how == "repeat":
            parts.append(parts[at])
        elif how == "drop" and len(parts) > 1:
            del parts[at]
        elif how == "cut":
            parts[at] = parts[at][: data.draw(st.integers(0, len(parts[at])))]
        else:
            parts[0], parts[at] = parts[at], parts[0]
    body = sealed(b"".join(parts))
    kind = data.draw(st.sampled_from([message.kind, message.kind, asked]), "asked")
    c = Native(native, table)
    for candidate in (body, body[:-1], data.draw(st.binary(max_size=60), "any")):
        left = outcome(lambda d, k: decode(d, k, table), candidate, kind)
        right = outcome(c.decode, candidate, kind)
        assert left[0] == right[0]
        if left[1] is not None and right[1] is not None:
            assert same(left[1], right[1])


def test_a_channel_taken_out_leaves_a_whole_message() -> None:
    table = [Channel(1, False, 6, (3,)), Channel(2, False, 0), Channel(3, False, 3, (2, 2))]
    message = Message(Kind.SENSORS, 9, {1: (1.0, 2.0, 3.0), 2: (True,), 3: (1, 2, 3, 4)})
    left = decode(without(encode(message, table), {1, 3}), Kind.SENSORS, table)
    assert same(left, Message(Kind.SENSORS, 9, {2: (True,)}))


# ---- docs/reference/transports.md ----------------------------------------------------------------------------------------------------

PAGE = (ROOT / "docs/reference/transports.md").read_text()
_, _, _SECTION = PAGE.partition("\n### Test vectors\n")
VECTORS, ACCEPTED, REFUSED = (json.loads(block) for block in re.findall(r"```json\n(.*?)```", _SECTION, re.DOTALL))


def page_table() -> list[Channel]:
    """The channels of the page's example, and its rows."""
    table = []
    pattern = (
        r"\| (\d+) \| (sensor|actuator) \| `(\w+)(?:\[([\d, ]+)\])?`(?: as (\w+))? \| (0x\w\w) \| `([0-9A-F ]+)` \|"
    )
    for number, direction, scalar, shape, kind, code, row in re.findall(pattern, PAGE):
        extents = tuple(int(n) for n in shape.split(",")) if shape else ()
        names = ("bool", "i32", "i64", "u32", "u64", "f32", "f64")
        if kind == "blob":
            assert scalar == "u32"
            scalar, extents = "bool", (extents[0] - 1,)
        channel = Channel(int(number), direction == "actuator", names.index(scalar), extents, kind or "field")
        assert channel.type == int(code, 16)
        packed = struct.pack("<HBBI", channel.id, channel.actuator, channel.type, channel.count)
        assert packed == bytes.fromhex(row)
        table.append(channel)
    return table


def vector_message(vector: dict[str, Any]) -> Message:
    values = {int(n): [math.nan if v == "nan" else v for v in vs] for n, vs in vector["values"].items()}
    return Message(
        Kind[vector["message"].upper()],
        vector["tick"],
        values,
        vector.get("armed", False),
        vector.get("time_ns", 0),
        vector.get("skipped", 0),
    )


def vector_bytes(vector: dict[str, Any]) -> bytes:
    return bytes.fromhex(" ".join(vector["bytes"]))


def test_the_hash_of_the_page(native: ctypes.CDLL) -> None:
    table = page_table()
    assert len(table) == 8
    (printed,) = re.findall(r"is the hash: `(0x[0-9A-F]{8})`", PAGE)
    assert int(printed, 16) == table_hash(table) == Native(native, table).hash
    assert zlib.crc32(b"123456789") == 0xCBF43926


@pytest.mark.parametrize("vector", VECTORS + ACCEPTED, ids=lambda v: f"{v['message']}-{v['tick']}")
def test_vectors_of_the_page(native: ctypes.CDLL, vector: dict[str, Any]) -> None:
    table, message, data = page_table(), vector_message(vector), vector_bytes(vector)
    c = Native(native, table)
    if not message.skipped:
        assert encode(message, table) == c.encode(message, len(data)) == data
    assert same(decode(data, message.kind, table), taken(message, table))
    assert same(c.decode(data, message.kind), taken(message, table))


@pytest.mark.parametrize("vector", REFUSED, ids=lambda v: f"{v['message']}-{v['refused']}")
def test_refused_vectors_of_the_page(native: ctypes.CDLL, vector: dict[str, Any]) -> None:
    table, kind, data = page_table(), Kind[vector["message"].upper()], vector_bytes(vector)
    assert outcome(lambda d, k: decode(d, k, table), data, kind)[0] == vector["refused"]
    assert outcome(Native(native, table).decode, data, kind)[0] == vector["refused"]
