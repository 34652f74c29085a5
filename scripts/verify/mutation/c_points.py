# SPDX-License-Identifier: Apache-2.0
"""What may be mutated in a C file: operators, constants, statements and results inside of functions (tree-sitter's grammar of C)."""

from __future__ import annotations

from collections.abc import Iterator

import tree_sitter_c
from tree_sitter import Language, Node, Parser

from .mutants import Point, shown

_PARSER = Parser(Language(tree_sitter_c.language()))
#: Kind, and what an operator becomes.
BINARY: dict[str, tuple[tuple[str, str], ...]] = {
    "<": (("boundary", "<="), ("relation", ">=")),
    "<=": (("boundary", "<"), ("relation", ">")),
    ">": (("boundary", ">="), ("relation", "<=")),
    ">=": (("boundary", ">"), ("relation", "<")),
    "==": (("relation", "!="),),
    "!=": (("relation", "=="),),
    "&&": (("logic", "||"),),
    "||": (("logic", "&&"),),
    "+": (("arithmetic", "-"),),
    "-": (("arithmetic", "+"),),
    "*": (("arithmetic", "/"),),
    "/": (("arithmetic", "*"),),
    "%": (("arithmetic", "*"),),
    "&": (("arithmetic", "|"),),
    "|": (("arithmetic", "&"),),
    "^": (("arithmetic", "&"),),
    "<<": (("arithmetic", ">>"),),
    ">>": (("arithmetic", "<<"),),
}
ASSIGNED = {"+=": "-=", "-=": "+=", "|=": "&=", "&=": "|=", "<<=": ">>=", ">>=": "<<=", "*=": "/=", "/=": "*="}
#: Below these stand constant expressions, or what is none.
_CONSTANT = {"array_declarator", "enumerator", "subscript_designator", "bitfield_clause", "preproc_def", "preproc_if"}
_SWITCH = "{switch}"


def points(source: bytes) -> list[Point]:
    """Of every function of the file."""
    found: list[Point] = []
    for function in _functions(_PARSER.parse(source).root_node):
        body = function.child_by_field_name("body")
        if body is not None and not function.has_error:
            found += _Body(source, _returns_number(function)).walk(body)
    return found


def _functions(node: Node) -> Iterator[Node]:
    for child in node.children:
        if child.type == "function_definition":
            yield child
        elif child.type.startswith("preproc_"):
            yield from _functions(child)


def _returns_number(function: Node) -> bool:
    """Whether 0 may stand for its result: a number or a pointer, no struct."""
    declarator, kind = function.child_by_field_name("declarator"), function.child_by_field_name("type")
    if declarator is not None and declarator.type == "pointer_declarator":
        return True
    text = (kind.text or b"").decode() if kind is not None else ""
    return text != "void" and (kind is not None and kind.type in ("primitive_type", "sized_type_specifier"))


class _Body:
    """Walks one function."""

    def __init__(self, source: bytes, returns_number: bool):
        self._source = source
        self._returns_number = returns_number

    def _text(self, begin: int, end: int) -> str:
        return self._source[begin:end].decode()

    def _expression(self, node: Node, kind: str, after: str) -> Point:
        before = self._text(node.start_byte, node.end_byte)
        both = f"({_SWITCH} ? ({after}) : ({before}))"
        return Point(node.start_byte, node.end_byte, node.start_point[0] + 1, kind, shown(before), shown(after), both)

    def _replaced(self, node: Node, operator: Node, other: str) -> str:
        left = self._text(node.start_byte, operator.start_byte)
        return left + other + self._text(operator.end_byte, node.end_byte)

    def walk(self, node: Node) -> Iterator[Point]:
        yield from self._own(node)
        for child in node.children:
            is_label = node.type == "case_statement" and child == node.child_by_field_name("value")
            if child.type in _CONSTANT or is_label or self._is_static(child) or node.type == "sizeof_expression":
                continue
            yield from self.walk(child)

    @staticmethod
    def _is_static(node: Node) -> bool:
        return node.type == "declaration" and any(c.type == "storage_class_specifier" for c in node.children)

    def _own(self, node: Node) -> Iterator[Point]:
        operator = node.child_by_field_name("operator")
        sign = (operator.text or b"").decode() if operator is not None else ""
        if node.type == "binary_expression" and operator is not None:
            for kind, other in BINARY.get(sign, ()):
                yield self._expression(node, kind, self._replaced(node, operator, other))
        elif node.type == "unary_expression" and sign == "!":
            yield self._expression(node, "logic", self._text(node.start_byte + 1, node.end_byte))
        elif node.type == "number_literal":
            yield from self._constant(node)
        elif node.type in ("true", "false"):
            yield self._expression(node, "constant", "0" if node.type == "true" else "1")
        elif node.type == "return_statement":
            yield from self._result(node)
        elif node.type in ("expression_statement", "break_statement", "continue_statement"):
            yield from self._statement(node)

    def _constant(self, node: Node) -> Iterator[Point]:
        parent = node.parent
        inside = parent.parent if parent is not None and parent.type == "unary_expression" else parent
        if inside is not None and inside.type == "return_statement":
            return  # the result, below
        text = self._text(node.start_byte, node.end_byte)
        digits = text.rstrip("uUlLfF") if not text.lower().startswith("0x") else text.rstrip("uUlL")
        after = "0" + text[len(digits) :] if digits == "1" else f"{text} + 1"
        yield self._expression(node, "constant", after)

    def _result(self, node: Node) -> Iterator[Point]:
        values = [c for c in node.named_children if c.type != "comment"]
        if not self._returns_number or len(values) != 1 or values[0].type in ("null", "true", "false"):
            return
        text = self._text(values[0].start_byte, values[0].end_byte)
        yield self._expression(values[0], "result", "1" if text == "0" else "0")

    def _statement(self, node: Node) -> Iterator[Point]:
        """Without it. An assignment inside of an expression statement may also have another operator."""
        before = self._text(node.start_byte, node.end_byte)
        if before.startswith("(void)") or before == ";":
            return
        line = node.start_point[0] + 1
        begin, end = node.start_byte, node.end_byte
        yield Point(begin, end, line, "deletion", shown(before), "", f"if (!{_SWITCH}) {{ {before} }}")
        inner = node.named_children[0] if node.named_children else None
        operator = inner.child_by_field_name("operator") if inner is not None else None
        sign = (operator.text or b"").decode() if operator is not None else ""
        if inner is None or operator is None:
            return
        other = ASSIGNED.get(sign) if inner.type == "assignment_expression" else {"++": "--", "--": "++"}.get(sign)
        if other is not None:
            after = self._replaced(node, operator, other)
            both = f"if ({_SWITCH}) {{ {after} }} else {{ {before} }}"
            yield Point(begin, end, line, "arithmetic", shown(before), shown(after), both)
