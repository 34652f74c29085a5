# SPDX-License-Identifier: Apache-2.0
"""A small host: fcsl_machine.h in ctypes. Tests use it to access a compiled machine through its ABI only."""

from __future__ import annotations

import ctypes as c
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.cache import build_machine

NONE, FROM_MACHINE, NO_OFFSET, UINT32_MAX = -1, -2, 0xFFFFFFFF, 0xFFFFFFFF
ROLES = ("machine", "input", "output", "parameter", "state", "counter", "channel")
TYPES = ("bool", "i32", "i64", "u32", "u64", "f32", "f64", "request", "health", "state")
HEALTH = ("nominal", "degraded", "failed", "stale")
_CTYPES = (c.c_bool, c.c_int32, c.c_int64, c.c_uint32, c.c_uint64, c.c_float, c.c_double, *[c.c_int32] * 3)

Clock = c.CFUNCTYPE(c.c_uint64, c.c_void_p)


class Field(c.Structure):
    _fields_ = [
        ("path", c.c_char_p),
        *[(n, c.c_uint8) for n in ("role", "type", "flags", "rank")],
        ("shape", c.POINTER(c.c_uint32)),
        *[(n, c.c_uint32) for n in ("count", "offset", "size")],
        ("instance", c.c_int32),
        ("connected_from", c.c_int32),
        ("unit", c.c_char_p),
        ("doc", c.c_char_p),
        ("minimum", c.c_double),
        ("maximum", c.c_double),
    ]


class Instance(c.Structure):
    _fields_ = [
        *[(n, c.c_char_p) for n in ("name", "algorithm", "source_file")],
        *[(n, c.c_uint32) for n in ("source_line", "first_field", "field_count", "request_offset", "health_offset")],
        *[(n, c.c_uint32) for n in ("faults_offset", "overruns_offset", "fault_place_offset")],
        *[(n, c.c_uint32) for n in ("inject_overrun_offset", "inject_fault_offset", "max_wcet_us")],
        ("published", c.c_uint8),
        *[(n, c.c_char_p) for n in ("message_type", "message_text")],
    ]


class Schedule(c.Structure):
    _fields_ = [("instance", c.c_uint32), ("divisor", c.c_uint64), ("phase", c.c_uint64)]


class State(c.Structure):
    _fields_ = [("name", c.c_char_p), ("schedule", c.POINTER(Schedule)), ("schedule_count", c.c_uint32)]


class Transition(c.Structure):
    _fields_ = [
        *[(n, c.c_int32) for n in ("from_", "to", "request", "priority", "guard_instance")],
        ("guard_mask", c.c_uint32),
    ]


class Channel(c.Structure):
    _fields_ = [
        ("name", c.c_char_p),
        ("id", c.c_uint16),
        ("direction", c.c_uint8),
        *[
            (n, c.c_uint32)
            for n in ("field", "max_age_ticks", "grace_ticks", "attached", "fresh", "valid", "waiting", "age")
        ],
        *[(n, c.c_uint32) for n in ("sample_age", "stamp")],
        *[(f"ros_{n}", c.c_char_p) for n in ("type", "field", "topic", "frame", "child_frame", "axes")],
        ("safe", c.c_void_p),
        ("as_", c.c_uint8),
    ]


class FaultPlace(c.Structure):
    _fields_ = [("file", c.c_char_p), ("line", c.c_uint32), ("column", c.c_uint32), ("cause", c.c_char_p)]


class EventSite(c.Structure):
    _fields_ = [
        ("instance", c.c_uint32),
        ("file", c.c_char_p),
        *[(n, c.c_uint32) for n in ("line", "column")],
        ("text", c.c_char_p),
        *[(n, c.c_uint8) for n in ("severity", "value_count")],
        ("types", c.c_uint8 * 4),
    ]


class Event(c.Structure):
    _fields_ = [("site", c.c_uint32), ("values", c.c_uint64 * 4)]


class Events(c.Structure):
    _fields_ = [
        *[(n, c.c_uint32) for n in ("count", "lost", "first_site", "count_before", "lost_before")],
        ("list", Event * 64),
    ]


