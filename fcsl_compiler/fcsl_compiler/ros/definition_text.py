# SPDX-License-Identifier: Apache-2.0
"""Reads the text of a message definition (a .msg file)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from .standard_messages import SIZES, Constant, Member, full_name

#: The only member of a message without members, as rosidl gives it one.
EMPTY = Member("structure_needs_at_least_one_member", "uint8")
_HEADER = "std_msgs/msg/Header"
#: Limits of a definition; none that is installed comes near them.
_MAX_MEMBERS, _MAX_COUNT = 4096, 1 << 28

_TYPE = re.compile(r"([A-Za-z]\w*(?:/(?:msg/)?[A-Za-z]\w*)?)(?:<=(\d+))?(\[(<=)?(\d*)\])?", re.ASCII)
_FIELD = re.compile(r"[a-z](_?[a-z0-9])*")
_CONSTANT = re.compile(r"[A-Z](_?[A-Z0-9])*")
_LINE = re.compile(r"(\S+)\s+(\w+)\s*(=?)\s*(.*)", re.ASCII)
_QUOTED = re.compile(r"'(?:[^'\\]|\\.)*'|\"(?:[^\"\\]|\\.)*\"")
_BOOLS = {"true": 1, "True": 1, "1": 1, "false": 0, "False": 0, "0": 0}


class DefinitionError(ValueError):
    """A text that is no definition of a message. str() names the line."""


@dataclass(frozen=True)
class Definition:
    """A message: its members in order, and its constants."""

    members: tuple[Member, ...]
    constants: dict[str, Constant]


def read_definition(message: str, text: str) -> Definition:
    """The definition of `message` (full name). Raises DefinitionError."""
    package = message.partition("/")[0]
    members: dict[str, Member] = {}
    constants: dict[str, Constant] = {}
    for line in declarations(text):
        try:
            _declare(line, package, members, constants)
        except DefinitionError as error:
            raise DefinitionError(f"`{line}`: {error}") from None
        if len(members) > _MAX_MEMBERS:
            raise DefinitionError(f"more than {_MAX_MEMBERS} fields")
    return Definition(tuple(members.values()) or (EMPTY,), constants)


def declarations(text: str) -> list[str]:
    """The lines of a definition that declare something, without comments and with single spaces."""
    lines = (_without_comment(line) for line in text.splitlines())
    return [line for line in lines if line]


def _without_comment(line: str) -> str:
    """A `#` within quotes begins no comment. Spaces in quotes stay."""
    kept, at = "", 0
    while at < len(line) and line[at] != "#":
        # Only a value is quoted: an apostrophe in a comment stands behind its `#`.
        quoted = _QUOTED.match(line, at) if line[at] in "'\"" else None
        if quoted is None and line[at].isspace():
            kept += "" if kept.endswith(" ") or not kept else " "
        else:
            kept += quoted[0] if quoted is not None else line[at]
        at = quoted.end() if quoted is not None else at + 1
    return kept.strip()


def _declare(line: str, package: str, members: dict[str, Member], constants: dict[str, Constant]) -> None:
    parts = _LINE.fullmatch(line)
    found = _TYPE.fullmatch(parts[1]) if parts is not None else None
    if parts is None or found is None:
        raise DefinitionError("not a type and a name")
    name, value = parts[2], parts[4]
    if parts[3]:
        if (
            not _CONSTANT.fullmatch(name)
            or found[3]
            or (found[1] not in SIZES and found[1] not in ("string", "wstring"))
        ):
            raise DefinitionError("not a constant of a number or a string, in capitals")
        constants[name] = _value(found[1], value)
        return
    if not _FIELD.fullmatch(name):
        raise DefinitionError("a name has lower-case letters, digits and single underscores")
    if name in members:
        raise DefinitionError("a second field of this name")
    members[name] = _member(found, name, value, package)


def _member(found: re.Match[str], name: str, value: str, package: str) -> Member:
    base, text_bound, array, bounded, count = found.groups()
    if text_bound and base not in ("string", "wstring"):
        raise DefinitionError("only strings have a length")
    numbers = [int(n) for n in (text_bound, count) if n]
    if any(not 0 < n <= _MAX_COUNT for n in numbers) or (bounded and not count):
        raise DefinitionError(f"a length is a number from 1 to {_MAX_COUNT}")
    is_sequence = array is not None and (bool(bounded) or not count)
    type_ = base
    if base not in SIZES and base not in ("string", "wstring"):
        type_ = full_name(base) if "/" in base else _HEADER if base == "Header" else f"{package}/msg/{base}"
        if value:
            raise DefinitionError("a message has no default")
    return Member(
        name,
        type_,
        count=int(count) if array is not None and not is_sequence else 0,
        sequence=is_sequence,
        bound=int(count) if bounded else 0,
        text_bound=int(text_bound or 0),
        default=_default(type_, value, array is not None),
    )


def _default(type_: str, text: str, is_list: bool) -> tuple[Constant, ...]:
    if not text:
        return ()
    if not is_list:
        return (_value(type_, text),)
    if not (text.startswith("[") and text.endswith("]")):
        raise DefinitionError("the default of a list is written in brackets")
    inside = text[1:-1]
    items = _QUOTED.findall(inside) if type_ in ("string", "wstring") else inside.split(",") if inside.strip() else []
    return tuple(_value(type_, item.strip()) for item in items)


def _value(type_: str, text: str) -> Constant:
    if type_ in ("string", "wstring"):
        quoted = _QUOTED.fullmatch(text)
        return re.sub(r"\\(['\"\\])", r"\1", text[1:-1]) if quoted is not None else text
    try:
        if type_ == "bool":
            return _BOOLS[text]
        return float(text) if type_.startswith("float") else int(text, 0)
    except (ValueError, KeyError):
        raise DefinitionError(f"`{text[:40]}` is not a {type_}") from None
