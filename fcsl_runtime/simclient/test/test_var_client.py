# SPDX-License-Identifier: Apache-2.0
"""VarClient against the flight program, and against servers that are none."""

from __future__ import annotations

import contextlib
import math
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from native import flying

from simclient import TwinError
from simclient.bag import Bag
from simclient.checkpoint import tick_of
from simclient.vars.client import VarClient
from simclient.vars.wire import VarError

PATHS = (
    "sensors.outputs.gyro",
    "sensors.outputs.gyro[1:]",
    "sensors.outputs.temperature",
    "machine.state",
    "machine.tick",
)


@pytest.fixture
def client(tmp_path: Path) -> Iterator[VarClient]:
    """Of a fixture machine that is paused at tick 0."""
    with flying("--socket", tmp_path / "fc", "--paused") as fc:
        fc.client(tmp_path / "fc").close()
        with VarClient(tmp_path / "fc") as client:
            yield client


def test_every_command(client: VarClient) -> None:
    assert client.describe()["machine"] == "fixture" and "IDLE" in client.describe()["states"]
    assert client.list("machine.") == ["machine.tick", "machine.state", "machine.next_state"]
    reply = client.set({"sensors.outputs.gyro": [1, 2.5, -0.0]})
    assert set(reply["overwritten_by"]) <= {"sensors.outputs.gyro"}
    assert client.get("sensors.outputs.gyro[1]", "machine.tick") == {"sensors.outputs.gyro[1]": 2.5, "machine.tick": 0}
    assert client.get_value("sensors.outputs")["gyro"] == [1.0, 2.5, 0.0]
    assert (
        client.eval("sensors.outputs.gyro[1] * 2 == 5") is True and client.eval("sensors.outputs.gyro[1] / 2") == 1.25
    )
    saved = client.save()
    assert client.tick() == 1 and client.tick(9) == 10 and client.state()["tick"] == 10
    assert [tick_of(c) for c in client.tick_by_tick(7)] == list(range(11, 18)) and tick_of(client.save()) == 17
    assert client.restore(saved)["tick"] == 0 and client.save() == saved
    other = client.describe()["states"][1]
    assert client.set_state(other)["next_state"] == other or client.state()["state"] == other
    assert client.resume()["paused"] is False and client.pause()["paused"] is True
    assert client.stats()["requests"] > 10 and client.describe("sensors.outputs.gyro")["type"].startswith("f")


def test_many_paths_are_described_together(client: VarClient) -> None:
    paths = [*client.list()] * 20
    assert len(paths) > 250  # more than are pending at a time
    assert [told["path"] for told in client.describe_all(paths)] == paths
    with pytest.raises(VarError, match="sensors.outputs.giro"):
        client.describe_all(["machine.tick", "sensors.outputs.giro", "machine.state"])
    assert client.state()["tick"] == 0  # replies that were left are dropped


def test_numbers_that_json_lacks(client: VarClient) -> None:
    with pytest.raises(VarError, match="not finite") as refused:
        client.set({"sensors.outputs.gyro[0]": math.inf})
    assert refused.value.code == "bad_value" and isinstance(refused.value, TwinError)
    client.set({"sensors.outputs.gyro": [math.nan, math.inf, -math.inf]}, allow_non_finite=True)
    nan, *others = client.get_value("sensors.outputs.gyro")
    assert math.isnan(nan) and others == [math.inf, -math.inf] and client.eval("sensors.outputs.gyro[1]") == math.inf


def test_refusals(client: VarClient) -> None:
    for call, code, hint in (
        (lambda: client.get("sensors.outputs.giro"), "unknown_path", "sensors.outputs.gyro"),
        (lambda: client.get(["machine.tick"]), "bad_request", ""),  # type: ignore[arg-type]
        (lambda: client.set({"machine.tick": 1}), "refused", ""),
        (lambda: client.set_state("IDEL"), "unknown_state", "IDLE"),
        (lambda: client.eval("1 +"), "bad_expression", ""),
        (lambda: client.inject("sensors", "degrade"), "bad_value", "degraded"),
        (lambda: client.inject("sensor", "fault"), "bad_value", "sensors"),
        (lambda: client.attach("nothing"), "bad_value", ""),
        (lambda: client.record("/nonexistent/bag"), "refused", ""),
        (lambda: client.set({"sensors.outputs.gyro": ["x" * 70000]}), "too_large", ""),
    ):
        with pytest.raises(VarError) as refused:
            call()
        assert (refused.value.code, refused.value.hint) == (code, hint), refused.value
    with pytest.raises(VarError, match="did you mean `sensors.outputs.gyro`"):
        client.get("sensors.outputs.giro")
    assert client.state()["tick"] == 0
    client.resume()
    for call in (client.tick, client.stop_recording):
        with pytest.raises(VarError) as refused:
            call()
        assert refused.value.code == "not_paused"


