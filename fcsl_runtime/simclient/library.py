# SPDX-License-Identifier: Apache-2.0
"""Finds the native runtime."""

from __future__ import annotations

import functools
from pathlib import Path

from fcsl_compiler.ament import PackageNotFound, package_prefix

from .errors import TwinError

RUNTIME_PACKAGE = "fcsl_runtime"
RUNTIME_LIBRARY = "libfcsl_run.so"


@functools.cache
def _library_of(prefix: Path) -> Path:
    library = prefix / "lib" / RUNTIME_LIBRARY
    if not library.is_file():
        raise TwinError(f"{library} is missing: package `{RUNTIME_PACKAGE}` is installed incompletely; build it again")
    return library


def runtime_library() -> Path:
    """`libfcsl_run.so` of the environment (AMENT_PREFIX_PATH). Raises TwinError."""
    try:
        return _library_of(package_prefix(RUNTIME_PACKAGE))
    except PackageNotFound as error:
        raise TwinError(str(error)) from None
