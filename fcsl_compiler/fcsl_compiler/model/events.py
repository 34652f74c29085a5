# SPDX-License-Identifier: Apache-2.0
"""Events: what an algorithm reports with `event(text, *values, severity="info")`, and the table of their sites that a
machine has: one row for each place in the source and each instance that it belongs to (fcsl_event_site_t)."""

from __future__ import annotations

import re
from dataclasses import dataclass

from . import ir
from .machine import Machine
from .types import REQUEST, Scalar, Type

EVENT = "event"
EVENT_DOC = (
    'event(text, *values, severity="info"): reports what happened, with up to four scalars, once this run of `execute` '
    'completes; severity: "debug", "info", "warning" or "error".'
)
#: fcsl_severity_t by number.
SEVERITIES = ("debug", "info", "warning", "error")
#: FCSL_EVENT_VALUES of fcsl_machine.h.
MOST_VALUES = 4
#: Header of the functions that generated code calls.
EVENT_HEADER = "fcsl/fcsl_event.h"
#: Characters of the text of an event, or of an assertion.
MOST_TEXT = 80
_TEXT = re.compile(rf"[ -~]{{1,{MOST_TEXT}}}")


def is_text(value: object) -> bool:
    """Whether a literal may be the text of an event, or of an assertion: printable ASCII."""
    return isinstance(value, str) and _TEXT.fullmatch(value) is not None


def is_event_value(type_: Type) -> bool:
    """Whether an event can have a value of this type."""
    return isinstance(type_, Scalar) and type_ is not REQUEST


@dataclass(frozen=True, order=True)
class EventSite:
    """`types`: of the values, as fcsl_machine.h names them."""

    file: str
    line: int
    column: int
    text: str
    severity: int
    types: tuple[str, ...]


def site_of(event: ir.Event) -> EventSite:
    at = event.span
    types = tuple(arg.type.abi for arg in event.args if isinstance(arg.type, Scalar))
    return EventSite(at.source.name, at.line, at.column, event.text, event.severity, types)


def sites_of(execute: ir.Function) -> tuple[EventSite, ...]:
    """Those of one `execute`, in the order of the source. Generated code numbers them from 0."""
    return tuple(sorted({site_of(s) for s in ir.walk(execute.body) if isinstance(s, ir.Event)}))


def first_sites(machine: Machine) -> list[int]:
    """For each instance the row of its first site. Its others follow."""
    firsts, count = [], 0
    for instance in machine.instances:
        firsts.append(count)
        count += len(sites_of(instance.execute))
    return firsts
