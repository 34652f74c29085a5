# SPDX-License-Identifier: Apache-2.0
"""Verdicts on the requirements of a machine (docs/guide/requirements.md), as a run has them after the ticks so far."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from enum import StrEnum
from functools import cached_property
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
    forgot_before: int | None = None  # tick of a restore that brought no memory of it: it began anew
    line: str = ""  # what a run prints at its end

    def __str__(self) -> str:
        return self.line


def read_verdicts(lib: Any, handle: int) -> list[Verdict]:
    """The verdicts of a run: `lib` is the runtime, `handle` an fcsl_run_t. [] without requirements."""
    reader = _Reader(lib, handle)
    return [reader.verdict(index) for index in range(reader.count)]


def of_stats(stats: Mapping[str, Mapping[str, Any]]) -> list[Verdict]:
    """The verdicts that a flight program counts (`stats` of the variable server)."""
    found = []
    for id_, counts in stats.items():
        ticks = {"first_tick": None, "last_tick": None}
        kept = {which: _numbers(counts.get(which, {})) for which in ("first", "last")}
        found.append(Verdict(id_, **{**ticks, **counts, **kept, "status": Status(counts["status"])}))
    return found


def _numbers(values: Mapping[str, Any]) -> dict[str, Any]:
    """With floats for the texts that JSON has instead of those that are not finite."""
    return {path: float(v) if v in ("nan", "inf", "-inf") else v for path, v in values.items()}


def read_violations(lib: Any, handle: int) -> list[float]:
    """How often each requirement was violated; NaN: not exercised. A hundred times faster than all of the verdicts."""
    reader, found = _Reader(lib, handle), []
    for raw in map(reader.raw, range(reader.count)):
        violated = float(max(raw.violations, raw.status == _VIOLATED))
        found.append(math.nan if raw.status == _NOT_EXERCISED else violated)
    return found


def not_exercised(flights: Iterable[Mapping[str, Verdict]]) -> list[str]:
    """The ids of the requirements that none of some flights exercised. Of each flight: `requirements` of its twin."""
    flown = list(flights)
    ids = dict.fromkeys(id_ for verdicts in flown for id_ in verdicts)
    silent = Status.NOT_EXERCISED
    return [id_ for id_ in ids if all(verdicts[id_].status is silent for verdicts in flown if id_ in verdicts)]


#: The state of a requirement that only counts.
_COUNTING = ("last_tick", "started", "violated")


def as_json(verdict: Verdict) -> dict[str, Any]:
    """Its members. JSON has no NaN and no infinity: values of a violation that are such are texts."""
    shown = asdict(verdict)
    for values in (shown["first"], shown["last"]):
        values |= {p: str(v) for p, v in values.items() if isinstance(v, float) and not math.isfinite(v)}
    return shown


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


class _Reader:
    """Reads the verdicts of a run. Descriptors take long to read, and only violated requirements need them."""

    def __init__(self, lib: Any, handle: int):
        self._lib, self._handle = lib, handle
        table = lib.fcsl_run_monitor(handle)
        self.count = table.contents.requirement_count if table else 0
        self._rows = lib.fcsl_run_gather_verdicts(handle, ctypes.byref(ctypes.c_uint32()))
        self._monitor = table.contents if table else None

    def raw(self, index: int) -> CVerdict:
        found = CVerdict()
        self._lib.fcsl_run_verdict(self._handle, self._rows, index, ctypes.byref(found))
        return found

    def verdict(self, index: int) -> Verdict:
        raw, text = self.raw(index), ctypes.create_string_buffer(VERDICT_TEXT_BYTES)
        self._lib.fcsl_run_verdict_text(self._handle, ctypes.byref(raw), text)
        required = raw.requirement.contents
        begun = raw.violations > 0
        first, last = self._violating(required.instance) if begun else ({}, {})
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
            forgot_before=raw.forgot_before or None,
            line=text.value.decode("utf-8", "replace"),
        )

    @cached_property
    def _machines(self) -> tuple[Machine, Machine]:
        """The monitor, and the machine that it watches."""
        assert self._monitor is not None
        return read_machine(self._monitor.machine), read_machine(self._lib.fcsl_run_machine(self._handle))

    @cached_property
    def _observed(self) -> dict[str, list[tuple[str, str]]]:
        """By instance of the monitor: the path of a value in the machine, and the name of its input."""
        assert self._monitor is not None
        found: dict[str, list[tuple[str, str]]] = {}
        for one in self._monitor.observed[: self._monitor.observed_count]:
            owner, _, target = one.input.decode().rpartition(".inputs.")
            found.setdefault(owner, []).append((one.path.decode(), target))
        return found

    def _violating(self, instance: int) -> tuple[dict[str, Any], dict[str, Any]]:
        """What a requirement read in the first and in the last tick that violated it, by path."""
        monitor, watched = self._machines
        base = self._lib.fcsl_run_monitor_data(self._handle)
        name, found = monitor.instances[instance].name, (dict[str, Any](), dict[str, Any]())
        for path, target in self._observed.get(name, []):
            for values, which in zip(found, ("first", "last"), strict=True):
                result = f"{name}.outputs.{which}_{target}"
                if result in monitor.fields:
                    value, names = _read(monitor, result, base), _names(path, watched)
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


def summary(verdicts: Sequence[Verdict]) -> list[str]:
    """The lines at the end of a run: each violated requirement; how many were met, which were not exercised, and whether a
    checkpoint made them begin anew."""
    if not verdicts:
        return []
    lines = [f"requirement {verdict}" for verdict in verdicts if verdict.status is Status.VIOLATED]
    met = sum(verdict.status is Status.MET for verdict in verdicts)
    silent = ", ".join(verdict.id for verdict in verdicts if verdict.status is Status.NOT_EXERCISED)
    anew = verdicts[0].forgot_before
    line = f"requirements: {met} of {len(verdicts)} met" + (f"; not exercised: {silent}" if silent else "")
    return [*lines, line + (f"; begun anew at tick {anew}: the checkpoint has no memory of them" if anew else "")]