class Host(c.Structure):
    _fields_ = [
        ("ctx", c.c_void_p),
        ("clock_ns", Clock),
        ("hw", c.c_void_p),
        ("substitute", c.c_void_p),
        ("executed", c.c_void_p),
        ("measure", c.c_void_p),
        ("events", c.POINTER(Events)),
    ]


_CALLS = {
    "read_gpio": (c.c_uint32, c.POINTER(c.c_bool)),
    "write_gpio": (c.c_uint32, c.c_bool),
    "read_adc": (c.c_uint32, c.POINTER(c.c_uint32)),
    "read_u32": (c.c_uint32, c.POINTER(c.c_uint32)),
    "write_u32": (c.c_uint32, c.c_uint32),
}


class Hardware(c.Structure):
    """A board (fcsl_hw.h) with callbacks in Python."""

    _fields_ = [("ctx", c.c_void_p), *((n, c.CFUNCTYPE(c.c_int32, c.c_void_p, *t)) for n, t in _CALLS.items())]

    @classmethod
    def of(cls, functions: Mapping[str, Callable[..., Any]]) -> Hardware:
        """`functions` by the names of the builtins, without `hw_`. A read returns its value, or None to refuse."""

        def entry(name: str) -> Any:
            def call(_: Any, number: int, other: Any) -> int:
                if not name.startswith("read"):
                    functions[name](number, other)
                    return 0
                value = functions[name](number)
                other[0] = 1 if value is None else value  # the value that a refused read stores is ignored
                return int(value is None)

            return c.CFUNCTYPE(c.c_int32, c.c_void_p, *_CALLS[name])(call)

        return cls(None, *map(entry, _CALLS))


class Fold(c.Structure):
    _fields_ = [("fields", c.POINTER(Field)), ("field_count", c.c_uint32)]


class FoldedInstance(c.Structure):
    _fields_ = [("fold", c.c_uint32), ("offset", c.c_uint32)]


class FoldedFields(c.Structure):
    _fields_ = [
        ("folds", c.POINTER(Fold)),
        ("fold_count", c.c_uint32),
        ("instances", c.POINTER(FoldedInstance)),
        ("others", c.POINTER(Field)),
        ("other_count", c.c_uint32),
        ("connections", c.c_void_p),
        ("connection_count", c.c_uint32),
    ]


class Descriptor(c.Structure):
    _fields_ = [
        ("abi_version", c.c_uint32),
        *[(n, c.c_char_p) for n in ("name", "source_hash", "layout_hash", "build_hash")],
        ("tick_hz", c.c_uint64),
        *[
            (n, c.c_uint32)
            for n in ("size", "align", "current_offset", "tick_offset", "state_offset", "next_state_offset")
        ],
        ("ticks_in_state_offset", c.c_uint32),
        ("fields", c.POINTER(Field)),
        ("field_count", c.c_uint32),
        ("instances", c.POINTER(Instance)),
        ("instance_count", c.c_uint32),
        ("states", c.POINTER(State)),
        ("state_count", c.c_uint32),
        ("requests", c.POINTER(c.c_char_p)),
        ("request_count", c.c_uint32),
        ("transitions", c.POINTER(Transition)),
        ("transition_count", c.c_uint32),
        ("after_ticks", c.POINTER(c.c_uint64)),
        ("channels", c.POINTER(Channel)),
        ("channel_count", c.c_uint32),
        ("ros_messages", c.c_void_p),
        ("ros_message_count", c.c_uint32),
        ("services", c.c_void_p),
        ("service_count", c.c_uint32),
        ("payloads", c.c_void_p),
        ("arm_field", c.c_int32),
        ("command_timeout_ns", c.c_uint64),
        ("fault_places", c.POINTER(FaultPlace)),
        ("fault_place_count", c.c_uint32),
        ("views", c.c_char_p),
        ("stack_bytes", c.c_uint32),
        ("init", c.CFUNCTYPE(None, c.c_void_p)),
        ("start", c.CFUNCTYPE(c.c_int32, c.c_void_p)),
        ("step", c.CFUNCTYPE(None, c.c_void_p, c.POINTER(Host))),
        ("force_state", c.CFUNCTYPE(None, c.c_void_p, c.c_int32)),
        ("measured", c.c_uint8),
        ("event_sites", c.POINTER(EventSite)),
        ("event_site_count", c.c_uint32),
        ("folded", c.POINTER(FoldedFields)),
    ]


