# SPDX-License-Identifier: Apache-2.0
"""C of a machine: its header (types a user may include) and its source (algorithms, init, step, force_state)."""

from __future__ import annotations

import re
from collections.abc import Iterator

from . import ir
from .c_names import c_comment, c_literal, c_name, decimal
from .c_writer import CWriter
from .emit_expr import constant_name, struct_type
from .emit_function import FunctionEmitter
from .machine import Channel, Connection, Edge, Entry, Instance, Machine, PortRef, State, Values
from .types import F64, HEALTH, Array, Leaf, Scalar, Struct, Type, count_of, element_of, leaves, scalar_of

RECORDS = ("inputs", "parameters", "outputs", "state")
_HEALTH = ("FCSL_NOMINAL", "FCSL_DEGRADED", "FCSL_FAILED", "FCSL_STALE")


def record_type(machine: Machine, algorithm: ir.Algorithm, record: str) -> str:
    return f"{machine.name}_{algorithm.name}_{record}_t"


def instance_type(machine: Machine, instance: Instance) -> str:
    return f"{machine.name}_{instance.name}_t"


def state_constant(machine: Machine, index: int) -> str:
    return f"{machine.name}_STATE_{machine.states[index].name}"


def request_constant(machine: Machine, name: str) -> str:
    return f"{machine.name}_tr_{name}"


def channel_member(channel: Channel) -> str:
    return "channel_" + channel.name.replace(".", "_") + "_"


def member(machine: Machine, name: str, type_: Type) -> str:
    """A struct member; arrays are flat and row-major."""
    element = element_of(type_)
    c_type = element.c if isinstance(element, Scalar) else struct_type(machine.name, element)
    return f"{c_type} {c_name(name)}{f'[{type_.count}]' if isinstance(type_, Array) else ''};"


def leaf_member(leaf: Leaf) -> str:
    """C member expression of a leaf, behind the port it is in."""
    return "".join(f"[{s}]" if isinstance(s, int) else f".{c_name(s)}" for s in leaf.steps)


# ---- header --------------------------------------------------------------------------------------------------------


def emit_header(machine: Machine) -> str:
    """Enums of states and requests, a record per instance with its init and execute, and the machine itself."""
    w, name = CWriter(), machine.name
    guard = f"{name.upper()}_H"
    w.block(f"/* {name}.h: made by fcslc from {c_comment(machine.config.name)}. Do not edit. */")
    w.block(
        f"#ifndef {guard}\n#define {guard}\n\n#include <stdbool.h>\n#include <stdint.h>\n\n#include <fcsl/fcsl_machine.h>\n"
    )
    w.block('#ifdef __cplusplus\nextern "C" {\n#endif\n')
    w.line()
    with w.braces("enum", "};"):
        for index, _ in enumerate(machine.states):
            w.line(f"{state_constant(machine, index)} = {index},")
    w.line()
    with w.braces("enum", "};"):
        w.line(f"{request_constant(machine, 'none')} = 0,")
        for index, request in enumerate(machine.requests):
            w.line(f"{request_constant(machine, request)} = {index + 1},")
    w.line()
    for struct in machine.structs:
        with w.braces("typedef struct", f"}} {struct_type(name, struct)};"):
            for m in struct.members:
                w.line(member(machine, m.name, m.type) + (f" /* [{c_comment(m.unit)}] */" if m.unit else ""))
        w.line()
    for algorithm in machine.algorithms:
        for record in RECORDS:
            if not algorithm.ports[record]:
                continue
            with w.braces("typedef struct", f"}} {record_type(machine, algorithm, record)};"):
                for port in algorithm.ports[record]:
                    note = " ".join(x for x in (f"[{port.unit}]" if port.unit else "", port.doc) if x)
                    w.line(member(machine, port.name, port.type) + (f" /* {c_comment(note)} */" if note else ""))
            w.line()
    for instance in machine.instances:
        _instance_record(w, machine, instance)
    _machine_struct(w, machine)
    w.line(f"extern const fcsl_machine_t {name}_machine;")
    w.block("\n#ifdef __cplusplus\n}\n#endif\n")
    w.line(f"\n#endif /* {guard} */".strip("\n"))
    return w.text()


