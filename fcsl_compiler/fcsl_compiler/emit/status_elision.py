# SPDX-License-Identifier: Apache-2.0
"""Status elision: selects the instances whose health, or whose number for the watchdog, a tick need not store."""

from __future__ import annotations

from collections import Counter

from ..model.machine import Machine
from .names import sensors
from .operations import KINDS, operations

#: Operations of an `execute` up to which it is brief: it ends within a tenth of a millisecond.
_BRIEF = 1000
#: What a division or a function counts, of which some take 2 µs (measured: `%`, `atan2`, `**`).
_LONG = 20


def quiet_instances(machine: Machine) -> frozenset[int]:
    """The instances without events whose health is nominal after a usual tick: neither their algorithm, nor a channel, nor
    a substitute for their effects sets it. The tick tests it instead of storing it, together with what a host injects. An
    injected health is set before the algorithm runs, which must not read it either."""
    guarded = {channel.port.instance for channel in sensors(machine)}
    return frozenset(
        n
        for n, i in enumerate(machine.instances)
        if not (
            n in guarded or i.algorithm.effects or i.execute.has_events or ("outputs", "health") in i.execute.fields
        )
    )


def noted_instances(machine: Machine) -> frozenset[int]:
    """The instances whose number a tick stores for the watchdog. Brief ones are left out: a tick that is late by
    milliseconds is not in one of them, and the store costs as much as a trivial algorithm."""
    brief: dict[str, bool] = {}
    for instance in machine.instances:
        f = instance.execute
        if f.name not in brief:
            brief[f.name] = not instance.algorithm.effects and _work(operations(f, machine.program)) <= _BRIEF
    return frozenset(n for n, i in enumerate(machine.instances) if not brief[i.execute.name])


def _work(counts: Counter[str]) -> int:
    return sum(n * (1 if kind in KINDS and kind != "divide" else _LONG) for kind, n in counts.items())
