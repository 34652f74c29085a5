# SPDX-License-Identifier: Apache-2.0
"""Where the code of a requirement stands: its own, and that which assigns the fields that it names."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..base.source import Span
from ..model import ir
from ..model.machine import Machine
from ..requirements.read import Signals
from ..requirements.requirement import Requirement
from .library import compile_all
from .passes import Compilation


@dataclass(frozen=True)
class RequirementPlaces:
    """Places are `file:line`, or `file:first-last`. An input is assigned where its source is. `algorithms`: the names
    of those that assign what it names."""

    at: str
    monitor: str
    python: tuple[str, ...]
    c: tuple[str, ...]
    algorithms: tuple[str, ...]


def requirement_places(config: Path) -> dict[str, RequirementPlaces]:
    """Those of each requirement of a machine, by id. Raises DiagnosticError, ToolchainError."""
    (c,) = compile_all([config])
    if c.monitor_code is None:
        return {}
    lines = _c_lines(c)
    own = {file: span for (file, _), span in _c_lines(c.monitor_code, whole_files=True).items()}
    found = {}
    for requirement in c.requirements:
        instances, spans = _watched(requirement, c.checked)
        at = [(span.source.name, span.line) for span in spans]
        first, last = own[f"{requirement.instance}.py"]
        found[requirement.id] = RequirementPlaces(
            at=_place(requirement.span.source.name, requirement.span.line),
            monitor=f"{c.monitor_code.source_name}:{first}-{last}",
            python=tuple(_place(*line) for line in at),
            c=tuple(_place(c.source_name, lines[line][0]) for line in at if line in lines),
            algorithms=tuple(dict.fromkeys(c.checked.instances[i].algorithm.name for i in instances)),
        )
    return found


def _place(file: str, line: int) -> str:
    return f"{file}:{line}"


def _c_lines(c: Compilation, whole_files: bool = False) -> dict[tuple[str, int], tuple[int, int]]:
    """First and last line of C of each line of a source, or of each source (as its line 0)."""
    found: dict[tuple[str, int], tuple[int, int]] = {}
    for first, last, file, line in json.loads(c.map)["runs"]:
        key = (file, 0 if whole_files else line)
        low, high = found.get(key, (first, last))
        found[key] = (min(low, first), max(high, last))
    return found


def _watched(requirement: Requirement, machine: Machine) -> tuple[list[int], list[Span]]:
    """The instances whose outputs and state it names, and the statements that assign those fields, each once."""
    signals = Signals(machine)
    leaves = [node for root in requirement.expressions for node in root.walk() if node.operator == "field"]
    fields = dict.fromkeys(found for leaf in leaves for found in _assigned(str(leaf.value), signals))
    spans = [span for instance, record, name in fields for span in _writes(machine, instance, record, name)]
    return list(dict.fromkeys(instance for instance, _, _ in fields)), list(dict.fromkeys(spans))


def _assigned(path: str, signals: Signals) -> Iterator[tuple[int, str, str]]:
    """Instance, record and field of what has the value of a path, where an algorithm assigns it."""
    row = signals.find(path).row
    if row.instance < 0:
        return
    instance = signals.machine.instances[row.instance].name
    record, _, rest = row.path.removeprefix(f"{instance}.").partition(".")
    name = rest.partition(".")[0]
    if record in ("outputs", "state"):
        yield row.instance, record, name
    for connection in signals.machine.connections if record == "inputs" else ():
        source, target = connection.source, connection.target
        if (target.instance, target.field) == (row.instance, name) and source.record in ("outputs", "state"):
            yield source.instance, source.record, source.field


def _writes(machine: Machine, instance: int, record: str, name: str) -> Iterator[Span]:
    own = machine.instances[instance]
    for function in (own.start, own.execute):
        for target, _, span in ir.writes(function.body) if function is not None else ():
            if ir.variable(target) == (record, name):
                yield span
