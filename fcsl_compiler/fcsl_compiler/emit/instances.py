# SPDX-License-Identifier: Apache-2.0
"""Generates the C of one instance: init, execute, and the functions for injected faults and overruns."""

from __future__ import annotations

from ..model import ir
from ..model.c_names import c_literal, c_name
from ..model.machine import Instance, Machine, Values
from ..model.types import HEALTH, Array, Scalar, Type, count_of, leaves, scalar_of
from .c_writer import CWriter
from .fault_places import FaultPlaces
from .fault_points import written_before_fault
from .header import HEALTH_CONSTANTS, execute_signature, instance_type, leaf_member, record_type, request_constant

#: Keeps rarely executed functions away from frequently executed code.
_RARE = "static __attribute__((cold, noinline)) void"


def constant(machine: Machine, value: bool | int | float | str, scalar: Scalar) -> str:
    """C literal for a scalar of a port. Healths and requests use the names of their enums."""
    if isinstance(value, str):
        return request_constant(machine, value or "none")
    return HEALTH_CONSTANTS[int(value)] if scalar is HEALTH else c_literal(value, scalar)


def store(w: CWriter, machine: Machine, target: str, type_: Type, values: Values) -> None:
    """Writes the values of a port, listed in the order of its leaves, into zero-initialised storage."""
    at = 0
    for leaf in leaves(type_):
        scalar, count = scalar_of(leaf.type), count_of(leaf.type)
        for position, value in enumerate(values[at : at + count]):
            place = f"{target}{leaf_member(leaf)}" + (f"[{position}]" if isinstance(leaf.type, Array) else "")
            if not isinstance(leaf.type, Array) or value != 0 or str(value).startswith("-"):
                w.line(f"{place} = {constant(machine, value, scalar)};")
        at += count


def call(function: ir.Function, fault: str, self_: str = "self->") -> str:
    """C call of `execute` or `start` with the records of `self_`."""
    arguments = [f"&{self_}{record}" for record in function.records]
    arguments += ["host"] if function.uses_hardware else []
    return f"{function.name}({', '.join([*arguments, *([fault] if function.faults else [])])});"


class InstanceEmitter:
    """Generates the functions of one instance."""

    def __init__(self, machine: Machine, places: FaultPlaces, instance: Instance, writer: CWriter):
        self.m, self.places, self.i, self.w = machine, places, instance, writer
        self.type = instance_type(machine, instance)

    def emit(self) -> None:
        self._init()
        self._execute()
        self._inject()
        if self.i.max_wcet_us:
            self._overrun()

    def _init(self) -> None:
        w, instance = self.w, self.i
        w.line(f"void {self.m.name}_{instance.name}_init({self.type} *self)")
        w.open_body()
        w.line("memset(self, 0, sizeof *self);")
        for record, values in (("parameters", instance.parameters), ("inputs", instance.inputs)):
            for port in instance.algorithm.ports[record]:
                if port.name in values:
                    store(w, self.m, f"self->{record}.{c_name(port.name)}", port.type, values[port.name])
        w.line("self->outputs.health = FCSL_STALE;")
        w.close()
        w.line()

    def _execute(self) -> None:
        w, algorithm = self.w, self.i.algorithm
        w.line(f"uint32_t {execute_signature(self.m, self.i)}")
        w.open_body()
        self._pulses("FCSL_NOMINAL")
        if not self.i.execute.faults:
            w.line(call(self.i.execute, ""))
            self._not_stale(algorithm)
            w.line("return 0u;")
        else:
            restore = self._save()
            w.line("uint32_t fault = 0u;")
            w.line(call(self.i.execute, "&fault"))
            with w.braces("if (fault != 0u)"):
                for line in restore:
                    w.line(line)
                self._failed("fault")
            self._not_stale(algorithm)
            w.line("return fault;")
        w.close()
        w.line()

    def _pulses(self, health: str) -> None:
        self.w.line(f"self->outputs.transition_request = {request_constant(self.m, 'none')};")
        self.w.line(f"self->outputs.health = {health};")

    def _failed(self, place: str) -> None:
        """The effects of a fault apart from the restored outputs and state."""
        self._pulses("FCSL_FAILED")
        self.w.line("self->faults += 1u;")
        self.w.line(f"self->fault_place = {place};")

    def _save(self) -> list[str]:
        """Saves the fields that a fault must restore. Returns the lines that restore them. Pulses are reset instead."""
        restore: list[str] = []
        written = written_before_fault(self.i.execute)
        for record in ("outputs", "state"):
            ports = [
                port
                for port in self.i.algorithm.ports[record]
                if (record, port.name) in written and not _is_pulse(record, port)
            ]
            if not ports:
                continue
            type_, before = record_type(self.m, self.i.algorithm, record), f"{record}_before"
            if all(p in ports or _is_pulse(record, p) for p in self.i.algorithm.ports[record]):
                self.w.line(f"const {type_} {before} = self->{record};")
                restore.append(f"self->{record} = {before};")
                continue
            self.w.line(f"{type_} {before};")
            for port in ports:
                self.w.line(_copy(port, before, f"self->{record}"))
                restore.append(_copy(port, f"self->{record}", before))
        return restore

    def _not_stale(self, algorithm: ir.Algorithm) -> None:
        """A running instance is never stale. If a variable can set health to stale, it becomes failed."""
        written = ir.writes(algorithm.execute.body)
        words = [value for target, value, _ in written if ir.variable(target) == ("outputs", "health")]
        if any(not isinstance(word, ir.Const) for word in words):
            with self.w.braces("if (self->outputs.health == FCSL_STALE)"):
                self.w.line("self->outputs.health = FCSL_FAILED;")

    def _inject(self) -> None:
        w, own = self.w, f"{self.m.name}_{self.i.name}({self.type} *self)"
        w.line("/* Replaces an execute with an injected fault: outputs and state stay. */")
        w.line(f"{_RARE} fcsl_fault_{own}")
        w.open_body()
        w.line("self->inject_fault = 0u;")
        self._failed(self.places.injected)
        w.close()
        w.line()
        w.line("/* After an execute with an injected health: at least degraded or failed. */")
        w.line(f"{_RARE} fcsl_worsen_{own}")
        w.open_body()
        w.line("const int32_t least = self->inject_fault > 2u ? FCSL_FAILED : FCSL_DEGRADED;")
        w.line("self->inject_fault = 0u;")
        with w.braces("if (self->outputs.health < least)"):
            w.line("self->outputs.health = least;")
        w.close()
        w.line()

    def _overrun(self) -> None:
        w = self.w
        w.line("/* After an execute that overran, or with an injected overrun. */")
        w.line(f"{_RARE} fcsl_overrun_{self.m.name}_{self.i.name}({self.type} *self)")
        w.open_body()
        w.line("self->inject_overrun = 0u;")
        w.line("self->overruns += 1u;")
        with w.braces("if (self->outputs.health == FCSL_NOMINAL)"):
            w.line("self->outputs.health = FCSL_DEGRADED;")
        w.close()
        w.line()


def _is_pulse(record: str, port: ir.Port) -> bool:
    """Whether the port is reset before each execute and by a fault."""
    return record == "outputs" and port.name in ("transition_request", "health")


def _copy(port: ir.Port, to: str, source: str) -> str:
    """Copies one field between two records."""
    field = c_name(port.name)
    if isinstance(port.type, Array):
        return f"memcpy({to}.{field}, {source}.{field}, sizeof {to}.{field});"
    return f"{to}.{field} = {source}.{field};"
