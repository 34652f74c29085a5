# SPDX-License-Identifier: Apache-2.0
"""Brings a run to a tick of a recording, from the last checkpoint before it."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator

from ..bag import Bag, RecordedMachine
from ..bag.bag import Place
from ..bag.keyframes import keyframe_before
from ..bag.stamps import Stamps
from ..errors import BagError
from ..run import Run
from .reproduce import Replay


class _Head(Bag):
    """The part of a bag before a tick, for the topics of one machine."""

    def __init__(self, whole: Bag, end_tick: int):
        self._whole, self._end_tick = whole, end_tick
        super().__init__(whole.path)

    def _open(self) -> None:
        self.files, self.topics = self._whole.files, self._whole.topics
        self._stores, self._layouts = self._whole._stores, self._whole._layouts

    def messages_from(self, topics: Collection[str], place: Place | None) -> Iterator[tuple[str, int, bytes]]:
        stamps = Stamps(self._whole)
        for topic, log_ns, data in self._whole.messages_from(topics, place):
            tick = stamps.tick(topic, data)
            if (
                tick is not None
                and tick >= self._end_tick
                and not (tick == self._end_tick and topic.endswith("/record/checkpoint"))
            ):
                return
            self.reading, self.lost, self.truncated = self._whole.reading, self._whole.lost, self._whole.truncated
            yield topic, log_ns, data


def seek(
    bag: Bag, machine: RecordedMachine, run: Run, tick: int, progress: Callable[[int], None] = lambda ticks: None
) -> None:
    """Brings `run`, of the recorded machine, to where `tick` ticks were completed. Raises BagError if the record from the
    last checkpoint up to there is incomplete, or does not replay identically.
    """
    first = keyframe_before(bag, machine, tick)
    verdict = Replay(_Head(bag, tick), machine, run, first=first).run(progress)
    if not verdict.identical or run.tick != tick:
        raise BagError(f"{bag.path}: the record up to tick {tick} cannot be replayed:\n{verdict}")
