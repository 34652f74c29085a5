# SPDX-License-Identifier: Apache-2.0
"""`make bench`: figures, measured side by side in one run; prints a table and writes out/bench.json. Nothing here can fail a test."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.build_cache import build_machine
from fcsl_compiler.toolchain import FLAGS, compiler, include_dirs
from simclient import bag as bags

ROOT = Path(__file__).resolve().parent.parent
HERE = ROOT / "scripts" / "bench"
CONFIG = ROOT / "examples/lander/fc/lander_control.json"
SIM = ROOT / "examples/lander/sim/lander.sim.json"
REPEATS = 2001
#: Processes of which the edit loop's figures are the best.
LOOPS = 7
#: The two must be the same controller, or their times mean nothing.
MAX_THROTTLE_APART = 1e-9


def fly(*options: str | Path) -> dict[str, Any]:
    line = ["fcsl-sim", "run", str(SIM), "--seed", "1", "--json", *map(str, options)]
    summary: dict[str, Any] = json.loads(subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return summary


def step_times(folder: Path) -> dict[str, Any]:
    """ns per step of the compiled lander and of the same logic by hand, on the samples of one recorded flight."""
    fly("--record", folder / "flight")
    flight = bags.Bag(folder / "flight")
    columns = [bags.columns(flight, f"sensors.outputs.{name}")[1] for name in ("pos_z", "vel_z")]
    samples = np.column_stack(columns).astype("<f8")
    (folder / "samples").write_bytes(samples.tobytes())
    program = folder / "step"
    flags = [f for f in FLAGS if f not in ("-fPIC", "-fvisibility=hidden")]
    sources = [str(HERE / "step.c"), str(HERE / "lander_by_hand.c")]
    includes = [f"-I{d}" for d in [HERE, *include_dirs()]]
    line = [*compiler(), *flags, "-D_GNU_SOURCE", *includes, *sources, "-ldl", "-lm", "-o", str(program)]
    subprocess.run(line, check=True)
    library = build_machine(CONFIG).library
    line = [str(program), str(library), str(folder / "samples"), str(REPEATS)]
    times: dict[str, Any] = json.loads(subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout)
    return times


def real_time_factor(folder: Path) -> dict[str, float]:
    """Simulated seconds per second, with and without recording; the best of three."""
    plain = max(fly()["real_time_factor"] for _ in range(3))
    recorded = max(fly("--record", folder / f"rtf{n}")["real_time_factor"] for n in range(3))
    return {"plain": plain, "recorded": recorded}


_CHECK = """
import sys, time
from pathlib import Path
from fcsl_compiler.passes import compile_machine
begun = time.perf_counter()
compile_machine(Path(sys.argv[1]), "", until="ir")
print(time.perf_counter() - begun)
"""
#: What pytest does with a test of one tick; prints the time from AlgTwin to the end of the tick.
_TEST = """
import sys, time
import pytest
from simclient import AlgTwin
begun = time.perf_counter()
with AlgTwin.from_config(sys.argv[1]) as twin:
    twin.tick()
    print(time.perf_counter() - begun)
"""


def in_a_fresh_process(script: str, config: Path, env: dict[str, str] | None = None) -> tuple[float, float]:
    """Seconds that the script printed, and of the whole process with the start of Python."""
    begun = time.perf_counter()
    line = [sys.executable, "-c", script, str(config)]
    printed = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True, env=env).stdout
    return float(printed), time.perf_counter() - begun


def edit_to_test() -> dict[str, float]:
    """The edit loop of the lander in seconds, the best of several fresh processes.

    check: of the first `fcslc check` after import. cold: from the edit of one algorithm to the end of a process that imported
    pytest, compiled and ticked. warm: from AlgTwin to its first tick, nothing changed, pytest and simclient imported.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name) / "fc"
        shutil.copytree(CONFIG.parent, folder)
        config, edited = folder / CONFIG.name, folder / "algorithms" / "engine.py"
        env = {**os.environ, "FCSL_CACHE_DIR": str(Path(name) / "cache")}
        check = [in_a_fresh_process(_CHECK, config)[0] for _ in range(LOOPS)]
        cold: list[float] = []
        for number in range(LOOPS):
            edited.write_text(edited.read_text() + f"# edit {number}\n")
            cold.append(in_a_fresh_process(_TEST, config, env)[1])
        warm = [in_a_fresh_process(_TEST, config, env)[0] for _ in range(LOOPS)]
    return {"check_s": min(check), "cold_s": min(cold), "warm_s": min(warm)}


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("flying the lander and timing its step…", file=sys.stderr)
        step = step_times(folder)
        print("timing the simulator…", file=sys.stderr)
        factor = real_time_factor(folder)
    print("timing the edit loop…", file=sys.stderr)
    build = edit_to_test()
    if step["throttle_apart"] > MAX_THROTTLE_APART:
        print(
            f"bench: the hand-written lander is another one (throttles {step['throttle_apart']} apart)", file=sys.stderr
        )
        return 1
    ratio = step["compiled_ns"] / step["by_hand_ns"]
    rows = [
        ("lander step, compiled by fcslc", f"{step['compiled_ns']:.1f} ns"),
        ("lander step, by hand in C", f"{step['by_hand_ns']:.1f} ns"),
        ("ratio", f"{ratio:.2f}"),
        ("simulator, in process", f"{factor['plain']:.0f} × real time"),
        ("simulator, recording every output", f"{factor['recorded']:.0f} × real time"),
        ("fcslc check of the lander", f"{build['check_s'] * 1e3:.0f} ms (goal 100)"),
        ("edit to tested, cold", f"{build['cold_s']:.2f} s  (goal 1.5)"),
        ("unchanged to ticking, warm", f"{build['warm_s'] * 1e3:.0f} ms  (goal 60)"),
    ]
    for what, figure in rows:
        print(f"{what:<36}{figure:>20}")
    out = ROOT / "out" / "bench.json"
    out.parent.mkdir(exist_ok=True)
    facts = {"step": {**step, "ratio": ratio}, "real_time_factor": factor, "build": build}
    out.write_text(json.dumps(facts, indent=2) + "\n")
    print(f"written: {out.relative_to(ROOT)}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        print("bench: interrupted", file=sys.stderr)
        sys.exit(130)
