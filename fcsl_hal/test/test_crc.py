# SPDX-License-Identifier: Apache-2.0
"""fcsl_crc32 and fcsl_crc16 against Python's: every length and alignment, pieces, long ones; and a wrong constant in each table
is found."""

from __future__ import annotations

import binascii
import ctypes
import random
import re
import subprocess
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from fcsl_compiler.driver.toolchain import include_dirs

HAL = Path(__file__).resolve().parents[1]
#: Over the bytes from an offset on, so many of them, continuing.
Crc = Callable[[ctypes.Array[ctypes.c_char], int, int, int], int]
MARGIN = 16


@dataclass(frozen=True)
class Kind:
    """`bits` wide, beginning with `first`; `peer` computes the same of bytes, continuing."""

    file: str
    bits: int
    first: int
    peer: Callable[[bytes, int], int]

    def source(self) -> str:
        return (HAL / "src" / self.file).read_text()

    def build(self, folder: Path, text: str) -> Crc:
        """The function of this source."""
        source, library = folder / "crc.c", folder / "libcrc.so"
        source.write_text(text)
        includes = [f"-I{path}" for path in (*include_dirs(), HAL / "include", HAL / "src")]
        subprocess.run(["cc", "-std=c11", "-O1", "-fPIC", "-shared", *includes, source, "-o", library], check=True)
        function = getattr(ctypes.CDLL(str(library)), f"fcsl_crc{self.bits}")
        number = {16: ctypes.c_uint16, 32: ctypes.c_uint32}[self.bits]
        function.restype, function.argtypes = number, [number, ctypes.c_void_p, ctypes.c_size_t]
        return lambda data, offset, size, crc: int(function(crc, ctypes.addressof(data) + offset, size))


KINDS = (Kind("codec/crc32.c", 32, 0, zlib.crc32), Kind("link/crc16.c", 16, 0xFFFF, binascii.crc_hqx))


@pytest.fixture(scope="module", params=KINDS, ids=lambda kind: f"crc{kind.bits}")
def kind(request: pytest.FixtureRequest) -> Kind:
    found: Kind = request.param
    return found


@pytest.fixture(scope="module")
def crc(kind: Kind, tmp_path_factory: pytest.TempPathFactory) -> Crc:
    return kind.build(tmp_path_factory.mktemp("crc"), kind.source())


def array(size: int, seed: int) -> ctypes.Array[ctypes.c_char]:
    return ctypes.create_string_buffer(random.Random(seed).randbytes(size), size)


def test_every_length_and_alignment(kind: Kind, crc: Crc) -> None:
    data = array(64 + MARGIN, 1)
    for offset in range(MARGIN):
        for size in range(65):
            expected = kind.peer(data.raw[offset : offset + size], kind.first)
            assert crc(data, offset, size, kind.first) == expected, (offset, size)


def test_pieces(kind: Kind, crc: Crc) -> None:
    """A checksum that goes on from another, cut anywhere."""
    data = array(64, 2)
    for cut in range(65):
        assert crc(data, cut, 64 - cut, crc(data, 0, cut, kind.first)) == kind.peer(data.raw, kind.first), cut


@pytest.mark.parametrize("seed", range(20))
def test_long_ones(kind: Kind, crc: Crc, seed: int) -> None:
    size = random.Random(seed).randrange(1000, 200_000)
    data = array(size, seed)
    assert crc(data, seed % 8, size - seed % 8, seed) == kind.peer(data.raw[seed % 8 :], seed)


@pytest.mark.parametrize("byte", [b"\0", b"\xff"])
def test_uniform_ones(kind: Kind, crc: Crc, byte: bytes) -> None:
    data = ctypes.create_string_buffer(byte * 4099, 4099)
    assert crc(data, 0, 4099, kind.first) == kind.peer(data.raw, kind.first)


@pytest.mark.parametrize("row", range(8))
def test_control_one_wrong_bit(kind: Kind, tmp_path: Path, row: int) -> None:
    """In one constant of a table: the comparison finds it."""
    text = kind.source()
    digits = kind.bits // 4
    constant = re.findall(rf"0x[0-9a-f]{{{digits}}}u", text.split("TABLES[8]")[1])[8 * row + (3 * row) % 8]
    assert text.count(constant) == 1
    wrong = kind.build(tmp_path, text.replace(constant, f"{int(constant[:-1], 16) ^ 0x0100:#0{digits + 2}x}u"))
    data = array(64, row)
    assert wrong(data, 0, 64, kind.first) != kind.peer(data.raw, kind.first)
