# SPDX-License-Identifier: Apache-2.0
"""How long users wait for a command line: help, an error of usage, the first output of fcsl var, an import.

python3 scripts/bench start
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from fcsl_compiler.driver.cache import build_machine
from simclient.library import runtime_program

from ..harness.size import sized

CONFIG = Path(__file__).resolve().parents[3] / "examples/lander/fc/lander_control.json"
#: What is timed takes turns, so that a busy computer is busy for all of it.
ROUNDS = sized(21, 1)
GOALS_MS = {"import_simclient": 150, "fcsl_help": 80, "fcslc_help": 80, "fcsl_var_list": 60}
TITLES = {
    "python": "python3 that does nothing",
    "import_simclient": "import simclient",
    "import_twin": "from simclient import AlgTwin",
    "fcsl_help": "fcsl --help",
    "fcslc_help": "fcslc --help",
    "fcslc_version": "fcslc --version",
    "fcslc_wrong": "fcslc with a wrong command",
    "fcsl_sim_help": "fcsl-sim --help",
    "fcsl_var_help": "fcsl var --help",
    "fcsl_var_list": "fcsl var list, to its first line",
}


def start_times(folder: Path) -> dict[str, dict[str, float]]:
    """ms from the start of a process: to its first line where it prints one, else to its end. Least, median, most."""
    fcsl, fcslc, sim = (_command(name) for name in ("fcsl", "fcslc", "fcsl-sim"))
    address = str(folder / "fc")
    lines = {
        "python": [sys.executable, "-c", "pass"],
        "import_simclient": [sys.executable, "-c", "import simclient"],
        "import_twin": [sys.executable, "-c", "from simclient import AlgTwin"],
        "fcsl_help": [fcsl, "--help"],
        "fcslc_help": [fcslc, "--help"],
        "fcslc_version": [fcslc, "--version"],
        "fcslc_wrong": [fcslc, "nope"],
        "fcsl_sim_help": [sim, "--help"],
        "fcsl_var_help": [fcsl, "var", "--help"],
        "fcsl_var_list": [fcsl, "var", "--socket", address, "list"],
    }
    flight = [str(runtime_program("fcsl-fc")), str(build_machine(CONFIG).library), "--paused", "--exit-on-stdin-eof"]
    with subprocess.Popen([*flight, "--socket", address], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as program:
        assert program.stdout is not None
        next(line for line in program.stdout if b"commands on" in line)
        times: dict[str, list[float]] = {name: [] for name in lines}
        for _ in range(ROUNDS):
            for name, line in lines.items():
                times[name].append(_first_line_ms(line))
        program.communicate()
    return {name: {"low": min(t), "median": statistics.median(t), "high": max(t)} for name, t in times.items()}


def _command(name: str) -> str:
    found = shutil.which(name)
    assert found is not None, f"{name} is not installed"
    return found


def _first_line_ms(line: Sequence[str]) -> float:
    begun = time.perf_counter()
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT) as process:
        assert process.stdout is not None
        process.stdout.readline()
        taken = time.perf_counter() - begun
        process.communicate()
    return taken * 1e3


def start_rows(facts: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    rows = []
    for name, title in TITLES.items():
        times = facts[name]
        goal = f" (goal {GOALS_MS[name]})" if name in GOALS_MS else ""
        rows.append((title, f"{times['median']:.0f} ms ({times['low']:.0f} to {times['high']:.0f}){goal}"))
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        for title, figure in start_rows(start_times(Path(name))):
            print(f"{title:<44}{figure:>34}")
