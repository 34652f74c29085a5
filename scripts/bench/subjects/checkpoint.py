# SPDX-License-Identifier: Apache-2.0
"""Saving and restoring a machine of 10 kB in process: the machine struct in C, and the bytes of a checkpoint file in C and
from Python.

python3 scripts/bench checkpoint
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin
from simclient.library import runtime_library

from ..harness.native import compile_program
from ..harness.size import sized

ROUNDS = sized(201, 3)
PYTHON_REPEATS = sized(50, 2)
#: 35 x 35 doubles of state and a counter: 10 kB.
SOURCE = """
class Large:
    outputs = {"n": "i64"}
    state = {"P": "f64[35][35]"}

    def execute(self):
        self.n += 1
        self.P[0, 0] += 0.5
"""


def _machine(folder: Path) -> Path:
    (folder / "large.py").write_text(SOURCE)
    config: dict[str, Any] = {"tick_hz": 100, "initial_state": "A", "algorithms": {"Large": {"source": "large.py"}}}
    config |= {"instances": {"large": {"algorithm": "Large"}}, "states": {"A": {"schedule": {"large": 100}}}}
    path = folder / "large.json"
    path.write_text(json.dumps(config))
    return path


def _from_python(library: Path) -> list[float]:
    """ns of twin.save() and twin.restore()."""
    found = []
    with AlgTwin.from_library(library) as twin:
        twin.tick(100)
        for _ in range(ROUNDS):
            begun = time.perf_counter_ns()
            for _ in range(PYTHON_REPEATS):
                twin.restore(twin.save())
            found.append((time.perf_counter_ns() - begun) / PYTHON_REPEATS)
    return found


def checkpoint_times(folder: Path) -> dict[str, float]:
    folder.mkdir(parents=True, exist_ok=True)
    library = build_machine(_machine(folder)).library
    includes = [package_prefix(p) / "include" for p in ("fcsl_runtime", "fcsl_hal")]
    program = compile_program(
        ["subjects/checkpoint.c", "harness/timing.c", runtime_library()], folder / "checkpoint", includes
    )
    environment = {**os.environ, "LD_LIBRARY_PATH": str(runtime_library().parent)}
    line: list[str] = [str(program), str(library), str(ROUNDS)]
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True, env=environment)
    facts: dict[str, float] = json.loads(done.stdout)
    low, middle, high = statistics.quantiles(_from_python(library), n=4)
    return facts | {"python_ns": middle, "python_low_ns": low, "python_high_ns": high}


def checkpoint_rows(facts: dict[str, float]) -> list[tuple[str, str]]:
    def us(what: str, goal: str = "") -> str:
        spread = f"{facts[f'{what}_low_ns'] / 1e3:.2f} to {facts[f'{what}_high_ns'] / 1e3:.2f}"
        return f"{facts[f'{what}_ns'] / 1e3:.2f} us ({spread}){goal}"

    return [
        (f"save + restore of a machine of {facts['bytes'] / 1e3:.1f} kB, in C", us("struct", " (goal 2)")),
        ("    the same bytes copied there and back", us("copy")),
        ("    as the bytes of a checkpoint file, with CRC", us("file")),
        ("    the same from Python: twin.save(), twin.restore()", us("python")),
    ]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        for title, figure in checkpoint_rows(checkpoint_times(Path(name))):
            print(f"{title:<60}{figure:>40}")