@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    st.booleans(), st.integers(1, 4), st.lists(st.tuples(st.integers(1, 30), st.floats(-9, 9)), min_size=1, max_size=4)
)
def test_samples_are_what_get_says(client: VarClient, binary: bool, every: int, runs: list[tuple[int, float]]) -> None:
    """Against `get` after every tick of the same run."""
    start = client.save()
    with client.subscribe(*PATHS, every=every, binary=binary) as subscription:
        for ticks, value in runs:
            client.set({"sensors.outputs.gyro[2]": value})
            client.tick(ticks)
        end = client.state()["tick"]
        due = [tick for tick in range(tick_of(start) + 1, end + 1) if tick % every == 0]
        samples = [subscription.read(10) for _ in due]
        assert subscription.read(0) is None
    client.restore(start)
    expected = {}
    for ticks, value in runs:
        client.set({"sensors.outputs.gyro[2]": value})
        for _ in range(ticks):
            tick = client.tick()
            expected[tick] = client.get(*PATHS)
    assert [sample.tick for sample in samples if sample] == due
    for sample in samples:
        assert sample and sample.lost == 0
        assert sample.values == expected[sample.tick]


def test_samples_that_nobody_reads_in_time_are_counted(client: VarClient, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("simclient.vars.subscription._KEPT", 4)
    with client.subscribe("machine.tick") as samples:
        client.tick(10)
        assert samples.waiting() == 4
        assert [(s.tick, s.lost) for s in (next(samples) for _ in range(4))] == [(7, 3), (8, 4), (9, 5), (10, 6)]
        client.tick()
        assert next(samples).lost == 6


def test_an_iterator_of_a_running_machine_ends_when_closed(client: VarClient) -> None:
    client.resume()
    subscription = client.subscribe("machine.tick")
    ticks = [next(subscription).tick for _ in range(5)]
    assert ticks == list(range(ticks[0], ticks[0] + 5))
    subscription.close()
    rest = [sample.tick for sample in subscription]
    assert rest == list(range(ticks[-1] + 1, ticks[-1] + 1 + len(rest)))
    subscription.close()


@pytest.mark.parametrize("binary", [True, False])
def test_a_path_that_names_nothing_is_empty(client: VarClient, binary: bool) -> None:
    """More often than there are subscriptions, so that none is left behind."""
    for _ in range(6):
        with client.subscribe("sensors.outputs.gyro[3:]", "machine.tick", binary=binary) as samples:
            tick = client.tick()
            sample = samples.read(10)
            assert sample and sample.values == {"sensors.outputs.gyro[3:]": [], "machine.tick": tick}


def test_a_number_of_ticks_that_is_none_is_refused(client: VarClient) -> None:
    for count in (1.5, "2", -1, 0):
        with pytest.raises(VarError):
            client.tick(count)  # type: ignore[arg-type]
    assert client.state()["tick"] == 0


def test_a_read_ends_in_time_while_others_get_samples(client: VarClient) -> None:
    """At 100 ticks per second: the samples that it waits for come after 20 s, others all the time."""
    client.resume()
    with client.subscribe("machine.tick") as often, client.subscribe("machine.state", every=2000) as seldom:
        assert next(often).tick < 2000
        assert seldom.read(timeout_s=0.1) is None and seldom.read(timeout_s=0) is None
        assert often.read(timeout_s=10) is not None


def test_a_reply_that_an_interrupted_call_left_is_not_taken_for_another(client: VarClient) -> None:
    client._send([("tick", {"count": 5}), ("get", {"paths": ["machine.state"]})])  # as Ctrl-C leaves it
    assert client.get("machine.tick") == {"machine.tick": 5}


@contextlib.contextmanager
def serving(path: Path, answer: bytes | None) -> Iterator[None]:
    """A server that answers the first request so, or never, and then closes."""
    done = threading.Event()
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(str(path))
        listener.listen()

        def serve() -> None:
            connection, _ = listener.accept()
            with connection:
                connection.recv(1000)
                if answer is None:
                    done.wait(30)
                else:
                    connection.sendall(answer)

        thread = threading.Thread(target=serve)
        thread.start()
        try:
            yield
        finally:
            done.set()
            thread.join()


@pytest.mark.parametrize(
    ("answer", "code"),
    [
        (None, "timeout"),
        (b"", "closed"),
        (b'{"ok":', "closed"),
        (b"HTTP/1.1 400 Bad Request\r\n", "protocol"),
        (b"[]\n", "protocol"),
        (b'{"ok":true}\n', "protocol"),
        (b"\xff\x02" + bytes(30), "protocol"),
        (b'{"ok":false,"error":{"code":"too_slow","message":"m","hint":""}}\n', "too_slow"),
    ],
)
def test_what_is_no_variable_server(tmp_path: Path, answer: bytes | None, code: str) -> None:
    with serving(tmp_path / "s", answer), VarClient(tmp_path / "s", timeout_s=0.2 if answer is None else 10) as client:
        with pytest.raises(VarError) as refused:
            client.eval("1")
        assert refused.value.code == code


def test_a_server_that_reads_nothing_is_not_waited_for(tmp_path: Path) -> None:
    """The first requests are sent and not answered; one then finds no more room, and is the last of this connection."""
    refused: list[VarError] = []
    with serving(tmp_path / "s", None), VarClient(tmp_path / "s", timeout_s=0.1) as client:
        while not refused or refused[-1].code == "timeout":
            with pytest.raises(VarError) as told:
                client.eval(" " * 60_000)
            refused.append(told.value)
    *_, full, after = refused
    assert "accepts no request within 0.1 s" in full.message and after.code == "closed"


def test_a_checkpoint_that_never_gets_whole_is_not_waited_for(tmp_path: Path) -> None:
    replies = b'{"ok":true,"id":1,"bytes":9,"data":"AAAA"}\n{"ok":true,"id":2,"data":""}\n'
    with serving(tmp_path / "s", replies), VarClient(tmp_path / "s") as client:
        with pytest.raises(VarError) as refused:
            client.save()
        assert refused.value.code == "protocol"


def test_nobody_is_there(tmp_path: Path) -> None:
    for address in (tmp_path / "nothing", "tcp:127.0.0.1:1", "tcp:somewhere", "tcp:127.0.0.1:65537", "tcp:::1:²"):
        with pytest.raises(VarError) as refused:
            VarClient(address)
        assert refused.value.code == "unreachable"
    with pytest.raises(VarError) as refused:
        VarClient(tmp_path / "nothing", token=tmp_path / "no token")
    assert refused.value.code == "unreachable"


def test_a_server_that_accepts_nobody_is_waited_for(tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener, contextlib.ExitStack() as waiting:
        listener.bind(str(tmp_path / "s"))
        listener.listen(0)
        with pytest.raises(BlockingIOError):
            while True:
                client = waiting.enter_context(socket.socket(socket.AF_UNIX))
                client.setblocking(False)
                client.connect(str(tmp_path / "s"))
        with pytest.raises(VarError, match=r"accepts no connection within 0.1 s") as refused:
            VarClient(tmp_path / "s", timeout_s=0.1)
        assert refused.value.code == "unreachable"


def test_tcp_with_a_token(tmp_path: Path) -> None:
    with flying("--socket", "tcp:127.0.0.1:0", "--token", tmp_path / "token", "--paused") as fc:
        assert fc.process.stdout is not None
        address = next(line.split()[-1] for line in fc.process.stdout if "commands on" in line)
        with VarClient(address, token=tmp_path / "token") as client:
            assert client.tick(3) == 3
        with VarClient(address) as client, pytest.raises(VarError) as refused:
            client.tick()
        assert refused.value.code == "unauthorized"


def test_what_a_test_does_to_a_machine(client: VarClient, tmp_path: Path) -> None:
    client.record(tmp_path / "bag", "test")
    client.attach("imu.gyro")
    client.sample("imu.gyro", [1.0, math.nan, 3.0], age_ticks=2, stamp_ns=77)
    client.tick()
    shown = client.get("channels.imu.gyro.valid", "channels.imu.gyro.age_ticks", "channels.imu.gyro.stamp_ns")
    assert list(shown.values()) == [True, 2, 77] and client.eval("isnan(sensors.outputs.gyro[1])") is True
    client.stop_recording()
    bag = Bag(tmp_path / "bag")
    assert bag.machine("fixture").writes.startswith("/test/fixture/")


@pytest.mark.parametrize(
    "members",
    [
        {"cmd": "sample", "channel": "imu.gyro"},
        {"cmd": "sample", "channel": "imu.gyro", "value": 1.0},
        {"cmd": "sample", "channel": "imu.gyro", "value": [1, 2]},
        {"cmd": "sample", "channel": "imu.gyro", "value": [1, 2, "nan"]},
        {"cmd": "sample", "channel": "imu.gyro", "value": [1, 2, 3], "age_ticks": -1},
        {"cmd": "sample", "channel": "imu.gyro", "value": [1, 2, 3], "age_ticks": 2**32},
        {"cmd": "sample", "channel": "imu.gyro", "value": [1, 2, 3], "stamp_ns": 2**63},
        {"cmd": "sample", "channel": "gyro", "value": [1, 2, 3]},
        {"cmd": "attach"},
        {"cmd": "inject", "instance": "sensors"},
        {"cmd": "inject", "what": "fault"},
        {"cmd": "record"},
        {"cmd": "record", "bag": "x" * 2000},
        {"cmd": "record", "bag": "/proc/nothing", "namespace": "x" * 300},
        {"cmd": "stop_recording", "bag": "x"},
    ],
)
def test_malformed_commands_change_nothing(client: VarClient, members: dict[str, object]) -> None:
    before = client.save()
    with pytest.raises(VarError) as refused:
        client._call(**members)  # type: ignore[arg-type]
    assert refused.value.code in ("bad_request", "bad_value", "refused") and client.save() == before
