# SPDX-License-Identifier: Apache-2.0
"""A client of the bus that is not ours: Zenoh's own Python package puts, subscribes, and sees who lives."""

from __future__ import annotations

import json
import os
import queue
import socket
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import zenoh

HAL = Path(__file__).resolve().parents[1]
ECHO = Path(os.environ.get("FCSL_TEST_PROGRAMS", HAL.parent / "build/fcsl_hal")) / "bus_echo"
MESSAGES = 200
LONG_S = 30


def free_endpoint() -> str:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{found.getsockname()[1]}"


@contextmanager
def client(endpoint: str, **transport: Any) -> Iterator[zenoh.Session]:
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", json.dumps([endpoint]))
    config.insert_json5("scouting/multicast/enabled", "false")
    for key, value in transport.items():
        config.insert_json5(f"transport/{key.replace('__', '/')}", json.dumps(value))
    with zenoh.open(config) as session:
        yield session


@contextmanager
def echo(endpoint: str | Path) -> Iterator[dict[str, Any]]:
    """A running bus_echo, with an endpoint or a configuration file; its counters when it has ended."""
    counters: dict[str, Any] = {}
    with subprocess.Popen([ECHO, str(endpoint)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout and process.stdin
        assert process.stdout.readline() == "listening\n"
        yield counters
        out, _ = process.communicate(timeout=LONG_S)
    assert process.returncode == 0
    counters.update(json.loads(out))


def test_messages_come_back_in_order() -> None:
    endpoint = free_endpoint()
    got: queue.Queue[bytes] = queue.Queue()
    sent = [number.to_bytes(2, "little") * (number % 30) for number in range(MESSAGES)]
    with echo(endpoint) as counters, client(endpoint) as session:
        session.declare_subscriber("t/out", lambda sample: got.put(sample.payload.to_bytes()))
        token = session.liveliness().declare_token("t/alive/0")
        alive = {str(reply.ok.key_expr) for reply in session.liveliness().get("t/alive/*") if reply.ok}
        assert len(alive - {"t/alive/0"}) == 1  # its own, and that of the other session
        publisher = session.declare_publisher("t/in", congestion_control=zenoh.CongestionControl.BLOCK)
        publisher.put(b"first")
        assert got.get(timeout=LONG_S) == b"first"  # subscription and token have arrived
        session.put("t/in", b"x" * 65)  # too large
        session.put("t/in/other", b"no input has this key")
        session.delete("t/in")
        for message in sent:
            publisher.put(message)
        assert [got.get(timeout=LONG_S) for _ in sent] == sent
        token.undeclare()
    assert counters == {
        "received": MESSAGES + 3, "wrong_size": 1, "deletions": 1, "strays": 1, "posted": MESSAGES + 1, "overflowed": 0, "alive": 1
    }  # fmt: skip


def test_a_constant_answers_queries() -> None:
    endpoint = free_endpoint()
    with echo(endpoint), client(endpoint) as session:
        for key in ("t/about", "**/about", "t/*"):
            (reply,) = session.get(key, timeout=LONG_S)
            assert reply.ok and (str(reply.ok.key_expr), reply.ok.payload.to_bytes()) == ("t/about", b"echo")
        assert list(session.get("t/other", timeout=1.0)) == []


def listener(folder: Path, endpoint: str, transport: dict[str, Any]) -> Path:
    """A configuration file of a session that listens."""
    path = folder / "listener.json5"
    quiet = {"multicast": {"enabled": False}, "gossip": {"enabled": False}}
    config = {"mode": "peer", "listen": {"endpoints": [endpoint]}, "scouting": quiet, "transport": transport}
    path.write_text(json.dumps(config))
    return path


def check_echo(session: zenoh.Session) -> None:
    got: queue.Queue[bytes] = queue.Queue()
    session.declare_subscriber("t/out", lambda sample: got.put(sample.payload.to_bytes()))
    session.declare_publisher("t/in", congestion_control=zenoh.CongestionControl.BLOCK).put(b"hello")
    assert got.get(timeout=LONG_S) == b"hello"


def test_users_of_a_configuration_file(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    (tmp_path / "users").write_text("rover:secret\n")
    config = listener(tmp_path, endpoint, {"auth": {"usrpwd": {"dictionary_file": str(tmp_path / "users")}}})
    with echo(config):
        with client(endpoint, auth__usrpwd={"user": "rover", "password": "secret"}) as session:
            check_echo(session)
        with (
            pytest.raises(zenoh.ZError),
            client(endpoint, auth__usrpwd={"user": "rover", "password": "guessed"}),
        ):
            pass


def test_tls_of_a_configuration_file(tmp_path: Path) -> None:
    port = free_endpoint().rpartition(":")[2]
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    make = ["openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"]
    subject = ["-days", "2", "-subj", "/CN=listener", "-addext", "subjectAltName=IP:127.0.0.1,DNS:localhost"]
    leaf = ["-addext", "basicConstraints=critical,CA:FALSE"]
    subprocess.run([*make, *subject, *leaf, "-keyout", key, "-out", certificate], check=True, capture_output=True)
    tls = {"listen_private_key": str(key), "listen_certificate": str(certificate)}
    config = listener(tmp_path, f"tls/127.0.0.1:{port}", {"link": {"tls": tls}})
    with echo(config):
        with client(f"tls/127.0.0.1:{port}", link__tls={"root_ca_certificate": str(certificate)}) as session:
            check_echo(session)
        with pytest.raises(zenoh.ZError), client(f"tcp/127.0.0.1:{port}"):
            pass
