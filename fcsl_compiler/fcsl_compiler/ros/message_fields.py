# SPDX-License-Identifier: Apache-2.0
"""Field paths in ROS 2 messages: the numbers that a path selects, and their kind (vector, quaternion, …)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from enum import Enum

from ..base.diagnostics import nearest
from .standard_messages import SIZES, Definitions, Member, short_name

#: Axes of a vector. ROS uses ENU in the world frame and FLU in a body frame (REP-103).
VECTOR_AXES: tuple[str, ...] = ("enu", "ned", "flu", "frd")
#: World and body axes of an orientation, which rotates vectors from the body frame to the world frame.
QUATERNION_AXES: tuple[str, ...] = ("enu/flu", "ned/frd", "ned/flu", "enu/frd")

#: Maximum index in a path. It bounds the size of a conversion.
MAX_INDEX = 4095
_MAX_DEPTH = 16
#: Number of fields that a message about a missing field lists.
_MAX_LISTED = 24
_STEPS = re.compile(r"\.(?![^\[]*\])")  # dots outside brackets; names in brackets may contain dots
_STEP = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:\[([^\[\]]+)\])?")
#: Behind the path of a list: its number of elements.
LENGTH = "count"


def numbers_text(count: int) -> str:
    """Text for messages: `one number`, `3 numbers`."""
    return "one number" if count == 1 else f"{count} numbers"


class Kind(Enum):
    """The meaning of a field's numbers as a group. It decides which axes they can have."""

    NUMBERS = "numbers"
    TEXT = "text"  # a string
    VECTOR = "a vector"
    VECTORS = "two vectors"  # such as a twist
    QUATERNION = "a quaternion"  # x, y, z, w
    COVARIANCE = "a covariance"  # of one vector (9 numbers) or of two (36), row-major

    @property
    def axes(self) -> tuple[str, ...]:
        """Allowed axes for this kind."""
        if self is Kind.QUATERNION:
            return QUATERNION_AXES
        return () if self in (Kind.NUMBERS, Kind.TEXT) else VECTOR_AXES


@dataclass(frozen=True)
class Piece:
    """`count` adjacent numbers of `type`. `path` leads to a member: a single number, an array or a sequence.

    `element` is the index of the selected number, or, in a sequence with a parallel `string[] name`, the name of the
    selected element. `count` is 0 for a whole sequence of unknown length. The path of a sequence and `.count` is its
    length. A `string` is one piece.
    """

    path: str
    type: str
    count: int
    element: int | str | None = None
    unit: str = ""
    length: bool = False


@dataclass(frozen=True)
class Selection:
    """The numbers that a field path selects, in the order of the message."""

    kind: Kind
    pieces: tuple[Piece, ...]

    @property
    def is_length(self) -> bool:
        """Whether it is the number of elements of a sequence."""
        return any(p.length for p in self.pieces)

    @property
    def count(self) -> int:
        """Total number of numbers; 0 if the length depends on the message."""
        return 0 if any(p.count == 0 for p in self.pieces) else sum(p.count for p in self.pieces)

    @property
    def unit(self) -> str:
        """The common unit of all numbers, or ""."""
        units = {p.unit for p in self.pieces}
        return units.pop() if len(units) == 1 else ""


def length_of(path: str) -> Piece:
    """The number of elements of the sequence at `path`."""
    return Piece(f"{path}.{LENGTH}", "uint32", 1, length=True)


class FieldError(ValueError):
    """A path that selects no numbers of its message. args: message text and help text."""


