# SPDX-License-Identifier: Apache-2.0
"""Every recorder keeps what it wrote: after kill -9, on a disk that is full, and after a power failure."""

from __future__ import annotations

import contextlib
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import yaml

from simclient import VarClient
from simclient.bag import Bag
from simclient.bag.info import describe
from simclient.bag.repair import repair
from simclient.bus.free_port import free_endpoint
from simclient.errors import BagError
from simclient.replay import replay

ROOT = Path(__file__).resolve().parent.parent
SIM = ROOT / "examples/lander/sim/lander.sim.json"
LANDER = ROOT / "examples/lander/fc/lander_control.json"
LONG_S = 120
#: Some seconds of the slowest recorder: several chunks, which are a second old at most.
TICKS = 400
#: A recording has its metadata.yaml, and then some chunks.
DISK_BYTES = 150_000
TWIN = """
import sys, time
from simclient import AlgTwin
with AlgTwin.from_library(sys.argv[1]) as twin:
    twin.record(sys.argv[2])
    while True:
        twin.tick(int(sys.argv[3]))
        time.sleep(0.05)
"""
#: (bag, library, how much faster than real time) to the process that records, in the end killed with its helpers.
Recorder = Callable[[Path, Path, int, Callable[[], None]], contextlib.AbstractContextManager[subprocess.Popen[str]]]


@contextlib.contextmanager
def process(line: list[Any], limit: Callable[[], None] = lambda: None) -> Iterator[subprocess.Popen[str]]:
    pipe, words = subprocess.PIPE, [str(word) for word in line]
    with subprocess.Popen(words, stdout=pipe, stderr=subprocess.STDOUT, text=True, preexec_fn=limit) as started:
        try:
            yield started
        finally:
            started.kill()


@contextlib.contextmanager
def flight_program(bag: Path, library: Path, speed: int, limit: Callable[[], None]) -> Iterator[subprocess.Popen[str]]:
    rate = ("--rate", "max", "--ticks", 10**7, "--record-policy", "wait") if speed > 1 else ()
    with process(["fcsl-fc", library, "--record", bag, *rate], limit) as fc:
        yield fc


@contextlib.contextmanager
def client(bag: Path, library: Path, speed: int, limit: Callable[[], None]) -> Iterator[subprocess.Popen[str]]:
    socket = bag.with_suffix(".socket")
    with process(["fcsl-fc", library, "--socket", socket, "--paused"], limit) as fc:
        while not socket.exists():
            time.sleep(0.05)
        with VarClient(socket) as server:
            server.record(bag)
            server.tick(3 * TICKS)
            yield fc


@contextlib.contextmanager
def simulator(bag: Path, library: Path, speed: int, limit: Callable[[], None]) -> Iterator[subprocess.Popen[str]]:
    with process(["fcsl-sim", "run", SIM, "--speed", speed, "--record", bag], limit) as sim:
        yield sim


@contextlib.contextmanager
def twin(bag: Path, library: Path, speed: int, limit: Callable[[], None]) -> Iterator[subprocess.Popen[str]]:
    with process([sys.executable, "-B", "-c", TWIN, library, bag, 10 * speed], limit) as running:
        yield running


@contextlib.contextmanager
def bystander(bag: Path, library: Path, speed: int, limit: Callable[[], None]) -> Iterator[subprocess.Popen[str]]:
    where, socket = free_endpoint(), bag.with_suffix(".socket")
    # Nothing waits for an observer: one that gets no processor time shall not miss most of a flight.
    simulator = ["fcsl-sim", "run", SIM, "--speed", min(speed, 4), "--observers", where, "--socket", socket, "--paused"]
    with process(simulator), process(["fcsl", "bus", "record", "-c", where, "-o", bag], limit) as recorder:
        assert recorder.stdout and recorder.stdout.readline().startswith("recording ")
        with VarClient(socket) as client:
            client.resume()
        yield recorder


RECORDERS: dict[str, Recorder] = {
    "fcsl-fc": flight_program, "client of fcsl-fc": client, "fcsl-sim": simulator, "AlgTwin": twin, "fcsl bus": bystander
}  # fmt: skip


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    subprocess.run(["fcslc", "build", LANDER, "-o", folder], check=True, capture_output=True)
    return folder / "liblander_control.so"


def ticks_in(bag: Path) -> int:
    """Messages of the topic that has most: one of every tick."""
    try:
        return max((topic.count for topic in Bag(bag).topics.values()), default=0)
    except BagError:
        return 0  # not there yet


@pytest.fixture(scope="module", params=RECORDERS)
def killed(request: pytest.FixtureRequest, library: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """The bag of a recorder that was killed, and the ticks that it had been seen to hold."""
    bag = tmp_path_factory.mktemp("killed") / "bag"
    with RECORDERS[request.param](bag, library, 1, lambda: None) as recorder:
        give_up_s = time.monotonic() + LONG_S
        while (seen := ticks_in(bag)) < TICKS:
            assert recorder.poll() is None and time.monotonic() < give_up_s, f"{seen} ticks were in the bag"
            time.sleep(0.1)
        recorder.send_signal(signal.SIGKILL)
        recorder.wait()
    return bag, seen


def replays(bag: Path, library: Path) -> None:
    verdict = replay(bag, library=str(library))
    assert verdict.divergence is None and verdict.ticks > 0, str(verdict)


def test_killed(killed: tuple[Path, int], library: Path) -> None:
    """What had been seen is there: so what is lost is what was not yet in the file."""
    bag, seen = killed
    assert ticks_in(bag) >= seen >= TICKS
    told = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    assert 0 < told["message_count"] <= sum(1 for _ in Bag(bag).messages())
    replays(bag, library)


def test_power_failure(killed: tuple[Path, int], library: Path, tmp_path: Path) -> None:
    """The last part of the file is lost, or zeros, and so is metadata.yaml."""
    randomly = random.Random(7)
    whole = killed[0] / "bag_0.mcap"
    for zeros in (False, True):
        bag = tmp_path / f"bag{zeros}"
        shutil.copytree(killed[0], bag)
        data = whole.read_bytes()
        kept = randomly.randrange(len(data) // 2, len(data) - 1000)
        (bag / "bag_0.mcap").write_bytes(data[:kept] + bytes(len(data) - kept if zeros else 0))
        (bag / "metadata.yaml").write_bytes(b"")
        found = sum(1 for _ in Bag(bag).messages())
        assert found > 0 and "damage     none" not in describe(Bag(bag))
        repair(bag)
        assert sum(1 for _ in Bag(bag).messages()) == found
        replays(bag, library)


@pytest.mark.parametrize("recorder", [name for name in RECORDERS if name != "client of fcsl-fc"])
def test_full_disk(recorder: str, library: Path, tmp_path: Path) -> None:
    """It is told, and what was written is there. The client hears of it: test_fc_record.py."""
    bag = tmp_path / "bag"
    limit = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (DISK_BYTES, DISK_BYTES))  # noqa: E731
    with RECORDERS[recorder](bag, library, 20, limit) as running:
        said, _ = running.communicate(timeout=LONG_S)
        assert running.returncode in (1, 2), said
    assert "File too large" in said and "bag" in said
    assert recorder == "AlgTwin" or "Traceback" not in said
    assert ticks_in(bag) > 0
    replays(bag, library)
