# SPDX-License-Identifier: Apache-2.0
"""The stream: server-sent events with a summary of all runs, and the new values of one."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable, Iterator
from typing import Any, Protocol

import anyio
from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from .http_error import HttpError
from .limits import STREAM_PERIOD_S, STREAM_STALL_S, STREAMS, SUMMARY_PERIOD_S
from .value_feed import ValueFeed

#: Where a request's state has its Connection.
CONNECTION = "connection"


class Connection(Protocol):
    """The connection of a stream."""

    def begin_stream(self) -> None: ...
    def drop(self) -> None: ...


class Streams:
    """All open streams, and what they share. Used on the event loop only."""

    def __init__(self, summarise: Callable[[], Any]):
        """`summarise` returns what to say of all runs; it is called on a thread, while there are streams."""
        self.open = 0
        #: Since the start: streams whose readers took nothing.
        self.dropped = 0
        self.threads = anyio.CapacityLimiter(STREAMS + 1)
        self._summarise = summarise
        self._begun = -SUMMARY_PERIOD_S
        self._refreshing: asyncio.Task[None] | None = None
        self._summary: tuple[int, bytes] = (0, b"")

    @contextlib.contextmanager
    def one(self) -> Iterator[None]:
        """While a stream is open. Raises HttpError if there can be no other."""
        if self.open >= STREAMS:
            raise HttpError(503, "too_many_clients", f"{STREAMS} streams at a time, and all are in use", "close a page")
        self.open += 1
        try:
            yield
        finally:
            self.open -= 1

    def newer_summary(self, known: int) -> tuple[int, bytes]:
        """Number and JSON of the newest summary, empty if `known` is its number. Begins the next one when it is due."""
        now = time.monotonic()
        if (self._refreshing is None or self._refreshing.done()) and now - self._begun >= SUMMARY_PERIOD_S:
            if now - self._begun > 2 * SUMMARY_PERIOD_S:  # nobody has asked for a while
                self._summary = (self._summary[0], b"")
            self._begun = now
            self._refreshing = asyncio.create_task(self._refresh())
        number, text = self._summary
        return number, b"" if number == known else text

    async def _refresh(self) -> None:
        found = await anyio.to_thread.run_sync(self._summarise, limiter=self.threads, abandon_on_cancel=True)
        self._summary = (self._summary[0] + 1, json.dumps(found, separators=(",", ":")).encode())


class EventStream(StreamingResponse):
    """A stream without end, refused if there are too many.

    A reader that is slow gets fewer updates; one that takes nothing is dropped.
    """

    media_type = "text/event-stream"

    def __init__(self, streams: Streams, connection: Connection, feed: ValueFeed | None):
        """`feed`: the run whose values are sent, if any."""
        super().__init__(self._events())
        self._streams, self._connection, self._feed = streams, connection, feed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        with self._streams.one():
            self._connection.begin_stream()
            await super().__call__(scope, receive, send)

    async def stream_response(self, send: Send) -> None:
        async def send_in_time(message: Any) -> None:
            async with asyncio.timeout(STREAM_STALL_S):
                await send(message)

        try:
            await super().stream_response(send_in_time)
        except TimeoutError:
            self._streams.dropped += 1
            self._connection.drop()

    async def _events(self) -> AsyncIterator[bytes]:
        known, due = 0, time.monotonic()
        while True:
            known, summary = self._streams.newer_summary(known)
            if summary:
                yield _event("runs", summary)
            if self._feed is not None:
                try:
                    update = await anyio.to_thread.run_sync(self._feed.update, limiter=self._streams.threads)
                except HttpError as error:
                    yield _event("error", json.dumps(error.as_json()["error"]).encode())
                    return
                if update is not None:
                    yield _event("values", update)
            now = time.monotonic()
            due = due + STREAM_PERIOD_S if now < due + 2 * STREAM_PERIOD_S else now  # a slow reader's are left out
            await asyncio.sleep(max(0.0, due - now))


def _event(name: str, data: bytes) -> bytes:
    """`data` is JSON, so it has no line breaks."""
    return b"event: " + name.encode() + b"\ndata: " + data + b"\n\n"
