# SPDX-License-Identifier: Apache-2.0
"""Makes `init`, `start`, `step` and `force_state` of the descriptor. In a step the latched state becomes active, channels age, and
the tick of the state runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..model import code
from ..model.code import STATE, Binary, Call, Do, Function, If, Literal, Member, Name, Set, Statement, Update
from ..model.machine import Channel, Instance, Machine
from ..model.types import I32, U32, U64
from .functions import HOST_TYPE
from .instances import call, init_name, store
from .names import health, machine_type, sensors, state_constant
from .tick import (
    MACHINE,
    NO_INSTANCE,
    ONE,
    PART,
    TICK,
    TICKS_IN_STATE,
    TickEmitter,
    channel_place,
    health_of,
    one_of,
    port_place,
    record_of,
)

_ACTIVE = Member(MACHINE, "state_")
_NEXT = Member(MACHINE, "next_state_")
_CURRENT = Member(MACHINE, "current_")
_GREATEST_AGE = Literal(0xFFFF_FFFF, U32)


class StepEmitter:
    """Makes the functions of the descriptor, callees first."""

    def __init__(self, machine: Machine, quiet: frozenset[int], firsts: Sequence[int], times: bool):
        """See TickEmitter."""
        self.m, self.quiet, self.firsts, self.times = machine, quiet, firsts, times
        self.pointer = code.Pointer(code.Named(machine_type(machine)), writable=True)

    def emit(self) -> Iterator[Function]:
        yield from self._init()
        yield self._start()
        if len(self.m.states) > 1:
            yield self._enter()
        yield from TickEmitter(self.m, self.quiet, self.firsts, self.times).emit()
        yield self._step()
        yield self._force_state()

    def _of_descriptor(
        self,
        entry: str,
        more: tuple[tuple[str, code.Type], ...],
        body: list[Statement],
        result: code.Type | None = None,
    ) -> Function:
        """A function of the descriptor; `m` is its machine."""
        machine = code.Let("m", self.pointer, code.Convert(self.pointer, Name("machine")))
        parameters = (("machine", code.UNTYPED), *more)
        return Function(f"fcsl_{entry}_{self.m.name}", parameters, result, (machine, *body))

    def _init(self) -> Iterator[Function]:
        m = self.m
        body: list[Statement] = [code.Clear(MACHINE, self.pointer.target), Set(_CURRENT, NO_INSTANCE)]
        body += [Set(place, state_constant(m, m.initial_state)) for place in (_ACTIVE, _NEXT)]
        calls = [
            Do(Call(init_name(m, instance, m.instances[first]), (code.Address(record_of(instance)),)))
            for instance, first in zip(m.instances, self.firsts, strict=True)
        ]
        if len(calls) > PART:
            for number, at in enumerate(range(0, len(calls), PART)):
                name, parameters = f"fcsl_init_{m.name}_{number}", (("m", self.pointer),)
                yield Function(name, parameters, None, tuple(calls[at : at + PART]), inline="rare")
                body.append(Do(Call(name, (MACHINE.pointer,))))
        else:
            body += calls
        for connection in m.connections:
            if connection.delayed:
                body += store(m, port_place(m, connection.target), connection.target.type, connection.initial)
        for channel in sensors(m):
            body += [Set(channel_place(channel, member), Literal(1, code.U8)) for member in ("valid", "waiting")]
        # Cold, so that C compilers do not spend time on a copy of init for every instance.
        yield replace(self._of_descriptor("init", (), body), inline="rare")

    def _start(self) -> Function:
        body = [statement for n, instance in enumerate(self.m.instances) for statement in self._started(n, instance)]
        if not body:
            body.append(code.Unused("m"))
        return replace(self._of_descriptor("start", (), [*body, code.Return(Literal(0, I32))], I32), inline="rare")

    def _started(self, index: int, instance: Instance) -> Iterator[Statement]:
        if instance.start is None:
            return
        fault = Name("fault")
        called = call(instance.start, record_of(instance), fault)
        if not instance.start.faults:
            yield called
            return
        place = Set(Member(Member(record_of(instance), "counters"), "fault_place"), fault)
        failed = (place, code.Return(Literal(index + 1, I32)))
        faulted = Binary("!=", fault, Literal(0, U32))
        yield code.Scope((code.Var(fault.text, U32), called, If(faulted, failed)))

    def _enter(self) -> Function:
        """Handles the instances of a new state. Instances with the same set of states share one test. An instance in
        all states never becomes stale."""
        m = self.m
        groups: dict[tuple[int, ...], list[int]] = {}
        for index in range(len(m.instances)):
            states = tuple(n for n, s in enumerate(m.states) if any(e.instance == index for e in s.entries))
            if len(states) < len(m.states):
                groups.setdefault(states, []).append(index)
        body: list[Statement] = []
        ends = (Name("left"), Name("entered"))
        if not any(len(states) > 1 for states in groups):
            body += [code.Unused(end.text) for end in ends]
        if not groups:
            body.append(code.Unused("m"))
        for states, instances in groups.items():
            stale = [store for instance in instances for store in self._made_stale(instance)]
            if len(states) > 1:
                both = [one_of([Binary("==", end, state_constant(m, n)) for n in states]) for end in ends]
                body.append(If(code.Not(code.And(tuple(both))), tuple(stale)))
            else:
                body += stale
        comment = (
            "On entering a state: instances scheduled in it and in the one that is left continue; the others are stale."
        )
        parameters: tuple[tuple[str, code.Type], ...] = (("m", self.pointer), *((end.text, STATE) for end in ends))
        return Function(f"fcsl_enter_{m.name}", parameters, None, tuple(body), comment, inline="rare")

    def _made_stale(self, index: int) -> Iterator[Statement]:
        instance = self.m.instances[index]
        yield Set(health_of(instance), health(3))
        if index in self.m.completed:
            yield Set(Member(record_of(instance), "completed"), Literal(0, code.U8))

    def _step(self) -> Function:
        m, host = self.m, Name("host")
        body: list[Statement] = []
        if len(m.states) > 1:
            enter = Do(Call(f"fcsl_enter_{m.name}", (MACHINE.pointer, _ACTIVE, _NEXT)))
            body.append(If(Binary("!=", _ACTIVE, _NEXT), (enter, Set(_ACTIVE, _NEXT), *self._restart())))
        body += map(self._age, sensors(m))
        ticks = [Do(Call(f"fcsl_tick_{m.name}_{state.name}", (MACHINE.pointer, host))) for state in m.states]
        if len(ticks) > 1:
            cases = tuple((state_constant(m, index), (tick,)) for index, tick in enumerate(ticks))
            body.append(code.Select(_ACTIVE, cases))
        else:
            body += ticks
        if m.counts_state_ticks:
            body.append(Update(TICKS_IN_STATE, "+", ONE))
        body.append(Update(TICK, "+", ONE))
        return self._of_descriptor("step", ((host.text, HOST_TYPE),), body)

    def _restart(self) -> list[Statement]:
        return [Set(TICKS_IN_STATE, Literal(0, U64))] if self.m.counts_state_ticks else []

    def _age(self, channel: Channel) -> Statement:
        """Updates a sensor channel. A sample sets its age; without one the age increases. From its first sample on, the
        channel is valid up to its maximum age."""

        def own(member: str) -> Member:
            return channel_place(channel, member)

        tests: list[code.Expr] = []
        if channel.max_age_ticks is not None:
            tests.append(Binary("<=", own("age_ticks"), Literal(channel.max_age_ticks, U32)))
        young = code.Convert(code.U8, tests[0]) if tests else Literal(1, code.U8)
        tests.append(Binary("==", own("waiting"), Literal(0, code.U8)))
        is_valid = code.And(tuple(tests)) if len(tests) > 1 else tests[0]
        sampled: list[Statement] = [Set(own("fresh"), Literal(0, code.U8)), Set(own("age_ticks"), own("sample_age"))]
        if channel.name in self.m.last_samples:
            sampled.append(Set(own("last_sample"), Binary("+", TICK, ONE)))
        sampled += [Set(own("waiting"), Literal(0, code.U8)), Set(own("valid"), young)]
        older = (Update(own("age_ticks"), "+", Literal(1, U32)), Set(own("valid"), code.Convert(code.U8, is_valid)))
        is_attached = Binary("!=", own("attached"), Literal(0, code.U8))
        can_age = code.And((is_attached, Binary("<", own("age_ticks"), _GREATEST_AGE)))
        is_fresh = Binary("!=", own("fresh"), Literal(0, code.U8))
        return If(is_fresh, tuple(sampled), (If(can_age, older),))

    def _force_state(self) -> Function:
        m, state = self.m, Name("entered")
        body: list[Statement] = [code.Let(state.text, STATE, code.Convert(STATE, Name("state")))]
        if len(m.states) > 1:
            enter = Do(Call(f"fcsl_enter_{m.name}", (MACHINE.pointer, _ACTIVE, state)))
            body.append(If(Binary("!=", _ACTIVE, state), (enter,)))
        body += [Set(_ACTIVE, state), Set(_NEXT, state), *self._restart()]
        return self._of_descriptor("force_state", (("state", I32),), body)
