# SPDX-License-Identifier: Apache-2.0
"""The times in which a recorded machine violated its requirements."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..errors import BagError
from .bag import Bag, RecordedMachine

_FIELDS = ("header", "tick", "requirement", "text", "holds", "values", "violations")


@dataclass(frozen=True)
class Violation:
    """From the tick that began it to the one in which the requirement held again; to the end of the recording, if none
    did. Times are stamps."""

    id: str
    text: str
    values: str  # what it read in that tick
    tick: int
    start_ns: int
    end_ns: int
    ended: bool = True


def violations(bag: Bag, machine: RecordedMachine, end_ns: int) -> list[Violation]:
    """In the order in which they began. `end_ns`: the stamp of the last tick. Empty where the bag has no verdicts: the
    machine has no requirements, or an older program recorded it. Raises BagError."""
    found: list[Violation] = []
    open_: dict[str, tuple[int, int]] = {}  # by id: place in `found`, and how many had begun
    messages = bag.messages({machine.requirements}) if machine.requirements in bag.topics else ()
    for _, _, data in messages:
        message = bag.decode_own(machine.requirements, data, _FIELDS)
        now_ns = message.header.stamp.sec * 1_000_000_000 + message.header.stamp.nanosec
        columns = message.requirement, message.text, message.holds, message.values, message.violations
        if len({len(column) for column in columns}) != 1:
            raise BagError(f"{bag.path}: a message of `{machine.requirements}` is damaged: its arrays differ in length")
        for id_, text, holds, values, begun in zip(*columns, strict=True):
            violated = not holds and begun > 0  # those that the last tick judges count none
            if id_ in open_ and (not violated or begun != open_[id_][1]):
                place, _ = open_.pop(id_)
                found[place] = replace(found[place], end_ns=now_ns, ended=True)
            if violated and id_ not in open_:
                open_[id_] = len(found), int(begun)
                found.append(Violation(id_, text, values, int(message.tick), now_ns, end_ns, ended=False))
    return found
