# SPDX-License-Identifier: Apache-2.0
"""Makes the functions of one instance: init, execute, and those for injected faults and overruns."""

from __future__ import annotations

from collections.abc import Iterator

from ..model import code, ir
from ..model.c_names import c_name
from ..model.code import Call, Deref, Function, If, Member, Name, Set, Statement, Update
from ..model.machine import Instance, Machine, Values
from ..model.types import BOOL, HEALTH, U32, U64, Array, Scalar, Type, count_of, leaves, scalar_of
from .copies import copied
from .expressions import code_type
from .fault_places import FaultPlaces
from .fault_points import written_before_fault
from .functions import HOST_TYPE
from .names import health, instance_type, record_type, request_constant

_SELF = Name("self")
_FAULT = Name("fault")
_HOST = Name("host")


def constant(machine: Machine, value: bool | int | float | str, scalar: Scalar) -> code.Literal | Name:
    """A scalar of a port. Healths and requests use the names of their enums."""
    if isinstance(value, str):
        return Name(request_constant(machine.name, value))
    return health(int(value)) if scalar is HEALTH else code.Literal(value, scalar)


def store(machine: Machine, target: code.Place, type_: Type, values: Values) -> Iterator[Statement]:
    """Stores the values of a port, listed in the order of its leaves, into zero-initialised storage."""
    at = 0
    for leaf in leaves(type_):
        scalar, count = scalar_of(leaf.type), count_of(leaf.type)
        place = target
        for step in leaf.steps:
            place = code.Element(place, code.Sum((), step)) if isinstance(step, int) else Member(place, c_name(step))
        for position, value in enumerate(values[at : at + count]):
            if isinstance(leaf.type, Array):
                if value != 0 or str(value).startswith("-"):
                    yield Set(code.Element(place, code.Sum((), position)), constant(machine, value, scalar))
            else:
                yield Set(place, constant(machine, value, scalar))
        at += count


def call(function: ir.Function, record: code.Place, fault: Name) -> code.Do:
    """Calls `execute` or `start` with the records of an instance."""
    arguments: list[code.Expr] = [code.Address(Member(record, name)) for name in function.records]
    arguments += [_HOST] if function.uses_hardware else []
    return code.Do(code.Call(function.name, (*arguments, *([code.Address(fault)] if function.faults else []))))