def _fields(d: Descriptor) -> dict[str, Field]:
    """The fields by path; those that are folded without connections."""
    if d.fields:
        return {d.fields[i].path.decode(): d.fields[i] for i in range(d.field_count)}
    folded, found = d.folded.contents, {}
    for index in range(d.instance_count):
        one = folded.instances[index]
        fold = folded.folds[one.fold]
        for i in range(fold.field_count):
            field = Field.from_buffer_copy(fold.fields[i])
            field.offset, field.instance = field.offset + one.offset, index
            found[(d.instances[index].name + field.path).decode()] = field
    return found | {folded.others[i].path.decode(): folded.others[i] for i in range(folded.other_count)}


def _values(site: EventSite, bits: list[int]) -> tuple[Any, ...]:
    """NaNs as text, so that they compare."""
    found: list[Any] = []
    for type_, value in zip(site.types[: site.value_count], bits, strict=False):
        held = _CTYPES[type_].from_buffer_copy(value.to_bytes(8, "little")).value
        found.append(HEALTH[held] if TYPES[type_] == "health" else "nan" if held != held else held)
    return tuple(found)


def classes(text: str) -> list[str]:
    """The names of the algorithms in a file."""
    return re.findall(r"^class (\w+)", text, re.MULTILINE)


def write_machine(folder: Path, name: str, config: Mapping[str, Any], algorithms: Mapping[str, str]) -> Path:
    """Writes <name>.json and <stem>.py files. A config without `algorithms` gets an entry for each class of the
    files."""
    folder.mkdir(parents=True, exist_ok=True)
    for stem, text in algorithms.items():
        path = folder / f"{stem}.py"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    listed = {one: {"source": f"{stem}.py"} for stem, text in algorithms.items() for one in classes(text)}
    path = folder / f"{name}.json"
    path.write_text(json.dumps({"algorithms": listed, **config}, indent=1))
    return path


def write_one_each(folder: Path, files: Mapping[str, str], algorithms: Mapping[str, Any], **more: Any) -> Path:
    """Writes a machine with one instance per algorithm, named after it in lower case. All run in every tick."""
    names = {name: name.lower() for name in algorithms}
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": algorithms,
        "instances": {instance: {"algorithm": name} for name, instance in names.items()},
        "states": {"A": {"schedule": {instance: 10 for instance in names.values()}}},
        **more,
    }
    return write_machine(folder, "several", config, {name.removesuffix(".py"): text for name, text in files.items()})