def _instance_record(w: CWriter, machine: Machine, instance: Instance) -> None:
    type_ = instance_type(machine, instance)
    with w.braces("typedef struct", f"}} {type_};"):
        for record in RECORDS:
            if instance.algorithm.ports[record]:
                w.line(f"{record_type(machine, instance.algorithm, record)} {record};")
        w.line("uint64_t faults;")
        w.line("uint64_t overruns;")
        if instance.max_wcet_us:
            w.line("uint8_t inject_overrun; /* 1: the next execute counts as an overrun */")
        w.line("uint8_t inject_fault; /* 1: the next execute counts as a fault */")
    w.line()
    w.line(
        "/* Zeroes the record, binds parameters and initial inputs. start() runs afterwards, in the machine's init. */"
    )
    w.line(f"void {machine.name}_{instance.name}_init({type_} *self);")
    w.line(
        "/* Runs execute once with the inputs in the record; returns 1 after a fault, which leaves outputs and state. */"
    )
    w.line(f"int32_t {_execute_signature(machine, instance)};")
    w.line()


def _execute_signature(machine: Machine, instance: Instance) -> str:
    host = ", const fcsl_host_t *host" if instance.execute.uses_hardware else ""
    return f"{machine.name}_{instance.name}_execute({instance_type(machine, instance)} *self{host})"


def _machine_struct(w: CWriter, machine: Machine) -> None:
    with w.braces("typedef struct", f"}} {machine.name}_t;"):
        w.line("uint64_t tick; /* ticks completed */")
        w.line("int32_t current_; /* the instance now executing, or -1 */")
        w.line("int32_t state_; /* of the last tick */")
        w.line("int32_t next_state_; /* of the coming tick */")
        for instance in machine.instances:
            w.line(f"{instance_type(machine, instance)} i_{instance.name};")
        for channel in sensors(machine):
            with w.braces("struct", f"}} {channel_member(channel)};"):
                w.line("int64_t stamp_ns;")
                w.line("uint32_t age_ticks;")
                w.line("uint32_t sample_age;")
                w.line("uint8_t attached;")
                w.line("uint8_t fresh;")
                w.line("uint8_t valid;")
    w.line()


def sensors(machine: Machine) -> list[Channel]:
    return [c for c in machine.channels if c.direction == "sensor"]


# ---- source --------------------------------------------------------------------------------------------------------


