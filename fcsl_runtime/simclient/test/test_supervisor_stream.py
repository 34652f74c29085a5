# SPDX-License-Identifier: Apache-2.0
"""The page's files and its stream: for whom, how many, how long, and what becomes of a reader that takes nothing."""

from __future__ import annotations

import contextlib
import http.client
import json
import re
import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from prometheus_client.parser import text_string_to_metric_families
from supervising import Supervisor, raw, supervising, wait_until
from vars_machine import build

from simclient import VarClient
from simclient.supervisor import page
from simclient.supervisor.limits import STREAMS

FIELDS = "hold.*,machine.*"
_PATIENCE_S = 30.0


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    build(folder)
    return folder


@pytest.fixture(scope="module")
def library(root: Path) -> str:
    (library,) = root.glob("*.so")
    return library.name


@pytest.fixture(scope="module")
def supervisor(root: Path) -> Iterator[Supervisor]:
    with supervising(root) as supervisor:
        yield supervisor


class Stream:
    """A reader of events."""

    def __init__(self, supervisor: Supervisor, query: str = "", **headers: str):
        self._connection = http.client.HTTPConnection(supervisor.address, supervisor.port, timeout=_PATIENCE_S)
        self._connection.request("GET", f"/stream{query}", headers=headers)
        self.answer = self._connection.getresponse()

    def next(self, wanted: str) -> Any:
        """The data of the next event of this name. Raises EOFError at the end."""
        while True:
            head, data, empty = (self.answer.readline() for _ in range(3))
            if not data:
                raise EOFError
            assert empty == b"\n" and head.startswith(b"event: ") and data.startswith(b"data: ")
            if head == f"event: {wanted}\n".encode():
                return json.loads(data.removeprefix(b"data: "))

    def close(self) -> None:
        self._connection.close()
        self.answer.close()


@contextlib.contextmanager
def streaming(supervisor: Supervisor, query: str = "", **headers: str) -> Iterator[Stream]:
    stream = Stream(supervisor, query, **headers)
    try:
        assert stream.answer.status == 200, stream.answer.read()
        yield stream
    finally:
        stream.close()


def refusal(supervisor: Supervisor, path: str, **headers: str) -> tuple[int, str]:
    """Status and code of an answer that must be an error: another one could have no end."""
    connection = http.client.HTTPConnection(supervisor.address, supervisor.port, timeout=_PATIENCE_S)
    with contextlib.closing(connection):
        connection.request("GET", path, headers=headers)
        answer = connection.getresponse()
        assert answer.status >= 400, path
        return answer.status, json.loads(answer.read())["error"]["code"]


def metric(supervisor: Supervisor, name: str) -> float:
    families = text_string_to_metric_families(supervisor.get("/metrics").body.decode())
    (sample,) = [sample for family in families for sample in family.samples if sample.name == name]
    return float(sample.value)


def test_it_says_what_the_run_does(supervisor: Supervisor, library: str) -> None:
    run = supervisor.start(library, paused=True, telemetry_fields=FIELDS)
    sent = supervisor.get(f"/runs/{run['id']}/channels").json
    assert sent["tick_hz"] == 1000 and sent["every"] == 1 and list(sent["channels"]) == run["channels"]
    assert sent["channels"]["hold.state.p"] == {"type": "f64", "shape": [4, 5], "unit": "", "labels": []}
    assert sent["channels"]["machine.state"]["labels"] == ["RUN", "WAIT"]
    query = f"?run={run['id']}&path=hold.state.count&path=hold.state.p[1][2]"
    with VarClient(run["socket"]) as client, streaming(supervisor, query) as stream:
        assert stream.answer.headers["Content-Type"].startswith("text/event-stream")
        client.set({"hold.state.p[1,2]": 2.5})
        client.tick(3)
        update = stream.next("values")
        while update["tick"] < 2:  # it may come in parts
            update = stream.next("values")
        assert update["values"]["hold.state.count"][-1] == 3.0 and update["values"]["hold.state.p[1][2]"][-1] == 2.5
        client.set_state("WAIT")
        client.tick(2)
        update = stream.next("values")
        while update["tick"] < 4:
            update = stream.next("values")
        assert update["states"][-1][1] == "WAIT" and update["values"]["hold.state.count"][-1] is None  # it is stale
        runs = stream.next("runs")
        while runs[-1]["health"].get("state") != "WAIT":
            runs = stream.next("runs")
        assert (
            runs[-1]["id"] == run["id"] and runs[-1]["health"]["health"] == "nominal" and runs[-1]["health"]["paused"]
        )
        supervisor.ask("DELETE", f"/runs/{run['id']}")
        while runs[-1]["status"] != "ended":
            runs = stream.next("runs")
    with streaming(supervisor, query) as stream:  # what telemetry brought remains
        assert stream.next("values")["tick"] == 4


