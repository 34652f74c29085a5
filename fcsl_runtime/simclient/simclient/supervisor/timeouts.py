# SPDX-License-Identifier: Apache-2.0
"""A connection carries one request, and is closed when it exceeds its time limit, whatever the client does."""

from __future__ import annotations

import asyncio

from uvicorn.protocols.http.h11_impl import H11Protocol

from .app import bad_head, too_many
from .limits import CONNECTION_S, CONNECTIONS, HEAD_S


class TimedProtocol(H11Protocol):
    """HTTP on a socket. uvicorn alone sets no time limit for receiving a request or sending a response."""

    _limits: tuple[asyncio.TimerHandle, ...] = ()

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if len(self.connections) > CONNECTIONS:
            self.app = too_many
        if len(self.connections) > 2 * CONNECTIONS:
            transport.abort()
        self._limits = (
            self.loop.call_later(HEAD_S, self._expect_head),
            self.loop.call_later(CONNECTION_S, transport.abort),
        )

    def connection_lost(self, exc: Exception | None) -> None:
        for limit in self._limits:
            limit.cancel()
        super().connection_lost(exc)

    def send_400_response(self, msg: str) -> None:
        self.transport.write(bad_head(msg))
        self.transport.close()

    def _expect_head(self) -> None:
        if not self.cycle:
            self.transport.abort()
