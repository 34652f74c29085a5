# SPDX-License-Identifier: Apache-2.0
"""What a supervisor refuses: strangers, paths that lead out, options it does not have, bytes that are no request."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from supervising import Supervisor, build_minimal, supervising, wait_until

from simclient import TwinError
from simclient.supervisor.files import Root
from simclient.supervisor.guard import Guard
from simclient.supervisor.limits import BODY_BYTES, CONNECTIONS, HEAD_BYTES
from simclient.supervisor.options import KINDS, arguments_of
from simclient.supervisor.refusal import Refusal
from simclient.supervisor.token import read_token

LIBRARY = "libminimal.so"
POST_BEGUN = (
    b"POST /runs HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nContent-Type: application/json\r\nContent-Length: 9\r\n\r\n{"
)


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
        run = supervisor.start(file, ticks=1, rate="free")
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
        ({"seed": 1}, 400, "unknown_option", None),
        ({"ticks": 0}, 400, "bad_value", None),
        ({"ticks": True}, 400, "bad_value", None),
        ({"ticks": 5.0}, 400, "bad_value", None),
        ({"ticks": "5"}, 400, "bad_value", None),
        ({"ticks": 2**63}, 400, "bad_value", None),
        ({"rate": "warp"}, 400, "bad_value", None),
        ({"rate": ["free"]}, 400, "bad_value", None),
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
        ({"last_state": "/tmp/x.json"}, 403, "outside_root", None),
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
    ("headers", "status", "code"),
    [
        ({"Host": "evil.example:{port}"}, 403, "bad_host"),  # whatever it resolves to
        ({"Host": "127.0.0.1"}, 403, "bad_host"),
        ({"Host": "127.0.0.1:1"}, 403, "bad_host"),
        ({"Host": "localhost.evil.example:{port}"}, 403, "bad_host"),
        ({"Host": "127.0.0.2:{port}"}, 403, "bad_host"),
        ({"Host": ""}, 403, "bad_host"),
        ({"Origin": "http://evil.example"}, 403, "bad_origin"),
        ({"Origin": "null"}, 403, "bad_origin"),
        ({"Origin": "https://127.0.0.1:{port}"}, 403, "bad_origin"),
        ({"Origin": "http://127.0.0.1:1"}, 403, "bad_origin"),
        ({"Content-Type": "text/plain"}, 415, "bad_type"),
        ({"Content-Type": "application/x-www-form-urlencoded"}, 415, "bad_type"),
    ],
)
def test_strangers(supervisor: Supervisor, headers: dict[str, str], status: int, code: str) -> None:
    given = {name: value.format(port=supervisor.port) for name, value in headers.items()}
    answer = supervisor.post({"kind": "flight", "file": LIBRARY}, **given)
    assert (answer.status, answer.code) == (status, code), answer.json
    if status == 403:
        for path in ("/", "/runs", "/metrics", "/nowhere"):
            assert supervisor.get(path, **given).code == code


def test_those_of_its_own_are_served(supervisor: Supervisor) -> None:
    own = f"127.0.0.1:{supervisor.port}"
    assert supervisor.get("/runs", Origin=f"http://{own}").status == 200
    assert supervisor.get("/runs", Host=f"LocalHost:{supervisor.port}").status == 200
    answer = supervisor.get("/", Host=own)
    assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
    assert answer.headers["X-Content-Type-Options"] == "nosniff" and answer.headers["Cache-Control"] == "no-store"
    assert "Access-Control-Allow-Origin" not in answer.headers and "Server" not in answer.headers


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
        ("GET", "/runs?x=1", 400, "bad_request"),
        ("GET", "/health?" + "x" * 2000, 400, "bad_request"),
    ],
)
def test_routes(supervisor: Supervisor, method: str, path: str, status: int, code: str) -> None:
    answer = supervisor.ask(method, path)
    assert (answer.status, answer.code) == (status, code), answer.json


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
        answer = supervisor.get(f"/runs/{name}/windows?path=machine.tick", Accept="text/html")
        assert (answer.status, answer.code) == (406, "not_acceptable")
    finally:
        supervisor.ask("DELETE", f"/runs/{name}")


# ---- tokens -----------------------------------------------------------------------------------------------------------


def test_a_token(root: Path, tmp_path: Path) -> None:
    with supervising(root, "--token", str(tmp_path / "token")) as supervisor:
        token = (tmp_path / "token").read_text().strip()
        assert len(token) == 48 and (tmp_path / "token").stat().st_mode & 0o777 == 0o600
        for given in ({}, {"Authorization": f"Bearer {token}x"}, {"Authorization": token}, {"Authorization": "Bearer "},
                      {"Authorization": f"Basic {token}"}, {"Authorization": "Bearer \xe9"}):  # fmt: skip
            for answer in (supervisor.get("/metrics", **given), supervisor.post({"kind": "flight"}, **given)):
                assert (answer.status, answer.code) == (401, "unauthorized")
                assert answer.headers["WWW-Authenticate"] == "Bearer"
        assert supervisor.get("/metrics", Authorization=f"Bearer {token}").status == 200


def test_other_computers_need_a_token(root: Path, tmp_path: Path) -> None:
    with pytest.raises(AssertionError, match="status 2"):
        supervising(root, "--address", "0.0.0.0").__enter__()
    with supervising(root, "--address", "0.0.0.0", "--token", str(tmp_path / "token")) as supervisor:
        token = {"Authorization": f"Bearer {(tmp_path / 'token').read_text().strip()}"}
        assert supervisor.get("/runs", **token, Host=f"192.0.2.7:{supervisor.port}").status == 200
        assert supervisor.get("/runs", **token, Host=f"name.example:{supervisor.port}").code == "bad_host"


@pytest.mark.parametrize("held", [b"short", b"x" * 129, b"sixteen letters \xff", b"two words of them"])
def test_token_files(tmp_path: Path, held: bytes) -> None:
    path = tmp_path / "token"
    path.write_bytes(held)
    with pytest.raises(TwinError, match="nobody else can read"):
        read_token(path)
    path.chmod(0o600)
    with pytest.raises(TwinError, match="16 to 128"):
        read_token(path)
    path.write_text("0123456789abcdef\n")
    assert read_token(path) == "0123456789abcdef"
    (tmp_path / "link").symlink_to(path)
    with pytest.raises(TwinError, match="cannot read"):
        read_token(tmp_path / "link")


@given(st.text(max_size=60), st.sampled_from(["127.0.0.1", "::1", "0.0.0.0"]))
def test_a_host_is_its_own_or_refused(host: str, address: str) -> None:
    """Of names none but `localhost`: by any other one a page elsewhere could reach it."""
    guard = Guard(address, 80, "")
    try:
        guard.check("GET", {"host": host})
    except Refusal as refusal:
        assert refusal.code == "bad_host"
    else:
        name = host.rpartition(":")[0]
        assert name.lower() == "localhost" or set(name) <= set("0123456789abcdefABCDEF.:[]%")


# ---- whatever comes ---------------------------------------------------------------------------------------------------


def raw(supervisor: Supervisor, data: bytes) -> bytes:
    """What it says to these bytes, until it closes the connection."""
    with socket.create_connection((supervisor.address, supervisor.port), timeout=30) as connection:
        connection.sendall(data)
        said = b""
        try:
            while part := connection.recv(65536):
                said += part
        except ConnectionResetError:
            pass
        return said


def test_heads(supervisor: Supervisor) -> None:
    for data in (b"\r\n\r\n", b"GET / HTTP/9\r\n\r\n", b"\x16\x03\x01\x02\x00\x01" * 40 + b"\r\n\r\n",
                 b"GET / HTTP/1.1\r\nHost: a\r\nHost: b\r\n\r\n", b"GET / HTTP/1.1\r\nX: " + b"x" * 2 * HEAD_BYTES):  # fmt: skip
        said = raw(supervisor, data)
        assert said.startswith(b"HTTP/1.1 400 ") and b'"bad_request"' in said
    answer = supervisor.get("/health", Filler="x" * HEAD_BYTES)
    assert (answer.status, answer.code) == (431, "too_large")
    own = f"Host: 127.0.0.1:{supervisor.port}\r\n".encode()
    twice = raw(supervisor, b"GET /health HTTP/1.1\r\n" + own + b"\r\nGET /health HTTP/1.1\r\n" + own + b"\r\n")
    assert twice.count(b"HTTP/1.1 200") == 1  # a connection carries one request


@pytest.mark.parametrize(
    ("soon", "begun", "said"),
    [
        ("patience.HEAD_S", b"GET /hea", b""),
        ("app.BODY_S", POST_BEGUN, b"HTTP/1.1 408 "),
        ("patience.CONNECTION_S", POST_BEGUN, b""),
    ],
)
def test_a_connection_is_cut_in_time(root: Path, soon: str, begun: bytes, said: bytes) -> None:
    with supervising(root, patch=f"from simclient.supervisor import app, patience; {soon} = 0.3") as supervisor:
        answer = raw(supervisor, begun.replace(b"PORT", str(supervisor.port).encode()))
        assert answer.startswith(said) and (said or not answer)


def test_so_many_connections_and_no_more(root: Path) -> None:
    def reachable() -> bool:
        try:
            return supervisor.get("/health").status == 200
        except (ConnectionError, http.client.HTTPException):
            return False

    patient = "from simclient.supervisor import patience; patience.HEAD_S = patience.CONNECTION_S = 600"
    with supervising(root, patch=patient) as supervisor:
        with contextlib.ExitStack() as idle:
            for _ in range(CONNECTIONS):
                idle.enter_context(socket.create_connection((supervisor.address, supervisor.port)))
            answer = supervisor.get("/health")
            assert (answer.status, answer.code) == (503, "too_many_clients")
            for _ in range(CONNECTIONS):
                idle.enter_context(socket.create_connection((supervisor.address, supervisor.port)))
            assert not reachable()
        wait_until(reachable)


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)
options = st.dictionaries(
    st.sampled_from(sorted(KINDS["flight"].options)) | st.text(max_size=8), json_values, max_size=4
)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.fixed_dictionaries(
        {}, optional={"kind": st.just("flight") | json_values, "file": json_values, "options": options}
    )
)
def test_whatever_json_comes_is_answered(supervisor: Supervisor, wanted: dict[str, object]) -> None:
    answer = supervisor.post(json.dumps(wanted).encode())
    assert answer.status in (400, 403, 404, 409) and answer.code


@settings(max_examples=300, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(sorted(KINDS)), options)
def test_no_value_becomes_an_argument_of_its_own(root: Path, kind: str, wanted: dict[str, object]) -> None:
    """Every argument begins with the flag of an option that was asked for."""
    try:
        arguments = arguments_of(KINDS[kind], wanted, Root(root))
    except Refusal:
        return
    flags = {f"--{name.replace('_', '-')}" for name in wanted}
    assert all(argument.partition("=")[0] in flags and "\0" not in argument for argument in arguments)
