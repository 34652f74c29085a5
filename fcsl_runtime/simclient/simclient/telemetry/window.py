# SPDX-License-Identifier: Apache-2.0
"""Window: what some channels were at the last ticks that came, as columns of NumPy."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..twin.trace import Array, Columns, fields_at, merged, places
from .configuration import HEAD, Configuration
from .ring import Ring

_HEAD = np.dtype([("tick", "<u8"), ("time_ns", "<i8"), ("missed", "<u8")])
assert _HEAD.itemsize == HEAD.size


class Window(Columns):
    """A copy, which later packets leave alone. It has a row for each packet that came, in the order in which they were sent:
    rows of lost ones are absent, so `tick` has gaps there. `window[path]` is a column as a Trace has it: of shape
    (rows, *shape of the field), texts for healths, requests and states."""

    def __init__(self, configuration: Configuration, ring: Ring, session: int, sequences: Array, paths: Sequence[str]):
        fields = fields_at(configuration.machine, paths)
        ranges = merged(fields)
        rows = sequences % ring.rows
        parts = [ring.raw[rows, offset : offset + size] for offset, size in ranges]
        super().__init__(
            configuration.machine,
            places(fields, ranges),
            sum(size for _, size in ranges),
            np.concatenate(parts, axis=1).tobytes(),
        )
        self._head: Array = ring.raw[rows, : HEAD.size].view(_HEAD).reshape(-1)
        #: What the sender announced of these rows.
        self.configuration = configuration
        #: Of the sender's start that these rows are of.
        self.session = session
        #: The number of each row's packet (i64): 1 more from row to row where none was lost.
        self.sequence = sequences

    @property
    def tick(self) -> Array:
        """Of each row the tick that left it (i64). It rises, but where a checkpoint was restored."""
        return self._head["tick"].astype(np.int64)

    @property
    def time_ns(self) -> Array:
        """Of each row the machine's time, ns (i64)."""
        return self._head["time_ns"].copy()

    @property
    def time_s(self) -> Array:
        """Of each row the machine's time, s (f64)."""
        return self._head["time_ns"] / 1e9
