# SPDX-License-Identifier: Apache-2.0
"""Warning about guards with `stale` that hold because a state has just been entered: W213.

An instance that a state starts is stale until it first runs there. How many ticks that takes depends on the tick in which
the state is entered: from none up to its period less one.
"""

from __future__ import annotations

from fractions import Fraction

from ..base.diagnostics import DiagnosticSink
from ..model.machine import Edge, Entry, Machine, nearest_seconds
from ..model.types import HEALTH_NAMES

_STALE = 1 << HEALTH_NAMES.index("stale")


def warn_stale_guards(machine: Machine, sink: DiagnosticSink) -> None:
    """Warns once about each transition, in the state where the instance is slowest."""
    found: dict[tuple[str, int, int], tuple[Edge, Entry]] = {}
    for instance in sorted({e.guard_instance for e in machine.edges if e.guard_mask & _STALE}):
        entries = [next((e for e in state.entries if e.instance == instance), None) for state in machine.states]
        entered = _entered_stale(machine, instance, entries)
        for edge in machine.edges:
            entry = entries[edge.source]
            guards = edge.guard_instance == instance and edge.guard_mask & _STALE
            if guards and entry is not None and _leaves_before_first_run(machine, edge, entry, entered):
                key = edge.span.key
                if key not in found or found[key][1].divisor < entry.divisor:
                    found[key] = edge, entry
    for edge, entry in found.values():
        _warn(machine, edge, entry, sink)


def _entered_stale(machine: Machine, instance: int, entries: list[Entry | None]) -> set[int]:
    """The states that a transition can enter while the instance is stale. `entries`: of the instance, for each state."""
    entered: set[int] = set()
    before = -1
    while before < len(entered):
        before = len(entered)
        for edge in machine.edges:
            entry = entries[edge.source]
            needs_a_run = edge.guard_instance == instance and not edge.guard_mask & _STALE
            if not needs_a_run and (entry is None or _leaves_before_first_run(machine, edge, entry, entered)):
                entered.add(edge.target)
    return entered


def _leaves_before_first_run(machine: Machine, edge: Edge, entry: Entry, entered: set[int]) -> bool:
    """Whether an edge can be taken while this instance of its state is stale."""
    from_start = entry.phase if edge.source == machine.initial_state else 0
    stale_ticks = entry.divisor - 1 if edge.source in entered else from_start
    return stale_ticks >= max(edge.after_ticks, 1)


def _warn(machine: Machine, edge: Edge, entry: Entry, sink: DiagnosticSink) -> None:
    name, state = machine.instances[entry.instance].name, machine.states[edge.source].name
    # A multiple of a tick that has finitely many digits, and is not less than the period.
    period_s = nearest_seconds(Fraction(entry.divisor - 1), machine.tick_hz)[-1]
    sink.warning(
        "W213",
        f"this guard may be true before `{name}` has run in state `{state}`",
        edge.span,
        why=f"`{name}` is stale there until its first run, which is in one of the first {entry.divisor} ticks",
        help=f'wait for at least one period of `{name}`: `"after_s": {period_s}`',
        notes=[(entry.span, "its rate")],
    )
