# SPDX-License-Identifier: Apache-2.0
"""What a supervisor refuses: strangers, paths that lead out, options it does not have, bytes that are no request."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from supervising import Supervisor, build_minimal, raw, supervising

from simclient.supervisor.files import Root
from simclient.supervisor.http_error import HttpError
from simclient.supervisor.limits import BODY_BYTES
from simclient.supervisor.options import KINDS, arguments_of

LIBRARY = "libminimal.so"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a library, and with ways out of it."""
    folder = tmp_path_factory.mktemp("all") / "root"
    folder.mkdir()
    build_minimal(folder)
    outside = folder.parent / "outside"
    outside.mkdir()
    (outside / LIBRARY).write_bytes((folder / LIBRARY).read_bytes())
    (folder / "link.so").symlink_to(outside / LIBRARY)
    (folder / "door").symlink_to(outside)
    (folder / "circle.so").symlink_to("circle.so")
    (folder / "inside.so").symlink_to(LIBRARY)
    (folder / "folder.so").mkdir()
    os.mkfifo(folder / "fifo.so")
    (folder / "machine.txt").write_text("{}")
    return folder


@pytest.fixture(scope="module")
def supervisor(root: Path) -> Iterator[Supervisor]:
    with supervising(root) as supervisor:
        yield supervisor


@pytest.fixture(autouse=True)
def nothing_runs(supervisor: Supervisor) -> Iterator[None]:
    yield
    assert supervisor.get("/health").json["runs"]["running"] == 0


@pytest.mark.parametrize(
    ("file", "status", "code"),
    [
        ("../outside/" + LIBRARY, 403, "outside_root"),
        ("x/../../outside/" + LIBRARY, 403, "outside_root"),
        ("link.so", 403, "outside_root"),
        ("door/" + LIBRARY, 403, "outside_root"),
        ("/etc/passwd", 403, "outside_root"),
        ("/proc/self/root/etc/passwd", 403, "outside_root"),
        (".", 403, "outside_root"),
        ("circle.so", 400, "bad_value"),
        ("folder.so", 400, "bad_value"),
        ("fifo.so", 400, "bad_value"),
        ("machine.txt", 400, "bad_value"),
        ("libminimall.so", 404, "unknown_file"),
        ("libminimal.so\0.so", 400, "bad_value"),
        ("a\nb.so", 400, "bad_value"),
        ("x" * 300 + ".so", 404, "unknown_file"),
        ("x" * 2000, 400, "bad_value"),
        ("", 400, "bad_value"),
        (None, 400, "bad_value"),
        (7, 400, "bad_value"),
        ([LIBRARY], 400, "bad_value"),
    ],
)
def test_files(supervisor: Supervisor, file: object, status: int, code: str) -> None:
    answer = supervisor.post({"kind": "flight", "file": file})
    assert (answer.status, answer.code) == (status, code), answer.json
    if code == "unknown_file" and "minimall" in str(file):
        assert answer.json["error"]["hint"] == LIBRARY


def test_a_link_that_stays_inside_is_followed(supervisor: Supervisor, root: Path) -> None:
    for file in ("inside.so", str(root / LIBRARY), f"folder.so/../{LIBRARY}"):
        run = supervisor.start(file, ticks=1, rate="max")
        assert run["file"] == file
        supervisor.ask("DELETE", f"/runs/{run['id']}")


@pytest.mark.parametrize(
    ("options", "status", "code", "hint"),
    [
        ({"tick": 5}, 400, "unknown_option", "ticks"),
        ({"socket": "/tmp/x"}, 400, "unknown_option", None),
        ({"telemetry": "udp:192.0.2.1:9"}, 400, "unknown_option", None),
        ({"hal": "wire:/tmp/x"}, 400, "unknown_option", None),
        ({"token": "/etc/shadow"}, 400, "unknown_option", None),
        ({"--ticks": 5}, 400, "unknown_option", "ticks"),
        ({"seed": 1}, 400, "unknown_option", "only a simulation has it"),
        ({"speed": 1}, 400, "unknown_option", "only a simulation has it"),
        ({"ticks": 0}, 400, "bad_value", None),
        ({"ticks": True}, 400, "bad_value", None),
        ({"ticks": 5.0}, 400, "bad_value", None),
        ({"ticks": "5"}, 400, "bad_value", None),
        ({"ticks": 2**63}, 400, "bad_value", None),
        ({"rate": "warp"}, 400, "bad_value", None),
        ({"rate": ["max"]}, 400, "bad_value", None),
        ({"paused": 1}, 400, "bad_value", None),
        ({"machine": "--help"}, 400, "bad_value", None),
        ({"machine": "a b"}, 400, "bad_value", None),
        ({"machine": "m\n"}, 400, "bad_value", None),
        ({"namespace": "../x"}, 400, "bad_value", None),
        ({"record_fields": "$(id)"}, 400, "bad_value", None),
        ({"telemetry_every": 0}, 400, "bad_value", None),
        ({"record": "../outside/bag"}, 403, "outside_root", None),
        ({"record": "door/bag"}, 403, "outside_root", None),
        ({"record": "folder.so"}, 409, "exists", None),
        ({"record": "none/bag"}, 404, "unknown_file", None),
        ({"summary": "/tmp/x.json"}, 403, "outside_root", None),
        ({"board": "link.so"}, 403, "outside_root", None),
        ({"restore": "nothing"}, 404, "unknown_file", None),
    ],
)
def test_options(supervisor: Supervisor, options: object, status: int, code: str, hint: str | None) -> None:
    answer = supervisor.post({"kind": "flight", "file": LIBRARY, "options": options})
    assert (answer.status, answer.code) == (status, code), answer.json
    assert hint is None or answer.json["error"]["hint"] == hint


