# SPDX-License-Identifier: Apache-2.0
"""A flight in lock-step whose simulator, controller or both are paused: clients of the other one are served."""

from __future__ import annotations

import contextlib
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from test_wires import LENGTH_S, SIM, library

from simclient import VarClient
from simclient.bus.free_port import free_endpoint
from simclient.replay import replay

__all__ = ["library"]
PATIENCE_S = 60.0
PARAMETER = "coast.parameters.touchdown_speed"


@contextlib.contextmanager
def client_of(process: subprocess.Popen[str], address: Path) -> Iterator[VarClient]:
    give_up = time.monotonic() + PATIENCE_S
    while not address.exists():
        assert process.poll() is None and time.monotonic() < give_up
        time.sleep(0.01)
    with VarClient(address) as client:
        yield client


def comes_to_rest(tick: Callable[[], int]) -> int:
    before = -1
    while before != (before := tick()):
        time.sleep(0.1)
    return before


@pytest.fixture
def flight(library: Path, tmp_path: Path) -> Iterator[tuple[VarClient, VarClient, subprocess.Popen[str]]]:
    place = f"zenoh:{free_endpoint()}"
    lines = (
        ["fcsl-sim", "run", SIM, "--duration", LENGTH_S, "--external", place, "--paused"],
        ["fcsl-fc", library, "--hal", place, "--timeout", "2", "--record", tmp_path / "bag"],
    )
    with contextlib.ExitStack() as opened:
        found = []
        for name, line in zip(("sim", "fc"), lines, strict=True):
            words = [str(word) for word in (*line, "--socket", tmp_path / name)]
            process = opened.enter_context(subprocess.Popen(words, stdout=subprocess.DEVNULL, text=True))
            opened.callback(process.kill)
            found.append(opened.enter_context(client_of(process, tmp_path / name)))
        yield found[0], found[1], process


def test_a_controller_whose_simulator_is_paused(
    flight: tuple[VarClient, VarClient, subprocess.Popen[str]], library: Path, tmp_path: Path
) -> None:
    """Longer than its time-out. What is set meanwhile counts from the tick on that comes next, as its replay shows."""
    sim, fc, controller = flight
    sim.tick(20)
    tick = comes_to_rest(lambda: int(fc.get_value("machine.tick")))
    assert tick == 20
    fc.set({PARAMETER: 0.75})
    assert fc.get_value(PARAMETER) == 0.75
    time.sleep(2.5)
    fc.pause()
    sim.resume()
    assert comes_to_rest(lambda: int(fc.get_value("machine.tick"))) == tick
    fc.set({PARAMETER: 0.5})
    fc.resume()
    assert controller.wait(PATIENCE_S) == 0
    assert replay(tmp_path / "bag", library=str(library)).identical
