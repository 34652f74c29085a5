# SPDX-License-Identifier: Apache-2.0
"""Paths as users write them: `nav.outputs.P[0][2]` or `nav.outputs.P[0, 2]`."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .descriptor import Field, Machine
from .errors import TwinError, did_you_mean

_PATH = re.compile(r"^([^\[\]]+)((?:\[[^\[\]]*\])*)$")
_MAX_LISTED = 12


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


def _unknown(path: str, machine: Machine) -> TwinError:
    hint = did_you_mean(path, machine.fields)
    below = [p for p in machine.fields if p.startswith(path + ".")]
    if below:
        shown = ", ".join(below[:_MAX_LISTED]) + (", …" if len(below) > _MAX_LISTED else "")
        return TwinError(f"`{path}` is not a field but a group of fields: {shown}")
    return TwinError(f"`{path}`: machine `{machine.name}` has no such field{hint}")


def resolve(path: str, machine: Machine) -> Selection:
    """What `path` selects. Raises TwinError with the nearest path, or the extents that an index violates."""
    match = _PATH.match(path) if isinstance(path, str) else None
    if match is None:
        raise TwinError(f"{path!r} is not a path; write for example `nav.outputs.position[2]`")
    name, brackets = match.groups()
    field = machine.fields.get(name)
    if field is None:
        raise _unknown(name, machine)
    indices = [i.strip() for part in re.findall(r"\[([^\]]*)\]", brackets) for i in part.split(",")]
    if len(indices) > len(field.shape):
        raise TwinError(f"`{path}`: {field.type_text} takes at most {len(field.shape)} indices, got {len(indices)}")
    element, count = 0, field.count
    for text, extent in zip(indices, field.shape, strict=False):
        if not re.fullmatch(r"[0-9]+", text) or int(text) >= extent:
            raise TwinError(f"`{path}`: index `{text}` is not in 0..{extent - 1}; the field is {field.type_text}")
        count //= extent
        element += int(text) * count
    return Selection(path, field, element, count, field.shape[len(indices) :])
