# SPDX-License-Identifier: Apache-2.0
"""The events of a recorded machine (fcsl_msgs/Event)."""

from __future__ import annotations

from dataclasses import dataclass

from .bag import Bag, RecordedMachine

_FIELDS = ("header", "tick", "severity", "instance", "text", "values", "file", "line", "suppressed")
#: By the constants of the message.
_SEVERITIES = {10: "debug", 20: "info", 30: "warning", 40: "error"}


@dataclass(frozen=True)
class RecordedEvent:
    """`stamp_ns`: of its tick. `values` are texts."""

    tick: int
    stamp_ns: int
    severity: str
    instance: str
    text: str
    values: tuple[str, ...]
    file: str
    line: int
    suppressed: int

    def __str__(self) -> str:
        more = f" ({self.suppressed} before it suppressed)" if self.suppressed else ""
        return f"{self.instance}: {' '.join((self.text, *self.values))}{more}"


def events(bag: Bag, machine: RecordedMachine) -> list[RecordedEvent]:
    """In their order; none of a machine that reports none. Raises BagError."""
    found: list[RecordedEvent] = []
    for _, _, data in bag.messages({machine.events}) if machine.events in bag.topics else ():
        m = bag.decode_own(machine.events, data, _FIELDS)
        stamp_ns = m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec
        severity = _SEVERITIES.get(m.severity, "error")
        values = tuple(map(str, m.values))
        found.append(
            RecordedEvent(m.tick, stamp_ns, severity, m.instance, m.text, values, m.file, m.line, m.suppressed)
        )
    return found
