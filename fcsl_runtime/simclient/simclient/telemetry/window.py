# SPDX-License-Identifier: Apache-2.0
"""Window: values of some channels at the last received ticks, as NumPy columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..twin.trace import Array, Columns, fields_at, merged, value_offsets
from .configuration import HEAD, Configuration
from .ring import Ring

_HEAD = np.dtype([("tick", "<u8"), ("time_ns", "<i8"), ("overwritten", "<u8")])
assert _HEAD.itemsize == HEAD.size


class Window(Columns):
    """A copy, which later packets do not change. It has a row for each received packet, in sending order.

    Lost ticks have no row, so `tick` has gaps there. `window[path]` is a column as in a Trace: of shape
    (rows, *shape of the field); healths, requests and states are texts.
    """

    def __init__(self, configuration: Configuration, ring: Ring, session: int, sequences: Array, paths: Sequence[str]):
        fields = fields_at(configuration.machine, paths)
        ranges = merged(fields)
        rows = sequences % ring.rows
        parts = [ring.raw[rows, offset : offset + size] for offset, size in ranges]
        super().__init__(
            configuration.machine,
            value_offsets(fields, ranges),
            sum(size for _, size in ranges),
            np.concatenate(parts, axis=1).tobytes(),
        )
        self._head: Array = ring.raw[rows, : HEAD.size].view(_HEAD).reshape(-1)
        #: The sender's configuration for these rows.
        self.configuration = configuration
        #: The session number of these rows.
        self.session = session
        #: Sequence number of each row's packet (i64), consecutive if no packet was lost.
        self.sequence = sequences

    @property
    def tick(self) -> Array:
        """The tick of each row (i64). It rises, except where a checkpoint was restored."""
        return self._head["tick"].astype(np.int64)

    @property
    def time_ns(self) -> Array:
        """The machine's time at each row, ns (i64)."""
        return self._head["time_ns"].copy()

    @property
    def time_s(self) -> Array:
        """The machine's time at each row, s (f64)."""
        return self._head["time_ns"] / 1e9
