# SPDX-License-Identifier: Apache-2.0
"""Ring buffer of the window: the newest data bodies, indexed by sequence number."""

from __future__ import annotations

from array import array
from typing import Any

import numpy as np

from .limits import WINDOW_BYTES_MAX

Array = np.ndarray[Any, Any]


class Ring:
    """Memory is allocated once, and mapped when rows are written. Row s % rows holds the body of sequence s."""

    def __init__(self, rows: int, body_bytes: int):
        self.rows = max(1, min(rows, WINDOW_BYTES_MAX // body_bytes))
        #: Sequence numbers: the lowest received in this ring, and the highest.
        self.oldest = self.newest = -1
        self._body_bytes = body_bytes
        self.raw: Array = np.zeros((self.rows, body_bytes), np.uint8)
        self._flat = self.raw.reshape(-1).data
        self._sequences = array("q", [-1]) * self.rows

    @property
    def used_bytes(self) -> int:
        """Size of the rows from the oldest packet to the newest."""
        return min(self.newest - self.oldest + 1, self.rows) * self._body_bytes if self.newest >= 0 else 0

    def too_old(self, sequence: int) -> bool:
        """Whether its row belongs to a newer packet."""
        return sequence <= self.newest - self.rows

    def has(self, sequence: int) -> bool:
        """Whether the row is present; `sequence` must not be too old."""
        return self._sequences[sequence % self.rows] == sequence

    def put(self, sequence: int, body: bytes) -> None:
        """Stores a row; `sequence` must not be too old, and `body` must have the right size."""
        row = sequence % self.rows
        at = row * self._body_bytes
        self._flat[at : at + self._body_bytes] = body
        self._sequences[row] = sequence
        if sequence < self.oldest or self.newest < 0:
            self.oldest = sequence
        if sequence > self.newest:
            self.newest = sequence

    def row(self, sequence: int) -> bytes:
        at = sequence % self.rows * self._body_bytes
        return bytes(self._flat[at : at + self._body_bytes])

    def held(self, count: int | None = None, after: int = -1) -> Array:
        """The last `count` (None: all) sequence numbers with a row, rising, that are greater than `after`."""
        first = max(self.newest - self.rows + 1, after + 1, self.oldest, 0)
        sequences = np.arange(first, self.newest + 1)
        found = sequences[np.frombuffer(self._sequences, np.int64)[sequences % self.rows] == sequences]
        return found if count is None else found[max(0, len(found) - count) :]
