# SPDX-License-Identifier: Apache-2.0
"""Finished messages on their way to the ROS graph: native code puts them into a publish queue, this file publishes them."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

from rclpy.publisher import Publisher

from simclient.ros.publish_queue import PublishQueue

_T = TypeVar("_T")


class QueuePublisher:
    """Everything runs in the thread that calls it. lossless: native code waits for room rather than drop a message."""

    def __init__(self, lossless: bool):
        self.queue = PublishQueue(lossless)
        self._publish: list[Callable[[bytes], Any]] = []

    def add(self, publisher: Publisher, seen: Callable[[bytes], None] | None = None) -> int:
        """The number of the publisher's topic in the publish queue. `seen` gets each of its messages, too."""

        def publish(data: bytes) -> None:
            publisher.publish(data)
            if seen is not None:
                seen(data)

        self._publish.append(publisher.publish if seen is None else publish)
        return len(self._publish) - 1

    def some(self, wait: bool) -> bool:
        """Publishes some of the messages that are there; whether there were any. wait: a moment, where there are none."""
        found = False
        for topic, data in self.queue.take(wait):
            self._publish[topic](data)
            found = True
        return found

    def all(self) -> None:
        """Publishes all messages; nobody may put one meanwhile."""
        while self.some(wait=False):
            pass

    def close(self) -> None:
        self.queue.close()


class NativeThread:
    """Makes native calls in a thread of its own, one at a time, and publishes meanwhile what they put into the publish queue."""

    def __init__(self, queue_publisher: QueuePublisher):
        self._queue_publisher = queue_publisher
        self._pool = ThreadPoolExecutor(1)

    def __call__(self, call: Callable[..., _T], *arguments: Any) -> _T:
        """Returns or raises what the call does."""
        future: Future[_T] = self._pool.submit(call, *arguments)
        future.add_done_callback(lambda _: self._queue_publisher.queue.wake())
        try:
            while not future.done():
                self._queue_publisher.some(wait=True)
        finally:
            while not future.done():  # publishing failed, and the call may wait for room
                list(self._queue_publisher.queue.take(wait=True))
        return future.result()

    def close(self) -> None:
        self._pool.shutdown()
