# SPDX-License-Identifier: Apache-2.0
"""The routes (docs/guide/monitoring.md). Blocking work runs on threads, never on the event loop."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager
from typing import Any

import anyio
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from ..errors import TwinError, ViewError
from ..vars.show import jsonable
from ..view.views import parse_views
from . import metrics, page, request_parameters, run_status
from .guard import Guard
from .http_error import HttpError
from .limits import CONNECTIONS, HEAD_BYTES
from .runs import STATUSES, Run, Runs
from .stream import CONNECTION, EventStream, Streams
from .value_feed import ValueFeed
from .windows import ARROW, channels, cut

#: On every answer. Pages of other origins can neither read nor embed one.
_HEADERS = (
    (b"x-content-type-options", b"nosniff"),
    (b"cache-control", b"no-store"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
)


class Json(Response):
    """JSON whose floats round-trip; NaN and infinities are strings."""

    media_type = request_parameters.JSON

    def render(self, content: Any) -> bytes:
        return json.dumps(jsonable(content), allow_nan=False, separators=(",", ":")).encode() + b"\n"


def make_app(runs: Runs, guard: Guard, lifespan: Callable[[Starlette], AbstractAsyncContextManager[None]]) -> Starlette:
    """The HTTP application of these runs, for clients that `guard` accepts."""
    on = _Routes(runs)
    return Starlette(
        routes=[
            *(Route(path, on.page) for path in page.FILES),
            Route("/health", on.health),
            Route("/metrics", on.metrics),
            Route("/runs", on.list),
            Route("/runs", on.start, methods=["POST"]),
            Route("/runs/{id}", on.show),
            Route("/runs/{id}", on.stop, methods=["DELETE"]),
            Route("/runs/{id}/health", on.run_health),
            Route("/runs/{id}/requirements", on.requirements),
            Route("/runs/{id}/times", on.times),
            Route("/runs/{id}/events", on.events),
            Route("/runs/{id}/channels", on.channels),
            Route("/runs/{id}/values", on.values),
            Route("/runs/{id}/windows", on.window),
            Route("/stream", on.stream),
        ],
        middleware=[Middleware(_Guarded, guard=guard)],
        exception_handlers={HttpError: _refused, HTTPException: _http_refused, Exception: _broken},
        lifespan=lifespan,
    )


class _Routes:
    """Handlers. Those that are not coroutines run on threads."""

    def __init__(self, runs: Runs):
        self._runs = runs
        self._begun = time.monotonic()
        #: Starts and stops wait for a long time, so they use separate threads and block no other request.
        self._waiting = anyio.CapacityLimiter(CONNECTIONS)
        self._streams = Streams(lambda: self._of_all(_summary))

    def page(self, request: Request) -> Response:
        request_parameters.query(request)
        return page.answer(request.url.path)

    def health(self, request: Request) -> Response:
        request_parameters.query(request)
        statuses = [run.status for run in self._runs.all()]
        counts = {status: statuses.count(status) for status in STATUSES}
        return Json({"ok": True, "uptime_s": round(time.monotonic() - self._begun, 3), "runs": counts})

    def metrics(self, request: Request) -> Response:
        request_parameters.query(request)
        found = metrics.text(self._of_all(metrics.see), self._streams)
        return Response(found, headers={"content-type": metrics.CONTENT_TYPE})

    def list(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json({"runs": [run.as_json() for run in self._runs.all()]})

    async def start(self, request: Request) -> Response:
        request_parameters.query(request)
        wanted = request_parameters.decoded(await request_parameters.body(request))
        run = await self._wait(lambda: self._runs.start(wanted))
        return Json(_described(run), 201, {"location": f"/runs/{run.name}"})

    def show(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json(_described(self._run(request)))

    async def stop(self, request: Request) -> Response:
        request_parameters.query(request)
        run = await self._wait(lambda: self._stopped(request))
        return Json(_described(run))

    def run_health(self, request: Request) -> Response:
        request_parameters.query(request)
        found = run_status.health(self._run(request))
        return Json(found, 200 if found["ok"] else 503)

    def requirements(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json(run_status.requirements(self._run(request)))

    def times(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json(run_status.times(self._run(request)))

    def events(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json(run_status.events(self._run(request)))

    def channels(self, request: Request) -> Response:
        request_parameters.query(request)
        return Json(channels(self._run(request).telemetry))

    def values(self, request: Request) -> Response:
        paths = request_parameters.paths(request_parameters.query(request, "path"))
        return Json(run_status.values(self._run(request), paths))

    def window(self, request: Request) -> Response:
        wants_arrow = request_parameters.wants_arrow(request.headers.get("accept", "*/*"))
        given = request_parameters.query(request, "path", "ticks")
        found = cut(self._run(request).telemetry, request_parameters.paths(given), request_parameters.ticks(given))
        return Response(found.as_arrow(), media_type=ARROW) if wants_arrow else Json(found.as_json())

    async def stream(self, request: Request) -> Response:
        name, paths, angles = request_parameters.stream(request_parameters.query(request, "run", "path", "angles"))
        feed = None if name is None else await anyio.to_thread.run_sync(self._feed, name, paths, angles)
        if request.method == "HEAD":
            return Response(media_type=EventStream.media_type)
        return EventStream(self._streams, request.scope["state"][CONNECTION], feed)

    def _feed(self, name: str, paths: Sequence[str], angles: Sequence[str]) -> ValueFeed:
        feed = ValueFeed(self._runs.get(name), paths, angles)
        feed.check()
        return feed

    def _run(self, request: Request) -> Run:
        return self._runs.get(request.path_params["id"])

    def _stopped(self, request: Request) -> Run:
        run = self._run(request)
        run.stop()
        return run

    async def _wait(self, act: Callable[[], Run]) -> Run:
        return await anyio.to_thread.run_sync(act, limiter=self._waiting)

    def _of_all(self, of_run: Callable[[Run], Any]) -> Any:
        """Queries all runs in parallel, so that several without an answer cost one timeout."""
        runs = self._runs.all()
        with ThreadPoolExecutor(max_workers=max(1, len(runs))) as askers:
            return [*askers.map(of_run, runs)]


class _Guarded:
    """Checks every request with the guard, and adds the common headers to every response."""

    def __init__(self, app: ASGIApp, guard: Guard):
        self._app, self._guard = app, guard

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return

        async def send_with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message["headers"], *_HEADERS]
            await send(message)

        try:
            _bound_head(scope)
            self._guard.check(scope["method"], _single(scope["headers"]), scope["path"] in page.FILES)
        except HttpError as error:
            await _answer(error)(scope, receive, send_with_headers)
            return
        await self._app(scope, receive, send_with_headers)


def _bound_head(scope: Scope) -> None:
    """Limits the size of a request's head; the HTTP server limits only heads that arrive in parts."""
    size = len(scope["raw_path"]) + len(scope["query_string"]) + sum(len(n) + len(v) for n, v in scope["headers"])
    if size > HEAD_BYTES:
        raise HttpError(431, "too_large", f"the head of a request has at most {HEAD_BYTES} bytes")


