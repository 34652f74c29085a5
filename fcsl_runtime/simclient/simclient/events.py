# SPDX-License-Identifier: Apache-2.0
"""Events that algorithms report (`event("gate passed", self.index)`), as a run has told them."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterable, Mapping
from ctypes import byref
from dataclasses import dataclass, field
from typing import Any

from .c_machine import HEALTH_NAMES, TYPE_FORMATS
from .c_run import EVENT_TEXT_BYTES, CToldEvent
from .descriptor import EventSite, Machine

Scalar = bool | int | float | str


@dataclass(frozen=True)
class Event:
    """One event. `tick` is the tick that it happened in, `time_ns` its time; `file` and `line` are its place in the
    algorithm, as the machine JSON names it. `suppressed` counts those of the same place and instance since the one before,
    which were too many in their second. `str` gives one line."""

    tick: int
    time_ns: int
    instance: str
    severity: str  # "debug", "info", "warning" or "error"
    text: str
    values: tuple[Scalar, ...]  # healths by name
    file: str
    line: int
    suppressed: int = 0
    message: str = field(default="", compare=False)  # text and values

    def __str__(self) -> str:
        return f"{self.instance}: {self.message}"


def read_events(lib: Any, handle: int, machine: Machine) -> list[Event]:
    """Those that a run has kept, in order: `lib` is the runtime, `handle` an fcsl_run_t, `machine` its descriptor."""
    found: list[Event] = []
    raw, number = CToldEvent(), 0
    room = ctypes.create_string_buffer(EVENT_TEXT_BYTES)
    descriptor = lib.fcsl_run_machine(handle)
    while machine.event_sites and (number := lib.fcsl_run_next_event(handle, number, byref(raw))):
        site = machine.event_sites[raw.site]
        lib.fcsl_event_text(descriptor, byref(raw), room)
        found.append(
            Event(
                tick=raw.tick,
                time_ns=machine.time_ns(raw.tick),
                instance=machine.instances[site.instance].name,
                severity=site.severity,
                text=site.text,
                values=_values(site, raw.values),
                file=site.file,
                line=site.line,
                suppressed=raw.suppressed,
                message=room.value.decode(),
            )
        )
    return found


def of_stats(last: Iterable[Mapping[str, Any]], machine: Machine) -> list[Event]:
    """The `last` events of a flight program (`stats` of the variable server)."""
    types = {(machine.instances[s.instance].name, s.line, s.text): s.types for s in machine.event_sites}
    found = []
    for one in last:
        known = types.get((one["instance"], one["line"], one["text"]), ())
        values = tuple(_number(value, type_) for value, type_ in zip(one["values"], known, strict=False))
        found.append(Event(**{**one, "values": values}, time_ns=machine.time_ns(one["tick"])))
    return found


def _number(value: Scalar, type_: str) -> Scalar:
    """With the value of its type: JSON has no NaN, no infinity, and of an f32 the digits."""
    if type_ not in ("f32", "f64"):
        return value
    number = float(value)
    return float(struct.unpack("<f", struct.pack("<f", number))[0]) if type_ == "f32" else number


def pack_values(site: EventSite, values: Any) -> list[int]:
    """The values of an event as fcsl_event_t has them."""
    found = []
    for type_, value in zip(site.types, values, strict=True):
        if type_ in ("f32", "f64"):
            found.append(int.from_bytes(struct.pack(f"<{TYPE_FORMATS[type_]}", value), "little"))
        else:
            found.append((HEALTH_NAMES.index(value) if type_ == "Health" else int(value)) & 2**64 - 1)
    return found


def _values(site: EventSite, bits: Any) -> tuple[Scalar, ...]:
    found: list[Scalar] = []
    for type_, word in zip(site.types, bits, strict=False):
        (value,) = struct.unpack_from(f"<{TYPE_FORMATS[type_]}", int(word).to_bytes(8, "little"))
        found.append(HEALTH_NAMES[value] if type_ == "Health" else bool(value) if type_ == "bool" else value)
    return tuple(found)
