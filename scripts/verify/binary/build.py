# SPDX-License-Identifier: Apache-2.0
"""A machine's library as `fcsl build` makes it, and beside it the same code with line numbers and gcc's call graphs."""

from __future__ import annotations

import contextlib
import os
import re
import shlex
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.externs import link_inputs
from fcsl_compiler.driver.library import build_library, stack_bounds
from fcsl_compiler.driver.passes import Compilation
from fcsl_compiler.driver.toolchain import compile_objects, compiler, include_dirs, link_shared, math_library
from fcsl_compiler.model.choices import DEFAULT_BACKEND
from fcsl_compiler.model.target import Target

from ..shared.cases import CheckFailed
from .elf import Elf

#: Where a library's instructions are.
_CODE = (".init", ".plt", ".plt.got", ".plt.sec", ".text", ".fini")


@dataclass(frozen=True)
class Binary:
    """`library` is what is checked; `lined` is the same code with line numbers. `bound`: bytes, what the build prints."""

    machine: str
    library: Path
    lined: Path
    graphs: tuple[Path, ...]
    externs: tuple[str, ...]
    bound: int | None


def build(config: Path, folder: Path, backend: str = DEFAULT_BACKEND) -> Binary:
    """Builds the machine twice. Raises DiagnosticError, ToolchainError, and CheckFailed should the two differ in code."""
    library = folder / "library.so"
    made = build_library([config], library, backend=backend)[0]
    binary = compile_lined(made, folder, folder / "lined")
    both = (Elf(library), Elf(binary.lined))
    for section in _CODE:
        one, other = (elf.contents(section) if section in elf.sections else b"" for elf in both)
        if one != other:
            raise CheckFailed(
                f"{made.checked.name}: line numbers changed {section}, so they say nothing about the library"
            )
    if binary.bound is None:
        raise CheckFailed(f"{made.checked.name}: the build tells no stack bound of its step")
    if binary.bound != made.stack_bound:
        raise CheckFailed(f"{made.checked.name}: two builds, two bounds: {binary.bound} and {made.stack_bound}")
    return Binary(binary.machine, library, binary.lined, binary.graphs, binary.externs, binary.bound)


def compile_lined(made: Compilation, folder: Path, output: Path, more: Target | None = None) -> Binary:
    """The C files of a machine in `folder` as they stand there, and its externs, with line numbers; unchecked.

    `more`: further externs than the machine's own. Raises ToolchainError.
    """
    name = made.checked.name
    externs = sorted({e.name for e in made.checked.externs})
    targets = [t for t in (made.target, more) if t is not None and not t.is_empty]
    includes = [folder, *include_dirs(), *(d for t in targets for d in t.include)]
    library = output / "library.so"
    with _line_numbers():
        sources = [*(folder / name for name in made.c_names), folder / "fcsl_machines.c"]
        objects = compile_objects(sources, includes, output / "objects")
        foreign = link_inputs(targets, output / "externs", folder)
        link_shared([*objects, *foreign.files], [], library, flags=foreign.flags)
    externs += [more.name] if more is not None else []
    graphs = (*sorted((output / "objects").glob("*.ci")), math_library().parent / "fcsl_math.ci")
    bound = stack_bounds(output / "objects", externs).get(name)
    return Binary(name, library, library, graphs, tuple(externs), bound)


@contextlib.contextmanager
def _line_numbers() -> Iterator[None]:
    """The same compiler, told to write where instructions come from; gcc promises that it changes no code."""
    before = os.environ.get("CC")
    os.environ["CC"] = shlex.join([*compiler(), "-g"])
    try:
        yield
    finally:
        if before is None:
            del os.environ["CC"]
        else:
            os.environ["CC"] = before


def sources_of(lines: Sequence[str]) -> list[str]:
    """The source lines that "file:line" or "file:line:column" mean; "" where there is none."""
    found = []
    for line in lines:
        m = re.match(r"(.*?):(\d+)", line)
        try:
            found.append(Path(m[1]).read_text().splitlines()[int(m[2]) - 1].strip() if m else "")
        except (OSError, IndexError):
            found.append("")
    return found
