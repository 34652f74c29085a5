# SPDX-License-Identifier: Apache-2.0
"""Paths as users write them: `nav.outputs.P[0][2]` or `nav.outputs.P[0, 2]`; `nav.outputs.targets[1].position[2]`.

A machine's descriptor has fields for the members of a struct, but none for the struct. `nav.outputs.targets`,
`nav.outputs.targets[1]` and `nav.outputs.targets[1].position` select an array of structs, a struct and a field.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from .descriptor import Field, Machine
from .errors import TwinError, did_you_mean

_PART = re.compile(r"(?:^|\.)([^.\[\]]+)|\[([^\[\]]*)\]")
_MAX_LISTED = 12
#: Roles of fields that may be members of a struct; their paths begin with instance, record and port.
_PORT_ROLES = ("input", "output", "parameter", "state")
#: The parts of an instance.
PARTS = ("inputs", "outputs", "parameters", "state", "counters")
_OF_INSTANCE = re.compile(rf"(?!machine\.|channels\.)(.+?)\.({'|'.join(PARTS)})\.(.+)", re.DOTALL)


@dataclass(frozen=True)
class Selection:
    """A field, or a contiguous part of it: `count` scalars from scalar `element` on, seen as `shape`."""

    path: str
    field: Field
    element: int
    count: int
    shape: tuple[int, ...]

    @property
    def offset(self) -> int:
        return self.field.offset + self.element * (self.field.size // self.field.count)

    @property
    def size(self) -> int:
        return self.count * (self.field.size // self.field.count)

    def leaves(self) -> Iterator[Selection]:
        yield self


@dataclass(frozen=True)
class Struct:
    """A struct: its members by name, in order."""

    path: str
    members: dict[str, Part]

    def leaves(self) -> Iterator[Selection]:
        """Every field of the struct, in order."""
        for part in self.members.values():
            yield from part.leaves()


@dataclass(frozen=True)
class StructArray:
    """An array of structs, or of rows of structs."""

    path: str
    elements: tuple[Part, ...]

    def leaves(self) -> Iterator[Selection]:
        """Every field of the array, in order."""
        for part in self.elements:
            yield from part.leaves()


Part = Selection | Struct | StructArray


@dataclass(frozen=True)
class _Index:
    """An index as written between brackets."""

    text: str

    def __str__(self) -> str:
        return f"[{self.text}]"


_Steps = tuple[str | _Index, ...]


def _steps(path: str) -> _Steps | None:
    """The names and indices of a path; None when it is not one."""
    steps: list[str | _Index] = []
    at = 0
    while at < len(path):
        match = _PART.match(path, at)
        if match is None or (not steps and match[1] is None):
            return None
        at = match.end()
        steps += [match[1]] if match[1] is not None else [_Index(i.strip()) for i in match[2].split(",")]
    return tuple(steps)


def _join(steps: Sequence[str | _Index]) -> str:
    text = "".join(str(s) if isinstance(s, _Index) else f".{s}" for s in steps)
    return text.removeprefix(".")


def resolve(path: str, machine: Machine) -> Part:
    """The part of the machine that `path` selects.

    Raises TwinError with the nearest path, or the extents that an index violates.
    """
    steps = _steps(path) if isinstance(path, str) else None
    if not steps:
        raise TwinError(f"{path!r} is not a path; write for example `nav.outputs.position[2]`")
    behind = 0  # indices after the last name may select inside a field, or an element of an array of structs
    while True:
        field = machine.fields.get(_join(steps[: len(steps) - behind]))
        if field is not None:
            indices = [s.text for s in steps[len(steps) - behind :] if isinstance(s, _Index)]
            return _element(path, field, indices)
        if not isinstance(steps[len(steps) - 1 - behind], _Index):
            break
        behind += 1
    return _struct(path, steps, machine)


def _element(path: str, field: Field, indices: list[str]) -> Selection:
    """The part of a field that the indices select."""
    if len(indices) > len(field.shape):
        raise TwinError(f"`{path}`: {field.type_text} takes at most {len(field.shape)} indices, got {len(indices)}")
    element, count = 0, field.count
    for text, extent in zip(indices, field.shape, strict=False):
        if not re.fullmatch(r"[0-9]+", text) or int(text) >= extent:
            raise TwinError(f"`{path}`: index `{text}` is not in 0..{extent - 1}; the field is {field.type_text}")
        count //= extent
        element += int(text) * count
    return Selection(path, field, element, count, field.shape[len(indices) :])


def _struct(path: str, steps: _Steps, machine: Machine) -> Part:
    """The struct, or array of structs, whose members are fields of the descriptor."""
    name = _join(steps)
    below = _below(name, machine)
    if not below:
        raise _unknown(path, steps, machine)
    if not split_path(name)[0] or any(f.role not in _PORT_ROLES for f in below):
        shown = ", ".join(f.path for f in below[:_MAX_LISTED]) + (", …" if len(below) > _MAX_LISTED else "")
        raise TwinError(f"`{path}` is not a field but a group of fields: {shown}")
    return _group(name, [(_split(f.path.removeprefix(name)), f) for f in below])


def split_path(path: str) -> tuple[str, str, str]:
    """Instance, part and field of `nav.outputs.angle`; the instance may have dots, `att.rate`. "", "" and the path if it
    names no part of an instance."""
    match = _OF_INSTANCE.fullmatch(path)
    return (match[1], match[2], match[3]) if match else ("", "", path)


def _below(name: str, machine: Machine) -> list[Field]:
    return [f for p, f in machine.fields.items() if p.startswith((f"{name}.", f"{name}["))]


def _split(rest: str) -> _Steps:
    steps = _steps("x" + rest)
    assert steps is not None
    return steps[1:]


def _group(path: str, leaves: list[tuple[_Steps, Field]]) -> Part:
    """The value that consists of these fields, each with its steps below `path`."""
    first, field = leaves[0]
    if not first:
        return _element(path, field, [])
    parts: dict[str | _Index, list[tuple[_Steps, Field]]] = {}
    for steps, leaf in leaves:
        parts.setdefault(steps[0], []).append((steps[1:], leaf))
    groups = {step: _group(f"{path}{'' if isinstance(step, _Index) else '.'}{step}", p) for step, p in parts.items()}
    if isinstance(first[0], _Index):
        return StructArray(path, tuple(groups.values()))
    return Struct(path, {str(step): part for step, part in groups.items()})


def _unknown(path: str, steps: _Steps, machine: Machine) -> TwinError:
    """An error that names the invalid step: an index beyond an array of structs, or a name."""
    for end in range(1, len(steps)):
        step, parent = steps[end], _join(steps[:end])
        if isinstance(step, _Index) and not _below(_join(steps[: end + 1]), machine):
            siblings = {
                s[0].text
                for f in _below(parent, machine)
                if isinstance((s := _split(f.path[len(parent) :]))[0], _Index)
            }
            if siblings and parent not in machine.fields:
                return TwinError(f"`{path}`: index `{step.text}` is not in 0..{len(siblings) - 1}")
    name = _join(steps)
    verb = "sends" if machine.partial else "has"
    return TwinError(f"`{path}`: machine `{machine.name}` {verb} no such field{did_you_mean(name, machine.fields)}")
