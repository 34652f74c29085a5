# SPDX-License-Identifier: Apache-2.0
"""Merges parts of a bag that are each in the order of their times of recording: chunks of a file, or whole files.

Files are usually in order already. Then each part passes through as it is. Parts that overlap are held in memory
together, up to HELD_BYTES_MAX. Messages of one time stay in the order of their parts.
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import BagError
from .batch import ENTRY, Batch

if TYPE_CHECKING:
    from .bag import Topic

#: Most bytes of overlapping parts that are in memory.
HELD_BYTES_MAX = 1 << 30
#: A batch, and the topic of each channel number in it.
Block = tuple[Batch, "Mapping[int, Topic]"]


class Part(NamedTuple):
    """Blocks in the order of time, with no message earlier than `first_ns`."""

    first_ns: int
    blocks: Callable[[], Iterator[Block]]


class _Open:
    """A part that has been opened: what is left of its current block."""

    def __init__(self, part: Part):
        self._blocks = part.blocks()
        self.data = b""
        self._entries: Any = np.empty(0, ENTRY)
        self._announced: Mapping[int, Topic] = {}

    def load(self) -> bool:
        """Goes on to the next block that is not empty, if there is one."""
        for batch, announced in self._blocks:
            if len(batch.entries):
                (self.data, self._entries), self._announced = batch, announced
                return True
        return False

    def drop_others(self) -> None:
        """Keeps only the bytes of the messages, where they are less than half."""
        if 2 * int((self._entries["end"] - self._entries["begin"]).sum()) < len(self.data):
            (self.data, self._entries), self._announced = _joined([(Batch(self.data, self._entries), self._announced)])

    @property
    def last_ns(self) -> int:
        return int(self._entries["log_ns"][-1])

    def taken(self, until_ns: int, inclusive: bool) -> Block:
        """Takes away what is not later than `until_ns`."""
        end = int(np.searchsorted(self._entries["log_ns"], until_ns, side="right" if inclusive else "left"))
        found = self._entries[:end]
        self._entries = self._entries[end:]
        return Batch(self.data, found), self._announced


def sorted_by_time(batch: Batch) -> Batch:
    """The batch in the order of time; messages of one time stay in their order."""
    times = batch.entries["log_ns"]
    if len(times) < 2 or (times[1:] >= times[:-1]).all():
        return batch
    return Batch(batch.data, batch.entries[np.argsort(times, kind="stable")])


def in_time_order(parts: Sequence[Part], name: str) -> Iterator[Block]:
    """The messages of all parts in the order of time. Raises BagError, which names the bag, for parts that overlap too
    much."""
    # What bounds the messages that may go out: the beginning of a part that is not open, and the end of each open block.
    bounds = [(part.first_ns, number) for number, part in enumerate(parts)]
    heapq.heapify(bounds)
    going: dict[int, _Open] = {}
    while bounds:
        until_ns, number = heapq.heappop(bounds)
        if number not in going:
            going[number] = _Open(parts[number])
        else:
            blocks = [going[n].taken(until_ns, n <= number) for n in sorted(going)]
            blocks = [block for block in blocks if len(block[0].entries)]
            yield _joined(blocks) if len(blocks) > 1 else blocks[0]
        if going[number].load():
            if len(going) > 1:
                going[number].drop_others()
            heapq.heappush(bounds, (going[number].last_ns, number))
        else:
            del going[number]
        if sum(len(part.data) for part in going.values()) > HELD_BYTES_MAX:
            raise BagError(
                f"{name}: its messages are not in the order of time, and its chunks overlap by more than "
                f"{HELD_BYTES_MAX >> 30} GiB; `mcap sort` or `rosbags-convert` writes one that is in order"
            )


def _joined(blocks: Sequence[Block]) -> Block:
    """The messages of several blocks in the order of time; channels that share a number get numbers of their own."""
    announced: dict[int, Topic] = {}
    data, parts, at = [], [], 0
    for batch, topics in blocks:
        entries = batch.entries.copy()
        sizes = entries["end"] - entries["begin"]
        data += [batch.data[begin:end] for _, _, begin, end in entries.tolist()]
        entries["end"] = at + np.cumsum(sizes)
        entries["begin"] = entries["end"] - sizes
        at += int(sizes.sum())
        for old in np.unique(batch.entries["number"]).tolist():
            new = len(announced)
            announced[new] = topics[old]
            entries["number"][batch.entries["number"] == old] = new
        parts.append(entries)
    return sorted_by_time(Batch(b"".join(data), np.concatenate(parts))), announced
