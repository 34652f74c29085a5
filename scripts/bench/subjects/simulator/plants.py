# SPDX-License-Identifier: Apache-2.0
"""Plants in the simulator beside the same loop by hand in C. Both end in the same state, or there is no figure."""

from __future__ import annotations

import json
import shutil
import subprocess
from pathlib import Path
from typing import Any

from fcsl_compiler.base.packages import package_prefix
from fcsl_sim import load

from ...harness.native import BENCH, compile_program
from ...harness.size import sized
from ...peers.satellite import case

HERE = Path(__file__).resolve().parent
PLANTS = BENCH / "machines/plants"
ROUNDS = sized(15, 1)
#: Simulated, with a second more for tick 0: the lander's flight from burn to touchdown takes most of the first.
SECONDS = {
    "lander": sized(600, 3),
    "ball": sized(300, 3),
    "bodies": sized(100, 3),
    "quadrotor": sized(100, 3),
    "satellite": sized(20, 1),
}
#: Of the states, relative to the largest; plants without events end in the same bits.
MAX_APART = 1e-9
WITHOUT_EVENTS = ("bodies", "quadrotor", "satellite")

#: A choreography of three equal masses, the figure of eight (Chenciner and Montgomery, 2000), and a little out of its plane.
_EIGHT = [
    *(0.97000436, -0.24308753, 0.0, -0.97000436, 0.24308753, 0.0, 0.0, 0.0, 0.0),
    *(0.466203685, 0.43236573, 0.01, 0.466203685, 0.43236573, -0.01, -0.93240737, -0.86473146, 0.0),
]
PARAMETERS: dict[str, dict[str, Any]] = {
    "lander": {
        "dry_mass": 400.0, "fuel_mass": 100.0, "max_thrust": 2000.0, "isp": 220.0, "gravity": 1.62,
        "height": 1000.0, "throttle": 0.4,
    },
    "ball": {"gravity": 9.80665, "restitution": 1.0, "height": 1.0},
    "bodies": {"mu": [1.0, 1.0, 1.0], "x": _EIGHT},
    "quadrotor": {
        "mass": 1.2, "gravity": 9.80665, "arm": 0.2, "yaw": 0.016, "drag": 0.3, "turning_drag": 0.02,
        "inertia": [0.011, 0.012, 0.021], "thrust": [2.95, 2.96, 2.95, 2.95],
    },
    "satellite": {"mu": case.MU, "inertia": case.INERTIA, "x": case.START},
}  # fmt: skip


def plan_of(plant: str, folder: Path) -> str:
    """The plan of a simulation of one plant, without a controller."""
    where = folder / "plants"
    if not where.exists():
        shutil.copytree(PLANTS, where)
    config = {
        "tick_hz": 1,  # ticks do not make steps short
        "seed": 1,
        "duration": float(SECONDS[plant] + 1),
        "integrator": {"method": "rk4", "hz": 1000},
        "models": {plant: {"source": f"{plant}.c"}},
        "instances": {plant: {"model": plant, "parameters": PARAMETERS[plant]}},
    }
    path = where / f"{plant}.sim.json"
    path.write_text(json.dumps(config))
    return load(path).plan.text


def compile_plants(folder: Path) -> Path:
    includes = [PLANTS, *(package_prefix(p) / "include" for p in ("fcsl_hal", "fcsl_runtime", "fcsl_sim"))]
    return compile_program(
        [HERE / "plants.c", "harness/timing.c", "peers/plants_by_hand.c"], folder / "plants_program", includes
    )


def plant_times(folder: Path, rounds: int = ROUNDS) -> dict[str, dict[str, Any]]:
    """By plant: ns per step in the simulator and by hand, their ratio and difference, and the last states."""
    program = compile_plants(folder)
    library = package_prefix("fcsl_sim") / "lib/libfcsl_sim.so"
    found = {}
    for plant in PARAMETERS:
        plan = folder / f"{plant}.plan"
        plan.write_text(plan_of(plant, folder))
        line = [str(program), str(library), plant, str(plan), str(rounds)]
        facts = json.loads(subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True).stdout)
        _compare(plant, facts)
        found[plant] = facts
    return found


def _compare(plant: str, facts: dict[str, Any]) -> None:
    by_hand = facts["by_hand"]
    for other in (facts["simulated"], facts["apart"]):
        off = max(abs(a - b) for a, b in zip(other, by_hand, strict=True)) / max(map(abs, by_hand))
        if not off <= MAX_APART or (plant in WITHOUT_EVENTS and not facts["same_bits"]):
            raise RuntimeError(f"{plant}: by hand it ends in another state ({off:.1e} apart)")
