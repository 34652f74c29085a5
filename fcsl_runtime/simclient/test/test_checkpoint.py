# SPDX-License-Identifier: Apache-2.0
"""Checkpoints: their bytes as docs/guide/recording.md has them, read here with struct and zlib; what is refused and why."""

from __future__ import annotations

import os
import re
import stat
import struct
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simclient import AlgTwin, ProcessTwin, TwinError

_HEAD = struct.Struct("<8sIIQQQIIII64s64s64s")
_MACHINE_H = Path(__file__).resolve().parents[3] / "fcsl_compiler/include/fcsl/fcsl_machine.h"
_ABI = int(re.findall(r"#define FCSL_ABI_VERSION (\d+)u", _MACHINE_H.read_text())[0])


class Parts(NamedTuple):
    """A checkpoint taken apart by the specification; `whole` puts it together again, sizes and CRC made anew."""

    magic: bytes
    version: int
    abi: int
    size: int
    tick: int
    tick_hz: int
    struct_bytes: int
    entries: int
    byte_order: int
    name_bytes: int
    source: bytes
    layout: bytes
    build: bytes
    name: bytes
    data: bytes
    hardware: bytes

    @staticmethod
    def of(content: bytes) -> Parts:
        assert zlib.crc32(content[:-4]) == int.from_bytes(content[-4:], "little")
        head = _HEAD.unpack_from(content)
        name_end = _HEAD.size + head[9]
        data_end = name_end + head[6]
        assert len(content) == head[3] == data_end + 16 * head[7] + 4
        return Parts(*head, content[_HEAD.size : name_end], content[name_end:data_end], content[data_end:-4])

    def whole(self) -> bytes:
        body = self.name + self.data + self.hardware
        counts = {
            "size": _HEAD.size + len(body) + 4,
            "struct_bytes": len(self.data),
            "entries": len(self.hardware) // 16,
            "name_bytes": len(self.name),
        }
        content = _HEAD.pack(*self._replace(**counts)[:13]) + body
        return content + zlib.crc32(content).to_bytes(4, "little")


@pytest.fixture
def twin(probe: Path) -> Iterator[AlgTwin]:
    with AlgTwin.from_library(probe) as twin:
        twin.set("source.outputs.vec", [1.0, 2.0, 0.25])
        twin.hardware.gpio[17] = True
        twin.hardware.adc[1023] = 1500
        twin.hardware.registers[0xFFFFFFFF] = 2**32 - 1
        twin.hardware.registers[3] = 7
        twin.tick(7)
        yield twin


# ---- the format -------------------------------------------------------------------------------------------------------


def test_the_bytes_are_as_specified(twin: AlgTwin) -> None:
    parts, machine = Parts.of(twin.save()), twin.machine
    assert parts[:3] == (b"FCSLCKPT", 2, _ABI) and (parts.tick, parts.tick_hz) == (7, machine.tick_hz)
    hashes = [machine.source_hash, machine.layout_hash, machine.build_hash]
    assert [h.rstrip(b"\0").decode() for h in (parts.source, parts.layout, parts.build)] == hashes
    assert parts.name == machine.name.encode() and parts.data == twin._save() and parts.byte_order == 1
    assert list(struct.iter_unpack("<IIQ", parts.hardware)) == [
        (0, 17, 1),
        (1, 1023, 1500),
        (2, 3, 7),
        (2, 0xFFFFFFFF, 2**32 - 1),
    ]
    assert parts.whole() == twin.save()


def test_it_brings_back_the_machine_and_its_hardware(twin: AlgTwin, probe: Path) -> None:
    saved = twin.save()
    with AlgTwin.from_library(probe) as other:
        other.hardware.gpio[5] = True
        other.restore(saved)
        assert other.save() == saved and other.hardware.gpio[17] and not other.hardware.gpio[5]
        assert (other.hardware.adc[1023], other.hardware.registers[3]) == (1500, 7)
        other.tick(3)
        twin.tick(3)
        assert other.save() == twin.save()


