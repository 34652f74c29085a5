# SPDX-License-Identifier: Apache-2.0
"""What the supervisor takes of a request: for whom it answers, and parameters and bodies at their limits."""

from __future__ import annotations

import json
from typing import Any

import pytest
from starlette.requests import Request

from simclient.supervisor import request_parameters as parameters
from simclient.supervisor.guard import Guard
from simclient.supervisor.http_error import HttpError, of_variables
from simclient.supervisor.limits import BODY_DEPTH, PATH_BYTES, PATHS, STREAM_VALUES
from simclient.vars.wire import VarError

GUARDS = {address: Guard(address, 7510, "") for address in ("127.0.0.1", "::1", "0.0.0.0", "::")}


@pytest.mark.parametrize(
    ("address", "host", "served"),
    [
        ("127.0.0.1", "127.0.0.1:7510", True),
        ("127.0.0.1", "LOCALHOST:7510", True),
        ("127.0.0.1", "[::1]:7510", False),
        ("127.0.0.1", "127.0.0.1:7511", False),
        ("127.0.0.1", "127.0.0.1", False),
        ("127.0.0.1", "", False),
        ("::1", "[::1]:7510", True),
        ("::1", "[0:0:0:0:0:0:0:1]:7510", True),
        ("::1", "[::2]:7510", False),
        ("::1", "[::1:7510", False),
        ("::1", "::1]:7510", False),
        ("::1", "127.0.0.1:7510", False),
        ("0.0.0.0", "192.0.2.7:7510", True),
        ("::", "[2001:db8::7]:7510", True),
        ("0.0.0.0", "name.example:7510", False),
    ],
)
def test_hosts(address: str, host: str, served: bool) -> None:
    try:
        GUARDS[address].check("GET", {"host": host})
    except HttpError as error:
        assert not served and (error.status, error.code) == (403, "bad_host")
        assert (
            error.hint == f"use http://{'[::1]' if address == '::1' else '[::]' if address == '::' else address}:7510/"
        )
    else:
        assert served


@pytest.mark.parametrize("site", ["cross-site", "same-site", "same-origin", "none"])
@pytest.mark.parametrize("method", ["GET", "POST", "DELETE"])
@pytest.mark.parametrize(("mode", "dest"), [("navigate", "document"), ("navigate", "iframe"), ("no-cors", "document")])
def test_of_pages_elsewhere_only_a_link_is_followed(site: str, method: str, mode: str, dest: str) -> None:
    headers = {"host": "127.0.0.1:7510", "sec-fetch-site": site, "sec-fetch-mode": mode, "sec-fetch-dest": dest}
    own = site in ("same-origin", "none")
    allowed = own or (method, mode, dest) == ("GET", "navigate", "document")
    try:
        GUARDS["127.0.0.1"].check(method, {**headers, "content-type": " Application/JSON ; charset=utf-8"})
    except HttpError as error:
        assert not allowed and (error.status, error.code) == (403, "bad_origin")
    else:
        assert allowed


def nested(depth: int) -> bytes:
    return b"[" * depth + b"]" * depth


@pytest.mark.parametrize(
    "text", [b"7", b'{"a": {"b": [1]}}', nested(BODY_DEPTH), b'{"a":' * BODY_DEPTH + b"1" + b"}" * BODY_DEPTH]
)
def test_bodies(text: bytes) -> None:
    assert parameters.decoded(text) == json.loads(text)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (b"", "the body is not JSON"),
        (b"{", "the body is not JSON"),
        (b'"\xff"', "the body is not JSON"),
        (b'{"a": 1, "a": 1}', "a member is given twice"),
        (b'[{"b": {"a": 1, "a": 2}}]', "a member is given twice"),
        (nested(BODY_DEPTH + 1), f"more than {BODY_DEPTH} lists and objects"),
        (b'{"a":' * (BODY_DEPTH + 1) + b"1" + b"}" * (BODY_DEPTH + 1), f"more than {BODY_DEPTH} lists and objects"),
        (nested(200_000), f"more than {BODY_DEPTH} lists and objects"),
    ],
)
def test_bodies_that_are_refused(text: bytes, reason: str) -> None:
    with pytest.raises(HttpError, match=reason) as refused:
        parameters.decoded(text)
    assert (refused.value.status, refused.value.code) == (400, "bad_json")


