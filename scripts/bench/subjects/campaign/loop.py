# SPDX-License-Identifier: Apache-2.0
"""Flies a share of a study's cases one after another, in one process, and prints the hash of each one's end.

python3 loop.py STUDY CASES FIRST STEP measured|flown
`measured`: with the metrics of the study; `flown`: the flights alone.
"""

from __future__ import annotations

import hashlib
import json
import sys
from pathlib import Path

from fcsl_sim import Simulation
from fcsl_sim.campaign.flight import Flights


def flown(flights: Flights, case: int) -> str:
    config = flights.config(case)
    with Simulation(config.plan, config.tables) as sim:
        while sim.status == "running":
            sim.run(config.ticks)
        return hashlib.sha256(sim.checkpoint()).hexdigest()[:16]


def main() -> None:
    study, cases, first, step, what = sys.argv[1:]
    flights = Flights.of(Path(study), int(cases))
    numbers = range(int(first), int(cases), int(step))
    if what == "measured":
        hashes = {case: flights.fly(case).hash for case in numbers}
    else:
        hashes = {case: flown(flights, case) for case in numbers}
    flights.close()
    print(json.dumps(hashes))


if __name__ == "__main__":
    main()
