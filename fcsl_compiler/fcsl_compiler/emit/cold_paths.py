# SPDX-License-Identifier: Apache-2.0
"""The cold paths of a tick: an injected fault or health, an overrun, a health to reset. Each is one function for all
instances of a machine, kept away from frequently executed code."""

from __future__ import annotations

from collections.abc import Iterator

from ..model import code
from ..model.code import Call, Deref, Do, Field, Function, If, Member, Name, Pointer, Record, Set, Statement, Update
from ..model.machine import Instance, Machine
from ..model.types import BOOL, HEALTH, REQUEST, U32, U64
from .fault_places import FaultPlaces
from .names import health, instance_member, request_constant

_COUNTERS, _HEALTH, _REQUEST = Name("counters"), Name("health"), Name("request")
_NONE = code.Literal(0, code.U8)


def counters_type(machine: Machine) -> str:
    return f"fcsl_counters_{machine.name}_t"


def counters_record(machine: Machine) -> Record:
    return Record(
        counters_type(machine),
        (
            Field("faults", U64),
            Field("overruns", U64),
            Field("fault_place", U32, "of the last fault: row of fault_places, from 1; 0: none"),
            Field(
                "inject_fault",
                code.U8,
                "1: its next run counts as a fault; 2, 3: its health is at least degraded, failed",
            ),
            Field("inject_overrun", code.U8, "1: its next run counts as an overrun"),
        ),
    )


def failed(
    machine: Machine, counters: code.Place, own: code.Place, request: code.Place, place: code.Expr
) -> tuple[Statement, ...]:
    """The effects of a fault apart from the restored outputs and state. `own`: the health."""
    return (
        Set(request, Name(request_constant(machine.name, ""))),
        Set(own, health(2)),
        Update(Member(counters, "faults"), "+", code.Literal(1, U64)),
        Set(Member(counters, "fault_place"), place),
    )


def call_begin(machine: Machine, instance: Instance) -> Call:
    """Before an execute whose health is not nominal, or for which something is injected. False if it does not run."""
    return _call(machine, instance, "begin")


def call_fault(machine: Machine, instance: Instance) -> Do:
    return Do(_call(machine, instance, "fault"))


def call_worsen(machine: Machine, instance: Instance) -> Do:
    return Do(_call(machine, instance, "worsen"))


def call_overrun(machine: Machine, instance: Instance) -> Do:
    return Do(_call(machine, instance, "overrun"))


def _call(machine: Machine, instance: Instance, what: str) -> Call:
    record = Member(Deref(Name("m")), instance_member(instance))
    outputs = Member(record, "outputs")
    places = [Member(record, "counters"), Member(outputs, "health"), Member(outputs, "transition_request")]
    if what in ("worsen", "overrun"):
        del places[2]
    return Call(f"fcsl_{what}_{machine.name}", tuple(map(code.Address, places)))


class ColdPathEmitter:
    """Makes the functions that a machine needs. `quiet`: see status_elision.py."""

    def __init__(self, machine: Machine, places: FaultPlaces, quiet: frozenset[int]):
        self.m, self.places, self.quiet = machine, places, quiet

    def emit(self) -> Iterator[Function]:
        run = {entry.instance for state in self.m.states for entry in state.entries}
        if run:
            yield self._fault()
        if run & self.quiet:
            yield self._begin()
        if run - self.quiet:
            yield self._worsen()
        if any(self.m.instances[n].max_wcet_us for n in run):
            yield self._overrun()

    def _function(
        self, what: str, body: tuple[Statement, ...], comment: str, result: code.Type | None = None
    ) -> Function:
        pointers: dict[str, code.Type] = {
            _COUNTERS.text: code.Named(counters_type(self.m)),
            _HEALTH.text: HEALTH,
            _REQUEST.text: REQUEST,
        }
        used = code.used_names(body)
        parameters = tuple((name, Pointer(type_, writable=True)) for name, type_ in pointers.items() if name in used)
        return Function(f"fcsl_{what}_{self.m.name}", parameters, result, body, comment, inline="rare")

    def _fault(self) -> Function:
        body = (
            Set(_counter("inject_fault"), _NONE),
            *failed(self.m, Deref(_COUNTERS), Deref(_HEALTH), Deref(_REQUEST), code.Literal(self.places.injected, U32)),
        )
        return self._function("fault", body, "Replaces an execute with an injected fault: outputs and state stay.")

    def _begin(self) -> Function:
        injected = Name("injected")
        fault = Do(Call(f"fcsl_fault_{self.m.name}", (_COUNTERS, _HEALTH, _REQUEST)))
        worse = code.Choice(_is(injected, 2), health(1), health(2))
        body = (
            code.Let(injected.text, code.U8, _counter("inject_fault")),
            If(_is(injected, 1), (fault, code.Return(code.Literal(False, BOOL)))),
            Set(_counter("inject_fault"), _NONE),
            Set(Deref(_HEALTH), code.Choice(_is(injected, 0), health(0), worse)),
            code.Return(code.Literal(True, BOOL)),
        )
        comment = (
            "Before an execute: sets its health, nominal or injected. False if it is replaced with an injected fault."
        )
        return self._function("begin", body, comment, BOOL)

    def _worsen(self) -> Function:
        least = Name("least")
        is_failed = code.Binary(">", _counter("inject_fault"), code.Literal(2, code.U8))
        body = (
            code.Let(least.text, HEALTH, code.Choice(is_failed, health(2), health(1))),
            Set(_counter("inject_fault"), _NONE),
            If(code.Binary("<", Deref(_HEALTH), least), (Set(Deref(_HEALTH), least),)),
        )
        return self._function("worsen", body, "After an execute with an injected health: at least degraded or failed.")

    def _overrun(self) -> Function:
        body = (
            Set(_counter("inject_overrun"), _NONE),
            Update(_counter("overruns"), "+", code.Literal(1, U64)),
            If(code.Binary("==", Deref(_HEALTH), health(0)), (Set(Deref(_HEALTH), health(1)),)),
        )
        return self._function("overrun", body, "After an execute that overran, or with an injected overrun.")


def _counter(name: str) -> Member:
    return Member(Deref(_COUNTERS), name)


def _is(byte: code.Expr, value: int) -> code.Expr:
    return code.Binary("==", byte, code.Literal(value, code.U8))
