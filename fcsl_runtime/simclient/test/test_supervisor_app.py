# SPDX-License-Identifier: Apache-2.0
"""The supervisor's routes, without a network: what requests say, and that those which wait keep nobody else waiting."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator

import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.types import Message, Scope

from simclient.supervisor import request_parameters
from simclient.supervisor.app import make_app
from simclient.supervisor.guard import Guard
from simclient.supervisor.http_error import HttpError
from simclient.supervisor.limits import BODY_BYTES, CONNECTIONS

_PATIENCE_S = 20.0
#: More at once than there are threads for what waits for nothing long, and so many that one connection is left.
_MANY = CONNECTIONS - 1


class Slow:
    """Runs that take so long to start and to end as `go` says; `waiting` counts those that do."""

    def __init__(self) -> None:
        self.waiting, self.go = threading.Semaphore(0), threading.Event()

    def all(self) -> list[object]:
        return []

    def start(self, wanted: object) -> None:
        self.stop()

    def get(self, name: str) -> Slow:
        return self

    def stop(self) -> None:
        self.waiting.release()
        self.go.wait()
        raise HttpError(504, "timeout", "it has waited")


@contextlib.asynccontextmanager
async def nothing(_: Starlette) -> AsyncIterator[None]:
    yield


async def status_of(app: Starlette, method: str, path: str, body: bytes = b"") -> int:
    headers = [(b"host", b"localhost:7700"), (b"content-type", b"application/json")]
    scope: Scope = {
        "type": "http", "http_version": "1.1", "method": method, "scheme": "http", "path": path,
        "raw_path": path.encode(), "query_string": b"", "root_path": "", "headers": headers,
        "server": ("127.0.0.1", 7700), "client": ("127.0.0.1", 1),
    }  # fmt: skip
    sent: list[Message] = []

    async def receive() -> Message:
        return {"type": "http.request", "body": body}

    async def send(message: Message) -> None:
        sent.append(message)

    await app(scope, receive, send)
    return int(sent[0]["status"])


@pytest.mark.parametrize(("method", "path"), [("POST", "/runs"), ("DELETE", "/runs/1")])
def test_starts_and_ends_keep_no_other_request_waiting(method: str, path: str) -> None:
    runs = Slow()

    async def ask() -> None:
        app = make_app(runs, Guard("127.0.0.1", 7700, ""), nothing)  # type: ignore[arg-type]
        asking = [asyncio.create_task(status_of(app, method, path, b"{}")) for _ in range(_MANY)]
        try:
            loop = asyncio.get_running_loop()
            for _ in range(_MANY):
                assert await loop.run_in_executor(None, runs.waiting.acquire, True, _PATIENCE_S)
            assert await asyncio.wait_for(status_of(app, "GET", "/health"), _PATIENCE_S) == 200
        finally:
            runs.go.set()
        assert await asyncio.gather(*asking) == [504] * _MANY

    asyncio.run(ask())


def request(length: bytes, body: bytes) -> Request:
    async def receive() -> Message:
        return {"type": "http.request", "body": body}

    return Request({"type": "http", "headers": [(b"content-length", length)]}, receive)


@pytest.mark.parametrize("length", ["\xb2", "1\xb3", "", "-1", str(BODY_BYTES)])
def test_a_length_that_is_none_is_not_read(length: str) -> None:
    assert asyncio.run(request_parameters.body(request(length.encode("latin-1"), b"{}"))) == b"{}"


@pytest.mark.parametrize("length", [BODY_BYTES + 1, 10**40])
def test_a_length_that_is_too_large_is_refused(length: int) -> None:
    with pytest.raises(HttpError, match="at most"):
        asyncio.run(request_parameters.body(request(str(length).encode(), b"{}")))
