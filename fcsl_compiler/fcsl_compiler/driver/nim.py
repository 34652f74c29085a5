# SPDX-License-Identifier: Apache-2.0
"""The Nim compiler, which makes C of the modules of the Nim backend.

Only the C of the modules themselves is compiled. Nim's own system module, with its allocator, is not part of a library,
so a machine cannot use it; the scan of symbols (symbols.py) would name what is missing.
"""

from __future__ import annotations

import json
import re
import shlex
import tempfile
from collections.abc import Sequence
from pathlib import Path

from ..model import ir
from ..model.types import Array, Scalar, Type, scalar_of
from ..printers.nim.names import REFUSED, is_keyword
from ..printers.nim.operations.helpers import NIM_TYPES
from .backends import NIM
from .toolchain import ToolchainError, run_compiler

#: The header of all C that Nim makes.
BASE_HEADER = "nimbase.h"

_REFUSED = re.compile(rf"\b({'|'.join(sorted(REFUSED))}|import(?! std/volatile$))\b", re.MULTILINE)
_COMMENT_OR_TEXT = re.compile(r'""".*?"""|#[^\n]*|"(?:[^"\\\n]|\\.)*"|`[^`\n]*`', re.DOTALL)


def refuse_allocation(text: str, file: str) -> None:
    """Raises ToolchainError if a generated module has a word that allocates, raises or keeps a reference."""
    code = _COMMENT_OR_TEXT.sub(lambda found: re.sub(r"[^\n]", " ", found[0]), text)
    found = _REFUSED.search(code)
    if found:
        line = code.count("\n", 0, found.start()) + 1
        raise ToolchainError(f"{file}:{line}: `{found[0]}` has no place in control code; this is a fault of fcslc")


def compile_modules(modules: dict[str, str]) -> dict[str, str]:
    """C of Nim modules, by file name: <name>.nim.c for each <name>, and BASE_HEADER. `modules`: their texts by name.
    Raises ToolchainError."""
    for name, text in modules.items():
        if is_keyword(name):
            fix = "rename the file, or build with --backend c"
            raise ToolchainError(f"machine `{name}`: no module of Nim has this name, a keyword; {fix}")
        refuse_allocation(text, f"{name}.nim")
    with tempfile.TemporaryDirectory(prefix="fcsl-nim-") as scratch:
        folder = Path(scratch)
        for name, text in modules.items():
            (folder / f"{name}.nim").write_text(text, encoding="utf-8")
        return _c_of(folder, list(modules))


def compile_externs(sources: Sequence[Path], externs: Sequence[ir.Extern], folder: Path) -> list[Path]:
    """C of the files in Nim among the sources of a target, in `folder`, beside BASE_HEADER. `externs`: Nim compares
    their types with what the algorithms declare. Raises ToolchainError."""
    made = check_externs(sources, externs)
    if made:
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in made.items():
        # An extern is visible as the flags of its compilation say, like one in C.
        own = text if name == BASE_HEADER else text.replace("N_LIB_PRIVATE ", "")
        (folder / name).write_text(own, encoding="utf-8")
    return [folder / name for name in made if name != BASE_HEADER]


def check_externs(sources: Sequence[Path], externs: Sequence[ir.Extern]) -> dict[str, str]:
    """The same C in memory, by file name; nothing without a file in Nim. Raises ToolchainError."""
    files = {source.stem: source for source in sources if source.suffix == ".nim"}
    if not files:
        return {}
    checks = [_binding(n, e) for n, e in enumerate(externs) if e.language == "nim" and Path(e.header).stem in files]
    with tempfile.TemporaryDirectory(prefix="fcsl-nim-") as scratch:
        for source in files.values():
            (Path(scratch) / source.name).write_bytes(source.read_bytes())
        return _c_of(Path(scratch), list(files), "proc fcsl_externs() {.used.} =\n  discard\n" + "".join(checks))


def _binding(number: int, e: ir.Extern) -> str:
    """A line that compiles if the proc has the types of the extern."""
    arguments = [f"a{n}: {_nim_type(type_)}" for n, (_, type_) in enumerate(e.arguments)]
    returned = ""
    if isinstance(e.result, Scalar):
        returned = f": {_nim_type(e.result)}"
    elif e.result is not None:
        arguments.append(f"returned: {_nim_type(e.result)}")
    return f"  let extern{number}: proc ({', '.join(arguments)}){returned} {{.cdecl.}} = {e.name}\n"


def _nim_type(type_: Type) -> str:
    scalar = NIM_TYPES[scalar_of(type_).name]
    return f"ptr array[{type_.count}, {scalar}]" if isinstance(type_, Array) else scalar


def _c_of(folder: Path, names: Sequence[str], program: str = "") -> dict[str, str]:
    """C of the modules <name>.nim of a folder, by file name. `program`: what the module that imports them holds."""
    # What belongs to a program is in the C of this module, which nobody compiles.
    root = folder / "fcsl_program.nim"
    root.write_text("".join(f"import {name}\n" for name in names) + program)
    run_compiler([*NIM.compiler(), *NIM.flags, f"--nimcache:{folder / 'c'}", str(root)], language=NIM)
    made = {f"{name}.nim.c": (folder / "c" / f"@m{name}.nim.c").read_text(encoding="utf-8") for name in names}
    return {**made, BASE_HEADER: _base_header(folder / "c")}


def _base_header(folder: Path) -> str:
    """The header, from a folder that Nim would hand to the C compiler."""
    build = json.loads(next(folder.glob("*.json")).read_text(encoding="utf-8"))
    for word in (word for _, command in build["compile"] for word in shlex.split(command)):
        found = Path(word.removeprefix("-I"), BASE_HEADER)
        if word.startswith("-I") and found.is_file():
            return found.read_text(encoding="utf-8")
    raise ToolchainError(f"Nim has no {BASE_HEADER}; install all of its library")
