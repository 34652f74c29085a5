# SPDX-License-Identifier: Apache-2.0
"""Cache of built libraries. The key is a hash of all inputs of a build.

A cached machine loads in milliseconds, because the compiler is imported only if it is needed.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.files import digest, write_whole
from ..coverage.settings import BUILD_NOTE, COVER_DIR
from ..model.target import DEFAULT_TARGET
from ..parse.machine_files import parse_machine
from .cache_lock import building
from .toolchain import ToolchainError, cache_dir, include_dirs, link_shared, math_library, toolchain, unwritten


@dataclass(frozen=True)
class BuiltMachine:
    """A compiled machine: its library, its name within the library, and its source hash (hex)."""

    library: Path
    name: str
    source_hash: str


def build_machine(config: Path, target: str = DEFAULT_TARGET, instances: Sequence[str] | None = None) -> BuiltMachine:
    """The library of one machine. It is taken from the cache if config, sources, target, compiler and flags are
    unchanged.

    `instances`: instances of a subset machine. If COVER_DIR is set, the result is a build for coverage. Raises
    DiagnosticError (str() is the rendered text) and ToolchainError.
    """
    try:
        return _build_machine(config, target, instances)
    except OSError as error:
        raise unwritten(error, config) from None


def _build_machine(config: Path, target: str, instances: Sequence[str] | None) -> BuiltMachine:
    cover = bool(os.environ.get(COVER_DIR))
    key = _cache_key(config, target, cover, instances)
    if key is None:
        from .passes import compile_machine

        compile_machine(config, toolchain(), target=target)
        raise AssertionError("a machine without a readable source cannot have compiled")
    folder = cache_dir() / "machines" / key
    found = _cached(folder, config.stem)
    if found is not None:
        return found
    with building(folder):
        return _cached(folder, config.stem) or _build_into(folder, config, target, cover, instances)


def _build_into(folder: Path, config: Path, target: str, cover: bool, instances: Sequence[str] | None) -> BuiltMachine:
    from ..emit.descriptor import source_hash
    from .library import build_library

    library = folder / f"lib{config.stem}.so"
    machine = build_library([config], library, target=target, cover=cover, instances=instances)[0].checked
    built = BuiltMachine(library, machine.name, source_hash(machine))
    facts = {"name": built.name, "source_hash": built.source_hash, "bytes": library.stat().st_size}
    write_whole(folder / "built.json", json.dumps(facts))
    return built


def _cached(folder: Path, stem: str) -> BuiltMachine | None:
    """The cached build in a folder. None if a file is missing or truncated (for example after a system crash)."""
    library = folder / f"lib{stem}.so"
    try:
        facts = json.loads((folder / "built.json").read_text())
        whole = library.stat().st_size == facts["bytes"]
        return BuiltMachine(library, facts["name"], facts["source_hash"]) if whole else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def _cache_key(config: Path, target: str, cover: bool, instances: Sequence[str] | None) -> str | None:
    """Hash of all inputs of the library, computed without compiling. None if a source cannot be read."""
    parsed = parse_machine(config, DiagnosticSink(), trees=False)
    if parsed is None or (target not in parsed.targets and "targets" in parsed.keys):
        return None
    linked = parsed.targets[target].digest_parts if target in parsed.targets else ()
    # A build for coverage contains the full paths of its files.
    name = f"{BUILD_NOTE} {config.resolve()}" if cover else config.name
    parts: list[str | bytes] = [*linked, name, parsed.package, parsed.source.text, toolchain(), _identity()]
    if any(algorithm.file is None for algorithm in parsed.algorithms.values()):
        return None
    for file in parsed.files:
        parts += [file.source.name, file.source.text]
    return digest(*parts, *(() if instances is None else ("subset", *sorted(instances))))


@cache
def _identity() -> str:
    """Hash of the compiler itself, the headers of generated C and the math library."""
    package = Path(__file__).parents[1]
    files = sorted(package.rglob("*.py"))
    headers = [include_dirs()[0] / "fcsl" / name for name in ("fcsl_machine.h", "fcsl_hw.h", "fcsl_cover.h")]
    try:
        return digest(*(f.read_bytes() for f in (*files, *headers)), str(math_library().stat().st_mtime_ns))
    except OSError as error:
        raise ToolchainError(f"fcsl_compiler is not installed completely: {error}") from None


def build_shared(sources: Sequence[Path], include: Sequence[Path]) -> Path:
    """Builds or finds a cached shared library of C sources (simulation models). Raises ToolchainError."""
    texts = [s.read_bytes() for s in sources]
    headers = [h.read_bytes() for d in [*include, *include_dirs()] for h in sorted((d / "fcsl").glob("*.h"))]
    key = digest(toolchain(), *(s.name for s in sources), *texts, *headers)
    library = cache_dir() / "shared" / key / f"lib{sources[0].stem}.so"
    try:
        if not library.is_file():
            with building(library.parent):
                if not library.is_file():
                    link_shared(list(sources), [*include, *include_dirs()], library)
    except OSError as error:
        raise unwritten(error, library) from None
    return library
