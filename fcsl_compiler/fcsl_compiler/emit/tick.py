# SPDX-License-Identifier: Apache-2.0
"""Generates C of a tick in each state: due tests, connections, instance calls and verdicts, and the arbitration at the
end."""

from __future__ import annotations

import re
from collections.abc import Iterable
from itertools import groupby

from ..model.c_names import c_literal, c_name
from ..model.machine import Channel, Connection, Edge, Entry, Instance, Machine, PortRef, State
from ..model.types import F64, Array
from .c_writer import CWriter
from .header import HEALTH_CONSTANTS, channel_member, request_constant, sensors, state_constant
from .inline_size import takes_bodies_in

#: Maximum number of instances in one C function. The time of C compilers grows faster than linearly with the size of a
#: function.
_PART = 50


def port_place(machine: Machine, port: PortRef) -> str:
    path = ".".join(c_name(part) for part in (port.field, *port.members))
    return f"m->i_{machine.instances[port.instance].name}.{port.record}.{path}"


def due_name(entry: Entry) -> str:
    """The C variable that is true if an entry is due; "" for an entry that is due in every tick."""
    return f"due_{entry.divisor}_{entry.phase}" if entry.divisor > 1 else ""


def _any_due(entries: list[Entry]) -> str:
    """C condition that one of the entries is due; "" if one is due in every tick."""
    names = dict.fromkeys(map(due_name, entries))
    return "" if "" in names else " || ".join(names)


def _static(attributes: list[str], result: str) -> str:
    """Start of the definition of a static function."""
    return f"static __attribute__(({', '.join(attributes)})) {result}" if attributes else f"static {result}"


