# SPDX-License-Identifier: Apache-2.0
"""C programs of `make bench`: compiled like machines, and how large what was compiled is."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.driver.toolchain import FLAGS, compiler, include_dirs, math_library

BENCH = Path(__file__).resolve().parents[1]
#: Of a program: nothing is shared, and all may be seen.
_FLAGS = [f for f in FLAGS if f not in ("-fPIC", "-fvisibility=hidden")]


def compile_program(
    sources: Sequence[str | Path], output: Path, includes: Sequence[Path] = (), more: Sequence[str] = ()
) -> Path:
    """A program of C sources (names are of scripts/bench), with the flags of a machine and some more."""
    folders = [f"-I{d}" for d in (BENCH / "harness", BENCH / "peers", *includes, *include_dirs())]
    files = [str(BENCH / s) if isinstance(s, str) else str(s) for s in sources]
    line = [*compiler(), *_FLAGS, *more, "-D_GNU_SOURCE=", *folders, *files, str(math_library()), "-ldl", "-lm"]
    subprocess.run([*line, "-o", str(output)], check=True)
    return output


def code_bytes(source: Path, includes: Sequence[Path] = ()) -> int:
    """Bytes of machine code that a C source becomes with the flags of a machine, without its constants."""
    folders = [f"-I{d}" for d in (source.parent, *includes, *include_dirs())]
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "object.o"
        subprocess.run([*compiler(), *FLAGS, *folders, "-c", str(source), "-o", str(made)], check=True)
        table = subprocess.run(["size", "-A", str(made)], stdout=subprocess.PIPE, text=True, check=True).stdout
    return sum(int(size) for size in re.findall(r"^\.text\S*\s+(\d+)", table, re.MULTILINE))
