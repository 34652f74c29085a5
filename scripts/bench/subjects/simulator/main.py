# SPDX-License-Identifier: Apache-2.0
"""The simulator: plants beside the same loop by hand in C, a thousand landings on two cores, and a satellite beside JSBSim and
Basilisk, each against its closed form.

    python3 scripts/bench simulator        needs scripts/bench/harness/setup.sh
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from ...harness.native import BENCH
from ...harness.size import sized
from ...peers.satellite import case
from .plants import SECONDS, plant_times

HERE = Path(__file__).resolve().parent
LANDINGS = sized(1000, 4)
PROCESSES = 2
#: Of which the fastest counts.
REPEATS = sized(3, 1)
PEERS = {"JSBSim": "fly_jsbsim", "Basilisk": "fly_basilisk"}
#: From so many states on a ratio is the goal, below a difference.
MANY_STATES = 10
GOAL_RATIO, GOAL_MORE_NS, GOAL_LANDINGS_S = 1.3, 50, 10
#: Beyond this a peer flies something else.
MAX_AWAY_M, MAX_TURNED = 0.01, 1e-6

Facts = dict[str, Any]


def simulator_figures(folder: Path) -> Facts:
    plants = plant_times(folder)
    return {"plants": plants, "landings": landings(), "satellite": satellite(plants["satellite"])}


# ---- landings --------------------------------------------------------------------------------------------------------


def landings() -> Facts:
    """Wall time from before the processes start until the last one has ended, their imports and builds from the cache included."""
    _land(1, PROCESSES)  # compiles what is not in the cache
    runs = [_land(1, LANDINGS) for _ in range(REPEATS)]
    return min(runs, key=lambda run: float(run["wall_s"]))


def _land(first: int, last: int) -> Facts:
    share = (last - first + 1) // PROCESSES
    bounds = [first + share * i for i in range(PROCESSES)] + [last + 1]
    begun = time.monotonic()
    processes = [
        subprocess.Popen(
            [sys.executable, str(HERE / "landings.py"), str(low), str(high - 1)], stdout=subprocess.PIPE, text=True
        )
        for low, high in zip(bounds, bounds[1:], strict=False)
    ]
    texts = [process.communicate()[0] for process in processes]
    wall_s = time.monotonic() - begun
    if any(process.returncode for process in processes):
        raise RuntimeError("landings failed")
    parts = [json.loads(text) for text in texts]
    speeds = [speed for part in parts for speed in part["speeds"]]
    simulated_s = sum(part["ticks"] for part in parts) / 100
    return {"count": len(speeds), "wall_s": wall_s, "simulated_s": simulated_s, "hardest_m_s": max(speeds)}


# ---- the satellite ---------------------------------------------------------------------------------------------------


def satellite(plant: Facts) -> Facts:
    """The best second of each in ns per step, and the errors at its end, in m and rad."""
    found: Facts = {}
    for name, key in (("FCSL", "simulated"), ("by hand", "by_hand")):
        x = plant[key]
        errors = case.errors(float(SECONDS["satellite"]), x[:3], x[6:10])
        found[name] = _checked(name, {"ns": plant[f"{key}_ns_best"], "errors": errors})
    for name, module in PEERS.items():
        try:
            found[name] = _checked(name, _fly(module))
        except FileNotFoundError as error:
            found[name] = {"missing": str(error)}
    return found


def _fly(module: str) -> Facts:
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(BENCH.parent), os.environ.get("PYTHONPATH", "")])}
    line = [sys.executable, "-m", f"bench.peers.satellite.{module}", str(SECONDS["satellite"])]
    runs = []
    for _ in range(REPEATS):
        done = subprocess.run(line, env=environment, capture_output=True, text=True)
        if "ModuleNotFoundError" in done.stderr:
            raise FileNotFoundError(done.stderr.strip().rpartition("\n")[2])
        if done.returncode:
            raise RuntimeError(f"{module}: {done.stderr}")
        runs.append(json.loads(done.stdout.strip().rpartition("\n")[2]))
    ns = min(second for run in runs for second in run["ns"])
    return {"ns": ns, "errors": runs[0]["errors"], "version": runs[0]["version"]}


def _checked(name: str, facts: Facts) -> Facts:
    away, turned = facts["errors"]
    if not (away <= MAX_AWAY_M and turned <= MAX_TURNED):
        raise RuntimeError(f"{name}: another flight ({away:.1e} m and {turned:.1e} rad from the closed form)")
    return facts


# ---- the table -------------------------------------------------------------------------------------------------------


def simulator_rows(facts: Facts) -> list[tuple[str, str]]:
    rows = []
    for name, p in facts["plants"].items():
        if p["states"] >= MANY_STATES:
            goal = f"{p['ratio']:.2f} (goal {GOAL_RATIO})"
        else:
            goal = f"{p['more_ns']:.0f} ns more (goal {GOAL_MORE_NS})"
        ends = "same bits" if p["same_bits"] else "same to 1e-9"
        rows.append((f"{name}, {p['states']} states, 1 kHz, RK4", f"{p['simulated_ns']:.1f} ns per step"))
        rows.append(("    by hand in C", f"{p['by_hand_ns']:.1f} ns"))
        rows.append(("    its derivative in a function", f"{p['apart_ns']:.1f} ns"))
        rows.append((f"    ÷ or − by hand; {ends}", goal))
    flown = facts["landings"]
    many = flown["simulated_s"] / flown["wall_s"]
    rows.append(
        (f"{flown['count']} landings, {PROCESSES} processes", f"{flown['wall_s']:.1f} s (goal {GOAL_LANDINGS_S})")
    )
    rows.append(("    together", f"{many:.0f} × real time"))
    for name, s in facts["satellite"].items():
        if "missing" in s:
            rows.append((f"satellite, {name}", f"not installed: {s['missing']}"))
            continue
        rows.append((f"satellite, {name}", f"{s['ns']:.0f} ns per step"))
        rows.append((f"    off after {SECONDS['satellite']} s", f"{s['errors'][0]:.0e} m, {s['errors'][1]:.0e} rad"))
    return rows


def main() -> int:
    with tempfile.TemporaryDirectory() as folder:
        facts = simulator_figures(Path(folder))
    for what, figure in simulator_rows(facts):
        print(f"{what:<44}{figure:>34}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, subprocess.SubprocessError) as error:
        sys.exit(f"bench: {error}")
