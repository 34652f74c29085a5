# SPDX-License-Identifier: Apache-2.0
"""Nim of statements and functions."""

from __future__ import annotations

from ...model import code
from ...model.types import I32, I64, Scalar
from .expressions import Module, NimExpressions
from .names import Names
from .writer import NimWriter


class NimStatements:
    """Writes the functions of a module. `helpers` collects the procs that they call."""

    def __init__(self, writer: NimWriter, module: Module, helpers: dict[str, str]):
        self.w, self.module, self.helpers = writer, module, helpers
        #: Identifiers of variables.
        self.variables: set[str] = set()

    def function(self, f: code.Function) -> None:
        w = self.w
        self.e = NimExpressions(self.module, self.helpers)
        self.e.indices |= {name for name, type_ in f.parameters if type_ is I64}
        w.origin = f.span
        parameters = ", ".join(f"{self.e.names.of(name)}: {self.module.type_name(t)}" for name, t in f.parameters)
        result = "" if f.result is None else f": {self.module.type_name(f.result)}"
        if f.comment and not f.exported:
            w.line(f"# {f.comment}")
        w.line(f"proc {self.module.proc_name(f)}({parameters}){result} {{.{self._pragmas(f)}.}} =")
        with w.indented():
            if f.exported:
                w.line(f"## {f.comment}")
            self.body(f.body)
        self.variables |= self.e.names.all()
        w.origin = None
        w.line()

    def _pragmas(self, f: code.Function) -> str:
        """Names in the library are those of the C backend, so all tools find them. The pragmas of `inline` are in
        module.py."""
        if f.exported:
            return f'exportc: "{f.name}", cdecl'
        inline = f.inline
        if f.flatten:
            inline = "flat_never" if f.inline == "never" else "flat"
        return f'exportc: "{f.name}", {inline}'

    def body(self, statements: code.Body) -> None:
        for s in statements:
            self._statement(s)
        if all(isinstance(s, code.At | code.Unused | code.Table) for s in statements):
            self.w.line("discard")

    def _nested(self, head: str, body: code.Body) -> None:
        self.w.line(f"{head}:")
        with self.w.indented():
            self.body(body)

    def _statement(self, s: code.Statement) -> None:
        w, e = self.w, self.e
        if isinstance(s, code.Count | code.For) or (isinstance(s, code.Let | code.Var) and s.type is I64):
            e.indices.add(s.name)
        if isinstance(s, code.At):
            self._at(s)
        elif isinstance(s, code.Let):
            # A record is not set to zero before it is copied.
            pragma = " {.noinit.}" if isinstance(s.type, code.Named) else ""
            value = e.bare(s.value)
            w.line(f"let {e.names.of(s.name)}{pragma}: {self.module.type_name(s.type)} = {value}")
        elif isinstance(s, code.Var):
            self._var(s)
        elif isinstance(s, code.Table):
            e.tables.add(s.name)
            print_table(w, self.module, s, e.names)
        elif isinstance(s, code.Set):
            self._set(s)
        elif isinstance(s, code.Update):
            place = e.text(s.place)
            w.line(f"{place} = {place} {s.symbol} {e.text(s.value)}")
        elif isinstance(s, code.Copy):
            self._copy(s)
        elif isinstance(s, code.Clear):
            w.line(f"zeroMem({e.text(code.Address(s.place))}, sizeof({self.module.type_name(s.type)}))")
        elif isinstance(s, code.Do):
            w.line(f"{'discard ' if s.unused else ''}{e.text(s.call)}")
        elif isinstance(s, code.Unused):
            pass
        elif isinstance(s, code.If):
            self._nested(f"if {e.bare(s.condition)}", s.then)
            self._otherwise(s.otherwise)
        elif isinstance(s, code.Select):
            self._select(s)
        elif isinstance(s, code.Count):
            self._count(s)
        elif isinstance(s, code.For):
            self._for(s)
        elif isinstance(s, code.Scope):
            self._nested("block", s.body)
        elif isinstance(s, code.Return):
            w.line("return" if s.value is None else f"return {e.bare(s.value)}")
        else:
            w.line("break" if isinstance(s, code.Break) else "continue")

    def _at(self, s: code.At) -> None:
        if s.quoted and s.span is not None:
            self.w.at(s.span)
        else:
            self.w.origin = s.span

    def _var(self, s: code.Var) -> None:
        name, type_ = self.e.names.of(s.name), self.module.type_name(s.type)
        value = "" if s.value is None else f" = {self.e.bare(s.value)}"
        pragma = "" if value or s.zeroed else " {.noinit.}"
        comment = f" # {s.comment}" if s.comment else ""
        self.w.line(f"var {name}{pragma}: {type_}{value}{comment}")

    def _copy(self, s: code.Copy) -> None:
        if isinstance(s.to, code.Part) or isinstance(s.source, code.Part):
            ends = ", ".join(self.e.text(code.Address(end, block=True)) for end in (s.to, s.source))
            self.w.line(f"copyMem({ends}, sizeof({self.module.type_name(s.type)}))")
        else:
            self.w.line(f"{self.e.text(s.to)} = {self.e.text(s.source)}")

    def _set(self, s: code.Set) -> None:
        if s.volatile:
            self.w.line(f"volatileStore({self.e.text(code.Address(s.place))}, {self.e.bare(s.value)})")
        else:
            self.w.line(f"{self.e.text(s.place)} = {self.e.bare(s.value)}")

    def _otherwise(self, body: code.Body) -> None:
        last = body[-1] if body else None
        if isinstance(last, code.If) and (len(body) == 1 or (len(body) == 2 and isinstance(body[0], code.At))):
            mark = body[0]
            if isinstance(mark, code.At):
                self.w.origin = mark.span
            self.w.line(f"elif {self.e.bare(last.condition)}:")
            with self.w.indented():
                if isinstance(mark, code.At):
                    self._at(mark)
                self.body(last.then)
            self._otherwise(last.otherwise)
        elif body:
            self._nested("else", body)

    def _select(self, s: code.Select) -> None:
        self.w.line(f"case {self.e.bare(s.value)}")
        for constant, body in s.cases:
            self._nested(f"of {self.e.text(constant)}", body)
        # Memory may hold a number that is no state. Without this line some compilers take it for impossible.
        self.w.line("else: discard")

    def _count(self, s: code.Count) -> None:
        if 0 < s.count <= s.unroll:
            self._written_out(s.name, I32, range(s.count), s.body)
        else:
            self._nested(f"for {self.e.names.of(s.name)} in 0'i32 ..< {s.count}'i32", s.body)

    def _written_out(self, name: str, type_: Scalar, values: range, body: code.Body) -> None:
        """A block for each iteration. Nim has no way to ask the C compiler to unroll a loop."""
        for value in values:
            self._nested("block", (code.Let(name, type_, code.Literal(value, type_)), *body))

    def _for(self, s: code.For) -> None:
        if s.unroll and isinstance(s.start, code.Literal) and isinstance(s.stop, code.Literal) and not _leaves(s.body):
            values = range(int(s.start.value), int(s.stop.value), s.step)
            if len(values) <= s.unroll:
                self._written_out(s.name, I64, values, s.body)
                return
        start, stop = self.e.bare(s.start), self.e.bare(s.stop)
        iterator = "fcsl_up" if s.step > 0 else "fcsl_down"
        self._nested(f"for {self.e.names.of(s.name)} in {iterator}({start}, {stop}, {abs(s.step)}'i64)", s.body)


def _leaves(body: code.Body) -> bool:
    """Whether the body leaves its loop, or an iteration of it."""
    for s in body:
        if isinstance(s, code.Break | code.Continue):
            return True
        if not isinstance(s, code.For | code.Count) and any(map(_leaves, code.parts(s)[1])):
            return True
    return False


def print_table(w: NimWriter, module: Module, table: code.Table, names: Names) -> None:
    w.line(f"const {names.of(table.name)}: {module.type_name(table.type)} = {_value(module, table.type, table.values)}")


def _value(module: Module, type_: code.Type, values: code.Values) -> str:
    if not isinstance(values, tuple):
        return NimExpressions(module, {}).text(values)
    if isinstance(type_, code.Block):
        return "[" + ", ".join(_value(module, type_.element, v) for v in values) + "]"
    assert isinstance(type_, code.Named)
    fields = zip(module.fields[type_.name], values, strict=True)
    inner = ", ".join(f"{module.members.of(f.name)}: {_value(module, f.type, v)}" for f, v in fields)
    return f"{module.types_of[type_.name]}({inner})"
