# SPDX-License-Identifier: Apache-2.0
"""One tick of a machine on terms: the scheduler as docs/architecture.md states it ("The tick").

The fields of a machine are those of its field table, by path. What is known stays a Python value, so that a tick from the
beginning of a flight is far smaller than one from any state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field

from bitwuzla import Kind, Term

from ..base.source import Span
from ..emit.field_table import FieldRow, field_table
from ..emit.names import sensors
from ..model import ir
from ..model.machine import Channel, Connection, Edge, Entry, Instance, Machine, PortRef
from ..model.ops import find
from ..model.types import BOOL, F64, HEALTH, I32, I64, REQUEST, SCALARS, U32, U64, Scalar, Type, leaves
from .execute import Executor, TooLarge, Values, Variable, scalars_of
from .operations import Operations
from .properties import ASSERTION
from .terms import Value

_NOMINAL, _DEGRADED, _FAILED, _STALE = range(4)
#: Scalar type by its name in a field table.
OF_ABI = {s.abi: s for s in SCALARS.values()} | {"FCSL_STATE": I32}

Fields = dict[str, Values]


@dataclass(frozen=True)
class Fault:
    """An assertion of an instance, and when it fails in a tick."""

    instance: int
    span: Span
    condition: Value


@dataclass(frozen=True)
class Inputs:
    """What a host gives to one tick: for each sensor, whether a sample came; and values, by path."""

    samples: dict[str, Value]
    values: Fields


@dataclass
class Tick:
    """The fields after a tick, and the assertions that it may fail."""

    fields: Fields
    active: list[Value] = field(default_factory=list)  # whether each state is the active one
    faults: list[Fault] = field(default_factory=list)


class MachineTerms:
    """The fields of a machine, and its step."""

    def __init__(self, machine: Machine, operations: Operations):
        self.m, self.o, self.t = machine, operations, operations.t
        self.rows = {row.path: row for row in field_table(machine)}
        self.types = {path: OF_ABI[row.abi_type] for path, row in self.rows.items()}
        self.opaque: dict[int, str] = {}  # instances that are not looked into, and why
        self.slots = _slots(machine)
        self.given = [row.path for row in host_fields(machine)]
        self.hyperperiod = math.lcm(1, *(e.divisor for s in machine.states for e in s.entries))
        self.sensors = sensors(machine)
        self.scheduled = [
            frozenset(n for n, s in enumerate(machine.states) if any(e.instance == i for e in s.entries))
            for i in range(len(machine.instances))
        ]
        self._guards: dict[int, list[Channel]] = {}
        for channel in self.sensors:
            self._guards.setdefault(channel.port.instance, []).append(channel)

    # ---- fields -----------------------------------------------------------------------------------------------------

    def paths(self, path: str, type_: Type) -> list[str]:
        """The rows of a value."""
        return [path + leaf.path for leaf in leaves(type_)]

    def values(self, fields: Fields, path: str, type_: Type) -> Values:
        return tuple(v for row in self.paths(path, type_) for v in fields[row])

    def store(self, fields: Fields, path: str, type_: Type, values: Values, condition: Value = True) -> None:
        """Writes a value where `condition` holds."""
        at = 0
        for row in self.paths(path, type_):
            before, scalar = fields[row], self.types[row]
            after = values[at : at + len(before)]
            at += len(before)
            fields[row] = tuple(self.t.choose(condition, a, b, scalar) for a, b in zip(after, before, strict=True))

    def port_path(self, port: PortRef) -> str:
        return f"{self.m.instances[port.instance].name}.{port.record}.{port.path}"

    def unknown(self, path: str) -> Values:
        row = self.rows[path]
        return tuple(self.t.fresh(self.types[path], path) for _ in range(row.count))

    def is_legal(self, path: str, values: Values) -> Iterator[Term]:
        """What holds of any value of a field: names are those that exist."""
        most = {
            "FCSL_TRANSITION_REQUEST": len(self.m.requests),
            "FCSL_HEALTH": _STALE,
            "FCSL_STATE": len(self.m.states) - 1,
        }.get(self.rows[path].abi_type)
        for value in values if most is not None else ():
            if isinstance(value, Term):
                yield self.t.make(Kind.BV_ULE, value, self.t.term(most, self.types[path]))

    # ---- what a host gives ------------------------------------------------------------------------------------------

    def inputs(self) -> tuple[Inputs, list[Term]]:
        """Unknown inputs of a tick, and what holds of them."""
        values = {row.path: self.unknown(row.path) for row in host_fields(self.m, sampled=True)}
        legal = [term for path, own in values.items() for term in self.is_legal(path, own)]
        return Inputs({c.name: self.t.fresh(BOOL, f"sample {c.name}") for c in self.sensors}, values), legal

    def any_fields(self, known: Fields) -> tuple[Fields, list[Term]]:
        """Any state of the machine, with the parameters of `known`, and what always holds of it."""
        fields: Fields = {}
        for path, row in self.rows.items():
            fields[path] = known[path] if row.role == "PARAMETER" else self.unknown(path)
        if len(self.m.states) == 1:
            fields |= {path: known[path] for path in ("machine.state", "machine.next_state")}
        legal = [term for path, values in fields.items() for term in self.is_legal(path, values)]
        tick = fields["machine.tick"][0]
        legal.append(self.compare("<", tick, 1 << 62, U64))
        if self.hyperperiod > 1:
            fields["phase"] = (self.t.fresh(U32, "phase"),)
            legal.append(self.compare("<", fields["phase"][0], self.hyperperiod, U32))
        return fields, [term for term in legal if isinstance(term, Term)]

    # ---- the tick ---------------------------------------------------------------------------------------------------

    def step(self, before: Fields, inputs: Inputs) -> Tick:
        fields = dict(before)
        fields.update((path, inputs.values[path]) for path in self.given if path in inputs.values)
        made = Tick(fields)
        if len(self.m.states) > 1:
            self._enter(fields)
        for channel in self.sensors:
            self._age(fields, channel, inputs)
        made.active = [self.t.equal(fields["machine.state"][0], n, I32) for n in range(len(self.m.states))]
        due: dict[int, Value] = {}
        for instance, entries in self.slots:
            due[instance] = self.t.any_of((due.get(instance, False), self._is_due(made, entries)))
        has_run = self.compare(">", fields["machine.tick"][0], 0, U64)
        for connection in self.m.connections:
            if connection.delayed and connection.target.instance in due:
                self._copy(fields, connection, self.t.all_of((has_run, due[connection.target.instance])))
        for instance, entries in self.slots:
            self._run(made, instance, entries, self._is_due(made, entries))
        self._apply_effects(fields)
        self._arbitrate(made, due)
        self._count(fields)
        return made

    def _enter(self, fields: Fields) -> None:
        (left,), (entered,) = fields["machine.state"], fields["machine.next_state"]
        changed = self.t.negation(self.t.equal(left, entered, I32))
        for index, states in enumerate(self.scheduled):
            if len(states) == len(self.m.states):
                continue
            both = self.t.all_of(
                self.t.any_of(self.t.equal(end, n, I32) for n in sorted(states)) for end in (left, entered)
            )
            stale = self.t.all_of((changed, self.t.negation(both)))
            name = self.m.instances[index].name
            self._set(fields, f"{name}.outputs.health", _STALE, stale)
            if index in self.m.completed:
                self._set(fields, f"{name}.counters.completed", False, stale)
        if self.m.counts_state_ticks:
            self._set(fields, "machine.ticks_in_state", 0, changed)
        fields["machine.state"] = (entered,)

    def _set(self, fields: Fields, path: str, value: Value, condition: Value) -> None:
        fields[path] = (self.t.choose(condition, value, fields[path][0], self.types[path]),)

    def _age(self, fields: Fields, channel: Channel, inputs: Inputs) -> None:
        """A sample is of this tick. The channel is attached."""
        path, came = f"channels.{channel.name}", inputs.samples[channel.name]
        port = self.port_path(channel.port)
        given = tuple(v for row in self.paths(port, channel.port.type) for v in inputs.values[row])
        self.store(fields, port, channel.port.type, given, came)
        (age,) = fields[f"{path}.age_ticks"]
        grows = self.compare("<", age, U32.high, U32)
        older = self.t.choose(grows, self._plus(age, 1, U32), age, U32)
        (waiting,) = fields[f"{path}.waiting"]
        young = True if channel.max_age_ticks is None else self.compare("<=", older, channel.max_age_ticks, U32)
        valid = self.t.all_of((self.t.negation(waiting), young))
        valid = self.t.choose(grows, valid, fields[f"{path}.valid"][0], BOOL)
        fields[f"{path}.age_ticks"] = (self.t.choose(came, 0, older, U32),)
        fields[f"{path}.valid"] = (self.t.any_of((came, valid)),)
        fields[f"{path}.waiting"] = (self.t.all_of((self.t.negation(came), waiting)),)
        fields[f"{path}.stamp_ns"] = self.unknown(f"{path}.stamp_ns")
        if channel.name in self.m.last_samples:
            self._set(fields, f"{path}.last_sample", self._plus(fields["machine.tick"][0], 1, U64), came)

    def _is_due(self, made: Tick, entries: Mapping[int, Entry]) -> Value:
        """Whether an instance runs in a tick, by its entries in the states."""
        parts = ((made.active[n], self._falls_due(made.fields, entry)) for n, entry in entries.items())
        return self.t.any_of(self.t.all_of(part) for part in parts)

    def _falls_due(self, fields: Fields, entry: Entry) -> Value:
        if entry.divisor == 1:
            return True
        type_ = U32 if "phase" in fields else U64
        (tick,) = fields.get("phase", fields["machine.tick"])
        return self.t.equal(self.apply("%", type_, tick, entry.divisor), entry.phase, type_)

    def _copy(self, fields: Fields, connection: Connection, condition: Value) -> None:
        source, target = connection.source, connection.target
        values = self.values(fields, self.port_path(source), source.type)
        self.store(fields, self.port_path(target), target.type, values, condition)

    # ---- an instance ------------------------------------------------------------------------------------------------

    def _run(self, made: Tick, index: int, entries: Mapping[int, Entry], due: Value) -> None:
        """Runs an instance where it is due."""
        if due is False:
            return
        fields, instance = made.fields, self.m.instances[index]
        for connection in self.m.connections:
            if connection.target.instance != index or connection.delayed:
                continue
            if connection.source.instance >= 0:
                self._copy(fields, connection, due)
            else:
                value = self._of_machine(made, connection.source, index, entries)
                path = self.port_path(connection.target)
                self.store(fields, path, connection.target.type, (value,), due)
        for w in self.m.watched:
            if w.instance == index:
                own = (
                    self._plus(fields["machine.tick"][0], 1, U64)
                    if w.path == "machine.tick"
                    else fields[w.path][w.element or 0]
                )
                self._set(fields, f"{instance.name}.inputs.{w.input}", own, due)
        after, hits = self._execute(fields, index, instance)
        faulted = self.t.any_of(condition for _, _, condition in hits)
        made.faults += self._first(index, due, hits)
        failed = self.t.all_of((due, faulted))
        completes = self.t.all_of((due, self.t.negation(faulted)))
        for path, values in after.items():
            rows = zip(values, fields[path], strict=True)
            fields[path] = tuple(self.t.choose(completes, a, b, self.types[path]) for a, b in rows)
        own = f"{instance.name}.outputs"
        stale = self.t.all_of((completes, self.t.equal(fields[f"{own}.health"][0], _STALE, HEALTH)))
        self._set(fields, f"{own}.health", _FAILED, self.t.any_of((failed, stale)))
        self._set(fields, f"{own}.transition_request", 0, failed)
        if failed is not False:
            faults = f"{instance.name}.counters.faults"
            self._set(fields, faults, self._plus(fields[faults][0], 1, U64), failed)
            place = f"{instance.name}.counters.fault_place"
            self._set(fields, place, self.t.fresh(U32, place), failed)
        if index in self.m.last_runs:
            now = self._plus(fields["machine.tick"][0], 1, U64)
            self._set(fields, f"{instance.name}.counters.last_run", now, completes)
        if index in self.m.completed:
            self._set(fields, f"{instance.name}.counters.completed", True, completes)
        for channel in self._guards.get(index, ()):
            self._judge(fields, channel, f"{own}.health", due)

    def _first(self, index: int, due: Value, hits: list[tuple[Span, str, Value]]) -> Iterator[Fault]:
        """The assertions that fail in a run, each where nothing else faulted before."""
        earlier: Value = False
        for span, cause, condition in hits:
            if cause.startswith(ASSERTION):
                yield Fault(index, span, self.t.all_of((due, condition, self.t.negation(earlier))))
            earlier = self.t.any_of((earlier, condition))

    def _execute(self, fields: Fields, index: int, instance: Instance) -> tuple[Fields, list[tuple[Span, str, Value]]]:
        """Outputs and state after an execute without a fault, and its possible faults."""
        ports = {(record, p.name): p.type for record in ir.RECORDS for p in instance.algorithm.ports[record]}
        frozen = {("parameters", name) for name in instance.frozen}

        def path(variable: Variable) -> str:
            return ".".join((instance.name, *variable))

        given = {v: self.values(fields, path(v), type_) for v, type_ in ports.items() if v not in frozen}
        given["outputs", "health"] = (_NOMINAL,)
        given["outputs", "transition_request"] = (0,)
        executor = Executor(self.o, self.m.program.functions, self.m.requests, self._constants(instance), self._outside)
        written = [v for v in given if v[0] in ("outputs", "state")]
        after: Fields = {}
        try:
            if index in self.opaque:
                raise TooLarge(self.opaque[index])
            found = executor.run(instance.execute, given, ports, True)
        except TooLarge as error:
            self.opaque[index] = str(error)
            for variable in written:
                after |= {row: self.unknown(row) for row in self.paths(path(variable), ports[variable])}
            return after, [(instance.span, "not looked into", self.t.fresh(BOOL, "fault"))]
        for variable in written:
            at = 0
            for row in self.paths(path(variable), ports[variable]):
                after[row] = found[variable][at : at + self.rows[row].count]
                at += self.rows[row].count
        return after, [(hit.span, hit.cause, hit.condition) for hit in executor.hits]

    def _constants(self, instance: Instance) -> Callable[[str, str], Values]:
        def find_constant(owner: str, name: str) -> Values:
            stored = self.m.program.constants.get((owner, name))
            values = stored[1] if stored is not None else instance.parameters[name]
            numbers = {request: n for n, request in enumerate(("", *self.m.requests))}
            return tuple(numbers[v] if isinstance(v, str) else v for v in values)

        return find_constant

    def _outside(self, effect: ir.Effect) -> Values:
        """Any result."""
        assert effect.target is not None
        return tuple(self.t.fresh(s, effect.function.name) for s in scalars_of(effect.target.type))

    def _judge(self, fields: Fields, channel: Channel, health: str, due: Value) -> None:
        """Health of an instance whose channel is invalid."""
        path = f"channels.{channel.name}"
        (valid,), (waits,) = fields[f"{path}.valid"], fields[f"{path}.waiting"]
        if channel.grace_ticks is not None:
            waits = self.t.all_of((waits, self.compare("<=", fields[f"{path}.age_ticks"][0], channel.grace_ticks, U32)))
        invalid = self.t.all_of((due, self.t.negation(valid)))
        nominal = self.t.equal(fields[health][0], _NOMINAL, HEALTH)
        self._set(fields, health, _FAILED, self.t.all_of((invalid, self.t.negation(waits))))
        self._set(fields, health, _DEGRADED, self.t.all_of((invalid, waits, nominal)))

    def _of_machine(self, made: Tick, source: PortRef, index: int, entries: Mapping[int, Entry]) -> Value:
        """`machine.<field>`, or a value of a channel."""
        fields = made.fields
        (tick,), name, hz = fields["machine.tick"], self.m.instances[index].name, self.m.tick_hz
        if source.members:
            path = f"channels.{source.field}"
            if source.members[0] == "fresh":
                last_sample, last_run = fields[f"{path}.last_sample"][0], fields[f"{name}.counters.last_run"][0]
                return self.compare(">", last_sample, last_run, U64)
            return fields[f"{path}.{source.members[0]}"][0]
        if source.field == "dt":
            return 1.0 / hz
        if source.field == "tick":
            return tick
        if source.field == "ticks_in_state":
            return fields["machine.ticks_in_state"][0]
        if source.field == "time_ns":
            whole = self.apply("*", U64, self.apply("//", U64, tick, hz), 1_000_000_000)
            rest = self.apply("//", U64, self.apply("*", U64, self.apply("%", U64, tick, hz), 1_000_000_000), hz)
            return self.signed(self._plus(whole, rest, U64), U64)
        period: Value = 0.0
        for n, entry in entries.items():
            period = self.t.choose(made.active[n], entry.divisor / hz, period, F64)
        if source.field == "period":
            return period
        resumed = self.t.negation(fields[f"{name}.counters.completed"][0])
        if source.field == "resumed":
            return resumed
        ticks = self.apply("-", U64, self._plus(tick, 1, U64), fields[f"{name}.counters.last_run"][0])
        since = self.apply("/", F64, self.apply("f64", U64, ticks), float(hz))
        return self.t.choose(resumed, period, since, F64)

    # ---- the end of a tick ------------------------------------------------------------------------------------------

    def _apply_effects(self, fields: Fields) -> None:
        """Worsens the healths of instances on which violated requirements act, unless they are stale."""
        for effect in self.m.effects:
            if effect.target >= 0:
                names = [f"{self.m.instances[i].name}.outputs.health" for i in (effect.instance, effect.target)]
                violated = self.t.equal(fields[names[0]][0], _DEGRADED, HEALTH)
                better = self.compare("<", fields[names[1]][0], effect.health, U32)
                self._set(fields, names[1], effect.health, self.t.all_of((violated, better)))

    def _arbitrate(self, made: Tick, due: Mapping[int, Value]) -> None:
        fields = made.fields
        chosen = fields["machine.state"][0]
        for edge in reversed(self.m.edges):
            taken = self.t.all_of((made.active[edge.source], self._holds(fields, edge, due)))
            chosen = self.t.choose(taken, edge.target, chosen, I32)
        fields["machine.next_state"] = (chosen,)
        if "machine.lost_requests" in fields:
            fields["machine.lost_requests"] = self.unknown("machine.lost_requests")

    def _holds(self, fields: Fields, edge: Edge, due: Mapping[int, Value]) -> Value:
        parts: list[Value] = []
        if edge.after_ticks:
            count = self._plus(fields["machine.ticks_in_state"][0], 1, U64)
            parts.append(self.compare(">=", count, edge.after_ticks, U64))
        if edge.request >= 0:
            number, name = edge.request + 1, self.m.requests[edge.request]
            made = [
                self.t.all_of(
                    (due[i], self.t.equal(fields[f"{maker.name}.outputs.transition_request"][0], number, REQUEST))
                )
                for i, maker in enumerate(self.m.instances)
                if i in due and name in self.m.requests_of(maker)
            ]
            parts.append(self.t.any_of(made))
        if edge.guard_instance >= 0:
            (own,) = fields[f"{self.m.instances[edge.guard_instance].name}.outputs.health"]
            words = [n for n in range(4) if edge.guard_mask >> n & 1]
            ran = self.t.any_of(self.t.equal(own, n, HEALTH) for n in words if n != _STALE)
            stale = self.t.equal(own, _STALE, HEALTH) if _STALE in words else False
            parts.append(self.t.any_of((self.t.all_of((due.get(edge.guard_instance, False), ran)), stale)))
        return self.t.all_of(parts)

    def _count(self, fields: Fields) -> None:
        if self.m.counts_state_ticks:
            fields["machine.ticks_in_state"] = (self._plus(fields["machine.ticks_in_state"][0], 1, U64),)
        fields["machine.tick"] = (self._plus(fields["machine.tick"][0], 1, U64),)
        if "phase" in fields:
            (phase,) = fields["phase"]
            last = self.t.equal(phase, self.hyperperiod - 1, U32)
            fields["phase"] = (self.t.choose(last, 0, self._plus(phase, 1, U32), U32),)

    # ---- operations -------------------------------------------------------------------------------------------------

    def apply(self, symbol: str, type_: Scalar, *args: Value) -> Value:
        op = find(symbol, (type_,) * len(args))
        assert op is not None
        return self.o.apply(op, args)[0]

    def compare(self, symbol: str, a: Value, b: Value, type_: Scalar) -> Value:
        return self.apply(symbol, type_, a, b)

    def _plus(self, a: Value, b: Value, type_: Scalar) -> Value:
        return self.apply("+", type_, a, b)

    def signed(self, value: Value, type_: Scalar) -> Value:
        """An integer as an i64, modulo 2^64."""
        return value if type_ is I64 else self.apply("wrap_i64", type_, value)


def host_fields(machine: Machine, sampled: bool = False) -> list[FieldRow]:
    """Fields that only hosts write: inputs without connection, and outputs that no algorithm assigns. `sampled`: with
    those that sensors write."""

    def paths(port: PortRef) -> list[str]:
        path = f"{machine.instances[port.instance].name}.{port.record}.{port.path}"
        return [path + leaf.path for leaf in leaves(port.type)]

    fed = {path for c in machine.connections for path in paths(c.target)}
    fed |= {f"{machine.instances[w.instance].name}.inputs.{w.input}" for w in machine.watched}
    sensed = {path for c in sensors(machine) for path in paths(c.port)}
    return [
        row
        for row in field_table(machine)
        if (row.path in sensed and sampled) or (row.path not in fed | sensed and _is_given(row))
    ]


def _is_given(row: FieldRow) -> bool:
    is_output = row.role == "OUTPUT" and "FCSL_FIELD_WRITABLE" in row.flags and "FCSL_FIELD_ASSIGNED" not in row.flags
    return row.role == "INPUT" or is_output


def _slots(machine: Machine) -> list[tuple[int, dict[int, Entry]]]:
    """An order of instances that contains that of each state: an instance, with its entry in each state that runs it
    there. It stands twice where two states have it in different orders."""
    queues = {n: list(state.entries) for n, state in enumerate(machine.states)}
    found: list[tuple[int, dict[int, Entry]]] = []
    while any(queues.values()):
        heads = list(dict.fromkeys(q[0].instance for q in queues.values() if q))
        behind = {e.instance for q in queues.values() for e in q[1:]}
        chosen = next((i for i in heads if i not in behind), heads[0])
        entries = {n: q.pop(0) for n, q in queues.items() if q and q[0].instance == chosen}
        found.append((chosen, entries))
    return found
