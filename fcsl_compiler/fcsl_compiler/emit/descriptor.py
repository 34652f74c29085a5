# SPDX-License-Identifier: Apache-2.0
"""Generates the descriptor of a machine: the tables of fcsl_machine.h."""

from __future__ import annotations

import hashlib
import math
import re
from collections.abc import Collection
from dataclasses import dataclass, replace

from ..base.files import digest
from ..model import ir
from ..model.c_names import c_literal, c_name, c_string
from ..model.machine import Channel, Instance, Machine, PortRef
from ..model.ranges import UNBOUNDED, Range
from ..model.types import F64, Scalar, count_of, element_of, leaves, scalar_of, shape_of
from ..ros.channels import by_topic, message_of
from .c_writer import CWriter
from .fault_places import FaultPlaces
from .header import channel_member, leaf_member, sensors
from .messages import message_definition, message_name
from .ros_messages import MessageEmitter

_ROLES = {"inputs": "INPUT", "parameters": "PARAMETER", "outputs": "OUTPUT", "state": "STATE"}


@dataclass(frozen=True)
class FieldRow:
    """One row of the field table, with symbolic C expressions."""

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


#: FCSL_NONE and FCSL_FROM_MACHINE of fcsl_machine.h, values of the column `connected_from`.
_NONE, _FROM_MACHINE = -1, -2
#: Part of layout_hash. Increase it when the struct changes in a way that the hashed rows do not show, because a
#: checkpoint contains the bytes of the struct.
_STRUCT_VERSION = 4


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
    return rows


def _opened(row: FieldRow, source: str) -> str:
    return "; ".join(
        part for part in (row.doc, f"a host input of this subset, in the whole machine from {source}") if part
    )


def _connected(machine: Machine, rows: Collection[str]) -> dict[str, str]:
    """For the path of each connected input leaf, the path of its source. "" if `rows` does not contain the source."""
    found: dict[str, str] = {}
    for c in machine.connections:
        target = f"{machine.instances[c.target.instance].name}.inputs.{c.target.path}"
        for leaf in leaves(c.target.type):
            if c.source.instance >= 0:
                source = f"{machine.instances[c.source.instance].name}.outputs.{c.source.path}{leaf.path}"
            else:
                path = f"{c.source.record}.{c.source.path}{leaf.path}"
                source = path if path in rows else ""
            found[target + leaf.path] = source
    return found


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
                        f"i_{instance.name}.{record}.{c_name(port.name)}{leaf_member(leaf)}",
                        scalar.c,
                        index,
                        leaf.unit,
                        port.doc,
                        port.range,
                    )
                )
    counters = [
        ("faults", "FCSL_U64", "uint64_t", "executes that faulted"),
        ("overruns", "FCSL_U64", "uint64_t", "executes longer than max_wcet_us"),
    ]
    if index in machine.last_runs:
        counters.append(("last_run", "FCSL_U64", "uint64_t", "ticks completed after its last run; 0: it has not run"))
    counters.append(("fault_place", "FCSL_U32", "uint32_t", "number of the last fault's place; 0: none so far"))
    for counter, abi_type, c_type, doc in counters:
        path, member = f"{instance.name}.counters.{counter}", f"i_{instance.name}.{counter}"
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
            ("age_ticks", "FCSL_U32", "uint32_t", "", "since a sample"),
            ("stamp_ns", "FCSL_I64", "int64_t", "ns", "the last sample's own time; 0 when it has none"),
            *([last_sample] if channel.name in machine.last_samples else []),
        )
    ]


def layout_hash(machine: Machine) -> str:
    """SHA-256 over everything that must match to restore a checkpoint: paths, types, shapes and order of all fields,
    and the states."""
    rows = [f"struct {_STRUCT_VERSION}"]
    rows += [f"{r.path} {r.abi_type} {list(r.shape)}" for r in field_table(machine)]
    rows += [f"timed {i.name}" for i in machine.instances if i.max_wcet_us]
    rows += [f"frozen {i.name}.{n} {i.parameters[n]}" for i in machine.instances for n in i.frozen]
    rows += [s.name for s in machine.states] + list(machine.requests)
    return hashlib.sha256("\n".join(rows).encode()).hexdigest()


def source_hash(machine: Machine) -> str:
    """SHA-256 over names and texts of the machine JSON (without `views`) and all algorithm files, and over the instances
    of a subset machine."""
    texts = [machine.config.name, machine.hashed_text]
    texts += [part for source in machine.sources for part in (source.name, source.text)]
    return digest(*texts, *(("subset", *machine.subset) if machine.subset else ()))


def _bound(number: int | float) -> str:
    """C double literal for a bound of a range."""
    return c_literal(float(number), F64) if math.isfinite(number) else "-INFINITY" if number < 0 else "INFINITY"


