# SPDX-License-Identifier: Apache-2.0
"""Makes the functions of one instance: init and execute."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from ..check.fault_points import PULSES, written_before_fault
from ..model import code, ir
from ..model.c_names import c_name
from ..model.code import Call, Deref, Function, If, Member, Name, Set, Statement
from ..model.machine import Instance, Machine, Values
from ..model.types import HEALTH, U32, Array, Scalar, Struct, Type, count_of
from .cold_paths import failed
from .copies import copied
from .expressions import code_type
from .functions import HOST_TYPE
from .names import health, instance_type, record_type, request_constant

#: An array of more values is copied from a constant table. C compilers take quadratic time for so many assignments.
_TABLE_VALUES = 64
_SELF = Name("self")
_FAULT = Name("fault")
_HOST = Name("host")


def constant(machine: Machine, value: bool | int | float | str, scalar: Scalar) -> code.Literal | Name:
    """A scalar of a port. Healths and requests use the names of their enums."""
    if isinstance(value, str):
        return Name(request_constant(machine.name, value))
    return health(int(value)) if scalar is HEALTH else code.Literal(value, scalar)


def nested(machine: Machine, type_: Type, values: Iterator[bool | int | float | str]) -> code.Values:
    """Values in the order of the leaves of a type, nested as the type is."""
    if isinstance(type_, Array):
        return tuple(nested(machine, type_.element, values) for _ in range(type_.count))
    if isinstance(type_, Struct):
        return tuple(nested(machine, m.type, values) for m in type_.members)
    return constant(machine, next(values), type_)


def store(machine: Machine, target: code.Place, type_: Type, values: Values) -> Iterator[Statement]:
    """Stores the values of a port, listed in the order of its leaves, into zero-initialised storage."""
    if isinstance(type_, Struct):
        for member in type_.members:
            size = count_of(member.type)
            yield from store(machine, Member(target, c_name(member.name)), member.type, values[:size])
            values = values[size:]
    elif isinstance(type_, Array):
        yield from _store_array(machine, target, type_, values)
    else:
        yield Set(target, constant(machine, values[0], type_))


def _store_array(machine: Machine, target: code.Place, type_: Array, values: Values) -> Iterator[Statement]:
    if all(_is_zero(value) for value in values):
        return
    if len(values) > _TABLE_VALUES:
        made = code_type(machine.name, type_)
        table = code.Table(f"fcsl_{'_'.join(_steps(target))}", made, nested(machine, type_, iter(values)))
        yield table
        yield copied(target, Name(table.name), made)
        return
    size = count_of(type_.element)
    for position in range(type_.count):
        own = values[position * size : (position + 1) * size]
        if isinstance(type_.element, Struct) or not _is_zero(own[0]):
            yield from store(machine, code.Element(target, code.Sum((), position)), type_.element, own)


def _is_zero(value: bool | int | float | str) -> bool:
    return value == 0 and not str(value).startswith("-")


def _steps(place: code.Place) -> Iterator[str]:
    """The names in a place, for a name that no other place has."""
    if isinstance(place, Member):
        yield from _steps(place.base)
        yield place.name
    elif isinstance(place, code.Element) and isinstance(place.index, code.Sum):
        yield from _steps(place.base)
        yield str(place.index.constant)


def call(function: ir.Function, record: code.Place, fault: Name) -> code.Do:
    """Calls `execute` or `start` with the records of an instance."""
    arguments: list[code.Expr] = [code.Address(Member(record, name)) for name in function.records]
    arguments += [_HOST] if function.takes_host else []
    return code.Do(code.Call(function.name, (*arguments, *([code.Address(fault)] if function.faults else []))))


def run_quiet(machine: Machine, first: Instance, record: code.Place) -> code.Do:
    """Runs execute of a quiet instance (status_elision.py), but for its health. `first`: of those alike."""
    if _is_plain(first):
        return call(first.execute, record, _FAULT)
    return code.Do(Call(_run_name(machine, first), (code.Address(record),)), unused=True)


def execute_name(machine: Machine, instance: Instance) -> str:
    """`instance`: the first of those alike for the definition that is compiled with the machine."""
    return f"{machine.name}_{instance.identifier}_execute"


def init_name(machine: Machine, instance: Instance, first: Instance) -> str:
    """The function that fills its record at the start: of the first of those alike, if both begin with the same values."""
    # In text, 0.0 differs from -0.0.
    same = repr((instance.parameters, instance.inputs)) == repr((first.parameters, first.inputs))
    return f"{machine.name}_{(first if same else instance).identifier}_init"


def _run_name(machine: Machine, instance: Instance) -> str:
    return f"fcsl_run_{machine.name}_{instance.identifier}"


def _makes_requests(instance: Instance) -> bool:
    return ("outputs", "transition_request") in instance.execute.fields


def _is_plain(instance: Instance) -> bool:
    """Whether to run a quiet instance is nothing but the call of its algorithm."""
    return not instance.execute.faults and not _makes_requests(instance)


class InstanceEmitter:
    """Makes the functions of one instance."""

    def __init__(self, machine: Machine, instance: Instance, quiet: bool, first: Instance):
        """`quiet`: see status_elision.py. `first`: of those alike (identical_code_folding.py)."""
        self.m, self.i, self.quiet, self.first = machine, instance, quiet, first
        self.pointer = code.Pointer(code.Named(instance_type(machine, instance)), writable=True)
        self.name = f"{machine.name}_{instance.identifier}"

    def emit(self) -> Iterator[Function]:
        yield self._init()
        if self.first is not self.i:
            yield self._as_first()
        elif self.quiet:
            yield from self._quiet()
        else:
            yield self._execute([*self._pulses(health(0)), *self._body()])

    def _init(self) -> Function:
        name = init_name(self.m, self.i, self.first)
        body = self._initial() if name == f"{self.name}_init" else [code.Do(Call(name, (_SELF,)))]
        comment = (
            "Zeroes the record, binds parameters and initial inputs. start() runs afterwards, in the machine's start."
        )
        parameters = ((_SELF.text, self.pointer),)
        return Function(f"{self.name}_init", parameters, None, tuple(body), comment, exported=True, in_header=True)

    def _initial(self) -> list[Statement]:
        body: list[Statement] = [code.Clear(Deref(_SELF), self.pointer.target)]
        for record, values in (("parameters", self.i.parameters), ("inputs", self.i.inputs)):
            for port in self.i.algorithm.ports[record]:
                if port.name in values:
                    body += store(self.m, _field(record, port), port.type, values[port.name])
        return [*body, Set(_output("health"), health(3))]

    def _as_first(self) -> Function:
        host = (_HOST,) if self.i.execute.takes_host else ()
        run = Call(execute_name(self.m, self.first), (_SELF, *host))
        return replace(self._execute([code.Return(run)]), in_header=True)

    def _quiet(self) -> Iterator[Function]:
        """A tick makes the call of run_quiet. If the health is not nominal, or something is injected, it calls `begin`
        before."""
        nominal = Set(_output("health"), health(0))
        if _is_plain(self.i):
            yield self._execute([nominal, *self._body()])
            return
        body: list[Statement] = (
            [Set(_output("transition_request"), self._no_request)] if _makes_requests(self.i) else []
        )
        run = Function(_run_name(self.m, self.i), ((_SELF.text, self.pointer),), U32, (*body, *self._body()))
        yield replace(run, comment="Runs execute, but for its health.")
        yield self._execute([nominal, code.Return(Call(run.name, (code.Address(Deref(_SELF)),)))])

    def _execute(self, body: list[Statement]) -> Function:
        parameters: list[tuple[str, code.Type]] = [(_SELF.text, self.pointer)]
        if self.i.execute.takes_host:
            parameters.append((_HOST.text, HOST_TYPE))
        comment = "Runs execute once with the inputs in the record. Returns 0, or the place of a fault; outputs and state then stay."
        return Function(execute_name(self.m, self.i), tuple(parameters), U32, tuple(body), comment, exported=True)

    def _body(self) -> list[Statement]:
        """Calls execute. A fault has its effects. Returns 0, or the place of the fault."""
        if not self.i.execute.faults:
            body = [call(self.i.execute, Deref(_SELF), _FAULT), *self._not_stale()]
            return [*body, code.Return(code.Literal(0, U32))]
        save, restore = self._saved()
        body = [*save, code.Var(_FAULT.text, U32), call(self.i.execute, Deref(_SELF), _FAULT)]
        faulted = code.Binary("!=", _FAULT, code.Literal(0, U32))
        undo = [code.Do(Call("fcsl_event_undo", (_HOST,)))] if self.i.execute.has_events else []
        return [*body, If(faulted, (*restore, *undo, *self._failed(_FAULT))), *self._not_stale(), code.Return(_FAULT)]

    @property
    def _no_request(self) -> Name:
        return Name(request_constant(self.m.name, ""))

    def _pulses(self, word: Name) -> list[Statement]:
        return [Set(_output("transition_request"), self._no_request), Set(_output("health"), word)]

    def _failed(self, place: code.Expr) -> list[Statement]:
        """The effects of a fault apart from the restored outputs and state."""
        return [*failed(self.m, _member("counters"), _output("health"), _output("transition_request"), place)]

    def _saved(self) -> tuple[list[Statement], list[Statement]]:
        """Statements that save the fields that a fault must restore, and those that restore them."""
        save: list[Statement] = []
        restore: list[Statement] = []
        written = written_before_fault(self.i.execute)
        for record in ("outputs", "state"):
            fields = self.i.algorithm.ports[record]
            ports = [port for port in fields if (record, port.name) in written]
            if not ports:
                continue
            before = f"{record}_before"
            if all(port in ports or (record, port.name) in PULSES for port in fields):
                type_ = code.Named(record_type(self.m, self.i.algorithm, record))
                save.append(code.Let(before, type_, _member(record)))
                restore.append(Set(_member(record), Name(before)))
                continue
            for port in ports:
                field, held = _field(record, port), Name(f"{before}_{c_name(port.name)}")
                of = code_type(self.m.name, port.type)
                if isinstance(of, code.Block):
                    save += [code.Var(held.text, of, zeroed=False), copied(held, field, of)]
                else:
                    save.append(code.Let(held.text, of, field))
                restore.append(copied(field, held, of))
        return save, restore

    def _not_stale(self) -> list[Statement]:
        """A running instance is never stale. If a variable can set health to stale, it becomes failed."""
        written = ir.writes(self.i.algorithm.execute.body)
        words = [value for target, value, _ in written if ir.variable(target) == ("outputs", "health")]
        if all(isinstance(word, ir.Const) for word in words):
            return []
        own = _output("health")
        return [If(code.Binary("==", own, health(3)), (Set(own, health(2)),))]


def _member(name: str) -> Member:
    return Member(Deref(_SELF), name)


def _output(name: str) -> Member:
    return Member(_member("outputs"), name)


def _field(record: str, port: ir.Port) -> Member:
    return Member(_member(record), c_name(port.name))
