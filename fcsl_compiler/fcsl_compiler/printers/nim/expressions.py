# SPDX-License-Identifier: Apache-2.0
"""Nim of expressions and types."""

from __future__ import annotations

from dataclasses import replace

from ...model import code
from ...model.types import HEALTH, I64, REQUEST, Scalar
from ..expressions import Expressions
from .names import Names
from .operations import SPELLINGS
from .operations.helpers import FAULT_HELPER, INDEX_HELPER, NIM_TYPES, literal

#: FCSL_NONE of fcsl_machine.h.
_NONE = "FCSL_NONE"


class Module:
    """What expressions refer to: names of all records, members, functions and constants of a machine."""

    def __init__(self, program: code.Program):
        self.types, self.members = Names(), Names()
        self.globals = Names(self.types)
        self.fields = {r.name: r.fields for r in (*program.records, *program.private_records)}
        self.state_type = f"{_capital(program.name)}State"
        self.request_type = f"{_capital(program.name)}Request"
        for name in ("Health", "Host", self.state_type, self.request_type):
            self.types.of(name)
        self.types_of = {"fcsl_host_t": "Host"}
        for record in (*program.records, *program.private_records):
            self.types_of[record.name] = self.types.of(record.name, _capital(record.name.removesuffix("_t")))
        self.tables = {table.name for table in program.tables}
        #: Labels of enums by constant.
        self.labels: dict[str, str] = {}
        self._enum(program.states, f"{program.name}_STATE_", self.state_type)
        self._enum(program.requests, f"{program.name}_tr_", self.request_type)
        for word in ("nominal", "degraded", "failed", "stale"):
            self.labels[f"FCSL_{word.upper()}"] = f"Health.{word}"
        for name in ("init", "execute", "initMachine", "step", "forceState", "volatileStore"):
            self.globals.of(name)
        #: Procs that are overloaded, by their names in C.
        self.overloads = _overloads(program)

    def _enum(self, constants: tuple[str, ...], prefix: str, type_: str) -> None:
        names = Names()
        for constant in constants:
            self.labels[constant] = f"{type_}.{names.of(constant.removeprefix(prefix))}"

    def proc_name(self, f: code.Function) -> str:
        """Those of instances are overloaded: `init` and `execute` of a record."""
        return (self.overloads.get(f.name) or self.globals.of(f.name)) + ("*" if f.exported else "")

    def type_name(self, type_: code.Type) -> str:
        if isinstance(type_, Scalar):
            special = {code.STATE: self.state_type, REQUEST: self.request_type, HEALTH: "Health"}
            return special.get(type_) or NIM_TYPES[type_.name]
        if isinstance(type_, code.Named):
            return self.types_of[type_.name]
        if isinstance(type_, code.Block):
            return f"array[{type_.count}, {self.type_name(type_.element)}]"
        return "pointer" if type_ == code.UNTYPED else f"ptr {self.type_name(type_.target)}"


def _overloads(program: code.Program) -> dict[str, str]:
    """The names of exported procs. Of instances with one record the first alone has the short names."""
    like = {r.name.removesuffix("_t") for r in program.records if r.like}
    names = ((f.name, *f.name.rsplit("_", 1)) for f in program.functions if f.exported)
    return {name: entry for name, record, entry in names if record not in like}


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]


