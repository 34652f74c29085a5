# SPDX-License-Identifier: Apache-2.0
"""Requirements that act on the machine: with an effect, or as the guard of a transition.

Each becomes an instance of the machine, in the language itself, which is degraded while the requirement is violated. It
runs at the end of every tick, in every state.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import replace
from math import prod
from pathlib import Path, PurePosixPath
from typing import Any

from ..base.diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, Severity, nearest
from ..base.source import SourceFile, Span
from ..check.algorithm import check_algorithm
from ..check.modules import Modules
from ..model import ir
from ..model.machine import Effect, Entry, Instance, Machine, Watched
from ..model.types import HEALTH_NAMES
from ..parse.machine_files import ParsedFile
from ..parse.python_source import parse_python
from .algorithm import AlgorithmWriter, file_head
from .code import Truth
from .read import Signals
from .requirement import Requirement

_VIOLATED = HEALTH_NAMES.index("degraded")


def acting(requirements: list[Requirement], machine: Machine) -> list[Requirement]:
    """Those that have an effect on an instance of the machine, or guard one of its transitions."""
    names = {instance.name for instance in machine.instances}
    guards = {edge.requirement for edge in machine.edges}
    return [r for r in requirements if r.target in names or r.id in guards]


def check_effects(
    requirements: list[Requirement], machine: Machine, guards: Mapping[str, Span], sink: DiagnosticSink
) -> None:
    """Reports what cannot act. `guards`: where transitions name requirements, by id."""
    by_id = {requirement.id: requirement for requirement in requirements}
    for id_, at in guards.items():
        if id_ not in by_id:
            hint = nearest(id_, list(by_id)) or f"the requirements are {', '.join(by_id) or 'none'}"
            sink.error("E206", f"no requirement `{id_}`", at, help=hint)
    actors = acting(requirements, machine)
    if not actors:
        return
    signals, targets = Signals(machine), {requirement.target for requirement in requirements}
    for r in actors:
        at = guards.get(r.id, r.span)
        if r.kind == "at_end" or r.assumed:
            why = "it is judged when the run is over" if r.kind == "at_end" else "it is about the environment"
            what = "`at_end`" if r.kind == "at_end" else "an assumption"
            fix = "name another requirement, or remove the effect"
            sink.error("E257", f"`{r.id}` cannot act: it is {what}", at, why=why, help=fix)
        for path in (node.value for root in r.expressions for node in root.walk() if node.operator == "field"):
            row = signals.find(path).row
            instance = machine.instances[row.instance].name if row.instance >= 0 else ""
            if row.abi_type == "FCSL_HEALTH" and row.role == "OUTPUT" and instance in targets:
                why = "its verdict would depend on an effect: a requirement sets this health"
                fix = "name what makes the health what it is"
                sink.error("E257", f"`{r.id}` acts, and reads `{path}`", r.span, why=why, help=fix)
            elif row.path == "machine.lost_requests":
                why = "it counts what transitions lose, which are taken later"
                sink.error("E257", f"`{r.id}` acts, and reads `{path}`", r.span, why=why, help="remove it")
        _warn_never_evaluated(r, machine, guards, signals, sink)


def _warn_never_evaluated(
    r: Requirement, machine: Machine, guards: Mapping[str, Span], signals: Signals, sink: DiagnosticSink
) -> None:
    """Warns about a transition from states of which none schedules an instance that its requirement needs."""
    needed = [name for name in signals.instances(r) if not r.hold or name == r.clock]
    sources = sorted({edge.source for edge in machine.edges if edge.requirement == r.id})
    for name in needed if r.id in guards else ():
        states = [machine.states[source] for source in sources]
        if not any(machine.instances[e.instance].name == name for state in states for e in state.entries):
            where = ", ".join(f"`{state.name}`" for state in states)
            message = f"`{r.id}` is never evaluated in {where}"
            why = f"no such state schedules `{name}`, which it reads"
            fix = f'schedule `{name}` there, or add `"stale": "hold"` to the requirement'
            sink.warning("W209", message, guards[r.id], why=why, help=fix)
            return


def with_effects(machine: Machine, requirements: list[Requirement]) -> Machine:
    """The machine with instances that evaluate these requirements, and guards in the place of their names. A transition
    with another one is removed: a subset machine lacks what it needs. Raises DiagnosticError."""
    first = len(machine.instances)
    index = {requirement.id: first + n for n, requirement in enumerate(requirements)}
    edges = tuple(
        replace(e, guard_instance=index[e.requirement], guard_mask=1 << _VIOLATED) if e.requirement else e
        for e in machine.edges
        if not e.requirement or e.requirement in index
    )
    if not requirements:
        return replace(machine, edges=edges) if len(edges) < len(machine.edges) else machine
    writers = [_Acting(requirement, machine) for requirement in requirements]
    source = _source(machine, writers)
    algorithms = _algorithms(machine, source, writers)
    names = [instance.name for instance in machine.instances]
    instances = tuple(_instance(w.requirement, a) for w, a in zip(writers, algorithms, strict=True))
    entries = tuple(Entry(first + n, 1, 0, r.span) for n, r in enumerate(requirements))
    return replace(
        machine,
        instances=(*machine.instances, *instances),
        states=tuple(replace(state, entries=(*state.entries, *entries)) for state in machine.states),
        edges=edges,
        sources=(*machine.sources, source),
        hashed_text="\n".join([machine.hashed_text, *(requirement.span.text for requirement in requirements)]),
        effects=tuple(
            Effect(r.id, index[r.id], names.index(r.target) if r.target in names else -1, r.health)
            for r in requirements
        ),
        watched=tuple(found for w in writers for found in w.watched(index[w.requirement.id])),
        tree=_tree(machine, source, instances, writers),
    )


class _Acting(AlgorithmWriter):
    """Degrades its own health while the requirement is violated. A fault fails it, so that it does not act then."""

    def outputs(self) -> Mapping[str, str]:
        return {}

    def verdict(self, when: Truth | None, wrong: list[str]) -> list[str]:
        return [*wrong, "if wrong:", '    self.health = "degraded"']

    def watched(self, instance: int) -> list[Watched]:
        return [self._watched(instance, path, name, type_) for path, (name, type_) in self.inputs.items()]

    def _watched(self, instance: int, path: str, name: str, type_: str) -> Watched:
        row = self.signals.find(path).row
        indices = [int(n) for n in re.findall(r"\d+", path.removeprefix(row.path))]
        element = sum(n * prod(row.shape[at + 1 :]) for at, n in enumerate(indices)) if row.shape else None
        return Watched(instance, name, type_, row.path, element, row.member, row.scalar)


def _source(machine: Machine, writers: list[_Acting]) -> SourceFile:
    """The file of their algorithms, which no file has yet."""
    taken = {re.sub(r"\W", "_", PurePosixPath(source.name).stem) for source in machine.sources}
    stem = f"{machine.name}_effects"
    while stem in taken:
        stem += "_"
    text = "\n\n".join([file_head("Requirements that act", machine.name), *(w.text() for w in writers)])
    name = f"{stem}.py"
    return SourceFile(name, text, str(Path(machine.config.path).parent / name))


def _algorithms(machine: Machine, source: SourceFile, writers: list[_Acting]) -> list[ir.Algorithm]:
    """Checked, and their functions added to the program of the machine. Raises DiagnosticError at the requirement."""
    sink, found = DiagnosticSink(), []
    modules = Modules(machine.program, {source.name: {w.class_name for w in writers}}, sink)
    declarations = modules.load(ParsedFile(source, parse_python(source, sink)))
    assert declarations is not None, sink.diagnostics
    for writer in writers:
        name, class_ = f"requirement__{writer.requirement.instance}", declarations.classes[writer.class_name]
        table = modules.table(declarations)
        found.append(check_algorithm(name, class_, (source.name,), table, declarations.sound, sink))
        if sink.failed:
            fix = "write it as several requirements"
            message = f"it cannot be compiled: {sink.diagnostics[-1].message}"
            raise DiagnosticError([Diagnostic(Severity.ERROR, "E257", message, writer.requirement.span, "", fix)])
    return found


def _instance(requirement: Requirement, algorithm: ir.Algorithm) -> Instance:
    name = f"requirements.{requirement.instance}"
    return Instance(name, algorithm, {}, {}, 0, (), algorithm.execute, None, requirement.span, published=False)


def _tree(
    machine: Machine, source: SourceFile, instances: tuple[Instance, ...], writers: list[_Acting]
) -> dict[str, Any]:
    """The JSON of the machine with these instances, for a second reader."""
    tree = machine.tree or json.loads(machine.config.text)
    made = zip(instances, writers, strict=True)
    algorithms = {i.algorithm.name: {"source": source.name, "class": w.class_name} for i, w in made}
    added = {instance.name: {"algorithm": instance.algorithm.name} for instance in instances}
    return {
        **tree,
        "algorithms": {**tree["algorithms"], **algorithms},
        "instances": {**tree["instances"], **added},
    }
