# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc as its users see it: options, commands, hostile clients, signals, recording."""

from __future__ import annotations

import math
import os
import random
import re
import signal
import socket
import stat
import struct
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from native import FIXTURE, FIXTURE_TWIN, PROGRAM, Client, Fc, flying
from rosbags.highlevel import AnyReader

from simclient.run import open_run


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "fc.sock"


@pytest.fixture
def paused(path: Path) -> Iterator[tuple[Fc, Client]]:
    """A paused flight program and a client of it."""
    with flying("--socket", path, "--paused") as fc:
        client = fc.client(path)
        yield fc, client
        client.close()


def run(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=30, check=False)


# ---- commands


def test_flight_by_commands(paused: tuple[Fc, Client]) -> None:
    fc, client = paused
    assert client.ok("state") == {"ok": True, "tick": 0, "state": "IDLE", "next_state": "IDLE", "paused": True}
    client.set("sensors.outputs.gyro", [1.5, -2, 0.1])
    assert client.ok("tick")["tick"] == 1
    assert client.get("pilot.outputs.force") == 2 * 1.5 - 0.25
    assert client.get("sensors.outputs.gyro") == [1.5, -2.0, 0.1]
    client.set("sensors.outputs.armed", True)
    reply = client.ok("tick")
    assert (reply["state"], reply["next_state"]) == ("IDLE", "ACTIVE")
    assert client.get("pilot.outputs.transition_request") == "tr_GO"
    assert client.ok("tick", count=10)["tick"] == 12
    assert client.ok("state")["state"] == "ACTIVE"
    assert client.ok("set_state", state="IDLE")["state"] == "IDLE"
    assert client.get("pilot.outputs.health") == "nominal"  # both states schedule it
    stats = client.ok("stats")
    assert stats["ticks"] == 12 and stats["faults"] == 0 and stats["requests_refused"] == 0
    code, out, err = fc.stop()
    assert (code, err) == (0, "") and "12 ticks" in out


