# SPDX-License-Identifier: Apache-2.0
"""Which states a recorded machine visited, and when."""

from __future__ import annotations

from typing import NamedTuple

from .bag import Bag, RecordedMachine, StateReader
from .errors import BagError, did_you_mean


class Visit(NamedTuple):
    """Consecutive ticks in one state: from the first to the last of them, times in ns of their stamps."""

    state: str
    first_tick: int
    last_tick: int
    start_ns: int
    end_ns: int


def visits(bag: Bag, machine: RecordedMachine) -> list[Visit]:
    """Every visit to a state in the order of the bag. Raises BagError when the bag holds no tick of the machine."""
    found: list[Visit] = []
    if machine.state in bag.topics:
        reader = StateReader(bag, machine.state)
        for _, _, data in bag.messages({machine.state}):
            now = reader.read(data)
            if found and found[-1].state == now.state:
                found[-1] = found[-1]._replace(last_tick=now.tick, end_ns=now.time_ns)
            else:
                found.append(Visit(now.state, now.tick, now.tick, now.time_ns, now.time_ns))
    if not found:
        cause = f" ({bag.truncated})" if bag.truncated else ""
        raise BagError(f"{bag.path}: no tick of machine `{machine.name}` is in the bag{cause}")
    return found


def nth_visit(bag: Bag, machine: RecordedMachine, state: str, number: int) -> Visit:
    """Visit `number` (from 1) to `state`. Raises BagError saying how often, or which states, there were."""
    there = visits(bag, machine)
    matching = [visit for visit in there if visit.state == state]
    if not matching:
        names = list(dict.fromkeys(visit.state for visit in there))
        raise BagError(
            f"{bag.path}: `{machine.name}` was never in state `{state}`{did_you_mean(state, names)}; "
            f"it was in {', '.join(names)}"
        )
    if not 1 <= number <= len(matching):
        times = "once" if len(matching) == 1 else f"{len(matching)} times"
        raise BagError(f"{bag.path}: `{machine.name}` was in `{state}` {times}; there is no visit {number}")
    return matching[number - 1]
