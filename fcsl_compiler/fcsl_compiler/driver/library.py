# SPDX-License-Identifier: Apache-2.0
"""Compiles machines to C files and to a shared library."""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError, Severity
from ..base.files import write_whole
from ..model.choices import DEFAULT_BACKEND, DEFAULT_TARGET
from .backends import toolchain_of_backend
from .externs import explained, link_inputs
from .monitors import compile_monitor
from .nim import check_externs, compile_modules
from .passes import Compilation, compile_machine
from .registry import registry
from .stack import stack_bound, stepped_machines
from .symbols import SymbolError, check_symbols
from .toolchain import ToolchainError, compile_objects, include_dirs, link_shared, math_library, start_call_graph_query


def emit(
    configs: Sequence[Path],
    folder: Path,
    strict: bool = False,
    target: str = DEFAULT_TARGET,
    instances: Sequence[str] | None = None,
    backend: str = DEFAULT_BACKEND,
    times: bool = False,
) -> list[Compilation]:
    """Writes <stem>.c, .h and .map.json of every machine and monitor, the algorithms of requirements that act, and
    fcsl_machines.c, into `folder`. With backend "nim" the C
    is <stem>.nim.c, which Nim makes of <stem>.nim.

    `instances`: instances of a subset machine. `times`: the host measures each instance. Writes nothing if a machine does
    not compile. Raises DiagnosticError, ToolchainError.
    """
    compilations = compile_all(configs, strict, target, instances=instances, backend=backend, times=times)
    for c in compilations:
        with explained(sorted(e.name for e in c.checked.externs), [c.target]):
            check_externs(c.target.sources, c.checked.externs)  # whoever compiles the C does not compare their types
    write_sources(compilations, folder)
    return compilations


def compile_all(
    configs: Sequence[Path],
    strict: bool = False,
    target: str = DEFAULT_TARGET,
    cover: bool = False,
    instances: Sequence[str] | None = None,
    backend: str = DEFAULT_BACKEND,
    requirements: Path | None = None,
    times: bool = False,
) -> list[Compilation]:
    """Compiles machines to source in memory and checks that they can share a library. Raises DiagnosticError,
    ToolchainError."""
    found = toolchain_of_backend(backend)
    compilations = [
        compile_machine(path, found, "emit", strict, target, cover, instances, backend, requirements, times)
        for path in configs
    ]
    for c in compilations:
        compile_monitor(c)
    check_distinct(compilations)
    return compilations


def write_sources(compilations: list[Compilation], folder: Path) -> list[Path]:
    """Writes all that `emit` lists, and returns the files."""
    texts: dict[str, str] = {}
    everything = [*compilations, *(c.monitor_code for c in compilations if c.monitor_code is not None)]
    for c in everything:
        name = c.checked.name
        texts |= {f"{name}.h": c.header, c.source_name: c.source, f"{name}.map.json": c.map}
        texts |= {source.name: source.text for source in c.checked.made_sources}
    modules = {c.checked.name: c.source for c in everything if c.backend == "nim"}
    texts |= compile_modules(modules) if modules else {}
    watching = {c.checked.name: c.monitor for c in compilations if c.monitor is not None}
    texts["fcsl_machines.c"] = registry([c.checked.name for c in compilations], watching)
    for file, text in texts.items():
        write_whole(folder / file, text)
    for c in compilations:
        for suffix in ("c", "h", "map.json", "nim", "nim.c"):  # the monitor of requirements that it no longer has
            old = f"{c.checked.name}_requirements.{suffix}"
            if c.monitor is None and old not in texts:
                (folder / old).unlink(missing_ok=True)
    return [folder / file for file in texts]


def check_distinct(compilations: list[Compilation]) -> None:
    """Checks that machines can share a library. Raises DiagnosticError."""
    seen: dict[str, Compilation] = {}
    for c in [*compilations, *(c.monitor_code for c in compilations if c.monitor_code is not None)]:
        name = c.checked.name
        if name in seen:
            message = f"two machines named `{name}` in one library"
            text = "a machine is found by its file stem"
            span = c.checked.config.whole()
            raise DiagnosticError([Diagnostic(Severity.ERROR, "E230", message, span, text, "rename one file")])
        seen[name] = c
    exported: dict[str, str] = {}
    for name, c in seen.items():
        for instance in c.checked.instances:
            symbol = f"{name}_{instance.identifier}"
            if exported.setdefault(symbol, name) != name:
                message = f"machines `{exported[symbol]}` and `{name}` would both define `{symbol}_execute`"
                help_text = "rename the instance, or build two libraries"
                raise DiagnosticError([Diagnostic(Severity.ERROR, "E230", message, instance.span, "", help_text)])


