# SPDX-License-Identifier: Apache-2.0
"""Stream: the data packets of the shown session."""

from __future__ import annotations

from .assembly import Assemblies, Piece
from .configuration import HEAD, Configuration
from .counts import Counts
from .datagram import Datagram
from .limits import PARTIAL_BYTES_MAX, PARTIAL_MAX
from .ring import Ring

#: Identifies a sender's start and its configuration: (session, configuration).
Key = tuple[int, int]

#: Limits of ticks and times, which must fit NumPy's i64. A time plus the longest packet period (2^32 - 1 ticks at 1 Hz)
#: must fit, too. Negative times are invalid, because viewers may not accept them.
_TICK_MAX, _TIME_MAX = 2**63 - 1, 2**62


class Stream:
    """Stores data in the ring and counts. `counts` covers all sessions; `lost`, `incomplete` and `overwritten` cover this one.

    `lost` and `incomplete` may fall, when a packet arrives late.
    """

    def __init__(self, key: Key, configuration: Configuration, window_ticks: int, counts: Counts):
        self.key = key
        self.configuration = configuration
        self.ring = Ring(window_ticks, configuration.body_bytes)
        self._body_bytes = configuration.body_bytes
        self._partial = Assemblies[int](PARTIAL_MAX, PARTIAL_BYTES_MAX)
        self._counts = counts
        self._packets = 0
        #: Packets that were dropped incomplete, and their highest sequence: further datagrams of these or older ones
        #: are late.
        self._given_up, self._given_up_to = 0, -1

    def take(self, datagram: Datagram) -> None:
        """Processes a data datagram of this session and configuration."""
        sequence = datagram.sequence
        if datagram.total != self._body_bytes:
            self._counts.malformed += 1
        elif self.ring.too_old(sequence):
            self._counts.too_old += 1
        elif self.ring.has(sequence):
            self._counts.duplicated += 1
        elif datagram.stride >= datagram.total and sequence not in self._partial:
            self._counts.accepted += 1
            self._put(sequence, datagram.piece)
        else:
            self._assemble(datagram)

    @property
    def lost(self) -> int:
        return self.ring.newest - self.ring.oldest + 1 - self._packets if self._packets else 0

    @property
    def incomplete(self) -> int:
        return self._given_up + len(self._partial)

    @property
    def overwritten(self) -> int:
        """The number in the newest packet."""
        if not self._packets:
            return 0
        return int(HEAD.unpack_from(self.ring.row(self.ring.newest))[2])

    def _put(self, sequence: int, body: bytes) -> None:
        """Stores a complete packet, whose last datagram was counted as accepted."""
        counts = self._counts
        tick, time_ns, _ = HEAD.unpack_from(body)
        if tick > _TICK_MAX or not 0 <= time_ns <= _TIME_MAX:
            counts.accepted -= 1
            counts.malformed += 1
            return
        counts.packets += 1
        counts.reordered += sequence < self.ring.newest
        self._packets += 1
        self.ring.put(sequence, body)

    def _assemble(self, datagram: Datagram) -> None:
        """Adds a piece of a packet. Dropped packets, and older ones, are not begun again."""
        sequence = datagram.sequence
        if sequence not in self._partial and sequence <= self._given_up_to:
            self._counts.too_old += 1
            return
        piece = self._partial.add(sequence, datagram)
        if piece is Piece.CONTRADICTION:
            self._counts.malformed += 1
        elif piece is Piece.AGAIN:
            self._counts.duplicated += 1
        else:
            self._counts.accepted += 1
            body = self._partial.body(sequence)
            if body is not None:
                self._partial.drop(sequence)
                self._put(sequence, body)
            for other in self._partial.shrink():
                self._given_up += 1
                self._given_up_to = max(self._given_up_to, other)
