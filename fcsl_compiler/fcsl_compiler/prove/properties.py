# SPDX-License-Identifier: Apache-2.0
"""What can be shown of a machine: that its requirements hold, that its assertions do, that a state is never active."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

from ..base.source import Span
from ..model import ir
from ..model.machine import Machine
from ..requirements.requirement import Requirement

ASSERTION = "assertion failed"


@dataclass(frozen=True)
class Property:
    """`kind`: requirement, assert or state. `id`: the requirement's; place of an assertion; name of a state. `instance`:
    of the monitor for a requirement, of the machine for an assertion."""

    kind: str
    id: str
    text: str
    instance: str = ""
    span: Span | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return self.id if self.kind == "requirement" else f"{self.kind} {self.id}"


def properties_of(machine: Machine, requirements: list[Requirement]) -> Iterator[Property]:
    """`at_end` says nothing of a tick, and assumptions are of the environment."""
    for r in requirements:
        if r.kind != "at_end" and not r.assumed:
            yield Property("requirement", r.id, r.text, r.instance, r.span)
    for instance in machine.instances:
        for span, cause in dict.fromkeys(_assertions(machine, instance.execute)):
            place = f"{instance.name} {span.source.name}:{span.line}:{span.column}"
            yield Property("assert", place, cause.removeprefix(ASSERTION).removeprefix(": "), instance.name, span)
    for number, state in enumerate(machine.states if len(machine.states) > 1 else ()):
        if number != machine.initial_state:
            yield Property("state", state.name, "never active", span=state.span)


def _assertions(machine: Machine, function: ir.Function) -> Iterator[tuple[Span, str]]:
    """Of a function and those that it calls."""
    for s in ir.walk(function.body):
        for e in ir.expressions(s):
            yield from _in_expression(e)
    for name in function.calls:
        yield from _assertions(machine, machine.program.functions[name])


def _in_expression(e: ir.Expr) -> Iterator[tuple[Span, str]]:
    if isinstance(e, ir.Apply) and e.op.name == "assert" and e.op.faults[0].startswith(ASSERTION):
        yield e.span, e.op.faults[0]
    for child in ir.children(e):
        yield from _in_expression(child)
