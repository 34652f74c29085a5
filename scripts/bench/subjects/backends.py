# SPDX-License-Identifier: Apache-2.0
"""The two backends side by side: a step of the libraries that C and Nim give, and how long a build takes.

python3 scripts/bench backends
"""

from __future__ import annotations

import json
import subprocess
import tempfile
import time
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.library import build_library
from fcsl_compiler.model.choices import BACKENDS

from ..harness.native import BENCH, compile_program
from ..harness.size import sized

ROUNDS = sized(2001, 5)
EXAMPLES = BENCH.parents[1] / "examples"
#: Machine and the state in which it flies.
MACHINES = {
    "lander": ("lander/fc/lander_control.json", "DESCENT"),
    "ahrs": ("ahrs/ahrs.json", ""),
    "quadrotor": ("quadrotor/fc/quadrotor.json", "FLY"),
    "satellite": ("satellite/fc/satellite.json", "POINT"),
}
MEASURED = sized(tuple(MACHINES), ("lander",))


def backend_times(folder: Path) -> dict[str, Any]:
    """For each machine: ns of a step and s of a build by each backend, and the ratio of the steps."""
    folder.mkdir(parents=True, exist_ok=True)
    program = compile_program(["subjects/backends.c", "harness/timing.c"], folder / "backends")
    return {name: _times(program, folder / name, *MACHINES[name]) for name in MEASURED}


def _times(program: Path, folder: Path, path: str, state: str) -> dict[str, Any]:
    facts: dict[str, Any] = {}
    libraries, number = [], 0
    for backend in BACKENDS:
        library = folder / backend / "library.so"
        begun = time.perf_counter()
        machine = build_library([EXAMPLES / path], library, backend=backend)[0].checked
        facts[f"{backend}_build_s"] = time.perf_counter() - begun
        libraries.append(str(library))
        number = next((n for n, s in enumerate(machine.states) if s.name == state), 0)
    line = [str(program), *libraries, str(number), str(ROUNDS)]
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True)
    return facts | json.loads(done.stdout)


def backend_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, f in facts.items():
        rows += [
            (f"{name}: step by C, by Nim", f"{f['c_ns']:.1f} ns, {f['nim_ns']:.1f} ns"),
            ("    Nim ÷ C (goal 1.1)", f"{f['ratio']:.2f} ({f['ratio_low']:.2f} to {f['ratio_high']:.2f})"),
            ("    build by C, by Nim", f"{f['c_build_s']:.2f} s, {f['nim_build_s']:.2f} s"),
        ]
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as name:
        for title, figure in backend_rows(backend_times(Path(name))):
            print(f"{title:<60}{figure:>40}")
