# SPDX-License-Identifier: Apache-2.0
"""Symbols of ELF files, compared with nm."""

from __future__ import annotations

import struct
import subprocess
from pathlib import Path

import pytest

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.elf import read_symbols
from fcsl_compiler.driver.symbols import SymbolError, check_symbols
from fcsl_compiler.driver.toolchain import compile_objects

SOURCE = """
#include <math.h>
extern int somewhere(void) __attribute__((weak));
static double kept;
double shared_value;
double rounded(double x) { kept = fma(x, x, kept); return somewhere ? sin(kept) : kept; }
"""


def by_nm(path: Path, *options: str) -> tuple[set[str], set[str]]:
    done = subprocess.run(["nm", *options, path], check=True, capture_output=True, text=True)
    rows = [line.split() for line in done.stdout.splitlines()]
    return {r[-1].split("@")[0] for r in rows if r[-2] == "U"}, {r[-1].split("@")[0] for r in rows if len(r) > 2}


def test_an_object(tmp_path: Path) -> None:
    (tmp_path / "part.c").write_text(SOURCE)
    (made,) = compile_objects([tmp_path / "part.c"], [], tmp_path / "out")
    found = read_symbols(made, dynamic=False)
    assert found == by_nm(made)
    assert {"fma", "sin"} <= found.needed and {"kept", "rounded", "shared_value"} <= found.defined
    assert "somewhere" not in found.needed | found.defined


@pytest.mark.parametrize("wide", [False, True])
@pytest.mark.parametrize("order", "<>")
def test_objects_of_any_processor(tmp_path: Path, wide: bool, order: str) -> None:
    """32 and 64 bits, little- and big-endian: written here, as the ELF specification has it."""
    names = b"\0fma\0step\0"
    if wide:
        symbols = b"".join(struct.pack(f"{order}IBBHQQ", n, 0x10, 0, place, 0, 0) for n, place in ((1, 0), (5, 1)))
        head, section = f"{order}HHIQQQIHHHHHH", f"{order}IIQQQQIIQQ"
    else:
        symbols = b"".join(struct.pack(f"{order}IIIBBH", n, 0, 0, 0x10, 0, place) for n, place in ((1, 0), (5, 1)))
        head, section = f"{order}HHIIIIIHHHHHH", f"{order}10I"
    start = 16 + struct.calcsize(head)
    sections_at = start + len(names) + len(symbols)
    header = struct.pack(head, 1, 0, 1, 0, 0, sections_at, 0, start, 0, 0, struct.calcsize(section), 2, 0)
    table = struct.pack(section, 0, 3, 0, 0, start, len(names), 0, 0, 1, 0)
    table += struct.pack(section, 0, 2, 0, 0, start + len(names), len(symbols), 0, 1, 1, len(symbols) // 2)
    identity = b"\x7fELF" + bytes([1 + wide, "<>".index(order) + 1, 1]) + bytes(9)
    (tmp_path / "made.o").write_bytes(identity + header + names + symbols + table)
    assert read_symbols(tmp_path / "made.o", dynamic=False) == ({"fma"}, {"step"})


def test_a_library() -> None:
    library = package_prefix("fcsl_compiler") / "lib/libfcsl_math.so"
    assert read_symbols(library, dynamic=True) == by_nm(library, "-D")


def test_what_is_no_library(tmp_path: Path) -> None:
    text, cut, start = tmp_path / "text.so", tmp_path / "cut.so", tmp_path / "start.so"
    text.write_text("not a library")
    cut.write_bytes((package_prefix("fcsl_compiler") / "lib/libfcsl_math.so").read_bytes()[:5000])
    start.write_bytes(b"\x7fELF")
    for path, why in (
        (text, "not an ELF file"),
        (start, "not an ELF file"),
        (cut, "a damaged ELF file"),
        (tmp_path / "none", "No such file or directory"),
    ):
        with pytest.raises(SymbolError, match=f"{path}: {why}"):
            check_symbols(path)
