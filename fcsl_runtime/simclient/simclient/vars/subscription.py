# SPDX-License-Identifier: Apache-2.0
"""Subscription: samples of a variable server by path, in order of arrival (VarClient.subscribe)."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple, Self

if TYPE_CHECKING:
    from .binary_sample import Layout
    from .client import VarClient

#: Samples buffered until they are read; beyond it the oldest are lost, and counted.
_KEPT = 100_000


class Sample(NamedTuple):
    """Values after one tick. `tick` counts completed ticks; `time_ns` is in ns of the server's monotonic clock."""

    tick: int
    time_ns: int
    #: Samples lost since the subscription began.
    lost: int
    values: dict[str, Any]


class Subscription:
    """An iterator over samples that ends only with `close` or a VarError."""

    def __init__(
        self, client: VarClient, number: int, types: Mapping[str, str], now: Mapping[str, Any], machine: dict[str, Any]
    ):
        self._client, self._number = client, number
        self._samples: deque[Sample] = deque()
        self._dropped = 0
        self._open = True
        self._fields: list[Layout] = []
        if machine:
            from .binary_sample import Layout  # here: most commands of fcsl var read no samples

            self._fields = [Layout(path, kind, now[path], machine) for path, kind in types.items()]

    def close(self) -> None:
        """Ends the subscription; received samples can still be read. Idempotent."""
        if self._open:
            self._open = False
            self._client._unsubscribe(self._number)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __iter__(self) -> Iterator[Sample]:
        return self

    def __next__(self) -> Sample:
        """Waits for the next sample."""
        if not self._samples and not self._open:
            raise StopIteration
        sample = self.read(None)
        assert sample is not None
        return sample

    def read(self, timeout_s: float | None) -> Sample | None:
        """The next sample; None if none arrives within `timeout_s` (None: no limit)."""
        if not self._samples and (not self._open or not self._client._wait_for_sample(self, timeout_s)):
            return None
        return self._samples.popleft()

    # ---- for the client -----------------------------------------------------------------------------------------------

    def waiting(self) -> int:
        """Number of samples that can be read without waiting."""
        return len(self._samples)

    def put(self, sample: Sample) -> None:
        if len(self._samples) == _KEPT:
            self._samples.popleft()
            self._dropped += 1
        self._samples.append(sample._replace(lost=sample.lost + self._dropped))

    def unpack(self, payload: bytes) -> dict[str, Any]:
        """The values of a binary sample: the scalars of every path, little-endian, concatenated."""
        values, at = {}, 0
        for field in self._fields:
            values[field.path] = field.read(payload, at)
            at += field.size
        return values
