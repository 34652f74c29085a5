# SPDX-License-Identifier: Apache-2.0
"""Nim of expressions and types."""

from __future__ import annotations

from dataclasses import replace

from ...model import code
from ...model.types import HEALTH, I64, REQUEST, Scalar
from .names import Names
from .operations import spelling_of
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
        self.overloads = {f.name: f.name.rsplit("_", 1)[1] for f in program.functions if f.exported}

    def _enum(self, constants: tuple[str, ...], prefix: str, type_: str) -> None:
        names = Names()
        for constant in constants:
            self.labels[constant] = f"{type_}.{names.of(constant.removeprefix(prefix))}"

    def proc_name(self, f: code.Function) -> str:
        """Those of instances are overloaded: `init` and `execute` of a record."""
        return f"{self.overloads[f.name]}*" if f.exported else self.globals.of(f.name)

    def type_name(self, type_: code.Type) -> str:
        if isinstance(type_, Scalar):
            special = {code.STATE: self.state_type, REQUEST: self.request_type, HEALTH: "Health"}
            return special.get(type_) or NIM_TYPES[type_.name]
        if isinstance(type_, code.Named):
            return self.types_of[type_.name]
        if isinstance(type_, code.Block):
            return f"array[{type_.count}, {self.type_name(type_.element)}]"
        return "pointer" if type_ == code.UNTYPED else f"ptr {self.type_name(type_.target)}"


def _capital(name: str) -> str:
    return name[:1].upper() + name[1:]


def bare(text: str) -> str:
    """The expression without the parentheses that enclose all of it. `if` keeps them."""
    if not (text.startswith("(") and text.endswith(")")) or text.startswith("(if "):
        return text
    depth = 0
    for position, char in enumerate(text):
        depth += (char == "(") - (char == ")")
        if depth == 0 and position < len(text) - 1:
            return text
    return text[1:-1]


class NimExpressions:
    """Writes the expressions of one function. `helpers` collects the procs that they call."""

    def __init__(self, module: Module, helpers: dict[str, str]):
        self.module, self.helpers = module, helpers
        self.names = Names(module.globals)
        #: Tables of the function itself.
        self.tables = set(module.tables)
        #: Variables that count a loop, or are int64.
        self.indices: set[str] = set()

    def bare(self, e: code.Expr) -> str:
        return bare(self.text(e))

    def text(self, e: code.Expr) -> str:
        if isinstance(e, code.Name):
            return self._name(e.text)
        if isinstance(e, code.Literal):
            return self._literal(e)
        if isinstance(e, code.Deref):
            return f"{self.text(e.pointer)}[]"
        if isinstance(e, code.Member):
            return f"{self._base(e.base)}.{self.module.members.of(e.name)}"
        if isinstance(e, code.Element):
            return self._element(e.base, [self.text(e.index)])
        if isinstance(e, code.Part):
            return f"{self._pointer(e)}[]"
        if isinstance(e, code.Address):
            return self._pointer(e.place)
        if isinstance(e, code.Operation):
            return self._operation(e)
        if isinstance(e, code.Choice):
            return f"(if {self.bare(e.condition)}: {self.bare(e.then)} else: {self.bare(e.otherwise)})"
        if isinstance(e, code.And | code.Or):
            return f"({(' and ' if isinstance(e, code.And) else ' or ').join(map(self._operand, e.args))})"
        if isinstance(e, code.Not):
            return f"(not {self._operand(e.arg)})"
        if isinstance(e, code.Binary):
            return f"{self._operand(e.left)} {self._symbol(e)} {self._operand(e.right)}"
        if isinstance(e, code.Convert):
            return self._convert(e)
        if isinstance(e, code.Sum):
            return self._sum(e)
        if isinstance(e, code.CheckedIndex):
            return self._checked(e)
        if isinstance(e, code.Null):
            return "nil"
        if isinstance(e.function, str):
            function = self.module.overloads.get(e.function) or self._name(e.function)
        else:
            function = self.text(e.function)
        return f"{function}({', '.join(map(self.bare, e.args))})"

    def _name(self, text: str) -> str:
        if text == _NONE:
            return "-1'i32"
        return self.module.labels.get(text) or self.names.of(text)

    def _literal(self, e: code.Literal) -> str:
        if e.type is HEALTH:
            return "Health.nominal"  # of a variable that is not assigned yet
        if e.type is REQUEST:
            return f"{self.module.request_type}(0)"
        return literal(e.value, e.type)

    def _symbol(self, e: code.Binary) -> str:
        return {"%": "mod", "/": "/" if _is_float(e) else "div"}.get(e.symbol, e.symbol)

    def _operand(self, e: code.Expr) -> str:
        text = self.text(e)
        return f"({text})" if isinstance(e, code.Binary) else text

    def _base(self, place: code.Place) -> str:
        """A place of which a member or an element is taken: a pointer stands for what it points to."""
        if not isinstance(place, code.Deref):
            return self.text(place)
        text = self.text(place.pointer)
        if not isinstance(place.pointer, code.Address):
            return text
        self._help(_OPAQUE)
        return f"fcsl_opaque({text})"

    def _element(self, base: code.Place, index: list[str]) -> str:
        if isinstance(base, code.Part):
            return self._element(base.base, [self.text(base.start), *index])
        return f"{self._base(base)}[{' + '.join(index)}]"

    def _pointer(self, place: code.Place) -> str:
        """Pointer to a place."""
        if isinstance(place, code.Deref):
            return self.text(place.pointer)
        if isinstance(place, code.Name):
            return f"{'unsafeAddr' if place.text in self.tables else 'addr'} {self._name(place.text)}"
        if self._table(place) and not isinstance(place, code.Part):
            # Nim takes the value of a part of a constant. Behind a pointer that it does not see through it has an address.
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

    def _operation(self, e: code.Operation) -> str:
        spelling = spelling_of(e.op)
        proven = bool(e.op.faults) and not e.places
        text, helper = (spelling.proven, spelling.proven_helper) if proven else (spelling.text, spelling.helper)
        for part in filter(None, helper.split("\n\n")):
            self._help(part)
        operands = list(map(self.text, e.args))
        if e.args and all(isinstance(a, code.Literal) for a in e.args):
            # Nim computes with literals itself, f32 as f64.
            self._help(_OPAQUE)
            operands = [f"fcsl_opaque({o})" for o in operands]
        if not text.startswith("("):
            operands = list(map(bare, operands))
        place = ", ".join(f"{number}'u32" for number in e.places)
        return text.format(*operands, place=place, fault="" if e.fault is None else self.text(e.fault))

    def _help(self, helper: str) -> None:
        self.helpers[helper.split("(", 1)[0].split("[", 1)[0].rsplit(" ", 1)[1]] = helper

    def _convert(self, e: code.Convert) -> str:
        if e.type is code.U8 or e.type is code.STATE:
            return f"{self.module.type_name(e.type)}({self.bare(e.arg)})"
        if isinstance(e.type, Scalar) and e.type.is_float:
            return f"{NIM_TYPES[e.type.name]}({self.bare(e.arg)})"
        return f"cast[{self.module.type_name(e.type)}]({self.bare(e.arg)})"

    def _sum(self, e: code.Sum) -> str:
        terms = [self._index(term) if stride == 1 else f"{self._index(term)} * {stride}" for term, stride in e.terms]
        if e.constant or not terms:
            terms.append(str(e.constant))
        return " + ".join(terms)

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
            else f"int64({bare(index)})"
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
