# SPDX-License-Identifier: Apache-2.0
"""Collector: selects the sender that is shown, and buffers data of other senders until one is selected.

Any sender may reach the port. So a session is shown only once its configuration is complete, and stays selected as long
as it sends; another takes over after a silence. A forged session can only use some of the buffer for senders that are
not shown.
"""

from __future__ import annotations

import zlib
from collections import deque
from dataclasses import replace

from .assembly import Assemblies, Piece
from .configuration import read_configuration
from .counts import Counts
from .datagram import CONFIGURATION, Datagram, parse
from .limits import FORMER_MAX, OFFER_BYTES_MAX, OFFERS_MAX, WAITING_BYTES_MAX, WAITING_MAX
from .stream import Key, Stream

#: A session is silent after four of its periods without a datagram, limited to this range in s.
_SILENT_S_MIN, _SILENT_S_MAX = 1.0, 10.0
_SILENT_PERIODS = 4


class Collector:
    """Processes datagrams; never raises. Not thread-safe."""

    def __init__(self, window_ticks: int):
        self.stream: Stream | None = None
        self._window_ticks = window_ticks
        self._counts = Counts()
        self._offers = Assemblies[Key](OFFERS_MAX, OFFER_BYTES_MAX)
        self._waiting: deque[Datagram] = deque()
        self._waiting_bytes = 0
        self._former: deque[int] = deque(maxlen=FORMER_MAX)
        self._received_s = 0.0

    def take(self, raw: bytes, now_s: float) -> None:
        """Processes a datagram; `now_s` is its time of arrival in s, on a monotonic clock."""
        counts = self._counts
        counts.received += 1
        datagram = parse(raw)
        if datagram is None:
            counts.malformed += 1
            return
        stream = self.stream
        if stream is None or (datagram.session, datagram.configuration) != stream.key:
            self._take_stranger(datagram, now_s)
            return
        self._received_s = now_s
        if datagram.kind == CONFIGURATION:
            counts.configurations += 1
        else:
            stream.take(datagram)

    def counts(self) -> Counts:
        """A copy of the current counts."""
        now = replace(self._counts, waiting=len(self._waiting))
        if self.stream is not None:
            now.lost += self.stream.lost
            now.incomplete += self.stream.incomplete
            now.overwritten += self.stream.overwritten
        return now

    # ---- other senders -----------------------------------------------------------------------------------------------

    def _take_stranger(self, datagram: Datagram, now_s: float) -> None:
        if datagram.kind == CONFIGURATION:
            self._offer(datagram)
        elif datagram.session in self._former:
            self._counts.other_session += 1
        else:
            self._wait(datagram)
        if self.stream is None or self._silent(self.stream, now_s):
            self._show((datagram.session, datagram.configuration), now_s)

    def _offer(self, datagram: Datagram) -> None:
        piece = self._offers.add((datagram.session, datagram.configuration), datagram)
        if piece is Piece.CONTRADICTION:
            self._counts.malformed += 1
        else:
            self._counts.configurations += 1
        for _ in self._offers.shrink():
            pass

    def _silent(self, stream: Stream, now_s: float) -> bool:
        limit_s = min(max(_SILENT_PERIODS * stream.configuration.period_s, _SILENT_S_MIN), _SILENT_S_MAX)
        return now_s - self._received_s > limit_s

    def _wait(self, datagram: Datagram) -> None:
        self._waiting.append(datagram)
        self._waiting_bytes += len(datagram.piece)
        while len(self._waiting) > WAITING_MAX or self._waiting_bytes > WAITING_BYTES_MAX:
            self._waiting_bytes -= len(self._waiting.popleft().piece)
            if self.stream is None:
                self._counts.before_configuration += 1
            else:
                self._counts.other_session += 1

    def _show(self, key: Key, now_s: float) -> None:
        """Begins a window for this sender, if its configuration is complete."""
        body = self._offers.body(key)
        if body is None:
            return
        self._offers.drop(key)
        configuration = read_configuration(body) if zlib.crc32(body) == key[1] else None
        if configuration is None:  # completed by the last datagram
            self._counts.configurations -= 1
            self._counts.malformed += 1
            return
        self._end_session()
        self.stream = Stream(key, configuration, self._window_ticks, self._counts)
        self._counts.sessions += 1
        self._received_s = now_s
        if key[0] in self._former:  # it was paused while another session was shown
            self._former.remove(key[0])
        waiting, self._waiting, self._waiting_bytes = self._waiting, deque(), 0
        for datagram in waiting:
            if (datagram.session, datagram.configuration) == key:
                self.stream.take(datagram)
            else:
                self._waiting.append(datagram)
                self._waiting_bytes += len(datagram.piece)

    def _end_session(self) -> None:
        """Ends the session; its missing packets stay counted."""
        if self.stream is None:
            return
        self._counts.lost += self.stream.lost
        self._counts.incomplete += self.stream.incomplete
        self._counts.overwritten += self.stream.overwritten
        self._former.append(self.stream.key[0])
