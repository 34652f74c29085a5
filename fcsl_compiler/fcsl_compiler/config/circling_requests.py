# SPDX-License-Identifier: Apache-2.0
"""`--strict`: warning about a request that leads the machine round a circle of states for as long as an input lasts: W214.

Such a request has transitions there and back, and its instance runs in all these states without a memory of its last run.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping

from ..base.diagnostics import DiagnosticSink
from ..base.source import Span
from ..check.dependencies import Sources, Variable, dependencies
from ..model.machine import Connection, Edge, Machine

#: Values of `machine` and of channels that stay while nothing happens.
_STEADY = ("dt", "period", "valid")


def warn_circling_requests(machine: Machine, sink: DiagnosticSink) -> None:
    levels = _Levels(machine)
    reported: set[tuple[int, frozenset[int]]] = set()
    for index, instance in enumerate(machine.instances):
        made = [n for n, name in enumerate(machine.requests) if name in machine.requests_of(instance)]
        if not made or not instance.algorithm.complete or not levels.is_level(index, "transition_request"):
            continue
        for request in made:
            edges = _answers(machine, index, request)
            for edge in edges:
                circle = _circle(edge, edges)
                key = request, frozenset(e.source for e in circle)
                if circle and key not in reported and not _is_deliberate(circle):
                    reported.add(key)
                    _warn(machine, index, circle, sink)


class _Levels:
    """Tells which outputs stay the same while the inputs of the machine do."""

    def __init__(self, machine: Machine):
        self.machine = machine
        self.feeds: dict[tuple[int, str], Connection] = {
            (c.target.instance, c.target.field): c for c in machine.connections
        }
        self.known: dict[int, Mapping[Variable, Sources]] = {}
        self.open: set[tuple[int, str]] = set()  # outputs in question; one that is met again feeds itself

    def is_level(self, instance: int, output: str) -> bool:
        if instance not in self.known:
            self.known[instance] = dependencies(self.machine.instances[instance].execute)
        if (instance, output) in self.open:
            return False
        self.open.add((instance, output))
        sources = self.known[instance].get(("outputs", output), frozenset())
        found = all(self._stays(instance, variable) for variable in sources)
        self.open.remove((instance, output))
        return found

    def _stays(self, instance: int, variable: Variable) -> bool:
        record, name = variable
        if record != "inputs":
            return record == "parameters"
        feed = self.feeds.get((instance, name))
        if feed is None:
            return True
        source = feed.source
        if source.instance < 0:
            return (source.members or (source.field,))[-1] in _STEADY
        return source.field != "health" and self.is_level(source.instance, source.field)


def _answers(machine: Machine, instance: int, request: int) -> list[Edge]:
    """The edges by which this request of the instance is answered. One without guard and time hides those of smaller
    priority."""
    found: list[Edge] = []
    for number, state in enumerate(machine.states):
        if any(entry.instance == instance for entry in state.entries):
            for edge in (e for e in machine.edges if (e.source, e.request) == (number, request)):
                found.append(edge)
                if not edge.is_guarded and not edge.after_ticks:
                    break
    return found


def _circle(first: Edge, edges: list[Edge]) -> list[Edge]:
    """The shortest way by these edges that begins with the first one and ends in its source; empty if there is none."""
    queue, came = deque([[first]]), {first.target}
    while queue:
        way = queue.popleft()
        for edge in (e for e in edges if e.source == way[-1].target):
            if edge.target == first.source:
                return [*way, edge]
            if edge.target not in came:
                came.add(edge.target)
                queue.append([*way, edge])
    return []


def _is_deliberate(circle: list[Edge]) -> bool:
    """Whether times slow down each step, or guards hold at most for a part of the way."""
    masks: dict[int, int] = {}
    for edge in (e for e in circle if e.guard_instance >= 0):
        masks[edge.guard_instance] = masks.get(edge.guard_instance, edge.guard_mask) & edge.guard_mask
    return all(edge.after_ticks > 1 for edge in circle) or 0 in masks.values()


def _warn(machine: Machine, index: int, circle: list[Edge], sink: DiagnosticSink) -> None:
    instance, name = machine.instances[index], machine.requests[circle[0].request]
    states = " → ".join(machine.states[number].name for number in [circle[0].source, *(e.target for e in circle)])
    spans = {e.span.key: e.span for e in circle}
    notes: list[tuple[Span, str]] = [(span, "and this one leads on") for span in list(spans.values())[1:]]
    notes += [(span, "requested here") for named, span in instance.algorithm.requests if named == name][:1]
    sink.warning(
        "W214",
        f"while `{instance.name}` requests `{name}`, the state changes in each of its runs: {states}",
        circle[0].span,
        why=f"`{instance.name}` runs in all these states and remembers no run, so it requests this for as long as its inputs last",
        help="request it only when the input changes: keep the last value in `state`; or use one request for each direction",
        notes=notes,
    )
