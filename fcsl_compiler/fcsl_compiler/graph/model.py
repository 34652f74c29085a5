# SPDX-License-Identifier: Apache-2.0
"""Content of a picture without coordinates: boxes with rows, tags, and wires between rows."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from ..model import ir
from ..model.machine import Channel, Connection, Edge, Entry, Instance, Machine, State, seconds
from ..model.types import HEALTH_NAMES


@dataclass
class Row:
    """One line of a box. Inputs are on its left, outputs on its right."""

    left: str = ""
    left_note: str = ""  # type and unit
    right: str = ""
    right_note: str = ""
    tag: str = ""  # a source without a separate box, drawn to the left of the row
    tag_kind: str = ""  # host, machine, channel, initial


@dataclass
class Box:
    """kind: instance, state, always (what every state schedules), any (every other state), channel, transition. The last
    three have one row and no header."""

    name: str
    kind: str
    title: str = ""
    subtitle: str = ""
    rows: list[Row] = field(default_factory=list)
    dim: bool = False  # not scheduled in the drawn state
    calls: str = ""  # external calls of an instance: externs and hardware
    strong: bool = False  # the drawn state
    colour_of: int = -1  # for a transition: the box it leaves, which determines the colour of its wires


@dataclass(frozen=True)
class Wire:
    """A wire from the right end of a row to the left end of a row. Indices into the picture's boxes and into their
    rows."""

    source: int
    source_row: int
    target: int
    target_row: int
    dashed: bool = False


@dataclass
class Picture:
    caption: str
    boxes: list[Box] = field(default_factory=list)
    wires: list[Wire] = field(default_factory=list)


#: What the signs of a picture mean: kinds of boxes and tags, then `wire`, `dashed`, `dim`, `strong`.
_MEANINGS = {
    "instance": "instance: algorithm, rate; inputs left, outputs right",
    "channel": "channel, with its number in messages",
    "host": "input that the host writes",
    "machine": "value of the machine itself",
    "wire": "connection, in the colour of its source",
    "dashed": "connection delayed by a tick",
    "dim": "does not run in this state",
    "state": "state, with the instances that it schedules",
    "always": "instances that every state schedules",
    "transition": "transition: request, health, time; highest priority first",
    "initial": "where the machine begins",
    "strong": "the state of the dataflow",
}


def legend(picture: Picture) -> list[tuple[str, str]]:
    """(sign, meaning) of the signs that a picture has."""
    there = {box.kind for box in picture.boxes} | {row.tag_kind for box in picture.boxes for row in box.rows}
    if "instance" in there:
        there |= {"dashed" if wire.dashed else "wire" for wire in picture.wires}
        there |= {"dim" for box in picture.boxes if box.dim}
    there |= {"strong" for box in picture.boxes if box.strong}
    return [(sign, meaning) for sign, meaning in _MEANINGS.items() if sign in there]


def rate_text(entry: Entry, tick_hz: int) -> str:
    """`50 Hz`, or `every 3000 ticks` if the rate is not a whole number of Hz; with the phase if it is not 0."""
    text = f"every {entry.divisor} ticks" if tick_hz % entry.divisor else f"{tick_hz // entry.divisor} Hz"
    return f"{text}, phase {entry.phase}" if entry.phase else text


def instance_rates(m: Machine, index: int, state: State | None) -> str:
    """Rates in one state, or in all: a single rate if they agree, else one per state."""
    if state is not None:
        entry = next((e for e in state.entries if e.instance == index), None)
        return rate_text(entry, m.tick_hz) if entry else f"not in {state.name}"
    found = [(s.name, rate_text(e, m.tick_hz)) for s in m.states for e in s.entries if e.instance == index]
    if not found:
        return "never runs"
    rates = {rate for _, rate in found}
    if len(rates) == 1:
        only = "" if len(found) == len(m.states) else f" in {', '.join(name for name, _ in found)}"
        return found[0][1] + only
    return "; ".join(f"{rate} in {name}" for name, rate in found)


def drawn_instances(m: Machine, state: State | None) -> list[int]:
    """All instances but those of requirements; or those of one state and the sources of their inputs."""
    if state is None:
        return [n for n in range(len(m.instances)) if n not in m.acting]
    due = {e.instance for e in state.entries} - m.acting.keys()
    read = {c.source.instance for c in m.connections if c.target.instance in due and c.source.instance >= 0}
    return sorted(due | read)


# ---- dataflow ------------------------------------------------------------------------------------------------------


def dataflow(m: Machine, state: State | None = None) -> Picture:
    """Picture of the dataflow: instances with ports, connections, channels, host inputs and machine sources, in all
    states or one."""
    where = f"state {state.name}" if state else "all states" if len(m.states) > 1 else f"state {m.states[0].name}"
    picture = Picture(f"{m.name}: dataflow, {where}, tick_hz {m.tick_hz}")
    instances = drawn_instances(m, state)
    place = {index: n for n, index in enumerate(instances)}
    due = {e.instance for e in state.entries} & set(instances) if state else set(instances)
    connections = [c for c in m.connections if c.target.instance in due]
    inputs: dict[tuple[int, str], int] = {}
    outputs: dict[tuple[int, str], int] = {}
    for index in instances:
        instance = m.instances[index]
        box = Box(instance.name, "instance", instance.name, instance.algorithm.name, dim=index not in due)
        box.subtitle += f" · {instance_rates(m, index, state)}"
        called = dict.fromkeys(_source_name(effect) for effect in instance.algorithm.effects)
        box.calls = f"calls {', '.join(called)}" if called else ""
        picture.boxes.append(box)
        wanted = {c.source.path: c for c in connections if c.source.instance == index}
        _output_rows(m, index, wanted, box, outputs)
        if index in due:
            _input_rows(m, index, instance, connections, box, inputs)
    for c in connections:
        if c.source.instance < 0:
            continue
        at, to = outputs[c.source.instance, c.source.path], inputs[c.target.instance, c.target.field]
        picture.wires.append(Wire(place[c.source.instance], at, place[c.target.instance], to, c.delayed))
    for channel in m.channels:
        key = (channel.port.instance, channel.port.path)
        if channel.direction != "sensor" and key in outputs:
            picture.boxes.append(Box(channel.name, "channel", rows=[Row(left=_channel(channel))]))
            picture.wires.append(Wire(place[key[0]], outputs[key], len(picture.boxes) - 1, 0))
    return picture


def _output_rows(
    m: Machine, index: int, wanted: dict[str, Connection], box: Box, rows: dict[tuple[int, str], int]
) -> None:
    """Declared outputs, separately connected members, and health if it is read."""
    channels = {c.port.path: c for c in m.channels if c.port.instance == index and c.port.record == "outputs"}
    found: dict[str, str] = {}
    for port in m.instances[index].algorithm.ports["outputs"]:
        if port.name in ("transition_request", "health") and port.name not in wanted:
            continue
        found[port.name] = _note(str(port.type), port.unit)
    for path, c in wanted.items():
        found.setdefault(path, _note(str(c.source.type), c.source.unit))
    for path, channel in channels.items():
        found.setdefault(path, _note(str(channel.port.type), channel.port.unit))
    for path, note in found.items():
        rows[index, path] = len(box.rows)
        row = Row(right=path, right_note=note)
        bound = channels.get(path)
        if bound is not None and bound.direction == "sensor":
            row.tag, row.tag_kind = _channel(bound), "channel"
        box.rows.append(row)


def _input_rows(
    m: Machine,
    index: int,
    instance: Instance,
    connections: list[Connection],
    box: Box,
    rows: dict[tuple[int, str], int],
) -> None:
    """Adds inputs to the rows of the outputs. An input with a tag gets a separate row."""
    sources = {c.target.field: c for c in connections if c.target.instance == index}
    channels = {c.port.field: c for c in m.channels if c.port.instance == index and c.port.record == "inputs"}
    free = [n for n, row in enumerate(box.rows) if not row.tag]
    for port in instance.algorithm.ports["inputs"]:
        if free:
            at = free.pop(0)
        else:
            at = len(box.rows)
            box.rows.append(Row())
        rows[index, port.name] = at
        row = box.rows[at]
        row.left, row.left_note = port.name, _note(str(port.type), port.unit)
        connection, channel = sources.get(port.name), channels.get(port.name)
        if channel is not None:
            row.tag, row.tag_kind = _channel(channel), "channel"
        elif connection is None:
            row.tag, row.tag_kind = "host", "host"
        elif connection.source.instance < 0:
            row.tag, row.tag_kind = f"{connection.source.record}.{connection.source.path}", "machine"


def _source_name(effect: ir.Effect) -> str:
    """Name of an effect in the source. The hardware builtins have other names in C."""
    return effect.function.name.removeprefix("fcsl_") if effect.is_hardware else effect.function.name


def _note(type_: str, unit: str) -> str:
    return f"{type_} {unit}".strip()


def _channel(channel: Channel) -> str:
    return f"channel {channel.name} ({channel.id})"


# ---- state machine -------------------------------------------------------------------------------------------------


def transition_text(m: Machine, edge: Edge) -> str:
    """Request, guard and time, followed by the priority if the state has several edges."""
    parts = []
    if edge.request >= 0:
        parts.append(m.requests[edge.request])
    if edge.requirement:
        parts.append(f"requirement {edge.requirement}")
    elif edge.guard_instance >= 0:
        words = [w for n, w in enumerate(HEALTH_NAMES) if edge.guard_mask >> n & 1]
        parts.append(f"{m.instances[edge.guard_instance].name} {' or '.join(words)}")
    text = " when ".join(parts)
    if edge.after_ticks:
        text = f"{text} after {seconds(edge.after_ticks, m.tick_hz)} s".lstrip()
    several = sum(e.source == edge.source for e in m.edges) > 1
    return f"{text} · priority {edge.priority}" if several else text


def merged_edges(m: Machine) -> list[tuple[int, Edge]]:
    """(source, edge) in JSON order. Source -1 denotes every other state: a transition from "*"."""
    groups: dict[object, list[Edge]] = {}
    for edge in sorted(m.edges, key=lambda e: (e.span.line, e.span.column, e.source)):
        groups.setdefault(edge.span, []).append(edge)
    merged: list[tuple[int, Edge]] = []
    for group in groups.values():
        if len(group) > 1 and len(group) == len(m.states) - 1:
            merged.append((-1, max(group, key=lambda e: sum(o.source == e.source for o in m.edges))))
        else:
            merged += [(e.source, e) for e in group]
    return merged


def _state_row(m: Machine, entry: Entry) -> Row:
    """An instance with its rate, or a requirement that acts."""
    effect = m.acting.get(entry.instance)
    if effect is None:
        return Row(left=m.instances[entry.instance].name, left_note=rate_text(entry, m.tick_hz))
    does = {"failed": "fails", "degraded": "degrades"}.get(HEALTH_NAMES[effect.health], "")
    target = f" {does} {m.instances[effect.target].name}" if effect.target >= 0 else ""
    return Row(left="requirement", left_note=effect.requirement + target)


def state_machine(m: Machine, state: State | None = None) -> Picture:
    """Picture of the states with their instances, and of the transitions. `state` is highlighted. What every state
    schedules at the same rate is in a box of its own, behind those of the states."""
    picture = Picture(f"{m.name}: states and transitions")
    alike = set.intersection(*(set(s.entries) for s in m.states)) if len(m.states) > 1 else set[Entry]()

    def rows_of(entries: Iterable[Entry]) -> list[Row]:
        return [_state_row(m, entry) for entry in entries]

    for index, s in enumerate(m.states):
        rows = rows_of(e for e in s.entries if e not in alike)
        box = Box(s.name, "state", s.name, "", rows or [Row()], strong=s is state)
        if index == m.initial_state:
            box.rows[0].tag, box.rows[0].tag_kind = "initial", "initial"
        picture.boxes.append(box)
    everywhere = [e for e in m.states[0].entries if e in alike]
    if everywhere:
        picture.boxes.append(Box("every state", "always", "every state", "", rows_of(everywhere)))
    entered = {m.initial_state: 1}
    merged = merged_edges(m)
    any_state = len(picture.boxes)
    if any(source < 0 for source, _ in merged):
        picture.boxes.append(Box("*", "any", rows=[Row(right="every other state")]))
    for source, edge in merged:
        leaves, label = source if source >= 0 else any_state, len(picture.boxes)
        picture.boxes.append(Box("", "transition", rows=[Row(left=transition_text(m, edge))], colour_of=leaves))
        picture.wires.append(Wire(leaves, 0, label, 0))
        row = entered.get(edge.target, 0)
        entered[edge.target] = row + 1
        target = picture.boxes[edge.target]
        if row == len(target.rows):
            target.rows.append(Row())
        picture.wires.append(Wire(label, 0, edge.target, row))
    return picture
