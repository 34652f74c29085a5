# SPDX-License-Identifier: Apache-2.0
"""Finds the checkpoint of a recording from which a replay reaches a tick with the fewest steps."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import BagError
from .bag import Bag, Place, RecordedMachine
from .stamps import Stamps


@dataclass(frozen=True)
class Keyframe:
    """A checkpoint before the tick `tick`. `data` is its message; `place` the chunk that has it, None where the bag has no
    index.
    """

    tick: int
    data: bytes
    place: Place | None


def keyframe_before(bag: Bag, machine: RecordedMachine, tick: int) -> Keyframe:
    """The last checkpoint of `machine` at or before `tick`; where the run went back in time, one of those. Raises BagError
    if there is none.

    With an index a few chunks are read, however long the bag is; without one (the recorder was killed), all of it.
    """
    stamps, topic = Stamps(bag), machine.checkpoint
    found: list[tuple[int | None, bytes, Place | None]]
    places = bag.chunks_of(topic) if topic in bag.topics else []
    if places is None:
        found = [(stamps.tick(topic, data), data, None) for _, _, data in bag.messages({topic})]
    else:
        low, high = 0, len(places)
        while low < high:  # the first chunk whose first checkpoint is behind the tick
            middle = (low + high) // 2
            first = next(iter(bag.chunk(places[middle], topic)), b"")
            at = stamps.tick(topic, first)
            low, high = (middle + 1, high) if at is not None and at <= tick else (low, middle)
        last = places[max(low - 1, 0) : low]
        found = [(stamps.tick(topic, data), data, place) for place in last for data in bag.chunk(place, topic)]
    before = [Keyframe(at, data, place) for at, data, place in found if at is not None and at <= tick]
    if not before:
        raise BagError(
            f"{bag.path}: no checkpoint of `{machine.name}` at or before tick {tick}, from which it could run"
        )
    return before[-1]
