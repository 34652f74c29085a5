# SPDX-License-Identifier: Apache-2.0
"""Connections, rates, order of updates, events, the stop condition and the ROS topics of a simulation."""

from __future__ import annotations

import heapq
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from fcsl_compiler.base.diagnostics import nearest
from fcsl_compiler.base.source import Span
from fcsl_compiler.model.types import Array, Type, scalar_of
from fcsl_compiler.parse.json_reader import ConfigReader
from fcsl_compiler.parse.json_source import JsonNode
from simclient.descriptor import Machine

from . import plan
from .models import ModelField, ModelTable, type_of, with_unit
from .ros import TruthTopic, read_truth

#: Limits of the native simulator (src/plan.h).
MAX_HZ = 1_000_000
MAX_SECONDS = 1e9
_COMPARISONS = ("equals", "above", "below")


@dataclass
class Instance:
    """`table` is None if its model has an error; `sets` are the plan's statements for its parameters."""

    name: str
    span: Span
    table: ModelTable | None
    sets: list[str] = field(default_factory=list)
    hz: int = 0


@dataclass(frozen=True)
class Wiring:
    """The plan's statements from the first instance on, the instances in update order, and the ROS topics of truth.

    `until`: the stop condition as text; empty without one.
    """

    lines: list[str]
    order: list[str]
    ros: tuple[TruthTopic, ...]
    until: str


@dataclass(frozen=True)
class _Port:
    """One end of a connection: a field of an instance (a channel of the controller when `instance` is empty)."""

    instance: str
    path: str
    type: Type
    unit: str


@dataclass(frozen=True)
class _End:
    """The allowed kind of one end of a connection: a model's field of this role, or a channel of this direction."""

    role: str
    direction: str
    rule: str


_FROM = _End("output", "actuator", "a connection comes `from` an output or an actuator")
_TO = _End("input", "sensor", "a connection goes `to` an input or a sensor")
_A_ROLE = {"input": "an input", "output": "an output", "parameter": "a parameter", "state": "a state"}
_RECORDS = ("inputs", "outputs", "parameters", "state")


@dataclass(frozen=True)
class _Edge:
    source: _Port
    target: _Port
    span: Span


def seconds(reader: ConfigReader, node: JsonNode | None, what: str) -> Fraction | None:
    """A duration in s, as the exact decimal number in the file."""
    value = reader.number(node, what, 0.0, MAX_SECONDS)
    return None if value is None else Fraction(repr(value))


def first(span: Span) -> Span:
    """The span of its first character, because an object may span many lines."""
    return Span(span.source, span.line, span.column, span.line, span.column + 1)


def check_wiring(
    reader: ConfigReader,
    instances: dict[str, Instance],
    machine: Machine | None,
    integrator_hz: int | None,
    keys: Mapping[str, JsonNode],
    ticks: int | None,
) -> Wiring:
    """Checks the rest of the file against the tables read so far; errors go to the reader's sink.

    ticks: length of the run; events after the last tick give a warning (None: unknown, no warning).
    """
    checker = _Checker(reader, instances, machine)
    checker.read_rates(keys.get("rates"), integrator_hz)
    checker.read_connections(keys)
    order = checker.order()
    lines = []
    for name in order:
        table = instances[name].table
        if table:
            lines.append(plan.statement("instance", name, table.name, instances[name].hz))
    for name in order:
        lines += instances[name].sets
    lines += [_edge_statement(edge) for edge in checker.edges]
    lines += checker.read_events(keys.get("events"), ticks)
    checker.warn_unfed(keys.get("connections") or keys.get("controller"))
    until, condition = checker.read_until(keys.get("until"))
    return Wiring([*lines, *until], order, read_truth(keys.get("ros"), reader, checker.output), condition)


def _edge_statement(edge: _Edge) -> str:
    source, target = edge.source, edge.target
    if not source.instance:
        return plan.statement("actuator", source.path, target.instance, target.path)
    if not target.instance:
        return plan.statement("sensor", source.instance, source.path, target.path)
    return plan.statement("link", source.instance, source.path, target.instance, target.path)