#: Called for each built machine with its object file (temporary) and the folders of its headers.
Inspect = Callable[[Compilation, Path, Sequence[Path]], None]


def build_library(
    configs: Sequence[Path],
    output: Path,
    strict: bool = False,
    target: str = DEFAULT_TARGET,
    cover: bool = False,
    inspect: Inspect = lambda *_: None,
    instances: Sequence[str] | None = None,
    backend: str = DEFAULT_BACKEND,
    requirements: Path | None = None,
    times: bool = False,
) -> list[Compilation]:
    """Compiles machines to one shared library and writes the C files beside it. Raises DiagnosticError, ToolchainError.

    `cover`: adds execution counters for `fcsl cover` (fcsl_cover.h). `instances`: instances of a subset machine.
    `requirements`: a file of those that take the place of the machines' own. `times`: the host measures each instance
    (fcsl_host_t.measure).

    Sets `extern_calls` of every compilation, and `stack_bound` if the C compiler reports frame sizes. Then calls
    `inspect` for each.
    """
    start_call_graph_query()
    compilations = compile_all(configs, strict, target, cover, instances, backend, requirements, times)
    absent = [p for p in (output.parent, *output.parent.parents) if not p.exists()]

    output.parent.mkdir(parents=True, exist_ok=True)
    try:
        # Library and C files appear together. After an error the folder is unchanged.
        with tempfile.TemporaryDirectory(dir=output.parent, prefix=".emit-") as scratch:
            folder = Path(scratch)
            written = write_sources(compilations, folder)
            _compile(compilations, [file for file in written if file.suffix == ".c"], folder / output.name, inspect)
            for file in (*written, folder / output.name):
                move(file, output.parent / file.name)
    except BaseException:
        for folder in absent:
            with contextlib.suppress(OSError):
                folder.rmdir()
        raise
    return compilations


def _compile(compilations: list[Compilation], sources: list[Path], output: Path, inspect: Inspect) -> None:
    """Compiles and links written machines and their externs, then inspects the result."""
    folder = output.parent
    externs = sorted({e.name for c in compilations for e in c.checked.externs})
    targets = list(dict.fromkeys(c.target for c in compilations if not c.target.is_empty))
    # The headers of externs come first: one may be called like a machine.
    includes = [*(d for t in targets for d in t.include), folder, *include_dirs()]
    with explained(externs, targets):
        objects = compile_objects(sources, includes, folder / "objects")
        declared = [e for c in compilations for e in c.checked.externs]
        foreign = link_inputs(targets, folder / "externs", folder, declared)

        def inspect_build(library: Path) -> None:
            calls = tuple(check_machine(library, objects if externs else (), externs))
            bounds = stack_bounds(folder / "objects", externs)
            for c in compilations:
                c.stack_bound, c.extern_calls = bounds.get(c.checked.name), calls

        # With coverage, the host maps the counters. Threads may still use them after the host closes the library.
        stays = ["-Wl,-z,nodelete"] if any(c.cover for c in compilations) else []
        link_shared([*objects, *foreign.files], [], output, inspect_build, [*foreign.flags, *stays])
    made = {source.name: compiled for source, compiled in zip(sources, objects, strict=True)}
    for c in compilations:
        inspect(c, made[c.c_name], includes)


def stack_bounds(folder: Path, externs: Sequence[str] = ()) -> dict[str, int]:
    """Stack of every machine's step in bytes, without externs, from the call graphs that the C compiler wrote below
    `folder`.

    Omits a machine whose call graph gives no bound. Empty if the compiler writes no call graphs.
    """
    own = sorted(folder.rglob("*.ci"))
    math_graph = math_library().parent / "fcsl_math.ci"
    if not own or not math_graph.is_file():
        return {}
    bounds = {name: stack_bound(name, [*own, math_graph], externs) for name in stepped_machines(own)}
    return {name: bound for name, bound in bounds.items() if bound is not None}


def move(made: Path, target: Path) -> None:
    """Leaves equal files untouched, so that make and ninja do not rebuild."""
    if not (target.is_file() and target.read_bytes() == made.read_bytes()):
        made.replace(target)


def check_machine(library: Path, objects: Sequence[Path] = (), externs: Sequence[str] = ()) -> list[str]:
    """Checks the symbols of a build. Raises ToolchainError if machines call functions that a step must not call. See
    check_symbols."""
    try:
        return check_symbols(library, objects, externs)
    except SymbolError as error:
        raise ToolchainError(str(error)) from None
