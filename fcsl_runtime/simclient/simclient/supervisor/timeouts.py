# SPDX-License-Identifier: Apache-2.0
"""A connection carries one request, and is closed when it exceeds its time limit, whatever the client does.

A stream has no end. It is closed when its reader takes nothing, and when the supervisor ends.
"""

from __future__ import annotations

import asyncio
import socket

from uvicorn.protocols.http.h11_impl import H11Protocol

from .app import bad_head, too_many
from .limits import CONNECTION_S, CONNECTIONS, HEAD_S, STREAM_SEND_BYTES
from .stream import CONNECTION


class TimedProtocol(H11Protocol):
    """HTTP on a socket. uvicorn alone sets no time limit for receiving a request or sending a response."""

    _limits: tuple[asyncio.TimerHandle, ...] = ()
    _streams = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > CONNECTIONS:
            self.app = too_many
        if len(self.connections) > 2 * CONNECTIONS:
            transport.abort()
        self.app_state = {**self.app_state, CONNECTION: self}
        self._limits = (
            self.loop.call_later(HEAD_S, self._expect_head),
            self.loop.call_later(CONNECTION_S, transport.abort),
        )

    def connection_lost(self, exc: Exception | None) -> None:
        for limit in self._limits:
            limit.cancel()
        super().connection_lost(exc)

    def begin_stream(self) -> None:
        """Lifts the limit for the response. A write then waits until the kernel has taken the one before."""
        if self.transport.is_closing():  # the client has left
            return
        self._streams = True
        for limit in self._limits:
            limit.cancel()
        # Whatever lies in buffers is old when it is read.
        self.transport.get_extra_info("socket").setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, STREAM_SEND_BYTES)
        self.transport.set_write_buffer_limits(high=0)

    def drop(self) -> None:
        """Closes the connection at once, whatever was not read."""
        self.transport.abort()

    def shutdown(self) -> None:
        super().shutdown()
        if self._streams:
            self.drop()

    def send_400_response(self, msg: str) -> None:
        self.transport.write(bad_head(msg))
        self.transport.close()

    def _expect_head(self) -> None:
        if not self.cycle:
            self.transport.abort()
