# SPDX-License-Identifier: Apache-2.0
"""C of a machine: everything of its source between the includes and the descriptor, callees first."""

from __future__ import annotations

from collections.abc import Iterator

from . import ir
from .c_names import c_comment, c_literal
from .c_writer import CWriter
from .emit_expr import constant_name, struct_type
from .emit_function import FunctionEmitter
from .emit_header import RECORDS, channel_member, record_type, sensors, state_constant
from .emit_instance import InstanceEmitter, call, store
from .emit_step import StepEmitter
from .emit_tick import port_place
from .machine import Machine, Values
from .types import Array, Scalar, Struct, Type, element_of


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
        for instance in self.m.instances:
            InstanceEmitter(self.m, instance, self.w).emit()
        self._init()
        StepEmitter(self.m, self.w).emit()
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

    def _init(self) -> None:
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
                store(w, port_place(m, connection.target), connection.target.type, connection.initial)
        for channel in sensors(m):
            w.line(f"m->{channel_member(channel)}.valid = 1u;")
        for index, instance in enumerate(m.instances):
            start = instance.start
            if start is None:
                continue
            line = call(start, "&fault", f"m->i_{instance.name}.")
            if not start.faults:
                w.line(line)
                continue
            with w.braces(""):
                w.line("int32_t fault = 0;")
                w.line(line)
                with w.braces("if (fault != 0)"):
                    w.line(f"return {index + 1};")
        w.line("return 0;")
        w.close()
        w.line()


def _initializer(type_: Type, values: Iterator[bool | int | float]) -> str:
    if isinstance(type_, Array):
        return "{" + ", ".join(_initializer(type_.element, values) for _ in range(type_.count)) + "}"
    if isinstance(type_, Struct):
        return "{" + ", ".join(_initializer(m.type, values) for m in type_.members) + "}"
    return c_literal(next(values), type_)
