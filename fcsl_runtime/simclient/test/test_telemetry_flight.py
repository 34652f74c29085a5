# SPDX-License-Identifier: Apache-2.0
"""Telemetry of real flight programs: what the receiver shows is what a twin of the same machine traces."""

from __future__ import annotations

import random
import socket
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from native import Fc, flying

from simclient import AlgTwin, Twin
from simclient.machine_build import build_config
from simclient.telemetry.receiver import Telemetry
from simclient.twin.trace import Trace
from simclient.vars.client import VarClient

ROOT = Path(__file__).resolve().parents[3]
CONFIGS = {"minimal": "examples/minimal/minimal.json", "ahrs": "examples/ahrs/ahrs.json"}


@pytest.fixture
def telemetry() -> Iterator[Telemetry]:
    with Telemetry(0, window_ticks=100_000) as telemetry:
        yield telemetry


def address(telemetry: Telemetry, every: int = 1) -> str:
    return f"udp:127.0.0.1:{telemetry.port}/{every}"


def commanded(fc: Fc, path: Path) -> VarClient:
    """A client, as soon as the program listens."""
    fc.client(path).close()
    return VarClient(path)


def same(telemetry: Telemetry, trace: Trace) -> None:
    """Every channel of every tick, bit for bit."""
    window = telemetry.window()
    assert window.tick.tolist() == trace.tick.tolist() and (window.time_s == trace.time_s).all()
    assert {f.path for f in window.fields} == {f.path for f in trace.fields}
    for field in window.fields:
        got, wanted = window[field.path], trace[field.path]
        assert got.dtype == wanted.dtype and got.tobytes() == wanted.tobytes(), field.path


def fly_both(client: VarClient, twin: Twin, telemetry: Telemetry, ticks: int) -> None:
    """The same sets and ticks for both; as many ticks at a time as no sender misses."""
    source = random.Random(7)
    writable = [f for f in twin.fields() if f.role == "output" and f.writable and f.type == "f64"]
    window = None
    for _ in range(0, ticks, 10):
        field = source.choice(writable)
        value = np.array([source.uniform(-1, 1) for _ in range(field.count)]).reshape(field.shape).tolist()
        client.set({field.path: value})
        client.tick(10)
        twin.set(field.path, value)
        twin.tick(10)
        telemetry.wait(ticks=10, after=window)
        window = telemetry.window()


@pytest.mark.parametrize("name", CONFIGS)
def test_it_shows_what_a_twin_traces(telemetry: Telemetry, tmp_path: Path, name: str) -> None:
    library, machine = build_config(ROOT / CONFIGS[name], "simulation", None)
    path = tmp_path / "fc.sock"
    options = ["--paused", "--no-overrun-check", "--machine", machine, "--socket", path]
    with (
        flying(*options, "--telemetry", address(telemetry), "--telemetry-fields", "*", library=str(library)) as fc,
        commanded(fc, path) as client,
        AlgTwin.from_library(library, machine) as twin,
        twin.trace() as trace,
    ):
        fly_both(client, twin, telemetry, 300)
        same(telemetry, trace)
        assert telemetry.machine.name == name and telemetry.machine.source_hash == twin.machine.source_hash
        assert telemetry.machine.states == twin.machine.states
        for path_, channel in telemetry.channels.items():
            field = twin.machine.fields[path_]
            assert (channel.type, channel.shape, channel.unit) == (field.type, field.shape, field.unit)
            assert telemetry.latest(path_) == twin.get_value(path_)
        counts = telemetry.counts
        assert (counts.packets, counts.lost, counts.overwritten, counts.malformed, counts.sessions) == (300, 0, 0, 0, 1)


def test_states_and_requests_have_their_names(telemetry: Telemetry, tmp_path: Path) -> None:
    path = tmp_path / "fc.sock"
    with flying("--paused", "--socket", path, "--telemetry", address(telemetry)) as fc, commanded(fc, path) as client:
        client.tick()
        client.set({"sensors.outputs.armed": True})
        client.tick(3)
        telemetry.wait(ticks=4)
        window = telemetry.window()
    assert window["machine.state"].tolist() == ["IDLE", "IDLE", "ACTIVE", "ACTIVE"]
    assert window["pilot.outputs.transition_request"][:2].tolist() == ["", "tr_GO"]


@pytest.mark.parametrize("every", [1, 7])
def test_every_tick_of_a_fast_flight_is_shown_or_counted(telemetry: Telemetry, every: int) -> None:
    """As fast as the machine can: the sender may miss some and the network lose some, but all are accounted for."""
    ticks = 20_000
    with flying("--rate", "max", "--ticks", str(ticks), "--telemetry", address(telemetry, every)) as fc:
        assert fc.wait()[0] == 0
    telemetry.wait()
    window, counts = telemetry.window(), telemetry.counts
    assert (window.tick % every == 0).all() and (np.diff(window.sequence) > 0).all()
    assert len(window) == counts.packets and counts.lost == window.sequence[-1] + 1 - counts.packets
    due = -(-ticks // every)
    assert counts.packets + counts.lost + counts.overwritten <= due
    assert (np.diff(window.tick) >= every).all() and telemetry.configuration.every == every


def recorded(tmp_path: Path, ticks: int) -> list[bytes]:
    """The datagrams of a flight, in the order in which they came."""
    path = tmp_path / "fc.sock"
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        sock.settimeout(10)
        options = ["--paused", "--socket", path, "--telemetry", f"udp:127.0.0.1:{sock.getsockname()[1]}"]
        datagrams = []
        with flying(*options) as fc, commanded(fc, path) as client:
            client.tick(ticks)
            while sum(d[5] == 2 for d in datagrams) < ticks:
                datagrams.append(sock.recv(65_535))
    return datagrams


def test_it_joins_a_flight_late(tmp_path: Path) -> None:
    """From any datagram on: with the first configuration behind it, all that came since then is there."""
    datagrams = recorded(tmp_path, 40)
    for first in range(len(datagrams)):
        telemetry = Telemetry()
        for datagram in datagrams[first:]:
            telemetry.feed(datagram)
        if any(d[5] == 1 for d in datagrams[first:]):
            ticks = 40 - sum(d[5] == 2 for d in datagrams[:first])
            assert telemetry.window().tick.tolist() == list(range(40 - ticks, 40))
        else:
            assert telemetry.session is None and telemetry.counts.waiting == len(datagrams) - first


def test_a_flight_program_that_is_started_again(telemetry: Telemetry, tmp_path: Path) -> None:
    path = tmp_path / "fc.sock"
    options = ["--paused", "--socket", path, "--telemetry", address(telemetry)]
    with flying(*options) as fc, commanded(fc, path) as client:
        client.tick(5)
        telemetry.wait(ticks=5)
        before = telemetry.window()
    with flying(*options) as fc, commanded(fc, path) as client:
        done = 0
        while telemetry.session == before.session:  # until the first has been silent for long enough
            done = client.tick()
        while (window := telemetry.window()).tick[-1] < done - 1:
            telemetry.wait(after=window)
    counts = telemetry.counts
    assert (
        window.sequence[0] == 0 and len(window) + counts.lost + counts.overwritten == done
    )  # commands may outrun the sender
    assert (counts.sessions, counts.other_session, counts.packets) == (2, 0, 5 + len(window))