def test_what_is_no_stream_is_refused(supervisor: Supervisor, library: str) -> None:
    run = supervisor.start(library, paused=True)
    for query, status, code in (
        ("?run=99", 404, "unknown_run"),
        ("?path=a", 400, "bad_request"),
        ("?run=1&run=2", 400, "bad_request"),
        (f"?run={run['id']}&path=a&path=a", 400, "bad_request"),
        (f"?run={run['id']}&" + "&".join(f"path=p{i}" for i in range(65)), 400, "bad_request"),
        (f"?run={run['id']}&path=hold.state.nothing", 404, "unknown_path"),
        ("?every=1", 400, "bad_request"),
    ):
        assert refusal(supervisor, f"/stream{query}") == (status, code)
    assert supervisor.ask("HEAD", "/stream").body == b""
    supervisor.ask("DELETE", f"/runs/{run['id']}")


def test_so_many_streams_and_no_more(supervisor: Supervisor) -> None:
    with contextlib.ExitStack() as streams:
        for _ in range(STREAMS):
            streams.enter_context(streaming(supervisor)).next("runs")
        assert refusal(supervisor, "/stream") == (503, "too_many_clients")
        assert supervisor.get("/health").status == 200 and metric(supervisor, "fcsl_streams") == STREAMS
    wait_until(lambda: metric(supervisor, "fcsl_streams") == 0)
    assert metric(supervisor, "fcsl_streams_dropped_total") == 0
    with streaming(supervisor) as stream:
        stream.next("runs")


def test_a_stream_outlives_other_answers_and_ends_with_the_supervisor(root: Path) -> None:
    """It has no limit of time; an end that waited for it would take as long as the grace of other answers."""
    short = "from simclient.supervisor import service, timeouts; timeouts.CONNECTION_S = 0.3; service._GRACE_S = 600"
    with supervising(root, patch=short) as supervisor:
        with streaming(supervisor) as stream:
            for _ in range(3):  # a summary comes once a second
                stream.next("runs")
            assert supervisor.stop() == 0
            with pytest.raises((EOFError, http.client.IncompleteRead)):
                while True:
                    stream.next("runs")


def is_held(reader: socket.socket) -> bool:
    """Whether the other end still has this connection open."""
    ends = (reader.getpeername()[1], reader.getsockname()[1])
    for line in Path("/proc/net/tcp").read_text().splitlines()[1:]:
        local, remote, state = line.split()[1:4]
        if (int(local.rpartition(":")[2], 16), int(remote.rpartition(":")[2], 16)) == ends:
            return state == "01"  # established
    return False


