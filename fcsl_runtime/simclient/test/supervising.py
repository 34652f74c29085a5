# SPDX-License-Identifier: Apache-2.0
"""A supervisor as a process of its own, and an HTTP client that says what it is told, right or wrong."""

from __future__ import annotations

import contextlib
import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[3]
_START = "import sys; from simclient.cli import run_tool; {patch}; sys.exit(run_tool('fcsl supervisor', 'supervisor.service', sys.argv[1:]))"
_PATIENCE_S = 30.0


class Answer:
    """Of one request."""

    def __init__(self, response: http.client.HTTPResponse):
        self.status = response.status
        self.headers = response.headers
        self.body = response.read()

    @property
    def json(self) -> Any:
        return json.loads(self.body)

    @property
    def code(self) -> str:
        """Of the error that it is; its members are complete."""
        error = self.json["error"]
        assert set(error) == {"code", "message", "hint"} and error["message"]
        return str(error["code"])


class Supervisor:
    """A running fcsl supervisor."""

    def __init__(self, root: Path, *arguments: str, patch: str = "pass", private: Path | None = None):
        """`patch` is Python that is executed before it starts; `private` is where it has its private folder."""
        environment = {**os.environ, **({"TMPDIR": str(private)} if private else {})}
        given = arguments if "--listen" in arguments else (*arguments, "--listen", "tcp:127.0.0.1:0")
        self.process = subprocess.Popen(
            [sys.executable, "-c", _START.format(patch=patch), "--root", str(root), *given],
            stdout=subprocess.PIPE,
            text=True,
            env=environment,
        )
        assert self.process.stdout is not None
        said = self.process.stdout.readline()
        found = re.match(r"fcsl supervisor: http://(.*):(\d+)/ ", said)
        assert found, f"{said!r}, status {self.process.wait(_PATIENCE_S)}"
        self.address, self.port = found[1].strip("[]"), int(found[2])

    def ask(
        self, method: str, path: str, body: bytes | None = None, headers: Mapping[str, str] | None = None
    ) -> Answer:
        """A request whose headers are these, and where they do not say so a right Host."""
        connection = http.client.HTTPConnection(self.address, self.port, timeout=_PATIENCE_S)
        try:
            connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
            sent = {"Host": f"{self.address}:{self.port}", **(headers or {})}
            if body is not None:
                sent.setdefault("Content-Length", str(len(body)))
            for name, value in sent.items():
                connection.putheader(name, value)
            connection.endheaders(body)
            return Answer(connection.getresponse())
        finally:
            connection.close()

    def get(self, path: str, **headers: str) -> Answer:
        return self.ask("GET", path, headers=headers)

    def post(self, wanted: object, **headers: str) -> Answer:
        """Starts a run."""
        body = wanted if isinstance(wanted, bytes) else json.dumps(wanted).encode()
        return self.ask("POST", "/runs", body, {"Content-Type": "application/json", **headers})

    def start(self, file: str, kind: str = "flight", **options: object) -> dict[str, Any]:
        """A run that is to be."""
        answer = self.post({"kind": kind, "file": file, "options": options})
        assert answer.status == 201, answer.json
        run: dict[str, Any] = answer.json
        assert answer.headers["Location"] == f"/runs/{run['id']}"
        return run

    def stop(self, number: int = signal.SIGTERM) -> int:
        self.process.send_signal(number)
        return self.process.wait(_PATIENCE_S)

    def close(self) -> None:
        assert self.process.stdout is not None
        self.process.stdout.close()


@contextlib.contextmanager
def supervising(root: Path, *arguments: str, patch: str = "pass", private: Path | None = None) -> Iterator[Supervisor]:
    supervisor = Supervisor(root, *arguments, patch=patch, private=private)
    try:
        yield supervisor
    finally:
        if supervisor.process.poll() is None:
            supervisor.stop()
        supervisor.close()


def raw(supervisor: Supervisor, data: bytes) -> bytes:
    """What it says to these bytes, until it closes the connection."""
    with socket.create_connection((supervisor.address, supervisor.port), timeout=_PATIENCE_S) as connection:
        connection.sendall(data)
        said = b""
        try:
            while part := connection.recv(65536):
                said += part
        except ConnectionResetError:
            pass
        return said


def is_gone(pid: int) -> bool:
    """Ended, whether or not somebody has asked for its status."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z"
    except (FileNotFoundError, ProcessLookupError):
        return True


def end(runs: Iterable[int]) -> None:
    """Those that a defect of the supervisor has left."""
    for pid in runs:
        if not is_gone(pid):
            os.kill(pid, signal.SIGKILL)


def wait_until(holds: Any) -> None:
    deadline = time.monotonic() + _PATIENCE_S
    while not holds():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def build_minimal(folder: Path) -> str:
    """The library of examples/minimal, made in `folder`; its name."""
    config = ROOT / "examples/minimal/minimal.json"
    command = [sys.executable, "-m", "fcsl_compiler.cli.main", "build", str(config), "-o", str(folder)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    (library,) = folder.glob("*.so")
    return library.name
