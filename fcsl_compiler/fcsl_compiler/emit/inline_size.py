# SPDX-License-Identifier: Apache-2.0
"""Which ticks and functions take the bodies of what they call in, and which call them: by how much code that makes."""

from __future__ import annotations

from ..model import ir
from ..model.machine import Machine

#: Operations, summed over all states, up to which every tick takes in all that it calls. The C compiler then keeps in
#: registers what one instance hands to the next (measured: a third less bookkeeping); the code of an instance stands once in
#: every state that runs it.
_MOST_OPERATIONS = 8000


#: A larger function is never forced into its callers: helpers that call helpers twice each would double the code at every level.
_MOST_INLINED = 4000


def inlined_functions(machine: Machine) -> frozenset[str]:
    """The helpers and library functions that are small enough to go into their callers, with all that they call."""
    sizes = _Sizes(machine)
    functions = machine.program.functions.values()
    return frozenset(f.name for f in functions if sizes.operations(f) <= _MOST_INLINED)


def takes_bodies_in(machine: Machine) -> bool:
    """Whether the ticks of this machine are small enough to hold the bodies of their instances."""
    sizes = _Sizes(machine)
    run = [machine.instances[e.instance].execute for state in machine.states for e in state.entries]
    return sum(sizes.operations(function) for function in run) <= _MOST_OPERATIONS


class _Sizes:
    """How large the C of functions is, about: their expressions, with those of a callee wherever it is called."""

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
