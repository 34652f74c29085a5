# SPDX-License-Identifier: Apache-2.0
"""Makes code of a tick in each state: due tests, connections, instance calls and verdicts, and the arbitration at the
end."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import groupby

from ..model import code
from ..model.c_names import c_name
from ..model.code import Binary, Call, Deref, Do, Function, If, Literal, Member, Name, Set, Statement, Update
from ..model.events import first_sites
from ..model.machine import Channel, Connection, Edge, Entry, Instance, Machine, PortRef, State
from ..model.types import BOOL, F64, I32, I64, U32, U64
from .cold_paths import call_begin, call_fault, call_overrun, call_worsen
from .copies import copied
from .expressions import code_type
from .functions import HOST_TYPE
from .inline_size import takes_bodies_in
from .instances import execute_name, run_quiet
from .names import (
    channel_member,
    health,
    instance_member,
    machine_type,
    request_constant,
    sensors,
    state_constant,
)
from .status_elision import noted_instances
from .watched import apply_effects, copy_watched

#: Maximum number of instances in one function. The time of C compilers grows faster than linearly with the size of a
#: function.
PART = 25

_HOST = Name("host")
_NOW = Name("now_ns")
MACHINE = Deref(Name("m"))
TICK = Member(MACHINE, "tick")
TICKS_IN_STATE = Member(MACHINE, "ticks_in_state")
ONE = Literal(1, U64)
#: The absent index of fcsl_machine.h.
NO_INSTANCE = Name("FCSL_NONE")


def record_of(instance: Instance) -> Member:
    return Member(MACHINE, instance_member(instance))


def port_place(machine: Machine, port: PortRef) -> code.Place:
    place: code.Place = Member(record_of(machine.instances[port.instance]), port.record)
    for part in (port.field, *port.members):
        place = Member(place, c_name(part))
    return place


def channel_place(channel: Channel, member: str) -> Member:
    return Member(Member(MACHINE, channel_member(channel)), member)


def health_of(instance: Instance) -> Member:
    return Member(Member(record_of(instance), "outputs"), "health")


def one_of(tests: Sequence[code.Expr]) -> code.Expr:
    """True if one of them is; none gives false."""
    if len(tests) > 1:
        return code.Or(tuple(tests))
    return tests[0] if tests else Literal(False, BOOL)


def due_name(entry: Entry) -> str:
    """The variable that is true if an entry is due; "" for an entry that is due in every tick."""
    return f"due_{entry.divisor}_{entry.phase}" if entry.divisor > 1 else ""


def _when_due(entry: Entry, test: code.Expr) -> code.Expr:
    return test if entry.divisor == 1 else code.And((Name(due_name(entry)), test))


def _if_any(name: str, body: Sequence[Statement]) -> tuple[Statement, ...]:
    """The body, if the variable is true; "" stands for true."""
    return (If(Name(name), tuple(body)),) if name else tuple(body)


class TickEmitter:
    """Makes one function per state, and its callees."""

    def __init__(self, machine: Machine, quiet: frozenset[int], firsts: Sequence[int], times: bool):
        """`quiet`: instances, see status_elision.py. `firsts`: see identical_code_folding.py. `times`: the host measures
        each instance."""
        self.m, self.quiet, self.firsts, self.times = machine, quiet, firsts, times
        self.flatten = takes_bodies_in(machine)
        self.noted = noted_instances(machine)
        self.first_sites = first_sites(machine)
        self.pointer = code.Pointer(code.Named(machine_type(machine)), writable=True)
        self.delayed = {c.target.instance for c in machine.connections if c.delayed}
        self.feeds: dict[int, list[Connection]] = {}
        for connection in machine.connections:
            if not connection.delayed:
                self.feeds.setdefault(connection.target.instance, []).append(connection)
        self.guards: dict[int, list[Channel]] = {}
        for channel in sensors(machine):
            self.guards.setdefault(channel.port.instance, []).append(channel)

    def emit(self) -> Iterator[Function]:
        if any(i.max_wcet_us for i in self.m.instances):
            yield self._clock()
        for state in self.m.states:
            yield from self._state(state)

    def _clock(self) -> Function:
        clock = Member(Deref(_HOST), "clock_ns")
        given = Binary("!=", clock, code.Null())
        time = code.Choice(given, Call(clock, (Member(Deref(_HOST), "ctx"),)), Literal(0, U64))
        name, parameters = f"fcsl_now_{self.m.name}", ((_HOST.text, HOST_TYPE),)
        return Function(name, parameters, U64, (code.Return(time),), "Without a clock all times are 0.", "hint")

    # ---- one state -------------------------------------------------------------------------------------------------

    def _state(self, state: State) -> Iterator[Function]:
        entries, name = list(enumerate(state.entries)), f"fcsl_tick_{self.m.name}_{state.name}"
        readings, timed = self._readings(state), any(self._is_timed(e) for e in state.entries)
        parts = [entries[at : at + PART] for at in range(0, len(entries), PART)]
        calls: list[Statement] = []
        for number, part in enumerate(parts if len(parts) > 1 else []):
            # Each part gets the last reading of the clock and returns its own.
            dues = self._dues(e for at, entry in part for e in (entry, *readings.get(at, ())))
            body = [*dues, *self._entries(part, readings)]
            last = Name("last_ns")
            if timed:
                body = [code.Var(_NOW.text, U64, last), *body, code.Return(_NOW)]
            more = ((last.text, U64),) if timed else ()
            yield self._function(f"{name}_{number}", body, more, U64 if timed else None, apart=True)
            called = Call(f"{name}_{number}", (MACHINE.pointer, _HOST, *([_NOW] if timed else [])))
            calls.append(Set(_NOW, called) if timed else Do(called))
        if self._losing(state):
            yield self._lost(state)
        yield self._function(name, self._tick(state, calls, readings, timed), flatten=not calls)

    def _function(
        self,
        name: str,
        body: list[Statement],
        more: tuple[tuple[str, code.Type], ...] = (),
        result: code.Type | None = None,
        apart: bool = False,
        flatten: bool = True,
    ) -> Function:
        used = code.used_names(body)
        unused = [code.Unused(argument) for argument in ("m", _HOST.text) if argument not in used]
        parameters = (("m", self.pointer), (_HOST.text, HOST_TYPE), *more)
        inline = "never" if apart else "usual"
        return Function(name, parameters, result, (*unused, *body), inline=inline, flatten=flatten and self.flatten)

    def _tick(
        self, state: State, calls: list[Statement], readings: dict[int, list[Entry]], timed: bool
    ) -> list[Statement]:
        body: list[Statement] = list(self._dues(e for e in state.entries if not calls or self._tests_due(state, e)))
        if timed:
            body.append(code.Var(_NOW.text, U64, Literal(0, U64), comment="the last reading of the clock"))
        body += self._delayed(state)
        if self.times and state.entries:
            body.append(self._measure(NO_INSTANCE))
        body += calls
        if not calls:
            body += self._entries(list(enumerate(state.entries)), readings)
        elif timed:
            body.append(code.Unused(_NOW.text))
        if any(e.instance in self.noted for e in state.entries):
            body.append(Set(Member(MACHINE, "current_"), NO_INSTANCE, volatile=True))
        return [*body, *apply_effects(self.m), *self._arbitration(state)]

    def _tests_due(self, state: State, entry: Entry) -> bool:
        """Whether the function of the state itself, not one of its parts, tests if this entry is due. Delayed
        connections and edges need this."""
        here = [e for e in self.m.edges if self.m.states[e.source] is state]
        wanted = {self.m.requests[e.request] for e in here if e.request >= 0}
        return (
            entry.instance in self.delayed
            or any(e.guard_instance == entry.instance and e.guard_mask & 7 for e in here)
            or bool(wanted & set(self.m.requests_of(self.m.instances[entry.instance])))
        )

    def _dues(self, entries: Iterable[Entry]) -> Iterator[Statement]:
        """Evaluates each rate and phase once."""
        for name, entry in {due_name(e): e for e in entries}.items():
            if name:
                rest = Binary("%", TICK, Literal(entry.divisor, U64))
                yield code.Let(name, BOOL, Binary("==", rest, Literal(entry.phase, U64)))

    def _is_timed(self, entry: Entry) -> bool:
        return self.m.instances[entry.instance].max_wcet_us > 0

    def _readings(self, state: State) -> dict[int, list[Entry]]:
        """The first position of each span of consecutive timed instances, with its entries. The clock is read there if
        one of them is due. Within a span, the end of one instance is the beginning of the next, so n instances take n +
        1 readings."""
        found: dict[int, list[Entry]] = {}
        for timed, span in groupby(enumerate(state.entries), lambda e: self._is_timed(e[1])):
            positions = list(span)
            if timed:
                found[positions[0][0]] = [e for _, e in positions]
        return found

    def _read_clock(self) -> Set:
        return Set(_NOW, Call(f"fcsl_now_{self.m.name}", (_HOST,)))

    def _entries(self, entries: list[tuple[int, Entry]], readings: dict[int, list[Entry]]) -> list[Statement]:
        """Runs the entries in order. Consecutive entries with the same due condition share one test."""
        body: list[Statement] = []
        shared: list[Statement] = []  # the body of the test that is open
        opened = ""

        def close() -> None:
            if shared:
                body.append(If(Name(opened), tuple(shared)))
                shared.clear()

        for position, entry in entries:
            due = due_name(entry)
            span = list(dict.fromkeys(map(due_name, readings[position]))) if position in readings else None
            # The clock is read within the test of this entry if it alone tells whether one of the span is due.
            within = span == [due]
            if due != opened or not (span is None or within):
                close()
                opened = due
            if span is not None and not within:
                always = "" in span
                body += [self._read_clock()] if always else [If(one_of(list(map(Name, span))), (self._read_clock(),))]
            to = shared if due else body
            if within:
                to.append(self._read_clock())
            to += self._run(entry)
        close()
        return body

    def _delayed(self, state: State) -> Iterator[Statement]:
        """Copies delayed connections. This precedes all writes of the tick, so the values are those of the previous
        tick."""
        due = {e.instance: due_name(e) for e in state.entries}
        delayed = [c for c in self.m.connections if c.delayed and c.target.instance in due]
        if not delayed:
            return
        body: list[Statement] = []
        for name, connections in groupby(delayed, lambda c: due[c.target.instance]):
            body += _if_any(name, [self._copy(connection, None) for connection in connections])
        yield If(Binary(">", TICK, Literal(0, U64)), tuple(body))

    def _copy(self, connection: Connection, entry: Entry | None) -> Statement:
        """Copies a connection. `entry`: entry of the receiver, None for a delayed connection (its source is never
        `machine`)."""
        target, type_ = port_place(self.m, connection.target), code_type(self.m.name, connection.target.type)
        if connection.source.instance < 0:
            assert entry is not None
            of = self._of_channel if connection.source.record == "channels" else self._of_machine
            return Set(target, of(connection.source, entry))
        return copied(target, port_place(self.m, connection.source), type_)

    def _of_machine(self, source: PortRef, entry: Entry) -> code.Expr:
        hz, receiver = self.m.tick_hz, self.m.instances[entry.instance]
        if source.field == "tick":
            return TICK
        if source.field == "ticks_in_state":
            return TICKS_IN_STATE
        if source.field == "dt":
            return Literal(1.0 / hz, F64)
        if source.field == "time_ns":
            return self._time_ns()
        period = Literal(entry.divisor / hz, F64)
        resumed = Binary("==", Member(record_of(receiver), "completed"), Literal(0, code.U8))
        if source.field == "elapsed":
            ticks = Binary("-", Binary("+", TICK, ONE), Member(record_of(receiver), "last_run"))
            since = Binary("/", code.Convert(F64, ticks), Literal(float(hz), F64))
            return code.Choice(resumed, period, since)
        return period if source.field == "period" else resumed

    def _time_ns(self) -> code.Expr:
        """floor(tick * 1e9 / hz) without overflow: whole seconds and the remainder are computed separately."""
        hz, second = Literal(self.m.tick_hz, U64), Literal(1_000_000_000, U64)
        whole = Binary("*", Binary("/", TICK, hz), second)
        rest = Binary("/", Binary("*", Binary("%", TICK, hz), second), hz)
        return code.Convert(I64, Binary("+", whole, rest))

    def _of_channel(self, source: PortRef, entry: Entry) -> code.Expr:
        channel = self.m.channel(source.field)
        if source.members[0] == "fresh":
            last_run = Member(record_of(self.m.instances[entry.instance]), "last_run")
            return Binary(">", channel_place(channel, "last_sample"), last_run)
        if source.members[0] == "valid":
            return Binary("!=", channel_place(channel, "valid"), Literal(0, code.U8))
        return channel_place(channel, "age_ticks")

    # ---- one instance ----------------------------------------------------------------------------------------------

    def _run(self, entry: Entry) -> list[Statement]:
        instance = self.m.instances[entry.instance]
        body = [self._copy(connection, entry) for connection in self.feeds.get(entry.instance, [])]
        body += [copy_watched(self.m, w) for w in self.m.watched if w.instance == entry.instance]
        if entry.instance in self.noted:
            # A watchdog thread reads it while execute runs, so the compiler must not remove the store.
            body.append(Set(Member(MACHINE, "current_"), Literal(entry.instance, I32), volatile=True))
        body.append(self._completed(entry.instance, self._execute(entry, instance)))
        if instance.max_wcet_us:
            body.append(self._verdict(instance))
        invalid = self.guards.get(entry.instance)
        if invalid:
            tests = [Binary("==", channel_place(c, "valid"), Literal(0, code.U8)) for c in invalid]
            body.append(If(one_of(tests), self._invalid(instance, invalid)))
        if self.times:
            body.append(self._measure(Literal(entry.instance, I32)))
        return body

    @staticmethod
    def _measure(instance: code.Expr) -> Statement:
        """The host reads its clock: what passed since it last did is the time of this instance."""
        measure = Member(Deref(_HOST), "measure")
        called = Call(measure, (Member(Deref(_HOST), "ctx"), instance))
        return If(Binary("!=", measure, code.Null()), (Do(called),))

    @staticmethod
    def _invalid(instance: Instance, channels: list[Channel]) -> tuple[Statement, ...]:
        """The health of an instance of which a channel is invalid: failed, or at least degraded while all that are
        invalid may still wait for their first sample."""
        failed = Set(health_of(instance), health(2))
        gone: list[code.Expr] = []
        for channel in channels:
            may_wait: list[code.Expr] = [Binary("!=", channel_place(channel, "waiting"), Literal(0, code.U8))]
            if channel.grace_ticks is not None:
                age = channel_place(channel, "age_ticks")
                may_wait.append(Binary("<=", age, Literal(channel.grace_ticks, U32)))
            waits = code.And(tuple(may_wait)) if len(may_wait) > 1 else may_wait[0]
            invalid = Binary("==", channel_place(channel, "valid"), Literal(0, code.U8))
            gone.append(code.And((invalid, code.Not(waits))))
        is_nominal = Binary("==", health_of(instance), health(0))
        return (If(one_of(gone), (failed,), (If(is_nominal, (Set(health_of(instance), health(1)),)),)),)

    def _completed(self, index: int, execute: Statement) -> Statement:
        """An execute, after which what needs it is stored, unless it faulted, by itself, injected or substituted."""
        record = record_of(self.m.instances[index])
        stores: list[Statement] = []
        if index in self.m.last_runs:
            stores.append(Set(Member(record, "last_run"), Binary("+", TICK, ONE)))
        if index in self.m.completed:
            stores.append(Set(Member(record, "completed"), Literal(1, code.U8)))
        if not stores:
            return execute
        before, faults = Name("faults_before"), Member(Member(record, "counters"), "faults")
        return code.Scope(
            (code.Let(before.text, U64, faults), execute, If(Binary("==", faults, before), tuple(stores)))
        )

    def _execute(self, entry: Entry, instance: Instance) -> Statement:
        """Exactly one call of execute, used with and without injected health: a second inlined call would add to the
        stack."""
        record, first = record_of(instance), self.m.instances[self.firsts[entry.instance]]
        this = code.Address(record)
        inject = Member(Member(record, "counters"), "inject_fault")
        if entry.instance in self.quiet:
            usual = (Binary("==", inject, Literal(0, code.U8)), Binary("==", health_of(instance), health(0)))
            runs = code.Or((code.And(usual), call_begin(self.m, instance)))
            return If(runs, (run_quiet(self.m, first, record),))
        arguments = (this, _HOST) if instance.execute.takes_host else (this,)
        worsen = If(Binary("!=", inject, Literal(0, code.U8)), (call_worsen(self.m, instance),))
        execute = Do(Call(execute_name(self.m, first), arguments), unused=True)
        is_fault = Binary("==", inject, Literal(1, code.U8))
        run: tuple[Statement, ...] = (execute, worsen)
        if instance.execute.has_events:
            site = Literal(self.first_sites[entry.instance], U32)
            run = (Do(Call("fcsl_event_begin", (_HOST, site))), *run)
        whole = If(is_fault, (call_fault(self.m, instance),), run)
        if not instance.algorithm.effects:
            return whole
        substitute = Member(Deref(_HOST), "substitute")
        called = Call(substitute, (Member(Deref(_HOST), "ctx"), Literal(entry.instance, U32)))
        is_substituted = code.And((Binary("!=", substitute, code.Null()), Binary("!=", called, Literal(0, I32))))
        # The substituted record contains the effect of an injected fault.
        executed = Member(Deref(_HOST), "executed")
        report = Do(Call(executed, (Member(Deref(_HOST), "ctx"), Literal(entry.instance, U32))))
        reports = If(Binary("!=", executed, code.Null()), (report,))
        return If(is_substituted, (Set(inject, Literal(0, code.U8)),), (whole, reports))

    def _verdict(self, instance: Instance) -> Statement:
        began = Name("began_ns")
        is_injected = Binary(
            "!=", Member(Member(record_of(instance), "counters"), "inject_overrun"), Literal(0, code.U8)
        )
        is_late = Binary(">", Binary("-", _NOW, began), Literal(instance.max_wcet_us * 1000, U64))
        return code.Scope(
            (
                code.Let(began.text, U64, _NOW),
                self._read_clock(),
                If(code.Or((is_injected, is_late)), (call_overrun(self.m, instance),)),
            )
        )

    # ---- the end of a tick -----------------------------------------------------------------------------------------

    def _arbitration(self, state: State) -> list[Statement]:
        """Edges are in falling priority; the first whose conditions are true is taken."""
        made: tuple[Statement, ...] = ()
        losing = self._losing(state)
        for number, edge in reversed([(n, e) for n, e in enumerate(self.m.edges) if self.m.states[e.source] is state]):
            taken: list[Statement] = [Set(Member(MACHINE, "next_state_"), state_constant(self.m, edge.target))]
            if any(number in self.m.preferred[loser] for loser in losing):
                taken.append(Do(Call(self._lost_name(state), (MACHINE.pointer, Literal(number, U32)))))
            made = (code.At(edge.span, quoted=False), If(self._condition(state, edge), tuple(taken), made))
        return [*made, code.At(None, quoted=False)] if made else []

    def _losing(self, state: State) -> list[int]:
        """The edges of a state that can lose their request to another one."""
        return [n for n in self.m.preferred if self.m.states[self.m.edges[n].source] is state]

    def _lost_name(self, state: State) -> str:
        return f"fcsl_lost_{self.m.name}_{state.name}"

    def _lost(self, state: State) -> Function:
        """Counts the requests that a taken edge leaves unanswered. Apart from the tick, which most often takes none."""
        taken, body = Name("taken"), list[Statement]()
        for number in self._losing(state):
            one = one_of([Binary("==", taken, Literal(n, U32)) for n in self.m.preferred[number]])
            count = code.Element(Member(MACHINE, "lost_requests"), Literal(number, U32))
            condition = code.And((one, self._condition(state, self.m.edges[number])))
            body.append(If(condition, (Update(count, "+", ONE),)))
        used = code.used_names(body)
        entries = [e for e in state.entries if due_name(e) in used]
        parameters: tuple[tuple[str, code.Type], ...] = (("m", self.pointer), (taken.text, U32))
        comment = "Counts requests that are lost because this edge is taken."
        return Function(self._lost_name(state), parameters, None, (*self._dues(entries), *body), comment, inline="rare")

    def _condition(self, state: State, edge: Edge) -> code.Expr:
        tests: list[code.Expr] = []
        if edge.after_ticks:
            tests.append(Binary(">=", Binary("+", TICKS_IN_STATE, ONE), Literal(edge.after_ticks, U64)))
        if edge.request >= 0:
            request = self.m.requests[edge.request]
            makers = []
            for entry in state.entries:
                maker = self.m.instances[entry.instance]
                if request in self.m.requests_of(maker):
                    made = Member(Member(record_of(maker), "outputs"), "transition_request")
                    constant = Name(request_constant(self.m.name, request))
                    makers.append(_when_due(entry, Binary("==", made, constant)))
            tests.append(one_of(makers))
        if edge.guard_instance >= 0:
            entries = {e.instance: e for e in state.entries}
            tests.append(self._guard(entries.get(edge.guard_instance), edge))
        return code.And(tuple(tests)) if len(tests) > 1 else tests[0]

    def _guard(self, entry: Entry | None, edge: Edge) -> code.Expr:
        """`nominal`, `degraded` and `failed` count only on ticks when the instance ran; `stale` counts always."""
        own = health_of(self.m.instances[edge.guard_instance])
        words = [i for i in range(4) if edge.guard_mask >> i & 1]
        ran = [Binary("==", own, health(i)) for i in words if i < 3]
        tests: list[code.Expr] = []
        if entry is not None and ran:
            tests += ran if entry.divisor == 1 else [_when_due(entry, one_of(ran))]
        if 3 in words:
            tests.append(Binary("==", own, health(3)))
        return one_of(tests)