def test_checkpoints(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    client.set("sensors.outputs.gyro[1]", 0.5)
    client.ok("tick", count=5)
    saved = client.ok("save")
    client.ok("tick", count=50)
    later = client.get("pilot.state.integral")
    assert client.ok("restore", data=saved["data"])["tick"] == 5
    client.ok("tick", count=50)
    assert client.get("pilot.state.integral") == later
    assert client.ok("restore")["tick"] == 5  # the same again
    client.ok("tick", count=50)
    assert client.get("pilot.state.integral") == later
    damaged = saved["data"][:8] + "/" * 16 + saved["data"][24:]
    assert client.error("restore", data=damaged)["code"] == "refused"
    assert client.error("restore", data="AAA")["code"] == "bad_value"
    assert client.ok("restore")["tick"] == 5  # what is refused takes nothing away
    client.ok("tick", count=50)
    assert client.ok("state")["tick"] == 55


def test_floats_round_trip(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    numbers = random.Random(3)
    for _ in range(200):
        value = struct.unpack("<d", numbers.randbytes(8))[0]
        client.set(
            "pilot.state.integral", value if math.isfinite(value) else str(value).lstrip("-"), allow_non_finite=True
        )
        got = client.get("pilot.state.integral")
        assert got == value or not math.isfinite(value)
    for text in ("nan", "inf", "-inf"):
        assert "allow_non_finite" in client.error("set", values={"pilot.state.integral": text})["message"]
        client.set("pilot.state.integral", text, allow_non_finite=True)
        assert client.get("pilot.state.integral") == text
    client.set("pilot.state.integral", -0.0)
    assert math.copysign(1, client.get("pilot.state.integral")) == -1
    for value in (2**63 - 1, -(2**63)):
        client.set("sensors.outputs.count", value)
        assert client.get("sensors.outputs.count") == value


def test_a_range_is_kept(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    for value in (-100.0, 100.0, 0.0):
        client.set("pilot.parameters.gain", value)
    for bad in (100.00000000000001, -1e300, "inf", "nan"):
        refused = client.error("set", values={"pilot.parameters.gain": bad}, allow_non_finite=True)
        assert refused["code"] == "refused" and refused["message"] == "'pilot.parameters.gain' lies in [-100, 100]"
    assert client.get("pilot.parameters.gain") == 0.0
    client.error("set", values={"sensors.outputs.count": 7, "pilot.parameters.gain": 101.0})
    assert client.get("sensors.outputs.count") == 0  # all or nothing, also of what the step thread finds out


def test_describe_and_list(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    machine = client.ok("describe")
    assert machine["machine"] == "fixture" and machine["tick_hz"] == 100 and machine["states"] == ["IDLE", "ACTIVE"]
    field = client.ok("describe", path="pilot.outputs.matrix[1,0]")
    assert field["type"] == "f32[2][2]" and field["role"] == "output" and field["writable"] is True
    assert client.ok("describe", path="pilot.outputs.health")["writable"] is False
    assert client.ok("describe", path="pilot.inputs.gyro")["connected_from"] == "sensors.outputs.gyro"
    assert client.ok("describe", path="pilot.parameters.limit")["frozen"] is True
    gain, force = (client.ok("describe", path=f"pilot.{name}") for name in ("parameters.gain", "outputs.force"))
    assert (gain["minimum"], gain["maximum"]) == (-100, 100) and (force["minimum"], force["maximum"]) == ("-inf", "inf")
    assert client.ok("list")["paths"] == list(open_run(Path(FIXTURE), None).machine.fields)
    assert client.ok("list", prefix="pilot.parameters.")["paths"] == ["pilot.parameters.gain", "pilot.parameters.limit"]


def test_nested_arrays(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    client.set("sensors.outputs.gyro[0]", 4.0)
    client.set("sensors.outputs.temperature", 1.25)
    client.ok("tick")
    assert client.get("pilot.outputs.matrix") == [[0.0, 8.0], [1.25, 0.0]]
    for index in ("[0][1]", "[0,1]"):
        assert client.get("pilot.outputs.matrix" + index) == 8.0
    for index in (
        "[2,0]",
        "[0,0,0]",
        "[-3,0]",
        "[0,1",
        "[0:1:0]",
        "[-]",
        "[0][0][0]",
        "[0,1]x",
        "[]",
        "[ 0,1]",
        "[99999999999999999999,0]",
    ):
        assert client.error("get", paths=["pilot.outputs.matrix" + index])["code"] == "bad_index"


def wait_for_tick(client: Client, tick: int) -> int:
    """The tick that a running machine is at once it is `tick` or later; nobody says how soon a busy computer gets there."""
    deadline = time.monotonic() + 60
    while (now := int(client.ok("state")["tick"])) < tick:
        assert time.monotonic() < deadline
        time.sleep(0.01)
    return now


def test_real_time_and_pause(path: Path) -> None:
    with flying("--socket", path) as fc:
        client = fc.client(path)
        begun = time.monotonic()
        first = client.ok("state")["tick"]
        last = wait_for_tick(client, first + 30)
        assert last - first <= 100 * (time.monotonic() - begun) + 12  # 100 Hz; 0.1 s may be caught up
        assert client.error("tick")["hint"] == "pause"
        tick = client.ok("pause")["tick"]
        time.sleep(0.1)
        assert client.ok("state")["tick"] == tick
        client.ok("resume")
        wait_for_tick(client, tick + 1)
        code, out, _ = fc.stop(signal.SIGINT)
        assert code == 0 and "ticks" in out
    assert not path.exists()


# ---- errors


@pytest.mark.parametrize(
    ("request_text", "code", "hint"),
    [
        ('{"cmd":"get","paths":["pilot.outputs.forse"]}', "unknown_path", "pilot.outputs.force"),
        ('{"cmd":"get","paths":[""]}', "unknown_path", ""),
        ('{"cmd":"get","paths":["nope"]}', "unknown_path", ""),
        ('{"cmd":"inject","instance":"pilto","what":"fault"}', "bad_value", "pilot"),
        ('{"cmd":"inject","instance":"pilot","what":"falut"}', "bad_value", "fault"),
        ('{"cmd":"attach","channel":"imu.gyor"}', "bad_value", "imu.gyro"),
        ('{"cmd":"attach","channel":"cart.force"}', "bad_value", ""),
        ('{"cmd":"attach","channel":"nowhere"}', "bad_value", ""),
        ('{"cmd":"sample","channel":"nowhere","value":1}', "bad_value", ""),
        ('{"cmd":"gte","path":"a"}', "unknown_command", "get"),
        ('{"cmd":"set_state","state":"IDEL"}', "unknown_state", "IDLE"),
        ('{"cmd":"get"}', "bad_request", ""),
        ('{"cmd":"get","paths":[7]}', "bad_request", ""),
        ('{"cmd":"get","paths":["machine.tick"],"pth":1}', "bad_request", "paths"),
        ('{"cmd":"get","paths":["machine.tick"],"paths":["machine.state"]}', "bad_request", ""),
        ('{"cmd":"set","values":{}}', "bad_request", ""),
        ('{"cmd":"set","values":{"pilot.parameters.gain":"x"}}', "bad_value", ""),
        ('{"cmd":"set","values":{"pilot.parameters.gain":true}}', "bad_value", ""),
        ('{"cmd":"set","values":{"pilot.parameters.gain":1e999}}', "bad_value", ""),
        ('{"cmd":"set","values":{"pilot.parameters.gain":[1]}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.count":1.0}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.count":9223372036854775808}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.armed":1}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.gyro":1}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.gyro":[1,2]}}', "bad_value", ""),
        ('{"cmd":"set","values":{"sensors.outputs.gyro":[1,2,[3]]}}', "bad_value", ""),
        ('{"cmd":"set","values":{"pilot.outputs.health":"failed"}}', "refused", ""),
        ('{"cmd":"set","values":{"pilot.parameters.limit":1}}', "refused", ""),
        ('{"cmd":"tick","count":0}', "bad_request", ""),
        ('{"cmd":"tick","count":-1}', "bad_request", ""),
        ('{"cmd":"tick","count":1000001}', "bad_request", ""),
        ('{"cmd":"tick","count":"1"}', "bad_request", ""),
        ('{"cmd":1}', "bad_request", ""),
        ("{}", "bad_request", ""),
        ("[]", "bad_json", ""),
        ("", "bad_json", ""),
        ("{", "bad_json", ""),
        ('{"cmd":"state"} x', "bad_json", ""),
        ("[" * 1000, "bad_json", ""),
        ("\xff", "bad_json", ""),
    ],
)
def test_errors(paused: tuple[Fc, Client], request_text: str, code: str, hint: str | None) -> None:
    _, client = paused
    client.send(request_text.encode("latin-1") + b"\n")
    reply = client.read()
    assert reply["ok"] is False and reply["error"]["code"] == code and reply["error"]["message"]
    assert hint is None or reply["error"]["hint"] == hint
    assert client.ok("stats")["requests_refused"] == 1


def test_ids_are_echoed(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    assert client.ok("state", id=7)["id"] == 7
    assert client.ok("state", id='a\n\u00e9"')["id"] == 'a\n\u00e9"'
    assert client("get", paths=["nothing"], id=8)["id"] == 8
    assert client.ok("state", id="x" * 64)["id"] == "x" * 64


@pytest.mark.parametrize("value", ["x" * 65, 10**64, [1], {}, None, True])
def test_ids_that_cannot_be_echoed_are_refused(paused: tuple[Fc, Client], value: Any) -> None:
    """And nothing is done: a client that waits for its id would take the reply for another request's."""
    _, client = paused
    reply = client("tick", id=value)
    assert "id" not in reply and reply["error"]["code"] == "bad_request" and '"id"' in reply["error"]["message"]
    assert client.ok("state")["tick"] == 0


def test_many_requests_at_once_and_in_pieces(paused: tuple[Fc, Client]) -> None:
    _, client = paused
    client.send(b'{"cmd":"tick"}\n' * 100)
    assert [client.read()["tick"] for _ in range(100)] == list(range(1, 101))
    for byte in b'{"cmd":"state","id":1}\n':
        client.send(bytes([byte]))
    assert client.read()["id"] == 1


def test_too_large_a_request(paused: tuple[Fc, Client], path: Path) -> None:
    fc, client = paused
    client.send(b'{"cmd":"state"}'.ljust(65536) + b"\n")
    assert client.read()["ok"]
    hostile = fc.client(path)
    hostile.send(b"x" * 65537)
    assert hostile.read()["error"]["code"] == "too_large"
    assert hostile.closed()
    assert client.ok("stats")["clients_dropped"] == 1


def test_one_client_too_many(paused: tuple[Fc, Client], path: Path) -> None:
    fc, client = paused
    others = [fc.client(path) for _ in range(63)]
    assert all(other.ok("state") for other in others)
    last = fc.client(path)
    assert last.read()["error"]["code"] == "too_many_clients" and last.closed()
    others[0].close()
    assert client.ok("state")  # a round of the server: it has seen the end of the other by now
    assert fc.client(path).ok("state")
    assert client.ok("stats")["clients_dropped"] == 1


def test_client_that_does_not_read(path: Path) -> None:
    """It is dropped after a while; ticks and other clients go on meanwhile."""
    with flying("--socket", path) as fc:
        client, silent = fc.client(path), fc.client(path)
        silent.socket.settimeout(0.2)
        sent = 0
        try:
            while sent < 50_000_000:
                sent += silent.socket.send(b'{"cmd":"list"}\n' * 1000)
        except TimeoutError:
            pass
        before = client.ok("stats")["ticks"]
        deadline = time.monotonic() + 15
        while client.ok("stats")["clients_dropped"] == 0:
            assert time.monotonic() < deadline
            time.sleep(0.1)
        after = client.ok("stats")
        assert after["ticks"] > before and after["clients_dropped"] == 1


def test_random_bytes(paused: tuple[Fc, Client], path: Path) -> None:
    fc, client = paused
    numbers = random.Random(5)
    good = [b'{"cmd":"set","values":{"sensors.outputs.gyro":[1,2,3]}}\n', b'{"cmd":"get","paths":["machine.tick"]}\n']
    for _ in range(60):
        hostile = fc.client(path)
        data = bytearray(b"".join(numbers.choices(good, k=20)))
        for _ in range(numbers.randrange(40)):
            data[numbers.randrange(len(data))] = numbers.randrange(256)
        hostile.send(data if numbers.random() < 0.5 else numbers.randbytes(500))
        if numbers.random() < 0.5:
            hostile.socket.shutdown(socket.SHUT_WR)
        hostile.close()
    assert client.ok("state")["tick"] == 0
    assert fc.process.poll() is None


# ---- socket and options


def test_socket_is_private_and_not_taken_away(path: Path) -> None:
    with flying("--socket", path, "--paused") as fc:
        client = fc.client(path)
        assert stat.S_IMODE(os.stat(path).st_mode) == 0o600
        second = run(FIXTURE, "--socket", path, "--paused")
        assert second.returncode == 1 and "in use" in second.stderr and str(path) in second.stderr
        assert client.ok("state")
        fc.process.kill()
        fc.process.wait()
    assert path.exists()
    with flying("--socket", path, "--paused") as fc:  # stale: replaced
        deadline = time.monotonic() + 10
        while True:
            try:
                assert fc.client(path).ok("state")
                break
            except (ConnectionRefusedError, AssertionError):
                assert time.monotonic() < deadline
        assert fc.stop()[0] == 0
    path.write_text("precious")
    third = run(FIXTURE, "--socket", path, "--paused")
    assert third.returncode == 1 and "not a socket" in third.stderr and path.read_text() == "precious"


@pytest.mark.parametrize(
    ("arguments", "code", "text"),
    [
        ([], 2, "which machine library"),
        ([FIXTURE, "other"], 2, "other"),
        ([FIXTURE, "--nonsense"], 2, "--nonsense"),
        (
            [FIXTURE, "--hal", "linux"],
            2,
            "stub, linux:PLAN, wire:SPEC, zenoh:tcp:HOST:PORT, composite:PLAN,HAL or ros:tcp:HOST:PORT",
        ),
        ([FIXTURE, "--hal", "wire:"], 2, "a wire is unix:PATH"),
        ([FIXTURE, "--rate", "fast"], 2, "realtime or max"),
        ([FIXTURE, "--ticks", "0"], 2, "--ticks"),
        ([FIXTURE, "--ticks", "1x"], 2, "--ticks"),
        *(
            ([FIXTURE, "--timeout", t], 2, "--timeout needs seconds")
            for t in ("-1", "0", "1.0005", "1e3", "3601", ".5")
        ),
        ([FIXTURE, "--timeout", "0.05"], 2, "--timeout needs --hal wire"),
        ([FIXTURE, "--timeout", "2"], 2, "--timeout needs --hal wire"),
        (
            [FIXTURE, "--timeout", "0.009", "--hal", "zenoh:tcp:127.0.0.1:1,free-running"],
            2,
            "nobody waits for the simulator",
        ),
        ([FIXTURE, "--paused"], 2, "--socket"),
        ([FIXTURE, "--token", "t"], 2, "--token needs --socket"),
        ([FIXTURE, "--namespace", "n"], 2, "--namespace needs --record"),
        ([FIXTURE, "--telemetry-fields", "*"], 2, "--telemetry-fields needs --telemetry"),
        (["/nonexistent/lib.so"], 2, "/nonexistent/lib.so"),
        (["craft.json"], 2, "fcsl build craft.json"),
        ([__file__], 1, "test_fc.py"),
        ([FIXTURE_TWIN], 1, "fixture, fixture_twin"),
        ([FIXTURE, "--machine", "nope"], 1, "it holds: fixture"),
        ([FIXTURE, "--hal", "wire:unix:/nonexistent/wire", "--timeout", "0.05"], 1, "nobody listens"),
        ([FIXTURE, "--record", "/nonexistent/folder/bag"], 1, "/nonexistent/folder/bag"),
        ([FIXTURE, "--record", "bag", "--namespace", "a b"], 1, "namespace"),
        ([FIXTURE, "--record", "bag", "--namespace", "1st"], 1, "namespace"),
        ([FIXTURE, "--socket", "/nonexistent/folder/s"], 1, "/nonexistent/folder/s"),
    ],
)
def test_bad_usage(arguments: list[str], code: int, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.returncode == code and text in result.stderr and result.stderr.count("\n") <= 2
    assert not list(tmp_path.iterdir())


def test_the_page_says_what_each_option_does() -> None:
    page = (Path(__file__).parents[3] / "docs/hardware/flight_computer.md").read_text()
    options = re.findall(r"^  (--[a-z-]+)", run("--help").stdout, re.MULTILINE)
    assert len(options) > 20
    assert [o for o in options if f"`{o}" not in page] == []


def test_help_and_twin() -> None:
    result = run("--help")
    assert result.returncode == 0 and "--record BAG" in result.stdout
    result = run(FIXTURE_TWIN, "--machine", "fixture_twin", "--rate", "max", "--ticks", "1000")
    assert result.returncode == 0 and "'fixture_twin'" in result.stdout and "1000 ticks" in result.stdout


# ---- recording


def test_recording_of_a_real_time_flight(path: Path, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    with flying("--socket", path, "--record", bag, "--namespace", "veh", "--ticks", "30") as fc:
        fc.client(path).set("sensors.outputs.gyro[0]", 1.0)
        code, out, err = fc.wait()
    assert (code, err) == (0, "") and "30 ticks" in out and "0 records dropped" in out
    with AnyReader([bag]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
        messages = [(c.topic, reader.deserialize(d, c.msgtype)) for c, _, d in reader.messages()]
    assert counts["/veh/fixture/pilot"] == 30
    (write,) = [m for topic, m in messages if topic.endswith("/writes") and m.kind == 0]
    forces = {m.tick: m.force for topic, m in messages if topic == "/veh/fixture/pilot"}
    assert all(force == (2.0 if tick >= write.tick else 0.0) for tick, force in forces.items())
    again = run(FIXTURE, "--record", bag)
    assert again.returncode == 1 and "exists already" in again.stderr


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_closes_the_bag(path: Path, tmp_path: Path, number: int) -> None:
    bag = tmp_path / "bag"
    with flying("--socket", path, "--record", bag) as fc:
        client = fc.client(path)
        while client.ok("state")["tick"] < 5:
            time.sleep(0.02)
        code, out, err = fc.stop(number)
    assert (code, err) == (0, "") and not path.exists()
    times = re.findall(
        r"(lateness |tick time) p50 ([0-9.]+) us, p99 ([0-9.]+) us, p99.9 ([0-9.]+) us, max ([0-9.]+) us", out
    )
    assert [what for what, *_ in times] == ["lateness ", "tick time"]
    assert all(sorted(map(float, row)) == list(map(float, row)) and float(row[-1]) > 0 for _, *row in times)
    assert re.search(r"[1-9]\d* requests \(0 refused\), 0 clients dropped", out)
    with AnyReader([bag]) as reader:
        counts = {c.topic: c.msgcount for c in reader.connections}
    assert counts["/fixture/pilot"] >= 5 and f"{counts['/fixture/pilot']} ticks" in out
