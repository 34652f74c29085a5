# SPDX-License-Identifier: Apache-2.0
"""Finds and compiles the machine config that a caller names."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .errors import TwinError
from .parameters import Given, Parameters, read_parameters


def find_config(path: str | Path, caller: str = "", what: str = "machine config") -> Path:
    """`path` relative to the working directory, else relative to the folder of the file `caller`.

    Raises TwinError, which says that there is no such `what`.
    """
    wanted = Path(path)
    tried = [wanted]
    if not wanted.is_absolute() and caller and not caller.startswith("<"):
        beside = Path(caller).resolve().parent / wanted
        tried += [beside] if beside.resolve() != wanted.resolve() else []
    for candidate in tried:
        if candidate.is_file():
            return candidate.resolve()
    for candidate in tried:
        if candidate.is_dir():
            raise TwinError(f"{candidate.absolute()}: a directory; name the {what.split()[0]}'s JSON file")
    raise TwinError(f"no such {what}: {' nor '.join(str(p.absolute()) for p in tried)}")


def find_parameters(given: Given | None, caller: str) -> Parameters | None:
    """Parameters that a caller gives; a path is found as that of a config is. Raises TwinError."""
    if isinstance(given, str | Path) and not Path(given).exists():
        given = find_config(given, caller, "parameter file")
    return read_parameters(given)


def check_backend(backend: str) -> None:
    """Raises TwinError if there is no such backend."""
    from fcsl_compiler.api.build import BACKENDS

    if backend not in BACKENDS:
        raise TwinError(f"backend={backend!r}: one of {', '.join(BACKENDS)} wanted")


def build_config(
    path: str | Path,
    target: str = "simulation",
    instances: Sequence[str] | None = None,
    backend: str = "c",
    requirements: str | Path | None = None,
) -> tuple[Path, str]:
    """Compiles a machine config (cached), or the subset machine of `instances`. `backend`: "c" or "nim". `requirements`: a
    file of those that take the place of the machine's own.

    Returns its library and the machine's name. Raises TwinError.
    """
    config = find_config(path)
    from fcsl_compiler.api.build import build_machine

    check_backend(backend)
    try:
        own = Path(requirements) if requirements is not None else None
        built = build_machine(config, target, instances, backend, own)
    except _refusals() as error:
        raise TwinError(str(error)) from None
    return built.library, built.name


def _refusals() -> tuple[type[Exception], ...]:
    """The compiler's errors. Their module is imported where one was raised, not for a machine of the cache."""
    from fcsl_compiler.api.build import ToolchainError
    from fcsl_compiler.api.diagnostics import DiagnosticError

    return DiagnosticError, ToolchainError
