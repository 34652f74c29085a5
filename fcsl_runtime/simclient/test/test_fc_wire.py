# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc in lock-step with a simulator over the wire. wire_sim compares every actuator message with its own, bit by bit."""

from __future__ import annotations

import signal
import socket
import struct
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from native import FIXTURE, WIRE_SIM, flying
from rosbags.highlevel import AnyReader

from simclient.link.message import Channel, Kind, Message, decode, encode, table_hash


@contextmanager
def simulator(wire: Path, ticks: int, end: str) -> Iterator[subprocess.Popen[str]]:
    process = subprocess.Popen(
        [WIRE_SIM, FIXTURE, f"unix:{wire}", str(ticks), end], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def test_same_bits_as_in_process(tmp_path: Path) -> None:
    wire, bag = tmp_path / "wire", tmp_path / "bag"
    with (
        simulator(wire, 3000, "end") as sim,
        flying("--hal", f"wire:unix:{wire}", "--record", bag, "--timeout", "10") as fc,
    ):
        code, out, err = fc.wait()
        assert sim.wait(timeout=30) == 0, sim.communicate()
    assert (code, err) == (0, "") and "paced by the simulator" in out
    assert "3000 ticks" in out and "0 overruns" in out and "0 sensor messages refused, 0 records dropped" in out
    with AnyReader([bag]) as reader:
        messages = [(c.topic, reader.deserialize(d, c.msgtype)) for c, _, d in reader.messages()]
    pilot = [m for topic, m in messages if topic == "/fixture/pilot"]
    assert [m.tick for m in pilot] == list(range(3000))
    # Every sample is a recorded write; attaching came before the record and shows in its checkpoint.
    writes = [m for topic, m in messages if topic == "/fixture/record/writes"]
    assert {m.kind for m in writes} == {3} and {m.path for m in writes} == {"imu.gyro", "panel.armed"}
    assert len([m for m in writes if m.path == "panel.armed"]) == 3000
    counted = [m for topic, m in messages if topic == "/hal"]
    assert [m.tick for m in counted] == list(range(3000))
    assert (counted[-1].messages, counted[-1].commands, counted[-1].messages_dropped) == (3000, 3000, 0)
    failed = [m.tick for topic, m in messages if topic == "/fixture/sensors" and m.health == 2]
    assert failed == list(range(105, 121))  # last sample at 99, max_age_ticks 5


def test_timeout_names_the_tick(tmp_path: Path) -> None:
    wire, bag = tmp_path / "wire", tmp_path / "bag"
    with (
        simulator(wire, 17, "hang"),
        flying("--hal", f"wire:unix:{wire}", "--record", bag, "--timeout", "0.4") as fc,
    ):
        code, out, err = fc.wait()
    assert code == 1 and err == "fcsl-fc: no time message of tick 17 within 400 ms\n" and "17 ticks" in out
    with AnyReader([bag]) as reader:  # and the bag is whole
        assert {c.topic: c.msgcount for c in reader.connections}["/fixture/pilot"] == 17


def test_killed_simulator(tmp_path: Path) -> None:
    wire = tmp_path / "wire"
    with simulator(wire, 9, "die"), flying("--hal", f"wire:unix:{wire}") as fc:
        code, _, err = fc.wait()
    assert code == 1 and "went away before tick 9" in err


def test_a_simulator_that_paces_leaves_no_deadline_to_miss(tmp_path: Path) -> None:
    wire = tmp_path / "wire"
    with (
        simulator(wire, 9, "end"),
        flying("--hal", f"wire:unix:{wire}", "--timeout", "20", "--missed-deadline", "skip") as fc,
    ):
        code, _, err = fc.wait()
    assert code == 1 and "here a simulator or a device paces them" in err


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_while_waiting(tmp_path: Path, number: int) -> None:
    wire = tmp_path / "wire"
    with simulator(wire, 5, "hang") as sim, flying("--hal", f"wire:unix:{wire}", "--timeout", "20") as fc:
        assert sim.stdout is not None and sim.stdout.readline() == "5 ticks\n"
        begun = time.monotonic()
        code, out, err = fc.stop(number)
        assert (code, err) == (0, "") and "5 ticks" in out and time.monotonic() - begun < 5


def test_commands_in_lock_step(tmp_path: Path) -> None:
    """Paused, the flight program makes the simulator wait; a command makes the tick."""
    wire, socket = tmp_path / "wire", tmp_path / "fc.sock"
    with (
        simulator(wire, 100, "end") as sim,
        flying("--hal", f"wire:unix:{wire}", "--socket", socket, "--paused") as fc,
    ):
        client = fc.client(socket)
        assert client.ok("tick", count=60)["tick"] == 60
        assert client.get("channels.imu.gyro.valid") is True
        assert client.get("machine.state") == "ACTIVE"
        here = client.ok("save")["data"]
        assert client.ok("restore", data=here)["tick"] == 60  # the simulator is at this tick, too
        client.ok("tick")
        error = client.error("restore", data=here)
        assert error["code"] == "refused" and "the checkpoint is of tick 60" in error["message"]
        assert "is at tick 61: only one of this very tick can be restored" in error["message"]
        assert client.ok("resume")
        code, out, _ = fc.wait()
        assert sim.wait(timeout=30) == 0
    assert code == 0 and "100 ticks" in out


# ---- a simulator written from docs/reference/transports.md ---------------------------------------------------------------------------

F64, BOOL = 6, 0
#: The channels of the fixture machine.
TABLE = [Channel(257, False, F64, (3,)), Channel(258, False, BOOL), Channel(513, True, F64), Channel(514, True, BOOL)]
TICK_HZ, HELLO, REFUSAL, END = 100, 1, 2, 3


def control(kind: int, table: int = 0, tick_hz: int = 0, text: bytes = b"", sends_time: int = 0) -> bytes:
    return b"FCSW" + struct.pack("<HBBIQ", 1, kind, sends_time, table, tick_hz) + text


@contextmanager
def listening(path: Path) -> Iterator[socket.socket]:
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
        listener.bind(str(path))
        listener.listen()
        listener.settimeout(30)
        yield listener


def test_a_simulator_written_from_the_page_flies_the_controller(tmp_path: Path) -> None:
    wire, hello = tmp_path / "wire", control(HELLO, table_hash(TABLE), TICK_HZ)
    with listening(wire) as listener, flying("--hal", f"wire:unix:{wire}", "--timeout", "30") as fc:
        peer, _ = listener.accept()
        peer.settimeout(30)
        assert peer.recv(4096) == hello
        peer.send(control(HELLO, table_hash(TABLE), TICK_HZ, sends_time=1))
        for tick in range(20):
            rate = 0.25 * tick
            good = encode(Message(Kind.SENSORS, tick, {257: (rate, 0.0, 0.0), 258: (False,)}), TABLE)
            peer.send(good[:-1] + bytes([good[-1] ^ 1]))  # dropped
            peer.send(good)
            peer.send(encode(Message(Kind.TIME, tick, time_ns=tick * 10**7), TABLE))
            answer = decode(peer.recv(4096), Kind.ACTUATORS, TABLE)
            assert (answer.tick, answer.armed, answer.skipped) == (tick, True, 0)
            assert answer.values[513] == (min(2.0 * rate, 10.0),)
        peer.send(control(END))
        code, out, err = fc.wait()
        peer.close()
    assert (code, err) == (0, "") and "20 ticks" in out and "0 sensor messages refused" in out


def test_a_rig_that_sends_no_time_leaves_the_clock_to_the_controller(tmp_path: Path) -> None:
    """It may fall silent and go; the controller makes its ticks, and says how old the samples are."""
    wire, variables = tmp_path / "wire", tmp_path / "fc.sock"
    hal = ("--hal", f"wire:unix:{wire}", "--timeout", "30", "--socket", variables)
    with listening(wire) as listener, flying(*hal) as fc:
        peer, _ = listener.accept()
        peer.settimeout(30)
        assert peer.recv(4096) == control(HELLO, table_hash(TABLE), TICK_HZ)
        peer.send(control(HELLO, table_hash(TABLE), TICK_HZ))
        first = decode(peer.recv(4096), Kind.ACTUATORS, TABLE)
        assert first.tick == 0  # nothing was sensed yet
        for number in range(100):  # faster than the ticks: the newest counts
            rate = 1.5 if number == 99 else 0.0
            peer.send(encode(Message(Kind.SENSORS, 12345 + number, {257: (rate, 0.0, 0.0), 258: (False,)}), TABLE))
        while decode(peer.recv(4096), Kind.ACTUATORS, TABLE).values[513] != (3.0,):
            pass
        client = fc.client(variables)
        while client.get("hal.messages") < 100:  # the command leaves before the tick's values are there for clients
            pass
        counters = [client.get(f"hal.{name}") for name in ("connected", "messages", "messages_dropped")]
        assert counters == [1, 100, 0]
        peer.close()
        while client.get("hal.connected") == 1 or client.get("hal.ticks_without") < 20:
            pass
        assert client.get("channels.imu.gyro.valid") is False
        code, out, err = fc.stop(signal.SIGTERM)
    assert (code, err) == (0, "") and "real time" in out and "the rig is gone" in out


def test_a_refusal_written_from_the_page_is_told(tmp_path: Path) -> None:
    wire = tmp_path / "wire"
    with listening(wire) as listener, flying("--hal", f"wire:unix:{wire}", "--timeout", "30") as fc:
        peer, _ = listener.accept()
        peer.send(control(REFUSAL, text=b"another vehicle"))
        code, _, err = fc.wait()
        peer.close()
    assert code != 0 and "the simulator refused: another vehicle" in err