class TickEmitter:
    """Generates one function per state, and its callees."""

    def __init__(self, machine: Machine, writer: CWriter):
        self.m, self.w = machine, writer
        self.inlined = ["flatten"] if takes_bodies_in(machine) else []
        self.feeds: dict[int, list[Connection]] = {}
        for connection in machine.connections:
            if not connection.delayed:
                self.feeds.setdefault(connection.target.instance, []).append(connection)
        self.guards: dict[int, list[Channel]] = {}
        for channel in sensors(machine):
            self.guards.setdefault(channel.port.instance, []).append(channel)

    def emit(self) -> None:
        if any(i.max_wcet_us for i in self.m.instances):
            self._clock()
        for state in self.m.states:
            self._state(state)

    def _clock(self) -> None:
        w = self.w
        w.line("/* Without a clock all times are 0. */")
        w.line(f"static inline uint64_t fcsl_now_{self.m.name}(const fcsl_host_t *host)")
        w.open_body()
        w.line("return host->clock_ns != NULL ? host->clock_ns(host->ctx) : 0u;")
        w.close()
        w.line()

    # ---- one state -------------------------------------------------------------------------------------------------

    def _state(self, state: State) -> None:
        entries, name = list(enumerate(state.entries)), f"fcsl_tick_{self.m.name}_{state.name}"
        readings, timed = self._readings(state), any(self._is_timed(e) for e in state.entries)
        parts = [entries[at : at + _PART] for at in range(0, len(entries), _PART)]
        calls: list[str] = []
        for number, part in enumerate(parts if len(parts) > 1 else []):
            # Each part gets now_ns, the last reading of the clock, and returns it.
            result, given, handed = ("uint64_t", ", uint64_t now_ns", ", now_ns") if timed else ("void", "", "")
            head = _static(["noinline", *self.inlined], result)
            self.w.line(f"{head} {name}_{number}({self.m.name}_t *m, const fcsl_host_t *host{given})")
            with _Body(self.w):
                self._dues(e for at, entry in part for e in (entry, *readings.get(at, ())))
                self._entries(part, readings)
                if timed:
                    self.w.line("return now_ns;")
            calls.append(f"{'now_ns = ' if timed else ''}{name}_{number}(m, host{handed});")
        attributes = [] if calls else self.inlined
        self.w.line(f"{_static(attributes, 'void')} {name}({self.m.name}_t *m, const fcsl_host_t *host)")
        with _Body(self.w):
            self._tick(state, calls, readings, timed)

    def _tick(self, state: State, calls: list[str], readings: dict[int, list[Entry]], timed: bool) -> None:
        w = self.w
        used = [e for e in state.entries if not calls or self._tests_due(state, e)]
        self._dues(used)
        if timed:
            w.line("uint64_t now_ns = 0u; /* the last reading of the clock */")
        self._delayed(state)
        for line in calls:
            w.line(line)
        if not calls:
            self._entries(list(enumerate(state.entries)), readings)
        elif timed:
            w.line("(void)now_ns;")
        if state.entries:
            w.line("*(volatile int32_t *)&m->current_ = FCSL_NONE;")
        edges = [e for e in self.m.edges if self.m.states[e.source] is state]
        for position, edge in enumerate(edges):
            self._edge(state, edge, position)
        if edges:
            w.close()

    def _tests_due(self, state: State, entry: Entry) -> bool:
        """Whether the function of the state itself, not one of its parts, tests if this entry is due. Delayed
        connections and edges need this."""
        here = [e for e in self.m.edges if self.m.states[e.source] is state]
        wanted = {self.m.requests[e.request] for e in here if e.request >= 0}
        return (
            any(c.delayed and c.target.instance == entry.instance for c in self.m.connections)
            or any(e.guard_instance == entry.instance and e.guard_mask & 7 for e in here)
            or bool(wanted & set(self.m.requests_of(self.m.instances[entry.instance])))
        )

    def _dues(self, entries: Iterable[Entry]) -> None:
        """Evaluates each rate and phase once."""
        for name, entry in {due_name(e): e for e in entries}.items():
            if name:
                self.w.line(f"const bool {name} = m->tick % {entry.divisor}u == {entry.phase}u;")

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

    def _entries(self, entries: list[tuple[int, Entry]], readings: dict[int, list[Entry]]) -> None:
        """Runs the entries in order. Consecutive entries with the same due condition share one test."""
        w, reading = self.w, f"now_ns = fcsl_now_{self.m.name}(host);"
        opened = ""
        for position, entry in entries:
            due, span = due_name(entry), _any_due(readings[position]) if position in readings else None
            if opened and (due != opened or span not in (None, due)):
                w.close()
                opened = ""
            if span is not None and span != due:
                if span:
                    with w.braces(f"if ({span})"):
                        w.line(reading)
                else:
                    w.line(reading)
            if due and due != opened:
                w.open(f"if ({due})")
                opened = due
            if span is not None and span == due:
                w.line(reading)
            self._run(entry)
        if opened:
            w.close()

    def _delayed(self, state: State) -> None:
        """Copies delayed connections. This precedes all writes of the tick, so the values are those of the previous
        tick."""
        m, w = self.m, self.w
        due = {e.instance: due_name(e) for e in state.entries}
        delayed = [c for c in m.connections if c.delayed and c.target.instance in due]
        if not delayed:
            return
        with w.braces("if (m->tick > 0u)"):
            for name, connections in groupby(delayed, lambda c: due[c.target.instance]):
                if name:
                    w.open(f"if ({name})")
                for connection in connections:
                    self._copy(connection, None)
                if name:
                    w.close()

    def _copy(self, connection: Connection, entry: Entry | None) -> None:
        """Copies a connection. `entry`: entry of the receiver, None for a delayed connection (its source is never
        `machine`)."""
        target = port_place(self.m, connection.target)
        if connection.source.instance < 0:
            assert entry is not None
            of = self._of_channel if connection.source.record == "channels" else self._of_machine
            self.w.line(f"{target} = {of(connection.source, entry)};")
        elif isinstance(connection.target.type, Array):
            self.w.line(f"memcpy({target}, {port_place(self.m, connection.source)}, sizeof {target});")
        else:
            self.w.line(f"{target} = {port_place(self.m, connection.source)};")

    def _of_machine(self, source: PortRef, entry: Entry) -> str:
        hz, receiver = self.m.tick_hz, f"m->i_{self.m.instances[entry.instance].name}"
        period, resumed = c_literal(entry.divisor / hz, F64), f"{receiver}.outputs.health == FCSL_STALE"
        since = f"(double)(m->tick + 1u - {receiver}.last_run)"
        return {
            "dt": c_literal(1.0 / hz, F64),
            # floor(tick * 1e9 / hz) without overflow: whole seconds and the remainder are computed separately.
            "time_ns": f"(int64_t)((m->tick / {hz}u) * 1000000000u + (m->tick % {hz}u) * 1000000000u / {hz}u)",
            "tick": "m->tick",
            "period": period,
            "elapsed": f"{resumed} ? {period} : {since} / {c_literal(float(hz), F64)}",
            "resumed": resumed,
            "ticks_in_state": "m->ticks_in_state",
        }[source.field]

    def _of_channel(self, source: PortRef, entry: Entry) -> str:
        channel = f"m->{channel_member(self.m.channel(source.field))}"
        return {
            "valid": f"{channel}.valid != 0u",
            "age_ticks": f"{channel}.age_ticks",
            "fresh": f"{channel}.last_sample > m->i_{self.m.instances[entry.instance].name}.last_run",
        }[source.members[0]]

    # ---- one instance ----------------------------------------------------------------------------------------------

    def _run(self, entry: Entry) -> None:
        w, instance = self.w, self.m.instances[entry.instance]
        record = f"m->i_{instance.name}"
        for connection in self.feeds.get(entry.instance, []):
            self._copy(connection, entry)
        if entry.instance in self.m.last_runs:
            w.line(f"{record}.last_run = m->tick + 1u;")
        # A watchdog thread reads it while execute runs, so the compiler must not remove the store.
        w.line(f"*(volatile int32_t *)&m->current_ = {entry.instance};")
        self._execute(entry, instance, record)
        if instance.max_wcet_us:
            self._verdict(instance, record)
        invalid = self.guards.get(entry.instance)
        if invalid:
            test = " || ".join(f"m->{channel_member(c)}.valid == 0u" for c in invalid)
            with w.braces(f"if ({test})"):
                w.line(f"{record}.outputs.health = FCSL_FAILED;")

    def _execute(self, entry: Entry, instance: Instance, record: str) -> None:
        """Writes exactly one call of execute, used with and without injected health: a second inlined call would add to
        the stack."""
        w, own = self.w, f"{self.m.name}_{instance.name}"
        fault = f"if ({record}.inject_fault == 1u)"
        if instance.algorithm.effects:
            w.open(f"if (host->substitute != NULL && host->substitute(host->ctx, {entry.instance}u) != 0)")
            w.line(f"{record}.inject_fault = 0u;")  # the substituted record contains its effect
            w.reopen(f"else {fault}")
        else:
            w.open(fault)
        w.line(f"fcsl_fault_{own}(&{record});")
        w.reopen("else")
        host = ", host" if instance.execute.uses_hardware else ""
        w.line(f"(void){own}_execute(&{record}{host});")
        with w.braces(f"if ({record}.inject_fault != 0u)"):
            w.line(f"fcsl_worsen_{own}(&{record});")
        w.close()

    def _verdict(self, instance: Instance, record: str) -> None:
        w = self.w
        with w.braces(""):
            w.line("const uint64_t began_ns = now_ns;")
            w.line(f"now_ns = fcsl_now_{self.m.name}(host);")
            limit_ns = instance.max_wcet_us * 1000
            with w.braces(f"if ({record}.inject_overrun != 0u || now_ns - began_ns > {limit_ns}u)"):
                w.line(f"fcsl_overrun_{self.m.name}_{instance.name}(&{record});")

    # ---- the end of a tick -----------------------------------------------------------------------------------------

    def _edge(self, state: State, edge: Edge, position: int) -> None:
        """One branch of the arbitration. Edges are in falling priority; the first whose conditions are true is
        taken."""
        m, w = self.m, self.w
        entries = {e.instance: e for e in state.entries}
        tests: list[str] = []
        if edge.after_ticks:
            tests.append(f"m->ticks_in_state + 1u >= {edge.after_ticks}u")
        if edge.request >= 0:
            request = m.requests[edge.request]
            makers = []
            for entry in state.entries:
                if request in m.requests_of(m.instances[entry.instance]):
                    name = m.instances[entry.instance].name
                    made = f"m->i_{name}.outputs.transition_request == {request_constant(m, request)}"
                    makers.append(made if entry.divisor == 1 else f"({due_name(entry)} && {made})")
            tests.append(" || ".join(makers) if makers else "false")
        if edge.guard_instance >= 0:
            tests.append(self._guard(entries.get(edge.guard_instance), edge))
        condition = " && ".join(f"({t})" if len(tests) > 1 else t for t in tests)
        w.origin = edge.span
        if position == 0:
            w.open(f"if ({condition})")
        else:
            w.reopen(f"else if ({condition})")
        w.line(f"m->next_state_ = {state_constant(m, edge.target)};")
        w.origin = None

    def _guard(self, entry: Entry | None, edge: Edge) -> str:
        """C condition of a guard. `nominal`, `degraded` and `failed` count only on ticks when the instance ran; `stale`
        counts always."""
        name = self.m.instances[edge.guard_instance].name
        health = f"m->i_{name}.outputs.health"
        words = [i for i in range(4) if edge.guard_mask >> i & 1]
        ran = [f"{health} == {HEALTH_CONSTANTS[i]}" for i in words if i < 3]
        tests: list[str] = []
        if entry is not None and ran:
            word = " || ".join(ran)
            tests.append(word if entry.divisor == 1 else f"({due_name(entry)} && ({word}))")
        if 3 in words:
            tests.append(f"{health} == FCSL_STALE")
        return " || ".join(tests) if tests else "false"


class _Body:
    """Body of a function. Adds `(void)` statements for unused arguments."""

    def __init__(self, writer: CWriter):
        self.w = writer

    def __enter__(self) -> None:
        self.w.open_body()
        self.mark = self.w.mark()

    def __exit__(self, *_: object) -> None:
        body = self.w.cut(self.mark)
        for argument in ("m", "host"):
            if not any(re.search(rf"\b{argument}\b", line) for line in body[0]):
                self.w.line(f"(void){argument};")
        self.w.paste(body)
        self.w.close()
        self.w.line()
