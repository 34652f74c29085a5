# SPDX-License-Identifier: Apache-2.0
"""fcsl adopt FILE MACHINE.json: the values of a parameter file become those of the machine JSON.

The machine is compiled, and opened with the file, so that the file is checked as every host checks it. Then each scalar that differs
is replaced in the text of the JSON; all other bytes stay. The new text is written whole, or not at all.

Exit status 0: done, also where nothing differed. 2: bad input, nothing written.
"""

from __future__ import annotations

import argparse
import json
import re
import struct
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from fcsl_compiler.api.command_line import add_examples
from fcsl_compiler.api.diagnostics import DiagnosticSink, SourceFile, Span
from fcsl_compiler.api.files import write_whole
from fcsl_compiler.api.json_files import JsonNode, parse_json

from .c_machine import TYPE_FORMATS
from .descriptor import Field
from .errors import TwinError
from .machine_build import build_config, find_config
from .parameters import read_parameters
from .run import Run, open_run
from .values import scalar_reader

_EXAMPLES = {"": "params.yaml craft_control.json"}
_STEP = re.compile(r"[^.\[\]]+")
_MARK = "\ufeff"


def make_parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="fcsl adopt",
        description="Writes the values of a parameter file into a machine JSON, and changes nothing else of it.",
    )
    parser.add_argument("file", metavar="FILE", help="parameter file (docs/reference/variables.md)")
    parser.add_argument("machine", metavar="MACHINE.json")
    add_examples(parser, _EXAMPLES)
    return parser


def main(arguments: Sequence[str]) -> int:
    options = make_parser().parse_args(arguments)
    config = find_config(options.machine)
    library, name = build_config(config)
    with (
        closing(open_run(library, name)) as own,
        closing(open_run(library, name, read_parameters(options.file))) as wanted,
    ):
        changes = list(_changes(own, wanted))
        text, told = _rewritten(config, changes, wanted)
    if changes:
        write_whole(config, text)
    print("\n".join([*told, f"{config}: {len(changes)} value{'s' if len(changes) != 1 else ''} changed"]))
    return 0


class _Change(NamedTuple):
    """Scalar `element` of a parameter."""

    field: Field
    element: int
    value: Any


def _changes(own: Run, wanted: Run) -> Iterator[_Change]:
    for field in own.machine.fields.values():
        if field.role != "parameter":
            continue
        read = scalar_reader(field, own.machine)
        size = field.size // field.count
        for element in range(field.count):
            offset = field.offset + element * size
            data = wanted.read(offset, size)
            if data != own.read(offset, size):
                yield _Change(field, element, read(struct.unpack(f"={TYPE_FORMATS[field.type]}", data)[0]))


# ---- the text ------------------------------------------------------------------------------------------------------------


class _Edit(NamedTuple):
    begin: int
    end: int
    text: str


def _rewritten(config: Path, changes: Sequence[_Change], wanted: Run) -> tuple[str, list[str]]:
    """The new text of the JSON, and what is said of the changes. Raises TwinError."""
    raw = config.read_bytes().decode("utf-8")
    mark, text = (_MARK, raw[1:]) if raw.startswith(_MARK) else ("", raw)
    told = []
    # One parameter at a time: the next one sees what was inserted.
    for _, group in groupby(changes, key=lambda change: _parameter_of(change.field)):
        root = parse_json(SourceFile(config.name, text, str(config)), DiagnosticSink())
        if root is None:
            raise TwinError(f"{config}: no JSON that can be changed")
        edits: set[_Edit] = set()
        for change in group:
            place = _Place(config, root, text, change, wanted)
            edit, before = place.edit()
            edits.add(edit)
            told.append(
                f"{place.name}: {before} -> {place.value}{f' {change.field.unit}' if change.field.unit else ''}"
            )
        for edit in sorted(edits, reverse=True):
            text = text[: edit.begin] + edit.text + text[edit.end :]
    return mark + text, told


def _parameter_of(field: Field) -> str:
    """`law.parameters.loop` of `law.parameters.loop.kp`."""
    path = field.path.removeprefix(f"{field.instance}.parameters.")
    return f"{field.instance}.parameters.{_STEP.findall(path)[0]}"


def _offsets(span: Span) -> tuple[int, int]:
    return span.source.offsets(span)


