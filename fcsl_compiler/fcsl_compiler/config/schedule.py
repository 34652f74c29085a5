# SPDX-License-Identifier: Apache-2.0
"""Orders the instances of every state by dataflow. Reports cycles and unreachable states."""

from __future__ import annotations

import heapq
from collections import deque
from dataclasses import replace

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..model.machine import Connection, Machine, State, seconds
from ..parse.json_reader import local_names
from .arming import warn_old_arm
from .channels import assigned_outputs
from .dead_transitions import warn_dead_transitions
from .stale_guards import warn_stale_guards


def schedule(machine: Machine, sink: DiagnosticSink) -> Machine:
    """The same machine with each state's entries in execution order (ties in JSON order). Reports cycles."""
    states = []
    reported: set[tuple[int, ...]] = set()
    for state in machine.states:
        order = _order(machine, state)
        if order is None:
            cycle = _shortest_cycle(machine, state)
            key = tuple(sorted(c.target.instance for c in cycle))
            if key not in reported:
                reported.add(key)
                _report(machine, state, cycle, sink)
            states.append(state)
        else:
            by_instance = {e.instance: e for e in state.entries}
            states.append(replace(state, entries=tuple(by_instance[i] for i in order)))
    warn_dead_transitions(machine, sink)
    warn_stale_guards(machine, sink)
    _warn_unreachable(machine, sink)
    _warn_too_late(machine, sink)
    _warn_idle(machine, sink)
    _warn_old_values(machine, sink)
    _warn_slow_dt(machine, sink)
    warn_old_arm(machine, sink)
    return replace(machine, states=tuple(states))


def _edges(machine: Machine, state: State) -> list[Connection]:
    """Connections that order two instances of this state."""
    due = {e.instance for e in state.entries}
    return [c for c in machine.connections if not c.delayed and c.source.instance in due and c.target.instance in due]


def _order(machine: Machine, state: State) -> list[int] | None:
    due = sorted(e.instance for e in state.entries)
    before: dict[int, set[int]] = {i: set() for i in due}
    after: dict[int, set[int]] = {i: set() for i in due}
    for c in _edges(machine, state):
        before[c.target.instance].add(c.source.instance)
        after[c.source.instance].add(c.target.instance)
    ready = [i for i in due if not before[i]]
    heapq.heapify(ready)
    order: list[int] = []
    while ready:
        instance = heapq.heappop(ready)
        order.append(instance)
        for other in after[instance]:
            before[other].discard(instance)
            if not before[other]:
                heapq.heappush(ready, other)
    return order if len(order) == len(due) else None


def _shortest_cycle(machine: Machine, state: State) -> list[Connection]:
    """The shortest cycle, by breadth-first search from every instance."""
    leaving: dict[int, list[Connection]] = {}
    for c in _edges(machine, state):
        leaving.setdefault(c.source.instance, []).append(c)
    best: list[Connection] = []
    for start in sorted(leaving):
        came: dict[int, Connection] = {}
        queue = deque([start])
        while queue:
            at = queue.popleft()
            for c in leaving.get(at, []):
                if c.target.instance == start:
                    path, node = [c], at
                    while node != start:
                        path.append(came[node])
                        node = came[node].source.instance
                    if not best or len(path) < len(best):
                        best = path[::-1]
                    queue.clear()
                    break
                if c.target.instance not in came:
                    came[c.target.instance] = c
                    queue.append(c.target.instance)
    return best


def _report(machine: Machine, state: State, cycle: list[Connection], sink: DiagnosticSink) -> None:
    names = [machine.instances[c.source.instance].name for c in cycle]
    cut = cycle[-1]
    notes = []
    for c in cycle:
        source, target = machine.instances[c.source.instance].name, machine.instances[c.target.instance].name
        notes.append((c.source.span, f"{source}.{c.source.path} → {target}.{c.target.path}"))
        notes.append((c.target.span, f"which `{target}` reads" + (", the connection to delay" if c is cut else "")))
    sink.error(
        "E228",
        f"dataflow cycle in state `{state.name}`: {' → '.join([*names, names[0]])}",
        cut.span,
        why="each would need the other's output of the same tick",
        help='mark this connection `"delayed": true, "initial": …`: it then carries the value of the previous tick',
        notes=notes,
    )


def _warn_unreachable(machine: Machine, sink: DiagnosticSink) -> None:
    reached, queue = {machine.initial_state}, [machine.initial_state]
    while queue:
        at = queue.pop()
        for edge in machine.edges:
            if edge.source == at and edge.target not in reached:
                reached.add(edge.target)
                queue.append(edge.target)
    for index, state in enumerate(machine.states):
        if index not in reached:
            sink.warning(
                "W203", f"no transition reaches state `{state.name}`", state.span, help="only a host can set it"
            )


