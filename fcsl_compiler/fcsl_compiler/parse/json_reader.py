# SPDX-License-Identifier: Apache-2.0
"""Reads JSON configuration and reports errors: objects with known keys, numbers in range, names, values of a type."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from ..base.diagnostics import DiagnosticSink, misspelt, nearest
from ..base.source import MAX_NAME, SourceFile, Span
from .json_source import JsonNode, article

if TYPE_CHECKING:
    from ..model.types import Type
    from .constants import Constants

#: Valid user-defined names. They become parts of C identifiers and of paths.
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")


def is_name(text: str) -> bool:
    return len(text) <= MAX_NAME and _NAME.fullmatch(text) is not None


def _is_path(text: str) -> bool:
    """Whether it is the name of an instance, also of one in a part."""
    return len(text) <= MAX_NAME and all(map(is_name, text.split(".")))


def local_names(instances: Iterable[str], at: Span) -> list[str]:
    """The instances and parts that connections and schedules in the file of `at` can name."""
    prefix = f"{at.source.part}." if at.source.part else ""
    names = (name.removeprefix(prefix).partition(".")[0] for name in instances if name.startswith(prefix))
    return list(dict.fromkeys(names))


@dataclass
class Scope:
    """What texts in the file of a part may name: its constants, its requests with their names in the whole machine, and
    its structs, those of its own parts included."""

    constants: Constants | None = None
    requests: dict[str, str] = field(default_factory=dict)
    named: dict[str, Span] = field(default_factory=dict)  # where the requests get these names
    structs: set[str] = field(default_factory=set)


@dataclass(frozen=True)
class RequestUse:
    """The first use of a request: in which part, "" for none, and by which instance, "" if a value in the JSON names it."""

    span: Span
    part: str
    instance: str = ""


class Everything(set[str]):
    """A set of names that could not be read: it contains every name."""

    def __contains__(self, name: object) -> bool:
        return True

    def __bool__(self) -> bool:
        return True


class ConfigReader:
    """Methods check one node. If it is invalid they report the error and return None or an empty value."""

    def __init__(self, sink: DiagnosticSink, constants: Constants | None = None):
        """`constants`: a string in the place of a number is an expression of them."""
        self.sink, self.constants = sink, constants
        #: Files of parts.
        self.scopes: dict[SourceFile, Scope] = {}
        #: Requests that values in the JSON name.
        self.requests: dict[str, RequestUse] = {}
        #: Columns of files that values in the JSON name, with their numbers.
        self.columns: list[str] = []

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

    def named(self, node: JsonNode | None, what: str, instances: bool = False) -> dict[str, tuple[JsonNode, Span]]:
        """An object with user-defined names as keys. Invalid names are reported, but stay in the result. `instances`: names
        of these may have dots, behind the name of a part."""
        if node is None:
            return {}
        if node.kind != "object":
            self.wrong(node, f"{what} is an object from name to definition", '{"name": …}')
            return {}
        found: dict[str, tuple[JsonNode, Span]] = {}
        for key, member in node.members.items():
            if not (_is_path(key) if instances else is_name(key)):
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

    def computed(self, node: JsonNode, what: str, unit: str = "") -> JsonNode | None:
        """The value of an expression of constants in the place of a number; any other node itself. None after reporting
        an expression that has no value, or another unit."""
        constants = self.scope(node).constants if self.scopes else self.constants
        if node.kind != "string" or constants is None:
            return node
        from ..expression.tree import ExpressionError
        from .constants import report

        try:
            value = constants.value(str(node.value), unit)
        except ExpressionError as error:
            report(error, what, node.span, "write a number, or an expression of `constants`", self)
            return None
        return JsonNode("int" if isinstance(value, int) else "float", node.span, value, repr(value))

    def scope(self, node: JsonNode) -> Scope:
        """What the text of a node may name."""
        return self.scopes.get(node.span.source) or Scope(self.constants)

    def integer(self, node: JsonNode | None, what: str, low: int, high: int, unit: str = "") -> int | None:
        """`unit`: of the constants that it may be made of."""
        given = node
        node = self.computed(node, what, unit) if node is not None else None
        if node is None:
            return None
        if node.kind == "float" and given is not node:
            from .json_values import INTEGERS

            self.sink.error("E208", f"{what} is an integer, not {node.value}", node.span, help=INTEGERS)
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
        node = self.computed(node, what) if node is not None else None
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

    def value(
        self, node: JsonNode, type_: Type, what: str, unit: str = ""
    ) -> tuple[bool | int | float | str, ...] | None:
        """A literal of type `type_`, as scalars in the order of its leaves. `unit`: that of the field."""
        from .json_values import read_value  # here: an unchanged machine is found in the cache without its types

        return read_value(self, node, type_, what, unit)

    def use_request(self, name: str, span: Span, instance: str = "") -> None:
        """Notes that a value names a request. `instance`: whose default it is, if it does not stand in the JSON."""
        part = instance.rpartition(".")[0] if instance else span.source.part
        self.requests.setdefault(name, RequestUse(span, part, instance))

    def scheduled_twice(self, instance: str, state: str, at: Span, always: Span) -> None:
        """Reports an instance, or a part, that a state and `always` schedule."""
        message = f"`{instance}` is in `always`, so state `{state}` schedules it already"
        fix = "remove it here; or from `always`, and list it in every state that runs it"
        self.sink.error("E243", message, at, help=fix, notes=[(always, "scheduled in every state here")])

    def wrong(self, node: JsonNode, message: str, fix: str) -> None:
        self.sink.error("E208", f"{message}, not {article(node.kind)}", node.span, help=f"write {fix}" if fix else "")
