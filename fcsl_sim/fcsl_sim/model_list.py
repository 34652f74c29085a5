# SPDX-License-Identifier: Apache-2.0
"""The models that a simulation can use from a folder: those of installed packages, and the C and C++ files below it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.api.build import LANGUAGES
from fcsl_compiler.api.diagnostics import nearest
from fcsl_compiler.api.files import MAX_SOURCE_BYTES, SourceError, read_regular
from fcsl_compiler.api.json_files import SourcePathError, resolve_source
from fcsl_compiler.api.packages import Package, PackageNotFound, installed_packages

from .errors import SimError
from .models import ModelTable
from .plugins import LIBRARY, compile_model, model_library

#: Folders below a package's share folder in which it installs models as source.
_SHARED = ("models", "sim")
#: Larger libraries are not looked at.
_MAX_LIBRARY_BYTES = 1 << 28
#: A source that defines the symbol by which the simulator finds models, in C or by the macro of fcsl_model.hpp.
_DEFINES = re.compile(rb"\bfcsl_models\s*\[\s*\]\s*=|^\s*FCSL_MODEL_EXPORT\w*\s*\(", re.MULTILINE)
_SYMBOL = b"\0fcsl_models\0"
#: Folders that colcon, CMake, cargo and fcslc fill.
_BUILT = {"build", "install", "log", "target"}


@dataclass(frozen=True)
class Found:
    """A model: its name, its member in `models` of a simulation file, `{key: text}`, and the file that has it.

    key: source, or library.
    """

    name: str
    key: str
    text: str
    path: Path

    @property
    def definition(self) -> dict[str, str]:
        return {self.key: self.text}

    def table(self) -> ModelTable:
        """Its description; a source is compiled (cached). Raises SimError."""
        return model_library(self.text) if self.key == "library" else compile_model(self.path)


def find_models(folder: Path) -> list[Found]:
    """Models of installed packages, then those below `folder`. Raises SimError if there is no such folder, or if a
    package is installed incompletely."""
    if not folder.is_dir():
        raise SimError(f"{folder}: no such folder")
    return [*_installed(), *_below(folder)]


def find_model(text: str) -> Found:
    """The model that a path, package://… or a name of `find_models` names. Raises SimError."""
    if library := LIBRARY.fullmatch(text):
        return Found(library[2], "library", text, Path(model_library(text).library))
    if text.startswith("package://"):
        try:
            return _file(text, text, resolve_source(text, config=Path()))
        except SourcePathError as error:
            raise SimError(f"{text}: {error}") from None
    path = Path(text)
    if path.suffix or len(path.parts) > 1:
        # A simulation file names files beside it or below its folder.
        return _file(text, path.name if path.is_absolute() or ".." in path.parts else text, path)
    return _named(text)


def _file(given: str, text: str, path: Path) -> Found:
    if not path.is_file():
        raise SimError(f"{given}: no such file")
    return Found(path.stem, "source", text, path)


def _named(name: str) -> Found:
    found = find_models(Path())
    named = [model for model in found if model.name == name]
    if len({model.path.resolve() for model in named}) > 1:
        raise SimError(f"{name}: there are several: {', '.join(model.text for model in named)}; name one of these")
    if not named:
        hint = nearest(name, [model.name for model in found]) or "`fcsl models` lists all models"
        raise SimError(f"{name}: no such model; {hint}")
    return named[0]


def _installed() -> Iterator[Found]:
    try:
        for package in installed_packages():
            yield from _of_package(package)
    except PackageNotFound as error:
        raise SimError(str(error)) from None


def _of_package(package: Package) -> Iterator[Found]:
    for inside in _SHARED:
        for path in sorted((package.share / inside).glob("*")):
            if _is_source(path):
                yield Found(path.stem, "source", f"package://{package.name}/{inside}/{path.name}", path)
    for path in sorted((package.prefix / "lib" / package.name).glob("lib*.so")):
        if _contains(path, _SYMBOL, _MAX_LIBRARY_BYTES):
            name = path.stem.removeprefix("lib")
            yield Found(name, "library", f"package://{package.name}/{name}", path)


def _below(folder: Path) -> Iterator[Found]:
    for place, folders, files in os.walk(folder):
        wanted = [] if "pyvenv.cfg" in files else folders  # in a virtual environment lies what is installed
        folders[:] = sorted(f for f in wanted if not f.startswith(".") and f not in _BUILT)
        for path in (Path(place) / name for name in sorted(files)):
            if _is_source(path):
                yield Found(path.stem, "source", path.relative_to(folder).as_posix(), path)


def _is_source(path: Path) -> bool:
    """Whether a file defines models, by its text."""
    return path.suffix in LANGUAGES and _contains(path, _DEFINES, MAX_SOURCE_BYTES)


def _contains(path: Path, wanted: bytes | re.Pattern[bytes], limit: int) -> bool:
    try:
        data = read_regular(path, limit)
    except (OSError, SourceError):
        return False
    return wanted in data if isinstance(wanted, bytes) else wanted.search(data) is not None
