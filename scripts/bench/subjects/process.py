# SPDX-License-Identifier: Apache-2.0
"""ProcessTwin of the lander: the round trip of a tick to the flight program and back, and what of it is the two processes.

python3 scripts/bench process
"""

from __future__ import annotations

import subprocess
import tempfile
import time
from pathlib import Path

from fcsl_compiler.driver.cache import build_machine
from simclient.library import runtime_program
from simclient.twin.process_twin import ProcessTwin

from ..harness.size import sized
from ..harness.trips import connect, echo, in_turns, trip

CONFIG = Path(__file__).resolve().parents[3] / "examples/lander/fc/lander_control.json"
TICK, STATE = b'{"cmd":"tick"}\n', b'{"cmd":"state"}\n'
MANY = sized(20_000, 100)


def process_times() -> dict[str, dict[str, float]]:
    """us per call: median, quartiles and 99th percentile.

    `tick_bytes`, `state_bytes`: a request of constant bytes, whose reply is received and not read. `echo` sends and
    receives as many as `tick_bytes`.
    """
    library = build_machine(CONFIG).library
    with tempfile.TemporaryDirectory() as folder, ProcessTwin.from_config(CONFIG) as twin:
        path = Path(folder) / "fc"
        options = ["--paused", "--no-overrun-check", "--exit-on-stdin-eof", "--socket", str(path)]
        command = [str(runtime_program("fcsl-fc")), str(library), *options]
        with (
            subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL),
            connect(path) as bare,
            echo(Path(folder), trip(bare, TICK)) as echoing,
        ):
            times = in_turns(
                {
                    "tick": twin.tick,
                    "get": lambda: (twin.tick(), twin.get_value("filter.outputs.pos_z")),
                    "tick_bytes": lambda: trip(bare, TICK),
                    "state_bytes": lambda: trip(bare, STATE),
                    "echo": lambda: trip(echoing, TICK),
                }
            )
        begun = time.perf_counter()
        twin.tick(MANY)
        times["many"] = {"median": (time.perf_counter() - begun) / MANY * 1e6}
    return times


def process_rows(facts: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    def us(what: str, goal: str = "") -> str:
        times = facts[what]
        return f"{times['median']:.1f} us ({times['low']:.1f} to {times['high']:.1f}){goal}"

    return [
        ("ProcessTwin, one tick() after another, p50", us("tick", " (goal 25)")),
        ("    and a value read after each", us("get")),
        ("    the same request without Python's JSON", us("tick_bytes")),
        ("    a request that only looks", us("state_bytes")),
        ("    a bare echo in C of the same bytes", us("echo")),
        ("ProcessTwin, tick(n), per tick", f"{facts['many']['median']:.2f} us"),
    ]


if __name__ == "__main__":
    for title, figure in process_rows(process_times()):
        print(f"{title:<50}{figure:>40}")
