# SPDX-License-Identifier: Apache-2.0
"""Selects the instances for which a tick can leave out a part of its bookkeeping."""

from __future__ import annotations

from math import inf

from ..model import ir
from ..model.machine import Machine
from ..model.types import count_of
from .names import sensors

#: Operations of an `execute` up to which it is brief: less than a tenth of a millisecond, elementary functions included.
_BRIEF = 1000


def quiet_instances(machine: Machine) -> frozenset[int]:
    """The instances whose health is nominal after a usual tick: neither their algorithm, nor a channel, nor a substitute
    for their effects sets it. The tick tests it instead of storing it, together with what a host injects."""
    guarded = {channel.port.instance for channel in sensors(machine)}
    return frozenset(
        n
        for n, i in enumerate(machine.instances)
        if not (n in guarded or i.algorithm.effects or ir.writes_field(i.execute.body, "outputs", "health"))
    )


def noted_instances(machine: Machine) -> frozenset[int]:
    """The instances whose number a tick stores for the watchdog. Brief ones are left out: a tick that is late by
    milliseconds is not in one of them, and the store costs as much as a trivial algorithm."""
    work = _Work(machine)
    return frozenset(n for n, i in enumerate(machine.instances) if work.of(i.execute) > _BRIEF)


class _Work:
    """Approximate number of operations that a call of a function executes at most; infinite if a loop has no constant
    bounds, or if the function reaches outside the machine."""

    def __init__(self, machine: Machine):
        self.functions, self.known = machine.program.functions, dict[str, float]()

    def of(self, function: ir.Function) -> float:
        if function.name not in self.known:
            self.known[function.name] = sum(map(self._statement, function.body))
        return self.known[function.name]

    def _statement(self, s: ir.Stmt) -> float:
        if isinstance(s, ir.Effect):
            return inf
        own = sum(map(self._expression, ir.expressions(s)))
        if isinstance(s, ir.For):
            rounds = ir.constant_rounds(s)
            return own + (inf if rounds is None else rounds * sum(map(self._statement, s.body)))
        if isinstance(s, ir.If):
            return own + max(sum(map(self._statement, branch)) for branch in (s.then, s.otherwise))
        return own

    def _expression(self, e: ir.Expr) -> float:
        callee = self.of(self.functions[e.function]) if isinstance(e, ir.Call) else 0
        return count_of(e.type) + callee + sum(map(self._expression, ir.children(e)))