class Machine:
    """One initialised machine. `get` and `set` take paths of the field table."""

    def __init__(self, library: Path, name: str, *, init: bool = True):
        self.dll = c.CDLL(str(library))
        table = (c.POINTER(Descriptor) * 64).in_dll(self.dll, "fcsl_machines")
        found = []
        for pointer in table:
            if not pointer:
                break
            found.append(pointer.contents)
        self.names = [d.name.decode() for d in found]
        self.d = next(d for d in found if d.name.decode() == name)
        # Aligned manually: ctypes aligns to 8 only if a member requires it.
        self._memory = c.create_string_buffer(self.d.size + self.d.align)
        start = c.addressof(self._memory)
        self.base = start + (-start) % self.d.align
        self.fields = _fields(self.d)
        self.instances = {self.d.instances[i].name.decode(): self.d.instances[i] for i in range(self.d.instance_count)}
        self.states = [self.d.states[i].name.decode() for i in range(self.d.state_count)]
        self.channels = {self.d.channels[i].name.decode(): self.d.channels[i] for i in range(self.d.channel_count)}
        self.init_result = self.initialise() if init else None
        self._events = Events()
        self._host = Host(events=c.pointer(self._events))

    def initialise(self) -> int:
        self.d.init(self.base)
        return int(self.d.start(self.base))

    @classmethod
    def build(cls, config: Path, *, init: bool = True) -> Machine:
        built = build_machine(config)
        return cls(built.library, built.name, init=init)

    def use_clock(self, now_ns: Callable[[], int]) -> None:
        self._host.clock_ns = Clock(lambda _: now_ns())

    def use_hardware(self, functions: Mapping[str, Callable[..., Any]]) -> None:
        """Sets the board functions by the names of the builtins without `hw_`."""
        self._hardware = Hardware.of(functions)
        self._host.hw = c.addressof(self._hardware)

    def step(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self._events.count = self._events.lost = 0
            self.d.step(self.base, c.byref(self._host))

    def force_state(self, name: str) -> None:
        self.d.force_state(self.base, self.states.index(name))

    def raw(self, path: str) -> Any:
        """The ctypes array of a field."""
        f = self.fields[path]
        return (_CTYPES[f.type] * f.count).from_address(self.base + f.offset)

    def get(self, path: str) -> Any:
        f, values = self.fields[path], list(self.raw(path))
        if TYPES[f.type] == "state":
            values = [self.states[v] for v in values]
        elif TYPES[f.type] == "health":
            values = [HEALTH[v] for v in values]
        elif TYPES[f.type] == "request":
            values = [self.d.requests[v - 1].decode() if v else "" for v in values]
        return values if f.rank else values[0]

    def set(self, path: str, value: Any) -> None:
        target = self.raw(path)
        for i, v in enumerate(value if isinstance(value, list | tuple) else [value]):
            target[i] = v

    def byte(self, offset: int) -> Any:
        """One byte of the struct, accessible as [0]."""
        assert offset != NO_OFFSET
        return (c.c_uint8 * 1).from_address(self.base + offset)

    def sample(self, channel: str, age_ticks: int = 0, stamp_ns: int = 0) -> None:
        """Marks a sensor's field as written for the coming tick."""
        ch = self.channels[channel]
        c.c_uint32.from_address(self.base + ch.sample_age).value = age_ticks
        c.c_int64.from_address(self.base + ch.stamp).value = stamp_ns
        self.byte(ch.fresh)[0] = 1

    def fault_places(self) -> list[tuple[str, int, int, str]]:
        """File, line, column and cause of all places where this machine may fault."""
        rows = (self.d.fault_places[i] for i in range(self.d.fault_place_count))
        return [(row.file.decode(), row.line, row.column, row.cause.decode()) for row in rows]

    def fault(self, instance: str) -> tuple[str, int, int, str] | None:
        """The last fault of an instance."""
        number = self.get(f"{instance}.counters.fault_place")
        return self.fault_places()[number - 1] if number else None

    def event_sites(self) -> list[EventSite]:
        return [self.d.event_sites[i] for i in range(self.d.event_site_count)]

    def event_rows(self) -> list[tuple[int, str, int, int]]:
        """Instance, file, line and column of each site, in the form that the reference takes."""
        return [(s.instance, s.file.decode(), s.line, s.column) for s in self.event_sites()]

    def events(self) -> tuple[int, list[tuple[int, list[int]]]]:
        """Of the last tick: how many found no room, and site and values of the others."""
        rows = self._events.list[: self._events.count]
        return self._events.lost, [(row.site, list(row.values)) for row in rows]

    def told(self) -> tuple[int, list[tuple[str, int, str, tuple[Any, ...]]]]:
        """The same as values: instance, line, text, values."""
        lost, rows = self.events()
        names, sites = list(self.instances), self.event_sites()
        return lost, [
            (names[sites[n].instance], sites[n].line, sites[n].text.decode(), _values(sites[n], v)) for n, v in rows
        ]

    def layout(self) -> dict[str, int]:
        """Offsets of all fields and of the bytes without a field, in the form that the reference takes."""
        offsets = {path: f.offset for path, f in self.fields.items()} | {"machine.current": self.d.current_offset}
        for name, i in self.instances.items():
            offsets[f"{name}.inject_fault"] = i.inject_fault_offset
            if i.max_wcet_us:
                offsets[f"{name}.inject_overrun"] = i.inject_overrun_offset
        for name, channel in self.channels.items():
            if channel.direction == 0:
                offsets |= {f"channels.{name}.attached": channel.attached, f"channels.{name}.fresh": channel.fresh}
                offsets[f"channels.{name}.sample_age"] = channel.sample_age
        return offsets

    def save(self) -> bytes:
        return c.string_at(self.base, self.d.size)

    def restore(self, data: bytes) -> None:
        c.memmove(self.base, data, self.d.size)

    @property
    def state(self) -> str:
        return str(self.get("machine.state"))
