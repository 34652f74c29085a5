# SPDX-License-Identifier: Apache-2.0
"""`make bench`: figures, measured side by side in one run; prints a table and writes out/bench.json. Nothing here can fail a test."""

from __future__ import annotations

import json
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


def edit_to_test() -> dict[str, float]:
    """Seconds from an edited machine to its library (cold), and from an unchanged one (warm)."""
    text = CONFIG.read_text()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        algorithms = folder / "algorithms"
        algorithms.mkdir()
        for source in (CONFIG.parent / "algorithms").glob("*.py"):
            (algorithms / source.name).write_text(source.read_text() + f"\n# edited {time.time_ns()}\n")
        config = folder / CONFIG.name
        config.write_text(text)
        begun = time.perf_counter()
        build_machine(config)
        cold = time.perf_counter() - begun
        begun = time.perf_counter()
        build_machine(config)
        return {"cold_s": cold, "warm_s": time.perf_counter() - begun}


def main() -> int:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        print("flying the lander and timing its step…", file=sys.stderr)
        step = step_times(folder)
        print("timing the simulator…", file=sys.stderr)
        factor = real_time_factor(folder)
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
        ("edit to library, cold", f"{build['cold_s']:.2f} s"),
        ("unchanged, from the cache", f"{build['warm_s'] * 1e3:.1f} ms"),
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
