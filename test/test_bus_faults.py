# SPDX-License-Identifier: Apache-2.0
"""Flights over the bus whose parties are killed or frozen at random moments, and beside a hostile one: a wrong value never
counts, the other party says why it ends, bags are readable, and the next flight has the bits of the first."""

from __future__ import annotations

import json
import os
import random
import re
import signal
import socket
import subprocess
import threading
import time
from pathlib import Path

import pytest
import zenoh
from test_wires import LENGTH_S, SIM, digest, fly, free_port, library, reference

from simclient.bag import Bag
from simclient.replay import replay

__all__ = ["library", "reference"]
MODES = ("zenoh:", "zenoh-peer:", "wire:zenoh:")
#: `make verify EFFORT=full` tries more.
MOMENTS = 10 if os.environ.get("FCSL_VERIFY", "") in ("", "0") else 200
#: Such a freeze is shorter than the lease of a session, s.
SHORT_S = 0.4


class Flight:
    """Simulator and flight program on the way."""

    def __init__(self, mode: str, place: str, library: Path, folder: Path, length_s: str = "120", speed: str = "10"):
        self.bag = folder / "bag"
        ours = mode.replace("-peer", "")
        line = ["fcsl-sim", "run", SIM, "--duration", length_s, "--speed", speed, "--external", f"{ours}{place}"]
        self.simulator = subprocess.Popen([*line, "--timeout", "60"], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        line = ["fcsl-fc", library, "--hal", f"{mode}{place}", "--timeout-ms", "60000", "--record", self.bag]
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
    place = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
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
    place = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
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


def resident_kib(process: subprocess.Popen[bytes]) -> int:
    status = Path(f"/proc/{process.pid}/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def test_a_hostile_party(reference: str, library: Path, tmp_path: Path) -> None:
    """It puts what no channel takes, as fast as it can: that is dropped and counted, and takes no memory."""
    place = f"tcp/127.0.0.1:{free_port(socket.SOCK_STREAM)}"
    flight = Flight("zenoh:", place, library, tmp_path, LENGTH_S, speed="0.5")
    config = zenoh.Config.from_json5('{mode: "client", scouting: {multicast: {enabled: false}}}')
    config.insert_json5("connect/endpoints", f'["{place}"]')
    keys = ("altitude", "velocity", "throttle", "tick", "nothing", "@control/x")
    over = threading.Event()
    put = 0
    try:
        before = [resident_kib(process) for process in (flight.simulator, flight.controller)]
        with zenoh.open(config) as session:

            def flood() -> None:
                nonlocal put
                numbers = random.Random(1)
                while not over.is_set():
                    size = numbers.choice([0, 1, 7, 9, 24, 26, 4096])
                    session.put(f"lander_control/{numbers.choice(keys)}", numbers.randbytes(size))
                    put += 1

            thread = threading.Thread(target=flood)
            thread.start()
            try:
                limit = time.monotonic() + 3.0
                while put < 20000 and time.monotonic() < limit:
                    time.sleep(0.01)
                after = [resident_kib(process) for process in (flight.simulator, flight.controller)]
                assert flight.ends("controller")[0] == 0
            finally:
                over.set()
                thread.join()
        assert flight.ends("simulator")[0] in (0, 1)
    finally:
        flight.close()
    assert digest(flight.bag) == reference
    counted = json.loads(flight.summary.read_text())["hal"]
    assert counted["bus.wrong_size"] > 100 and counted["bus.strays"] > 100
    assert max(now - then for then, now in zip(before, after, strict=True)) < 64 * 1024
