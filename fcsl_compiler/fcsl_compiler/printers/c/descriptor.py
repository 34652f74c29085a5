# SPDX-License-Identifier: Apache-2.0
"""C of the descriptor of a machine: the tables of fcsl_machine.h."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable

from ...emit.fault_places import FaultPlaces
from ...emit.field_table import FieldRow, Fold, field_table, fold, layout_hash, source_hash
from ...emit.messages import message_definition, message_name
from ...emit.names import channel_member, instance_member, instance_type
from ...model.c_names import c_literal, c_string
from ...model.events import SEVERITIES, sites_of
from ...model.machine import Channel, Machine, PortRef
from ...model.types import F64, Scalar, element_of, leaves
from ...ros.channels import by_topic, message_of, payload_of
from .ros_messages import MessageEmitter
from .writer import CWriter

#: FCSL_NONE and FCSL_FROM_MACHINE of fcsl_machine.h, values of the column `connected_from`.
_NONE, _FROM_MACHINE = -1, -2


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
    found |= {f"{machine.instances[w.instance].name}.inputs.{w.input}": w.path for w in machine.watched}
    return found


def _bound(number: int | float) -> str:
    """C double literal for a bound of a range."""
    return c_literal(float(number), F64) if math.isfinite(number) else "-INFINITY" if number < 0 else "INFINITY"


class DescriptorEmitter:
    """Writes the constant tables and the fcsl_machine_t of a machine."""

    def __init__(
        self,
        machine: Machine,
        writer: CWriter,
        build_hash: str,
        places: FaultPlaces,
        stack_bytes: int,
        times: bool,
        folds: bool,
    ):
        self.m, self.w, self.build_hash, self.places = machine, writer, build_hash, places
        self.stack_bytes, self.times, self.folds = stack_bytes, times, folds
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
        self._services()
        self._fault_places()
        self._event_sites()
        self._machine()

    def _offset(self, member: str, struct: str = "") -> str:
        return f"(uint32_t)offsetof({struct or self.struct}, {member})"

    def _table(self, c_type: str, name: str, rows: Iterable[str]) -> str:
        """Writes a table. Returns a C pointer expression to it, NULL for an empty table."""
        rows = list(rows)
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
        connected = {
            self.by_path[path]: self.by_path[source] if source else _FROM_MACHINE
            for path, source in _connected(self.m, self.by_path).items()
            if path in self.by_path
        }
        self.fields, self.folded, folds = "NULL", "NULL", fold(self.m, self.rows) if self.folds else []
        if folds:
            self._folded(folds, connected)
        else:
            rows = (self._field(row, connected.get(n, _NONE)) for n, row in enumerate(self.rows))
            self.fields = self._table("fcsl_field_t", f"fcsl_fields_{self.m.name}", rows)

    def _field(self, r: FieldRow, source: int, struct: str = "") -> str:
        """`struct`: the type that contains its member, that of the machine without one."""
        shape = "fcsl_shape_" + "_".join(map(str, r.shape)) if r.shape else "NULL"
        flags = " | ".join(r.flags) or "0u"
        return (
            f"{{{c_string(r.path)}, FCSL_ROLE_{r.role}, {r.abi_type}, {flags}, {len(r.shape)}u, {shape}, {r.count}u, "
            f"{self._offset(r.member, struct)}, (uint32_t)({r.count}u * sizeof({r.scalar})), {r.instance}, {source}, "
            f"{c_string(r.unit)}, {c_string(r.doc)}, {_bound(r.range.low)}, {_bound(r.range.high)}}}"
        )

    def _folded(self, folds: list[Fold], connected: dict[int, int]) -> None:
        """The tables of fcsl_folded_fields_t."""
        name = self.m.name
        tables, uses = list[str](), dict[int, int]()
        for number, made in enumerate(folds):
            struct = instance_type(self.m, self.m.instances[made.instances[0]])
            rows = [self._field(row, _NONE, struct) for row in made.rows]
            tables.append(f"{{{self._table('fcsl_field_t', f'fcsl_fields_{name}_{number}', rows)}, {len(rows)}u}}")
            uses |= dict.fromkeys(made.instances, number)
        of = [f"{{{uses[n]}u, {self._offset(instance_member(i))}}}" for n, i in enumerate(self.m.instances)]
        others = [self._field(row, _NONE) for row in self.rows if not row.in_instance]
        pairs = [f"{{{field}u, {source}}}" for field, source in connected.items()]
        members = (
            (self._table("fcsl_fold_t", f"fcsl_folds_{name}", tables), len(tables)),
            (self._table("fcsl_folded_instance_t", f"fcsl_folded_instances_{name}", of), None),
            (self._table("fcsl_field_t", f"fcsl_fields_{name}", others), len(others)),
            (self._table("fcsl_folded_connection_t", f"fcsl_folded_connections_{name}", pairs), len(pairs)),
        )
        text = ", ".join(part for table, n in members for part in (table, *([] if n is None else [f"{n}u"])))
        self.folded = f"&fcsl_folded_{name}"
        self.w.line(f"static const fcsl_folded_fields_t fcsl_folded_{name} = {{{text}}};")
        self.w.line()

    def _instances(self) -> None:
        rows = []
        of: dict[int, list[int]] = {}
        for number, row in enumerate(self.rows):
            if row.in_instance:
                of.setdefault(row.instance, []).append(number)
        for index, i in enumerate(self.m.instances):
            own = of[index]
            overrun = self._offset(f"i_{i.identifier}.counters.inject_overrun") if i.max_wcet_us else "FCSL_NO_OFFSET"
            fault = self._offset(f"i_{i.identifier}.counters.inject_fault")
            rows.append(
                f"{{{c_string(i.name)}, {c_string(i.algorithm.name)}, {c_string(i.algorithm.source)}, "
                f"{i.algorithm.execute.span.line}u, {own[0]}u, {len(own)}u, "
                f"{self._offset(f'i_{i.identifier}.outputs.transition_request')}, {self._offset(f'i_{i.identifier}.outputs.health')}, "
                f"{self._offset(f'i_{i.identifier}.counters.faults')}, {self._offset(f'i_{i.identifier}.counters.overruns')}, "
                f"{self._offset(f'i_{i.identifier}.counters.fault_place')}, {overrun}, {fault}, "
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
            age, grace = ("UINT32_MAX" if n is None else f"{n}u" for n in (c.max_age_ticks, c.grace_ticks))
            names = ("attached", "fresh", "valid", "waiting", "age_ticks", "sample_age", "stamp_ns")
            kept = ["FCSL_NO_OFFSET"] * len(names)
            if c.direction == "sensor":
                kept = [self._offset(f"{channel_member(c)}.{n}") for n in names]
            ros = (c.ros.type, c.ros.field, c.ros.topic, c.ros.frame, c.ros.child_frame, c.ros.axes)
            rows.append(
                f"{{{c_string(c.name)}, {c.id}u, FCSL_{c.direction.upper()}, {self.by_path[path]}u, {age}, {grace}, {', '.join(kept)}, "
                f"{', '.join(map(c_string, ros))}, {self._safe(c)}, FCSL_AS_{c.kind.upper()}}}"
            )
        self.channels = self._table("fcsl_channel_t", f"fcsl_channels_{self.m.name}", rows)

    def _ros_messages(self) -> None:
        """The messages of mapped channels, by topic, and those of all channels on the bus."""
        emitter = MessageEmitter(self.w, self.m.channels, self._field_offset)
        prefix = f"fcsl_ros_{self.m.name}"
        rows = [emitter.emit(message_of(parts), f"{prefix}_{i}") for i, parts in enumerate(by_topic(self.m.channels))]
        self.ros_messages = self._table("fcsl_ros_message_t", f"{prefix}_messages", rows), len(rows)
        cdr = self.m.channels if self.m.payload == "cdr" else ()
        rows = [emitter.emit(payload_of(channel), f"{prefix}_payload_{i}") for i, channel in enumerate(cdr)]
        self.payloads = self._table("fcsl_ros_message_t", f"{prefix}_payloads", rows)

    def _services(self) -> None:
        """The services whose calls are samples of channels."""
        rows = []
        for index, channel in enumerate(self.m.channels):
            service = channel.service
            if service is not None:
                kind = {"std_srvs/Trigger": "FCSL_TRIGGER", "std_srvs/SetBool": "FCSL_SET_BOOL"}[service.type]
                rows.append(
                    f"{{{c_string(service.name)}, {kind}, {index}u, {c_string(service.accepted)}, "
                    f"{c_string(service.refused)}, {service.within_ticks}u}}"
                )
        self.services = self._table("fcsl_service_t", f"fcsl_services_{self.m.name}", rows), len(rows)

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

    def _event_sites(self) -> None:
        rows = []
        for number, instance in enumerate(self.m.instances):
            for s in sites_of(instance.execute):
                types = ", ".join(s.types) or "0"
                rows.append(
                    f"{{{number}u, {c_string(s.file)}, {s.line}u, {s.column}u, {c_string(s.text)}, "
                    f"FCSL_{SEVERITIES[s.severity].upper()}, {len(s.types)}u, {{{types}}}}}"
                )
        self.event_sites = self._table("fcsl_event_site_t", f"fcsl_event_sites_{self.m.name}", rows), len(rows)

    def _machine(self) -> None:
        m = self.m
        rows = {
            "abi_version": "FCSL_ABI_VERSION",
            "name": c_string(m.name),
            "source_hash": c_string(source_hash(m)),
            "layout_hash": c_string(layout_hash(m, self.rows)),
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
            "stack_bytes": f"{min(self.stack_bytes, 2**32 - 1)}u",
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
        table, count = self.services
        if count:
            rows |= {"services": table, "service_count": f"{count}u"}
        if self.payloads != "NULL":
            rows["payloads"] = self.payloads
        if self.folded != "NULL":
            rows["folded"] = self.folded
        if self.times:
            rows["measured"] = "1"
        table, count = self.event_sites
        if count:
            rows |= {"event_sites": table, "event_site_count": f"{count}u"}
        if m.command_timeout_ns:
            rows["command_timeout_ns"] = f"UINT64_C({m.command_timeout_ns})"
        if self.after_ticks != "NULL":
            rows |= {"after_ticks": self.after_ticks, "ticks_in_state_offset": self._offset("ticks_in_state")}
        for entry in ("init", "start", "step", "force_state"):
            rows[entry] = f"fcsl_{entry}_{m.name}"
        with self.w.braces(f"const fcsl_machine_t {m.name}_machine =", "};"):
            for key, value in rows.items():
                self.w.line(f".{key} = {value},")
