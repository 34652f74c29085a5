# SPDX-License-Identifier: Apache-2.0
"""The machine ABI in Python: a ctypes mirror of fcsl/fcsl_machine.h, and the descriptor as plain Python values.

This is the only place that knows the C layout; a test compares it with the compiler's own idea of the header.
"""

from __future__ import annotations

import ctypes
import math
from ctypes import POINTER, Structure, c_char_p, c_double, c_int32, c_uint8, c_uint16, c_uint32, c_uint64, c_void_p
from dataclasses import dataclass
from typing import Any

ABI_VERSION = 4
NO_OFFSET = 0xFFFFFFFF

#: fcsl_type_t by number, with the struct format of one scalar in native byte order.
TYPE_NAMES = ("bool", "i32", "i64", "u32", "u64", "f32", "f64", "TransitionRequest", "Health", "state")
TYPE_FORMATS = {
    "bool": "B",
    "i32": "i",
    "i64": "q",
    "u32": "I",
    "u64": "Q",
    "f32": "f",
    "f64": "d",
    "TransitionRequest": "i",
    "Health": "i",
    "state": "i",
}
#: fcsl_health_t by number.
HEALTH_NAMES = ("nominal", "degraded", "failed", "stale")
#: fcsl_role_t by number.
ROLE_NAMES = ("machine", "input", "output", "parameter", "state", "counter", "channel")
DIRECTION_NAMES = ("sensor", "actuator")

_WRITABLE, _FROZEN, _IMPURE = 1, 2, 4


class CField(Structure):
    _fields_ = [
        ("path", c_char_p),
        ("role", c_uint8),
        ("type", c_uint8),
        ("flags", c_uint8),
        ("rank", c_uint8),
        ("shape", POINTER(c_uint32)),
        ("count", c_uint32),
        ("offset", c_uint32),
        ("size", c_uint32),
        ("instance", c_int32),
        ("connected_from", c_int32),
        ("unit", c_char_p),
        ("doc", c_char_p),
        ("minimum", c_double),
        ("maximum", c_double),
    ]


class CInstance(Structure):
    _fields_ = [
        ("name", c_char_p),
        ("algorithm", c_char_p),
        ("source_file", c_char_p),
        ("source_line", c_uint32),
        ("first_field", c_uint32),
        ("field_count", c_uint32),
        ("request_offset", c_uint32),
        ("health_offset", c_uint32),
        ("faults_offset", c_uint32),
        ("overruns_offset", c_uint32),
        ("inject_overrun_offset", c_uint32),
        ("inject_fault_offset", c_uint32),
        ("max_wcet_us", c_uint32),
        ("published", c_uint8),
        ("message_type", c_char_p),
        ("message_text", c_char_p),
    ]


class CSchedule(Structure):
    _fields_ = [("instance", c_uint32), ("divisor", c_uint64), ("phase", c_uint64)]


class CState(Structure):
    _fields_ = [("name", c_char_p), ("schedule", POINTER(CSchedule)), ("schedule_count", c_uint32)]


class CTransition(Structure):
    _fields_ = [
        ("from_", c_int32),
        ("to", c_int32),
        ("request", c_int32),
        ("priority", c_int32),
        ("guard_instance", c_int32),
        ("guard_mask", c_uint32),
    ]


class CChannel(Structure):
    _fields_ = [
        ("name", c_char_p),
        ("id", c_uint16),
        ("direction", c_uint8),
        ("field", c_uint32),
        ("max_age_ticks", c_uint32),
        ("attached_offset", c_uint32),
        ("fresh_offset", c_uint32),
        ("valid_offset", c_uint32),
        ("age_offset", c_uint32),
        ("sample_age_offset", c_uint32),
        ("stamp_offset", c_uint32),
        ("ros_type", c_char_p),
        ("ros_field", c_char_p),
        ("ros_topic", c_char_p),
        ("ros_frame", c_char_p),
        ("ros_child_frame", c_char_p),
        ("ros_axes", c_char_p),
    ]


