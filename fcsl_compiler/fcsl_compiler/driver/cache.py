# SPDX-License-Identifier: Apache-2.0
"""Cache of built libraries. The key is a hash of all inputs of a build.

A cached machine loads in milliseconds, because the compiler is imported only if it is needed.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import NamedTuple

from ..base.files import MAX_SOURCE_BYTES, SourceError, digest, read_regular
from ..coverage.settings import BUILD_NOTE, COVER_DIR
from ..model.choices import DEFAULT_BACKEND, DEFAULT_TARGET, TIMES
from ..parse.machine_texts import MachineTexts, message_types, package_of, read_texts
from .backends import toolchain_of_backend
from .cache_entry import cached
from .toolchain import (
    LANGUAGES,
    C,
    ToolchainError,
    include_dirs,
    link_shared,
    math_library,
    start_version_query,
    toolchain,
    unwritten,
)

#: The files that decide how build_shared() makes a library.
SHARED_RULES = tuple(
    Path(__file__).with_name(f"{name}.py") for name in ("cache", "c_dependencies", "symbols", "toolchain")
)


class BuiltMachine(NamedTuple):
    """A compiled machine: its library, its name within the library, and its source hash (hex)."""

    library: Path
    name: str
    source_hash: str


def build_machine(
    config: Path,
    target: str = DEFAULT_TARGET,
    instances: Sequence[str] | None = None,
    backend: str = DEFAULT_BACKEND,
    requirements: Path | None = None,
) -> BuiltMachine:
    """The library of one machine. It is taken from the cache if config, sources, target, compiler and flags are
    unchanged.

    `instances`: instances of a subset machine. `requirements`: a file of those that take the place of the machine's own. If
    COVER_DIR is set, the result is a build for coverage, by the C backend; else, if TIMES is, the host measures each instance.
    Raises DiagnosticError (str() is the rendered text) and ToolchainError.
    """
    try:
        return _build_machine(config, target, instances, backend, requirements)
    except OSError as error:
        raise unwritten(error, config) from None


def _build_machine(
    config: Path, target: str, instances: Sequence[str] | None, backend: str, requirements: Path | None
) -> BuiltMachine:
    cover = bool(os.environ.get(COVER_DIR))
    times = bool(os.environ.get(TIMES)) and not cover
    if cover:
        backend = DEFAULT_BACKEND

    def key() -> str:
        found = _cache_key(config, target, cover, times, instances, backend, requirements)
        if found is None:
            from .passes import compile_machine

            compile_machine(config, toolchain(), target=target, requirements=requirements)
            raise AssertionError("a machine without a readable source cannot have compiled")
        return found

    def build(library: Path) -> dict[str, str]:
        from ..emit.field_table import source_hash
        from .library import build_library

        (built,) = build_library(
            [config],
            library,
            False,
            target,
            cover,
            instances=instances,
            backend=backend,
            requirements=requirements,
            times=times,
        )
        machine = built.checked
        return {"name": machine.name, "source_hash": source_hash(machine)}

    built = cached("machines", key, f"lib{config.stem}.so", build, config)
    return BuiltMachine(built.library, built.facts["name"], built.facts["source_hash"])


def _cache_key(
    config: Path,
    target: str,
    cover: bool,
    times: bool,
    instances: Sequence[str] | None,
    backend: str,
    requirements: Path | None,
) -> str | None:
    """Hash of all inputs of the library, computed without compiling. None if a source cannot be read."""
    start_version_query()
    texts = read_texts(config)
    externs = _extern_parts(config, target, texts) if texts is not None else None
    messages = _message_parts(config, texts) if texts is not None else None
    if texts is None or externs is None or messages is None:
        return None
    # A build for coverage contains the full paths of its files, one with a mesh that of the mesh.
    name = f"{BUILD_NOTE} {config.resolve()}" if cover else str(config.resolve()) if texts.has_mesh else config.name
    parts = [name, package_of(config, config.stem), texts.text, _identity(), toolchain_of_backend(backend), *externs]
    parts += [TIMES] if times else []
    parts += messages
    for file in texts.files.items():
        parts += file
    if requirements is not None:
        try:
            parts += ["requirements", str(requirements), read_regular(requirements, MAX_SOURCE_BYTES)]
        except (OSError, SourceError):
            return None
    return digest(*parts, *(() if instances is None else ("subset", *sorted(instances))))


def _message_parts(config: Path, texts: MachineTexts) -> list[str] | None:
    """The definitions of the messages of channels that are not standard. None where one cannot be had."""
    if '"ros"' not in texts.text:
        return []
    from ..ros.interfaces import InterfaceError, find_interfaces

    parts: list[str] = []
    for type_ in message_types(texts.keys):
        try:
            found = find_interfaces(type_, config).texts
        except InterfaceError:
            return None
        parts += [part for name in sorted(found) for part in (name, *found[name])]
    return parts


def _extern_parts(config: Path, target: str, texts: MachineTexts) -> list[str | bytes] | None:
    """What the externs of a target are compiled from. None if the machine has targets, and not a valid one of this name."""
    if "targets" not in texts.keys:
        return []
    from ..base.diagnostics import DiagnosticSink
    from ..parse.machine_files import parse_machine
    from .c_dependencies import extern_inputs

    parsed = parse_machine(config, DiagnosticSink())
    if parsed is None or target not in parsed.targets:
        return None
    linked = parsed.targets[target]
    c_files = extern_inputs(parsed, linked)
    return [*linked.digest_parts, *c_files.digest_parts, c_files.probed]


@cache
def _identity() -> str:
    """Names, sizes and times of change of the compiler's files, of the headers of generated C and of the math
    library."""
    # As Python itself notices that a module is newer than its .pyc. Contents took 6 to 13 ms where this takes 4.
    package = str(Path(__file__).parents[1])  # from here on without pathlib, which is slow
    files = sorted(_python_files(package))
    headers = ("machine", "monitor", "hw", "event", "cover")
    files += [f"{include_dirs()[0]}/fcsl/fcsl_{name}.h" for name in headers]
    try:
        return "\n".join(_stamp(file, package) for file in (*files, str(math_library())))
    except OSError as error:
        raise ToolchainError(f"fcsl_compiler is not installed completely: {error}") from None


def _python_files(folder: str) -> Iterator[str]:
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.endswith(".py"):
                yield entry.path
            elif entry.name != "__pycache__" and entry.is_dir(follow_symlinks=False):
                yield from _python_files(entry.path)


def _stamp(path: str, package: str = "") -> str:
    """Of a file. Its path within the package is the same if it is installed as a link."""
    found = os.stat(path)
    return f"{path.removeprefix(package)} {found.st_size} {found.st_mtime_ns}"


def build_shared(sources: Sequence[Path], include: Sequence[Path], exports: Sequence[str] = ()) -> Path:
    """Builds or finds a cached shared library of C or C++ sources (simulation models); the suffix of the first one says
    which.

    exports: if there are any, the library has no other symbols. Raises ToolchainError, also if the sources call what a
    model must not call.
    """
    from .c_dependencies import c_inputs

    includes = [*include, *include_dirs()]
    language = LANGUAGES.get(sources[0].suffix, C)

    def key() -> str:
        read = c_inputs(sources, includes, sources[0].parent)
        rules = Path(__file__).with_name("symbols.py").read_bytes()
        stamp = _stamp(str(math_library()))
        return digest(toolchain(language), *language.checks, stamp, rules, *exports, *read.digest_parts, read.probed)

    def build(library: Path) -> dict[str, str]:
        link_shared(list(sources), includes, library, _check_model, language.checks, language=language, exports=exports)
        return {}

    try:
        return cached("shared", key, f"lib{sources[0].stem}.so", build, sources[0]).library
    except OSError as error:
        raise unwritten(error, sources[0]) from None


def _check_model(library: Path) -> None:
    from .symbols import SymbolError, check_model_symbols

    try:
        check_model_symbols(library)
    except SymbolError as error:
        raise ToolchainError(str(error)) from None