def _warn_too_late(machine: Machine, sink: DiagnosticSink) -> None:
    """Warns about an edge that never occurs because an earlier timed edge of its state always precedes it."""
    for index, state in enumerate(machine.states):
        leaving = [e for e in machine.edges if e.source == index]
        sure = [e for e in leaving if e.after_ticks and e.request < 0 and not e.is_guarded]
        if not sure:
            continue
        last = min(sure, key=lambda e: (e.after_ticks, -e.priority))
        for edge in leaving:
            # An edge can be taken at the end of the first tick at the earliest.
            if (max(edge.after_ticks, 1), -edge.priority) > (last.after_ticks, -last.priority):
                after = seconds(last.after_ticks, machine.tick_hz)
                sink.warning(
                    "W211",
                    f"from state `{state.name}` this transition is never taken",
                    edge.span,
                    why=f"another transition always leaves that state after {after} s",
                    help="give it a shorter time, or the same time and the larger priority",
                    notes=[(last.span, "the other one")],
                )


def _warn_idle(machine: Machine, sink: DiagnosticSink) -> None:
    due = {machine.instances[e.instance].name for state in machine.states for e in state.entries}
    arms = machine.instances[machine.arm.instance].name if machine.arm is not None else ""
    parts: set[str] = set()  # that are reported
    for instance in machine.instances:
        if instance.name in due:
            continue
        part, at = _idle_part(instance.span, due)
        if part in parts:
            continue
        parts |= {part} - {""}
        never = part or instance.name
        what = (
            f"part `{at.local(part)}`: none of its instances runs"
            if part
            else f"instance `{at.local(never)}`: it never runs"
        )
        why = "the actuators are never armed" if f"{arms}.".startswith(f"{never}.") else ""
        fix = f'add `"{at.local(part)}": true` to the schedule' if part else "add it to the schedule"
        always = " or to `always`," if part and not at.source.part else ""
        sink.warning("W204", f"no state schedules {what}", at, why=why, help=f"{fix} of a state,{always} or remove it")


def _idle_part(at: Span, due: set[str]) -> tuple[str, Span]:
    """The outermost part around an instance of which nothing runs, with its place. "" and that of the instance if there is
    none."""
    idle = ""
    while at.source.included is not None and not any(name.startswith(f"{at.source.part}.") for name in due):
        idle, at = at.source.part, at.source.included
    return idle, at


def _warn_old_values(machine: Machine, sink: DiagnosticSink) -> None:
    """Warns about a state that runs a reader but not its source. The reader then gets a value that another state
    left."""
    reads_health = {(c.source.instance, c.target.instance) for c in machine.connections if c.source.field == "health"}
    entries = [{e.instance: e for e in state.entries} for state in machine.states]
    running = set().union(*entries)
    for c in machine.connections:
        source, target = c.source.instance, c.target.instance
        if source not in running or (source, target) in reads_health:
            continue
        writer, reader = machine.instances[source], machine.instances[target]
        if c.source.field not in dict(assigned_outputs(writer.algorithm)):
            continue  # the writer is not scheduled by states
        for state, here in zip(machine.states, entries, strict=True):
            if target in here and source not in here:
                reads_health.add((source, target))
                at = here[target].span if not here[target].span.source.part else state.span
                (scheduled,) = local_names([writer.name], at)
                sink.warning(
                    "W206",
                    f"in state `{state.name}`, `{reader.name}` reads `{writer.name}`, which does not run there",
                    at,
                    why="the outputs keep old values",
                    help=f"schedule `{scheduled}` here, or connect `{writer.name}.health`: it is then stale",
                    notes=[(c.span, "it reads this")],
                )
                break


def _warn_slow_dt(machine: Machine, sink: DiagnosticSink) -> None:
    """Warns about `machine.dt` (period of the tick) as input of an instance with a slower rate."""
    for c in machine.connections:
        if c.source.instance >= 0 or c.source.field != "dt":
            continue
        slow = [e for s in machine.states for e in s.entries if e.instance == c.target.instance and e.divisor > 1]
        if slow:
            name, tick = machine.instances[c.target.instance].name, 1.0 / machine.tick_hz
            sink.warning(
                "W207",
                f"`machine.dt` is one tick, {tick:g} s, but `{name}` runs every {slow[0].divisor} ticks",
                c.source.span,
                help="connect `machine.period`, the period of the receiver",
                notes=[(slow[0].span, "its rate")],
            )
