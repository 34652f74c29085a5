# SPDX-License-Identifier: Apache-2.0
"""Examples in C that the pages name, compiled with a program that uses them, as a user would with this package installed."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

from fcsl_compiler.driver.toolchain import include_dirs

HAL = Path(__file__).resolve().parents[1]
STRICT = ["-std=c11", "-D_GNU_SOURCE", "-O1", "-Wall", "-Wextra", "-Werror"]


def run_program(source: Path, macro: str, program: Path, folder: Path) -> None:
    """Compiles `program`, which includes `source` by the name `macro`, and runs it. Raises CalledProcessError."""
    build = Path(os.environ.get("FCSL_TEST_PROGRAMS", HAL.parent / "build/fcsl_hal"))
    libraries = [build / "libfcsl_hal.a", build / "cargo/release/libfcsl_io.a", "-Wl,--gc-sections"]
    includes = [f"-I{path}" for path in (*include_dirs(), HAL / "include", HAL / "test", HAL / "test/support")]
    define = f'-D{macro}="{source}"'
    out = folder / "program"
    subprocess.run(["cc", *STRICT, define, *includes, program, *libraries, "-lpthread", "-lm", "-o", out], check=True)
    subprocess.run([out], check=True, timeout=60)