def select(definitions: Definitions, message: str, path: str) -> Selection:
    """Resolves `path` in message type `message` (full name). `.` selects the whole message. Raises FieldError."""
    if path == ".":
        pieces = tuple(_below(definitions, message, "", "", 0))
        return Selection(_kind_of_message(definitions, message), pieces)
    done, unit = "", ""
    here = Member("", message)
    siblings: tuple[Member, ...] = ()
    element: int | str | None = None
    steps = _STEPS.split(path)
    for number, step in enumerate(steps):
        match = _STEP.fullmatch(step)
        if match is None:
            raise FieldError(f"`{path}` is not a field of a message", "write it such as pose.position.z, or axes[1]")
        if step == LENGTH and number == len(steps) - 1 and here.sequence and element is None and _has_length(here):
            return Selection(Kind.NUMBERS, (length_of(done[:-1]),))
        if here.is_array and element is None:
            raise FieldError(
                f"`{done[:-1]}` is a list of messages", f"take one, such as {done[:-1]}[0].{path[len(done) :]}"
            )
        if here.type not in definitions:
            raise FieldError(f"`{done[:-1]}` is {_article(here)}, without fields", f"write `{done[:-1]}`")
        siblings = definitions[here.type]
        here = _member(definitions, message, here, match.group(1), done)
        unit = here.unit or unit
        element = _element(definitions, here, match.group(2), siblings, done + here.name)
        indexed = element is not None and here.type in definitions
        done += f"{here.name}[{element}]." if indexed else f"{here.name}."
    return _numbers(definitions, replace(here, unit=unit), done[:-1], element)


def owner_of(definitions: Definitions, message: str, path: str) -> tuple[str, Member]:
    """The message that has the last member of a valid path, and that member; of `.` the message itself."""
    owner, member = message, Member("", message)
    for step in _STEPS.split(path) if path != "." else ():
        name = step.partition("[")[0]
        found = next((m for m in definitions.get(member.type, ()) if m.name == name), None)
        if found is None:  # `.count` of a list
            break
        owner, member = member.type, found
    return owner, member


def fields_of(definitions: Definitions, message: str) -> list[str]:
    """The fields of a message that a user may want to map. A vector counts as one field."""
    whole = ["."] if _kind_of_message(definitions, message) is not Kind.NUMBERS else []
    return [*whole, *_fields(definitions, message, "", 0)]


def _fields(definitions: Definitions, message: str, prefix: str, depth: int) -> Iterator[str]:
    for member in definitions[message]:
        path = prefix + member.name
        if member.type in SIZES:
            named = _has_names(definitions[message]) and member.sequence
            yield path + ("[<name>]" if named else "")
        elif member.type in definitions and path != "header" and depth < _MAX_DEPTH and not member.is_array:
            if _kind_of_message(definitions, member.type) in (Kind.NUMBERS, Kind.VECTORS):
                yield from _fields(definitions, member.type, path + ".", depth + 1)
            else:
                yield path


def _has_names(members: tuple[Member, ...]) -> bool:
    return any(m.name == "name" and m.type == "string" and m.sequence for m in members)


def _article(member: Member) -> str:
    if member.is_array:
        return "a list"
    return "a string" if member.type == "string" else f"a number ({member.type})"


def _member(definitions: Definitions, message: str, owner: Member, name: str, done: str) -> Member:
    members = definitions[owner.type]
    found = next((m for m in members if m.name == name), None)
    if found is None:
        close = nearest(name, [m.name for m in members])
        fields = fields_of(definitions, message)
        known = ", ".join(fields[:_MAX_LISTED]) + (", …" if len(fields) > _MAX_LISTED else "")
        raise FieldError(f"`{short_name(owner.type)}` has no field `{name}`", close or f"fields to map: {known}")
    return found


def _has_length(member: Member) -> bool:
    return member.type not in ("string", "wstring")


def key_of(index: str) -> tuple[str, str]:
    """The member and its value of an index such as `child_frame_id=base_link`; ("", "") for another one."""
    name, equals, value = index.partition("=")
    return (name, value) if equals else ("", "")


