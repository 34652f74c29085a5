# SPDX-License-Identifier: Apache-2.0
"""The lander: its step against C written by hand, and how fast the simulator flies it."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.driver.cache import build_machine
from simclient import bag as bags

from ..harness.native import compile_program
from ..harness.size import sized

ROOT = Path(__file__).resolve().parents[3]
CONFIG = ROOT / "examples/lander/fc/lander_control.json"
SIM = ROOT / "examples/lander/sim/lander.sim.json"
REPEATS = sized(2001, 3)
#: Of which the fastest counts.
FLIGHTS = sized(3, 1)
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
    program = compile_program(["subjects/step.c", "harness/timing.c", "peers/lander_by_hand.c"], folder / "step")
    library = build_machine(CONFIG).library
    line = [str(program), str(library), str(folder / "samples"), str(REPEATS)]
    times: dict[str, Any] = json.loads(subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout)
    if times["throttle_apart"] > MAX_THROTTLE_APART:
        raise RuntimeError(f"the hand-written lander is another one (throttles {times['throttle_apart']} apart)")
    return times


def real_time_factor(folder: Path) -> dict[str, float]:
    """Simulated seconds per second, with and without recording; the best of FLIGHTS."""
    plain = max(fly()["real_time_factor"] for _ in range(FLIGHTS))
    recorded = max(fly("--record", folder / f"rtf{n}")["real_time_factor"] for n in range(FLIGHTS))
    return {"plain": plain, "recorded": recorded}
