# SPDX-License-Identifier: Apache-2.0
"""fcsl-guard: from SIGSTOP of the flight program, which tells the guard nothing, to safe values at the actuator.

python3 scripts/bench guard
"""

from __future__ import annotations

import json
import os
import signal
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from fcsl_compiler.driver.cache import build_machine
from simclient.library import runtime_program

from ..harness.size import sized

STOPS = sized(200, 2)
TIMEOUT_S, PERIOD_S, TICK_S = 0.05, 0.002, 0.01
#: A computer whose flight programs have no processor for as long as a command counts may never get there, s.
WAIT_S = 20.0
LINE_BYTES = 256
SAFE = -1.0
ALGORITHM = '''class Pilot:
    """Commands, armed, from its first tick on."""

    outputs = {"force": "f64", "armed": "bool"}

    def execute(self):
        self.force = 1.0
        self.armed = True
'''
CONFIG = {
    "tick_hz": round(1 / TICK_S),
    "initial_state": "RUN",
    "algorithms": {"Pilot": {"source": "pilot.py"}},
    "instances": {"pilot": {"algorithm": "Pilot"}},
    "connections": [],
    "states": {"RUN": {"schedule": {"pilot": round(1 / TICK_S)}}},
    "transitions": [],
    "channels": [{"name": "force", "id": 1, "field": "pilot.outputs.force", "direction": "actuator", "safe": SAFE}],
    "arm": "pilot.armed",
    "command_timeout_s": TIMEOUT_S,
}


REAL_TIME = ("--realtime-priority", "80", "--lock-memory")


def guard_times(folder: Path) -> dict[str, dict[str, float]]:
    """ms from SIGSTOP to the first safe write: median, 99th percentile, maximum; and stops. Nothing of a mode that this computer
    does not allow, or is too slow for."""
    (folder / "pilot.py").write_text(ALGORITHM)
    (folder / "pilot.json").write_text(json.dumps(CONFIG))
    library = build_machine(folder / "pilot.json").library
    times = {"no load of the bench": _stops(library, folder / "idle")}
    with _load():
        times["loaded"] = _stops(library, folder / "loaded")
        times["loaded, SCHED_FIFO"] = _stops(library, folder / "fifo", *REAL_TIME)
    return times


@contextmanager
def _load() -> Iterator[None]:
    """Three processes for each processor that never sleep."""
    spinners = [subprocess.Popen(["sh", "-c", "while :; do :; done"]) for _ in range(3 * len(os.sched_getaffinity(0)))]
    try:
        yield
    finally:
        for spinner in spinners:
            spinner.kill()
            spinner.wait()


def _stops(library: Path, log: Path, *options: str) -> dict[str, float]:
    slot, told = log.with_suffix(".slot"), log.with_suffix(".txt")
    command = [runtime_program("fcsl-guard"), library, "--slot", slot, "--actuator", f"force=log:{log}", *options]
    with (
        told.open("wb") as output,
        subprocess.Popen(list(map(str, command)), stdout=output, stderr=subprocess.STDOUT) as guard,
    ):
        try:
            # It says so once nothing can be refused any more; the slot is there before.
            if not _reached(lambda: "actuators written every" in told.read_text(), guard):
                return {}
            found = [_stop(library, slot, log, guard) for _ in range(STOPS)]
        except TimeoutError:
            return {}
        finally:
            guard.terminate()
    cuts = statistics.quantiles(found, n=100)
    return {"median": cuts[49], "p99": cuts[98], "max": max(found), "stops": STOPS}


def _stop(library: Path, slot: Path, log: Path, guard: subprocess.Popen[bytes]) -> float:
    """Starts a flight program, stops it once the actuator has its command, and returns how long that lasted, in ms."""
    command = [runtime_program("fcsl-fc"), library, "--guard", slot]
    with subprocess.Popen(list(map(str, command)), stdout=subprocess.DEVNULL) as program:
        try:
            flies = _reached(lambda: _writes(log)[-1][1] != SAFE, guard, program)
            stopped = time.monotonic()
            program.send_signal(signal.SIGSTOP)
            if not flies or not _reached(lambda: _writes(log)[-1][1] == SAFE, guard):
                raise RuntimeError(
                    f"`fcsl-guard` or `fcsl-fc` ended; the guard said:\n{log.with_suffix('.txt').read_text()}"
                )
        finally:
            program.kill()
    return 1e3 * (next(t for t, value in _writes(log) if t > stopped and value == SAFE) - stopped)


def _reached(what: Callable[[], bool], *processes: subprocess.Popen[bytes]) -> bool:
    """Waits; false once one of the processes has ended instead. Raises TimeoutError."""
    deadline = time.monotonic() + WAIT_S
    while not what():
        if any(process.poll() is not None for process in processes):
            return False
        if time.monotonic() > deadline:
            raise TimeoutError
        time.sleep(0.005)
    return True


def _writes(log: Path) -> list[tuple[float, float]]:
    """Time (s, monotonic) and value of the complete lines of the driver `log`, oldest first."""
    data = log.read_bytes()
    lines = (data[at : at + LINE_BYTES] for at in range(0, len(data), LINE_BYTES))
    rows = (line.split() for line in lines if line.endswith(b"\n"))
    return sorted((int(stamp) / 1e9, float(value.partition(b"=")[2])) for stamp, value in rows)


def guard_rows(facts: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    bound = 1e3 * (TIMEOUT_S + PERIOD_S)
    return [
        (
            f"SIGSTOP to safe outputs, {name}",
            f"{t['median']:.1f} ms median, {t['p99']:.1f} 99 %, {t['max']:.1f} worst (time-out and period {bound:.0f})"
            if t
            else "not possible here",
        )
        for name, t in facts.items()
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as temporary:
        for title, figure in guard_rows(guard_times(Path(temporary))):
            print(f"{title:<65}{figure}")
