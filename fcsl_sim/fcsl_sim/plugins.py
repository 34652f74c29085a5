# SPDX-License-Identifier: Apache-2.0
"""Finds the library of a model: compiled on demand from C or C++, or built and installed by a package."""

from __future__ import annotations

import re
from pathlib import Path

from fcsl_compiler.api.build import LANGUAGES, SymbolError, ToolchainError, check_model_symbols
from fcsl_compiler.api.diagnostics import nearest
from fcsl_compiler.api.json_files import SourcePathError, resolve_source
from fcsl_compiler.api.packages import PackageNotFound, package_prefix

from .errors import SimError
from .model_build import build_model
from .models import ModelTable
from .native import describe_model

#: Include folders of a model: the model ABI, and the machine ABI that it includes.
INCLUDE_PACKAGES = ("fcsl_sim", "fcsl_compiler")
#: package://PACKAGE/NAME
LIBRARY = re.compile(r"package://([^/]+)/([a-z][a-z0-9_]*)")
_AS_LIBRARY = '{"library": "package://PACKAGE/NAME"}'


def compile_model(path: Path) -> ModelTable:
    """The model of a C or C++ file (cached). Raises SimError; the compiler's output follows on lines of its own."""
    if path.suffix not in LANGUAGES:
        raise SimError(_no_source(path.suffix))
    try:
        includes = [package_prefix(package) / "include" for package in INCLUDE_PACKAGES]
        return describe_model(build_model(path, includes), path.stem)
    except (PackageNotFound, ToolchainError) as error:
        raise SimError(str(error)) from None


def _no_source(suffix: str) -> str:
    if suffix == ".rs":
        return (
            "a model in Rust is a crate that its package builds: write `fcsl_add_model(NAME CRATE Cargo.toml)` in its "
            f"CMakeLists.txt, and here {_AS_LIBRARY}"
        )
    if suffix == ".nim":
        return (
            "a model in Nim is built by its package: write `fcsl_add_model(NAME SOURCES NAME.nim)` in its "
            f"CMakeLists.txt, and here {_AS_LIBRARY}"
        )
    if suffix in (".so", ".a", ".o"):
        return f"a built library is not a source: write {_AS_LIBRARY}"
    return f"a source is a file in C or C++ ({', '.join(LANGUAGES)}); a model that a package builds is {_AS_LIBRARY}"


def model_source(text: str, config: Path) -> ModelTable:
    """The model of the `source` that the file `config` names. Raises SimError."""
    try:
        path = resolve_source(text, config=config)
    except SourcePathError as error:
        raise SimError(str(error)) from None
    if path.suffix in LANGUAGES and not path.is_file():
        raise SimError(f"no such file: {path}")
    return compile_model(path)


def source_text(text: str, config: Path) -> str:
    """The text of a `source` that is a model."""
    return resolve_source(text, config=config).read_text(encoding="utf-8", errors="replace")


def model_library(text: str) -> ModelTable:
    """The model of a `library`, package://PACKAGE/NAME, which fcsl_add_model() of that package has installed. Raises
    SimError."""
    named = LIBRARY.fullmatch(text)
    if not named:
        raise SimError(
            "write package://PACKAGE/NAME, where the package's CMakeLists.txt has `fcsl_add_model(NAME …)`; a file in C "
            'or C++ is a {"source": …}'
        )
    package, name = named.groups()
    try:
        folder = package_prefix(package) / "lib" / package
    except PackageNotFound as error:
        raise SimError(str(error)) from None
    library = folder / f"lib{name}.so"
    if not library.is_file():
        hint = nearest(name, [path.stem.removeprefix("lib") for path in folder.glob("lib*.so")])
        fix = hint or f"write `fcsl_add_model({name} …)` in its CMakeLists.txt, and build it"
        raise SimError(f"package `{package}` has no such library ({library}); {fix}")
    try:
        check_model_symbols(library)
    except SymbolError as error:
        raise SimError(str(error)) from None
    return describe_model(library, name)
