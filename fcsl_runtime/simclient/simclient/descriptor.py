# SPDX-License-Identifier: Apache-2.0
"""A machine's descriptor as plain Python values."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from .c_machine import (
    DIRECTION_NAMES,
    FROM_MACHINE,
    FROZEN,
    HEALTH_NAMES,
    IMPURE,
    ROLE_NAMES,
    SERVICE_TYPES,
    SEVERITY_NAMES,
    TYPE_NAMES,
    WRITABLE,
    CMachine,
)


def type_text(type_: str, shape: tuple[int, ...]) -> str:
    """The type as a user writes it: `f64[2][3]`."""
    return type_ + "".join(f"[{extent}]" for extent in shape)


@dataclass(frozen=True)
class Field:
    """One leaf of the machine struct, as `describe` shows it.

    A host may set values in [`minimum`, `maximum`]; -inf and inf mean no bound. Only parameters have bounds.
    `connected_from` is the source path of a connected input, "the machine" for values without a field (machine.dt),
    and empty for all other fields.
    """

    index: int
    path: str
    role: str
    type: str
    shape: tuple[int, ...]
    count: int
    offset: int
    size: int
    instance: str
    connected_from: str
    unit: str
    doc: str
    writable: bool
    frozen: bool
    impure: bool
    minimum: float = -math.inf
    maximum: float = math.inf

    @property
    def bounded(self) -> bool:
        """Whether it has a range."""
        return not (math.isinf(self.minimum) and math.isinf(self.maximum))

    @property
    def type_text(self) -> str:
        """The type as a user writes it."""
        return type_text(self.type, self.shape)

    def __str__(self) -> str:
        notes = [self.role]
        if self.connected_from:
            notes.append(f"connected from {self.connected_from}")
        if self.frozen:
            notes.append("frozen")
        elif not self.writable:
            notes.append("read-only")
        if self.bounded:
            notes.append(f"{self.minimum:g} to {self.maximum:g}")
        text = f"{self.path}: {self.type_text}{' ' + self.unit if self.unit else ''} ({', '.join(notes)})"
        return f"{text}  # {self.doc}" if self.doc else text


@dataclass(frozen=True)
class Instance:
    """One algorithm in the machine.

    `source_file` and `source_line` locate the algorithm's definition. `max_wcet_us` is its time limit in microseconds
    (0: none). The offsets are those of its outputs in the machine struct, in bytes. The message is its type in
    recordings and, if `published`, on a ROS 2 topic.
    """

    index: int
    name: str
    algorithm: str
    source_file: str
    source_line: int
    max_wcet_us: int
    health_offset: int
    request_offset: int
    message_type: str
    message_text: str
    published: bool

    @property
    def topic(self) -> str:
        """Its topic below that of the machine: `att/rate` of instance `att.rate`."""
        return self.name.replace(".", "/")


@dataclass(frozen=True)
class Channel:
    """A sensor, an actuator or a report of the machine.

    `id` is its number in messages, `direction` "sensor", "actuator" or "report", `field` the field that it carries. A
    sensor whose last sample is older than `max_age_ticks` is invalid. One that waits for its first sample for longer than
    `grace_ticks` is a failure (both: 2**32 - 1: never). The ROS names select a part of a message
    (fcsl_machine.h); all are empty if the channel has no ROS message.
    """

    index: int
    name: str
    id: int
    direction: str
    field: Field
    max_age_ticks: int
    grace_ticks: int
    ros_type: str
    ros_field: str
    ros_topic: str
    ros_frame: str
    ros_child_frame: str
    ros_axes: str


@dataclass(frozen=True)
class RosMessage:
    """A ROS 2 message of channels, by their indices.

    `type` is its full name, `type_hash` that of its definition when the machine was built; `reader` and `composer` are the
    addresses of its conversions in the machine's library.
    """

    topic: str
    type: str
    type_hash: str
    channels: tuple[int, ...]
    reader: int
    composer: int


@dataclass(frozen=True)
class Service:
    """A ROS 2 service of this `type`, std_srvs/srv/Trigger or SetBool, whose calls are samples of channel number `channel`.
    `name` is relative to the node's namespace unless it begins with a slash."""

    name: str
    type: str
    channel: int


@dataclass(frozen=True)
class Transition:
    """A transition between states.

    It goes from `source` to `target` when three conditions hold: an instance makes `request` (empty: none is needed),
    the `guard_instance` (empty: no guard) has one of the healths in `guard_health`, and the state has lasted
    `after_ticks` (0: not timed). Of several transitions
    that could be taken, the one of the highest `priority` is.
    """

    source: str
    target: str
    request: str
    priority: int
    guard_instance: str
    guard_health: tuple[str, ...]
    after_ticks: int

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}" + (f": {self.request}" if self.request else "")