def _element(
    definitions: Definitions, member: Member, index: str | None, siblings: tuple[Member, ...], path: str
) -> int | str | None:
    if index is None:
        return None
    if "=" in path and member.sequence and not (member.type in SIZES and index.isdigit()):
        text = f"`{path}[{index}]` lies within an element that is found by its key"
        raise FieldError(text, f"give the outer list a number, such as {path.partition('[')[0]}[0]")
    if member.sequence and member.type in definitions and key_of(index)[0]:
        return _by_key(definitions, member, index, path)
    if not member.is_array:
        raise FieldError(f"`{path}` is not a list", f"write `{path}`")
    if index.isascii() and index.isdigit() and len(index) < 10:
        end = member.count or member.bound or MAX_INDEX + 1
        if int(index) >= end:
            raise FieldError(f"`{path}` has no element {int(index)}", f"the last one is {end - 1}")
        return int(index)
    if not (member.sequence and member.type in SIZES and _has_names(siblings)):
        raise FieldError(f"`{path}` has no element `{index}`", f"write a number, such as {path}[0]")
    return index


def _by_key(definitions: Definitions, member: Member, index: str, path: str) -> str:
    name, value = key_of(index)
    strings = [m.name for m in definitions[member.type] if m.type == "string" and not m.is_array]
    if name not in strings or not value:
        text = f"`{path}` has no element `{index}`"
        fix = f"write {path}[{strings[0]}=…]" if strings else f"its elements have no strings; write {path}[0]"
        raise FieldError(text, fix)
    return index


def _numbers(definitions: Definitions, member: Member, path: str, element: int | str | None) -> Selection:
    """The numbers of a member, or of one element of it."""
    if member.type in SIZES:
        count = 1 if element is not None or not member.is_array else member.count
        kind = Kind.NUMBERS
        if count == 3 and member.type.startswith("float"):
            kind = Kind.VECTOR
        if count in (9, 36) and member.name.endswith("covariance"):
            kind = Kind.COVARIANCE
        return Selection(kind, (Piece(path, member.type, count, element, member.unit),))
    if member.type == "string" and not member.is_array:
        if key_of(path.rpartition("[")[2].partition("]")[0])[0] == path.rpartition("].")[2]:
            raise FieldError(f"`{path}` is the key of its element", "map another field of the element")
        return Selection(Kind.TEXT, (Piece(path, "string", 1),))
    if member.type not in definitions:
        raise FieldError(f"`{path}` is text, not a number", "a channel carries numbers and bools")
    if member.is_array and element is None:
        raise FieldError(f"`{path}` is a list of messages", f"take one, such as {path}[0]")
    pieces = tuple(_below(definitions, member.type, path, member.unit, 0))
    return Selection(_kind_of_message(definitions, member.type), pieces)


def _below(definitions: Definitions, message: str, path: str, unit: str, depth: int) -> Iterator[Piece]:
    for member in definitions[message]:
        at = f"{path}.{member.name}" if path else member.name
        if member.type in SIZES and not member.sequence:
            yield Piece(at, member.type, max(1, member.count), None, unit if unit else member.unit)
            continue
        nested = member.type in definitions and not member.is_array and depth < _MAX_DEPTH
        if not nested or _kind_of_message(definitions, member.type) is Kind.QUATERNION:
            what = "a quaternion" if nested else _article(member)
            fields = ", ".join(m.name for m in definitions[message])
            raise FieldError(
                f"`{path or short_name(message)}` contains {what} (`{member.name}`)",
                f"map each of its fields to a separate channel: {fields}",
            )
        yield from _below(definitions, member.type, at, member.unit or unit, depth + 1)


def _kind_of_message(definitions: Definitions, message: str) -> Kind:
    names = _float_names(definitions, message)
    if names in ("xyz", "xyzw"):
        return Kind.VECTOR if names == "xyz" else Kind.QUATERNION
    members = definitions[message]
    vectors = [m for m in members if not m.is_array and _float_names(definitions, m.type) == "xyz"]
    return Kind.VECTORS if len(vectors) == len(members) == 2 else Kind.NUMBERS


def _float_names(definitions: Definitions, message: str) -> str:
    """Concatenated member names of a message that contains only floats."""
    members = definitions.get(message, ())
    is_float = all(m.type in ("float32", "float64") and not m.is_array for m in members)
    return "".join(m.name for m in members) if is_float else ""
