# SPDX-License-Identifier: Apache-2.0
"""Warnings about dead transitions, which cannot occur in the states they leave: W202, W209, W210."""

from __future__ import annotations

from collections.abc import Sequence

from ..base.diagnostics import DiagnosticSink
from ..model.machine import Edge, Machine
from ..model.types import HEALTH_NAMES

_STALE = 1 << HEALTH_NAMES.index("stale")


def warn_dead_transitions(machine: Machine, sink: DiagnosticSink) -> None:
    """Checks all transitions. A transition from several states has one edge for each. If one of these edges can occur,
    there is no warning."""
    transitions: dict[tuple[str, int, int], list[Edge]] = {}
    for edge in machine.edges:
        transitions.setdefault(edge.span.key, []).append(edge)
    for edges in transitions.values():
        if edges[0].request >= 0:
            _warn_request(machine, edges, sink)
        if edges[0].guard_instance >= 0:
            _warn_guard(machine, edges, sink)


def _warn_request(machine: Machine, edges: Sequence[Edge], sink: DiagnosticSink) -> None:
    name, span = machine.requests[edges[0].request], edges[0].span
    if name not in machine.named_requests:
        sink.warning("W202", f"no algorithm requests `{name}`", span, help="only a host can take this edge")
        return
    makers = [i for i, instance in enumerate(machine.instances) if name in machine.requests_of(instance)]
    if not makers or _schedules(machine, edges, makers) or not _ever(machine, makers):
        return  # W204 reports instances that never run
    listed = " or ".join(f"`{machine.instances[i].name}`" for i in makers)
    message = f"`{name}` is requested only by {listed}, which {_unscheduled(machine, edges)}"
    fix = "schedule it there, or leave this transition to a host"
    sink.warning("W210", message, span, why="an instance that does not run makes no request", help=fix)


def _warn_guard(machine: Machine, edges: Sequence[Edge], sink: DiagnosticSink) -> None:
    guard, span = edges[0].guard_instance, edges[0].span
    if _schedules(machine, edges, [guard]) or not _ever(machine, [guard]):
        return
    name = machine.instances[guard].name
    holds = "always" if edges[0].guard_mask & _STALE else "never"
    message = f"this guard is {holds} true: {_unscheduled(machine, edges)} `{name}`"
    why = "an instance that the state does not schedule is stale"
    fix = f"schedule `{name}` there, or guard an instance that runs there"
    sink.warning("W209", message, span, why=why, help=fix)


def _schedules(machine: Machine, edges: Sequence[Edge], instances: Sequence[int]) -> bool:
    return any(e.instance in instances for edge in edges for e in machine.states[edge.source].entries)


def _ever(machine: Machine, instances: Sequence[int]) -> bool:
    return any(e.instance in instances for state in machine.states for e in state.entries)


def _unscheduled(machine: Machine, edges: Sequence[Edge]) -> str:
    names = [f"`{machine.states[edge.source].name}`" for edge in edges]
    return f"state {names[0]} does not schedule" if len(names) == 1 else f"none of {', '.join(names)} schedules"