@dataclass(frozen=True)
class FaultPlace:
    """The place and cause of a fault; `str` gives one line.

    `file` is as the machine JSON names it; `line` and `column` count from 1. An injected fault has no place: `file` is
    empty.
    """

    file: str
    line: int
    column: int
    cause: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}: {self.cause}" if self.file else self.cause


@dataclass(frozen=True)
class EventSite:
    """A place in the source that reports an event, of instance number `instance`. `types`: of its values."""

    instance: int
    file: str
    line: int
    column: int
    text: str
    severity: str
    types: tuple[str, ...]


@dataclass(frozen=True)
class Machine:
    """A machine's descriptor. `fields` maps path to field, in descriptor order."""

    name: str
    source_hash: str
    layout_hash: str
    build_hash: str
    tick_hz: int
    size: int
    fields: dict[str, Field]
    instances: tuple[Instance, ...]
    states: tuple[str, ...]
    requests: tuple[str, ...]
    transitions: tuple[Transition, ...]
    channels: tuple[Channel, ...]
    #: What the numbers of `counters.fault_place` mean, from 1.
    fault_places: tuple[FaultPlace, ...] = ()
    event_sites: tuple[EventSite, ...] = ()
    #: What plots and viewers show, as JSON text (docs/reference/language.md, views); "" for none.
    views: str = ""
    #: The messages of mapped channels, by topic.
    ros_messages: tuple[RosMessage, ...] = ()
    services: tuple[Service, ...] = ()
    #: Whether it describes only the part of the machine that a telemetry sender sends.
    partial: bool = False

    @property
    def host_inputs(self) -> tuple[str, ...]:
        """Inputs that only a host can set: they have no connection and no channel."""
        bound = {c.field.path for c in self.channels}
        inputs = (f for f in self.fields.values() if f.role == "input")
        return tuple(f.path for f in inputs if not f.connected_from and f.path not in bound)

    def fault_place(self, number: int) -> FaultPlace | None:
        """The place that a value of `counters.fault_place` means; None for 0 (no fault so far) and for unknown numbers."""
        return self.fault_places[number - 1] if 0 < number <= len(self.fault_places) else None

    def named_lost_requests(self, counts: Sequence[int]) -> dict[str, int]:
        """What `machine.lost_requests` counts, by transition, without the zeros: {"HOVER -> SAFE: ABORT": 1}."""
        named: dict[str, int] = {}
        for transition, count in zip(self.transitions, counts, strict=False):
            if count:
                named[str(transition)] = named.get(str(transition), 0) + count
        return named

    def lost_requests(self, read: Callable[[int, int], bytes]) -> dict[str, int]:
        """Likewise, of a machine struct of which `read(offset, size)` gives the bytes; {} for a machine that loses none."""
        field = self.fields.get("machine.lost_requests")
        if field is None:
            return {}
        return self.named_lost_requests(memoryview(read(field.offset, field.size)).cast("Q"))

    def time_ns(self, tick: int) -> int:
        """Time of tick `tick` in ns: floor(tick * 1e9 / tick_hz)."""
        return tick * 1_000_000_000 // self.tick_hz


def _text(value: bytes | None) -> str:
    return value.decode("utf-8", "replace") if value else ""


def _source(index: int, paths: list[str]) -> str:
    """The path that a field is connected from."""
    return "the machine" if index == FROM_MACHINE else paths[index] if index >= 0 else ""


def _read_fields(machine: Any, instances: list[str]) -> dict[str, Field]:
    raw = [machine.fields[i] for i in range(machine.field_count)]
    paths = [_text(f.path) for f in raw]
    return {
        paths[i]: Field(
            index=i,
            path=paths[i],
            role=ROLE_NAMES[f.role],
            type=TYPE_NAMES[f.type],
            shape=tuple(f.shape[d] for d in range(f.rank)),
            count=f.count,
            offset=f.offset,
            size=f.size,
            instance=instances[f.instance] if f.instance >= 0 else "",
            connected_from=_source(f.connected_from, paths),
            unit=_text(f.unit),
            doc=_text(f.doc),
            writable=bool(f.flags & WRITABLE),
            frozen=bool(f.flags & FROZEN),
            impure=bool(f.flags & IMPURE),
            minimum=f.minimum,
            maximum=f.maximum,
        )
        for i, f in enumerate(raw)
    }


def _read_transitions(
    machine: Any, states: tuple[str, ...], requests: tuple[str, ...], instances: list[str]
) -> tuple[Transition, ...]:
    raw = [machine.transitions[i] for i in range(machine.transition_count)]
    return tuple(
        Transition(
            source=states[t.from_],
            target=states[t.to],
            request=requests[t.request] if t.request >= 0 else "",
            priority=t.priority,
            guard_instance=instances[t.guard_instance] if t.guard_instance >= 0 else "",
            guard_health=tuple(name for i, name in enumerate(HEALTH_NAMES) if t.guard_mask >> i & 1)
            if t.guard_instance >= 0
            else (),
            after_ticks=machine.after_ticks[i] if machine.after_ticks else 0,
        )
        for i, t in enumerate(raw)
    )


