# SPDX-License-Identifier: Apache-2.0
"""Decides by code size which callees are inlined into ticks and functions."""

from __future__ import annotations

from ..model import ir
from ..model.machine import Machine

#: Maximum number of operations, summed over all states, for which ticks inline all callees. The C compiler can then
#: keep values between instances in registers (measured: a third less overhead). The code of an instance is repeated in
#: every state that runs it.
_MOST_OPERATIONS = 8000


#: Larger functions are never inlined by force. Helpers that call other helpers twice would double the code at each
#: level.
_MOST_INLINED = 4000


def inlined_functions(machine: Machine) -> frozenset[str]:
    """The helpers and library functions to inline, including their callees."""
    sizes = _Sizes(machine)
    functions = machine.program.functions.values()
    return frozenset(f.name for f in functions if sizes.operations(f) <= _MOST_INLINED)


def takes_bodies_in(machine: Machine) -> bool:
    """Whether the ticks of this machine are small enough to inline the bodies of their instances."""
    sizes = _Sizes(machine)
    run = [machine.instances[e.instance].execute for state in machine.states for e in state.entries]
    return sum(sizes.operations(function) for function in run) <= _MOST_OPERATIONS


class _Sizes:
    """Approximate sizes of functions as C: their expressions, with those of a callee added at each call."""

    def __init__(self, machine: Machine):
        self.functions, self.known = machine.program.functions, dict[str, int]()

    def operations(self, function: ir.Function) -> int:
        if function.name not in self.known:
            found = sum(self._nodes(e) for s in ir.walk(function.body) for e in ir.expressions(s))
            self.known[function.name] = found
        return self.known[function.name]

    def _nodes(self, e: ir.Expr) -> int:
        callee = self.operations(self.functions[e.function]) if isinstance(e, ir.Call) else 0
        return 1 + callee + sum(map(self._nodes, ir.children(e)))
