# SPDX-License-Identifier: Apache-2.0
"""fcsl bus play: a recorded flight's sensors, played to a flight computer, which answers as it did."""

from __future__ import annotations

import contextlib
import json
import os
import re
import select
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import pytest
from test_bystander import RECORD, wait_until
from test_observers import LONG_S, MACHINE, SIM, run, started

from simclient import AlgTwin, VarClient
from simclient.bag import Bag
from simclient.bag.writer import copy_of
from simclient.bus.cli import main
from simclient.bus.free_port import free_endpoint
from simclient.errors import BagError

PLAY = ["fcsl", "bus", "play"]
TICKS = 1000
#: Ticks beyond: what is still on its way to a bystander when the flight program ends may be lost.
MORE_TICKS = 500
FOLLOWER = """class Follower:
    inputs = {"target": "f64"}
    outputs = {"out": "f64"}
    parameters = {"gain": "f64 1 mutable"}

    def execute(self):
        self.out += self.gain * (self.target - self.out)
"""
SMALL_TICKS = 300


def build_small(folder: Path, name: str = "small", gain: float = 0.5, sensor: int = 1) -> Path:
    """A machine that follows its one sensor."""
    folder.mkdir(exist_ok=True)
    (folder / "follower.py").write_text(FOLLOWER)
    machine = {
        "tick_hz": 100,
        "initial_state": "A",
        "algorithms": {"Follower": {"source": "follower.py"}},
        "instances": {"follower": {"algorithm": "Follower", "parameters": {"gain": gain}}},
        "states": {"A": {"schedule": {"follower": 100}}},
        "channels": [
            {"name": "target", "id": sensor, "field": "follower.inputs.target", "direction": "sensor"},
            {"name": "out", "id": 2, "field": "follower.outputs.out", "direction": "actuator"},
        ],
    }
    (folder / f"{name}.json").write_text(json.dumps(machine))
    run("fcslc", "build", folder / f"{name}.json", "-o", folder)
    return folder / f"lib{name}.so"


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with its library, and `bag`, which a twin recorded: a sample in every third tick."""
    folder = tmp_path_factory.mktemp("small")
    with AlgTwin.from_library(build_small(folder)) as twin:
        twin.record(folder / "bag")
        for tick in range(SMALL_TICKS):
            if tick % 3 == 0:
                twin.sample("target", tick * 0.25)
            if tick == 100:
                twin.set("follower.parameters.gain", 0.5)
            twin.tick()
    return folder


def of_small(folder: Path, *options: str | Path) -> list[str | Path]:
    return [folder / "bag", "--library", folder / "libsmall.so", *options]


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lander")
    run("fcslc", "build", MACHINE, "-o", folder)
    return folder / "liblander_control.so"


@pytest.fixture(scope="module")
def bags(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight in lock-step over the bus, from its first tick on: `bag` of a bystander, `own` of the flight program."""
    folder = tmp_path_factory.mktemp("flight")
    control, observed, socket = free_endpoint(), free_endpoint(), folder / "socket"
    line = [library, "--hal", f"zenoh:{control}", "--timeout", "30", "--observers", observed, "--socket", socket]
    with contextlib.ExitStack() as opened:
        begin = lambda *words: opened.enter_context(started(*words))  # noqa: E731
        begin("fcsl-sim", "run", SIM, "--external", f"zenoh:{control}", "--speed", "10")
        fc = begin("fcsl-fc", *line, "--paused", "--record", folder / "own")
        wait_until(socket.exists)
        with VarClient(socket) as client:
            client.pause()  # it answers when all is open, the observers' bus too
            recorder = begin(*RECORD, "-c", observed, "-o", folder / "bag")
            assert recorder.stdout and recorder.stdout.readline().startswith("recording lander_control to ")
            while not select.select([recorder.stdout], [], [], 0.05)[0]:
                client.pause()  # once more: what is published then has the first checkpoint
            client.resume()
            wait_until(lambda: client.get_value("machine.tick") > TICKS + MORE_TICKS)
            client.pause()  # what was posted leaves before the end
            last = client.get_value("machine.tick") - 1
            wait_until(lambda: sum(client.stats()["observers"].values()) == last + 1)
        fc.terminate()
        for process in (fc, recorder):
            out, err = process.communicate(timeout=LONG_S)
            assert process.returncode == 0, err
    recorded = re.search(r"lander_control: reproduces ticks 0 to (\d+)\n", out)
    assert recorded and TICKS < int(recorded[1]) <= last, out
    return folder