def test_a_file_has_the_bytes_of_memory(twin: AlgTwin, tmp_path: Path) -> None:
    path = tmp_path / "a checkpoint"
    twin.save_file(path)
    saved = twin.save()
    assert path.read_bytes() == saved and os.listdir(tmp_path) == [path.name]
    twin.tick(5)
    twin.restore_file(path)
    assert twin.save() == saved


def test_a_process_takes_it_and_gives_it(probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin, ProcessTwin.from_library(probe) as process:
        twin.set("source.outputs.vec", [1.0, 2.0, 0.25])
        twin.tick(7)
        twin.save_file(tmp_path / "checkpoint")
        process.restore_file(tmp_path / "checkpoint")
        assert process.save() == twin.save()
        twin.tick(3)
        process.tick(3)
        twin.restore(process.save())
        assert process.save() == twin.save() and twin.get_value("machine.tick") == 10
        twin.hardware.gpio[1] = True
        twin.hardware.adc[7] = 2500
        process.restore(twin.save())
        assert process.save() == twin.save()


@settings(max_examples=100)
@given(st.data())
def test_every_nan_is_the_same_in_it(probe: Path, data: st.DataObject) -> None:
    """Whatever bits the machine left in memory; the reference is NumPy's isnan."""
    with AlgTwin.from_library(probe) as twin:
        wanted = bytearray(twin._save())
        for field in (f for f in twin.fields() if f.type in ("f64", "f32")):
            floats, bits = (np.float64, np.uint64) if field.type == "f64" else (np.float32, np.uint32)
            inf, ones = int(floats("inf").view(bits)), int(np.iinfo(bits).max)
            number = st.integers(0, ones) | st.sampled_from([0, inf, inf + 1, ones, ones - 1])
            values = np.array(data.draw(st.lists(number, min_size=field.count, max_size=field.count)), bits)
            place = slice(field.offset, field.offset + field.size)
            twin._run._data[place] = values.tobytes()
            values[np.isnan(values.view(floats))] = floats("nan").view(bits)
            wanted[place] = values.tobytes()
        assert twin._save() == wanted and Parts.of(twin.save()).data == wanted


# ---- what is refused --------------------------------------------------------------------------------------------------


def refused(twin: AlgTwin, content: bytes, **options: Any) -> str:
    """The reason; nothing has changed."""
    before = twin.save()
    with pytest.raises(TwinError) as caught:
        twin.restore(content, **options)
    assert twin.save() == before
    return str(caught.value)


#: What is changed in a whole checkpoint, and what the refusal says.
FORGED: list[tuple[Callable[[Parts], dict[str, Any]], str]] = [
    (lambda p: {"magic": b"FCSLCKPU"}, "not a checkpoint"),
    (lambda p: {"version": 4}, "format version 4, and this program reads versions 2 and 3"),
    (lambda p: {"abi": 2}, f"machine ABI 2, and this program hosts ABI {_ABI}"),
    (lambda p: {"byte_order": 2}, "other byte order"),
    (lambda p: {"name": b"pr\x1b[2Jobe"}, r"machine 'pr?[2Jobe', not of 'probe'"),
    (lambda p: {"name": b""}, "machine '', not of"),
    (lambda p: {"layout": b"7" * 64}, "another layout of machine 'probe' (layout_hash 777777777777, here"),
    (lambda p: {"data": p.data + bytes(8)}, "another layout"),
    (lambda p: {"source": b"8" * 64}, "other sources of machine 'probe' (source_hash 888888888888, here"),
    (lambda p: {"tick": p.tick + 1}, "another tick than its machine"),
    (lambda p: {"tick": 2**63}, "an impossible tick"),
    (lambda p: {"name": b"large", "data": bytes(300_000)}, "machine 'large', not of 'probe'"),
    (lambda p: {"data": bytes(300_000)}, "another layout"),
    (lambda p: {"hardware": p.hardware[16:32] + p.hardware[:16]}, "impossible simulated hardware"),
    (lambda p: {"hardware": p.hardware[:16] * 2}, "impossible simulated hardware"),
    *[
        (lambda p, entry=entry: {"hardware": struct.pack("<IIQ", *entry)}, "impossible simulated hardware")
        for entry in ((3, 0, 1), (0, 1024, 1), (1, 1024, 1), (0, 0, 2), (0, 0, 0), (1, 0, 2**32), (2, 0, 2**32))
    ],
    (
        lambda p: {"hardware": b"".join(struct.pack("<IIQ", 2, n, 1) for n in range(1025))},
        "impossible simulated hardware",
    ),
]


@pytest.mark.parametrize(("change", "reason"), FORGED, ids=[reason for _, reason in FORGED])
def test_each_refusal_says_why(twin: AlgTwin, change: Callable[[Parts], dict[str, Any]], reason: str) -> None:
    parts = Parts.of(twin.save())
    assert reason in refused(twin, parts._replace(**change(parts)).whole())


def test_other_sources_of_the_same_layout_are_taken_when_told(twin: AlgTwin) -> None:
    content = Parts.of(twin.save())._replace(source=b"8" * 64).whole()
    assert "allow other sources (ignore_source_hash, --ignore-source-hash)" in refused(twin, content)
    twin.tick(2)
    twin.restore(content, ignore_source_hash=True)
    assert twin.get_value("machine.tick") == 7
    foreign = Parts.of(content)._replace(layout=b"7" * 64).whole()
    assert "another layout" in refused(twin, foreign, ignore_source_hash=True)


def test_impossible_values_are_refused(twin: AlgTwin) -> None:
    parts = Parts.of(twin.save())
    state = twin.machine.fields["machine.state"]
    data = parts.data[: state.offset] + b"\x63\0\0\0" + parts.data[state.offset + 4 :]
    assert "'machine.state' has an impossible value" in refused(twin, parts._replace(data=data).whole())


def test_every_damaged_bit_and_every_cut_is_refused(twin: AlgTwin) -> None:
    content = twin.save()
    for n in range(len(content)):
        damaged = bytearray(content)
        damaged[n] ^= 1 << n % 8
        reason = refused(twin, bytes(damaged))
        known = ("damaged", "not a checkpoint", "format version", "cut short")
        assert any(word in reason for word in known), (n, reason)
        assert ("cut short" if n >= 8 else "not a checkpoint") in refused(twin, content[:n])
    assert "damaged" in refused(twin, content + b"\0")


@settings(max_examples=300)
@given(st.binary(max_size=600))
def test_any_bytes_are_refused(probe: Path, noise: bytes) -> None:
    with AlgTwin.from_library(probe) as twin:
        refused(twin, noise)
        refused(twin, b"FCSLCKPT\2\0\0\0" + noise)


def test_what_is_no_file_is_refused(twin: AlgTwin, tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for name, reason in (("fifo", "not a regular file"), ("none", "No such file"), ("", "Is a directory")):
        with pytest.raises(TwinError, match=reason):
            twin.restore_file(tmp_path / name)
    with pytest.raises(TwinError, match="cannot write .*No such file"):
        twin.save_file(tmp_path / "none/checkpoint")
    (tmp_path / "link").symlink_to("/dev/null")
    for name in ("fifo", "link"):
        with pytest.raises(TwinError, match="cannot write .*not a regular file"):
            twin.save_file(tmp_path / name)
    assert stat.S_ISFIFO(os.stat(tmp_path / "fifo").st_mode) and (tmp_path / "link").is_symlink()
    (tmp_path / "text").write_text("hello")
    with pytest.raises(TwinError, match="text: not a checkpoint"):
        twin.restore_file(tmp_path / "text")


def test_a_name_with_a_null_character_is_refused(twin: AlgTwin, tmp_path: Path) -> None:
    for call in (twin.save_file, twin.restore_file):
        with pytest.raises(TwinError, match="null character"):
            call(f"{tmp_path}/a\0b")
    assert not any(tmp_path.iterdir())
