# SPDX-License-Identifier: Apache-2.0
"""Clients of the variable server that are many, silent, hostile or remote, and the socket itself."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import socket
import stat
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from native import FIXTURE, PROGRAM, Client, Fc, flying


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "fc.sock"


@pytest.fixture
def paused(path: Path) -> Iterator[tuple[Fc, Client]]:
    with flying("--socket", path, "--paused") as fc:
        client = fc.client(path)
        yield fc, client
        client.close()


# ---- many


def test_commands_of_many_clients_are_served_in_turn(path: Path) -> None:
    """One command meets the step thread at a time, and nobody is left out."""
    with flying("--socket", path) as fc:
        clients = [fc.client(path) for _ in range(40)]
        for round_ in range(3):
            for i, client in enumerate(clients):
                client.send(b'{"cmd":"set","values":{"sensors.outputs.temperature":%d},"id":%d}\n' % (i, round_))
        for client in clients:
            assert [client.read()["id"] for _ in range(3)] == [0, 1, 2]


def test_who_only_looks_does_not_wait_for_a_command(path: Path) -> None:
    """At 100 Hz a set takes up to 10 ms; 50 gets behind another client's set are answered before its tick is over."""
    with flying("--socket", path) as fc:
        setter, getter = fc.client(path), fc.client(path)
        overtaken = 0
        for _ in range(20):
            setter.ok("set", values={"sensors.outputs.temperature": 1.0})  # just after a tick now
            setter.send(b'{"cmd":"set","values":{"sensors.outputs.temperature":2}}\n')
            before = getter.ok("state")["tick"]
            ticks = {getter.ok("get", paths=["machine.tick"])["tick"] for _ in range(20)}
            overtaken += ticks == {before}
            assert setter.read()["ok"]
        assert overtaken > 0


def test_a_client_that_leaves_while_its_command_waits(path: Path) -> None:
    with flying("--socket", path) as fc:
        client = fc.client(path)
        for i in range(50):
            other = fc.client(path)
            other.send(b'{"cmd":"set","values":{"sensors.outputs.count":%d}}\n' % (i + 1))
            other.close()
        deadline = time.monotonic() + 10
        while client.get("sensors.outputs.count") == 0:
            assert time.monotonic() < deadline
        assert client.set("sensors.outputs.temperature", 1.0)["ok"]


def descriptors(process: int) -> int:
    return len(os.listdir(f"/proc/{process}/fd"))


def threads(process: int) -> int:
    return len(os.listdir(f"/proc/{process}/task"))


def waits(process: int) -> dict[str, int]:
    """How often each thread has gone to sleep."""
    found = {}
    for task in Path(f"/proc/{process}/task").iterdir():
        lines = (task / "status").read_text().splitlines()
        found[task.name] = int(next(line.split()[1] for line in lines if line.startswith("voluntary_ctxt_switches:")))
    return found


def test_the_server_sleeps_until_somebody_asks(path: Path) -> None:
    with flying("--socket", path) as fc:
        client = fc.client(path)
        client.ok("state")  # no time limit runs for whoever has asked
        time.sleep(0.1)
        begun = waits(fc.process.pid)
        time.sleep(1)
        slept = waits(fc.process.pid)
        client.ok("state")
        time.sleep(0.1)
        woken = waits(fc.process.pid)
        assert any(slept[t] == begun[t] and woken[t] > slept[t] for t in begun), (begun, slept, woken)


def resident_kib(process: int) -> int:
    text = Path(f"/proc/{process}/status").read_text()
    return int(next(line.split()[1] for line in text.splitlines() if line.startswith("VmRSS:")))


def test_1000_connections_that_are_abandoned_leak_nothing(paused: tuple[Fc, Client], path: Path) -> None:
    fc, client = paused
    number = fc.process.pid
    assert client.ok("state")  # the connection has been taken
    lines = (
        b"",
        b'{"cmd":"get","paths":["machine.tick"]}\n',
        b'{"cmd":"get","pat',
        b'{"cmd":"subscribe","paths":["machine.tick"]}\n',
        b'{"cmd":"tick"}\n',
        b"nonsense\n" * 20,
    )

    def cycle(count: int) -> None:
        for i in range(count):
            with socket.socket(socket.AF_UNIX) as abandoned:
                abandoned.connect(str(path))
                with contextlib.suppress(BrokenPipeError):  # refused, when 64 before it have not been noticed yet
                    abandoned.sendall(lines[i % len(lines)])
        assert client.ok("state")
        deadline = time.monotonic() + 10
        while descriptors(number) > steady:
            assert time.monotonic() < deadline, "descriptors are left open"

    steady = descriptors(number)
    cycle(300)  # every buffer has been touched once
    memory, tasks = resident_kib(number), threads(number)
    cycle(1000)
    assert (descriptors(number), threads(number)) == (steady, tasks)
    assert resident_kib(number) - memory < 256


# ---- silent, malformed


