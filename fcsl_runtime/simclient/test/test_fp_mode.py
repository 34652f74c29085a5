# SPDX-License-Identifier: Apache-2.0
"""Bits do not depend on the floating-point mode that a library of this process left behind."""

from __future__ import annotations

import ctypes
import json
import struct
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest

from simclient import AlgTwin, PyTwin
from simclient.errors import TwinError

#: Small numbers, a rounded third, and a constant that the compiler folds.
DECAY = """
TINY = 4.0e-310 * 3.0


class Decay:
    inputs = {"three": "f64"}
    outputs = {"y": "f64", "z": "f64", "third": "f64", "narrow": "f32"}

    def start(self):
        self.y = 1.0e-307

    def execute(self):
        self.y = self.y * 0.5
        self.z = self.y / 1.0e-320 + TINY / 1.0e-310
        self.third = 1.0 / self.three
        self.narrow = f32(self.third)
"""
#: Changes the mode of the calling thread as crtfastmath.o does, or its rounding.
CHANGER = """
#include <fenv.h>
#include <stdint.h>
#if defined(__SSE2__)
#include <xmmintrin.h>
static void flush(void) { _mm_setcsr(_mm_getcsr() | 0x8040u); }
static uint32_t mode(void) { return (uint32_t)_mm_getcsr() & 0xffc0u; }
#elif defined(__aarch64__)
static void flush(void) { uint64_t r; __asm__ volatile("mrs %0, fpcr" : "=r"(r)); r |= UINT64_C(1) << 24; __asm__ volatile("msr fpcr, %0" : : "r"(r)); }
static uint32_t mode(void) { uint64_t r; __asm__ volatile("mrs %0, fpcr" : "=r"(r)); return (uint32_t)r; }
#endif
void change(int32_t how) { if (how == 1) flush(); if (how == 2) (void)fesetround(FE_UPWARD); if (how == 0) (void)fesetenv(FE_DFL_ENV); }
uint32_t current(void) { return mode(); }
"""
CALLER = """
@extern(header="changer.h")
def change(how: i32) -> None: ...


class Caller:
    inputs = {"how": "i32"}
    outputs = {"ticks": "u32"}

    def execute(self):
        self.ticks = self.ticks + 1
        change(self.how)
"""


@pytest.fixture(scope="module")
def changer(tmp_path_factory: pytest.TempPathFactory) -> Iterator[ctypes.CDLL]:
    folder = tmp_path_factory.mktemp("changer")
    (folder / "changer.c").write_text(CHANGER)
    line = ["cc", "-shared", "-fPIC", str(folder / "changer.c"), "-lm", "-o", str(folder / "changer.so")]
    subprocess.run(line, check=True)
    library = ctypes.CDLL(str(folder / "changer.so"))
    yield library
    library.change(0)


def decay(folder: Path) -> Path:
    (folder / "decay.py").write_text("from fcsl_builtins import f32\n" + DECAY)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Decay": {"source": "decay.py"}},
        "instances": {"decay": {"algorithm": "Decay", "inputs": {"three": 3.0}}},
        "states": {"RUN": {"schedule": {"decay": 100}}},
    }
    (folder / "m.json").write_text(json.dumps(config))
    return folder / "m.json"


def bits(kind: type[AlgTwin] | type[PyTwin], config: Path) -> list[bytes]:
    """As bytes: what Python makes of a small number depends on the mode, too."""
    with kind.from_config(config) as twin:
        twin.tick(10)
        return [struct.pack("<d", twin.get_value(f"decay.outputs.{name}")) for name in ("y", "z", "third", "narrow")]


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
@pytest.mark.parametrize("how", [1, 2], ids=["small numbers become zero", "rounding upward"])
def test_the_mode_of_the_process_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, changer: ctypes.CDLL, kind: type[AlgTwin] | type[PyTwin], how: int
) -> None:
    """Neither the ticks, nor what the compiler computes; and the caller keeps its mode."""
    expected = bits(AlgTwin, decay(tmp_path))
    assert expected[0] != bytes(8)
    monkeypatch.setenv("FCSL_CACHE_DIR", str(tmp_path / "cache"))  # it is compiled anew
    changer.change(how)
    mode = changer.current()
    try:
        with pytest.warns(RuntimeWarning, match="floating-point mode"):
            found = bits(kind, tmp_path / "m.json")
        assert changer.current() == mode
    finally:
        changer.change(0)
    assert found == expected


def caller(folder: Path) -> Path:
    (folder / "caller.py").write_text("from fcsl_builtins import extern, i32\n" + CALLER)
    (folder / "decay.py").write_text("from fcsl_builtins import f32\n" + DECAY)
    (folder / "changer.h").write_text("#include <stdint.h>\nvoid change(int32_t how);\n")
    (folder / "changer.c").write_text(CHANGER)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Caller": {"source": "caller.py"}, "Decay": {"source": "decay.py"}},
        "instances": {"caller": {"algorithm": "Caller"}, "decay": {"algorithm": "Decay", "inputs": {"three": 3.0}}},
        "states": {"RUN": {"schedule": {"caller": 100, "decay": 100}}},
        "targets": {"simulation": {"sources": ["changer.c"], "include": ["."], "libraries": ["m"]}},
    }
    (folder / "m.json").write_text(json.dumps(config))
    return folder / "m.json"


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
def test_c_code_that_leaves_another_mode_is_named(
    tmp_path: Path, changer: ctypes.CDLL, kind: type[AlgTwin] | type[PyTwin]
) -> None:
    mode = changer.current()
    with kind.from_config(caller(tmp_path)) as twin:
        twin.tick(3)
        twin.set("caller.inputs.how", 1)
        with pytest.raises(TwinError, match="instance `caller` left another floating-point mode"):
            twin.tick(2)
        assert twin.get_value("caller.outputs.ticks") == 5 and changer.current() == mode
        twin.set("caller.inputs.how", 0)
        twin.tick(5)
        assert float(twin.get_value("decay.outputs.y")) == 1.0e-307 * 0.5**10
