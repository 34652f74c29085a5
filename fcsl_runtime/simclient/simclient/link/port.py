# SPDX-License-Identifier: Apache-2.0
"""One port of a link (docs/reference/transports.md): what waits to be sent, and what arrived."""

from __future__ import annotations

import enum
from collections import Counter, deque

from .frame import PAYLOAD_MAX, Flag, Frame, Kind

WINDOW, QUEUE = 16, 128
MESSAGE_MAX = 16380
#: A latest or sequenced frame less than this far behind the newest one is late, any other is new.
LATE = 64
#: Messages that wait for the host; a reliable port takes no more until it has read.
INBOX = 1024


class Full(Exception):
    """The port's queue has no room for the message now."""


class Policy(enum.Enum):
    LATEST = Kind.LATEST
    SEQUENCED = Kind.SEQUENCED
    RELIABLE = Kind.DATA


class Port:
    """Sequence numbers are modulo 65536; `counters` has the names of the C implementation's counters."""

    def __init__(self, policy: Policy):
        self.policy = policy
        self.counters: Counter[str] = Counter()
        self.inbox: deque[bytes] = deque()
        self._waiting: deque[tuple[Flag, bytes]] = deque()
        self._first_sequence = 0  # of the first frame that waits
        self._confirmed = self._sent = self._sent_max = self._due = self._ticks = 0
        self._session = self._sequence = 0
        self._part: list[bytes] | None = None
        self._skipping = False
        self.answer_soon = self.answer_now = False

    @property
    def reliable(self) -> bool:
        return self.policy is Policy.RELIABLE

    @property
    def expected(self) -> int:
        """Of a reliable port: the number of the frame that it takes next."""
        return self._sequence

    # ---- sending ---------------------------------------------------------------------------------------------

    def put(self, message: bytes) -> None:
        """Raises ValueError for a message that never fits, and Full."""
        parts = [message[i : i + PAYLOAD_MAX] for i in range(0, len(message), PAYLOAD_MAX)] or [b""]
        if len(message) > MESSAGE_MAX or len(parts) > (QUEUE if self.reliable else 1):
            raise ValueError(f"a message of {len(message)} bytes is too large for this port")
        if self.policy is Policy.LATEST:
            self.counters["replaced"] += len(self._waiting)
            self._waiting.clear()
        if len(self._waiting) + len(parts) > QUEUE:
            raise Full
        for number, part in enumerate(parts):
            last = Flag.LAST if number == len(parts) - 1 else Flag.NONE
            self._waiting.append((last if number else last | Flag.FIRST, part))
        self.counters["sent"] += 1

    def tick(self, retransmit_ticks: int) -> None:
        self.answer_now, self.answer_soon = self.answer_now or self.answer_soon, False
        self._due = len(self._waiting)
        if not self.reliable:
            return
        self._due = min(self._due, self._confirmed + WINDOW)
        self._ticks = self._ticks + 1 if self._sent_max > self._confirmed else 0
        if self._ticks >= retransmit_ticks:
            self._ticks, self._sent = 0, self._confirmed

    def next_frame(self, number: int, session: int, peer: int) -> Frame | None:
        """The next frame that is due on this port, `number`."""
        if self.reliable and not peer:
            return None
        to, acknowledge = (peer, self._sequence) if self.reliable else (0, 0)
        if self._sent >= self._due or not self._waiting:
            if not self.answer_now:
                return None
            self.answer_now = False
            return Frame(Kind.ACKNOWLEDGEMENT, session, 0, to, acknowledge, number)
        self.answer_now = self.answer_soon = False
        flags, part = self._waiting[self._sent]
        sequence = (self._first_sequence + self._sent) % 65536
        self.counters["frames_sent"] += 1
        if self.reliable:
            self.counters["frames_repeated"] += self._sent < self._sent_max
            self._sent += 1
            self._sent_max = max(self._sent, self._sent_max)
        else:
            flags = Flag.NONE
            self._pop(1)
        return Frame(self.policy.value, session, sequence, to, acknowledge, number, flags, part)

    def _pop(self, count: int) -> None:
        for _ in range(count):
            self._waiting.popleft()
        self._first_sequence = (self._first_sequence + count) % 65536
        self._due = max(0, self._due - count)

    def confirm(self, acknowledge: int) -> None:
        """The peer takes frame `acknowledge` next."""
        more = (acknowledge - self._first_sequence - self._confirmed) % 65536
        if not 0 < more <= self._sent_max - self._confirmed:
            return
        self._confirmed += more
        self._sent = max(self._sent, self._confirmed)
        self._ticks = 0
        ends = [i for i in range(self._confirmed) if Flag.LAST in self._waiting[i][0]]
        done = ends[-1] + 1 if ends else 0
        self._pop(done)
        self._confirmed, self._sent, self._sent_max = (n - done for n in (self._confirmed, self._sent, self._sent_max))

    def restart(self) -> None:
        """The peer is a new one."""
        self._first_sequence = self._confirmed = self._sent = self._sent_max = self._due = self._ticks = 0
        self._sequence, self._part, self._skipping = 0, None, False
        self.answer_soon = self.answer_now = False

    # ---- receiving -------------------------------------------------------------------------------------------

    def take_message(self, frame: Frame) -> None:
        """A frame of a latest or sequenced port."""
        if frame.session == self._session:
            ahead = (frame.sequence - self._sequence) % 65536
            if ahead == 0 or ahead > 65536 - LATE:
                self.counters["late"] += 1
                return
            self.counters["lost"] += ahead - 1
        self._session, self._sequence = frame.session, frame.sequence
        if self.policy is Policy.LATEST:
            self.counters["replaced"] += len(self.inbox)
            self.inbox.clear()
        if len(self.inbox) == INBOX:
            self.counters["no_room"] += 1
            return
        self.inbox.append(frame.payload)
        self.counters["received"] += 1

    def take_data(self, frame: Frame) -> bool:
        """A data frame of the peer. False for a fragment that does not follow the one before it."""
        self.answer_soon = True
        if frame.sequence != self._sequence:
            self.counters["late"] += 1
            return True
        if len(self.inbox) == INBOX:
            self.counters["no_room"] += 1
            return True
        self._sequence = (self._sequence + 1) % 65536
        first = Flag.FIRST in frame.flags
        sound = first != (self._part is not None or self._skipping)
        if not sound:
            self._part, self._skipping = None, True
        elif first:
            self._part = []
        if self._part is not None:
            self._part.append(frame.payload)
        if Flag.LAST in frame.flags:
            if self._part is not None:
                self.inbox.append(b"".join(self._part))
                self.counters["received"] += 1
            self._part, self._skipping = None, False
        return sound
