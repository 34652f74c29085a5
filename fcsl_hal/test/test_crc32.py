# SPDX-License-Identifier: Apache-2.0
"""fcsl_crc32 against zlib's: every length and alignment, pieces, long ones; and a wrong constant in each table is found."""

from __future__ import annotations

import ctypes
import random
import re
import subprocess
import zlib
from collections.abc import Callable
from pathlib import Path

import pytest

from fcsl_compiler.driver.toolchain import include_dirs

HAL = Path(__file__).resolve().parents[1]
SOURCE = HAL / "src/crc32.c"
#: Over the bytes from an offset on, so many of them, continuing.
Crc = Callable[[ctypes.Array[ctypes.c_char], int, int, int], int]
MARGIN = 16


def build(folder: Path, text: str) -> Crc:
    """The function of this source."""
    source, library = folder / "crc32.c", folder / "libcrc32.so"
    source.write_text(text)
    includes = [f"-I{path}" for path in (*include_dirs(), HAL / "include", HAL / "src")]
    subprocess.run(["cc", "-std=c11", "-O1", "-fPIC", "-shared", *includes, source, "-o", library], check=True)
    function = ctypes.CDLL(str(library)).fcsl_crc32
    function.restype, function.argtypes = ctypes.c_uint32, [ctypes.c_uint32, ctypes.c_void_p, ctypes.c_size_t]
    return lambda data, offset, size, crc: int(function(crc, ctypes.addressof(data) + offset, size))


@pytest.fixture(scope="module")
def crc32(tmp_path_factory: pytest.TempPathFactory) -> Crc:
    return build(tmp_path_factory.mktemp("crc"), SOURCE.read_text())


def array(size: int, seed: int) -> ctypes.Array[ctypes.c_char]:
    return ctypes.create_string_buffer(random.Random(seed).randbytes(size), size)


def test_every_length_and_alignment(crc32: Crc) -> None:
    data = array(64 + MARGIN, 1)
    for offset in range(MARGIN):
        for size in range(65):
            assert crc32(data, offset, size, 0) == zlib.crc32(data.raw[offset : offset + size]), (offset, size)


def test_pieces(crc32: Crc) -> None:
    """A checksum that goes on from another, cut anywhere."""
    data = array(64, 2)
    for cut in range(65):
        assert crc32(data, cut, 64 - cut, crc32(data, 0, cut, 0)) == zlib.crc32(data.raw), cut


@pytest.mark.parametrize("seed", range(20))
def test_long_ones(crc32: Crc, seed: int) -> None:
    size = random.Random(seed).randrange(1000, 200_000)
    data = array(size, seed)
    assert crc32(data, seed % 8, size - seed % 8, seed) == zlib.crc32(data.raw[seed % 8 :], seed)


@pytest.mark.parametrize("byte", [b"\0", b"\xff"])
def test_uniform_ones(crc32: Crc, byte: bytes) -> None:
    data = ctypes.create_string_buffer(byte * 4099, 4099)
    assert crc32(data, 0, 4099, 0) == zlib.crc32(data.raw)


@pytest.mark.parametrize("row", range(8))
def test_control_one_wrong_bit(tmp_path: Path, row: int) -> None:
    """In one constant of a table: the comparison finds it."""
    text = SOURCE.read_text()
    constant = re.findall(r"0x[0-9a-f]{8}u", text.split("TABLES[8]")[1])[8 * row + (3 * row) % 8]
    assert text.count(constant) == 1
    wrong = build(tmp_path, text.replace(constant, f"{int(constant[:-1], 16) ^ 0x00010000:#010x}u"))
    data = array(64, row)
    assert wrong(data, 0, 64, 0) != zlib.crc32(data.raw)