def test_a_client_that_says_nothing_is_told_why_it_goes(paused: tuple[Fc, Client], path: Path) -> None:
    """One that is silent from the beginning, and one in the middle of a request; who has asked once may stay silent."""
    fc, client = paused
    client.ok("state")
    silent, halting = fc.client(path), fc.client(path)
    halting.ok("state")
    halting.send(b'{"cmd":"sta')
    for dropped in (silent, halting):
        dropped.socket.settimeout(30)
        error = dropped.read()["error"]
        assert error["code"] == "too_slow" and "10 s" in error["message"] and dropped.closed()
    assert client.ok("stats")["clients_dropped"] == 2


def test_a_client_that_talks_nonsense_is_told_why_it_goes(paused: tuple[Fc, Client], path: Path) -> None:
    fc, client = paused
    hostile = fc.client(path)
    hostile.send(b"nonsense\n" * 15 + b'{"cmd":"state"}\n' + b"nonsense\n" * 16)
    errors = [hostile.read() for _ in range(33)]
    assert errors[15]["ok"] and "16 requests in a row" in errors[32]["error"]["message"] and hostile.closed()
    assert client.ok("stats")["clients_dropped"] == 1


# ---- TCP


def tcp(address: str) -> Client:
    host, port = address.removeprefix("tcp:").rsplit(":", 1)
    client = Client.__new__(Client)
    client.socket = socket.create_connection((host, int(port)), timeout=10)
    client.file = client.socket.makefile("rb")
    return client


def address_of(fc: Fc) -> str:
    assert fc.process.stdout is not None
    for line in fc.process.stdout:
        if " on tcp:" in line:
            return line.split(" on ")[1].strip()
    raise AssertionError("it does not say where it listens")


def test_what_one_client_did_wrong_is_not_held_against_the_next(paused: tuple[Fc, Client], path: Path) -> None:
    """The next one gets the place, and a first mistake of its own is only told."""
    fc, client = paused
    hostile = fc.client(path)
    hostile.send(b"nonsense\n" * 16)
    assert {hostile.read()["error"]["code"] for _ in range(17)} == {"bad_json"} and hostile.closed()
    other = fc.client(path)
    other.send(b"nonsense\n")
    assert other.read()["error"]["code"] == "bad_json" and other.ok("state")["tick"] == 0
    assert client.ok("stats")["clients_dropped"] == 1


def test_tcp_asks_for_the_token(tmp_path: Path) -> None:
    token = tmp_path / "token"
    with flying("--socket", "tcp:127.0.0.1:0", "--token", token, "--paused") as fc:
        address = address_of(fc)
        assert stat.S_IMODE(token.stat().st_mode) == 0o600
        secret = token.read_text().strip()
        assert len(secret) == 48
        client = tcp(address)
        assert client.ok("authenticate", token=secret)
        assert client.ok("tick")["tick"] == 1
        for first in (
            {"cmd": "state"},
            {"cmd": "authenticate"},
            {"cmd": "authenticate", "token": ""},
            {"cmd": "authenticate", "token": secret[:-1]},
            {"cmd": "authenticate", "token": secret + "0"},
            {"cmd": "authenticate", "token": secret[:-1] + "x"},
            {"cmd": "authenticate", "token": secret * 2},
            {"cmd": "tick", "token": secret},
        ):
            stranger = tcp(address)
            stranger.send(json.dumps(first).encode() + b'\n{"cmd":"tick"}\n')
            assert stranger.read()["ok"] is False and stranger.closed()
        assert client.ok("state")["tick"] == 1 and client.ok("stats")["clients_dropped"] == 8
        port = address.rsplit(":", 1)[1]
        fc.process.kill()
        fc.process.wait()
    with flying("--socket", f"tcp:127.0.0.1:{port}", "--token", token, "--paused") as fc:  # at once, the same token
        client = tcp(address_of(fc))
        assert client.ok("authenticate", token=secret) and token.read_text().strip() == secret
        assert fc.stop()[0] == 0


def test_silent_connections_do_not_keep_out_who_has_the_token(tmp_path: Path) -> None:
    """More of them than the server has places; one that sent the token before is not touched."""
    with flying("--socket", "tcp:127.0.0.1:0", "--token", tmp_path / "token", "--paused") as fc:
        address, secret = address_of(fc), (tmp_path / "token").read_text().strip()
        first = tcp(address)
        first.ok("authenticate", token=secret)
        silent = [tcp(address) for _ in range(100)]
        client = tcp(address)
        assert client.ok("authenticate", token=secret) and client.ok("tick")["tick"] == 1
        assert first.ok("tick")["tick"] == 2
        silent[0].socket.settimeout(10)
        assert b"too many connections have sent no token" in silent[0].socket.recv(4096)
        assert client.ok("stats")["clients_dropped"] == 100 - 15  # the two who sent the token took places of theirs


def test_tcp_listens_on_loopback_alone_unless_told(tmp_path: Path) -> None:
    with flying("--socket", "tcp:127.0.0.1:0", "--token", tmp_path / "token", "--paused") as fc:
        port = int(address_of(fc).rsplit(":", 1)[1])
        with socket.socket() as probe:  # 127.0.0.2 is this machine, too, but not that address
            assert probe.connect_ex(("127.0.0.2", port)) != 0
    with flying("--socket", "tcp:0.0.0.0:0", "--token", tmp_path / "token", "--paused") as fc:
        address = address_of(fc)
        assert address.startswith("tcp:0.0.0.0:")
        assert tcp(address.replace("0.0.0.0", "127.0.0.2")).ok(
            "authenticate", token=(tmp_path / "token").read_text().strip()
        )


