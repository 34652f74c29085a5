# SPDX-License-Identifier: Apache-2.0
"""Generates the C of a machine between the includes and the descriptor, callees first."""

from __future__ import annotations

from collections.abc import Iterator

from ..model import ir
from ..model.c_names import c_comment
from ..model.machine import Machine, Values
from ..model.ops.op import FAULT_HELPER
from ..model.types import Array, Results, Scalar, Struct, Type, element_of
from .c_writer import CWriter
from .expressions import constant_name, struct_type
from .fault_places import FaultPlaces
from .functions import FunctionEmitter
from .header import channel_member, member, record_type, sensors, state_constant
from .inline_size import inlined_functions
from .instances import InstanceEmitter, call, constant, store
from .step import StepEmitter
from .tick import port_place


class MachineEmitter:
    """Generates the functions of a machine, callees first."""

    def __init__(self, machine: Machine, places: FaultPlaces):
        self.m, self.places, self.w = machine, places, CWriter()

    def emit(self) -> CWriter:
        """Writes the source file between its includes and its descriptor."""
        self._externs()
        self._constants()
        self._results()
        functions, helpers, inlined = CWriter(), {}, inlined_functions(self.m)
        for function, owner in self.m.emitted:
            types = {r: record_type(self.m, owner, r) for r in ir.RECORDS} if owner else {}
            emitter = FunctionEmitter(functions, function, self.m.name, self.places, types, function.name in inlined)
            emitter.emit()
            helpers.update(emitter.helpers)
        if any("fcsl_fault(" in text for text in helpers.values()):
            self.w.block(FAULT_HELPER)
            self.w.line()
        for name in sorted(helpers):
            self.w.block(helpers[name])
            self.w.line()
        self.w.paste((functions.lines, functions.origins))
        for instance in self.m.instances:
            InstanceEmitter(self.m, self.places, instance, self.w).emit()
        self._init()
        StepEmitter(self.m, self.w).emit()
        return self.w

    def _externs(self) -> None:
        """Asserts that the user's header declares each extern with the types that the algorithm uses. C would convert
        silently."""
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

    def _results(self) -> None:
        """The structs of helpers with several results."""
        for struct in dict.fromkeys(f.result for f, _ in self.m.emitted if isinstance(f.result, Results)):
            with self.w.braces("typedef struct", f"}} {struct_type(self.m.name, struct)};"):
                for m in struct.members:
                    self.w.line(member(self.m, m.name, m.type))
            self.w.line()

    def _constants(self) -> None:
        """Constant arrays of modules and frozen parameters that are used."""
        read = set().union(*(ir.constants(f.body) for f, _ in self.m.emitted))
        for (owner, name), (type_, values) in self.m.program.constants.items():
            if (owner, name) in read:
                self._constant(owner, name, type_, values)
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
            f"static const {c_type} {constant_name(owner, name)}{extent} = {self._initializer(type_, iter(values))};"
        )
        self.w.line()

    def _initializer(self, type_: Type, values: Iterator[bool | int | float | str]) -> str:
        if isinstance(type_, Array):
            return "{" + ", ".join(self._initializer(type_.element, values) for _ in range(type_.count)) + "}"
        if isinstance(type_, Struct):
            return "{" + ", ".join(self._initializer(m.type, values) for m in type_.members) + "}"
        return constant(self.m, next(values), type_)

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
                store(w, m, port_place(m, connection.target), connection.target.type, connection.initial)
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
                w.line("uint32_t fault = 0u;")
                w.line(line)
                with w.braces("if (fault != 0u)"):
                    w.line(f"m->i_{instance.name}.fault_place = fault;")
                    w.line(f"return {index + 1};")
        w.line("return 0;")
        w.close()
        w.line()
