# SPDX-License-Identifier: Apache-2.0
"""Two flight computers with different machines, each with its simulation, meet at one address. Neither disturbs the other."""

from __future__ import annotations

import contextlib
import signal
import time
from pathlib import Path

from test_free_running import LONG_S, Program, folder, programs, start
from test_wires import LENGTH_S, SIM, digest, library, reference, run

from simclient.bus.free_port import free_endpoint

__all__ = ["folder", "library", "programs", "reference"]


class Pair:
    """A simulation and its flight computer; the second pair's simulation is a client of the first one's."""

    def __init__(self, role: str, place: str, sim: Path, library: Path, bag: Path, length_s: str, speed: str):
        self.bag = bag
        line = ["fcsl-fc", str(library), "--hal", f"zenoh:{place}", "--record", str(bag)]
        self.fc_line = [*line, "--timeout", "180"]
        self.sim_line = ["fcsl-sim", "run", str(sim), "--external", f"{role}:{place}", "--speed", speed]
        self.sim_line += ["--duration", length_s]

    def start(self, programs: contextlib.ExitStack, names: tuple[str, ...]) -> None:
        for name in names:
            setattr(self, name, start(programs, *getattr(self, f"{name}_line")))

    fc: Program
    sim: Program


def pairs(folder: Path, library: Path, tmp_path: Path, speed: str = "2") -> tuple[Pair, Pair]:
    place = free_endpoint()
    lander = Pair("zenoh", place, SIM, library, tmp_path / "lander", LENGTH_S, "2")
    hopper = Pair(
        "zenoh-client", place, folder / "hopper.sim.json", folder / "libhopper.so", tmp_path / "hopper", "2", speed
    )
    return lander, hopper


def test_each_flies_as_if_it_were_alone(
    folder: Path, library: Path, reference: str, tmp_path: Path, programs: contextlib.ExitStack
) -> None:
    """They start in any order: here clients are the first. Who listens ends last."""
    lander, hopper = pairs(folder, library, tmp_path, speed="0")
    hopper.start(programs, ("fc", "sim"))
    lander.start(programs, ("sim",))
    hopper.fc.hears("armed at tick")
    lander.start(programs, ("fc",))
    for program in (hopper.fc, lander.fc, hopper.sim, lander.sim):
        assert program.ends() in (0, 1), program.said  # 1: `until` did not hold in so short a flight
    run(
        "fcsl-sim",
        "run",
        folder / "hopper.sim.json",
        "--duration",
        "2",
        "--record",
        tmp_path / "alone",
        statuses=(0, 1),
    )
    assert digest(hopper.bag) == digest(tmp_path / "alone")
    assert digest(lander.bag) == reference


def test_one_that_dies_or_freezes_disturbs_the_other_by_nothing(
    folder: Path, library: Path, reference: str, tmp_path: Path, programs: contextlib.ExitStack
) -> None:
    lander, hopper = pairs(folder, library, tmp_path)
    lander.start(programs, ("sim", "fc"))
    hopper.start(programs, ("sim", "fc"))
    for pair in (lander, hopper):
        pair.fc.hears("armed at tick")
    begun = time.monotonic()
    hopper.sim.signal(signal.SIGSTOP)
    hopper.fc.signal(signal.SIGKILL)
    for program in (lander.fc, lander.sim):
        assert program.ends() in (0, 1), program.said
    assert digest(lander.bag) == reference
    assert time.monotonic() - begun < float(LENGTH_S) + LONG_S / 4