class _Checker:
    def __init__(self, reader: ConfigReader, instances: dict[str, Instance], machine: Machine | None):
        self.reader, self.instances, self.machine = reader, instances, machine
        self.sink = reader.sink
        self.edges: list[_Edge] = []
        #: What feeds (instance, input): a connection, or an event. None: a connection is broken, nothing is known.
        self._fed: set[tuple[str, str]] | None = None

    # ---- rates --------------------------------------------------------------------------------------------------------

    def read_rates(self, node: JsonNode | None, integrator_hz: int | None) -> None:
        rates = self.reader.named(node, "`rates`")
        for name, (definition, span) in rates.items():
            instance = self.instances.get(name)
            if instance is None:
                self._no_instance(name, span)
                continue
            hz = self.reader.integer(definition, "a rate (Hz)", 1, MAX_HZ)
            if instance.table and instance.table.integrated:
                message = f"`{name}` is integrated: it is updated after every step of the integrator"
                self.sink.error("E804", message, span, help="remove its rate; `integrator` has one for all")
            elif hz and integrator_hz and integrator_hz % hz:
                message = f"{hz} Hz does not divide the integrator's {integrator_hz} Hz"
                self.sink.error("E220", message, definition.span)
            elif hz:
                instance.hz = hz
        for instance in self.instances.values():
            if instance.table and not instance.table.integrated and instance.name not in rates:
                fix = f'add `"{instance.name}": …` (Hz) to `rates`'
                self.sink.error("E804", f"`{instance.name}` has no rate", instance.span, help=fix)

    # ---- connections ----------------------------------------------------------------------------------------------------

    def read_connections(self, simulation: Mapping[str, JsonNode]) -> None:
        node = simulation.get("connections")
        fed: dict[tuple[str, str], Span] = {}
        broken = False
        for item in self.reader.list(node, "`connections`"):
            keys = self.reader.object(item, "a connection", ("from", "to"))
            if keys is None or "from" not in keys or "to" not in keys:
                broken = True
                continue
            source = self._port(keys["from"], _FROM)
            target = self._port(keys["to"], _TO)
            if target is None or source is None:
                broken = True
                continue
            where = (target.instance, target.path)
            if where in fed:
                fix = "an input has one source; remove one connection"
                text = keys["to"].value
                self.sink.error(
                    "E213", f"two sources for `{text}`", keys["to"].span, help=fix, notes=[(fed[where], "first")]
                )
                continue
            fed[where] = keys["to"].span
            if self._compatible(source, target, keys["from"], keys["to"]):
                self.edges.append(_Edge(source, target, keys["from"].span))
        self._fed = None if broken else set(fed)

    def _compatible(self, source: _Port, target: _Port, source_node: JsonNode, target_node: JsonNode) -> bool:
        notes = [(source_node.span, f"the source is {with_unit(source.type, source.unit)}")]
        notes += [(target_node.span, f"the target is {with_unit(target.type, target.unit)}")]
        if not source.instance and not target.instance:
            fix = "connect its instances in the machine's own file"
            self.sink.error("E215", "the controller is connected to itself", target_node.span, help=fix)
        elif source.type != target.type:
            message = f"{source.type} cannot be connected to {target.type}"
            self.sink.error("E217", message, target_node.span, notes=notes)
        elif source.unit and target.unit and source.unit != target.unit:
            message = f"unit `{source.unit}` cannot be connected to `{target.unit}`"
            self.sink.error("E218", message, target_node.span, notes=notes)
        else:
            return True
        return False

    def _port(self, node: JsonNode, end: _End) -> _Port | None:
        """The end of the connection; None if an error was reported, here or before."""
        if node.kind != "string" or not isinstance(node.value, str):
            fix = f'"instance.{end.role}" or "controller.channel"'
            self.sink.error("E208", f"{end.rule}, written as a string", node.span, help=fix)
            return None
        head, _, name = node.value.partition(".")
        if head == "controller":
            return self._channel(node, name, end)
        found = self._model_port(node, head, name, end)
        return _Port(head, found.path, found.type, found.unit) if found else None

    def _model_port(self, node: JsonNode, head: str, name: str, end: _End) -> ModelField | None:
        """The output or input `name` of the instance `head`; `end` selects the role."""
        instance = self.instances.get(head)
        if instance is None:
            self._no_instance(head, node.span)
            return None
        if instance.table is None:
            return None
        ports = {field.name: field for field in instance.table.of_role(end.role)}
        if name in ports:
            return ports[name]
        record, _, rest = name.partition(".")
        others = [field.role for field in instance.table.fields.values() if name in (field.name, field.path)]
        if record == f"{end.role}s" and rest in ports:
            why = "a source is an output and a target an input"
            self.sink.error("E215", f"`{record}` in a connection", node.span, why=why, help=f'write "{head}.{rest}"')
        elif others:
            self.sink.error("E215", f"{end.rule}, and `{node.value}` is {_A_ROLE[others[0]]}", node.span)
        else:
            hint = nearest(rest if record in _RECORDS else name, list(ports))
            hint = hint or (f"it has {', '.join(ports)}" if ports else "it has none")
            self.sink.error("E216", f"`{head}` has no {end.role} `{name}`", node.span, help=hint)
        return None

    def _channel(self, node: JsonNode, name: str, end: _End) -> _Port | None:
        if self.machine is None:
            return None
        channel = next((c for c in self.machine.channels if c.name == name), None)
        if channel and channel.direction == end.direction:
            type_ = type_of(channel.field.type, channel.field.shape)
            return _Port("", name, type_, channel.field.unit)
        if channel:
            self.sink.error("E215", f"{end.rule}, but `{name}` is the other kind of channel", node.span)
            return None
        names = [c.name for c in self.machine.channels if c.direction == end.direction]
        hint = nearest(name, names) or (f"it has {', '.join(names)}" if names else "it has none")
        message = f"machine `{self.machine.name}` has no {end.direction} channel `{name}`"
        self.sink.error("E206", message, node.span, help=hint)
        return None

    def _no_instance(self, name: str, span: Span) -> None:
        names = ["controller", *self.instances]
        hint = nearest(name, names) or f"the instances are {', '.join(self.instances)}"
        self.sink.error("E206", f"no instance `{name}`", span, help=hint)

    def _field(self, node: JsonNode, text: str, roles: Sequence[str], rule: str) -> ModelField | None:
        """The field of `instance.path` if it has one of these roles; None if an error was reported."""
        head, _, path = text.partition(".")
        instance = self.instances.get(head)
        if instance is None:
            self._no_instance(head, node.span)
            return None
        if instance.table is None:
            return None
        found = instance.table.fields.get(path)
        if found and found.role in roles:
            return found
        if found:
            self.sink.error("E215", f"{rule}, not `{text}`", node.span)
            return None
        choices = [f.path for f in instance.table.of_role(*roles)]
        hint = nearest(path, choices) or (f"it has {', '.join(choices)}" if choices else "it has none")
        self.sink.error("E216", f"`{head}` has no {' or '.join(roles)} `{path}`", node.span, help=hint)
        return None

    def warn_unfed(self, place: JsonNode | None) -> None:
        """After connections and events: what neither of them feeds. `place` is shown for sensor channels."""
        fed = self._fed
        if fed is None or place is None:
            return
        channels = self.machine.channels if self.machine else ()
        unfed = [f"`{c.name}`" for c in channels if c.direction == "sensor" and ("", c.name) not in fed]
        if unfed:
            message = f"nothing feeds sensor channel {', '.join(unfed)}"
            self.sink.warning("W801", message, first(place.span), why="it never gets a sample")
        for instance in self.instances.values():
            inputs = instance.table.of_role("input") if instance.table else []
            unfed = [f"`{f.name}`" for f in inputs if (instance.name, f.path) not in fed]
            if unfed:
                message = f"nothing feeds input {', '.join(unfed)} of `{instance.name}`"
                self.sink.warning("W802", message, instance.span, why="it stays zero")

    # ---- order ----------------------------------------------------------------------------------------------------------

    def order(self) -> list[str]:
        """Topological order: sources before targets, ties by name, independent of the order in the file."""
        feeds: dict[str, set[str]] = {name: set() for name in self.instances}
        for edge in self.edges:
            if edge.source.instance and edge.target.instance:
                feeds[edge.source.instance].add(edge.target.instance)
        waiting = {name: sum(name in targets for targets in feeds.values()) for name in feeds}
        ready = [name for name, count in waiting.items() if count == 0]
        heapq.heapify(ready)
        order = []
        while ready:
            name = heapq.heappop(ready)
            order.append(name)
            for target in feeds[name]:
                waiting[target] -= 1
                if waiting[target] == 0:
                    heapq.heappush(ready, target)
        if len(order) < len(feeds):
            self._report_cycle({name for name in feeds if name not in order})
        return order

    def _report_cycle(self, stuck: set[str]) -> None:
        """Follows sources backwards until an instance repeats, which closes a cycle."""
        path: list[_Edge] = []
        seen: list[str] = []
        name = min(stuck & {e.target.instance for e in self.edges if e.source.instance in stuck})
        while name not in seen:
            seen.append(name)
            edge = next(e for e in self.edges if e.target.instance == name and e.source.instance in stuck)
            path.append(edge)
            name = edge.source.instance
        cycle = path[seen.index(name) :][::-1]
        text = " -> ".join([cycle[0].source.instance, *(edge.target.instance for edge in cycle)])
        notes = [(edge.span, f"`{edge.source.instance}` feeds `{edge.target.instance}`") for edge in cycle[1:]]
        why = "an update uses the outputs that its sources computed for the same instant"
        self.sink.error("E803", f"models feed each other: {text}", cycle[0].span, why=why, notes=notes)

    def output(self, node: JsonNode, text: str) -> ModelField | None:
        """The output that `text` names; None if an error was reported."""
        return self._field(node, text, ("output",), "truth is an output of a model")

    # ---- events and stop --------------------------------------------------------------------------------------------------

    def read_events(self, node: JsonNode | None, ticks: int | None) -> list[str]:
        lines = []
        last_ns = self.machine.time_ns(ticks - 1) if self.machine and ticks else None
        for item in self.reader.list(node, "`events`"):
            keys = self.reader.object(item, "an event", ("at_s", "set", "value")) or {}
            at_s = seconds(self.reader, keys.get("at_s"), "`at_s`")
            if at_s is not None and last_ns is not None and at_s * 10**9 > last_ns:
                message = f"the event at {float(at_s):g} s never happens: the last tick is at {last_ns / 1e9:g} s"
                self.sink.warning("W803", message, keys["at_s"].span)
            text = self.reader.string(keys.get("set"), "`set`")
            if text is None or "value" not in keys:
                continue
            found = self._field(keys["set"], text, ("parameter", "input"), "an event sets a parameter or an input")
            if found is None:
                continue
            instance = text.partition(".")[0]
            if self._fed is not None:
                self._fed.add((instance, found.path))
            if any(e.target.instance == instance and e.target.path == found.path for e in self.edges):
                message = f"the event sets `{text}`, which is connected: the next copy overwrites it"
                self.sink.warning("W804", message, keys["set"].span, help="set a parameter of its source")
            scalars = self.reader.value(keys["value"], found.type, f"`{text}`")
            if at_s is not None and scalars is not None:
                lines += self._event_statements(int(at_s * 10**9), instance, found, scalars)
        return lines

    def _event_statements(
        self, time_ns: int, instance: str, target: ModelField, scalars: Sequence[bool | int | float | str]
    ) -> list[str]:
        values = [plan.bits(scalar_of(target.type).name, value) for value in scalars]
        return [plan.statement("event", time_ns, instance, target.path, i, value) for i, value in enumerate(values)]

    def read_until(self, node: JsonNode | None) -> tuple[list[str], str]:
        """The statements of the stop condition, and the condition as text."""
        nothing: tuple[list[str], str] = [], ""
        if node is None or (node.kind == "object" and not node.members):
            return nothing
        keys = self.reader.object(node, "`until`", ("field",), (*_COMPARISONS, "for_s"))
        if keys is None:
            return nothing
        text = self.reader.string(keys.get("field"), "`field`")
        rule = "a stop condition watches an output or a state"
        found = self._field(keys["field"], text, ("output", "state"), rule) if text is not None else None
        for_s = seconds(self.reader, keys.get("for_s"), "`for_s`")
        given = [name for name in _COMPARISONS if name in keys]
        if len(given) != 1:
            self.sink.error("E202", "`until` has one of `equals`, `above` and `below`", first(node.span))
            return nothing
        if found is None or text is None:
            return nothing
        if isinstance(found.type, Array):
            self.sink.error("E217", f"`{text}` is {found.type}; a stop condition compares a scalar", keys["field"].span)
            return nothing
        value = self.reader.value(keys[given[0]], found.type, f"`{given[0]}`")
        if value is None or self.machine is None:
            return nothing
        ticks = 1 + math.ceil((for_s or 0) * self.machine.tick_hz)
        bits = plan.bits(found.type.name, value[0])
        condition = f"{text} {given[0]} {json.dumps(value[0])}" + (f" for {float(for_s):g} s" if for_s else "")
        return [plan.statement("until", text.partition(".")[0], found.path, given[0], bits, ticks)], condition
