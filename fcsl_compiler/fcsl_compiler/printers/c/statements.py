# SPDX-License-Identifier: Apache-2.0
"""C of statements and functions."""

from __future__ import annotations

from ...model import code
from ..statements import Statements
from .expressions import CExpressions, constant_declarator, declarator, literal, type_name, zero
from .writer import CWriter

_ATTRIBUTES = {
    "always": "static inline __attribute__((always_inline))",
    "hint": "static inline",
    "usual": "static",
    "never": "static __attribute__((noinline))",
    "rare": "static __attribute__((cold, noinline))",
}


def initializer(values: code.Values) -> str:
    if isinstance(values, tuple):
        return "{" + ", ".join(map(initializer, values)) + "}"
    return literal(values) if isinstance(values, code.Literal) else values.text


def prototype(f: code.Function) -> str:
    """Result, name and parameters."""
    parameters = ", ".join(declarator(type_, name) for name, type_ in f.parameters) or "void"
    return f"{'void' if f.result is None else type_name(f.result)} {f.name}({parameters})"


class CStatements(Statements):
    """Writes statements and functions."""

    w: CWriter
    e: CExpressions
    end = ";"
    scope = ""
    discard = "(void)"
    else_if = "else if"

    def __init__(self, writer: CWriter, expressions: CExpressions):
        self.w, self.e = writer, expressions

    def function(self, f: code.Function) -> None:
        w = self.w
        w.origin = f.span
        is_declared = f.exported and not f.in_header
        if f.comment and not is_declared:
            w.line(f"/* {f.comment} */")
        head = "" if is_declared else _ATTRIBUTES["hint" if f.in_header else f.inline] + " "
        if f.flatten:
            head = (
                "static __attribute__((noinline, flatten)) "
                if f.inline == "never"
                else "static __attribute__((flatten)) "
            )
        w.line(head + prototype(f))
        self._nested("", f.body)
        w.origin = None
        w.line()

    def table(self, s: code.Table) -> None:
        self._line(f"static {constant_declarator(s.type, s.name)} = {initializer(s.values)}")

    def _condition(self, e: code.Expr) -> str:
        return f"({self.e.bare(e)})"

    def _let(self, s: code.Let) -> None:
        self._line(f"{constant_declarator(s.type, s.name)} = {self.e.bare(s.value)}")

    def _var(self, s: code.Var) -> None:
        value = self.e.bare(s.value) if s.value is not None else zero(s.type) if s.zeroed else ""
        comment = f" /* {s.comment} */" if s.comment else ""
        self.w.line(f"{declarator(s.type, s.name)}{f' = {value}' if value else ''};{comment}")

    def _clear(self, s: code.Clear) -> None:
        to = self.e.elements(s.place)
        if isinstance(s.type, code.Block):
            self._line(f"memset({to}, 0, {s.type.count} * sizeof({type_name(s.type)}))")
        else:
            self._line(f"memset({to}, 0, sizeof *{to})")

    def _store(self, s: code.Set) -> None:
        self._line(f"*(volatile int32_t *)&{self.e.text(s.place)} = {self.e.bare(s.value)}")

    def _update(self, s: code.Update) -> None:
        self._line(f"{self.e.text(s.place)} {s.symbol}= {self.e.bare(s.value)}")

    def _copy(self, s: code.Copy) -> None:
        ends = f"{self.e.elements(s.to)}, {self.e.elements(s.source)}"
        self._line(f"memcpy({ends}, {s.type.count} * sizeof({type_name(s.type)}))")

    def _unused(self, s: code.Unused) -> None:
        self._line(f"(void){s.name}")

    def _select(self, s: code.Select) -> None:
        w = self.w
        w.open(f"switch ({self.e.bare(s.value)})")
        for constant, body in s.cases:
            w.line(f"case {constant.text}:")
            with w.indented():
                self.body(body)
                w.line("break;")
        w.line("default:")
        w.line("    break;")
        w.close()

    def _count(self, s: code.Count) -> None:
        self._loop(f"int32_t {s.name} = 0; {s.name} < {s.count}; ++{s.name}", s)

    def _for(self, s: code.For) -> None:
        relation = "<" if s.step > 0 else ">"
        ends = f"int64_t {s.name} = {self.e.bare(s.start)}; {s.name} {relation} {self.e.bare(s.stop)}"
        self._loop(f"{ends}; {s.name} += {s.step}", s)

    def _loop(self, head: str, s: code.Count | code.For) -> None:
        if s.unroll:
            self.w.line(f"#pragma GCC unroll {s.unroll}")
        self._nested(f"for ({head})", s.body)
