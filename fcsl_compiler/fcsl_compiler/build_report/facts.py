# SPDX-License-Identifier: Apache-2.0
"""The facts of `fcslc build --report`, as JSON of a stable schema (`"version": 1`; keys are only ever added). See
docs/authoring.md for what each of them means; bytes, ticks and instructions are what the keys say."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import Any

from ..machine import Connection, Entry, Machine, State
from .levelling import levelled, load_per_tick
from .machine_code import MachineCode
from .objects import Address
from .operations import KINDS, operations
from .paths import Unbounded
from .schedule_facts import MOST_TICKS, Latency, Slot, latency_of, major_cycle, slots

Facts = dict[str, Any]


def machine_facts(machine: Machine, stack_bytes: int | None, code: MachineCode | None, why_no_code: str = "") -> Facts:
    """Everything; what needs machine code is null where `code` is None, and `why_no_code` says why."""
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
        "code_bytes": None,
        "own_instructions": None,
        "instructions": None,
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
            facts |= {"own_instructions": bound.own, "instructions": bound.whole}
    return facts


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
        """Of a tick at which everything is due."""
        total: Counter[str] = Counter()
        for e in self.state.entries:
            total += operations(self.machine.instances[e.instance].execute, self.machine.program)
        return _counts(total)

    def _connection(self, c: Connection) -> Facts:
        found = latency_of(self.machine, self.state, c)
        return {
            "from": self._end(c.source.instance, c.source.record, c.source.path),
            "to": self._end(c.target.instance, c.target.record, c.target.path),
            "delayed": c.delayed,
            "latency_ticks": _ticks(found),
        }

    def _end(self, instance: int, record: str, path: str) -> str:
        return f"{self.machine.instances[instance].name}.{record}.{path}" if instance >= 0 else f"machine.{path}"

    # ---- load ----------------------------------------------------------------------------------------------------

    def _slots(self) -> Facts:
        """One row for all ticks of the cycle at which the same instances are due."""
        if self.slots is None:
            why = f"the major cycle has more than {MOST_TICKS} ticks"
            unknown = dict.fromkeys(("slots", "own_instructions", "instructions", "code_bytes"))
            return {**unknown, "why_no_slots": why, "why_no_bound": why}
        rows: list[Facts] = []
        why = ""
        code_bytes: dict[Address, int] = {}
        for slot in self.slots:
            bound = None
            try:
                bound = self.code.step(self.state, slot) if self.code else None
            except Unbounded as error:
                why = str(error)
            code_bytes |= bound.code if bound else {}
            rows.append(
                {
                    "ticks": slot.ticks,
                    "first": slot.first,
                    "due": [self.instances[n]["name"] for n in slot.due],
                    "load": self._load(slot),
                    "own_instructions": bound.own if bound else None,
                    "instructions": bound.whole if bound else None,
                }
            )
        whole = self.code is not None and not why
        return {
            "slots": rows,
            "why_no_slots": "",
            "own_instructions": max(r["own_instructions"] for r in rows) if whole else None,
            "instructions": max(r["instructions"] for r in rows) if whole else None,
            "code_bytes": sum(code_bytes.values()) if whole else None,
            "why_no_bound": why,
        }

    def _load(self, slot: Slot) -> int | None:
        due = [self.instances[n]["instructions"] for n in slot.due]
        return None if None in due else sum(due)

    def _levelling(self) -> Facts | None:
        """Other phases with a lower peak of the load, and what they do to the latencies. None: nothing to gain."""
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
