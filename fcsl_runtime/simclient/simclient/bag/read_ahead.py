# SPDX-License-Identifier: Apache-2.0
"""Reads ahead: an iterator goes on in a thread of its own while its items are used."""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable, Generator, Iterator
from typing import Generic, TypeVar

T = TypeVar("T")

#: Bytes of items that wait at most, and the one that is being made.
_AHEAD_BYTES = 16 << 20


class _Reader(threading.Thread, Generic[T]):
    """Takes items from an iterator until they are `_AHEAD_BYTES`; goes on as they are taken away."""

    def __init__(self, items: Iterator[T], size: Callable[[T], int]):
        super().__init__(name="read ahead", daemon=True)
        self._items, self._size = items, size
        self._changed = threading.Condition()
        self._waiting: deque[T] = deque()
        self._bytes = 0
        self._ended = False
        self._failure: BaseException | None = None

    def run(self) -> None:
        try:
            for item in self._items:
                with self._changed:
                    self._waiting.append(item)
                    self._bytes += self._size(item)
                    self._changed.notify()
                    self._changed.wait_for(lambda: self._bytes < _AHEAD_BYTES or self._ended)
                    if self._ended:
                        return
        except BaseException as error:  # noqa: BLE001  whoever takes the items gets it
            self._failure = error
        finally:
            with self._changed:
                self._ended = True
                self._changed.notify()

    def take(self) -> Iterator[T]:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._waiting or self._ended)
                if not self._waiting:
                    break
                item = self._waiting.popleft()
                self._bytes -= self._size(item)
                self._changed.notify()
            yield item
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self.join()


def ahead(items: Iterator[T], size: Callable[[T], int]) -> Generator[T, None, None]:
    """The same items. Those behind the first are made in another thread, until `size` of those that wait is some MiB."""
    first = next(items, None)
    if first is None:
        return
    reader = _Reader(items, size)
    reader.start()
    try:
        yield first
        yield from reader.take()
    finally:
        reader.stop()