@pytest.mark.parametrize(
    ("body", "status", "code"),
    [
        (b"", 400, "bad_json"),
        (b"{", 400, "bad_json"),
        (b"\xff\xfe", 400, "bad_json"),
        (b"[" * 30000, 400, "bad_json"),
        (b'{"kind":"flight","kind":"flight"}', 400, "bad_json"),
        (b'{"kind":' + b"9" * 5000 + b"}", 400, "bad_json"),
        (b"[]", 400, "bad_request"),
        (b"null", 400, "bad_request"),
        (b'{"kind":"flight","fiel":"x"}', 400, "bad_request"),
        (b'{"file":"libminimal.so"}', 400, "bad_value"),
        (b'{"kind":"fly","file":"libminimal.so"}', 400, "bad_value"),
        (b'{"kind":["flight"],"file":"libminimal.so"}', 400, "bad_value"),
        (b'{"kind":"flight","file":"libminimal.so","options":[]}', 400, "bad_value"),
        (b'{"kind":"flight","file":"libminimal.so","options":{"ticks":NaN}}', 400, "bad_value"),
        (b" " * (BODY_BYTES + 1), 413, "too_large"),
        (b'{"kind":"simulation","options":{"set":{"a":' + b"[" * 480 + b"]" * 480 + b"}}}", 400, "bad_json"),
        (b'{"kind":"simulation","file":' + b"[" * 31 + b"]" * 31 + b"}", 400, "bad_value"),
        (b'{"kind":"simulation","file":' + b"[" * 32 + b"]" * 32 + b"}", 400, "bad_json"),
        (b'{"kind":' * 32 + b"1" + b"}" * 32, 400, "bad_value"),
        (b'{"kind":' * 33 + b"1" + b"}" * 33, 400, "bad_json"),
    ],
)
def test_bodies(supervisor: Supervisor, body: bytes, status: int, code: str) -> None:
    answer = supervisor.post(body)
    assert (answer.status, answer.code) == (status, code), answer.json


def test_a_body_without_a_length_is_bounded_too(supervisor: Supervisor) -> None:
    chunk = b"8000\r\n" + b" " * 0x8000 + b"\r\n"
    head = b"POST /runs HTTP/1.1\r\nHost: %s:%d\r\nContent-Type: application/json\r\nTransfer-Encoding: chunked\r\n\r\n"
    said = raw(supervisor, head % (supervisor.address.encode(), supervisor.port) + chunk * 3)
    assert said.startswith(b"HTTP/1.1 413 ") and b'"too_large"' in said


@pytest.mark.parametrize(
    ("method", "path", "status", "code"),
    [
        ("GET", "/nowhere", 404, "unknown_route"),
        ("GET", "/runs/77", 404, "unknown_run"),
        ("DELETE", "/runs/77", 404, "unknown_run"),
        ("GET", "/runs/77/health", 404, "unknown_run"),
        ("GET", "/runs/77/values?path=x", 404, "unknown_run"),
        ("GET", "/runs/77/windows?path=x", 404, "unknown_run"),
        ("GET", "/runs/..%2f..%2fetc", 404, "unknown_route"),
        ("PUT", "/runs", 405, "bad_method"),
        ("DELETE", "/runs", 405, "bad_method"),
        *(("GET", f"{path}?x=1", 400, "bad_request") for path in ("/health", "/metrics", "/runs", "/runs/1")),
        *(("GET", f"/runs/1/{part}?x=1", 400, "bad_request") for part in ("health", "channels", "values", "windows")),
        ("GET", "/runs/1/requirements?x=1", 400, "bad_request"),
        ("GET", "/runs/77/requirements", 404, "unknown_run"),
        ("GET", "/runs/1/events?x=1", 400, "bad_request"),
        ("GET", "/runs/77/events", 404, "unknown_run"),
        ("GET", "/stream?x=1", 400, "bad_request"),
        ("DELETE", "/runs/1?x=1", 400, "bad_request"),
        ("GET", "/health?" + "x" * 2000, 400, "bad_request"),
    ],
)
def test_routes(supervisor: Supervisor, method: str, path: str, status: int, code: str) -> None:
    answer = supervisor.ask(method, path)
    assert (answer.status, answer.code) == (status, code), answer.json


