# SPDX-License-Identifier: Apache-2.0
"""Reads a machine JSON and the algorithms it names: texts and syntax trees, nothing checked yet and nothing executed."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from pathlib import Path

from .config_reader import ConfigReader
from .diagnostics import DiagnosticSink
from .json_source import JsonNode, parse_json
from .pysource import parse_python
from .source import MAX_NAME, SourceError, SourceFile, Span
from .source_path import SourcePathError, resolve_source
from .targets import Target, read_targets

_STEM = re.compile(r"[a-z](_?[a-z0-9])*")
#: Machines named so would have the header or the type `<name>_t` of a C library, or files and types of this compiler.
_TAKEN = re.compile(
    r"fcsl(_.*)?|u?int(_?(least|fast))?(8|16|32|64|ptr|max)|size|ssize|time|clock|ptrdiff|wchar|wint|max_align|float|double|div|ldiv|"
    r"lldiv|fpos|locale|math|string|strings|stdint|stddef|stdbool|stdlib|stdio|limits|errno|features|assert|ctype|fenv|setjmp|"
    r"signal|stdarg|complex|tgmath|iso646|inttypes|endian|alloca|memory"
)

_REQUIRED = ("tick_hz", "initial_state", "algorithms", "instances", "states")
_OPTIONAL = (
    *("$schema", "description", "structs", "connections", "transitions", "requests", "publish", "channels", "targets"),
)


@dataclass(frozen=True)
class ParsedAlgorithm:
    """source is None where the file cannot be read, tree where it is not Python (both were reported) or was not asked for."""

    name: str
    span: Span
    source: SourceFile | None
    tree: ast.Module | None


@dataclass(frozen=True)
class ParsedMachine:
    """The values of the machine JSON by key, its algorithms in JSON order, and what its externs are linked from."""

    name: str
    source: SourceFile
    package: str  # ROS package of its messages
    keys: dict[str, JsonNode]
    algorithms: dict[str, ParsedAlgorithm]
    targets: dict[str, Target]


def parse_machine(path: Path, sink: DiagnosticSink, trees: bool = True) -> ParsedMachine | None:
    """Reads everything; None when the machine JSON itself is unusable. What is wrong is reported.

    Without `trees` the algorithms are read, but not parsed.
    """
    name = path.stem
    try:
        source = SourceFile.read(path, path.name)
    except SourceError as error:
        sink.error("E100", f"cannot read the machine `{path}`: {error}", SourceFile(str(path), "", str(path)).whole())
        return None
    root = parse_json(source, sink)
    if _is_simulation(path, root):
        fix = f"`fcsl-sim check {path}` checks it, and the machine of its `controller` with it"
        sink.error("E104", "this is a simulation, not a machine", source.whole(), help=fix)
        return None
    _check_name(name, source, sink)
    if root is None:
        return None
    reader = ConfigReader(sink)
    keys = reader.object(root, "a machine", _REQUIRED, _OPTIONAL)
    if keys is None:
        return None
    for key in ("$schema", "description"):
        reader.string(keys.get(key), f"`{key}`")
    algorithms = {
        key: _parse_algorithm(key, definition, span, path, reader, trees)
        for key, (definition, span) in reader.named(keys.get("algorithms"), "`algorithms`").items()
    }
    targets = read_targets(keys.get("targets"), path, reader)
    return ParsedMachine(name, source, _package_of(path, name), keys, algorithms, targets)


def is_machine_name(name: str) -> bool:
    """lower_snake_case, and no name that C or this compiler has taken."""
    return len(name) <= MAX_NAME and bool(_STEM.fullmatch(name)) and not _TAKEN.fullmatch(name)


def _is_simulation(path: Path, root: JsonNode | None) -> bool:
    """By its content; by its name where that cannot be read."""
    if root is None or root.kind != "object":
        return path.name.endswith(".sim.json")
    return {"controller", "models"} <= root.members.keys()


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
    name: str, definition: JsonNode, span: Span, config: Path, reader: ConfigReader, trees: bool
) -> ParsedAlgorithm:
    keys = reader.object(definition, f"algorithm `{name}`", ("source",))
    text = reader.string(keys.get("source"), "`source`") if keys else None
    if keys is None or text is None:
        return ParsedAlgorithm(name, span, None, None)
    at = keys["source"].span
    try:
        source = SourceFile.read(resolve_source(text, config=config), text)
    except SourcePathError as error:
        reader.sink.error("E103", f"`{text}` cannot be a source", at, why=str(error))
        return ParsedAlgorithm(name, span, None, None)
    except SourceError as error:
        fix = f"paths are relative to {config.parent}" if str(error) == "no such file" else ""
        reader.sink.error("E100", f"cannot read `{text}`: {error}", at, help=fix)
        return ParsedAlgorithm(name, span, None, None)
    return ParsedAlgorithm(name, span, source, parse_python(source, reader.sink) if trees else None)


def _package_of(path: Path, name: str) -> str:
    """The ROS package the machine stands in (the nearest package.xml above it), or a name of its own."""
    for folder in path.resolve().parents:
        manifest = folder / "package.xml"
        if manifest.is_file():
            match = re.search(r"<name>\s*([a-z][a-z0-9_]*)\s*</name>", manifest.read_text(errors="replace"))
            if match:
                return match.group(1)
    return name
