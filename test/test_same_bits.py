# SPDX-License-Identifier: Apache-2.0
"""One seed gives one flight: with the machine in the simulator's process or in a flight program, idle or under load.

(The ROS 2 nodes are held to the same digest in fcsl_bridge/test.)
"""

from __future__ import annotations

import multiprocessing
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

SIM = Path(__file__).resolve().parent.parent / "examples" / "lander" / "sim" / "lander.sim.json"
CONFIG = SIM.parent.parent / "fc" / "lander_control.json"


def run(*line: str | Path) -> str:
    done = subprocess.run([str(w) for w in line], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, f"{line}\n{done.stdout}{done.stderr}"
    return done.stdout


def digest(bag: Path) -> str:
    return run("fcsl", "bag", "digest", bag).split()[0]


def in_process(bag: Path, seed: int) -> str:
    run("fcsl-sim", "run", SIM, "--seed", str(seed), "--record", bag)
    return digest(bag)


def as_process(bag: Path, seed: int, library: Path, folder: Path) -> str:
    """The simulator listens, the flight program connects; they advance in lock-step."""
    socket = folder / "wire"
    line = ["fcsl-sim", "run", str(SIM), "--seed", str(seed), "--external", f"wire:unix:{socket}"]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as simulator:
        assert simulator.stdout
        assert simulator.stdout.readline().startswith("waiting for a controller")
        while not socket.exists():
            assert simulator.poll() is None
        run("fcsl-fc", library, "--hal", f"wire:unix:{socket}", "--record", bag)
        assert simulator.wait(timeout=60) == 0
    return digest(bag)


def _burn() -> None:
    while True:
        pass


@contextmanager
def load() -> Iterator[None]:
    """Twice as many busy processes as cores."""
    burners = [multiprocessing.Process(target=_burn, daemon=True) for _ in range(2 * multiprocessing.cpu_count())]
    for burner in burners:
        burner.start()
    try:
        yield
    finally:
        for burner in burners:
            burner.kill()
            burner.join()


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    run("fcslc", "build", CONFIG, "-o", folder)
    return folder / "liblander_control.so"


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> str:
    return in_process(tmp_path_factory.mktemp("reference") / "bag", 3)


def test_again(reference: str, tmp_path: Path) -> None:
    assert in_process(tmp_path / "bag", 3) == reference


def test_another_seed_is_another_flight(reference: str, tmp_path: Path) -> None:
    assert in_process(tmp_path / "bag", 4) != reference


def test_flight_program(reference: str, tmp_path: Path, library: Path) -> None:
    assert as_process(tmp_path / "bag", 3, library, tmp_path) == reference


def test_flight_program_under_load(reference: str, tmp_path: Path, library: Path) -> None:
    with load():
        assert as_process(tmp_path / "bag", 3, library, tmp_path) == reference


def test_both_bags_replay(tmp_path: Path, library: Path) -> None:
    in_process(tmp_path / "one", 5)
    as_process(tmp_path / "two", 5, library, tmp_path)
    for bag in ("one", "two"):
        assert "identical" in run("fcsl", "replay", tmp_path / bag, "--library", library)
