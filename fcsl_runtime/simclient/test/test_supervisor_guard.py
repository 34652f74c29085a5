# SPDX-License-Identifier: Apache-2.0
"""Whom a supervisor answers, and for how long: hosts, origins, tokens, heads, connections."""

from __future__ import annotations

import contextlib
import http.client
import os
import socket
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from supervising import Supervisor, build_minimal, raw, supervising, wait_until

from simclient import TwinError
from simclient.supervisor.guard import Guard
from simclient.supervisor.http_error import HttpError
from simclient.supervisor.limits import CONNECTIONS, HEAD_BYTES
from simclient.supervisor.token import read_token

LIBRARY = "libminimal.so"
POST_BEGUN = (
    b"POST /runs HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nContent-Type: application/json\r\nContent-Length: 9\r\n\r\n{"
)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    build_minimal(folder)
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
        supervising(root, "--listen", "tcp:0.0.0.0:0").__enter__()
    with supervising(root, "--listen", "tcp:0.0.0.0:0", "--token", str(tmp_path / "token")) as supervisor:
        token = {"Authorization": f"Bearer {(tmp_path / 'token').read_text().strip()}"}
        assert supervisor.get("/runs", **token, Host=f"192.0.2.7:{supervisor.port}").status == 200
        assert supervisor.get("/runs", **token, Host=f"name.example:{supervisor.port}").code == "bad_host"


@pytest.mark.parametrize("held", [b"short", b"x" * 129, b"sixteen letters \xff", b"two words of them"])
def test_token_files(tmp_path: Path, held: bytes) -> None:
    path = tmp_path / "token"
    path.write_bytes(held)
    with pytest.raises(TwinError, match="readable by you alone"):
        read_token(path)
    path.chmod(0o600)
    with pytest.raises(TwinError, match="16 to 128"):
        read_token(path)
    path.write_text("0123456789abcdef\n")
    assert read_token(path) == "0123456789abcdef"
    (tmp_path / "link").symlink_to(path)
    with pytest.raises(TwinError, match="cannot read"):
        read_token(tmp_path / "link")


def test_a_token_file_that_cannot_be_made_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object) -> None:
        raise FileExistsError(17, "File exists")  # somebody made it meanwhile

    monkeypatch.setattr(os, "link", refuse)
    with pytest.raises(TwinError, match="cannot create token file .*: File exists"):
        read_token(tmp_path / "token")
    assert not list(tmp_path.iterdir())


@given(st.text(max_size=60), st.sampled_from(["127.0.0.1", "::1", "0.0.0.0"]))
def test_a_host_is_its_own_or_refused(host: str, address: str) -> None:
    """Of names none but `localhost`: by any other one a page elsewhere could reach it."""
    guard = Guard(address, 80, "")
    try:
        guard.check("GET", {"host": host})
    except HttpError as refusal:
        assert refusal.code == "bad_host"
    else:
        name = host.rpartition(":")[0]
        assert name.lower() == "localhost" or set(name) <= set("0123456789abcdefABCDEF.:[]%")


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
        ("timeouts.HEAD_S", b"GET /hea", b""),
        ("request_parameters.BODY_S", POST_BEGUN, b"HTTP/1.1 408 "),
        ("timeouts.CONNECTION_S", POST_BEGUN, b""),
    ],
)
def test_a_connection_is_cut_in_time(root: Path, soon: str, begun: bytes, said: bytes) -> None:
    with supervising(
        root, patch=f"from simclient.supervisor import request_parameters, timeouts; {soon} = 0.3"
    ) as supervisor:
        answer = raw(supervisor, begun.replace(b"PORT", str(supervisor.port).encode()))
        assert answer.startswith(said) and (said or not answer)


def test_so_many_connections_and_no_more(root: Path) -> None:
    def reachable() -> bool:
        try:
            return supervisor.get("/health").status == 200
        except (ConnectionError, http.client.HTTPException):
            return False

    patient = "from simclient.supervisor import timeouts; timeouts.HEAD_S = timeouts.CONNECTION_S = 600"
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
