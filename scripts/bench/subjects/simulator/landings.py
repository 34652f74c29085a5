# SPDX-License-Identifier: Apache-2.0
"""Landings of the lander in one process: `python3 landings.py FIRST LAST` flies these seeds, and prints what became of them."""

from __future__ import annotations

import json
import sys
from pathlib import Path

from fcsl_sim import Simulation, load

SIM = Path(__file__).resolve().parents[4] / "examples/lander/sim/lander.sim.json"


def main() -> None:
    config = load(SIM)
    speeds, ticks = [], 0
    for seed in range(int(sys.argv[1]), int(sys.argv[2]) + 1):
        with Simulation(config.with_seed(seed).plan, config.tables) as sim:
            while sim.status == "running":
                ticks += sim.run(config.ticks)
            if sim.status != "until":
                sys.exit(f"bench: with seed {seed} it does not land")
            speeds.append(sim.get("lander.outputs.touchdown_speed"))
    print(json.dumps({"speeds": speeds, "ticks": ticks}))


if __name__ == "__main__":
    main()
