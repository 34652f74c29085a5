# SPDX-License-Identifier: Apache-2.0
"""Verdicts on the requirements of a machine (docs/guide/requirements.md), as a run has them after the ticks so far."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from .c_machine import CMonitor
from .c_run import VERDICT_TEXT_BYTES, CVerdict
from .descriptor import Machine, read_machine
from .values import read_part

#: fcsl_required_t
REQUIRED = ("then", "never", "at_end")


class Status(StrEnum):
    """In the order of fcsl_verdict_status_t. A requirement whose `when` never held is not exercised: it is not met."""

    MET = "met"
    VIOLATED = "violated"
    NOT_EXERCISED = "not exercised"


_VIOLATED, _NOT_EXERCISED = map(list(Status).index, (Status.VIOLATED, Status.NOT_EXERCISED))


@dataclass(frozen=True)
class Verdict:
    """On one requirement. Counts are of ticks: `evaluated`; of these `exercised` (`when` held) and `undefined` (`when`
    compared a NaN); `faults`, where an integer of it overflowed. `violations` counts how often one began; the first tick of
    all and the last one have the values that the requirement reads, by path. None without a violation."""

    id: str
    text: str
    kind: str  # of REQUIRED
    source: str  # its condition
    assumed: bool  # about the environment
    status: Status
    holds: bool  # at the last evaluation
    evaluated: int
    exercised: int
    undefined: int
    faults: int
    violations: int
    violated_ticks: int
    first_tick: int | None
    last_tick: int | None
    first: dict[str, Any] = field(default_factory=dict)
    last: dict[str, Any] = field(default_factory=dict)
    line: str = ""  # what a run prints at its end

    def __str__(self) -> str:
        return self.line


def read_verdicts(lib: Any, handle: int) -> list[Verdict]:
    """The verdicts of a run: `lib` is the runtime, `handle` an fcsl_run_t. [] without requirements."""
    table = lib.fcsl_run_monitor(handle)
    if not table:
        return []
    monitor, base = table.contents, lib.fcsl_run_monitor_data(handle)
    return [_verdict(lib, handle, monitor, base, index) for index in range(monitor.requirement_count)]


def of_stats(stats: Mapping[str, Mapping[str, Any]]) -> list[Verdict]:
    """The verdicts that a flight program counts (`stats` of the variable server), without the values of a violation."""
    found = []
    for id_, counts in stats.items():
        ticks = {"first_tick": None, "last_tick": None}
        found.append(Verdict(id_, **{**ticks, **counts, "status": Status(counts["status"])}))
    return found


def read_violations(lib: Any, handle: int) -> list[float]:
    """How often each requirement was violated; NaN: not exercised. A hundred times faster than all of the verdicts."""
    table, raw, found = lib.fcsl_run_monitor(handle), CVerdict(), []
    for index in range(table.contents.requirement_count) if table else ():
        lib.fcsl_run_verdict(handle, lib.fcsl_run_monitor_data(handle), index, ctypes.byref(raw))
        violated = float(max(raw.violations, raw.status == _VIOLATED))
        found.append(math.nan if raw.status == _NOT_EXERCISED else violated)
    return found


#: The state of a requirement that only counts.
_COUNTING = ("last_tick", "started", "violated")


def remembering(monitor: CMonitor) -> frozenset[str]:
    """Ids of the requirements whose verdict in a tick depends on other ticks."""
    machine = read_machine(monitor.machine)
    found = set()
    for required in monitor.requirements[: monitor.requirement_count]:
        state = f"{machine.instances[required.instance].name}.state."
        kept = {path.removeprefix(state) for path in machine.fields if path.startswith(state)}
        if not kept <= set(_COUNTING):
            found.add(required.id.decode())
    return frozenset(found)


def _verdict(lib: Any, handle: int, monitor: CMonitor, base: int, index: int) -> Verdict:
    raw, text = CVerdict(), ctypes.create_string_buffer(VERDICT_TEXT_BYTES)
    lib.fcsl_run_verdict(handle, base, index, ctypes.byref(raw))
    lib.fcsl_run_verdict_text(handle, ctypes.byref(raw), text)
    required = raw.requirement.contents
    begun = raw.violations > 0
    first, last = _violating(lib, handle, monitor, base, required.instance) if begun else ({}, {})
    return Verdict(
        id=required.id.decode(),
        text=required.text.decode(),
        kind=REQUIRED[required.kind],
        source=required.source.decode(),
        assumed=bool(required.assumed),
        status=list(Status)[raw.status],
        holds=bool(raw.holds),
        **{name: getattr(raw, name) for name in ("evaluated", "exercised", "undefined", "faults", "violations")},
        violated_ticks=raw.violated_ticks,
        first_tick=raw.first_tick if begun else None,
        last_tick=raw.last_tick if begun else None,
        first=first,
        last=last,
        line=text.value.decode("utf-8", "replace"),
    )


def _violating(
    lib: Any, handle: int, monitor: CMonitor, base: int, instance: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a requirement read in the first and in the last tick that violated it, by path."""
    machine, watched = read_machine(monitor.machine), read_machine(lib.fcsl_run_machine(handle))
    name, found = machine.instances[instance].name, (dict[str, Any](), dict[str, Any]())
    for observed in monitor.observed[: monitor.observed_count]:
        path, (owner, _, target) = observed.path.decode(), observed.input.decode().rpartition(".inputs.")
        for values, which in zip(found, ("first", "last"), strict=True):
            result = f"{name}.outputs.{which}_{target}"
            if owner == name and result in machine.fields:
                value, names = _read(machine, result, base), _names(path, watched)
                values[path] = names[value] if names else value
    return found


def _read(machine: Machine, path: str, base: int) -> Any:
    from .paths import resolve

    return read_part(resolve(path, machine), lambda offset, size: ctypes.string_at(base + offset, size), machine)


def _names(path: str, watched: Machine) -> Sequence[str]:
    """The names of an enumeration, which the monitor has as numbers."""
    from .values import enumerators

    field_ = watched.fields.get(path)
    return enumerators(field_.type, watched) if field_ is not None else ()


def summary(verdicts: list[Verdict]) -> list[str]:
    """The lines at the end of a run: each requirement that was not met, and how many were."""
    if not verdicts:
        return []
    lines = [f"requirement {verdict}" for verdict in verdicts if verdict.status is not Status.MET]
    met = sum(verdict.status is Status.MET for verdict in verdicts)
    return [*lines, f"requirements: {met} of {len(verdicts)} met"]
