# SPDX-License-Identifier: Apache-2.0
"""Compiles machines to a static library for a processor, with the functions of fcsl_math that they call, and reports what they
need of it."""

from __future__ import annotations

import contextlib
import re
import tempfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from ..base.packages import package_share
from ..base.usage_error import UsageError
from ..driver.externs import explained
from ..driver.library import check_distinct, move, write_sources
from ..driver.monitors import compile_monitor
from ..driver.passes import Compilation, compile_machine
from ..driver.symbols import ALLOWED
from ..driver.toolchain import C, ToolchainError, compile_objects, include_dirs, toolchain_of
from ..model.choices import DEFAULT_TARGET
from .archive import archive
from .code import Code, Sizes
from .processors import Processor

#: Headers that the project's own code includes.
_HEADERS = ("fcsl_machine.h", "fcsl_monitor.h", "fcsl_hw.h", "fcsl_math.h")
_INCLUDE = re.compile(r'#include [<"]fcsl/(\w+\.h)[>"]')
#: As CMake compiles CORE-MATH.
_MATH_FLAGS = ("-std=gnu11", "-O2", "-w")
#: The functions of a compiler's run-time library, such as 64-bit division: those of ARM's ABI, and GCC's.
_OF_COMPILER = re.compile(r"__(aeabi_\w+|[a-z]+[sdt][if]([sdt][if])?[234]?)")
_FUSED = {"fma", "fmaf"}
_FUNCTIONS = ("init", "start", "step")


class MachineFacts(NamedTuple):
    """Of one machine: bytes of its struct (RAM), what its functions and their fcsl_math take, what its descriptor takes beside them,
    and the stack of init, start and step; None where it is not known."""

    name: str
    struct_bytes: int
    functions: Sizes
    descriptor: Sizes
    stack_bytes: dict[str, int | None]


class Firmware(NamedTuple):
    """A library for a processor. `needs`: the symbols that the project gives. `monitors`: what requirements take where the project
    uses `fcsl_monitors`."""

    library: Path
    compilations: list[Compilation]
    machines: list[MachineFacts]
    monitors: Sizes | None
    needs: list[str]


def build_firmware(
    configs: Sequence[Path],
    library: Path,
    processor: Processor,
    strict: bool = False,
    target: str = DEFAULT_TARGET,
    instances: Sequence[str] | None = None,
) -> Firmware:
    """Writes the library, the machines' C beside it, and in `fcsl/` the headers that a project includes. After an error the
    folder is unchanged. Raises DiagnosticError, ToolchainError, UsageError."""
    command = processor.compile_command
    found = toolchain_of(processor.command, C._replace(flags=processor.machine_flags))
    compilations = [
        compile_machine(path, found, "emit", strict, target, instances=instances, folds=False) for path in configs
    ]
    for c in compilations:
        compile_monitor(c)
        nim = [source.name for source in c.target.sources if source.suffix == ".nim"]
        if nim:
            raise UsageError(f"{c.path}: {nim[0]}: externs in Nim are for this computer only; with --processor write C")
    check_distinct(compilations)
    with _appearing(library.parent) as folder:
        made = write_sources(compilations, folder)
        made += _write_headers(folder / "fcsl")
        objects = _compile(compilations, [file for file in made if file.suffix == ".c"], folder, processor, command)
        code = Code([*objects.machines, *objects.math, *objects.externs])
        _check(code, compilations, library.name)
        (folder / library.name).write_bytes(_archived(code, [*objects.machines, *objects.math, *objects.externs]))
        facts = _facts(code, compilations, folder, command)
        roots = ["fcsl_machines", *(["fcsl_monitors"] if any(c.monitor for c in compilations) else [])]
        needs = sorted(code.missing(code.reached(roots)))
        machines = code.reached(["fcsl_machines"])
        monitors = code.sizes(code.reached(roots) - machines) if len(roots) > 1 else None
        library.parent.joinpath("fcsl").mkdir(exist_ok=True)
        for file in (*made, folder / library.name):
            move(file, library.parent / file.relative_to(folder))
    return Firmware(library, compilations, facts, monitors, needs)


@contextlib.contextmanager
def _appearing(output: Path) -> Iterator[Path]:
    """A temporary folder in `output`, which is created; after an error, no folder that it took is left."""
    absent = [path for path in (output, *output.parents) if not path.exists()]
    output.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryDirectory(dir=output, prefix=".emit-") as folder:
            yield Path(folder)
    except BaseException:
        for path in absent:
            with contextlib.suppress(OSError):
                path.rmdir()
        raise


def _write_headers(folder: Path) -> list[Path]:
    """With those that they include."""
    folder.mkdir()
    waiting, made = list(_HEADERS), []
    while waiting:
        file = folder / waiting.pop()
        if file not in made:
            text = (include_dirs()[0] / "fcsl" / file.name).read_text()
            file.write_text(text)
            made.append(file)
            waiting += _INCLUDE.findall(text)
    return made