class MachineEmitter:
    """Writes the functions of a machine, callees first."""

    def __init__(self, machine: Machine):
        self.m, self.w = machine, CWriter()

    def emit(self) -> CWriter:
        """Everything of the source file between its includes and its descriptor."""
        self._externs()
        self._constants()
        functions, helpers = CWriter(), {}
        for function, owner in self._functions():
            types = {r: record_type(self.m, owner, r) for r in RECORDS} if owner else {}
            emitter = FunctionEmitter(functions, function, self.m.name, types)
            emitter.emit()
            helpers.update(emitter.helpers)
        for name in sorted(helpers):
            self.w.block(helpers[name])
            self.w.line()
        self.w.paste((functions.lines, functions.origins))
        for index, instance in enumerate(self.m.instances):
            self._init(instance)
            self._execute(index, instance)
        self._stale()
        self._machine_init()
        for state in self.m.states:
            self._tick(state)
        self._step()
        self._force_state()
        return self.w

    def _functions(self) -> list[tuple[ir.Function, ir.Algorithm | None]]:
        out: list[tuple[ir.Function, ir.Algorithm | None]] = []
        used: set[str] = set()

        def use(names: tuple[str, ...]) -> None:
            for name in names:
                if name not in used:
                    use(self.m.program.functions[name].calls)
                    used.add(name)
                    out.append((self.m.program.functions[name], None))

        for entry, algorithm in self.m.entries:
            use(entry.calls)
            out.append((entry, algorithm))
        return out

    def _externs(self) -> None:
        """What the user's header declares must be what the algorithm calls: C would convert in silence."""
        for e in self.m.externs:
            self.w.origin = e.span
            arguments = [self._parameter(type_) for _, type_ in e.arguments]
            result = "void"
            if isinstance(e.result, Scalar):
                result = e.result.c
            elif e.result is not None:
                arguments.append(self._parameter(e.result).removeprefix("const "))
            prototype = f"{result}({', '.join(arguments) or 'void'})"
            test = f"__builtin_types_compatible_p(__typeof__({e.name}), {prototype})"
            self.w.line(
                f'_Static_assert({test}, "{e.name} is not what {c_comment(str(e.span))} declares: {prototype}");'
            )
            self.w.origin = None
        if self.m.externs:
            self.w.line()

    def _parameter(self, type_: Type) -> str:
        element = element_of(type_)
        c_type = element.c if isinstance(element, Scalar) else struct_type(self.m.name, element)
        return c_type if isinstance(type_, Scalar) else f"const {c_type} *"

    def _constants(self) -> None:
        """Arrays of the modules and frozen parameters, as far as something reads them."""
        read = set().union(*(ir.constants(f.body) for f, _ in self._functions()))
        for algorithm in self.m.algorithms:
            for name, array, values in algorithm.constants:
                if (algorithm.owner, name) in read:
                    self._constant(algorithm.owner, name, array, values)
        for instance in self.m.instances:
            owner = f"{instance.algorithm.owner}__{instance.name}"
            for port in instance.algorithm.ports["parameters"]:
                if port.name in instance.frozen and (owner, port.name) in read:
                    self._constant(owner, port.name, port.type, instance.parameters[port.name])

    def _constant(self, owner: str, name: str, type_: Type, values: Values) -> None:
        element = element_of(type_)
        c_type = element.c if isinstance(element, Scalar) else struct_type(self.m.name, element)
        extent = f"[{type_.count}]" if isinstance(type_, Array) else ""
        self.w.line(
            f"static const {c_type} {constant_name(owner, name)}{extent} = {_initializer(type_, iter(values))};"
        )
        self.w.line()

    # ---- one instance ----------------------------------------------------------------------------------------------

    def _init(self, instance: Instance) -> None:
        w, type_ = self.w, instance_type(self.m, instance)
        w.line(f"void {self.m.name}_{instance.name}_init({type_} *self)")
        w.open_body()
        w.line("memset(self, 0, sizeof *self);")
        for record, values in (("parameters", instance.parameters), ("inputs", instance.inputs)):
            for port in instance.algorithm.ports[record]:
                if port.name in values:
                    self._store(f"self->{record}.{c_name(port.name)}", port.type, values[port.name])
        w.line("self->outputs.health = FCSL_STALE;")
        w.close()
        w.line()

    def _store(self, target: str, type_: Type, values: Values) -> None:
        """Values of a port, flat in the order of its leaves, into storage that is zero."""
        at = 0
        for leaf in leaves(type_):
            scalar, count = scalar_of(leaf.type), count_of(leaf.type)
            for position, value in enumerate(values[at : at + count]):
                place = f"{target}{leaf_member(leaf)}" + (f"[{position}]" if isinstance(leaf.type, Array) else "")
                if not isinstance(leaf.type, Array) or value != 0 or str(value).startswith("-"):
                    text = _HEALTH[int(value)] if scalar is HEALTH else c_literal(value, scalar)
                    self.w.line(f"{place} = {text};{decimal(value)}")
            at += count

    def _call(self, function: ir.Function, fault: str) -> str:
        arguments = [f"&self->{record}" for _, record in function.records]
        arguments += ["host"] if function.uses_hardware else []
        return f"{function.name}({', '.join([*arguments, *([fault] if function.faults else [])])});"

    def _execute(self, index: int, instance: Instance) -> None:
        w, algorithm = self.w, instance.algorithm
        w.line(f"int32_t {_execute_signature(self.m, instance)}")
        w.open_body()
        w.line(f"self->outputs.transition_request = {request_constant(self.m, 'none')};")
        w.line("self->outputs.health = FCSL_NOMINAL;")
        with w.braces("if (self->inject_fault != 0u)"):
            w.line("self->inject_fault = 0u;")
            w.line("self->outputs.health = FCSL_FAILED;")
            w.line("self->faults += 1u;")
            w.line("return 1;")
        if not instance.execute.faults:
            w.line(self._call(instance.execute, ""))
            self._not_stale(algorithm)
            w.line("return 0;")
        else:
            saved = [r for r in ("outputs", "state") if algorithm.ports[r]]
            for record in saved:
                w.line(f"const {record_type(self.m, algorithm, record)} {record}_before = self->{record};")
            w.line("int32_t fault = 0;")
            w.line(self._call(instance.execute, "&fault"))
            with w.braces("if (fault != 0)"):
                for record in saved:
                    w.line(f"self->{record} = {record}_before;")
                w.line("self->outputs.health = FCSL_FAILED;")
                w.line("self->faults += 1u;")
            self._not_stale(algorithm)
            w.line("return fault;")
        w.close()
        w.line()

    def _not_stale(self, algorithm: ir.Algorithm) -> None:
        """An instance that runs is not stale: the word, where it may come from a variable, counts as failed."""
        words = [value for target, value, _ in ir.writes(algorithm.execute.body) if target.type is HEALTH]
        if any(not isinstance(word, ir.Const) for word in words):
            with self.w.braces("if (self->outputs.health == FCSL_STALE)"):
                self.w.line("self->outputs.health = FCSL_FAILED;")

    # ---- the machine -----------------------------------------------------------------------------------------------

    def _stale(self) -> None:
        w, m = self.w, self.m
        w.line("/* On entering a state: nothing has run in it yet. */")
        w.line(f"static void fcsl_all_stale_{m.name}({m.name}_t *m)")
        w.open_body()
        for instance in m.instances:
            w.line(f"m->i_{instance.name}.outputs.health = FCSL_STALE;")
        w.close()
        w.line()

    def _machine_init(self) -> None:
        w, m = self.w, self.m
        w.line(f"static int32_t fcsl_init_{m.name}(void *machine)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        w.line("memset(m, 0, sizeof *m);")
        w.line("m->current_ = FCSL_NONE;")
        w.line(f"m->state_ = {state_constant(m, m.initial_state)};")
        w.line(f"m->next_state_ = {state_constant(m, m.initial_state)};")
        for instance in m.instances:
            w.line(f"{m.name}_{instance.name}_init(&m->i_{instance.name});")
        for connection in m.connections:
            if connection.delayed:
                self._store(self._port(connection.target), connection.target.type, connection.initial)
        for channel in sensors(m):
            w.line(f"m->{channel_member(channel)}.valid = 1u;")
        for index, instance in enumerate(m.instances):
            start = instance.start
            if start is None:
                continue
            call = self._call(start, "&fault").replace("&self->", f"&m->i_{instance.name}.")
            if not start.faults:
                w.line(call)
                continue
            with w.braces(""):
                w.line("int32_t fault = 0;")
                w.line(call)
                with w.braces("if (fault != 0)"):
                    w.line(f"return {index + 1};")
        w.line("return 0;")
        w.close()
        w.line()

    def _port(self, port: PortRef) -> str:
        path = ".".join(c_name(part) for part in (port.field, *port.members))
        return f"m->i_{self.m.instances[port.instance].name}.{port.record}.{path}"

    def _copy(self, connection: Connection) -> None:
        target = self._port(connection.target)
        if connection.source.instance < 0:
            hz = self.m.tick_hz
            sources = {
                "dt": c_literal(1.0 / hz, F64),
                # floor(tick * 1e9 / hz) without overflow: whole seconds and the rest apart.
                "time_ns": f"(int64_t)((m->tick / {hz}u) * 1000000000u + (m->tick % {hz}u) * 1000000000u / {hz}u)",
                "tick": "m->tick",
            }
            self.w.line(f"{target} = {sources[connection.source.field]};")
        elif isinstance(connection.target.type, Array):
            self.w.line(f"memcpy({target}, {self._port(connection.source)}, sizeof {target});")
        else:
            self.w.line(f"{target} = {self._port(connection.source)};")

    def _tick(self, state: State) -> None:
        w, m = self.w, self.m
        edges = [e for e in m.edges if m.states[e.source] is state]
        w.line(f"static void fcsl_tick_{m.name}_{state.name}({m.name}_t *m, const fcsl_host_t *host)")
        w.open_body()
        mark = w.mark()
        for entry in state.entries:
            if entry.divisor > 1:
                name = m.instances[entry.instance].name
                w.line(f"const bool {name}_due = m->tick % {entry.divisor}u == {entry.phase}u;")
        self._delayed(state)
        for entry in state.entries:
            if entry.divisor > 1:
                with w.braces(f"if ({m.instances[entry.instance].name}_due)"):
                    self._run(entry)
            else:
                self._run(entry)
        if state.entries:
            w.line("*(volatile int32_t *)&m->current_ = FCSL_NONE;")
        for position, edge in enumerate(edges):
            self._edge(state, edge, position)
        if edges:
            w.close()
        body = w.cut(mark)
        for argument in ("m", "host"):
            if not any(re.search(rf"\b{argument}\b", line) for line in body[0]):
                w.line(f"(void){argument};")
        w.paste(body)
        w.close()
        w.line()

    def _delayed(self, state: State) -> None:
        """Yesterday's values, before anything of this tick overwrites them."""
        m, w = self.m, self.w
        due = {e.instance: e for e in state.entries}
        delayed = [c for c in m.connections if c.delayed and c.target.instance in due]
        if delayed:
            w.open("if (m->tick > 0u)")
            for connection in delayed:
                entry = due[connection.target.instance]
                if entry.divisor > 1:
                    with w.braces(f"if ({m.instances[entry.instance].name}_due)"):
                        self._copy(connection)
                else:
                    self._copy(connection)
            w.close()

    def _run(self, entry: Entry) -> None:
        m, w = self.m, self.w
        instance = m.instances[entry.instance]
        record = f"m->i_{instance.name}"
        for connection in m.connections:
            if connection.target.instance == entry.instance and not connection.delayed:
                self._copy(connection)
        # A watchdog on another thread reads it while execute runs, so the store must happen.
        w.line(f"*(volatile int32_t *)&m->current_ = {entry.instance};")
        if instance.max_wcet_us:
            w.open_body()
            w.line("const uint64_t began_ns = host->clock_ns != NULL ? host->clock_ns(host->ctx) : 0u;")
        host = ", host" if instance.execute.uses_hardware else ""
        call = f"(void){m.name}_{instance.name}_execute(&{record}{host});"
        if instance.algorithm.effects:
            w.open(f"if (host->substitute == NULL || host->substitute(host->ctx, {entry.instance}u) == 0)")
            w.line(call)
            w.reopen("else")
            w.line(f"{record}.inject_fault = 0u;")  # what was put in place holds its effect
            w.close()
        else:
            w.line(call)
        if instance.max_wcet_us:
            w.line("const uint64_t spent_ns = host->clock_ns != NULL ? host->clock_ns(host->ctx) - began_ns : 0u;")
            with w.braces(f"if ({record}.inject_overrun != 0u || spent_ns > {instance.max_wcet_us * 1000}u)"):
                w.line(f"{record}.inject_overrun = 0u;")
                w.line(f"{record}.overruns += 1u;")
                with w.braces(f"if ({record}.outputs.health == FCSL_NOMINAL)"):
                    w.line(f"{record}.outputs.health = FCSL_DEGRADED;")
            w.close()
        invalid = [c for c in sensors(m) if c.port.instance == entry.instance]
        if invalid:
            test = " || ".join(f"m->{channel_member(c)}.valid == 0u" for c in invalid)
            with w.braces(f"if ({test})"):
                w.line(f"{record}.outputs.health = FCSL_FAILED;")

    def _edge(self, state: State, edge: Edge, position: int) -> None:
        """One branch of the arbitration; edges stand in falling priority, the first that holds is taken."""
        m, w = self.m, self.w
        entries = {e.instance: e for e in state.entries}
        tests: list[str] = []
        if edge.request >= 0:
            request = m.requests[edge.request]
            makers = []
            for entry in state.entries:
                if request in m.requests_of(m.instances[entry.instance]):
                    name = m.instances[entry.instance].name
                    made = f"m->i_{name}.outputs.transition_request == {request_constant(m, request)}"
                    makers.append(made if entry.divisor == 1 else f"({name}_due && {made})")
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
        """A health counts on ticks when its instance ran; `stale` is what an instance is that has not run at all."""
        name = self.m.instances[edge.guard_instance].name
        health = f"m->i_{name}.outputs.health"
        words = [i for i in range(4) if edge.guard_mask >> i & 1]
        ran = [f"{health} == {_HEALTH[i]}" for i in words if i < 3]
        tests: list[str] = []
        if entry is not None and ran:
            word = " || ".join(ran)
            tests.append(word if entry.divisor == 1 else f"({name}_due && ({word}))")
        if 3 in words:
            tests.append(f"{health} == FCSL_STALE")
        return " || ".join(tests) if tests else "false"

    def _step(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_step_{m.name}(void *machine, const fcsl_host_t *host)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        with w.braces("if (m->state_ != m->next_state_)"):
            w.line("m->state_ = m->next_state_;")
            w.line(f"fcsl_all_stale_{m.name}(m);")
        for channel in sensors(m):
            self._age(channel)
        w.open("switch (m->state_)")
        for index, state in enumerate(m.states):
            w.line(f"case {state_constant(m, index)}:")
            w.line(f"    fcsl_tick_{m.name}_{state.name}(m, host);")
            w.line("    break;")
        w.line("default:")
        w.line("    break;")
        w.close()
        w.line("m->tick += 1u;")
        w.close()
        w.line()

    def _age(self, channel: Channel) -> None:
        """A sample makes a channel as old as it is itself; without one it ages. It is valid until it is too old."""
        w, c = self.w, f"m->{channel_member(channel)}"
        w.open(f"if ({c}.fresh != 0u)")
        w.line(f"{c}.fresh = 0u;")
        w.line(f"{c}.age_ticks = {c}.sample_age;")
        w.line(
            f"{c}.valid = {'1u' if channel.max_age_ticks is None else f'{c}.age_ticks <= {channel.max_age_ticks}u'};"
        )
        w.reopen(f"else if ({c}.attached != 0u && {c}.age_ticks < UINT32_MAX)")
        w.line(f"{c}.age_ticks += 1u;")
        if channel.max_age_ticks is not None:
            w.line(f"{c}.valid = {c}.age_ticks <= {channel.max_age_ticks}u;")
        w.close()

    def _force_state(self) -> None:
        w, m = self.w, self.m
        w.line(f"static void fcsl_force_state_{m.name}(void *machine, int32_t state)")
        w.open_body()
        w.line(f"{m.name}_t *const m = machine;")
        w.line("m->state_ = state;")
        w.line("m->next_state_ = state;")
        w.line(f"fcsl_all_stale_{m.name}(m);")
        w.close()
        w.line()


def _initializer(type_: Type, values: Iterator[bool | int | float]) -> str:
    if isinstance(type_, Array):
        return "{" + ", ".join(_initializer(type_.element, values) for _ in range(type_.count)) + "}"
    if isinstance(type_, Struct):
        return "{" + ", ".join(_initializer(m.type, values) for m in type_.members) + "}"
    return c_literal(next(values), type_)
