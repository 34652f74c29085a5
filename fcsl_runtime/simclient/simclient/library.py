# SPDX-License-Identifier: Apache-2.0
"""Finds native libraries and declares the prototypes of their functions."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fcsl_compiler.api.packages import PackageNotFound, package_prefix

from .errors import TwinError

#: Maps a C function's name to its result (None: void) and its arguments, as ctypes types.
Prototypes = Mapping[str, tuple[Any, Sequence[Any]]]

RUNTIME_PACKAGE = "fcsl_runtime"
RUNTIME_LIBRARY = "libfcsl_run.so"


@functools.cache
def _library_of(prefix: Path) -> Path:
    library = prefix / "lib" / RUNTIME_LIBRARY
    if not library.is_file():
        raise TwinError(f"{library} is missing: package `{RUNTIME_PACKAGE}` is installed incompletely; build it again")
    return library


def runtime_library() -> Path:
    """`libfcsl_run.so` of the environment. Raises TwinError."""
    try:
        return _library_of(package_prefix(RUNTIME_PACKAGE))
    except PackageNotFound as error:
        raise TwinError(str(error)) from None


def runtime_program(name: str) -> Path:
    """A program of the environment's runtime. Raises TwinError."""
    try:
        program = package_prefix(RUNTIME_PACKAGE) / "bin" / name
    except PackageNotFound as error:
        raise TwinError(str(error)) from None
    if not program.is_file():
        raise TwinError(f"{program} is missing: package `{RUNTIME_PACKAGE}` is installed incompletely; build it again")
    return program


class _Library(ctypes.CDLL):
    """Has no function without a prototype: ctypes would cut pointers to 32 bits."""

    def __getattr__(self, name: str) -> Any:
        raise AttributeError(f"{name} has no prototype here")


def bind(path: Path, prototypes: Prototypes) -> ctypes.CDLL:
    """Loads a library with these functions, and no others. Raises OSError, or AttributeError for a missing function."""
    library = _Library(str(path))
    for name, (result, arguments) in prototypes.items():
        function = library[name]
        function.restype = result
        function.argtypes = arguments
        setattr(library, name, function)
    return library


def bind_runtime(path: Path, prototypes: Prototypes) -> ctypes.CDLL:
    """Loads the runtime at `path` with these prototypes. Raises TwinError."""
    try:
        return bind(path, prototypes)
    except (OSError, AttributeError) as error:
        raise TwinError(f"{path} cannot be used as the FCSL runtime: {error}") from None