@pytest.mark.parametrize(
    ("address", "make", "text"),
    [
        ("tcp:127.0.0.1:0", None, "--token"),
        ("tcp:example.org:0", "0123456789abcdef", "tcp:"),
        ("tcp:127.0.0.1", "0123456789abcdef", "tcp:"),
        ("tcp:127.0.0.1:99999", "0123456789abcdef", "tcp:"),
        ("tcp:127.0.0.1:0", "short", "16 to 128"),
        ("tcp:127.0.0.1:0", "with a blank in the middle", "16 to 128"),
        ("tcp:127.0.0.1:0", "x" * 129, "16 to 128"),
    ],
)
def test_bad_addresses_and_tokens(tmp_path: Path, address: str, make: str | None, text: str) -> None:
    arguments: list[str | Path] = ["--socket", address, "--paused"]
    if make is not None:
        token = tmp_path / "token"
        token.write_text(make)
        token.chmod(0o600)
        arguments += ["--token", token]
    with flying(*arguments, library=FIXTURE) as fc:
        code, _, err = fc.wait()
    assert code in (1, 2) and text in err


def test_a_token_that_others_can_read_is_refused(tmp_path: Path) -> None:
    token = tmp_path / "token"
    token.write_text("0123456789abcdef")
    token.chmod(0o644)
    with flying("--socket", "tcp:127.0.0.1:0", "--token", token, "--paused") as fc:
        code, _, err = fc.wait()
    assert code == 1 and "chmod 600" in err
    link = tmp_path / "link"
    token.chmod(0o600)
    link.symlink_to(token)
    with flying("--socket", "tcp:127.0.0.1:0", "--token", link, "--paused") as fc:
        assert fc.wait()[0] == 1


# ---- open files


def test_too_few_files_are_refused_at_the_start(tmp_path: Path) -> None:
    """poll() takes no more entries than files may be open: that is seen to before anybody waits for an answer."""
    program = f"exec {PROGRAM} {FIXTURE} --paused --socket {tmp_path / 's'}"
    done = subprocess.run(
        ["bash", "-c", f"ulimit -n 50; {program}"], capture_output=True, text=True, check=False, timeout=30
    )
    assert done.returncode == 1 and "ulimit -n" in done.stderr and not (tmp_path / "s").exists()
    # Where the program may raise the limit itself, it does.
    with subprocess.Popen(["bash", "-c", f"ulimit -S -n 50; {program}"], stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert any(b"commands on" in line for line in process.stdout)
        client = Client(tmp_path / "s")
        assert client.ok("state")["paused"] is True
        client.close()
        process.terminate()


def test_without_a_descriptor_left_nothing_spins(paused: tuple[Fc, Client], path: Path) -> None:
    """Who cannot be taken waits; he is tried five times a second, the others are served, and then he is, too."""
    fc, client = paused
    client.ok("state")
    resource.prlimit(fc.process.pid, resource.RLIMIT_NOFILE, (68, 68))
    begun = time.monotonic()
    crowd = []
    for _ in range(63):
        crowd.append(Client(path))
    while (dropped := client.ok("stats")["clients_dropped"]) < 3:
        assert time.monotonic() < begun + 20
    assert dropped <= 5.0 * (time.monotonic() - begun) + 1
    waiting = crowd.pop()
    for each in crowd:
        each.close()
    assert waiting.ok("state")["tick"] == 0
    waiting.close()


def test_a_server_that_may_open_nothing_any_more_still_ends(paused: tuple[Fc, Client]) -> None:
    fc, client = paused
    client.ok("state")
    resource.prlimit(fc.process.pid, resource.RLIMIT_NOFILE, (4, 4096))
    client.send(b'{"cmd":"state"}\n')
    resource.prlimit(fc.process.pid, resource.RLIMIT_NOFILE, (4096, 4096))
    assert client.read()["ok"]
    resource.prlimit(fc.process.pid, resource.RLIMIT_NOFILE, (4, 4096))
    assert fc.stop()[0] == 0


# ---- ends


def test_who_sends_nothing_more_is_answered_to_the_end(paused: tuple[Fc, Client], path: Path) -> None:
    """As `printf … | socat - UNIX:fc.sock` does: what looks and what acts."""
    for line in (b'{"cmd":"state"}\n', b'{"cmd":"set","values":{"sensors.outputs.count":3}}\n'):
        one = Client(path)
        one.send(line * 100 + b'{"cmd":"sta')
        one.socket.shutdown(socket.SHUT_WR)
        assert all(one.read()["ok"] for _ in range(100)) and one.closed()


def test_only_its_own_socket_is_removed(path: Path) -> None:
    with flying("--socket", path, "--paused") as fc:
        fc.client(path).close()
        path.unlink()
        path.write_text("somebody's")
        assert fc.stop()[0] == 0 and path.read_text() == "somebody's"
