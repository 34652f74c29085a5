# SPDX-License-Identifier: Apache-2.0
"""kill -9 at random times: leftovers of a flight program or a simulator do not block the next one, which listens at
the same addresses and answers."""

from __future__ import annotations

import random
import select
import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from simclient import AlgTwin
from simclient.vars.client import VarClient

ROOT = Path(__file__).resolve().parent.parent
SIM = ROOT / "examples/lander/sim/lander.sim.json"
_TIMEOUT_S = 60
_LANDER = ROOT / "examples/lander/fc/lander_control.json"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    subprocess.run(["fcslc", "build", _LANDER, "-o", folder], check=True, capture_output=True)
    return folder / "liblander_control.so"


@contextmanager
def started(line: list[str | Path]) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def announced(process: subprocess.Popen[str], what: str) -> str:
    """The first line of the process's output with this prefix."""
    assert process.stdout
    said = []
    for line in process.stdout:
        said.append(line)
        if line.startswith(what):
            return line
    raise AssertionError("".join(said))


def killed(line: list[str | Path], seconds: float) -> None:
    """Kills the process after this time; a process that ended before has failed."""
    with started(line) as process:
        select.select([], [], [], seconds)
        assert process.poll() is None, process.communicate()[0]
        process.send_signal(signal.SIGKILL)


def whole_life(line: list[str | Path], what: str) -> float:
    """Seconds from the start to the announcement, then the process is killed."""
    begun = time.monotonic()
    with started(line) as process:
        announced(process, what)
        return time.monotonic() - begun


def test_a_killed_flight_program_is_not_in_the_way(library: Path, tmp_path: Path) -> None:
    """Kills from the start to some time after it serves; with a checkpoint to restore and a last state to write."""
    moments, place = random.Random(3), tmp_path / "socket"
    with AlgTwin.from_library(library) as twin:
        twin.tick(3)
        twin.save_file(tmp_path / "checkpoint")
    line = [
        "fcsl-fc",
        library,
        "--socket",
        place,
        "--restore",
        tmp_path / "checkpoint",
        "--summary",
        tmp_path / "last",
    ]
    usual = whole_life(line, "fcsl-fc: commands on")
    for _ in range(25):
        killed(line, moments.uniform(0, 2 * usual))
    with started([*line, "--paused"]) as process:
        announced(process, "fcsl-fc: commands on")
        with VarClient(place) as client:
            assert client.state()["tick"] == 3
        process.send_signal(signal.SIGTERM)
        assert process.wait(_TIMEOUT_S) == 0
    assert not place.exists() and (tmp_path / "last").exists()


def test_a_killed_simulator_is_not_in_the_way(library: Path, tmp_path: Path) -> None:
    moments, wire, place = random.Random(4), tmp_path / "wire", tmp_path / "socket"
    line = ["fcsl-sim", "run", str(SIM), "--external", f"wire:unix:{wire}", "--socket", str(place)]
    usual = whole_life(line, "waiting for a controller")
    for _ in range(5):
        killed(line, moments.uniform(0, 1.2 * usual))
    with started(line) as simulator:
        announced(simulator, "waiting for a controller")
        done = subprocess.run(
            ["fcsl-fc", library, "--hal", f"wire:unix:{wire}"],
            capture_output=True,
            text=True,
            timeout=_TIMEOUT_S,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert simulator.wait(_TIMEOUT_S) == 0
    assert not wire.exists() and not place.exists()


def test_a_socket_that_is_served_is_not_taken_away(library: Path, tmp_path: Path) -> None:
    """Control: only a stale socket is replaced; one with a listening process stays."""
    place = tmp_path / "socket"
    with socket.socket(socket.AF_UNIX) as other:
        other.bind(str(place))
        other.listen()
        done = subprocess.run(["fcsl-fc", library, "--socket", place], capture_output=True, text=True, check=False)
    assert done.returncode == 1 and "in use by another process" in done.stderr