@contextlib.contextmanager
def playing(*arguments: str | Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """A player that waits, and where."""
    endpoint = free_endpoint()
    with started(*PLAY, *arguments, "--listen", endpoint) as player:
        assert player.stdout and "waiting for a flight computer" in player.stdout.readline()
        yield player, endpoint


def flown(library: Path, endpoint: str, *options: str) -> list[str | Path]:
    return ["fcsl-fc", library, "--hal", f"zenoh:{endpoint}", "--timeout", "30", *options]


def ended(process: subprocess.Popen[str], status: int = 0) -> tuple[str, str]:
    out, err = process.communicate(timeout=LONG_S)
    assert process.returncode == status, out + err
    assert "Traceback" not in err
    return out, err


@pytest.mark.parametrize("which", ["bag", "own"])
def test_a_fresh_flight_computer_answers_as_the_recorded_one(bags: Path, library: Path, which: str) -> None:
    options = ["--library", library] if which == "own" else []
    with playing(bags / which, *options) as (player, endpoint), started(*flown(library, endpoint)) as fc:
        out, _ = ended(player)
        said, _ = ended(fc)
    ticks = int(re.findall(r"(\d+) ticks played\n", out)[0])
    compared = int(re.findall(r"(\d+) ticks were answered as in the bag, bit for bit", out)[0])
    assert ticks > TICKS and compared > 100 and "played as tick 0" not in out
    assert f"{ticks} ticks, 0 deadlines missed" in said


def test_another_machine_is_found_by_its_answers(small: Path, tmp_path: Path) -> None:
    """The tick and the channel in which it first shows; the run goes on to its end."""
    other = build_small(tmp_path / "other", gain=0.25)
    with playing(*of_small(small, "--speed", "10")) as (player, endpoint), started(*flown(other, endpoint)) as fc:
        out, err = ended(player, status=1)
        ended(fc)
    assert f"{SMALL_TICKS} ticks played\n297 of {SMALL_TICKS} ticks were answered otherwise\n" in out
    assert "first: tick 3, out: 0.375 in the bag, 0.1875 now\n" in out
    assert "which is not played: 1 SET" in err


@pytest.mark.parametrize(
    ("name", "sensor", "said", "heard"),
    [
        ("small", 9, "the flight computer has another channel table", "this end has another channel table"),
        ("other", 1, "the flight computer has machine other, and the bag is of small", ""),
    ],
)
def test_a_machine_that_is_refused(small: Path, tmp_path: Path, name: str, sensor: int, said: str, heard: str) -> None:
    library = build_small(tmp_path / "other", name, sensor=sensor)
    with playing(*of_small(small)) as (player, endpoint), started(*flown(library, endpoint)) as fc:
        _, err = ended(player, status=2)
        assert said in err and len(err.splitlines()) == 1
        if heard:
            _, complaint = fc.communicate(timeout=LONG_S)
            assert fc.returncode == 1 and heard in complaint


def test_a_flight_computer_that_goes(small: Path) -> None:
    """Killed, or at its own end."""
    library = small / "libsmall.so"
    with playing(*of_small(small, "--speed", "1")) as (player, endpoint), started(*flown(library, endpoint)) as fc:
        assert player.stdout and player.stdout.readline() == "small: playing\n"
        os.kill(fc.pid, signal.SIGKILL)
        _, err = ended(player, status=2)
        assert re.search(r"the flight computer is gone, at tick \d+$", err.strip())
    with playing(*of_small(small)) as (player, endpoint), started(*flown(library, endpoint, "--ticks", "50")) as fc:
        assert "50 ticks played: the flight computer ended the run\n" in ended(player)[0]
        ended(fc)


def test_ctrl_c_ends_the_run_of_the_flight_computer(small: Path) -> None:
    library = small / "libsmall.so"
    with playing(*of_small(small, "--speed", "1")) as (player, endpoint), started(*flown(library, endpoint)) as fc:
        assert player.stdout and player.stdout.readline() == "small: playing\n"
        player.send_signal(signal.SIGINT)
        assert "ticks played: interrupted\n" in ended(player)[0]
        ended(fc)
    with playing(*of_small(small)) as (player, _):
        player.send_signal(signal.SIGINT)
        assert ended(player) == ("", "")


def test_bags_that_cannot_be_played(bags: Path, tmp_path: Path) -> None:
    """Without sensors, without their machine, and none at all."""
    bag = Bag(bags / "bag")
    left = [name for name in bag.topics if not name.endswith(("/altitude", "/velocity", "/record/writes"))]
    with copy_of(bag, tmp_path / "bag", left) as copy:
        for message in bag.messages(set(left)):
            copy.write(*message)
    for path, said in (
        (tmp_path / "bag", "it has no values of sensors of `lander_control`"),
        (bags / "own", "it needs the machine: --config FILE or --library FILE"),
        (tmp_path / "none", "none: no such"),
    ):
        with pytest.raises(BagError, match=said):
            main(["play", str(path), "--listen", free_endpoint()])