class _Objects(NamedTuple):
    machines: list[Path]
    externs: list[Path]
    math: list[Path]


def _compile(
    compilations: Sequence[Compilation],
    sources: Sequence[Path],
    folder: Path,
    processor: Processor,
    command: Sequence[str],
) -> _Objects:
    targets = list(dict.fromkeys(c.target for c in compilations if not c.target.is_empty))
    names = sorted({e.name for c in compilations for e in c.checked.externs})
    with explained(names, targets):
        includes = [*(d for t in targets for d in t.include), folder, *include_dirs()]
        machines = compile_objects(sources, includes, folder / "machines", command)
        externs = [
            made
            for number, t in enumerate(targets)
            for made in compile_objects(
                t.sources, [*t.include, folder, *include_dirs()], folder / f"externs{number}", command
            )
        ]
    return _Objects(machines, externs, _compile_math([*machines, *externs], folder / "math", processor, command))


def _compile_math(objects: Sequence[Path], folder: Path, processor: Processor, command: Sequence[str]) -> list[Path]:
    """The functions of fcsl_math that are called: in CORE-MATH, none calls another."""
    root = package_share("fcsl_compiler") / "math"
    code = Code(objects)
    missing = code.missing(code.reached(name for n in range(len(objects)) for name in code.exported(n)))
    sources = []
    for name in sorted(missing):
        function = name.removeprefix("cr_")
        places = [root / f"binary64/{function}/{function}.c", root / f"binary32/{function[:-1]}/{function}.c"]
        sources += [place for place in places if name != function and place.is_file()][:1]
    if not sources:
        return []
    line = [*command, *_MATH_FLAGS, "-include", str(root / "no_stdio.h")]
    try:
        return compile_objects(sources, [], folder, line)
    except ToolchainError as error:
        if "__int128" not in str(error):
            raise
        raise ToolchainError(
            f"`{processor.command[0]}` has no 128-bit integers for this processor, which fcsl_math needs: use clang with "
            '-fforce-enable-int128, as --processor "clang-19 --target=armv8m.main-none-eabihf -mcpu=cortex-m33 '
            '-fforce-enable-int128 -fshort-enums"'
        ) from None


def _check(code: Code, compilations: Sequence[Compilation], library: str) -> None:
    """Raises ToolchainError if machines or fcsl_math call what they must not."""
    externs = {e.name for c in compilations for e in c.checked.externs}
    own = ["fcsl_machines", *(["fcsl_monitors"] if any(c.monitor for c in compilations) else [])]
    reached = code.reached(own, stop=externs)
    missing = {name for name in code.missing(reached) if name not in externs and not _OF_COMPILER.fullmatch(name)}
    fused = sorted(missing & _FUSED)
    if fused:
        raise ToolchainError(
            f"{library} would call {', '.join(fused)}: this processor has no instruction that multiplies and adds with one rounding, "
            "and the C libraries of microcontrollers round twice, so results would differ; use a processor with a "
            "double-precision FPU, or a machine without elementary functions"
        )
    wrong = sorted(missing - ALLOWED)
    if wrong:
        raise ToolchainError(
            f"{library} would call {', '.join(wrong)}; a step allocates nothing and calls only the math library"
            + (" and its externs" if externs else "")
        )


def _archived(code: Code, objects: Sequence[Path]) -> bytes:
    members = {f"{path.stem.partition('-')[2]}-{number}.o": path.read_bytes() for number, path in enumerate(objects)}
    return archive(members, {name: code.exported(number) for number, name in enumerate(members)})


def _facts(code: Code, compilations: Sequence[Compilation], folder: Path, command: Sequence[str]) -> list[MachineFacts]:
    names = [c.checked.name for c in compilations]
    source = folder / "sizes.c"
    lines = [
        f'#include "{name}.h"\nextern char fcsl_bytes_{name}[]; char fcsl_bytes_{name}[sizeof({name}_t)];'
        for name in names
    ]
    source.write_text("\n".join(lines) + "\n")
    sizes = Code(compile_objects([source], [folder, *include_dirs()], folder / "sizes", command))
    facts = []
    for name in names:
        descriptor = f"{name}_machine"
        functions = code.reached([f"fcsl_{what}_{name}" for what in (*_FUNCTIONS, "force_state")], descriptor)
        rest = code.reached([descriptor]) - functions
        stacks = {what: code.stack(f"fcsl_{what}_{name}", descriptor) for what in _FUNCTIONS}
        struct = sizes.size_of(f"fcsl_bytes_{name}")
        facts.append(MachineFacts(name, struct, code.sizes(functions), code.sizes(rest), stacks))
    return facts