class _Place:
    """Where the machine JSON has a value."""

    def __init__(self, config: Path, root: JsonNode, text: str, change: _Change, wanted: Run):
        self.config, self.text, self.change, self.wanted = config, text, change, wanted
        field = change.field
        self.steps = _STEP.findall(field.path.removeprefix(f"{field.instance}.parameters."))
        rest, indices = change.element, []
        for extent in reversed(field.shape):
            indices.append(rest % extent)
            rest //= extent
        self.indices = indices[::-1]
        self.name = f"{field.path.replace('.parameters.', '.', 1)}{''.join(f'[{i}]' for i in self.indices)}"
        self.value = _literal(change.value, field)
        instances = root.get("instances")
        self.instance = None if instances is None else instances.get(field.instance)

    def edit(self) -> tuple[_Edit, str]:
        """And what the JSON has there now."""
        if self.instance is None:
            raise TwinError(
                f"{self.name}: `{self.change.field.instance}` is an instance of a part of {self.config.name}; "
                "adopt the values in the machine JSON of the part"
            )
        parameters = self.instance.get("parameters")
        if parameters is None:
            return self._inserted(self.instance, "parameters", f"{{{self._member()}}}"), "default"
        node = parameters.get(self.steps[0])
        if node is None:
            return self._inserted(parameters, self.steps[0], self._whole()), "default"
        for step in [*self.steps[1:], *self.indices]:
            node = self._below(node, step)
        if node.kind in ("object", "array", "null") or (node.kind == "string") != isinstance(self.change.value, str):
            raise self._not_plain(node)
        begin, end = _offsets(node.span)
        return _Edit(begin, end, self.value), self.text[begin:end]

    def _below(self, node: JsonNode, step: str | int) -> JsonNode:
        below = None
        if node.kind == "array" and str(step).isdecimal() and int(step) < len(node.items):
            below = node.items[int(step)]
        elif node.kind == "object":
            below = node.get(str(step))
        if below is None:
            raise self._not_plain(node)
        return below

    def _not_plain(self, node: JsonNode) -> TwinError:
        shown = node.span.text
        return TwinError(
            f"{self.config}:{node.span.line}: `{self.name}` comes from {shown if len(shown) < 60 else 'here'}, not from a plain value; "
            f"write {self.value} by hand, or change what it comes from"
        )

    def _inserted(self, node: JsonNode, key: str, value: str) -> _Edit:
        """Behind the last member, with the white space that this one has before it."""
        members = list(node.members.values())
        if not members:
            return _Edit(*_offsets(node.span), f'{{"{key}": {value}}}')
        last, (at, _) = members[-1], _offsets(members[-1].key_span)
        space = len(self.text[:at]) - len(self.text[:at].rstrip())
        _, end = _offsets(last.value.span)
        return _Edit(end, end, f',{self.text[at - space : at]}"{key}": {value}')

    def _member(self) -> str:
        return f'"{self.steps[0]}": {self._whole()}'

    def _whole(self) -> str:
        """The whole parameter, whose default the algorithm has: no member of it can be left out."""
        path = _parameter_of(self.change.field)
        rows = [f for f in self.wanted.machine.fields.values() if f.role == "parameter"]
        fields = [f for f in rows if _parameter_of(f) == path]
        return _tree([(_STEP.findall(f.path.removeprefix(path)), self._field(f)) for f in fields])

    def _field(self, field: Field) -> str:
        read = scalar_reader(field, self.wanted.machine)
        data = self.wanted.read(field.offset, field.size)
        flat = [_literal(read(v), field) for v in struct.unpack(f"={field.count}{TYPE_FORMATS[field.type]}", data)]
        for extent in reversed(field.shape):
            flat = [f"[{', '.join(flat[i : i + extent])}]" for i in range(0, len(flat), extent)]
        return flat[0]


def _tree(rows: Sequence[tuple[list[str], str]]) -> str:
    """Nested structs of leaves, each below the names and indices that lead to it."""
    if not rows[0][0]:
        return rows[0][1]
    groups: dict[str, list[tuple[list[str], str]]] = {}
    for steps, value in rows:
        groups.setdefault(steps[0], []).append((steps[1:], value))
    inner = {key: _tree(below) for key, below in groups.items()}
    if all(key.isdecimal() for key in inner):
        return f"[{', '.join(inner.values())}]"
    return "{" + ", ".join(f'"{key}": {value}' for key, value in inner.items()) + "}"


def _literal(value: Any, field: Field) -> str:
    """As the machine JSON has it."""
    if isinstance(value, str):
        return json.dumps(value.removeprefix("tr_") if field.type == "TransitionRequest" else value)
    if isinstance(value, float) and field.type == "f32":
        return next(t for t in (repr(float(f"{value:.{n}g}")) for n in range(1, 18)) if _f32(float(t)) == value)
    return json.dumps(value)


def _f32(value: float) -> float:
    return float(struct.unpack("=f", struct.pack("=f", value))[0])
