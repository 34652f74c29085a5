# SPDX-License-Identifier: Apache-2.0
"""Python wrapper of fcsl_publish_queue.h and fcsl_topics.h: finished messages from the thread that steps, for one that publishes."""

from __future__ import annotations

import ctypes
import struct
from collections.abc import Iterator
from ctypes import byref

from ..c_machine import DIRECTION_NAMES
from ..c_run import CError
from ..errors import TwinError
from ..run import TICK_MESSAGES, Run
from . import native
from .composer import Composer

#: FCSL_PUBLISH_QUEUE_TAKE_MAX
_TAKE_BYTES = 4 << 20
#: Topic and size of a message; messages begin at multiples of 8 bytes.
_HEAD = struct.Struct("<II")
_ALIGNMENT = 8


class PublishQueue:
    """The queue. One thread puts, in C; another one takes. A context manager."""

    def __init__(self, lossless: bool):
        """lossless: who puts waits for room; otherwise what finds none is dropped."""
        error = CError()
        self._library = native.library()
        self._handle = self._library.fcsl_publish_queue_new(int(lossless), byref(error))
        if not self._handle:
            raise TwinError(error.text.decode("utf-8", "replace"))
        self._bytes = ctypes.create_string_buffer(_TAKE_BYTES)

    @property
    def handle(self) -> int:
        """The fcsl_publish_queue_t."""
        return int(self._handle)

    def take(self, wait: bool) -> Iterator[tuple[int, bytes]]:
        """(topic, CDR) of some of the messages, oldest first. wait: a moment, where there is none."""
        size = self._library.fcsl_publish_queue_take(self._handle, int(wait), self._bytes)
        data = ctypes.string_at(self._bytes, size)
        at = 0
        while at < size:
            topic, length = _HEAD.unpack_from(data, at)
            at += _HEAD.size
            yield topic, data[at : at + length]
            at += (length + _ALIGNMENT - 1) // _ALIGNMENT * _ALIGNMENT

    def wake(self) -> None:
        """Ends the moment that `take` waits; from any thread."""
        self._library.fcsl_publish_queue_wake(self._handle)

    @property
    def dropped(self) -> int:
        """Messages that found no room."""
        return int(self._library.fcsl_publish_queue_dropped(self._handle))

    def close(self) -> None:
        """Frees it; nobody may put or take any more. Idempotent."""
        if self._handle:
            self._library.fcsl_publish_queue_free(self._handle)
            self._handle = None


class RunTopics:
    """The topics of a run. `topic` is a number by which the publish queue's reader knows it. Everything is added before the first
    tick. Raises TwinError."""

    def __init__(self, run: Run, queue: PublishQueue):
        self._library, self._error = native.library(), CError()
        self._kept: list[object] = [run, queue]
        self._handle = self._library.fcsl_topics_new(run.handle(), queue.handle, byref(self._error))
        if not self._handle:
            raise TwinError(self._error.text.decode("utf-8", "replace"))

    @property
    def handle(self) -> int:
        """The fcsl_topics_t."""
        return int(self._handle)

    def _check(self, status: int) -> None:
        if status < 0:
            raise TwinError(self._error.text.decode("utf-8", "replace"))

    def add_instance(self, topic: int, instance: int, every: int) -> None:
        """The generated message of instance number `instance`, of each `every`-th tick."""
        self._check(self._library.fcsl_topics_add_instance(self._handle, topic, instance, every, byref(self._error)))

    def add_tick_message(self, topic: int, what: str) -> None:
        """`state`, `health`, `faults` (where they changed), or `transitions`."""
        number = TICK_MESSAGES[what]
        self._check(self._library.fcsl_topics_add_tick_message(self._handle, topic, number, byref(self._error)))

    def add_events(self, topic: int) -> None:
        """What the algorithms report from now on (fcsl_msgs/Event)."""
        self._check(self._library.fcsl_topics_add_events(self._handle, topic, byref(self._error)))

    def add_channels(self, topic: int, direction: str, composer: Composer) -> None:
        """A message of "actuator" or "report" channels, each tick."""
        self._kept.append(composer)
        self._check(
            self._library.fcsl_topics_add_channels(
                self._handle,
                topic,
                DIRECTION_NAMES.index(direction),
                composer.handle,
                composer.size,
                byref(self._error),
            )
        )

    def put(self, stamp_ns: int) -> None:
        """Puts what the last completed tick shows into the publish queue."""
        self._library.fcsl_topics_put(self._handle, stamp_ns)

    def put_changes(self, stamp_ns: int) -> None:
        """The same of state, health and faults alone."""
        self._library.fcsl_topics_put_changes(self._handle, stamp_ns)

    def refused(self, topic: int) -> int:
        """Messages that were not made, because a value does not fit its field."""
        return int(self._library.fcsl_topics_refused(self._handle, topic))

    def close(self) -> None:
        """Frees it; before its run and its publish queue. Idempotent."""
        if self._handle:
            self._library.fcsl_topics_free(self._handle)
            self._handle = None
