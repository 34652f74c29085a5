# SPDX-License-Identifier: Apache-2.0
"""A machine with the monitor of its requirements: both on terms, and both in CPython."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..driver.passes import Compilation
from ..model.types import BOOL, I32
from ..requirements.requirement import Requirement
from .flight import Externs, Flight
from .operations import Operations
from .properties import Property
from .terms import Value
from .tick import Fields, Inputs, MachineTerms, Tick


@dataclass(frozen=True)
class Moment:
    """The end of a tick, or the beginning: fields of machine and monitor."""

    tick: Tick
    monitor: Fields


#: What a host gives to one tick, known.
Given = tuple[Mapping[str, bool], Mapping[str, Sequence[Any]]]


class Watched:
    """A compiled machine, until the pass `lower`, and its monitor. Raises StartFaulted."""

    def __init__(self, compiled: Compilation, externs: Externs | None = None):
        assert compiled.lowered is not None
        self.machine, self.requirements = compiled.checked, list(compiled.requirements)
        self.flight = Flight(compiled.checked, compiled.lowered, externs)
        self.monitor_flight: Flight | None = None
        self.observed: tuple[tuple[str, str], ...] = ()
        if compiled.monitor is not None:
            code = compiled.monitor_code
            assert code is not None and code.lowered is not None
            self.observed = compiled.monitor.observed
            self.monitor_flight = Flight(code.checked, code.lowered)

    def begin(self) -> None:
        self.flight.begin()
        if self.monitor_flight is not None:
            self.monitor_flight.begin()

    def tick(self, given: Given) -> None:
        """One tick in CPython."""
        self.flight.tick(*given)
        if self.monitor_flight is not None:
            values = {to: (self._known(path),) for path, to in self.observed}
            self.monitor_flight.tick({}, values)

    def save(self) -> tuple[bytes, bytes]:
        monitor = self.monitor_flight
        return bytes(self.flight.memory), b"" if monitor is None else bytes(monitor.memory)

    def restore(self, saved: tuple[bytes, bytes]) -> None:
        self.flight.memory[:] = saved[0]
        if self.monitor_flight is not None:
            self.monitor_flight.memory[:] = saved[1]

    def _known(self, path: str) -> Any:
        row, at = element(self.flight.rows, path)
        return self.flight.read(row)[at]

    def is_violated(self, property_: Property) -> bool:
        """By the tick that was made last, in CPython."""
        if property_.kind == "requirement":
            assert self.monitor_flight is not None
            return bool(self.monitor_flight.read(f"{property_.instance}.state.violated")[0])
        if property_.kind == "state":
            names = [state.name for state in self.machine.states]
            return names[self.flight.read("machine.state")[0]] == property_.id
        return self.flight.fault_of(property_.instance) == str(property_.span)

    def is_assumption_violated(self) -> bool:
        """By the tick that was made last, in CPython."""
        monitor = self.monitor_flight
        return monitor is not None and any(monitor.read(f"{r.instance}.state.violated")[0] for r in self.assumptions)

    @property
    def assumptions(self) -> list[Requirement]:
        return [r for r in self.requirements if r.assumed and r.kind != "at_end"]

    def violated_requirements(self) -> list[str]:
        """Ids of those that the flight in CPython violated, ever."""
        found: list[str] = []
        for r in self.requirements:
            if r.kind != "at_end" and self.monitor_flight is not None:
                if self.monitor_flight.read(f"{r.instance}.outputs.violations")[0]:
                    found.append(r.id)
        return found


class WatchedTerms:
    """The same on terms."""

    def __init__(self, watched: Watched, operations: Operations):
        self.w, self.t = watched, operations.t
        self.machine = MachineTerms(watched.machine, operations)
        monitor = watched.monitor_flight
        self.monitor = None if monitor is None else MachineTerms(monitor.m, operations)

    def beginning(self) -> Moment:
        """Where a flight stands in CPython."""
        monitor = self.w.monitor_flight
        return Moment(Tick(self.w.flight.fields()), {} if monitor is None else monitor.fields())

    def any_moment(self, known: Moment) -> tuple[Moment, list[Value]]:
        """Any state of both, and what always holds of it."""
        fields, legal = self.machine.any_fields(known.tick.fields)
        monitor: Fields = {}
        if self.monitor is not None:
            monitor, more = self.monitor.any_fields(known.monitor)
            monitor["machine.tick"] = fields["machine.tick"]
            legal += more
        return Moment(Tick(fields), monitor), list(legal)

    def step(self, before: Moment, inputs: Inputs) -> Moment:
        tick = self.machine.step(before.tick.fields, inputs)
        if self.monitor is None:
            return Moment(tick, {})
        values = {to: (self._read(tick.fields, path),) for path, to in self.w.observed}
        return Moment(tick, self.monitor.step(before.monitor, Inputs({}, values)).fields)

    def _read(self, fields: Fields, path: str) -> Value:
        row, at = element(self.machine.rows, path)
        return fields[row][at]

    def violated(self, property_: Property, moment: Moment) -> Value:
        """That a tick violates a property."""
        if property_.kind == "requirement":
            return moment.monitor[f"{property_.instance}.state.violated"][0]
        fields = moment.tick.fields
        if property_.kind == "state":
            number = [state.name for state in self.w.machine.states].index(property_.id)
            return self.t.equal(fields["machine.state"][0], number, I32)
        index = [i.name for i in self.w.machine.instances].index(property_.instance)
        if index in self.machine.opaque:  # it may do anything
            return self.t.fresh(BOOL, "assertion")
        faults = [f.condition for f in moment.tick.faults if f.instance == index and f.span == property_.span]
        return self.t.any_of(faults)

    def assumed(self, moment: Moment) -> Value:
        """That no assumption about the environment is violated."""
        violated = (moment.monitor[f"{r.instance}.state.violated"][0] for r in self.w.assumptions)
        return self.t.all_of(self.t.negation(v) for v in violated)


def element(rows: Mapping[str, Any], path: str) -> tuple[str, int]:
    """The row of one number, and its place in it: `nav.state.p[1, 2]`."""
    row, at = path, len(path)
    while row not in rows:
        at = path.rindex("[", 0, at)
        row = path[:at]
    index = [int(n) for n in path[len(row) :].replace("][", ",").strip("[]").split(",") if n]
    offset = 0
    for extent, i in zip(rows[row].shape, index, strict=True):
        offset = offset * extent + i
    return row, offset
