# SPDX-License-Identifier: Apache-2.0
"""The field table of a machine, and the hashes of its descriptor."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..base.files import digest
from ..model import ir
from ..model.c_names import c_name
from ..model.machine import Channel, Instance, Machine
from ..model.ranges import UNBOUNDED, Range
from ..model.types import Scalar, count_of, leaves, scalar_of, shape_of
from ..ros.channels import definitions_used
from .names import channel_member, instance_member, leaf_member, sensors

_ROLES = {"inputs": "INPUT", "parameters": "PARAMETER", "outputs": "OUTPUT", "state": "STATE"}


@dataclass(frozen=True)
class FieldRow:
    """One row of the field table."""

    path: str
    role: str
    abi_type: str
    flags: tuple[str, ...]  # FCSL_FIELD_…
    shape: tuple[int, ...]
    count: int
    member: str  # C member expression relative to the machine struct
    scalar: str  # C type of one scalar
    instance: int
    unit: str
    doc: str
    range: Range = UNBOUNDED

    @property
    def in_instance(self) -> bool:
        return self.role not in ("MACHINE", "CHANNEL")


@dataclass(frozen=True)
class Fold:
    """Instances with the same fields: rows whose path is what follows the name, and whose member is one of the record."""

    rows: tuple[FieldRow, ...]
    instances: tuple[int, ...]


#: Instances with the fields of another one from which a library has them once (fcsl_folded_fields_t). Fewer are not worth a
#: table of their own.
_FOLDED = 64

#: Part of layout_hash. Increase it when the struct changes in a way that the hashed rows do not show, because a
#: checkpoint contains the bytes of the struct.
_STRUCT_VERSION = 5


def field_table(machine: Machine) -> list[FieldRow]:
    """All leaves of the machine struct, in the order of the struct."""
    rows = [
        FieldRow("machine.tick", "MACHINE", "FCSL_U64", (), (), 1, "tick", "uint64_t", -1, "", "ticks completed"),
        FieldRow("machine.state", "MACHINE", "FCSL_STATE", (), (), 1, "state_", "int32_t", -1, "", "of the last tick"),
        FieldRow(
            "machine.next_state",
            "MACHINE",
            "FCSL_STATE",
            (),
            (),
            1,
            "next_state_",
            "int32_t",
            -1,
            "",
            "of the coming tick",
        ),
    ]
    if machine.counts_state_ticks:
        path, doc = "machine.ticks_in_state", "ticks completed since the state was entered"
        rows.append(FieldRow(path, "MACHINE", "FCSL_U64", (), (), 1, "ticks_in_state", "uint64_t", -1, "", doc))
    for index, instance in enumerate(machine.instances):
        rows += _instance_rows(machine, index, instance)
    rows = [replace(r, doc=_opened(r, machine.left_out[r.path])) if r.path in machine.left_out else r for r in rows]
    for channel in sensors(machine):
        rows += _channel_rows(machine, channel)
    if machine.preferred:
        path, doc, n = "machine.lost_requests", "of each transition: requests lost to another one", len(machine.edges)
        rows.append(FieldRow(path, "MACHINE", "FCSL_U64", (), (n,), n, "lost_requests", "uint64_t", -1, "", doc))
    return rows


def fold(machine: Machine, rows: Sequence[FieldRow]) -> list[Fold]:
    """The folds of a machine, `rows` its field table; none if too few instances are alike."""
    own: list[list[FieldRow]] = [[] for _ in machine.instances]
    for row in rows:
        if row.in_instance:
            own[row.instance].append(row)
    found: dict[tuple[str, tuple[tuple[object, ...], ...]], list[int]] = {}
    for index, instance in enumerate(machine.instances):
        name, member = len(instance.name), len(instance_member(instance)) + 1
        alike = tuple((r.path[name:], r.member[member:], r.flags, r.doc) for r in own[index])
        found.setdefault((instance.algorithm.name, alike), []).append(index)
    if len(machine.instances) - len(found) < _FOLDED:
        return []
    return [_fold(machine, own[alike[0]], alike) for alike in found.values()]


def _fold(machine: Machine, rows: Sequence[FieldRow], alike: Sequence[int]) -> Fold:
    first = machine.instances[alike[0]]
    name, member = len(first.name), len(instance_member(first)) + 1
    relative = (replace(r, path=r.path[name:], member=r.member[member:], instance=-1) for r in rows)
    return Fold(tuple(relative), tuple(alike))


def _opened(row: FieldRow, source: str) -> str:
    return "; ".join(
        part for part in (row.doc, f"a host input of this subset, in the whole machine from {source}") if part
    )


def _instance_rows(machine: Machine, index: int, instance: Instance) -> list[FieldRow]:
    rows: list[FieldRow] = []
    assigned = _assigned(instance.algorithm.execute)
    for record in ir.RECORDS:
        for port in instance.algorithm.ports[record]:
            for leaf in leaves(port.type, port.unit):
                scalar = scalar_of(leaf.type)
                written = record == "outputs" and _is_assigned(port.name + leaf.path, assigned)
                rows.append(
                    FieldRow(
                        f"{instance.name}.{record}.{port.name}{leaf.path}",
                        _ROLES[record],
                        scalar.abi,
                        _flags(instance, record, port.name, scalar, written),
                        shape_of(leaf.type),
                        count_of(leaf.type),
                        f"i_{instance.identifier}.{record}.{c_name(port.name)}{leaf_member(leaf)}",
                        scalar.c,
                        index,
                        leaf.unit,
                        port.doc,
                        port.range,
                    )
                )
    counters = [
        ("counters.faults", "FCSL_U64", "uint64_t", "executes that faulted"),
        ("counters.overruns", "FCSL_U64", "uint64_t", "executes longer than max_wcet_us"),
    ]
    counters.append(
        ("counters.fault_place", "FCSL_U32", "uint32_t", "number of the last fault's place; 0: none so far")
    )
    if index in machine.last_runs:
        text = "ticks completed after its last completed run; 0: none so far"
        counters.append(("last_run", "FCSL_U64", "uint64_t", text))
    if index in machine.completed:
        counters.append(("completed", "FCSL_BOOL", "uint8_t", "whether a run has completed since it was stale"))
    for member_of_record, abi_type, c_type, doc in counters:
        path = f"{instance.name}.counters.{member_of_record.removeprefix('counters.')}"
        member = f"i_{instance.identifier}.{member_of_record}"
        rows.append(FieldRow(path, "COUNTER", abi_type, (), (), 1, member, c_type, index, "", doc))
    return rows


def _assigned(execute: ir.Function) -> set[str]:
    """Paths below `outputs` that a statement of execute assigns, wholly or in part, without indices."""
    found = set()
    for target, _, _ in ir.writes(execute.body):
        root, path = ir.root(target), ""
        while isinstance(target, ir.Member | ir.Element | ir.Slice):
            path = f".{target.name}{path}" if isinstance(target, ir.Member) else path
            target = target.base
        if isinstance(root, ir.Field) and root.record == "outputs":
            found.add(root.name + path)
    return found


def _is_assigned(leaf: str, assigned: set[str]) -> bool:
    """Whether an assigned path contains the leaf, such as "targets[2].pose.valid", or a part of it."""
    steps = re.sub(r"\[\d+\]", "", leaf).split(".")
    return any(".".join(steps[:n]) in assigned for n in range(1, len(steps) + 1))


def _flags(instance: Instance, record: str, name: str, scalar: Scalar, assigned: bool) -> tuple[str, ...]:
    impure = ("FCSL_FIELD_IMPURE",) if record in ("outputs", "state") and instance.algorithm.effects else ()
    if record == "parameters" and name in instance.frozen:
        return ("FCSL_FIELD_FROZEN",)
    # Algorithms write these pulses. A host that wants a transition sets the state instead.
    if record == "outputs" and name in ("health", "transition_request"):
        return impure
    return ("FCSL_FIELD_WRITABLE", *impure, *(("FCSL_FIELD_ASSIGNED",) if assigned else ()))


def _channel_rows(machine: Machine, channel: Channel) -> list[FieldRow]:
    path, member, index = f"channels.{channel.name}", channel_member(channel), channel.port.instance
    last_sample = (
        "last_sample",
        "FCSL_U64",
        "uint64_t",
        "",
        "ticks completed after that of its last sample; 0: none came",
    )
    return [
        FieldRow(f"{path}.{name}", "CHANNEL", abi_type, (), (), 1, f"{member}.{name}", c_type, index, unit, doc)
        for name, abi_type, c_type, unit, doc in (
            ("valid", "FCSL_BOOL", "uint8_t", "", "young enough"),
            ("waiting", "FCSL_BOOL", "uint8_t", "", "no sample has come yet"),
            ("age_ticks", "FCSL_U32", "uint32_t", "", "since a sample"),
            ("stamp_ns", "FCSL_I64", "int64_t", "ns", "the last sample's own time; 0 when it has none"),
            *([last_sample] if channel.name in machine.last_samples else []),
        )
    ]


def layout_hash(machine: Machine, table: Sequence[FieldRow]) -> str:
    """SHA-256 over everything that must match to restore a checkpoint: paths, types, shapes and order of all fields,
    and the states. `table`: from field_table."""
    rows = [f"struct {_STRUCT_VERSION}"]
    rows += [f"{r.path} {r.abi_type} {list(r.shape)}" for r in table]
    rows += [f"timed {i.name}" for i in machine.instances if i.max_wcet_us]
    rows += [f"frozen {i.name}.{n} {i.parameters[n]}" for i in machine.instances for n in i.frozen]
    rows += [s.name for s in machine.states] + list(machine.requests)
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()


def source_hash(machine: Machine) -> str:
    """SHA-256 over names and texts of the machine JSON (without `views`) and all algorithm files, over the definitions of
    messages that are not standard, and over the instances of a subset machine."""
    texts = [machine.config.name, machine.hashed_text]
    texts += [part for source in machine.sources for part in (source.name, source.text)]
    texts += [part for name, lines in definitions_used(machine.channels).items() for part in (name, *lines)]
    return digest(*texts, *(("subset", *machine.subset) if machine.subset else ()))
