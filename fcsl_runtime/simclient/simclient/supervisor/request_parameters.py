# SPDX-License-Identifier: Apache-2.0
"""Parameters, body and accepted types of an HTTP request. Every function raises HttpError for invalid input."""

from __future__ import annotations

import asyncio
import json
import re
from typing import Any

from starlette.requests import Request

from .http_error import HttpError, nearest
from .limits import BODY_BYTES, BODY_DEPTH, BODY_S, PATH_BYTES, PATHS, STREAM_VALUES
from .windows import ARROW

JSON = "application/json"
_TICKS = 100
_INTEGER_DIGITS = 12


def query(request: Request, *known: str) -> list[tuple[str, str]]:
    """Names and values of the query parameters; only `known` ones are allowed."""
    given = request.query_params.multi_items()
    for name, value in given:
        if name not in known:
            hint = f"its parameters: {', '.join(known)}" if known else "it has none"
            raise HttpError(400, "bad_request", f"no parameter {name[:80]!r} here", nearest(name, known) or hint)
        if len(value) > PATH_BYTES:
            raise HttpError(400, "bad_value", f"{name}: at most {PATH_BYTES} characters")
    return given


def paths(given: list[tuple[str, str]]) -> list[str]:
    """The `path` parameters: at least one, no duplicates."""
    found = _each("path", given)
    if not 1 <= len(found) < PATHS:
        raise HttpError(400, "bad_request", f"expected 1 to {PATHS - 1} paths, not {len(found)}", "?path=...&path=...")
    return found


def stream(given: list[tuple[str, str]]) -> tuple[str | None, list[str], list[str]]:
    """The `run`, if any, its `path` parameters and its `angles`."""
    runs, paths, angles = (_each(name, given) for name in ("run", "path", "angles"))
    if len(runs) > 1 or not runs and (paths or angles):
        raise HttpError(400, "bad_request", f"expected one run, not {len(runs)}", "/stream?run=ID&path=...")
    if len(paths) + len(angles) > STREAM_VALUES:
        raise HttpError(400, "bad_request", f"a stream has at most {STREAM_VALUES} paths")
    return (runs[0] if runs else None), paths, angles


def _each(wanted: str, given: list[tuple[str, str]]) -> list[str]:
    """The values of this parameter, no duplicates."""
    found = [value for name, value in given if name == wanted]
    twice = [value for index, value in enumerate(found) if value in found[:index]]
    if twice:
        raise HttpError(400, "bad_request", f"{wanted} {twice[0][:80]!r} is given twice")
    return found


def ticks(given: list[tuple[str, str]]) -> int:
    """The `ticks` parameter, or its default."""
    found = [value for name, value in given if name == "ticks"] or [str(_TICKS)]
    if len(found) > 1 or not re.fullmatch(r"[0-9]+", found[0], re.ASCII) or len(found[0]) > _INTEGER_DIGITS:
        raise HttpError(400, "bad_value", f"ticks: expected one number, not {', '.join(found)[:80]}")
    return int(found[0])


def wants_arrow(accept: str) -> bool:
    """Whether to answer with Arrow: yes if Accept names it, else JSON. One of the two must be accepted."""
    kinds = [part.partition(";")[0].strip().lower() for part in accept.split(",")]
    if ARROW in kinds:
        return True
    if not {JSON, "application/*", "*/*"} & set(kinds):
        raise HttpError(406, "not_acceptable", f"Accept: {accept[:80]}", f"{JSON} or {ARROW}")
    return False


async def body(request: Request) -> bytes:
    """The complete body, within the limits of size and time."""
    too_large = HttpError(413, "too_large", f"a request has at most {BODY_BYTES} bytes")
    length = request.headers.get("content-length", "")
    if length.isdecimal() and length.isascii() and int(length[:20]) > BODY_BYTES:
        raise too_large
    taken = b""
    try:
        async with asyncio.timeout(BODY_S):
            async for part in request.stream():
                taken += part
                if len(taken) > BODY_BYTES:
                    raise too_large
    except TimeoutError:
        raise HttpError(408, "too_slow", f"the request was not complete after {BODY_S:g} s") from None
    return taken


def decoded(text: bytes) -> Any:
    """The value of a JSON text. Duplicate members and excessive nesting are errors."""

    too_deep = HttpError(400, "bad_json", f"the body has more than {BODY_DEPTH} lists and objects inside each other")

    def unique(members: list[tuple[str, Any]]) -> dict[str, Any]:
        if len({name for name, _ in members}) != len(members):
            raise HttpError(400, "bad_json", "a member is given twice")
        return dict(members)

    try:
        value = json.loads(text, object_pairs_hook=unique)
    except ValueError as error:
        raise HttpError(400, "bad_json", f"the body is not JSON: {str(error)[:200]}") from None
    except RecursionError:
        raise too_deep from None
    if not _nests(value, BODY_DEPTH):
        raise too_deep
    return value


def _nests(value: Any, most: int) -> bool:
    """Whether lists and objects are nested at most `most` deep."""
    inner = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return inner is None or most > 0 and all(_nests(item, most - 1) for item in inner)
