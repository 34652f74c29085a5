# SPDX-License-Identifier: Apache-2.0
"""Generates the header of a machine: the names and types of its C. Users may include it."""

from __future__ import annotations

from ..model import ir
from ..model.c_names import c_comment, c_name
from ..model.machine import Channel, Instance, Machine
from ..model.types import Array, Leaf, Scalar, Type, element_of
from .c_writer import CWriter
from .expressions import struct_type

HEALTH_CONSTANTS = ("FCSL_NOMINAL", "FCSL_DEGRADED", "FCSL_FAILED", "FCSL_STALE")


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
    """A struct member. Arrays are flat, row-major."""
    element = element_of(type_)
    c_type = element.c if isinstance(element, Scalar) else struct_type(machine.name, element)
    return f"{c_type} {c_name(name)}{f'[{type_.count}]' if isinstance(type_, Array) else ''};"


def leaf_member(leaf: Leaf) -> str:
    """C member expression of a leaf relative to its port."""
    return "".join(f"[{s}]" if isinstance(s, int) else f".{c_name(s)}" for s in leaf.steps)


# ---- header --------------------------------------------------------------------------------------------------------


def emit_header(machine: Machine) -> str:
    """The header: enums of states and requests, a record per instance with its init and execute, and the machine
    struct."""
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
        for record in ir.RECORDS:
            if not algorithm.ports[record]:
                continue
            with w.braces("typedef struct", f"}} {record_type(machine, algorithm, record)};"):
                for port in algorithm.ports[record]:
                    note = " ".join(x for x in (f"[{port.unit}]" if port.unit else "", port.doc) if x)
                    w.line(member(machine, port.name, port.type) + (f" /* {c_comment(note)} */" if note else ""))
            w.line()
    for index in range(len(machine.instances)):
        _instance_record(w, machine, index)
    _machine_struct(w, machine)
    w.line(f"extern const fcsl_machine_t {name}_machine;")
    w.block("\n#ifdef __cplusplus\n}\n#endif\n")
    w.line(f"\n#endif /* {guard} */".strip("\n"))
    return w.text()


def _instance_record(w: CWriter, machine: Machine, index: int) -> None:
    instance = machine.instances[index]
    type_ = instance_type(machine, instance)
    with w.braces("typedef struct", f"}} {type_};"):
        for record in ir.RECORDS:
            if instance.algorithm.ports[record]:
                w.line(f"{record_type(machine, instance.algorithm, record)} {record};")
        w.line("uint64_t faults;")
        w.line("uint64_t overruns;")
        if index in machine.last_runs:
            w.line("uint64_t last_run; /* ticks completed after its last run; 0: none yet */")
        w.line("uint32_t fault_place; /* of the last fault: row of fault_places, from 1; 0: none */")
        if instance.max_wcet_us:
            w.line("uint8_t inject_overrun; /* 1: its next run counts as an overrun */")
        w.line(
            "uint8_t inject_fault; /* 1: its next run counts as a fault; 2, 3: its health is at least degraded, failed */"
        )
    w.line()
    w.line(
        "/* Zeroes the record, binds parameters and initial inputs. start() runs afterwards, in the machine's init. */"
    )
    w.line(f"void {machine.name}_{instance.name}_init({type_} *self);")
    w.line(
        "/* Runs execute once with the inputs in the record. Returns 0, or the place of a fault; outputs and state then stay. */"
    )
    w.line(f"uint32_t {execute_signature(machine, instance)};")
    w.line()


def execute_signature(machine: Machine, instance: Instance) -> str:
    host = ", const fcsl_host_t *host" if instance.execute.uses_hardware else ""
    return f"{machine.name}_{instance.name}_execute({instance_type(machine, instance)} *self{host})"


def _machine_struct(w: CWriter, machine: Machine) -> None:
    with w.braces("typedef struct", f"}} {machine.name}_t;"):
        w.line("uint64_t tick; /* ticks completed */")
        w.line("int32_t current_; /* index of the executing instance, or -1 */")
        w.line("int32_t state_; /* of the last tick */")
        w.line("int32_t next_state_; /* of the coming tick */")
        if machine.counts_state_ticks:
            w.line("uint64_t ticks_in_state; /* ticks completed since the state was entered */")
        for instance in machine.instances:
            w.line(f"{instance_type(machine, instance)} i_{instance.name};")
        for channel in sensors(machine):
            with w.braces("struct", f"}} {channel_member(channel)};"):
                w.line("int64_t stamp_ns;")
                if channel.name in machine.last_samples:
                    w.line("uint64_t last_sample; /* ticks completed after the one of its last sample; 0: none yet */")
                w.line("uint32_t age_ticks;")
                w.line("uint32_t sample_age;")
                w.line("uint8_t attached;")
                w.line("uint8_t fresh;")
                w.line("uint8_t valid;")
    w.line()


def sensors(machine: Machine) -> list[Channel]:
    return [c for c in machine.channels if c.direction == "sensor"]
