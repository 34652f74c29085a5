# SPDX-License-Identifier: Apache-2.0
"""Flights over the bus whose parties are killed or frozen at random moments, and beside a hostile one: a wrong value never
counts, the other party says why it ends, bags are readable, and the next flight has the bits of the first."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
import zenoh
from test_wires import LENGTH_S, SIM, digest, fly, library, reference, run

from simclient.bag import Bag
from simclient.bus.endpoint import zenoh_locator
from simclient.bus.free_port import free_endpoint
from simclient.replay import replay

__all__ = ["library", "reference"]
MODES = ("zenoh:", "zenoh-peer:", "wire:zenoh:")
#: `make verify EFFORT=full` tries more.
FULL = os.environ.get("FCSL_VERIFY", "") not in ("", "0")
MOMENTS = 200 if FULL else 10
RUNS_UNDER_LOAD = 20 if FULL else 1
#: Messages, and the flight meanwhile: simulated seconds, and how many of them in a second.
FLOOD, FLOODED_S, FLOODED_SPEED = (1_000_000, "25", "0.5") if FULL else (20_000, "4", "1")
#: A thread that steps and had to do with each message of a flood would take longer, ns.
STEP_LIMIT_NS = 1_000_000
#: Such a freeze is shorter than the lease of a session, s.
SHORT_S = 0.4


class Flight:
    """Simulator and flight program on the way."""

    def __init__(self, mode: str, place: str, library: Path, folder: Path, length_s: str = "120", speed: str = "10"):
        self.bag = folder / "bag"
        ours = mode.replace("-peer", "")
        line = ["fcsl-sim", "run", SIM, "--duration", length_s, "--speed", speed, "--external", f"{ours}{place}"]
        self.simulator = subprocess.Popen([*line, "--timeout", "60"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        line = ["fcsl-fc", library, "--hal", f"{mode}{place}", "--timeout", "60", "--record", self.bag]
        self.summary = folder / "summary.json"
        self.controller = subprocess.Popen(
            [*map(str, line), "--summary", self.summary], stdout=subprocess.PIPE, stderr=subprocess.PIPE
        )
        said = b""
        assert self.controller.stdout
        while b"armed" not in said:
            said = self.controller.stdout.readline()
            assert said, self.controller.communicate()

    def ends(self, party: str) -> tuple[int, str]:
        """Status and errors."""
        process = getattr(self, party)
        _, said = process.communicate(timeout=60)
        return process.returncode, said.decode()

    def close(self) -> None:
        for process in (self.simulator, self.controller):
            process.kill()
            process.communicate()


@pytest.mark.parametrize("seed", range(MOMENTS))
def test_a_party_is_killed_or_frozen(seed: int, reference: str, library: Path, tmp_path: Path) -> None:
    """The other one does not wait for the time-out of 60 s. A frozen one ends when it goes on."""
    numbers = random.Random(seed)
    mode, number = numbers.choice(MODES), numbers.choice([signal.SIGKILL, signal.SIGSTOP])
    victim, other = numbers.sample(["simulator", "controller"], 2)
    place = free_endpoint()
    flight = Flight(mode, place, library, tmp_path)
    try:
        time.sleep(numbers.uniform(0.0, 1.5))
        begun = time.monotonic()
        getattr(flight, victim).send_signal(number)
        status, said = flight.ends(other)
        assert time.monotonic() - begun < 20.0
        assert status == (1 if other == "controller" else 2) and re.search(r"tick \d+", said), said
        if number == signal.SIGSTOP:
            getattr(flight, victim).send_signal(signal.SIGCONT)
            status, said = flight.ends(victim)
            assert status == (1 if victim == "controller" else 2) and re.search(r"tick \d+", said), said
    finally:
        flight.close()
    killed = victim == "controller" and number == signal.SIGKILL
    assert killed or not Bag(flight.bag).truncated
    verdict = replay(flight.bag, library=str(library))
    assert verdict.divergence is None and (killed or verdict.ticks > 0)  # the first ticks may not have been written yet
    again = fly(f"{mode.replace('-peer', '')}{place}", f"{mode}{place}", library, tmp_path / "again")
    assert again == reference, "the next flight, at the same place"


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize("party", ["simulator", "controller"])
def test_a_party_that_is_frozen_for_a_moment(
    mode: str, party: str, reference: str, library: Path, tmp_path: Path
) -> None:
    """Simulated time stands still meanwhile."""
    place = free_endpoint()
    flight = Flight(mode, place, library, tmp_path, LENGTH_S, speed="1")
    try:
        getattr(flight, party).send_signal(signal.SIGSTOP)
        time.sleep(SHORT_S)
        assert getattr(flight, party).poll() is None
        getattr(flight, party).send_signal(signal.SIGCONT)
        assert flight.ends("controller")[0] == 0 and flight.ends("simulator")[0] in (0, 1)
    finally:
        flight.close()
    assert digest(flight.bag) == reference


@pytest.mark.parametrize("number", range(RUNS_UNDER_LOAD))
@pytest.mark.parametrize("mode", MODES)
def test_beside_busy_processes(mode: str, number: int, reference: str, library: Path, tmp_path: Path) -> None:
    place = free_endpoint()
    busy = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(2)]
    try:
        assert fly(f"{mode.replace('-peer', '')}{place}", f"{mode}{place}", library, tmp_path / "bag") == reference
    finally:
        for process in busy:
            process.kill()
            process.wait()


# ---- a hostile party ---------------------------------------------------------------------------------------------------


def resident_kib(process: subprocess.Popen[bytes]) -> int:
    """0 of one that has ended."""
    status = Path(f"/proc/{process.pid}/status").read_text()
    return next((int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")), 0)


class Flood:
    """Puts what no channel takes as fast as it can, until it is closed."""

    KEYS = ("altitude", "velocity", "throttle", "tick", "nothing", "@control/x")
    SIZES = (0, 1, 7, 9, 24, 26, 4096)

    def __init__(self, place: str):
        config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
        config.insert_json5("connect/endpoints", f'["{zenoh_locator(place)}"]')
        config.insert_json5("connect/timeout_ms", "30000")
        self.put = 0
        self._over = threading.Event()
        self._session = zenoh.open(config)
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        numbers = random.Random(1)
        messages = [(f"lander_control/{key}", numbers.randbytes(size)) for key in self.KEYS for size in self.SIZES]
        while not self._over.is_set():
            self._session.put(*numbers.choice(messages))
            self.put += 1

    def close(self) -> None:
        self._over.set()
        self._thread.join()
        self._session.close()


def flood(place: str, *processes: subprocess.Popen[bytes]) -> tuple[int, int]:
    """Puts FLOOD messages, or as many as can be until the first process ends: how many, and the memory in KiB that a process
    has taken meanwhile."""
    before = [resident_kib(process) for process in processes]
    grown = 0
    hostile = Flood(place)
    try:
        while hostile.put < FLOOD and processes[0].poll() is None:
            grown = max(grown, *(resident_kib(p) - then for p, then in zip(processes, before, strict=True)))
            time.sleep(0.01)
    finally:
        hostile.close()
    return hostile.put, grown


def summary_of(path: Path) -> dict[str, Any]:
    summary: dict[str, Any] = json.loads(path.read_text())
    return summary


def test_a_hostile_party(library: Path, tmp_path: Path) -> None:
    """What it puts is dropped and counted, takes no memory, and delays no step."""
    place = free_endpoint()
    run("fcsl-sim", "run", SIM, "--duration", FLOODED_S, "--record", tmp_path / "alone", statuses=(0, 1))
    flight = Flight("zenoh:", place, library, tmp_path, FLOODED_S, FLOODED_SPEED)
    try:
        put, grown = flood(place, flight.controller, flight.simulator)
        assert flight.ends("controller")[0] == 0 and flight.ends("simulator")[0] in (0, 1)
    finally:
        flight.close()
    assert digest(flight.bag) == digest(tmp_path / "alone")
    summary = summary_of(flight.summary)
    counted = summary["hal"]
    assert counted["bus.wrong_size"] > 100 and counted["bus.strays"] > 100 and put > 1000
    assert grown < 64 * 1024
    assert summary["tick_time_ns"]["p50"] < STEP_LIMIT_NS, summary["tick_time_ns"]


def test_a_hostile_observer(library: Path, tmp_path: Path) -> None:
    """The flight in real time does not hear it."""
    place = free_endpoint()
    line = [
        library,
        "--observers",
        place,
        "--ticks",
        "10000" if FULL else "300",
        "--summary",
        tmp_path / "summary.json",
    ]
    with subprocess.Popen(["fcsl-fc", *map(str, line)], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as flying:
        try:
            put, grown = flood(place, flying)
            _, said = flying.communicate(timeout=200)
        finally:
            flying.kill()
    assert flying.returncode == 0 and put > 1000, said
    summary = summary_of(tmp_path / "summary.json")
    assert grown < 64 * 1024
    for what in ("tick_time_ns", "lateness_ns"):
        assert summary[what]["count"] > 0 and summary[what]["p50"] < STEP_LIMIT_NS, summary[what]
