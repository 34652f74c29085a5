# SPDX-License-Identifier: Apache-2.0
"""Structs of the machine JSON: `"Pose": {"position": "f64[3] m", "valid": "bool"}`."""

from __future__ import annotations

import re

from ..base.source import MAX_NAME, Span
from ..check.scope import LANGUAGE_NAMES
from ..model.c_names import C_KEYWORDS
from ..model.ros_names import ros_field
from ..model.types import SCALARS, Member, Struct, TypeNames, TypeSyntaxError, check_size, parse_type
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode

_NAME = re.compile(r"[A-Z][A-Za-z0-9]*")
_MEMBER = re.compile(r"[a-z](_?[a-z0-9])*")
#: Maximum nesting of structs. They are resolved recursively.
_MAX_DEPTH = 32


def read_structs(node: JsonNode | None, reader: ConfigReader) -> dict[str, Struct]:
    """All structs by name, in dependency order. A struct with a reported error has its valid members."""
    structs = _Structs(reader.named(node, "`structs`"), reader)
    for name in structs.definitions:
        structs.resolve(name, ())
    return structs.found


def _written(definition: JsonNode) -> int:
    return len(definition.members) if definition.kind == "object" else 1


class _Structs:
    def __init__(self, definitions: dict[str, tuple[JsonNode, Span]], reader: ConfigReader):
        self.definitions, self.reader = definitions, reader
        self.found: dict[str, Struct] = {}
        self.levels: dict[str, int] = {}  # structs one in another, itself included

    def resolve(self, name: str, outside: tuple[str, ...]) -> None:
        """Resolves a struct after the structs it contains. `outside`: the chain of structs that contain it."""
        definition, span = self.definitions[name]
        if name in self.found:
            return
        if not self._check_name(name, span):
            self.found[name], self.levels[name] = Struct(name, (), partial=True, span=span), 1
            return
        self.levels[name] = 1
        members: list[Member] = []
        for member, (text_node, at) in self.reader.named(definition, f"struct `{name}`").items():
            text = self.reader.string(text_node, f"the type of `{member}`", "f64[3] rad/s")
            if text is None or not self._member_name(member, at):
                continue
            same = next((m.name for m in members if ros_field(m.name) == ros_field(member)), "")
            if same:
                message = f"`{member}` and `{same}` would be one field of a ROS 2 message"
                self._error(message, at, "fields are in lower case; use another name")
                continue
            found = self._member(name, member, text, text_node.span, (*outside, name))
            if found is not None:
                members.append(found)
        if definition.kind == "object" and not definition.members:
            self._error(f"struct `{name}` has no members", span, 'such as `"position": "f64[3] m"`')
        self.found[name] = Struct(name, tuple(members), len(members) < _written(definition), span)

    def _member(self, struct: str, member: str, text: str, span: Span, outside: tuple[str, ...]) -> Member | None:
        inner = re.match(r"\s*(\w+)", text)
        if inner and inner.group(1) in self.definitions:
            chain = [*outside, inner.group(1)]
            if inner.group(1) in outside:
                self._error(f"`{struct}` would contain itself: {' → '.join(chain)}", span, "a value has a fixed size")
                return None
            if len(outside) <= _MAX_DEPTH:
                self.resolve(inner.group(1), outside)
            if len(outside) > _MAX_DEPTH or self.levels[inner.group(1)] > _MAX_DEPTH:
                self._error(f"structs nested deeper than {_MAX_DEPTH}", span, "flatten them")
                return None
            self.levels[struct] = max(self.levels[struct], self.levels[inner.group(1)] + 1)
        try:
            type_, unit = parse_type(text, TypeNames({}, self.found), True)
            check_size(type_)
        except TypeSyntaxError as error:
            self._error(str(error.args[0]), span, str(error.args[1]))
            return None
        return Member(member, type_, unit)

    def _check_name(self, name: str, span: Span) -> bool:
        """Checks the name of a struct. Returns False after reporting a name of the language."""
        if name in LANGUAGE_NAMES or name in SCALARS:
            self._error(f"`{name}` is a name of the language", span, "use another name")
            return False
        if not _NAME.fullmatch(name) or len(name) > MAX_NAME:
            self._error(
                f"`{name}` cannot be the name of a struct", span, "write it in CamelCase: it becomes a ROS 2 message"
            )
        return True

    def _member_name(self, name: str, span: Span) -> bool:
        if ros_field(name) in C_KEYWORDS:
            self._error(f"`{name}` is a keyword of C or C++", span, "use another name")
        elif not _MEMBER.fullmatch(ros_field(name)) or len(name) > MAX_NAME:
            fix = "a name begins with a letter, and single underscores separate letters and digits"
            self._error(f"`{name}` cannot be the name of a member", span, fix)
        else:
            return True
        return False

    def _error(self, message: str, span: Span, help: str) -> None:
        self.reader.sink.error("E232", message, span, help=help)