class DescriptorEmitter:
    """Writes the constant tables and the fcsl_machine_t of a machine."""

    def __init__(self, machine: Machine, writer: CWriter, build_hash: str, places: FaultPlaces):
        self.m, self.w, self.build_hash, self.places = machine, writer, build_hash, places
        self.rows = field_table(machine)
        self.by_path = {r.path: n for n, r in enumerate(self.rows)}
        self.struct = f"{machine.name}_t"

    def emit(self) -> None:
        self._shapes()
        self._fields()
        self._instances()
        self._states()
        self._requests()
        self._transitions()
        self._channels()
        self._ros_messages()
        self._fault_places()
        self._machine()

    def _offset(self, member: str) -> str:
        return f"(uint32_t)offsetof({self.struct}, {member})"

    def _table(self, c_type: str, name: str, rows: list[str]) -> str:
        """Writes a table. Returns a C pointer expression to it, NULL for an empty table."""
        if not rows:
            return "NULL"
        with self.w.braces(f"static const {c_type} {name}[] =", "};"):
            for row in rows:
                self.w.line(row + ",")
        self.w.line()
        return name

    def _shapes(self) -> None:
        for shape in sorted({r.shape for r in self.rows if r.shape}):
            name = "fcsl_shape_" + "_".join(map(str, shape))
            self.w.line(f"static const uint32_t {name}[] = {{{', '.join(f'{n}u' for n in shape)}}};")
        self.w.line()

    def _fields(self) -> None:
        connected = _connected(self.m, self.by_path)
        rows = []
        for r in self.rows:
            shape = "fcsl_shape_" + "_".join(map(str, r.shape)) if r.shape else "NULL"
            flags = " | ".join(r.flags) or "0u"
            source = connected.get(r.path)
            source_field = _NONE if source is None else self.by_path[source] if source else _FROM_MACHINE
            rows.append(
                f"{{{c_string(r.path)}, FCSL_ROLE_{r.role}, {r.abi_type}, {flags}, {len(r.shape)}u, {shape}, {r.count}u, "
                f"{self._offset(r.member)}, (uint32_t)({r.count}u * sizeof({r.scalar})), {r.instance}, {source_field}, "
                f"{c_string(r.unit)}, {c_string(r.doc)}, {_bound(r.range.low)}, {_bound(r.range.high)}}}"
            )
        self.fields = self._table("fcsl_field_t", f"fcsl_fields_{self.m.name}", rows)

    def _instances(self) -> None:
        rows = []
        of: dict[int, list[int]] = {}
        for number, row in enumerate(self.rows):
            if row.role != "CHANNEL":
                of.setdefault(row.instance, []).append(number)
        for index, i in enumerate(self.m.instances):
            own = of[index]
            overrun = self._offset(f"i_{i.name}.inject_overrun") if i.max_wcet_us else "FCSL_NO_OFFSET"
            fault = self._offset(f"i_{i.name}.inject_fault")
            rows.append(
                f"{{{c_string(i.name)}, {c_string(i.algorithm.name)}, {c_string(i.algorithm.source)}, "
                f"{i.algorithm.execute.span.line}u, {own[0]}u, {len(own)}u, "
                f"{self._offset(f'i_{i.name}.outputs.transition_request')}, {self._offset(f'i_{i.name}.outputs.health')}, "
                f"{self._offset(f'i_{i.name}.faults')}, {self._offset(f'i_{i.name}.overruns')}, "
                f"{self._offset(f'i_{i.name}.fault_place')}, {overrun}, {fault}, "
                f"{i.max_wcet_us}u, {int(i.published)}u, "
                f"{c_string(f'{self.m.package}/msg/{message_name(self.m, i)}')}, {c_string(message_definition(self.m, i))}}}"
            )
        self.instances = self._table("fcsl_instance_t", f"fcsl_instances_{self.m.name}", rows)

    def _states(self) -> None:
        rows = []
        for state in self.m.states:
            entries = [f"{{{e.instance}u, {e.divisor}u, {e.phase}u}}" for e in state.entries]
            table = self._table("fcsl_schedule_t", f"fcsl_schedule_{self.m.name}_{state.name}", entries)
            rows.append(f"{{{c_string(state.name)}, {table}, {len(entries)}u}}")
        self.states = self._table("fcsl_state_t", f"fcsl_states_{self.m.name}", rows)

    def _requests(self) -> None:
        rows = [c_string(r) for r in self.m.requests]
        self.requests = self._table("char *const", f"fcsl_requests_{self.m.name}", rows)

    def _transitions(self) -> None:
        rows = [
            f"{{{e.source}, {e.target}, {e.request}, {e.priority}, {e.guard_instance}, {e.guard_mask}u}}"
            for e in self.m.edges
        ]
        self.transitions = self._table("fcsl_transition_t", f"fcsl_transitions_{self.m.name}", rows)
        times = [f"{e.after_ticks}u" for e in self.m.edges] if any(e.after_ticks for e in self.m.edges) else []
        self.after_ticks = self._table("uint64_t", f"fcsl_after_ticks_{self.m.name}", times)

    def _path(self, port: PortRef) -> str:
        return f"{self.m.instances[port.instance].name}.{port.record}.{port.path}"

    def _channels(self) -> None:
        rows = []
        for c in self.m.channels:
            path = self._path(c.port)
            age = "UINT32_MAX" if c.max_age_ticks is None else f"{c.max_age_ticks}u"
            names = ("attached", "fresh", "valid", "age_ticks", "sample_age", "stamp_ns")
            kept = ["FCSL_NO_OFFSET"] * len(names)
            if c.direction == "sensor":
                kept = [self._offset(f"{channel_member(c)}.{n}") for n in names]
            ros = (c.ros.type, c.ros.field, c.ros.topic, c.ros.frame, c.ros.child_frame, c.ros.axes)
            rows.append(
                f"{{{c_string(c.name)}, {c.id}u, FCSL_{c.direction.upper()}, {self.by_path[path]}u, {age}, {', '.join(kept)}, "
                f"{', '.join(map(c_string, ros))}, {self._safe(c)}, FCSL_AS_{c.kind.upper()}}}"
            )
        self.channels = self._table("fcsl_channel_t", f"fcsl_channels_{self.m.name}", rows)

    def _ros_messages(self) -> None:
        """The messages of mapped channels, by topic."""
        emitter = MessageEmitter(self.w, self.m.channels, self._field_offset)
        prefix = f"fcsl_ros_{self.m.name}"
        rows = [emitter.emit(message_of(parts), f"{prefix}_{i}") for i, parts in enumerate(by_topic(self.m.channels))]
        self.ros_messages = self._table("fcsl_ros_message_t", f"{prefix}_messages", rows), len(rows)

    def _field_offset(self, channel: Channel) -> str:
        return self._offset(self.rows[self.by_path[self._path(channel.port)]].member)

    def _safe(self, channel: Channel) -> str:
        """Writes the safe value of a channel, flat as its field. Returns a C pointer expression to it."""
        if not channel.safe:
            return "NULL"
        element = element_of(channel.port.type)
        assert isinstance(element, Scalar)
        name = f"fcsl_safe_{self.m.name}_{channel.id}"
        values = ", ".join(c_literal(v, element) for v in channel.safe if not isinstance(v, str))
        self.w.line(f"static const {element.c} {name}[] = {{{values}}};")
        return name

    def _fault_places(self) -> None:
        rows = [f"{{{c_string(p.file)}, {p.line}u, {p.column}u, {c_string(p.cause)}}}" for p in self.places.rows]
        self.fault_places = self._table("fcsl_fault_place_t", f"fcsl_fault_places_{self.m.name}", rows)

    def _machine(self) -> None:
        m = self.m
        rows = {
            "abi_version": "FCSL_ABI_VERSION",
            "name": c_string(m.name),
            "source_hash": c_string(source_hash(m)),
            "layout_hash": c_string(layout_hash(m)),
            "build_hash": c_string(self.build_hash),
            "tick_hz": f"{m.tick_hz}u",
            "size": f"(uint32_t)sizeof({self.struct})",
            "align": f"(uint32_t)_Alignof({self.struct})",
            "current_offset": self._offset("current_"),
            "tick_offset": self._offset("tick"),
            "state_offset": self._offset("state_"),
            "next_state_offset": self._offset("next_state_"),
            "arm_field": str(self.by_path[self._path(m.arm)]) if m.arm is not None else "FCSL_NONE",
            "views": c_string(m.views),
        }
        for name, table, count in (
            ("field", self.fields, len(self.rows)),
            ("instance", self.instances, len(m.instances)),
            ("state", self.states, len(m.states)),
            ("request", self.requests, len(m.requests)),
            ("transition", self.transitions, len(m.edges)),
            ("channel", self.channels, len(m.channels)),
            ("fault_place", self.fault_places, len(self.places.rows)),
        ):
            rows[f"{name}s"], rows[f"{name}_count"] = table, f"{count}u"
        table, count = self.ros_messages
        if count:
            rows |= {"ros_messages": table, "ros_message_count": f"{count}u"}
        if m.command_timeout_ns:
            rows["command_timeout_ns"] = f"UINT64_C({m.command_timeout_ns})"
        if self.after_ticks != "NULL":
            rows |= {"after_ticks": self.after_ticks, "ticks_in_state_offset": self._offset("ticks_in_state")}
        for entry in ("init", "step", "force_state"):
            rows[entry] = f"fcsl_{entry}_{m.name}"
        with self.w.braces(f"const fcsl_machine_t {m.name}_machine =", "};"):
            for key, value in rows.items():
                self.w.line(f".{key} = {value},")
