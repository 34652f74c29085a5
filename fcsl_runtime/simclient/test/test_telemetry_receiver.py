# SPDX-License-Identifier: Apache-2.0
"""Telemetry as its users meet it: sockets, its thread, waiting, paths and what it says when it cannot."""

from __future__ import annotations

import os
import socket
import threading

import numpy as np
import pytest
from telemetry_packets import Channel, Sender
from test_telemetry_faults import adds_up, assert_truth

from simclient import TwinError
from simclient.telemetry.receiver import Telemetry


def send(port: int, *datagrams: bytes, host: str = "127.0.0.1") -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_DGRAM) as sock:
        for one in datagrams:
            sock.sendto(one, (host, port))


def fed(*datagrams: bytes) -> Telemetry:
    telemetry = Telemetry()
    for one in datagrams:
        telemetry.feed(one)
    return telemetry


@pytest.mark.parametrize("host", ["127.0.0.1", "::1", "localhost"])
def test_it_receives_in_a_thread_of_its_own(host: str) -> None:
    sender = Sender()
    with Telemetry(0, host) as telemetry:
        send(telemetry.port, *sender.configuration(), *sender.data(0), b"hello", *sender.data(1), host=host)
        telemetry.wait(ticks=2)
        first = telemetry.window("nav.outputs")
        assert telemetry.latest("nav.outputs.angle") == sender.values(1)[1][0]
        send(telemetry.port, *sender.data(2), *sender.data(3), host=host)
        telemetry.wait(ticks=2, after=first)
        assert telemetry.window("nav.outputs", after=first).tick.tolist() == [2, 3]
        assert (telemetry.counts.malformed, telemetry.counts.received) == (1, 6)
    assert_truth(telemetry.window(), sender, [0, 1, 2, 3])  # what came can be read after the end
    telemetry.close()
    with pytest.raises(TwinError, match="has no port, or was closed"):
        telemetry.start()