def test_a_start_has_no_query(supervisor: Supervisor) -> None:
    answer = supervisor.ask("POST", "/runs?x=1", b"{}", {"Content-Type": "application/json"})
    assert (answer.status, answer.code) == (400, "bad_request") and "no parameter 'x'" in answer.json["error"][
        "message"
    ]


QUERIES = [
    ("values", 400, "bad_request"),
    ("values?path=nothing.at.all", 404, "unknown_path"),
    ("values?path=pilot.outputs.forze", 404, "unknown_path"),
    ("values?path=pilot.outputs.force[1]", 400, "bad_index"),
    ("values?path=machine.tick&path=machine.tick", 400, "bad_request"),
    ("values?" + "&".join(f"path=x{i}" for i in range(256)), 400, "bad_request"),
    ("values?path=" + "x" * 1025, 400, "bad_value"),
    ("values?path=machine.tick&ticks=1", 400, "bad_request"),
    ("windows?ticks=1", 400, "bad_request"),
    ("windows?path=pilot.outputs.forze", 404, "unknown_path"),
    ("windows?path=machine.tick[" + "9" * 900 + "]", 404, "unknown_path"),
    ("windows?path=machine.tick&ticks=0", 400, "bad_value"),
    ("windows?path=machine.tick&ticks=-1", 400, "bad_value"),
    ("windows?path=machine.tick&ticks=1e3", 400, "bad_value"),
    ("windows?path=machine.tick&ticks=" + "9" * 900, 400, "bad_value"),
    ("windows?path=machine.tick&ticks=99999999999", 400, "bad_value"),
    ("windows?path=machine.tick&ticks=1&ticks=2", 400, "bad_value"),
    ("windows?path=machine.tick&path=pilot&tick=5", 400, "bad_request"),
]


def test_queries(supervisor: Supervisor) -> None:
    name = supervisor.start(LIBRARY, paused=True)["id"]
    try:
        for query, status, code in QUERIES:
            answer = supervisor.get(f"/runs/{name}/{query}")
            assert (answer.status, answer.code) == (status, code), answer.json
        answer = supervisor.get(f"/runs/{name}/values?path=pilot.outputs.forze")
        assert answer.json["error"]["hint"] == "pilot.outputs.force"
        answer = supervisor.get(f"/runs/{name}/values?path=machine.tick&path=machine.tick")
        assert answer.json["error"]["message"] == "path 'machine.tick' is given twice"
        answer = supervisor.get(f"/runs/{name}/windows?path=machine.tick", Accept="text/html")
        assert (answer.status, answer.code) == (406, "not_acceptable")
    finally:
        supervisor.ask("DELETE", f"/runs/{name}")


# ---- whatever comes ---------------------------------------------------------------------------------------------------


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
options = st.dictionaries(
    st.sampled_from(sorted(KINDS["flight"].options)) | st.text(max_size=8), json_values, max_size=4
)


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries(
        {}, optional={"kind": st.just("flight") | json_values, "file": json_values, "options": options}
    )
)
def test_whatever_json_comes_is_answered(supervisor: Supervisor, wanted: dict[str, object]) -> None:
    answer = supervisor.post(json.dumps(wanted).encode())
    assert answer.status in (400, 403, 404, 409) and answer.code


@settings(max_examples=300, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(KINDS)), options)
def test_no_value_becomes_an_argument_of_its_own(root: Path, kind: str, wanted: dict[str, object]) -> None:
    """Every argument begins with the flag of an option that was asked for."""
    try:
        arguments = arguments_of(KINDS[kind], wanted, Root(root))
    except HttpError:
        return
    flags = {f"--{name.replace('_', '-')}" for name in wanted}
    assert all(argument.partition("=")[0] in flags and "\0" not in argument for argument in arguments)
