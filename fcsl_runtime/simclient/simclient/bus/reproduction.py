# SPDX-License-Identifier: Apache-2.0
"""Whether a recording reproduces a machine's run: a checkpoint, and behind it every host write of every tick."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

from .machine import BusMachine
from .session import Question, Session
from .ticks import Tick
from .writes import CHECKPOINT, Checkpoint, Write, Written, read_checkpoint

#: How long a checkpoint may take, from the first tick on; and most events that wait for it.
_WAIT_S, _WAITING_MAX = 5.0, 200_000
Event = Tick | Write | Written


class Reproduction:
    """Takes what comes of a machine, in order, and gives back what a bag of it holds, in order.

    Until there is a checkpoint everything waits; then the checkpoint lies before the first tick behind it. `lacks` says
    why the run is not reproduced; "" while it is.
    """

    def __init__(self, machine: BusMachine, session: Session, now_s: Callable[[], float] = time.monotonic):
        self.lacks = ""
        self.first = self.last = -1  # the ticks that are reproduced
        self._key = f"{machine.prefix}/{CHECKPOINT}"
        self._session, self._now_s = session, now_s
        self._question: Question | None = None
        self._checkpoint: Checkpoint | None = None
        self._begun = False
        self._expected = 0  # the number of the next write; 0: no `Written` has come
        self._oldest = 0  # `_expected` of the first event that waits
        self._give_up_s = float("inf")
        self._waiting: list[Event] = []

    @property
    def reproduces(self) -> bool:
        return self._begun and not self.lacks

    def __str__(self) -> str:
        if self.reproduces and self.last >= self.first:
            return f"reproduces ticks {self.first} to {self.last}"
        return f"does not reproduce the run: {self.lacks or 'no tick came behind the checkpoint'}"

    def take(self, event: Event | None) -> Iterator[Tick | Write | Checkpoint]:
        """None: nothing more has come yet."""
        if event is not None:
            self._follow(event)
        if self._begun or self.lacks:
            yield from self._pass_on(event)
            return
        if event is not None:
            self._give_up_s = min(self._give_up_s, self._now_s() + _WAIT_S)
            self._waiting.append(event)
        if event is None or isinstance(event, Written):
            self._query()
            if self._is_due():
                yield from self._begin()
        if not self._begun and (self._now_s() > self._give_up_s or len(self._waiting) > _WAITING_MAX):
            yield from self.end()

    def end(self) -> Iterator[Tick | Write | Checkpoint]:
        """Nothing more will come: what still waits."""
        if not self._begun and not self.lacks:
            heard = "no checkpoint came" if self._expected else "no host writes came: the program serves none"
            self.lacks = heard
            waiting, self._waiting = self._waiting, []
            for event in waiting:
                yield from self._pass_on(event)

    # ---- numbers -----------------------------------------------------------------------------------------------------

    def _follow(self, event: Event) -> None:
        """Counts the writes. Those before the first `Written` may be a part."""
        if isinstance(event, Write) and self._expected:
            self._expect(event.number, event.number + 1)
        elif isinstance(event, Written):
            if not self._expected:
                self._expected = self._oldest = event.next_write
            self._expect(event.next_write, event.next_write)
            if self._begun and not self.lacks:
                self.last = event.ticks - 1

    def _expect(self, number: int, following: int) -> None:
        if number != self._expected and not self._begun:  # nothing is lost yet: it begins anew behind the gap
            self._oldest = following
        elif number != self._expected and not self.lacks:
            gap = f"{self._expected} to {number - 1}" if number > self._expected else f"from {self._expected} on"
            self.lacks = f"host writes {gap} were lost on the way, behind tick {max(self.last, self.first)}"
        self._expected = following

    # ---- the beginning -----------------------------------------------------------------------------------------------

    def _query(self) -> None:
        """For a checkpoint, until there is one whose writes are all here."""
        answer = self._question.answer() if self._question is not None else None
        found = read_checkpoint(answer) if answer is not None else None
        if found is not None:
            self._checkpoint = found
        if self._checkpoint is not None and self._checkpoint.next_write < self._oldest:
            self._checkpoint = None  # of a time before
        if self._checkpoint is None and self._expected and (self._question is None or self._question.is_over):
            self._question = self._session.query(self._key)

    def _is_due(self) -> bool:
        """Whether everything before the checkpoint has come."""
        found, last = self._checkpoint, self._waiting[-1] if self._waiting else None
        return (
            found is not None
            and isinstance(last, Written)
            and last.next_write >= found.next_write
            and last.ticks >= found.tick
        )

    def _begin(self) -> Iterator[Tick | Write | Checkpoint]:
        found, waiting = self._checkpoint, self._waiting
        assert found is not None and isinstance(waiting[-1], Written)
        self._waiting = []
        for event in waiting:
            if not self._begun and _is_behind(event, found):
                yield found
                self._begun = True
            yield from self._pass_on(event)
        if not self._begun:
            yield found
            self._begun = True
        self.first, self.last = found.tick, waiting[-1].ticks - 1

    def _pass_on(self, event: Event | None) -> Iterator[Tick | Write]:
        if isinstance(event, Tick) or (isinstance(event, Write) and self.reproduces):
            yield event


def _is_behind(event: Event, checkpoint: Checkpoint) -> bool:
    if isinstance(event, Write):
        return event.number >= checkpoint.next_write
    return (event.ticks - 1 if isinstance(event, Written) else event.tick) >= checkpoint.tick