class CMachine(Structure):
    _fields_ = [
        ("abi_version", c_uint32),
        ("name", c_char_p),
        ("source_hash", c_char_p),
        ("layout_hash", c_char_p),
        ("build_hash", c_char_p),
        ("tick_hz", c_uint64),
        ("size", c_uint32),
        ("align", c_uint32),
        ("current_offset", c_uint32),
        ("tick_offset", c_uint32),
        ("state_offset", c_uint32),
        ("next_state_offset", c_uint32),
        ("fields", POINTER(CField)),
        ("field_count", c_uint32),
        ("instances", POINTER(CInstance)),
        ("instance_count", c_uint32),
        ("states", POINTER(CState)),
        ("state_count", c_uint32),
        ("requests", POINTER(c_char_p)),
        ("request_count", c_uint32),
        ("transitions", POINTER(CTransition)),
        ("transition_count", c_uint32),
        ("channels", POINTER(CChannel)),
        ("channel_count", c_uint32),
        ("init", c_void_p),
        ("step", c_void_p),
        ("force_state", c_void_p),
    ]


@dataclass(frozen=True)
class Field:
    """One leaf of the machine struct, as `describe` shows it.

    A host may set what lies in [`minimum`, `maximum`]; -inf and inf where nothing bounds it. Only parameters have bounds.
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
        """The type as a user writes it: `f64[3]`."""
        return self.type + (f"[{','.join(map(str, self.shape))}]" if self.shape else "")

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

    `source_file` and `source_line` are where the algorithm is defined, `max_wcet_us` its time limit in microseconds (0:
    none), the offsets those of its outputs in the machine struct in bytes; the message is what it is recorded as, and,
    where it is `published`, what a ROS 2 topic carries.
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


@dataclass(frozen=True)
class Channel:
    """A sensor or actuator of the machine.

    `id` is its number in frames, `direction` "sensor" or "actuator", `field` what it carries. A sensor whose last sample
    is older than `max_age_ticks` is no longer valid (2**32 - 1: never). The ROS names say which part of a message it is
    (fcsl_machine.h); all are empty when it is none.
    """

    index: int
    name: str
    id: int
    direction: str
    field: Field
    max_age_ticks: int
    ros_type: str
    ros_field: str
    ros_topic: str
    ros_frame: str
    ros_child_frame: str
    ros_axes: str


@dataclass(frozen=True)
class Transition:
    """A change of state.

    From `source` to `target`, when an instance makes `request` (empty: none is needed) and `guard_instance` (empty: no
    guard) has one of the healths in `guard_health`. Of several that may fire, the one of the highest
    `priority` does.
    """

    source: str
    target: str
    request: str
    priority: int
    guard_instance: str
    guard_health: tuple[str, ...]


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

    @property
    def host_inputs(self) -> tuple[str, ...]:
        """Inputs that nothing feeds but a host: no connection and no channel."""
        bound = {c.field.path for c in self.channels}
        return tuple(f.path for f in self.fields.values() if f.role == "input" and f.writable and f.path not in bound)

    def time_ns(self, tick: int) -> int:
        """Time of tick `tick`: floor(tick * 1e9 / tick_hz)."""
        return tick * 1_000_000_000 // self.tick_hz


def _text(value: bytes | None) -> str:
    return value.decode("utf-8", "replace") if value else ""


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
            connected_from=paths[f.connected_from] if f.connected_from >= 0 else "",
            unit=_text(f.unit),
            doc=_text(f.doc),
            writable=bool(f.flags & _WRITABLE),
            frozen=bool(f.flags & _FROZEN),
            impure=bool(f.flags & _IMPURE),
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
        )
        for t in raw
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
            ros_type=_text(c.ros_type),
            ros_field=_text(c.ros_field),
            ros_topic=_text(c.ros_topic),
            ros_frame=_text(c.ros_frame),
            ros_child_frame=_text(c.ros_child_frame),
            ros_axes=_text(c.ros_axes),
        )
        for i, c in enumerate(raw)
    )


def read_machine(pointer: ctypes._Pointer[CMachine]) -> Machine:
    """The descriptor behind `pointer`; its tables must have been checked (fcsl_run_open does)."""
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
    )