def test_two_threads_that_close_it_close_it_once(monkeypatch: pytest.MonkeyPatch) -> None:
    closed: list[int] = []
    close = os.close

    def noted(descriptor: int) -> None:
        closed.append(descriptor)
        both.wait(0.2) if len(closed) == 1 else both.set()  # the other one has time to come here, too
        close(descriptor)

    both = threading.Event()
    monkeypatch.setattr(os, "close", noted)
    telemetry = Telemetry(0).start()
    threads = [threading.Thread(target=telemetry.close) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(closed) == 1


def test_it_receives_when_it_is_asked_to() -> None:
    sender = Sender()
    telemetry = Telemetry(0)
    try:
        assert telemetry.poll(0) == 0
        send(telemetry.port, *sender.configuration(), *(d for s in range(300) for d in sender.data(s)))
        telemetry.wait(ticks=300)
        assert_truth(telemetry.window(n=2), sender, [298, 299])
        assert telemetry.poll(0) == 0
    finally:
        telemetry.close()


def test_the_memory_of_a_window_is_what_its_rows_take(monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where it has fewer rows than were asked for, because bodies are large."""
    sender = Sender()
    monkeypatch.setattr("simclient.telemetry.ring.WINDOW_BYTES_MAX", 20 * sender.body_bytes)
    telemetry = Telemetry()
    assert telemetry.window_bytes == 0
    for packets, rows in ((0, 0), (7, 7), (50, 20)):
        for one in [*sender.configuration(), *(d for s in range(packets) for d in sender.data(s))]:
            telemetry.feed(one)
        assert telemetry.window_bytes == rows * sender.body_bytes == len(telemetry.window()) * sender.body_bytes


def test_a_thread_that_waits_is_woken_by_what_another_feeds() -> None:
    sender, telemetry = Sender(), Telemetry()
    waiting = threading.Thread(target=telemetry.wait, args=(60.0, 50))
    waiting.start()
    for datagram in [*sender.configuration(), *(d for s in range(50) for d in sender.data(s))]:
        telemetry.feed(datagram)
    waiting.join(30)
    assert not waiting.is_alive()


def test_reading_while_another_thread_receives_never_tears_a_row() -> None:
    """Every value of a row is the row's own sequence, whenever it is read."""
    sender = Sender(channels=(Channel("a.outputs.b", 4, (40,)),), stride=100)
    telemetry = Telemetry(window_ticks=16)
    for datagram in sender.configuration():
        telemetry.feed(datagram)
    done = threading.Event()

    def feed() -> None:
        for sequence in range(3000):
            body = sender.body(0)[:24] + np.full(40, sequence, np.uint64).tobytes()
            for datagram in sender.cut(2, sequence, body):
                telemetry.feed(datagram)
        done.set()

    feeding = threading.Thread(target=feed)
    feeding.start()
    reads = 0
    while not done.is_set() or not reads:
        window = telemetry.window()
        assert (window["a.outputs.b"] == window.sequence[:, None]).all()
        assert (np.diff(window.sequence) > 0).all() and len(window) <= 16
        reads += 1
    feeding.join()
    assert len(telemetry.window()) == 16


def test_paths_are_those_of_the_variable_server() -> None:
    sender = Sender()
    telemetry = fed(*sender.configuration(), *sender.data(0))
    values = {c.path: v for c, v in zip(sender.channels, sender.values(0), strict=True)}
    assert (
        telemetry.latest("nav.outputs.P[1][2]") == telemetry.latest("nav.outputs.P[1, 2]") == values["nav.outputs.P"][5]
    )
    assert telemetry.latest("nav.outputs.targets[1].position") == values["nav.outputs.targets[1].position"]
    assert telemetry.latest("nav.outputs.targets")[0]["position"] == values["nav.outputs.targets[0].position"]
    window = telemetry.window("nav.outputs.targets")
    assert window["nav.outputs.targets[1].position[0]"].tolist() == values["nav.outputs.targets[1].position"][:1]
    assert telemetry.machine.name == "probe" and telemetry.machine.states == ("IDLE", "RUN", "DONE")
    assert telemetry.machine.requests == ("GO", "STOP") and telemetry.configuration.every == 1
    channel = telemetry.channels["nav.outputs.P"]
    assert (channel.type, channel.shape, channel.unit, channel.labels) == ("f32", (2, 3), "m", ())
    assert telemetry.channels["machine.state"].labels == ("IDLE", "RUN", "DONE")


def test_a_window_is_written_as_a_trace_is(tmp_path: object) -> None:
    sender = Sender()
    telemetry = fed(*sender.configuration(), *sender.data(0), *sender.data(2))
    path = f"{tmp_path}/w.csv"
    telemetry.window(["nav.outputs.angle", "machine.state"]).to_csv(path)
    lines = open(path).read().splitlines()
    assert lines[0] == "tick,time_s,machine.state,nav.outputs.angle" and [x.split(",")[0] for x in lines[1:]] == [
        "0",
        "2",
    ]


def test_a_wrong_path_says_which_is_near() -> None:
    sender = Sender()
    telemetry = fed(*sender.configuration(), *sender.data(0))
    for read in (telemetry.latest, telemetry.window):
        with pytest.raises(TwinError, match="`probe` sends no such field; did you mean `nav.outputs.angle`"):
            read("nav.outputs.angel")
        with pytest.raises(TwinError, match=r"index `3` is not in 0..2"):
            read("nav.outputs.on[3]")
    with pytest.raises(TwinError, match="was not traced|no such field"):
        telemetry.window("machine.state")["nav.outputs.angle"]


def test_it_says_what_came_instead_of_telemetry() -> None:
    with Telemetry(0) as telemetry:
        with pytest.raises(
            TwinError, match=f"nothing received on port {telemetry.port}; start the sender with --telemetry"
        ):
            telemetry.wait(0.01)
        send(telemetry.port, b"hello")
        with pytest.raises(TwinError, match="none of 1 datagrams received"):
            telemetry.wait(0.5)
        send(telemetry.port, *Sender().data(3))
        with pytest.raises(TwinError, match="2 datagrams received.*but no complete configuration"):
            telemetry.wait(0.5)
        with pytest.raises(TwinError, match="no telemetry yet: 2 datagrams"):
            telemetry.window()
        assert telemetry.session is None
        send(telemetry.port, *Sender().configuration())
        telemetry.wait()
        with pytest.raises(TwinError, match="no 2 ticks of telemetry within 0.01 s: 1 packets received"):
            telemetry.wait(0.01, ticks=2)
        with pytest.raises(TwinError, match="receives in its thread"):
            telemetry.poll()
    with pytest.raises(TwinError, match="no tick of telemetry yet"):
        fed(*Sender().configuration()).latest("nav.outputs.angle")


def test_a_window_has_a_row_or_more() -> None:
    telemetry = fed(*Sender().configuration(), *Sender().data(0), *Sender().data(1))
    for n in (0, -1, 1.5, "2"):
        with pytest.raises(TwinError, match="n=.*expected a number of rows, 1 or more"):
            telemetry.window(n=n)  # type: ignore[arg-type]
    for read in (telemetry.window, telemetry.wait):
        with pytest.raises(TwinError, match="after=5: expected a Window"):
            read(after=5)  # type: ignore[operator]
    assert telemetry.window(n=np.int64(1)).tick.tolist() == [1]  # type: ignore[arg-type]


def test_a_window_without_rows_has_columns() -> None:
    window = fed(*Sender().configuration()).window()
    assert window["nav.outputs.P"].shape == (0, 2, 3) and len(window.tick) == 0


def test_what_cannot_be_listened_on() -> None:
    with Telemetry(0) as first:
        with pytest.raises(TwinError, match=rf"cannot listen on 127.0.0.1:{first.port}: .*give another port"):
            Telemetry(first.port)
    with pytest.raises(TwinError, match="cannot listen on no.such.host.invalid:1"):
        Telemetry(1, "no.such.host.invalid")
    with pytest.raises(TwinError, match="cannot listen on 127.0.0.1:70000"):
        Telemetry(70_000)
    with pytest.raises(TwinError, match="a port is a whole number"):
        Telemetry("udp:9870")  # type: ignore[arg-type]
    with pytest.raises(TwinError, match="window_ticks=0"):
        Telemetry(window_ticks=0)
    with pytest.raises(TwinError, match="50 ticks cannot be in a window of 10"):
        Telemetry(window_ticks=10).wait(ticks=50)


@pytest.mark.parametrize("kind", [bytes, bytearray, memoryview])
def test_bytes_of_any_kind(kind: type) -> None:
    telemetry = fed(
        *(kind(d) for d in [*Sender().configuration(), *Sender().data(0), b"", b"FCST" * 20, bytes(70_000)])
    )
    assert telemetry.counts.malformed == 3 and telemetry.counts.packets == 1 and adds_up(telemetry.counts)


def test_opening_and_closing_leaks_nothing() -> None:
    def used() -> tuple[int, int]:
        return len(os.listdir("/proc/self/fd")), threading.active_count()

    before = used()
    for _ in range(200):
        with Telemetry(0) as telemetry:
            send(telemetry.port, b"x")
    assert used() == before