class NimExpressions(Expressions):
    """Writes the expressions of one function."""

    null = "nil"
    place_suffix = "'u32"

    def __init__(self, module: Module, helpers: dict[str, str]):
        super().__init__(SPELLINGS, helpers)
        self.module = module
        self.names = Names(module.globals)
        #: Tables of the function itself.
        self.tables = set(module.tables)
        #: Variables that count a loop, or are int64.
        self.indices: set[str] = set()

    def unwrapped(self, text: str) -> str:
        """An `if` keeps its parentheses."""
        return text if text.startswith("(if ") else super().unwrapped(text)

    def _name(self, text: str) -> str:
        if text == _NONE:
            return "-1'i32"
        return self.module.labels.get(text) or self.names.of(text)

    def _function(self, name: str) -> str:
        return self.module.overloads.get(name) or self._name(name)

    def _literal(self, e: code.Literal) -> str:
        if e.type is HEALTH:
            return "Health.nominal"  # of a variable that is not assigned yet
        if e.type is REQUEST:
            return f"{self.module.request_type}(0)"
        return literal(e.value, e.type)

    def _symbol(self, e: code.Binary) -> str:
        return {"%": "mod", "/": "/" if _is_float(e) else "div"}.get(e.symbol, e.symbol)

    def _deref(self, e: code.Deref) -> str:
        return f"{self.text(e.pointer)}[]"

    def _member(self, e: code.Member) -> str:
        return f"{self._indexed(e.base)}.{self.module.members.of(e.name)}"

    def _indexed(self, place: code.Place) -> str:
        """A place of which a member or an element is taken: a pointer stands for what it points to."""
        if not isinstance(place, code.Deref):
            return self.text(place)
        text = self.text(place.pointer)
        if not isinstance(place.pointer, code.Address):
            return text
        self._help(_OPAQUE)
        return f"fcsl_opaque({text})"

    def _part(self, e: code.Part) -> str:
        return f"{self._pointer(e)}[]"

    def _address(self, e: code.Address) -> str:
        return self._pointer(e.place)

    def _pointer(self, place: code.Place) -> str:
        """Pointer to a place."""
        if isinstance(place, code.Deref):
            return self.text(place.pointer)
        if isinstance(place, code.Name):
            return f"{'unsafeAddr' if place.text in self.tables else 'addr'} {self._name(place.text)}"
        if self._table(place) and not isinstance(place, code.Part):
            # Nim takes the value of a part of a constant. Behind an opaque pointer it has an address.
            return f"addr {self.text(_behind_pointer(place))}"
        if isinstance(place, code.Part):
            base = _behind_pointer(place.base) if self._table(place) else place.base
            first = self._element(base, [self.text(place.start)])
            return f"cast[ptr {self.module.type_name(place.type)}](addr {first})"
        return f"addr {self.text(place)}"

    def _table(self, place: code.Place) -> bool:
        while isinstance(place, code.Member | code.Element | code.Part):
            place = place.base
        return isinstance(place, code.Name) and place.text in self.tables

    def _choice(self, e: code.Choice) -> str:
        return f"(if {self.bare(e.condition)}: {self.bare(e.then)} else: {self.bare(e.otherwise)})"

    def _and(self, e: code.And) -> str:
        return f"({' and '.join(map(self._operand, e.args))})"

    def _or(self, e: code.Or) -> str:
        return f"({' or '.join(map(self._operand, e.args))})"

    def _not(self, e: code.Not) -> str:
        return f"(not {self._operand(e.arg)})"

    def _operands(self, e: code.Operation) -> list[str]:
        operands = super()._operands(e)
        if not e.args or not all(isinstance(a, code.Literal) for a in e.args):
            return operands
        # Nim computes with literals itself, f32 as f64.
        self._help(_OPAQUE)
        return [f"fcsl_opaque({o})" for o in operands]

    def _convert(self, e: code.Convert) -> str:
        if e.type is code.U8 or e.type is code.STATE:
            return f"{self.module.type_name(e.type)}({self.bare(e.arg)})"
        if isinstance(e.type, Scalar) and e.type.is_float:
            return f"{NIM_TYPES[e.type.name]}({self.bare(e.arg)})"
        return f"cast[{self.module.type_name(e.type)}]({self.bare(e.arg)})"

    def _index(self, e: code.Expr) -> str:
        """An index as an int64. Nim converts between integers on request alone."""
        is_int64 = (
            (isinstance(e, code.Name) and e.text in self.indices)
            or isinstance(e, code.CheckedIndex)
            or (isinstance(e, code.Operation) and e.op.result is I64)
        )
        return self.text(e) if is_int64 else f"int64({self.bare(e)})"

    def _checked(self, e: code.CheckedIndex) -> str:
        self._help(FAULT_HELPER)
        self._help(INDEX_HELPER)
        index = self.text(e.index)
        # An index beyond high(int64) is always out of range; -1 stands for it.
        wide = (
            f"(if {index} > 0x7fff_ffff_ffff_ffff'u64: -1'i64 else: cast[int64]({index}))"
            if e.is_u64
            else f"int64({self.unwrapped(index)})"
        )
        return f"fcsl_index({wide}, {e.extent}'i64, {e.place}'u32, {self.text(e.fault)})"


def _behind_pointer(place: code.Place) -> code.Place:
    """The same place, with its variable behind a pointer."""
    if isinstance(place, code.Name):
        return code.Deref(code.Address(place))
    if isinstance(place, code.Member | code.Element | code.Part):
        return replace(place, base=_behind_pointer(place.base))
    return place


_OPAQUE = """\
proc fcsl_opaque[T](x: T): T {.inline.} =
  x
"""


def _is_float(e: code.Expr) -> bool:
    if isinstance(e, code.Binary):
        return _is_float(e.left)
    return isinstance(e, code.Convert | code.Literal) and isinstance(e.type, Scalar) and e.type.is_float