class InstanceEmitter:
    """Makes the functions of one instance."""

    def __init__(self, machine: Machine, places: FaultPlaces, instance: Instance, quiet: bool):
        """`quiet`: see bookkeeping.py."""
        self.m, self.places, self.i, self.quiet = machine, places, instance, quiet
        self.pointer = code.Pointer(code.Named(instance_type(machine, instance)), writable=True)
        self.name = f"{machine.name}_{instance.name}"

    def emit(self) -> Iterator[Function]:
        yield self._init()
        yield from self._quiet() if self.quiet else self._execute()
        if self.i.max_wcet_us:
            yield self._overrun()

    def _function(
        self, name: str, body: tuple[Statement, ...], comment: str, result: code.Type | None = None
    ) -> Function:
        """Rarely executed, and kept away from frequently executed code."""
        return Function(name, ((_SELF.text, self.pointer),), result, body, comment, inline="rare")

    def _init(self) -> Function:
        body: list[Statement] = [code.Clear(Deref(_SELF), self.pointer.target)]
        for record, values in (("parameters", self.i.parameters), ("inputs", self.i.inputs)):
            for port in self.i.algorithm.ports[record]:
                if port.name in values:
                    body += store(self.m, _field(record, port), port.type, values[port.name])
        body.append(Set(_output("health"), health(3)))
        comment = (
            "Zeroes the record, binds parameters and initial inputs. start() runs afterwards, in the machine's init."
        )
        return Function(f"{self.name}_init", ((_SELF.text, self.pointer),), None, tuple(body), comment, exported=True)

    def _execute(self) -> Iterator[Function]:
        yield self._exported([*self._pulses(health(0)), *self._body()])
        yield from self._inject()

    def _quiet(self) -> Iterator[Function]:
        """A tick calls `begin` only if the health is not nominal, or if something is injected; then it calls `run`."""
        own = code.Address(Deref(_SELF))
        run = f"fcsl_run_{self.name}"
        body: list[Statement] = [Set(_output("transition_request"), self._no_request)] if self._makes_requests else []
        body += self._body()
        unused = [] if _SELF.text in code.used_names(body) else [code.Unused(_SELF.text)]
        comment = "Runs execute, but for its health."
        yield Function(run, ((_SELF.text, self.pointer),), U32, (*unused, *body), comment)
        yield self._exported([Set(_output("health"), health(0)), code.Return(Call(run, (own,)))])
        injected, none = Name("injected"), code.Literal(0, code.U8)
        failed = (*self._failed(code.Literal(self.places.injected, U32)), code.Return(code.Literal(False, BOOL)))
        least = code.Choice(
            _is("==", injected, 0), health(0), code.Choice(_is("==", injected, 2), health(1), health(2))
        )
        begin = (
            code.Let(injected.text, code.U8, _member("inject_fault")),
            Set(_member("inject_fault"), none),
            If(_is("==", injected, 1), failed),
            Set(_output("health"), least),
            code.Return(code.Literal(True, BOOL)),
        )
        comment = "Sets the health, nominal or injected. False if a fault is injected: outputs and state stay."
        yield self._function(f"fcsl_begin_{self.name}", begin, comment, BOOL)

    @property
    def _makes_requests(self) -> bool:
        return ir.names_field(self.i.execute.body, "outputs", "transition_request")

    def _exported(self, body: list[Statement]) -> Function:
        parameters: list[tuple[str, code.Type]] = [(_SELF.text, self.pointer)]
        if self.i.execute.uses_hardware:
            parameters.append((_HOST.text, HOST_TYPE))
        comment = "Runs execute once with the inputs in the record. Returns 0, or the place of a fault; outputs and state then stay."
        return Function(f"{self.name}_execute", tuple(parameters), U32, tuple(body), comment, exported=True)

    def _body(self) -> list[Statement]:
        """Calls execute. A fault has its effects. Returns 0, or the place of the fault."""
        if not self.i.execute.faults:
            body = [call(self.i.execute, Deref(_SELF), _FAULT), *self._not_stale()]
            return [*body, code.Return(code.Literal(0, U32))]
        save, restore = self._saved()
        body = [*save, code.Var(_FAULT.text, U32), call(self.i.execute, Deref(_SELF), _FAULT)]
        faulted = code.Binary("!=", _FAULT, code.Literal(0, U32))
        return [*body, If(faulted, (*restore, *self._failed(_FAULT))), *self._not_stale(), code.Return(_FAULT)]

    @property
    def _no_request(self) -> Name:
        return Name(request_constant(self.m.name, ""))

    def _pulses(self, word: Name) -> list[Statement]:
        return [Set(_output("transition_request"), self._no_request), Set(_output("health"), word)]

    def _failed(self, place: code.Expr) -> list[Statement]:
        """The effects of a fault apart from the restored outputs and state."""
        return [*self._pulses(health(2)), _increment("faults"), Set(_member("fault_place"), place)]

    def _saved(self) -> tuple[list[Statement], list[Statement]]:
        """Statements that save the fields that a fault must restore, and those that restore them. Pulses are reset
        instead."""
        save: list[Statement] = []
        restore: list[Statement] = []
        written = written_before_fault(self.i.execute)
        for record in ("outputs", "state"):
            ports = [
                port
                for port in self.i.algorithm.ports[record]
                if (record, port.name) in written and not _is_pulse(record, port)
            ]
            if not ports:
                continue
            type_, before = code.Named(record_type(self.m, self.i.algorithm, record)), Name(f"{record}_before")
            if all(p in ports or _is_pulse(record, p) for p in self.i.algorithm.ports[record]):
                save.append(code.Let(before.text, type_, _member(record)))
                restore.append(Set(_member(record), before))
                continue
            save.append(code.Var(before.text, type_, zeroed=False))
            for port in ports:
                save.append(self._copy(port, before, _member(record)))
                restore.append(self._copy(port, _member(record), before))
        return save, restore

    def _copy(self, port: ir.Port, to: code.Place, source: code.Place) -> Statement:
        """Copies one field between two records."""
        name = c_name(port.name)
        return copied(Member(to, name), Member(source, name), code_type(self.m.name, port.type))

    def _not_stale(self) -> list[Statement]:
        """A running instance is never stale. If a variable can set health to stale, it becomes failed."""
        written = ir.writes(self.i.algorithm.execute.body)
        words = [value for target, value, _ in written if ir.variable(target) == ("outputs", "health")]
        if all(isinstance(word, ir.Const) for word in words):
            return []
        own = _output("health")
        return [If(code.Binary("==", own, health(3)), (Set(own, health(2)),))]

    def _inject(self) -> Iterator[Function]:
        clear = Set(_member("inject_fault"), code.Literal(0, code.U8))
        body: tuple[Statement, ...] = (clear, *self._failed(code.Literal(self.places.injected, U32)))
        comment = "Replaces an execute with an injected fault: outputs and state stay."
        yield self._function(f"fcsl_fault_{self.name}", body, comment)
        own, least = _output("health"), Name("least")
        failed = code.Binary(">", _member("inject_fault"), code.Literal(2, code.U8))
        body = (
            code.Let(least.text, HEALTH, code.Choice(failed, health(2), health(1))),
            clear,
            If(code.Binary("<", own, least), (Set(own, least),)),
        )
        comment = "After an execute with an injected health: at least degraded or failed."
        yield self._function(f"fcsl_worsen_{self.name}", body, comment)

    def _overrun(self) -> Function:
        own = _output("health")
        body = (
            Set(_member("inject_overrun"), code.Literal(0, code.U8)),
            _increment("overruns"),
            If(code.Binary("==", own, health(0)), (Set(own, health(1)),)),
        )
        comment = "After an execute that overran, or with an injected overrun."
        return self._function(f"fcsl_overrun_{self.name}", body, comment)


def _member(name: str) -> Member:
    return Member(Deref(_SELF), name)


def _output(name: str) -> Member:
    return Member(_member("outputs"), name)


def _field(record: str, port: ir.Port) -> Member:
    return Member(_member(record), c_name(port.name))


def _is(operator: str, byte: code.Expr, value: int) -> code.Expr:
    return code.Binary(operator, byte, code.Literal(value, code.U8))


def _increment(counter: str) -> Update:
    return Update(_member(counter), "+", code.Literal(1, U64))


def _is_pulse(record: str, port: ir.Port) -> bool:
    """Whether the port is reset before each execute and by a fault."""
    return record == "outputs" and port.name in ("transition_request", "health")
