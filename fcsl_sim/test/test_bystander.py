# SPDX-License-Identifier: Apache-2.0
"""A bystander on the bus records a flight from its middle: its bag replays bit for bit, or says what it lacks."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_observers import LONG_S, MACHINE, SIM, run, started

from simclient import VarClient
from simclient.bus.free_port import free_endpoint
from simclient.replay import replay

RECORD = ["fcsl", "bus", "record"]


class Flight:
    """The lander in lock-step over the bus, with observers and a socket."""

    def __init__(self, library: Path, folder: Path, opened: contextlib.ExitStack, speed: int):
        self._opened = opened
        self.observed, self.socket = free_endpoint(), folder / "socket"
        control = free_endpoint()
        options = ["--hal", f"zenoh:{control}", "--timeout", "30", "--observers", self.observed]
        line = [library, *options, "--socket", self.socket, "--record", folder / "own"]
        self.begin("fcsl-sim", "run", SIM, "--external", f"zenoh:{control}", "--speed", str(speed))
        self.fc = self.begin("fcsl-fc", *line)
        wait_until(self.socket.exists)
        self.client = opened.enter_context(VarClient(self.socket))
        self.run_to(100)

    @contextlib.contextmanager
    def paused(self) -> Iterator[None]:
        self.client.pause()
        yield
        self.client.resume()

    def begin(self, *line: str | Path) -> subprocess.Popen[str]:
        return self._opened.enter_context(started(*line))

    def run_to(self, tick: int) -> None:
        wait_until(lambda: self.client.get_value("machine.tick") >= tick)

    def record(self, bag: Path) -> subprocess.Popen[str]:
        """A bystander, whose checkpoint has come. The flight waits while it starts."""
        with self.paused():
            recorder = self.begin(*RECORD, "-c", self.observed, "-o", bag)
            assert recorder.stdout
            assert recorder.stdout.readline() == f"recording lander_control to {bag}\n"
        assert recorder.stdout.readline().startswith("lander_control: reproduces the run from tick ")
        return recorder


def wait_until(holds: Callable[[], bool]) -> None:
    give_up = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < give_up
        time.sleep(0.02)


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lander")
    run("fcslc", "build", MACHINE, "-o", folder)
    return folder / "liblander_control.so"


@pytest.fixture
def flight(request: pytest.FixtureRequest, library: Path, tmp_path: Path) -> Iterator[Flight]:
    """Five times as fast as real time, or as a test says."""
    with contextlib.ExitStack() as opened:
        yield Flight(library, tmp_path, opened, getattr(request, "param", 5))


def complete(process: subprocess.Popen[str]) -> str:
    out, err = process.communicate(timeout=LONG_S)
    assert process.returncode == 0, out + err
    return out


def test_what_a_bystander_recorded_replays_bit_for_bit(flight: Flight, library: Path, tmp_path: Path) -> None:
    """Recorded while somebody writes a parameter, forces a state and injects a fault and a health, and
    restores a checkpoint; with the recorder of the flight program beside it, which says the same."""
    recorder = flight.record(tmp_path / "bag")
    with flight.paused():
        flight.client.set({"coast.parameters.touchdown_speed": 0.75, "filter.inputs.altimeter": 3.0})
        flight.client.set_state("DESCENT")
        flight.client.inject("sensors", "fault")
        flight.client.inject("monitor", "degraded")
        flight.client.restore(flight.client.save())
    said = complete(recorder)
    complete(flight.fc)
    verdict = said.splitlines()[-1]
    assert verdict.startswith("lander_control: reproduces ticks ")
    first, last = (int(word) for word in verdict.split() if word.isdigit())
    found = replay(tmp_path / "bag", library=str(library))
    assert found.divergence is None and found.ticks == last + 1 - first > 50, str(found)
    # A busy machine drops values of ticks, which are not compared; the replay needs none of them.
    assert found.values > 50 and all("throttle` has" in text for text in found.missing), str(found)
    assert replay(tmp_path / "own", library=str(library)).identical
    info = run("fcsl", "bag", "info", tmp_path / "bag")
    assert f"replays from the checkpoint before tick {first}" in info
    for kind in ("2 SET", "1 SET_STATE", "1 FAULT", "1 HEALTH", "1 RESTORE", " CHANNEL"):
        assert kind in info, info


@pytest.mark.parametrize("flight", [1], indirect=True)  # so long that it is not over before the recorder is left behind
def test_a_recorder_that_was_frozen_says_what_it_lacks(flight: Flight, library: Path, tmp_path: Path) -> None:
    recorder = flight.record(tmp_path / "bag")
    observers = lambda: flight.client.stats()["observers"]["ticks"]  # noqa: E731
    os.kill(recorder.pid, signal.SIGSTOP)
    seen, since = observers(), flight.client.get_value("machine.tick")

    def is_left_behind() -> bool:
        """Nothing has been put for it for a while: its link is closed."""
        nonlocal seen, since
        now, tick = observers(), flight.client.get_value("machine.tick")
        if now != seen:
            seen, since = now, tick
        return bool(tick > since + 100)

    wait_until(is_left_behind)
    os.kill(recorder.pid, signal.SIGCONT)
    assert recorder.stdout
    said = recorder.stdout.readline()
    assert said.startswith("lander_control: does not reproduce the run: host writes ")
    flight.fc.terminate()
    said = complete(recorder)
    complete(flight.fc)
    assert "lander_control: does not reproduce the run: host writes" in said.splitlines()[-1]
    refused = subprocess.run(
        ["fcsl", "replay", tmp_path / "bag", "--library", library],
        capture_output=True, text=True, timeout=LONG_S, check=False,
    )  # fmt: skip
    assert refused.returncode == 2 and len(refused.stderr.splitlines()) == 1
    assert "it does not reproduce the run of `lander_control`: host writes" in refused.stderr
    assert "record     does not reproduce the run: host writes" in run("fcsl", "bag", "info", tmp_path / "bag")
