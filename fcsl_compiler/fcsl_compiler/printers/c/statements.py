# SPDX-License-Identifier: Apache-2.0
"""C of statements and functions."""

from __future__ import annotations

from ...model import code
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


class CStatements:
    """Writes statements and functions."""

    def __init__(self, writer: CWriter, expressions: CExpressions):
        self.w, self.e = writer, expressions

    def function(self, f: code.Function) -> None:
        w = self.w
        w.origin = f.span
        if f.comment and not f.exported:
            w.line(f"/* {f.comment} */")
        head = "" if f.exported else _ATTRIBUTES[f.inline] + " "
        if f.flatten:
            head = (
                "static __attribute__((noinline, flatten)) "
                if f.inline == "never"
                else "static __attribute__((flatten)) "
            )
        w.line(head + prototype(f))
        w.open_body()
        self.body(f.body)
        w.close()
        w.origin = None
        w.line()

    def table(self, s: code.Table) -> None:
        self.w.line(f"static {constant_declarator(s.type, s.name)} = {initializer(s.values)};")

    def body(self, statements: code.Body) -> None:
        for s in statements:
            self._statement(s)

    def _statement(self, s: code.Statement) -> None:
        w, e = self.w, self.e
        if isinstance(s, code.At):
            self._at(s)
        elif isinstance(s, code.Let):
            w.line(f"{constant_declarator(s.type, s.name)} = {e.bare(s.value)};")
        elif isinstance(s, code.Var):
            self._var(s)
        elif isinstance(s, code.Table):
            self.table(s)
        elif isinstance(s, code.Set):
            place = f"*(volatile int32_t *)&{e.text(s.place)}" if s.volatile else e.text(s.place)
            w.line(f"{place} = {e.bare(s.value)};")
        elif isinstance(s, code.Update):
            w.line(f"{e.text(s.place)} {s.symbol}= {e.bare(s.value)};")
        elif isinstance(s, code.Copy):
            ends = f"{e.elements(s.to)}, {e.elements(s.source)}"
            w.line(f"memcpy({ends}, {s.type.count} * sizeof({type_name(s.type)}));")
        elif isinstance(s, code.Clear):
            self._clear(s)
        elif isinstance(s, code.Do):
            w.line(f"{'(void)' if s.unused else ''}{e.text(s.call)};")
        elif isinstance(s, code.Unused):
            w.line(f"(void){s.name};")
        elif isinstance(s, code.If):
            w.open(f"if ({e.bare(s.condition)})")
            self._branches(s)
        elif isinstance(s, code.Select):
            self._select(s)
        elif isinstance(s, code.Count):
            self._loop(f"int32_t {s.name} = 0; {s.name} < {s.count}; ++{s.name}", s)
        elif isinstance(s, code.For):
            relation = "<" if s.step > 0 else ">"
            ends = f"int64_t {s.name} = {e.bare(s.start)}; {s.name} {relation} {e.bare(s.stop)}"
            self._loop(f"{ends}; {s.name} += {s.step}", s)
        elif isinstance(s, code.Scope):
            with w.braces(""):
                self.body(s.body)
        elif isinstance(s, code.Return):
            w.line("return;" if s.value is None else f"return {e.bare(s.value)};")
        else:
            w.line("break;" if isinstance(s, code.Break) else "continue;")

    def _at(self, s: code.At) -> None:
        if s.quoted and s.span is not None:
            self.w.at(s.span)
        else:
            self.w.origin = s.span

    def _var(self, s: code.Var) -> None:
        value = self.e.bare(s.value) if s.value is not None else zero(s.type) if s.zeroed else ""
        comment = f" /* {s.comment} */" if s.comment else ""
        self.w.line(f"{declarator(s.type, s.name)}{f' = {value}' if value else ''};{comment}")

    def _clear(self, s: code.Clear) -> None:
        to = self.e.elements(s.place)
        if isinstance(s.type, code.Block):
            self.w.line(f"memset({to}, 0, {s.type.count} * sizeof({type_name(s.type)}));")
        else:
            self.w.line(f"memset({to}, 0, sizeof *{to});")

    def _branches(self, s: code.If) -> None:
        """What follows the condition."""
        self.body(s.then)
        last = s.otherwise[-1] if s.otherwise else None
        if isinstance(last, code.If) and (s.otherwise == (last,) or self._is_chained(s.otherwise)):
            mark = s.otherwise[0]
            if isinstance(mark, code.At):
                self.w.origin = mark.span
            self.w.reopen(f"else if ({self.e.bare(last.condition)})")
            if isinstance(mark, code.At):
                self._at(mark)
            self._branches(last)
            return
        if s.otherwise:
            self.w.reopen("else")
            self.body(s.otherwise)
        self.w.close()

    def _is_chained(self, body: code.Body) -> bool:
        return len(body) == 2 and isinstance(body[0], code.At)

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

    def _loop(self, head: str, s: code.Count | code.For) -> None:
        if s.unroll:
            self.w.line(f"#pragma GCC unroll {s.unroll}")
        self.w.open(f"for ({head})")
        self.body(s.body)
        self.w.close()