def _single(headers: Iterable[tuple[bytes, bytes]]) -> dict[str, str]:
    """One value of each header. Raises HttpError if a header that the guard checks is given twice."""
    found: dict[str, str] = {}
    for raw_name, value in headers:
        name = raw_name.decode("latin-1").lower()
        if name in found and name in ("host", "origin", "authorization", "content-type"):
            raise HttpError(400, "bad_request", f"header {name} is given twice")
        found[name] = value.decode("latin-1")
    return found


# ---- answers ----------------------------------------------------------------------------------------------------------


def _described(run: Run) -> dict[str, Any]:
    """A run with its log, its telemetry channels and its views."""
    log = run.child.log
    try:
        channels, views = list(run.telemetry.channels), _views(run.telemetry.machine.views)
    except TwinError:
        channels, views = [], None
    more = {"log": log.lines(), "log_lines_dropped": log.lines_dropped, "channels": channels, "views": views}
    return {**run.as_json(), **more}


def _views(text: str) -> dict[str, Any] | None:
    """The object that a text of views holds; None for no text, and for one that is not valid."""
    try:
        parse_views(text)
    except ViewError:
        return None
    found: dict[str, Any] = json.loads(text)
    return found


def _summary(run: Run) -> dict[str, Any]:
    """A run for the list of all: without what may be long. Never raises."""
    health = run_status.health(run)
    found = run.as_json()
    return {**{name: found[name] for name in ("id", "kind", "file", "status", "started", "exit")}, "health": health}


async def too_many(scope: Scope, receive: Receive, send: Send) -> None:
    """The application for connections beyond the limit."""
    error = HttpError(
        503, "too_many_clients", f"{CONNECTIONS} connections at a time, and all are in use", "try again later"
    )
    await _answer(error)(scope, receive, send)


def bad_head(message: str) -> bytes:
    """The complete answer to bytes that are not HTTP, which have no request object."""
    answer = _answer(HttpError(400, "bad_request", message))
    head = b"".join(name + b": " + value + b"\r\n" for name, value in answer.raw_headers)
    return b"HTTP/1.1 400 Bad Request\r\nconnection: close\r\n" + head + b"\r\n" + bytes(answer.body)


def _answer(error: HttpError) -> Response:
    headers = {"www-authenticate": "Bearer"} if error.status == 401 else None
    return Json(error.as_json(), error.status, headers)


async def _refused(request: Request, error: Exception) -> Response:
    assert isinstance(error, HttpError)
    return _answer(error)


async def _http_refused(request: Request, error: Exception) -> Response:
    """Errors of starlette: unknown route, wrong method."""
    assert isinstance(error, HTTPException)
    code = {404: "unknown_route", 405: "bad_method"}.get(error.status_code, "bad_request")
    answer = _answer(HttpError(error.status_code, code, f"{request.method} {request.url.path[:80]}: {error.detail}"))
    answer.headers.update(error.headers or {})
    return answer


async def _broken(request: Request, error: Exception) -> Response:
    return _answer(HttpError(500, "failed", f"{type(error).__name__}; the supervisor's log has the details"))
