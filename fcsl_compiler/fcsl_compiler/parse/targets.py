# SPDX-License-Identifier: Apache-2.0
"""`targets` of a machine JSON: for each kind of computer, the C files and libraries that externs are linked from."""

from __future__ import annotations

import re
from pathlib import Path

from ..base.diagnostics import Diagnostic, DiagnosticError, Severity, nearest
from ..base.files import SourceError, read_regular
from ..base.source import SourceFile, Span
from ..model.target import Target
from .json_reader import ConfigReader
from .json_source import JsonNode
from .source_path import SourcePathError, resolve_source

_MAX_ARCHIVE_BYTES = 256 << 20
#: A library name for the linker (-l<name>).
_LIBRARY = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_+.-]*")


def read_targets(node: JsonNode | None, config: Path, reader: ConfigReader) -> dict[str, Target]:
    """Reads all targets. Returns the valid ones and reports errors in the others."""
    targets: dict[str, Target] = {}
    for name, (definition, _) in reader.named(node, "`targets`").items():
        keys = reader.object(definition, f"target `{name}`", (), ("sources", "include", "libraries"))
        if keys is not None:
            targets[name] = _TargetReader(config, reader).read(name, keys)
    return targets


def choose_target(targets: dict[str, Target], name: str, at: Span) -> Target:
    """The target to build. A machine without `targets` has the same empty one under every name. Raises
    DiagnosticError."""
    if not targets:
        return Target(name)
    if name not in targets:
        known = ", ".join(targets)
        fix = nearest(name, list(targets)) or f"add it, or build one of {known} (--target, TARGET in CMake)"
        text = f"the machine has no target `{name}`"
        raise DiagnosticError([Diagnostic(Severity.ERROR, "E233", text, at, f"its targets are {known}", fix)])
    return targets[name]


class _TargetReader:
    """Reads one target."""

    def __init__(self, config: Path, reader: ConfigReader):
        self._config, self._reader = config, reader
        self._archive_contents: dict[str, bytes] = {}

    def read(self, name: str, keys: dict[str, JsonNode]) -> Target:
        sources = [p for n, t, p in self._paths(keys.get("sources"), "sources") if self._source(n, t, p)]
        include = [p for n, t, p in self._paths(keys.get("include"), "include") if self._folder(n, t, p)]
        libraries, archives = self._libraries(keys.get("libraries"))
        contents = tuple(sorted(self._archive_contents.items()))
        return Target(name, tuple(sources), tuple(include), tuple(libraries), tuple(archives), contents)

    def _error(self, node: JsonNode, text: str, fix: str = "", why: str = "") -> None:
        self._reader.sink.error("E233", text, node.span, why=why, help=fix)

    def _texts(self, node: JsonNode | None, key: str) -> list[tuple[JsonNode, str]]:
        out: list[tuple[JsonNode, str]] = []
        for item in self._reader.list(node, f"`{key}`"):
            text = self._reader.string(item, f"an entry of `{key}`")
            if text is None:
                continue
            if any(text == seen for _, seen in out):
                self._error(item, f"`{text}` is listed twice", "remove one")
            else:
                out.append((item, text))
        return out

    def _paths(self, node: JsonNode | None, key: str) -> list[tuple[JsonNode, str, Path]]:
        found = [(item, text, self._resolve(item, text)) for item, text in self._texts(node, key)]
        return [(item, text, path) for item, text, path in found if path is not None]

    def _resolve(self, node: JsonNode, text: str) -> Path | None:
        if not text:
            self._error(node, "an empty path", "the machine's own folder is `.`")
            return None
        try:
            return resolve_source(text, config=self._config)
        except SourcePathError as error:
            self._error(node, f"`{text}` cannot be used", why=str(error))
            return None

    def _source(self, node: JsonNode, text: str, path: Path) -> bool:
        if not text.endswith((".c", ".nim")):
            fix = "externs are written in C or Nim; the file's name ends in .c or .nim"
            self._error(node, f"`{text}` is not a file in C or Nim", fix)
            return False
        try:
            SourceFile.read(path, text)
        except SourceError as error:
            self._error(node, f"cannot read `{text}`: {error}", self._relative if str(error) == "no such file" else "")
            return False
        return True

    @property
    def _relative(self) -> str:
        return f"paths are relative to {self._config.parent}"

    def _folder(self, node: JsonNode, text: str, path: Path) -> bool:
        if not path.is_dir():
            self._error(
                node, f"`{text}` is not a folder" if path.exists() else f"no such folder: `{text}`", self._relative
            )
            return False
        return True

    def _libraries(self, node: JsonNode | None) -> tuple[list[str], list[Path]]:
        names, archives = [], []
        for item, text in self._texts(node, "libraries"):
            if text.endswith(".a"):
                path = self._resolve(item, text)
                if path is not None and self._archive(item, text, path):
                    archives.append(path)
            elif _LIBRARY.fullmatch(text):
                names.append(text)
            else:
                fix = "a name such as `gpiod` (for -lgpiod), or a file of this folder that ends in .a"
                self._error(item, f"`{text}` cannot be a library", fix)
        return names, archives

    def _archive(self, node: JsonNode, text: str, path: Path) -> bool:
        try:
            self._archive_contents[text] = read_regular(path, _MAX_ARCHIVE_BYTES)
        except (OSError, SourceError) as error:
            reason = "no such file" if isinstance(error, FileNotFoundError) else str(error)
            self._error(node, f"cannot read `{text}`: {reason}", self._relative if reason == "no such file" else "")
            return False
        return True