def test_a_reader_that_takes_nothing_is_dropped(root: Path, library: str) -> None:
    soon = "from simclient.supervisor import stream; stream.STREAM_STALL_S = 0.3; stream.STREAM_PERIOD_S = 0.001"
    with supervising(root, patch=soon) as supervisor:
        run = supervisor.start(library, telemetry_fields=FIELDS)
        with socket.socket() as reader:
            reader.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            reader.connect((supervisor.address, supervisor.port))
            path = f"/stream?run={run['id']}&path=hold.state.p&path=hold.state.cube"
            reader.sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{supervisor.port}\r\n\r\n".encode())
            wait_until(lambda: metric(supervisor, "fcsl_streams_dropped_total") == 1)  # others are served meanwhile
            wait_until(lambda: not is_held(reader))  # whatever it did not read
        assert metric(supervisor, "fcsl_streams") == 0


def test_a_reader_that_is_gone_before_the_answer_is_no_error(root: Path, capfd: pytest.CaptureFixture[str]) -> None:
    slow = "import time; from simclient.supervisor import app; app._Routes._feed = lambda *_: time.sleep(0.5)"
    with supervising(root, patch=slow) as supervisor:
        with socket.create_connection((supervisor.address, supervisor.port)) as reader:
            reader.sendall(f"GET /stream?run=1 HTTP/1.1\r\nHost: 127.0.0.1:{supervisor.port}\r\n\r\n".encode())
        with streaming(supervisor, "?run=1") as stream:  # its answer begins later
            stream.next("runs")
        assert supervisor.stop() == 0
    assert "Traceback" not in capfd.readouterr().err


def test_the_page_is_for_everybody_and_shows_nothing_without_the_token(root: Path, tmp_path: Path) -> None:
    with supervising(root, "--token", str(tmp_path / "token")) as supervisor:
        for path in page.FILES:
            answer = supervisor.get(path)
            assert answer.status == 200 and answer.headers["Cross-Origin-Resource-Policy"] == "same-origin"
            assert "script-src 'self'" in answer.headers["Content-Security-Policy"]
            assert "unsafe" not in answer.headers["Content-Security-Policy"]
        assert supervisor.get("/").headers["Content-Type"].startswith("text/html")
        assert supervisor.get("/main.js").headers["Content-Type"].startswith("text/javascript")
        for path in ("/stream", "/runs", "/main.js/../runs", "//", "/nothing.js"):
            assert refusal(supervisor, path) == (401, "unauthorized")
        token = {"Authorization": f"Bearer {(tmp_path / 'token').read_text().strip()}"}
        with streaming(supervisor, **token) as stream:
            assert stream.next("runs") == []


def test_the_page_has_all_its_files() -> None:
    """What a file names is there, and nothing comes from elsewhere."""
    named = set()
    for path, (content, _) in page.FILES.items():
        text = content.decode()
        assert "http:" not in text and "https:" not in text and "innerHTML" not in text, path
        named |= {f"/{name}" for name in re.findall(r'(?:from "\./|(?:src|href)="/)([\w.]+\.\w+)"', text)}
    assert named == set(page.FILES) - {"/"}


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_other_pages_cannot_use_it(supervisor: Supervisor, site: str) -> None:
    """A browser says where a request comes from, also where it sends no Origin: images, scripts, frames."""
    for path in ("/stream", "/runs", "/"):
        for mode, destination in (("no-cors", "image"), ("navigate", "iframe"), ("cors", "empty")):
            given = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": mode, "Sec-Fetch-Dest": destination}
            assert refusal(supervisor, path, **given) == (403, "bad_origin")
    link = {"Sec-Fetch-Site": site, "Sec-Fetch-Mode": "navigate", "Sec-Fetch-Dest": "document"}
    assert supervisor.get("/", **link).status == 200
    assert supervisor.ask("DELETE", "/runs/1", headers=link).code == "bad_origin"


def test_a_head_that_is_no_stream(supervisor: Supervisor) -> None:
    said = raw(supervisor, f"GET /stream?run=%00 HTTP/1.1\r\nHost: 127.0.0.1:{supervisor.port}\r\n\r\n".encode())
    assert said.startswith(b"HTTP/1.1 404 ")