def _read_instances(machine: Any) -> tuple[Instance, ...]:
    raw = [machine.instances[i] for i in range(machine.instance_count)]
    return tuple(
        Instance(
            index=i,
            name=_text(r.name),
            algorithm=_text(r.algorithm),
            source_file=_text(r.source_file),
            source_line=r.source_line,
            max_wcet_us=r.max_wcet_us,
            health_offset=r.health_offset,
            request_offset=r.request_offset,
            message_type=_text(r.message_type),
            message_text=_text(r.message_text),
            published=bool(r.published),
        )
        for i, r in enumerate(raw)
    )


def _read_channels(machine: Any, fields: dict[str, Field]) -> tuple[Channel, ...]:
    by_index = tuple(fields.values())
    raw = [machine.channels[i] for i in range(machine.channel_count)]
    return tuple(
        Channel(
            index=i,
            name=_text(c.name),
            id=c.id,
            direction=DIRECTION_NAMES[c.direction],
            field=by_index[c.field],
            max_age_ticks=c.max_age_ticks,
            grace_ticks=c.grace_ticks,
            ros_type=_text(c.ros_type),
            ros_field=_text(c.ros_field),
            ros_topic=_text(c.ros_topic),
            ros_frame=_text(c.ros_frame),
            ros_child_frame=_text(c.ros_child_frame),
            ros_axes=_text(c.ros_axes),
        )
        for i, c in enumerate(raw)
    )


def _read_fault_places(machine: Any) -> tuple[FaultPlace, ...]:
    raw = [machine.fault_places[i] for i in range(machine.fault_place_count)]
    return tuple(FaultPlace(_text(p.file), p.line, p.column, _text(p.cause)) for p in raw)


def _read_event_sites(machine: Any) -> tuple[EventSite, ...]:
    raw = [machine.event_sites[i] for i in range(machine.event_site_count)]
    return tuple(
        EventSite(
            instance=s.instance,
            file=_text(s.file),
            line=s.line,
            column=s.column,
            text=_text(s.text),
            severity=SEVERITY_NAMES[s.severity],
            types=tuple(TYPE_NAMES[t] for t in s.types[: s.value_count]),
        )
        for s in raw
    )


def _read_ros_messages(machine: Any) -> tuple[RosMessage, ...]:
    raw = [machine.ros_messages[i] for i in range(machine.ros_message_count)]
    return tuple(
        RosMessage(
            topic=_text(m.topic),
            type=_text(m.type),
            type_hash=_text(m.type_hash),
            channels=tuple(m.channels[: m.channel_count]),
            reader=m.reader,
            composer=m.composer,
        )
        for m in raw
    )


def _read_services(machine: Any) -> tuple[Service, ...]:
    raw = [machine.services[i] for i in range(machine.service_count)]
    return tuple(Service(name=_text(s.name), type=SERVICE_TYPES[s.kind], channel=s.channel) for s in raw)


def read_machine(pointer: ctypes._Pointer[CMachine]) -> Machine:
    """The descriptor at `pointer`, whose tables must have been validated (fcsl_run_open does that)."""
    machine = pointer.contents
    instances = _read_instances(machine)
    names = [i.name for i in instances]
    states = tuple(_text(machine.states[i].name) for i in range(machine.state_count))
    requests = tuple(_text(machine.requests[i]) for i in range(machine.request_count))
    fields = _read_fields(machine, names)
    return Machine(
        name=_text(machine.name),
        source_hash=_text(machine.source_hash),
        layout_hash=_text(machine.layout_hash),
        build_hash=_text(machine.build_hash),
        tick_hz=machine.tick_hz,
        size=machine.size,
        fields=fields,
        instances=instances,
        states=states,
        requests=requests,
        transitions=_read_transitions(machine, states, requests, names),
        channels=_read_channels(machine, fields),
        ros_messages=_read_ros_messages(machine),
        services=_read_services(machine),
        fault_places=_read_fault_places(machine),
        event_sites=_read_event_sites(machine),
        views=_text(machine.views),
    )


def why_read_only(field: Field) -> str:
    """The reason why a host may not write a field, and what to do instead."""
    if field.frozen:
        return "frozen: the compiler folded this parameter's value into the code; remove it from `frozen` to set it"
    if field.path in ("machine.state", "machine.next_state"):
        return "read-only; call set_state() to change the state"
    if field.role == "output":
        return f"read-only: instance `{field.instance}` computes it"
    return f"read-only ({field.role})"
