# SPDX-License-Identifier: Apache-2.0
"""JSON parser (RFC 8259) that records the span of every key and value. Rejects Python's extensions (NaN, duplicate
keys)."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from dataclasses import dataclass

from ..base.diagnostics import DiagnosticSink
from ..base.source import SourceFile, Span

#: Maximum nesting depth. It bounds the use of the stack.
MAX_DEPTH = 64


@dataclass(frozen=True)
class Member:
    """One `key: value` of an object."""

    key: str
    key_span: Span
    value: JsonNode


@dataclass(frozen=True)
class JsonNode:
    """kind: object, array, string, int, float, bool or null. `value`: members, items or the Python scalar."""

    kind: str
    span: Span
    value: object
    text: str = ""  # source text of a number; of a string that parse/parts.py replaced: that of the file

    @property
    def members(self) -> dict[str, Member]:
        assert self.kind == "object" and isinstance(self.value, dict)
        return self.value

    @property
    def items(self) -> list[JsonNode]:
        assert self.kind == "array" and isinstance(self.value, list)
        return self.value

    @property
    def is_number(self) -> bool:
        return self.kind in ("int", "float")

    @property
    def written(self) -> str:
        """A string as its file has it."""
        return self.text or str(self.value)

    def get(self, key: str) -> JsonNode | None:
        """Value of `key`. None if this is not an object or lacks the key."""
        if self.kind != "object":
            return None
        member = self.members.get(key)
        return member.value if member else None


def article(kind: str) -> str:
    """A kind of node with its article."""
    return {"int": "an integer", "object": "an object", "array": "a list", "null": "null"}.get(kind, f"a {kind}")


class _SyntaxError(Exception):
    def __init__(self, message: str, start: int, end: int, help_text: str = ""):
        self.message, self.start, self.end, self.help = message, start, end, help_text


_SPACE = re.compile(r"[ \t\n\r]*")
_NUMBER = re.compile(r"-?(?:0|[1-9][0-9]*)(\.[0-9]+)?([eE][+-]?[0-9]+)?")
_STRING = re.compile(r'"(?:[^"\\\x00-\x1f]|\\(?:["\\/bfnrt]|u[0-9a-fA-F]{4}))*"')
_WORD = re.compile(r"[A-Za-z_+.][A-Za-z0-9_+.\-]*|'[^'\n]*'?|.", re.DOTALL)
_NO_COMMENTS = "JSON has no comments"
_LITERALS: dict[str, tuple[str, object]] = {"true": ("bool", True), "false": ("bool", False), "null": ("null", None)}


def parse_json(source: SourceFile, sink: DiagnosticSink, start: int = 0) -> JsonNode | None:
    """Parses the text from character `start` to its end. Reports E101 (syntax) or E102 (duplicate key). Returns None
    after a syntax error."""
    parser = _Parser(source, sink)
    parser.at = start
    try:
        node = parser.value(0)
        parser.skip()
        if parser.at < len(source.text):
            raise _SyntaxError("text after the end of the JSON value", parser.at, parser.at + 1)
    except _SyntaxError as error:
        sink.error("E101", error.message, source.span(error.start, error.end), help=error.help)
        return None
    return node


def text_without(source: SourceFile, root: JsonNode, keys: Collection[str]) -> str:
    """The text without these members of its root object and the commas that come with them."""
    members = list(root.members.values())
    text, end = "", 0
    is_first = True  # of those that stay
    for at, member in enumerate(members):
        own = source.offsets(member.key_span)[0], source.offsets(member.value.span)[1]
        if member.key in keys:
            text += source.text[end : own[0]] if at == 0 else ""
        else:
            text += source.text[own[0] : own[1]] if is_first and at else source.text[end : own[1]]
            is_first = False
        end = own[1]
    return text + source.text[end:]


class _Parser:
    def __init__(self, source: SourceFile, sink: DiagnosticSink):
        self.source, self.text, self.sink, self.at = source, source.text, sink, 0

    def skip(self) -> None:
        match = _SPACE.match(self.text, self.at)
        assert match
        self.at = match.end()

    def value(self, depth: int) -> JsonNode:
        self.skip()
        if depth > MAX_DEPTH:
            fix = "a machine needs fewer than ten"
            raise _SyntaxError(f"nested deeper than {MAX_DEPTH} levels", self.at, self.at + 1, fix)
        start = self.at
        char = self.text[start : start + 1]
        if char == "{":
            return self._object(depth)
        if char == "[":
            return self._array(depth)
        if char == '"':
            text, span = self._string()
            return JsonNode("string", span, text)
        match = _NUMBER.match(self.text, start)
        if match and match.end() > start:
            return self._number(match)
        return self._literal()

    def _number(self, match: re.Match[str]) -> JsonNode:
        self.at = match.end()
        span = self.source.span(match.start(), match.end())
        if match.end() - match.start() > 400:
            raise _SyntaxError("a number longer than 400 digits", match.start(), match.end())
        if match.group(1) is None and match.group(2) is None:
            return JsonNode("int", span, int(match.group()), match.group())
        number = float(match.group())
        if number in (float("inf"), float("-inf")):
            raise _SyntaxError("number beyond the range of f64", match.start(), match.end())
        return JsonNode("float", span, number, match.group())

    def _literal(self) -> JsonNode:
        start = self.at
        if start >= len(self.text):
            raise _SyntaxError("the file ends where a value is expected", max(0, start - 1), start)
        match = _WORD.match(self.text, start)
        assert match
        word = match.group()
        if word in _LITERALS:
            self.at = match.end()
            kind, value = _LITERALS[word]
            return JsonNode(kind, self.source.span(start, match.end()), value)
        fix = ""
        if word.startswith("'"):
            fix = 'JSON strings are in double quotes: "…"'
        elif word in ("True", "False", "None"):
            fix = f"JSON writes `{ {'True': 'true', 'False': 'false', 'None': 'null'}[word] }`"
        elif word.lstrip("+").lower() in ("nan", "inf", "infinity"):
            fix = "every number of a machine is finite"
        elif word.startswith(("+", ".")):
            fix = "a JSON number begins with a digit or `-`"
        elif word in ("/", "#"):
            fix = _NO_COMMENTS
        elif word in ("}", "]"):
            fix = "remove the comma before it" if self.text[:start].rstrip().endswith(",") else ""
        raise _SyntaxError(f"expected a JSON value, found `{word}`", start, match.end(), fix)

    def _string(self) -> tuple[str, Span]:
        match = _STRING.match(self.text, self.at)
        if not match:
            end = self.text.find("\n", self.at)
            raise _SyntaxError(
                "unterminated or malformed string",
                self.at,
                len(self.text) if end < 0 else end,
                "close it with a double quote",
            )
        self.at = match.end()
        written = match.group()
        text = json.loads(written) if "\\" in written else written[1:-1]
        if not text.isascii() and any(0xD800 <= ord(c) <= 0xDFFF for c in text):
            raise _SyntaxError("a surrogate is not a character", match.start(), match.end())
        return text, self.source.span(match.start(), match.end())

    def _object(self, depth: int) -> JsonNode:
        start = self.at
        self.at += 1
        members: dict[str, Member] = {}
        self.skip()
        if self.text[self.at : self.at + 1] == "}":
            self.at += 1
            return JsonNode("object", self.source.span(start, self.at), members)
        while True:
            self.skip()
            if self.text[self.at : self.at + 1] != '"':
                fix = {"}": "remove the comma before it", "/": _NO_COMMENTS, "#": _NO_COMMENTS}.get(self._here())
                message = f"expected a key, found {self._found()}"
                if not fix:
                    fix = "keys are strings in double quotes" if self._here() else "close the object with `}`"
                raise _SyntaxError(message, self.at, self.at + 1, fix)
            key, key_span = self._string()
            self.skip()
            self._expect(":", "after a key")
            value = self.value(depth + 1)
            if key in members:
                self.sink.error(
                    "E102",
                    f"duplicate key `{key}`",
                    key_span,
                    notes=[(members[key].key_span, "first given here")],
                    help="keep one of the two",
                )
            else:
                members[key] = Member(key, key_span, value)
            if self._more("}"):
                continue
            return JsonNode("object", self.source.span(start, self.at), members)

    def _array(self, depth: int) -> JsonNode:
        start = self.at
        self.at += 1
        items: list[JsonNode] = []
        self.skip()
        if self.text[self.at : self.at + 1] == "]":
            self.at += 1
            return JsonNode("array", self.source.span(start, self.at), items)
        while True:
            items.append(self.value(depth + 1))
            if self._more("]"):
                continue
            return JsonNode("array", self.source.span(start, self.at), items)

    def _expect(self, char: str, where: str) -> None:
        if self.text[self.at : self.at + 1] != char:
            raise _SyntaxError(f"expected `{char}` {where}, found {self._found()}", self.at, self.at + 1)
        self.at += 1

    def _more(self, close: str) -> bool:
        self.skip()
        char = self.text[self.at : self.at + 1]
        if char == close:
            self.at += 1
            return False
        if char == ",":
            self.at += 1
            return True
        fix = (
            _NO_COMMENTS
            if char in ("/", "#")
            else "a comma is missing before this"
            if char
            else f"close it with `{close}`"
        )
        raise _SyntaxError(f"expected `,` or `{close}`, found {self._found()}", self.at, self.at + 1, fix)

    def _here(self) -> str:
        return self.text[self.at : self.at + 1]

    def _found(self) -> str:
        return f"`{self._here()}`" if self._here() else "the end of the file"
