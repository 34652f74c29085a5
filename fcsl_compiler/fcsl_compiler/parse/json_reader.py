# SPDX-License-Identifier: Apache-2.0
"""Reads JSON configuration and reports errors: objects with known keys, numbers in range, names, values of a type."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ..base.diagnostics import DiagnosticSink, misspelt, nearest
from ..base.source import MAX_NAME, Span
from ..model.literals import LiteralError, fit
from ..model.types import BOOL, HEALTH, HEALTH_NAMES, REQUEST, Array, Scalar, Struct, Type
from .json_source import JsonNode

#: Valid user-defined names. They become parts of C identifiers and of paths.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")


def is_name(text: str) -> bool:
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


class Everything(set[str]):
    """A set of names that could not be read: it contains every name."""

    def __contains__(self, name: object) -> bool:
        return True

    def __bool__(self) -> bool:
        return True


class ConfigReader:
    """Methods check one node. If it is invalid they report the error and return None or an empty value."""

    def __init__(self, sink: DiagnosticSink):
        self.sink = sink
        #: Requests that values in the JSON name, with their first use.
        self.requests: dict[str, Span] = {}

    def object(
        self,
        node: JsonNode,
        what: str,
        required: Sequence[str],
        optional: Sequence[str] = (),
    ) -> dict[str, JsonNode] | None:
        """Values by key. Reports unknown and missing keys. Returns None if the node is not an object."""
        if node.kind != "object":
            keys = ", ".join(f'"{key}": …' for key in required or optional[:1])
            self.wrong(node, f"{what} is an object", f"{{{keys}}}")
            return None
        known = [*required, *optional]
        values: dict[str, JsonNode] = {}
        for key, member in node.members.items():
            if key in known:
                values[key] = member.value
            elif not self.sink.full:
                meant = misspelt(key, known)
                hint = f"did you mean `{meant}`?" if meant else f"the keys of {what} are {', '.join(known)}"
                self.sink.error("E201", f"unknown key `{key}` in {what}", member.key_span, help=hint)
                if meant and meant not in node.members:  # continue as if the key were spelled correctly
                    values.setdefault(meant, member.value)
        for key in required:
            if key not in values:
                self.sink.error("E202", f"{what} has no `{key}`", node.span, help=f'add `"{key}": …`')
        return values

    def named(self, node: JsonNode | None, what: str) -> dict[str, tuple[JsonNode, Span]]:
        """An object with user-defined names as keys. Invalid names are reported, but stay in the result."""
        if node is None:
            return {}
        if node.kind != "object":
            self.wrong(node, f"{what} is an object from name to definition", '{"name": …}')
            return {}
        found: dict[str, tuple[JsonNode, Span]] = {}
        for key, member in node.members.items():
            if not is_name(key):
                fix = f"letters, digits and single underscores between them, {MAX_NAME} at most; a letter first"
                self.sink.error("E203", f"`{key}` is not a name", member.key_span, help=fix)
            found[key] = (member.value, member.key_span)
        return found

    def list(self, node: JsonNode | None, what: str) -> list[JsonNode]:
        if node is None:
            return []
        if node.kind != "array":
            self.wrong(node, f"{what} is a list", "[…]")
            return []
        return node.items

    def string(self, node: JsonNode | None, what: str, example: str = "…") -> str | None:
        if node is None:
            return None
        if node.kind != "string":
            self.wrong(node, f"{what} is a string", f'"{example}"')
            return None
        return str(node.value)

    def integer(self, node: JsonNode | None, what: str, low: int, high: int) -> int | None:
        if node is None:
            return None
        if node.kind != "int" or not isinstance(node.value, int):
            self.wrong(node, f"{what} is an integer", "it without quotes and decimal point")
            return None
        if not low <= node.value <= high:
            self.sink.error("E204", f"{what} is {node.value}", node.span, help=f"it must be in [{low}, {high}]")
            return None
        return node.value

    def boolean(self, node: JsonNode | None, what: str) -> bool | None:
        if node is None:
            return None
        if node.kind != "bool":
            self.wrong(node, f"{what} is true or false", "it without quotes")
            return None
        return bool(node.value)

    def number(self, node: JsonNode | None, what: str, low: float, high: float) -> float | None:
        """A finite number in [low, high]."""
        if node is None:
            return None
        if not node.is_number or not isinstance(node.value, int | float):
            self.wrong(node, f"{what} is a number", "")
            return None
        if not low <= node.value <= high:
            self.sink.error("E204", f"{what} is {node.value}", node.span, help=f"it must be in [{low:g}, {high:g}]")
            return None
        return float(node.value)

    def choice(self, node: JsonNode | None, what: str, choices: Sequence[str]) -> str | None:
        text = self.string(node, what)
        if text is None or node is None:
            return None
        if text not in choices:
            hint = nearest(text, choices) or f"one of {', '.join(choices)}"
            self.sink.error("E205", f"{what} cannot be `{text}`", node.span, help=hint)
            return None
        return text

    def reference(self, node: JsonNode | None, what: str, names: Sequence[str]) -> int | None:
        """Index in `names` of the name that `node` holds. None after reporting an unknown name."""
        text = self.string(node, what)
        if text is None or node is None:
            return None
        if text not in names:
            hint = nearest(text, names) or (f"there are {', '.join(names)}" if names else "there are none")
            self.sink.error("E206", f"no {what} `{text}`", node.span, help=hint)
            return None
        return list(names).index(text)

    def value(self, node: JsonNode, type_: Type, what: str) -> tuple[bool | int | float | str, ...] | None:
        """A literal of type `type_`, as scalars in the order of its leaves."""
        if isinstance(type_, Struct):
            return self._struct(node, type_, what)
        if isinstance(type_, Array):
            if node.kind != "array" or len(node.items) != type_.shape[0]:
                have = f"a list of {len(node.items)}" if node.kind == "array" else _article(node.kind)
                self.sink.error("E207", f"{what} is {type_}, not {have}", node.span, help=f"write {example(type_)}")
                return None
            if len(type_.shape) == 1 and any(item.kind == "array" for item in node.items):
                self.sink.error(
                    "E207", f"{what} is {type_}, not a list of lists", node.span, help=f"write {example(type_)}"
                )
                return None
            rest: Type = Array(type_.element, type_.shape[1:]) if len(type_.shape) > 1 else type_.element
            parts = [self.value(item, rest, what) for item in node.items]
            return None if any(p is None for p in parts) else tuple(v for p in parts if p is not None for v in p)
        return self._scalar(node, type_, what)

    def _struct(self, node: JsonNode, type_: Struct, what: str) -> tuple[bool | int | float | str, ...] | None:
        if type_.partial:
            return None
        if node.kind != "object":
            fix = "write {" + ", ".join(f'"{m.name}": …' for m in type_.members) + "}"
            self.sink.error("E207", f"{what} is {type_}, not {_article(node.kind)}", node.span, help=fix)
            return None
        keys = self.object(node, f"{what} ({type_})", [m.name for m in type_.members]) or {}
        values: list[bool | int | float | str] = []
        complete = keys.keys() == node.members.keys() and len(keys) == len(type_.members)
        for member in type_.members:
            part = self.value(keys[member.name], member.type, f"{what}.{member.name}") if member.name in keys else None
            complete &= part is not None
            values += part or ()
        return tuple(values) if complete else None

    def _scalar(self, node: JsonNode, type_: Scalar, what: str) -> tuple[bool | int | float | str, ...] | None:
        if type_ is BOOL:
            if node.kind == "bool":
                return (bool(node.value),)
        elif type_ is REQUEST:
            name = self.string(node, what)
            if name:
                self.requests.setdefault(name, node.span)
            return None if name is None else (name,)
        elif type_ is HEALTH:
            word = self.choice(node, what, HEALTH_NAMES)
            return None if word is None else (HEALTH_NAMES.index(word),)
        elif node.is_number and isinstance(node.value, int | float):
            try:
                number = fit(node.value, type_)
                if not isinstance(number, float) or math.isfinite(number):
                    return (number,)
            except LiteralError as error:
                if type_.is_integer and node.kind == "float":
                    fix = f"write {int(node.value)}" if node.value == int(node.value) else "write an integer"
                    self.sink.error("E207", f"{what} is {type_}, not a number with a point", node.span, help=fix)
                    return None
                self.sink.error("E207", f"{what}: {error.args[0]}", node.span, help=str(error.args[1]))
                return None
        fix = "true or false" if type_ is BOOL else "an integer" if type_.is_integer else "a finite number"
        self.sink.error("E207", f"{what} is {type_}, not {_article(node.kind)}", node.span, help=f"write {fix}")
        return None

    def wrong(self, node: JsonNode, message: str, fix: str) -> None:
        self.sink.error("E208", f"{message}, not {_article(node.kind)}", node.span, help=f"write {fix}" if fix else "")


def _article(kind: str) -> str:
    return {"int": "an integer", "object": "an object", "array": "a list", "null": "null"}.get(kind, f"a {kind}")


def example(type_: Scalar | Array) -> str:
    """A value of this type, to write in the JSON."""
    element, shape = (type_, ()) if isinstance(type_, Scalar) else (type_.element, type_.shape)
    if isinstance(element, Struct) or math.prod(shape) > 16:
        return f"a list of {shape[0]}"
    inner = "0.0" if element.is_float else {BOOL: "false", HEALTH: '"nominal"', REQUEST: '""'}.get(element, "0")
    for extent in reversed(shape):
        inner = "[" + ", ".join([inner] * extent) + "]"
    return inner
