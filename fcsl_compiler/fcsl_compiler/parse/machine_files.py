# SPDX-License-Identifier: Apache-2.0
"""Reads a machine JSON and its algorithm files: texts and syntax trees. Nothing is checked or executed here."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass, field
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.files import SourceError
from ..base.source import MAX_NAME, SourceFile, Span
from ..model.target import Target
from ..model.types import MAX_ELEMENTS
from .constants import Constants, read_constants
from .json_reader import ConfigReader
from .json_source import JsonNode, parse_json, text_without
from .machine_texts import package_of
from .parts import Joined
from .python_source import is_ignored_module, parse_python, span_of
from .source_path import SourcePathError, missing_file_help, resolve_source
from .targets import read_targets

_STEM = re.compile(r"[a-z](_?[a-z0-9])*")
#: Reserved machine names: their header or type `<name>_t` would conflict with a C library or with files and types of
#: this compiler.
_TAKEN = re.compile(
    r"fcsl(_.*)?|u?int(_?(least|fast))?(8|16|32|64|ptr|max)|size|ssize|time|clock|ptrdiff|wchar|wint|max_align|float|double|div|ldiv|"
    r"lldiv|fpos|locale|math|string|strings|stdint|stddef|stdbool|stdlib|stdio|limits|errno|features|assert|ctype|fenv|setjmp|"
    r"signal|stdarg|complex|tgmath|iso646|inttypes|endian|alloca|memory"
)

#: Maximum length of a chain of imports. They are read recursively.
MAX_IMPORTS = 32

_REQUIRED = ("tick_hz", "initial_state", "algorithms", "instances", "states")
_OPTIONAL = (
    *(
        "$schema",
        "description",
        "structs",
        "constants",
        "connections",
        "always",
        "transitions",
        "requests",
        "ports",
        "publish",
        "channels",
        "bus",
        "arm",
        "command_timeout_s",
        "start_grace_s",
        "nan",
        "targets",
        "requirements",
        "views",
    ),
)


@dataclass(frozen=True)
class ParsedFile:
    """One algorithm file. `tree` is None if it is not valid Python (reported)."""

    source: SourceFile
    tree: ast.Module | None
    #: Imported files of the same folder by module name, None if unreadable. Cycles are possible here; check/modules.py
    #: reports them.
    imports: dict[str, ParsedFile | None] = field(default_factory=dict, repr=False, compare=False)

    @property
    def all(self) -> list[ParsedFile]:
        """This file and all files it imports directly or indirectly, each once."""
        found: dict[str, ParsedFile] = {}

        def visit(file: ParsedFile) -> None:
            if file.source.name not in found:
                found[file.source.name] = file
                for other in file.imports.values():
                    if other is not None:
                        visit(other)

        visit(self)
        return list(found.values())


@dataclass(frozen=True)
class ParsedAlgorithm:
    """An entry of `algorithms`. `file` is None if it could not be read (reported)."""

    name: str
    class_name: str
    span: Span
    class_span: Span  # span of the class name in the JSON
    file: ParsedFile | None
    sizes: dict[str, tuple[int, Span]] = field(default_factory=dict)
    requests: dict[str, str] | None = None  # of an algorithm of a part: those it may make, by its names for them
    parts: tuple[Span, ...] = ()  # where the parts that use it name it

    @property
    def written(self) -> str:
        """Its name in the file that names it."""
        return self.span.text.strip('"') if self.parts else self.name


@dataclass(frozen=True)
class ParsedMachine:
    """Values of the machine JSON by key, as if one file had all of its parts; its algorithms in JSON order, and its
    targets."""

    name: str
    source: SourceFile
    package: str  # ROS package of its messages
    keys: dict[str, JsonNode]
    algorithms: dict[str, ParsedAlgorithm]
    targets: dict[str, Target]
    hashed_text: str  # of machine JSON and parts, without `views` and `requirements`, which change nothing that it does
    constants: Constants | None  # None without a block of them
    joined: Joined

    @property
    def folder(self) -> Path:
        """The folder of the machine JSON, to which its paths are relative."""
        return Path(self.source.path).parent

    @property
    def files(self) -> list[ParsedFile]:
        """All algorithm files, each once, in JSON order."""
        files = [file for a in self.algorithms.values() if a.file is not None for file in a.file.all]
        return list({file.source.name: file for file in files}.values())


def parse_machine(path: Path, sink: DiagnosticSink) -> ParsedMachine | None:
    """Reads a machine and reports errors. Returns None if the machine JSON itself is unusable."""
    name = path.stem
    try:
        source = SourceFile.read(path, path.name)
    except SourceError as error:
        at = error.span or SourceFile(str(path), "", str(path)).whole()
        fix = "remove it, or save the file as UTF-8" if error.span else ""
        sink.error("E100", f"cannot read the machine `{path}`: {error}", at, help=fix)
        return None
    root = parse_json(source, sink)
    if _is_simulation(path, root):
        fix = f"`fcsl check {path}` checks it together with the machine of its `controller`"
        sink.error("E104", "this is a simulation, not a machine", source.whole(), help=fix)
        return None
    if root is not None and root.kind == "object" and {"machine", "devices"} <= root.members.keys():
        fix = f"`fcsl board {path}` checks it together with its machine"
        sink.error("E105", "this is a board, not a machine", source.whole(), help=fix)
        return None
    _check_name(name, source, sink)
    if root is None:
        return None
    reader = ConfigReader(sink)
    keys = reader.object(root, "a machine", _REQUIRED, _OPTIONAL)
    if keys is None:
        return None
    if "constants" in keys:
        reader.constants = read_constants(keys["constants"], path, reader)
    joined = Joined(path, keys, reader)
    if not joined.complete:
        return None
    keys = joined.keys
    for key in ("$schema", "description"):
        reader.string(keys.get(key), f"`{key}`")
    files = _Files(path, reader.sink)
    algorithms = {
        key: _parse_algorithm(key, definition, span, files, tuple(joined.users.get(key, ())), reader)
        for key, (definition, span) in reader.named(keys.get("algorithms"), "`algorithms`").items()
    }
    targets = read_targets(keys.get("targets"), path, reader)
    hashed_text = "\n".join((text_without(source, root, ("views", "requirements")), *joined.hashed.values()))
    return ParsedMachine(
        name, source, package_of(path, name), keys, algorithms, targets, hashed_text, reader.constants, joined
    )


def is_machine_name(name: str) -> bool:
    """Whether `name` is lower_snake_case and not reserved by C or this compiler."""
    return len(name) <= MAX_NAME and bool(_STEM.fullmatch(name)) and not _TAKEN.fullmatch(name)


def _is_simulation(path: Path, root: JsonNode | None) -> bool:
    """Whether the file is a simulation, by its content; by its file name if the content is not valid JSON."""
    if root is None or root.kind != "object":
        return path.name.endswith(".sim.json")
    return "extends" in root.members or {"controller", "models"} <= root.members.keys()


def _check_name(name: str, source: SourceFile, sink: DiagnosticSink) -> None:
    if not _STEM.fullmatch(name) or len(name) > MAX_NAME:
        fix = "the file's name becomes the machine's: lower_snake_case.json"
        sink.error("E203", f"`{name}` cannot be the name of a machine", source.whole(), help=fix)
    elif _TAKEN.fullmatch(name):
        fix = "rename the file, such as `<vehicle>_<what>.json`"
        sink.error(
            "E203", f"`{name}` is a name of C", source.whole(), why=f"it becomes `{name}.h` and `{name}_t`", help=fix
        )


def _parse_algorithm(
    name: str, definition: JsonNode, span: Span, files: _Files, parts: tuple[Span, ...], reader: ConfigReader
) -> ParsedAlgorithm:
    keys = reader.object(definition, f"algorithm `{name}`", ("source",), ("class", "sizes"))
    text = reader.string(keys.get("source"), "`source`") if keys else None
    class_node = keys.get("class") if keys else None
    class_name = reader.string(class_node, "`class`")
    class_span = class_node.span if class_node is not None else span
    if keys is None or text is None or (class_node is not None and class_name is None):
        return ParsedAlgorithm(name, name, span, class_span, None, parts=parts)
    sizes = {
        key: (reader.integer(node, f"size `{key}`", 1, MAX_ELEMENTS) or 1, at)
        for key, (node, at) in reader.named(keys.get("sizes"), f"`sizes` of `{name}`").items()
    }
    scope = reader.scopes.get(definition.span.source)
    requests = scope.requests if scope is not None else None
    file = files.read(text, keys["source"].span)
    return ParsedAlgorithm(name, class_name or name, span, class_span, file, sizes, requests, parts)


class _Files:
    """Reads each file and its imports once."""

    def __init__(self, config: Path, sink: DiagnosticSink):
        self.config, self.sink = config, sink
        self._read: dict[Path, ParsedFile | None] = {}

    def read(self, text: str, at: Span, depth: int = 0) -> ParsedFile | None:
        """The file that a `source` names. None after reporting that it cannot be read."""
        if depth > MAX_IMPORTS:
            fix = "import from the file that defines the name"
            self.sink.error("E304", f"a chain of more than {MAX_IMPORTS} imports", at, help=fix)
            return None
        try:
            path = resolve_source(text, config=self.config)
            if path in self._read:
                return self._read[path]
            self._read[path] = None
            source = SourceFile.read(path, text)
        except SourcePathError as error:
            self.sink.error("E103", f"`{text}` cannot be a source", at, why=str(error))
            return None
        except SourceError as error:
            fix = "remove it, or save the file as UTF-8" if error.span else missing_file_help(error, at)
            self.sink.error("E100", f"cannot read `{text}`: {error}", error.span or at, help=fix)
            return None
        file = ParsedFile(source, parse_python(source, self.sink))
        self._read[path] = file
        for module, span in self._modules(file):
            beside = f"{module.replace('.', '/')}.py"
            name = f"{text.rpartition('/')[0]}/{beside}" if "/" in text else beside
            if _is_file(path.parent / beside):
                file.imports[module] = self.read(name, span, depth + 1)
        return file

    def _modules(self, file: ParsedFile) -> list[tuple[str, Span]]:
        """Modules that a file may import from, in file order. None of one that is not valid Python."""
        body = file.tree.body if file.tree is not None else []
        found = [(module, span_of(file.source, node)) for node in body for module in _imported(node)]
        return [(module, span) for module, span in found if not is_ignored_module(module)]


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # not a valid file name
        return False


def _imported(node: ast.stmt) -> list[str]:
    """The modules that a statement imports. Relative imports are omitted; check/collect.py reports them."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return [node.module] if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module else []
