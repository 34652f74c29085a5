# SPDX-License-Identifier: Apache-2.0
"""Connections, rates, groups, order of evaluation, events, the stop condition and the ROS topics of a simulation."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction

from fcsl_compiler.api.diagnostics import Span, longer_paths, nearest
from fcsl_compiler.api.expressions import ExpressionError, Kind, Quantity, parse, read_unit
from fcsl_compiler.api.json_files import ConfigReader, JsonNode
from fcsl_compiler.api.types import Type, scalar_of, shape_of
from simclient.descriptor import Field, Machine, why_read_only

from . import dataflow, plan
from .dataflow import AlgebraicLoop, Link
from .integrators import MAX_HZ, Integrator
from .models import FIELD_TYPES, ModelField, ModelTable, type_of, with_unit
from .plan import Statement
from .ros import TruthTopic, read_truth

MAX_SECONDS = 1e9
#: Of the grid on which updates with a phase lie (src/plan/plan.h).
_MAX_GRID_HZ = 1_000_000_000


@dataclass
class Instance:
    """`table` is None if its model has an error; `sets` are the plan's statements for its parameters and inputs, `given` the
    paths of these inputs; `tolerances` are the statements for its continuous states. `integrator`: of its group, where it says so. `rate`: of its updates."""

    name: str
    span: Span
    table: ModelTable | None
    sets: list[Statement] = field(default_factory=list)
    given: dict[str, Span] = field(default_factory=dict)
    tolerances: list[Statement] = field(default_factory=list)
    integrator: Integrator | None = None
    rate: Rate | None = None


@dataclass(frozen=True)
class Rate:
    """Updates at steps `phase` + i * `every` of a grid of `hz`."""

    hz: int
    every: int
    phase: int
    span: Span

    def words(self) -> tuple[int, int, int]:
        return self.hz, self.every, self.phase

    def text(self) -> str:
        hz = Fraction(self.hz, self.every)
        return f"{hz} Hz" + (f" from {float(Fraction(self.phase, self.hz)):g} s on" if self.phase else "")


@dataclass(frozen=True)
class Wiring:
    """The plan's statements from the first instance on, the instances in update order, and the ROS topics of truth.

    `until`: the stop condition as text; empty without one.
    """

    statements: list[Statement]
    order: list[str]
    ros: tuple[TruthTopic, ...]
    until: str


@dataclass(frozen=True)
class _Port:
    """One end of a connection: a field of an instance, or of a controller, where `instance` is empty. `channel`: whether this
    is one of its channels, or any other field."""

    instance: str
    path: str
    type: Type
    unit: str
    controller: str = ""
    channel: bool = True


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
    """`first_ns`: a sensor channel gets no sample before."""

    source: _Port
    target: _Port
    span: Span
    first_ns: int = 0


def seconds(reader: ConfigReader, node: JsonNode | None, what: str) -> Fraction | None:
    """A duration in s, as the exact decimal number in the file."""
    node = reader.computed(node, what, "s") if node is not None else None
    value = reader.number(node, what, 0.0, MAX_SECONDS)
    if value is None or node is None:
        return None
    return Fraction(node.text) if value > 0.0 else Fraction(0)  # 1e-99999999 would take minutes


def first(span: Span) -> Span:
    """The span of its first character, because an object may span many lines."""
    return Span(span.source, span.line, span.column, span.line, span.column + 1)


def check_wiring(
    reader: ConfigReader,
    instances: dict[str, Instance],
    machines: Mapping[str, Machine],
    integrator: Integrator | None,
    keys: Mapping[str, JsonNode],
    ticks: int | None,
) -> Wiring:
    """Checks the rest of the file against the tables read so far; errors go to the reader's sink.

    ticks: length of the run; events after the last tick give a warning (None: unknown, no warning).
    """
    checker = _Checker(reader, instances, machines)
    checker.read_rates(keys.get("rates"))
    checker.read_connections(keys)
    lines, order = checker.order(integrator)
    for name in order:
        lines += instances[name].sets + instances[name].tolerances
    lead = next(iter(machines), "")
    lines += [_edge_statement(edge, lead) for edge in checker.edges]
    lines += [_first_sample(edge, lead) for edge in checker.edges if edge.first_ns]
    lines += checker.read_events(keys.get("events"), ticks)
    checker.warn_unfed(keys.get("connections") or keys.get("controller"))
    until, condition = checker.read_until(keys.get("until"))
    return Wiring([*lines, *until], order, read_truth(keys.get("ros"), reader, checker.output), condition)


def _edge_statement(edge: _Edge, lead: str) -> Statement:
    source, target = edge.source, edge.target
    if not source.instance:
        if not source.channel:
            return plan.statement("read", source.path, target.instance, target.path)
        if source.controller == lead:
            return plan.statement("actuator", source.path, target.instance, target.path)
        return plan.statement("companion_actuator", source.controller, source.path, target.instance, target.path)
    if not target.instance:
        if not target.channel:
            return plan.statement("write", source.instance, source.path, target.path)
        if target.controller == lead:
            return plan.statement("sensor", source.instance, source.path, target.path)
        return plan.statement("companion_sensor", source.instance, source.path, target.controller, target.path)
    return plan.statement("link", source.instance, source.path, target.instance, target.path)


def _first_sample(edge: _Edge, lead: str) -> Statement:
    controller = edge.target.controller
    return plan.statement("first_sample", "-" if controller == lead else controller, edge.target.path, edge.first_ns)


class _Checker:
    def __init__(self, reader: ConfigReader, instances: dict[str, Instance], machines: Mapping[str, Machine]):
        self.reader, self.instances, self.machines = reader, instances, machines
        #: The first controller, whose ticks are those of the simulation.
        self.machine = next(iter(machines.values()), None)
        self.sink = reader.sink
        self.edges: list[_Edge] = []
        #: What a connection or an event feeds: (instance, input). Of a file with an error it may lack some; no warnings are
        #: shown then.
        self._fed: set[tuple[str, str]] = set()

    # ---- rates --------------------------------------------------------------------------------------------------------

    def read_rates(self, node: JsonNode | None) -> None:
        rates = self.reader.named(node, "`rates`")
        for name, (definition, span) in rates.items():
            instance = self.instances.get(name)
            if instance is None:
                self._no_instance(name, span, controllers=False)
                continue
            rate = self._rate(definition)
            if instance.table and not instance.table.has_update:
                message = (
                    f"`{name}` may have no rate: its model has no `update`, and its outputs follow at every instant"
                )
                self.sink.error("E804", message, span, help="remove its rate")
            elif rate and instance.table and instance.table.tick_hz not in (0, Fraction(rate.hz, rate.every)):
                message = f"`{name}` is a machine with a tick_hz of {instance.table.tick_hz}: its rate is that"
                self.sink.error("E804", message, definition.span)
            else:
                instance.rate = rate
        for instance in self.instances.values():
            if instance.table and instance.table.has_update and instance.name not in rates:
                fix = f'add `"{instance.name}": …` (Hz) to `rates`'
                self.sink.error("E804", f"`{instance.name}` has no rate", instance.span, help=fix)

    def _rate(self, node: JsonNode) -> Rate | None:
        """100, or {"hz": 100, "phase_s": 0.002}."""
        if node.kind != "object":
            hz = self.reader.integer(node, "a rate (Hz)", 1, MAX_HZ)
            return None if hz is None else Rate(hz, 1, 0, node.span)
        keys = self.reader.object(node, "a rate", ("hz",), ("phase_s",))
        hz = self.reader.integer(keys.get("hz"), "`hz`", 1, MAX_HZ) if keys else None
        if keys is None or hz is None:
            return None
        phase = seconds(self.reader, keys.get("phase_s"), "`phase_s`") or Fraction(0)
        if phase * hz >= 1:
            message = f"the phase {float(phase):g} s is not within the period of {hz} Hz"
            self.sink.error("E804", message, keys["phase_s"].span, help=f"write less than {1 / hz:g}")
            return None
        grid = math.lcm(hz, phase.denominator)
        if grid > _MAX_GRID_HZ:
            self.sink.error("E804", f"the phase {float(phase):g} s is finer than a nanosecond", keys["phase_s"].span)
            return None
        return Rate(grid, grid // hz, int(phase * grid), node.span)

    # ---- connections ----------------------------------------------------------------------------------------------------

    def read_connections(self, simulation: Mapping[str, JsonNode]) -> None:
        node = simulation.get("connections")
        fed: dict[tuple[str, str], Span] = {}
        for item in self.reader.list(node, "`connections`"):
            keys = self.reader.object(item, "a connection", ("from", "to"), ("first_sample_s",))
            if keys is None or "from" not in keys or "to" not in keys:
                continue
            source = self._port(keys["from"], _FROM)
            target = self._port(keys["to"], _TO)
            if target is None or source is None:
                continue
            where = (target.instance or f"{target.controller}.", target.path)
            if where in fed:
                fix = "an input has one source; remove one connection"
                text = keys["to"].value
                self.sink.error(
                    "E213", f"two sources for `{text}`", keys["to"].span, help=fix, notes=[(fed[where], "first")]
                )
                continue
            fed[where] = keys["to"].span
            value = self.instances[target.instance].given.get(target.path) if target.instance else None
            if value:
                message = f"`{keys['to'].value}` has a value and a connection"
                self.sink.error("E212", message, value, help="remove one of them", notes=[(fed[where], "connected")])
            if self._compatible(source, target, keys["from"], keys["to"]):
                self.edges.append(_Edge(source, target, keys["from"].span, self._first_ns(target, keys)))
        values = {(name, path) for name, instance in self.instances.items() for path in instance.given}
        self._fed = set(fed) | values

    def _first_ns(self, target: _Port, keys: Mapping[str, JsonNode]) -> int:
        node = keys.get("first_sample_s")
        time = seconds(self.reader, node, "`first_sample_s`")
        if node is not None and (target.instance or not target.channel):
            message = "`first_sample_s` is for a connection to a sensor channel"
            self.sink.error("E214", message, node.span, help="remove it")
        return round((time or 0) * 10**9)

    def _compatible(self, source: _Port, target: _Port, source_node: JsonNode, target_node: JsonNode) -> bool:
        notes = [(source_node.span, f"the source is {with_unit(source.type, source.unit)}")]
        notes += [(target_node.span, f"the target is {with_unit(target.type, target.unit)}")]
        if not source.instance and not target.instance:
            fix = "connect instances of a machine in its own file; between controllers put a model, such as a link"
            self.sink.error("E215", "a controller is connected to a controller", target_node.span, help=fix)
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
        if head in self.machines or (head == "controller" and not self.machines):
            return self._channel(node, head, name, end)
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

    def _channel(self, node: JsonNode, controller: str, name: str, end: _End) -> _Port | None:
        machine = self.machines.get(controller)
        if machine is None:
            return None
        channel = next((c for c in machine.channels if c.name == name), None)
        if channel and channel.direction == end.direction:
            type_ = type_of(channel.field.type, channel.field.shape)
            return _Port("", name, type_, channel.field.unit, controller)
        if name in machine.fields:
            return self._machine_field(node, controller, machine.fields[name], end)
        if channel:
            self.sink.error("E215", f"{end.rule}, but `{name}` is the other kind of channel", node.span)
            return None
        names = [c.name for c in machine.channels if c.direction == end.direction]
        hint = nearest(name, [*names, *longer_paths(name, machine.fields)]) or (
            f"it has {', '.join(names)}" if names else "it has none"
        )
        message = f"machine `{machine.name}` has no {end.direction} channel `{name}`"
        self.sink.error("E206", message, node.span, help=hint)
        return None

    def _machine_field(self, node: JsonNode, controller: str, field: Field, end: _End) -> _Port | None:
        """Any field of the first controller beside its channels: `controller.pilot.outputs.throttle`."""
        if controller != next(iter(self.machines)):
            why = "fields beside the channels are those of the first controller"
            self.sink.error("E215", f"`{node.value}` is no channel of `{controller}`", node.span, why=why)
            return None
        if end is _TO and not field.writable:
            self.sink.error("E215", f"`{node.value}`: {why_read_only(field)}", node.span)
            return None
        if field.type not in FIELD_TYPES:
            self.sink.error("E217", f"`{node.value}` is {field.type}, which models do not have", node.span)
            return None
        return _Port("", field.path, type_of(field.type, field.shape), field.unit, controller, False)

    def _no_instance(self, name: str, span: Span, controllers: bool = True) -> None:
        if name in self.machines:
            message = f"`{name}` is a controller, and this is about models"
            fix = "set parameters of a machine in its own file, or in a test with `SimTwin.set`"
            self.sink.error("E206", message, span, help=fix)
            return
        others = list(self.machines) if controllers else []
        text = f"the instances are {', '.join(self.instances)}"
        text += f", the controllers {', '.join(others)}" if others else ""
        self.sink.error("E206", f"no instance `{name}`", span, help=nearest(name, [*others, *self.instances]) or text)

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
        if place is None:
            return
        several = len(self.machines) > 1
        unfed = [
            f"`{name}.{c.name}`" if several else f"`{c.name}`"
            for name, machine in self.machines.items()
            for c in machine.channels
            if c.direction == "sensor" and (f"{name}.", c.name) not in self._fed
        ]
        if unfed:
            message = f"nothing feeds sensor channel {', '.join(unfed)}"
            self.sink.warning("W801", message, first(place.span), why="it never gets a sample")
        for instance in self.instances.values():
            inputs = instance.table.of_role("input") if instance.table else []
            unfed = [f"`{f.name}`" for f in inputs if not f.optional and (instance.name, f.path) not in self._fed]
            if unfed:
                message = f"nothing feeds input {', '.join(unfed)} of `{instance.name}`"
                self.sink.warning("W802", message, instance.span, why="it stays zero")

    # ---- groups and order ---------------------------------------------------------------------------------------------

    def order(self, integrator: Integrator | None) -> tuple[list[Statement], list[str]]:
        """The plan's statements of groups, instances and calls; and the instances, sources before what they feed."""
        tables = {name: instance.table for name, instance in self.instances.items() if instance.table}
        links = [self._link(edge, tables) for edge in self.edges if edge.source.instance and edge.target.instance]
        try:
            calls = dataflow.calls(tables, links)
        except AlgebraicLoop as loop:
            self._report_loop(loop.links, tables)
            return [], list(self.instances)
        groups = dataflow.groups(tables, links)
        number = {name: i for i, group in enumerate(groups) for name in group}
        chosen = [self._integrator_of(group, integrator) for group in groups]
        self._check_grids(tables, links, number, chosen)
        self._check_methods(tables, groups, chosen)
        self._check_unused(number, chosen)
        order = list(dict.fromkeys(call.instance for call in calls))
        order += [name for name in self.instances if name not in order]
        lines = [one.statement(self._fastest(group)) for group, one in zip(groups, chosen, strict=True) if one]
        for name in order:
            if name in tables:
                rate = self.instances[name].rate
                grid = rate.words() if rate else (0, 0, 0)
                lines.append(plan.statement("instance", name, tables[name].name, number.get(name, "-"), *grid))
        return lines + [plan.statement("call", call.instance, call.kind) for call in calls], order

    def _fastest(self, group: Sequence[str]) -> int:
        """The highest rate at which a controller sets an input of the group, in Hz; 0: none does."""
        names = {
            edge.source.controller for edge in self.edges if edge.target.instance in group and edge.source.controller
        }
        return max((self.machines[name].tick_hz for name in names), default=0)

    def _check_unused(self, number: Mapping[str, int], chosen: Sequence[Integrator | None]) -> None:
        for name, instance in self.instances.items():
            if instance.integrator and instance.table and name not in number:
                message = f"`{name}` has an integrator, and nothing to integrate or to locate"
                self.sink.error("E808", message, first(instance.integrator.span), help="remove it")
            integrator = chosen[number[name]] if name in number else None
            if instance.tolerances and (integrator is None or integrator.method != "rk45"):
                message = f"`tolerances` of `{name}`: only rk45 chooses its steps"
                self.sink.error("E804", message, instance.span, help="remove them, or integrate with rk45")

    def _link(self, edge: _Edge, tables: Mapping[str, ModelTable]) -> Link:
        source, target = edge.source, edge.target
        output = tables[source.instance].fields[source.path]
        return Link(source.instance, output, target.instance, tables[target.instance].fields[target.path], edge.span)

    def _integrator_of(self, group: Sequence[str], default: Integrator | None) -> Integrator | None:
        given = [(name, own) for name in group if (own := self.instances[name].integrator)]
        for name, own in given[1:]:
            if not own.same(given[0][1]):
                message = f"`{name}` and `{given[0][0]}` are directly connected, and have different integrators"
                why = f"states of directly connected models integrate together: {', '.join(group)}"
                notes = [(given[0][1].span, f"that of `{given[0][0]}`")]
                self.sink.error("E808", message, first(own.span), why=why, notes=notes)
        return given[0][1] if given else default

    def _check_grids(
        self,
        tables: Mapping[str, ModelTable],
        links: Sequence[Link],
        number: Mapping[str, int],
        chosen: Sequence[Integrator | None],
    ) -> None:
        """An update that a group feeds, or that feeds it, is at one of its steps, if these are of fixed size."""
        for name, instance in self.instances.items():
            near = {link.source for link in links if link.target == name} | {name}
            near |= {link.target for link in links if link.source == name}
            for group in sorted({number[other] for other in near if other in number}):
                integrator = chosen[group]
                if instance.rate and integrator and integrator.hz and integrator.hz % instance.rate.hz:
                    message = f"{instance.rate.text()} is not on the grid of the integrator's {integrator.hz} Hz"
                    fix = f"let its rate divide the integrator's, and its phase be a multiple of {1 / integrator.hz:g} s, or integrate with rk45"
                    self.sink.error("E220", message, instance.rate.span, help=fix)
                    break

    def _check_methods(
        self, tables: Mapping[str, ModelTable], groups: Sequence[Sequence[str]], chosen: Sequence[Integrator | None]
    ) -> None:
        for group, integrator in zip(groups, chosen, strict=True):
            if integrator is None or integrator.method != "verlet":
                continue
            for name in group:
                if tables[name].integrated and not tables[name].second_order:
                    message = f"`{name}` cannot be integrated by verlet"
                    why = f"model `{tables[name].name}` does not declare positions and their velocities"
                    fix = "use another integrator, or set `is_second_order` where its forces depend on no velocity"
                    self.sink.error("E808", message, self.instances[name].span, why=why, help=fix)

    def _report_loop(self, links: Sequence[Link], tables: Mapping[str, ModelTable]) -> None:
        texts = [f"{link.source}.{link.output.name} -> {link.target}.{link.input.name}" for link in links]
        notes = [(link.span, text) for link, text in zip(links, texts, strict=True)]
        loop = " -> ".join([links[0].source, *(link.target for link in links)])
        sampled = all(not tables[link.source].has_output for link in links)
        why = (
            "an update uses the values that its sources make at the same instant"
            if sampled
            else "each of these outputs depends on the input before it at the same instant"
        )
        fix = "make one model of them, or let one keep its value in a state, so that its output needs no input"
        head = "models feed each other" if sampled else "an algebraic loop"
        self.sink.error("E803", f"{head}: {loop}", links[0].span, why=why, help=fix, notes=notes)

    def output(self, node: JsonNode, text: str) -> ModelField | None:
        """The output that `text` names; None if an error was reported."""
        return self._field(node, text, ("output",), "truth is an output of a model")

    # ---- events and stop --------------------------------------------------------------------------------------------------

    def read_events(self, node: JsonNode | None, ticks: int | None) -> list[Statement]:
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
    ) -> list[Statement]:
        values = [plan.bits(scalar_of(target.type).name, value) for value in scalars]
        return [plan.statement("event", time_ns, instance, target.path, i, value) for i, value in enumerate(values)]

    def read_until(self, node: JsonNode | None) -> tuple[list[Statement], str]:
        """The statement of the stop condition, and the condition as text."""
        nothing: tuple[list[Statement], str] = [], ""
        if node is None or (node.kind == "object" and not node.members):
            return nothing
        keys = self.reader.object(node, "`until`", ("condition",), ("for_s",))
        if keys is None:
            return nothing
        text = self.reader.string(keys.get("condition"), "`condition`", "lander.outputs.landed")
        for_s = seconds(self.reader, keys.get("for_s"), "`for_s`")
        if text is None or self.machine is None or any(i.table is None for i in self.instances.values()):
            return nothing
        try:
            parse(text, self._quantity, condition=True)
        except ExpressionError as error:
            self.sink.error("E208", f"`condition`: {error}", keys["condition"].span)
            return nothing
        ticks = 1 + math.ceil((for_s or 0) * self.machine.tick_hz)
        condition = text + (f" for {float(for_s):g} s" if for_s else "")
        return [plan.statement("until", ticks, " ".join(text.split()))], condition

    def _quantity(self, path: str) -> Quantity:
        """What `instance.outputs.name` is in an expression; indices may follow. Raises ExpressionError."""
        head, _, name = path.partition(".")
        table = self.instances[head].table if head in self.instances else None
        fields = table.fields if table else {}
        index: list[int] = []
        while name not in fields and name.endswith("]"):  # fields in an array of structs have brackets of their own
            name, _, inside = name[:-1].rpartition("[")
            index = [*map(int, inside.split(",")), *index]
        found = fields.get(name)
        if found is None or found.role not in ("output", "state"):
            known = [
                f"{i.name}.{f.path}"
                for i in self.instances.values()
                if i.table
                for f in i.table.of_role("output", "state")
            ]
            hint = nearest(f"{head}.{name}", known)
            raise ExpressionError(f"there is no output or state `{path}` of a model{'; ' + hint if hint else ''}")
        shape = shape_of(found.type)
        if len(index) > len(shape) or any(i >= extent for i, extent in zip(index, shape, strict=False)):
            raise ExpressionError(f"`{path}`: `{head}.{name}` is {found.type}")
        scalar = scalar_of(found.type).name
        kind = Kind.BOOL if scalar == "bool" else Kind.FLOAT if scalar in ("f32", "f64") else Kind.INTEGER
        return Quantity(kind, shape[len(index) :], read_unit(found.unit))
