# SPDX-License-Identifier: Apache-2.0
"""Records of a machine: its structs, those of each algorithm and instance, its sensor channels, and the machine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ..model import ir
from ..model.c_names import c_name
from ..model.code import STATE, U8, Block, Field, Named, Record
from ..model.machine import Channel, Instance, Machine
from ..model.types import I32, I64, U32, U64, Results
from .cold_paths import counters_record, counters_type
from .expressions import code_type
from .names import (
    channel_member,
    channel_type,
    instance_member,
    instance_type,
    machine_type,
    record_type,
    sensors,
    struct_type,
)


def records(machine: Machine, firsts: Sequence[int]) -> Iterator[Record]:
    """Each after those that it contains. `firsts`: see identical_code_folding.py."""
    for struct in machine.structs:
        fields = [
            Field(c_name(m.name), code_type(machine.name, m.type), f"[{m.unit}]" if m.unit else "")
            for m in struct.members
        ]
        yield Record(struct_type(machine.name, struct), tuple(fields))
    for algorithm in machine.algorithms:
        for record in ir.RECORDS:
            if algorithm.ports[record]:
                ports = tuple(_port(machine, port) for port in algorithm.ports[record])
                yield Record(record_type(machine, algorithm, record), ports)
    if machine.instances:
        yield counters_record(machine)
    for index, (instance, first) in enumerate(zip(machine.instances, firsts, strict=True)):
        like = instance_type(machine, machine.instances[first]) if first != index else ""
        yield Record(instance_type(machine, instance), tuple(_instance(machine, index, instance)), like)
    for with_last_sample in sorted({c.name in machine.last_samples for c in sensors(machine)}):
        yield Record(channel_type(machine, with_last_sample), tuple(_channel(with_last_sample)))
    yield Record(machine_type(machine), tuple(_machine(machine)))


def result_records(machine: Machine) -> Iterator[Record]:
    """Of helpers with several results."""
    for struct in dict.fromkeys(f.result for f, _ in machine.emitted if isinstance(f.result, Results)):
        fields = tuple(Field(c_name(m.name), code_type(machine.name, m.type)) for m in struct.members)
        yield Record(struct_type(machine.name, struct), fields)


def _port(machine: Machine, port: ir.Port) -> Field:
    note = " ".join(part for part in (f"[{port.unit}]" if port.unit else "", port.doc) if part)
    return Field(c_name(port.name), code_type(machine.name, port.type), note)


def _instance(machine: Machine, index: int, instance: Instance) -> Iterator[Field]:
    for record in ir.RECORDS:
        if instance.algorithm.ports[record]:
            yield Field(record, Named(record_type(machine, instance.algorithm, record)))
    yield Field("counters", Named(counters_type(machine)))
    if index in machine.last_runs:
        yield Field("last_run", U64, "ticks completed after its last completed run; 0: none yet")
    if index in machine.completed:
        yield Field("completed", U8, "whether a run has completed since it was stale")


def _channel(with_last_sample: bool) -> Iterator[Field]:
    yield Field("stamp_ns", I64)
    if with_last_sample:
        yield Field("last_sample", U64, "ticks completed after the one of its last sample; 0: none yet")
    yield Field("age_ticks", U32)
    yield Field("sample_age", U32)
    yield Field("attached", U8)
    yield Field("fresh", U8)
    yield Field("waiting", U8)
    yield Field("valid", U8)


def _machine(machine: Machine) -> Iterator[Field]:
    yield Field("tick", U64, "ticks completed")
    yield Field("current_", I32, "index of the executing instance; a brief one leaves the one before; -1 outside")
    yield Field("state_", STATE, "of the last tick")
    yield Field("next_state_", STATE, "of the coming tick")
    if machine.counts_state_ticks:
        yield Field("ticks_in_state", U64, "ticks completed since the state was entered")
    for instance in machine.instances:
        yield Field(instance_member(instance), Named(instance_type(machine, instance)))
    for channel in sensors(machine):
        yield Field(channel_member(channel), Named(_type_of(machine, channel)))
    if machine.preferred:  # at the end, so that what usual ticks touch stays together
        yield Field("lost_requests", Block(U64, len(machine.edges)), "of each edge, by another that was taken")


def _type_of(machine: Machine, channel: Channel) -> str:
    return channel_type(machine, channel.name in machine.last_samples)
