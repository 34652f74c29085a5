# SPDX-License-Identifier: Apache-2.0
"""ProcessTwin of the lander: the round trip of a tick to the flight program and back, and what of it is the two processes.

python3 scripts/bench process
"""

from __future__ import annotations

import socket
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from fcsl_compiler.driver.cache import build_machine
from simclient.library import runtime_program
from simclient.twin.process_twin import ProcessTwin

from ..harness.size import sized

CONFIG = Path(__file__).resolve().parents[3] / "examples/lander/fc/lander_control.json"
#: Works take turns in blocks, so that a busy computer is busy for all of them.
BLOCKS, TRIPS = sized((60, 100), (1, 10))
MANY = sized(20_000, 100)


def process_times() -> dict[str, dict[str, float]]:
    """us per call: median, quartiles and 99th percentile. `tick_bytes`, `state_bytes`: a request of constant bytes, whose reply
    is received and not looked at; `state` never leaves the server's thread, so the difference is the way to the step thread.
    """
    library = build_machine(CONFIG).library
    with tempfile.TemporaryDirectory() as folder, ProcessTwin.from_config(CONFIG) as twin:
        path = f"{folder}/fc"
        options = ["--paused", "--no-overrun-check", "--exit-on-stdin-eof", "--socket", path]
        command = [str(runtime_program("fcsl-fc")), str(library), *options]
        with (
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program,
            socket.socket(socket.AF_UNIX) as bare,
        ):
            assert program.stdout is not None
            for line in program.stdout:
                if b"commands on" in line:
                    break
            bare.connect(path)

            def trip(request: bytes) -> None:
                bare.sendall(request)
                while not bare.recv(4096).endswith(b"\n"):
                    pass

            times = _in_turns(
                {
                    "tick": twin.tick,
                    "get": lambda: (twin.tick(), twin.get_value("filter.outputs.pos_z")),
                    "tick_bytes": lambda: trip(b'{"cmd":"tick"}\n'),
                    "state_bytes": lambda: trip(b'{"cmd":"state"}\n'),
                }
            )
        begun = time.perf_counter()
        twin.tick(MANY)
        times["many"] = {"median": (time.perf_counter() - begun) / MANY * 1e6}
    return times


def _in_turns(works: dict[str, Callable[[], object]]) -> dict[str, dict[str, float]]:
    found: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(BLOCKS):
        for name, work in works.items():
            for _ in range(TRIPS):
                begun = time.perf_counter_ns()
                work()
                found[name].append((time.perf_counter_ns() - begun) / 1e3)
    return {name: _summary(values) for name, values in found.items()}


def _summary(values: list[float]) -> dict[str, float]:
    cuts = statistics.quantiles(values, n=100)
    return {"low": cuts[24], "median": cuts[49], "high": cuts[74], "p99": cuts[98]}


def process_rows(facts: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    def us(what: str, goal: str = "") -> str:
        times = facts[what]
        return f"{times['median']:.1f} us ({times['low']:.1f} to {times['high']:.1f}){goal}"

    return [
        ("ProcessTwin, one tick() after another, p50", us("tick", " (goal 40)")),
        ("    and a value read after each", us("get")),
        ("    the same request without Python's JSON", us("tick_bytes")),
        ("    a request that the step thread has no part in", us("state_bytes")),
        ("ProcessTwin, tick(n), per tick", f"{facts['many']['median']:.2f} us"),
    ]


if __name__ == "__main__":
    for title, figure in process_rows(process_times()):
        print(f"{title:<50}{figure:>40}")
