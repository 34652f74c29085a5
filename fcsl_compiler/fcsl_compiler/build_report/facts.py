# SPDX-License-Identifier: Apache-2.0
"""The facts of `fcsl build --report`, as JSON of a stable schema (`"version": 1`; keys are only ever added). See
docs/guide/authoring.md for what each of them means; bytes, ticks and instructions are what the keys say."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

from ..check.fault_points import rollback_bytes
from ..emit.operations import KINDS, operations
from ..model.machine import Connection, Entry, Machine, PortRef, State
from .instruction_counts import COUNTS
from .instruction_table import shown_name
from .levelling import levelled, load_per_tick
from .machine_code import Cost, MachineCode
from .paths import Unbounded
from .schedule_facts import MOST_SLOTS, Latency, Slot, latency_of, major_cycle, slots

Facts = dict[str, Any]


def machine_facts(machine: Machine, stack_bytes: int | None, code: MachineCode | None, why_no_code: str = "") -> Facts:
    """All facts of a machine. If `code` is None, facts that need machine code are null and `why_no_code` gives the
    reason."""
    facts: Facts = {
        "machine": machine.name,
        "tick_hz": machine.tick_hz,
        "stack_bytes": stack_bytes,
        "struct_bytes": code.layout.machine if code else None,
        "code_bytes": code.code_bytes if code else None,
        "constant_bytes": code.constant_bytes if code else None,
        "descriptor_bytes": code.descriptor_bytes if code else None,
        "why_no_code": why_no_code,
    }
    instances = [_instance(machine, n, code) for n in range(len(machine.instances))]
    return {
        **facts,
        "math": _math(instances),
        "instances": instances,
        "states": [_State(machine, s, instances, code).facts() for s in machine.states],
    }


def _instance(machine: Machine, n: int, code: MachineCode | None) -> Facts:
    instance = machine.instances[n]
    facts: Facts = {
        "name": instance.name,
        "algorithm": instance.algorithm.name,
        "operations": _counts(operations(instance.execute, machine.program)),
        "record_bytes": code.layout.instances[n] if code else None,
        "rollback_bytes": rollback_bytes(instance.execute, instance.algorithm.ports),
        "code_bytes": None,
        **_instructions(None),
        "math": [],
        "apart": [],
        "why_no_bound": "",
    }
    if code is not None:
        try:
            bound = code.execute(n)
        except Unbounded as error:
            facts["why_no_bound"] = str(error)
        else:
            facts |= {"code_bytes": sum(bound.code.values()), "apart": sorted(bound.apart)}
            facts |= {**_instructions(bound), "math": sorted(map(shown_name, bound.math & COUNTS.keys()))}
    return facts


def _instructions(bound: Cost | None) -> Facts:
    if bound is None:
        return dict.fromkeys(("own_instructions", "instructions", "usual_instructions"))
    return {"own_instructions": bound.own, "instructions": bound.whole, "usual_instructions": bound.usual}


def _math(instances: list[Facts]) -> list[Facts]:
    """Functions that are called and counted from the table."""
    called = {name for i in instances for name in i["math"]}
    return [
        {"function": shown_name(symbol), "most": e.most, "usual": e.usual, "estimate": e.is_estimate}
        for symbol, e in COUNTS.items()
        if shown_name(symbol) in called
    ]


def _counts(found: Counter[str]) -> Facts:
    functions = {name: n for name, n in sorted(found.items()) if name not in KINDS and n}
    return {**{kind: found[kind] for kind in KINDS}, "functions": functions}


class _State:
    """Facts of one state."""

    def __init__(self, machine: Machine, state: State, instances: list[Facts], code: MachineCode | None):
        self.machine, self.state, self.code = machine, state, code
        self.instances = [instances[e.instance] for e in state.entries]
        self.slots = slots(state.entries)

    def facts(self) -> Facts:
        m, state = self.machine, self.state
        in_state = {e.instance for e in state.entries}
        found = self._slots()
        return {
            "name": state.name,
            "major_cycle_ticks": major_cycle(state.entries),
            "order": [self._entry(e) for e in state.entries],
            "operations": self._operations(),
            "connections": [self._connection(c) for c in m.connections if c.target.instance in in_state],
            **found,
            "levelling": self._levelling(),
        }

    def _entry(self, e: Entry) -> Facts:
        return {"instance": self.machine.instances[e.instance].name, "divisor": e.divisor, "phase": e.phase}

    def _operations(self) -> Facts:
        """Operations of a tick at which all instances are due."""
        total: Counter[str] = Counter()
        for e in self.state.entries:
            total += operations(self.machine.instances[e.instance].execute, self.machine.program)
        return _counts(total)

    def _connection(self, c: Connection) -> Facts:
        found = latency_of(self.machine, self.state, c)
        return {
            "from": self._end(c.source),
            "to": self._end(c.target),
            "delayed": c.delayed,
            "latency_ticks": _ticks(found),
        }

    def _end(self, port: PortRef) -> str:
        """A connection's end in the notation of the machine JSON."""
        owner = self.machine.instances[port.instance].name if port.instance >= 0 else port.record
        return f"{owner}.{port.path}"

    # ---- load ----------------------------------------------------------------------------------------------------

    def _slots(self) -> Facts:
        """One row for each set of ticks of the cycle at which the same instances are due."""
        bounds: list[Cost] = []
        why = ""
        rows: list[Facts] = []
        for slot in self.slots if self.slots is not None else [None]:
            bound = None
            try:
                bound = self.code.step(self.state, slot) if self.code else None
            except Unbounded as error:
                why = str(error)
            bounds += [bound] if bound else []
            if slot is not None:
                due = [self.instances[n]["name"] for n in slot.due]
                row = {"ticks": slot.ticks, "first": slot.first, "due": due, "load": self._load(slot)}
                rows.append(row | _instructions(bound))
        whole = self.code is not None and not why
        code = {a: n for bound in bounds for a, n in bound.code.items()}
        return {
            "slots": rows if self.slots is not None else None,
            "why_no_slots": ""
            if self.slots is not None
            else f"more than {MOST_SLOTS} sets of instances are due together",
            **{key: max(_instructions(b)[key] for b in bounds) if whole else None for key in _instructions(None)},
            "code_bytes": sum(code.values()) if whole else None,
            "why_no_bound": why,
        }

    def _load(self, slot: Slot) -> int | None:
        due = [self.instances[n]["instructions"] for n in slot.due]
        return None if None in due else sum(due)

    def _levelling(self) -> Facts | None:
        """Phases with a lower peak load, and their effect on latencies. None if there is no improvement."""
        costs = [i["instructions"] for i in self.instances]
        if None in costs or self.slots is None:
            return None
        entries = self.state.entries
        better = levelled(entries, costs)
        if better is None:
            return None
        after = replace(self.state, entries=better)
        in_state = {e.instance for e in entries}
        changes = []
        for c in self.machine.connections:
            if c.target.instance not in in_state:
                continue
            old, new = latency_of(self.machine, self.state, c), latency_of(self.machine, after, c)
            if old != new:
                ends = self._connection(c)
                changes.append({"from": ends["from"], "to": ends["to"], "before": _ticks(old), "after": _ticks(new)})
        moved = [(old, new) for old, new in zip(entries, better, strict=True) if old.phase != new.phase]
        return {
            "peak_before": max(load_per_tick(entries, costs)),
            "peak_after": max(load_per_tick(better, costs)),
            "phases": {self.machine.instances[new.instance].name: new.phase for _, new in moved},
            "latency_ticks": changes,
        }


def _ticks(found: Latency | None) -> list[int] | None:
    return [found.least, found.most] if found is not None else None