def given(text: str, *known: str) -> list[tuple[str, str]]:
    return parameters.query(Request({"type": "http", "headers": [], "query_string": text.encode()}), *known)


def test_parameters() -> None:
    assert given("") == [] and given("run=&path=%20", "run", "path") == [("run", ""), ("path", " ")]
    assert given(f"path={'x' * PATH_BYTES}", "path") == [("path", "x" * PATH_BYTES)]
    for text, code, hint in (
        ("pth=a", "bad_request", "path"),
        ("zzz=a", "bad_request", "its parameters: path"),
        (f"path={'x' * (PATH_BYTES + 1)}", "bad_value", ""),
    ):
        with pytest.raises(HttpError) as refused:
            given(text, "path")
        assert (refused.value.status, refused.value.code, refused.value.hint) == (400, code, hint)
    with pytest.raises(HttpError) as refused:
        given("a=b")
    assert refused.value.hint == "it has none"


def numbered(name: str, count: int) -> list[tuple[str, str]]:
    return [(name, f"p{n}") for n in range(count)]


def test_numbers_of_paths() -> None:
    for count in (1, PATHS - 1):
        assert parameters.paths([("run", "1"), *numbered("path", count)]) == [f"p{n}" for n in range(count)]
    for wrong in ([], numbered("path", PATHS), [("path", "a"), ("path", "b"), ("path", "a")]):
        with pytest.raises(HttpError) as refused:
            parameters.paths(wrong)
        assert (refused.value.status, refused.value.code) == (400, "bad_request")


def test_streams() -> None:
    half = STREAM_VALUES // 2
    full = [("run", "7"), *numbered("path", STREAM_VALUES - half), *numbered("angles", half)]
    assert parameters.stream([]) == (None, [], []) and parameters.stream([("run", "7")]) == ("7", [], [])
    run, paths, angles = parameters.stream(full)
    assert (run, len(paths), len(angles)) == ("7", STREAM_VALUES - half, half)
    for wrong in ([*full, ("path", "q")], [("run", "1"), ("run", "2")], [("path", "a")], [("angles", "a")]):
        with pytest.raises(HttpError) as refused:
            parameters.stream(wrong)
        assert (refused.value.status, refused.value.code) == (400, "bad_request")


@pytest.mark.parametrize(("text", "number"), [("0", 0), ("7", 7), ("9" * 12, 10**12 - 1), ("007", 7)])
def test_numbers_of_ticks(text: str, number: int) -> None:
    assert parameters.ticks([("path", "1"), ("ticks", text)]) == number and parameters.ticks([]) == 100


@pytest.mark.parametrize("wrong", [["-1"], [""], ["1.5"], ["9" * 13], ["\u0661"], ["1", "2"]])
def test_what_is_no_number_of_ticks(wrong: list[str]) -> None:
    with pytest.raises(HttpError, match="ticks: expected one number") as refused:
        parameters.ticks([("ticks", text) for text in wrong])
    assert (refused.value.status, refused.value.code) == (400, "bad_value")


@pytest.mark.parametrize(
    ("accept", "arrow"),
    [("*/*", False), ("application/json", False), ("text/html, application/*;q=0.5", False),
     (f"text/html, {parameters.ARROW} ; q=1", True), (f"*/*, {parameters.ARROW.upper()}", True)],
)  # fmt: skip
def test_kinds_of_answers(accept: str, arrow: bool) -> None:
    assert parameters.wants_arrow(accept) is arrow


def test_kinds_of_answers_that_are_none() -> None:
    for accept in ("", "text/html", "image/*"):
        with pytest.raises(HttpError) as refused:
            parameters.wants_arrow(accept)
        assert (refused.value.status, refused.value.code) == (406, "not_acceptable")


@pytest.mark.parametrize(
    ("code", "status"),
    [("unknown_path", 404), ("bad_index", 400), ("bad_request", 400), ("bad_value", 400), ("timeout", 504),
     ("unreachable", 503), ("closed", 503), ("too_many_clients", 503), ("too_slow", 503), ("too_large", 413),
     ("internal", 502)],
)  # fmt: skip
def test_what_a_run_refused_has_a_status(code: str, status: int) -> None:
    error: Any = of_variables(VarError(code, "why", "what instead"))
    assert (error.status, error.code, error.message, error.hint) == (status, code, "why", "what instead")
