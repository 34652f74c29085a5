# SPDX-License-Identifier: Apache-2.0
"""Nim of statements and functions."""

from __future__ import annotations

from ...model import code
from ...model.types import I32, I64, Scalar
from ..statements import Statements
from .expressions import Module, NimExpressions
from .names import Names
from .writer import NimWriter


class NimStatements(Statements):
    """Writes the functions of a module. `helpers` collects the procs that they call."""

    w: NimWriter
    e: NimExpressions
    end = ""
    scope = "block"
    discard = "discard "
    else_if = "elif"

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

    def table(self, s: code.Table) -> None:
        self.e.tables.add(s.name)
        print_table(self.w, self.module, s, self.e.names)

    def body(self, statements: code.Body) -> None:
        super().body(statements)
        if all(isinstance(s, code.At | code.Unused | code.Table) for s in statements):
            self._line("discard")

    def _statement(self, s: code.Statement) -> None:
        if isinstance(s, code.Count | code.For) or (isinstance(s, code.Let | code.Var) and s.type is I64):
            self.e.indices.add(s.name)
        super()._statement(s)

    def _let(self, s: code.Let) -> None:
        # A record is not set to zero before it is copied.
        pragma = " {.noinit.}" if isinstance(s.type, code.Named) else ""
        value = self.e.bare(s.value)
        self._line(f"let {self.e.names.of(s.name)}{pragma}: {self.module.type_name(s.type)} = {value}")

    def _var(self, s: code.Var) -> None:
        name, type_ = self.e.names.of(s.name), self.module.type_name(s.type)
        value = "" if s.value is None else f" = {self.e.bare(s.value)}"
        pragma = "" if value or s.zeroed else " {.noinit.}"
        comment = f" # {s.comment}" if s.comment else ""
        self._line(f"var {name}{pragma}: {type_}{value}{comment}")

    def _copy(self, s: code.Copy) -> None:
        if isinstance(s.to, code.Part) or isinstance(s.source, code.Part):
            ends = ", ".join(self.e.text(code.Address(end, block=True)) for end in (s.to, s.source))
            self._line(f"copyMem({ends}, sizeof({self.module.type_name(s.type)}))")
        else:
            self._line(f"{self.e.text(s.to)} = {self.e.text(s.source)}")

    def _clear(self, s: code.Clear) -> None:
        self._line(f"zeroMem({self.e.text(code.Address(s.place))}, sizeof({self.module.type_name(s.type)}))")

    def _store(self, s: code.Set) -> None:
        self._line(f"volatileStore({self.e.text(code.Address(s.place))}, {self.e.bare(s.value)})")

    def _update(self, s: code.Update) -> None:
        place = self.e.text(s.place)
        self._line(f"{place} = {place} {s.symbol} {self.e.text(s.value)}")

    def _unused(self, s: code.Unused) -> None:
        """Nim warns of no argument."""

    def _select(self, s: code.Select) -> None:
        self.w.line(f"case {self.e.bare(s.value)}")
        for constant, body in s.cases:
            self._nested(f"of {self.e.text(constant)}", body)
        # Memory may hold a number that is no state. Without this line Nim 2 tells the C compiler that it cannot be.
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
