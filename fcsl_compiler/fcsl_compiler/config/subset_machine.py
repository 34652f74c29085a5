# SPDX-License-Identifier: Apache-2.0
"""A subset machine: some instances of a machine and their connections, as a separate machine.

It keeps the name of the whole machine, so that headers, topics and recordings match. Its hashes differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.machine import Channel, Connection, Edge, Machine, PortRef, State, unknown_instance
from ..model.types import leaves
from .arming import subset_arm


def subset_machine(machine: Machine, names: Sequence[str], at: Span, sink: DiagnosticSink) -> Machine | None:
    """The machine with the instances `names` only, in the order of the whole machine. Returns None after reporting an
    error `at` the given span.

    An input whose source is omitted becomes a host input. Its value is zero, or the initial value of its delayed
    connection. States that schedule none of the instances are removed; if the initial state is removed, the first
    remaining state is initial. A transition remains if both its states remain and its guard refers to a remaining
    instance. All requests keep their names and numbers. Without the instance that arms, nothing does: the actuators are
    armed in simulation. There are no views: they may show what is left out.
    """
    if not _is_subset(machine, names, at, sink):
        return None
    kept = [n for n, i in enumerate(machine.instances) if i.name in names]
    new = {-1: -1, **{old: n for n, old in enumerate(kept)}}
    states = [n for n, s in enumerate(machine.states) if any(e.instance in new for e in s.entries)]
    if not states:
        what = ", ".join(f"`{machine.instances[n].name}`" for n in kept)
        sink.error("E242", f"no state schedules {what}", at, help="add an instance that runs")
        return None
    cut = [c for c in machine.connections if c.target.instance in new and not _has_source(machine, c, new)]
    chosen = replace(
        machine,
        initial_state=states.index(machine.initial_state) if machine.initial_state in states else 0,
        instances=tuple(machine.instances[n] for n in kept),
        connections=tuple(_connections(machine, new)),
        states=tuple(_state(machine.states[n], new) for n in states),
        edges=tuple(_edges(machine, states, new)),
        channels=tuple(_channels(machine, new)),
        views="",
        subset=tuple(machine.instances[n].name for n in kept),
        left_out=_left_out(machine, cut),
        arm=subset_arm(machine.arm, new),
    )
    for c in cut:
        chosen = _with_initial(chosen, c, new[c.target.instance])
    used = {name for a in chosen.algorithms for name in a.files}
    return replace(chosen, sources=tuple(s for s in machine.sources if s.name in used))


def _is_subset(machine: Machine, names: Sequence[str], at: Span, sink: DiagnosticSink) -> bool:
    """Checks the names. Returns False after reporting an error."""
    known = [i.name for i in machine.instances]
    if not names:
        sink.error("E242", "a subset of no instances", at, help=f"name some of {', '.join(known)}")
    for name in dict.fromkeys(names):
        if name not in known:
            message, fix = unknown_instance(name, known)
            sink.error("E206", message, at, help=fix)
        elif names.count(name) > 1:
            sink.error("E242", f"a subset with `{name}` twice", at, help="name it once")
    return not sink.failed


def _moved(port: PortRef, new: dict[int, int]) -> PortRef:
    return replace(port, instance=new[port.instance])


def _has_source(machine: Machine, c: Connection, new: dict[int, int]) -> bool:
    """Whether the source of a connection remains. A channel is removed together with the instance it is bound to."""
    if c.source.record == "channels":
        return machine.channel(c.source.field).port.instance in new
    return c.source.instance in new


def _connections(machine: Machine, new: dict[int, int]) -> list[Connection]:
    return [
        replace(c, source=_moved(c.source, new), target=_moved(c.target, new))
        for c in machine.connections
        if c.target.instance in new and _has_source(machine, c, new)
    ]


def _state(state: State, new: dict[int, int]) -> State:
    entries = tuple(replace(e, instance=new[e.instance]) for e in state.entries if e.instance in new)
    return replace(state, entries=entries)


def _edges(machine: Machine, states: list[int], new: dict[int, int]) -> list[Edge]:
    return [
        replace(e, source=states.index(e.source), target=states.index(e.target), guard_instance=new[e.guard_instance])
        for e in machine.edges
        if e.source in states and e.target in states and e.guard_instance in new
    ]


def _channels(machine: Machine, new: dict[int, int]) -> list[Channel]:
    return [replace(c, port=_moved(c.port, new)) for c in machine.channels if c.port.instance in new]


def _left_out(machine: Machine, cut: list[Connection]) -> dict[str, str]:
    found: dict[str, str] = {}
    for c in cut:
        target = machine.instances[c.target.instance].name
        source = f"{machine.instances[c.source.instance].name}.outputs" if c.source.instance >= 0 else c.source.record
        for leaf in leaves(c.target.type):
            path = f"{target}.inputs.{c.target.field}{leaf.path}"
            found[path] = f"{source}.{c.source.path}{leaf.path}"
    return found


def _with_initial(chosen: Machine, c: Connection, index: int) -> Machine:
    """Adds the initial value of a delayed connection to the input that it fed."""
    if not c.delayed:
        return chosen
    instance = chosen.instances[index]
    instance = replace(instance, inputs={**instance.inputs, c.target.field: c.initial})
    return replace(chosen, instances=(*chosen.instances[:index], instance, *chosen.instances[index + 1 :]))
