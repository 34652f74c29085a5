# SPDX-License-Identifier: Apache-2.0
"""States and schedules of the machine JSON."""

from __future__ import annotations

from ..base.diagnostics import nearest
from ..base.source import Span
from ..model.machine import Entry, State
from ..parse.json_reader import ConfigReader, local_names
from ..parse.json_source import JsonNode

#: Maximum number of ticks of a period or of a time in a state.
MAX_TICKS = 1 << 40


def read_states(
    node: JsonNode | None,
    always: JsonNode | None,
    tick_hz: int,
    instances: list[str],
    incomplete: set[str],
    reader: ConfigReader,
) -> list[State]:
    """All states with their entries, including those of `always`, in JSON order."""
    everywhere = reader.named(always, "`always`", instances=True)
    shared = _entries(everywhere, tick_hz, instances, incomplete, reader)
    required = () if everywhere or (always is not None and always.kind != "object") else ("schedule",)
    states: list[State] = []
    for name, (definition, span) in reader.named(node, "`states`").items():
        optional = ("description",) if required else ("schedule", "description")
        keys = reader.object(definition, f"state `{name}`", required, optional) or {}
        reader.string(keys.get("description"), "`description`")
        listed = reader.named(keys.get("schedule"), f"the schedule of `{name}`", instances=True)
        for instance in (n for n in listed if n in everywhere):
            reader.scheduled_twice(instance, name, listed[instance][1], everywhere[instance][1])
        own = {n: rate for n, rate in listed.items() if n not in everywhere}
        entries = [*shared, *_entries(own, tick_hz, instances, incomplete, reader)]
        states.append(State(name, tuple(sorted(entries, key=lambda e: e.instance)), span))
    if node is not None and node.kind == "object" and not states:
        fix = 'a machine without mode changes has one: "states": {"RUN": {"schedule": {…}}}'
        reader.sink.error("E219", "a machine has at least one state", node.span, help=fix)
    return states


def _entries(
    listed: dict[str, tuple[JsonNode, Span]],
    tick_hz: int,
    instances: list[str],
    incomplete: set[str],
    reader: ConfigReader,
) -> list[Entry]:
    """The valid entries of a schedule. Errors in the others are reported."""
    entries: list[Entry] = []
    for instance, (rate, at) in listed.items():
        if instance not in instances and instance not in incomplete:
            name, known = at.local(instance), local_names(instances, at)
            hint = nearest(name, known) or f"the instances are {', '.join(known) or 'none'}"
            reader.sink.error("E206", f"no instance `{name}`", at, help=hint)
            continue
        timing = _rate(rate, tick_hz, reader) if tick_hz else None
        if timing is not None and instance not in incomplete:
            entries.append(Entry(instances.index(instance), timing[0], timing[1], at))
    return entries


def _rate(node: JsonNode, tick_hz: int, reader: ConfigReader) -> tuple[int, int] | None:
    """(divisor, phase) of `100`, `{"hz": 100, "phase": 3}` or `{"every": 2000}`. Rates are in Hz, phases in ticks."""
    phase_node: JsonNode | None = None
    if node.kind == "object":
        timed = "every" if node.get("every") is not None else "hz"
        keys = reader.object(node, "a rate", (timed,), ("phase",))
        if keys is None or timed not in keys:
            return None
        phase_node = keys.get("phase")
        if timed == "every":
            divisor = reader.integer(keys["every"], "`every` (ticks)", 1, MAX_TICKS)
        else:
            divisor = _divisor(keys["hz"], tick_hz, reader)
    else:
        divisor = _divisor(node, tick_hz, reader)
    if divisor is None:
        return None
    phase = 0
    if phase_node is not None:
        given = reader.integer(phase_node, "`phase` (ticks)", 0, divisor - 1)
        if given is None:
            return None
        phase = given
    return divisor, phase


def _divisor(node: JsonNode, tick_hz: int, reader: ConfigReader) -> int | None:
    hz = reader.integer(node, "a rate (Hz)", 1, tick_hz, "Hz")
    if hz is None:
        return None
    if tick_hz % hz:
        near = [r for r in (max(d for d in range(1, hz + 1) if tick_hz % d == 0),) if r]
        above = next((d for d in range(hz, tick_hz + 1) if tick_hz % d == 0), tick_hz)
        fix = f"the nearest rates that do are {near[0]} and {above} Hz"
        whose = "the machine's tick_hz" if node.span.source.part else "tick_hz"
        reader.sink.error("E220", f"{hz} Hz does not divide {whose} ({tick_hz})", node.span, help=fix)
        return None
    return tick_hz // hz
