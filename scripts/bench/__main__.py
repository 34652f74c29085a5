# SPDX-License-Identifier: Apache-2.0
"""`python3 scripts/bench` takes all figures of `make bench` (figures.py), `python3 scripts/bench NAME [OPTIONS]` those of one subject."""

import runpy
import sys
from pathlib import Path

#: What can be run alone, and its module in subjects/.
ALONE = {
    "backends": "backends",
    "board": "board",
    "bus": "bus.main",
    "campaign": "campaign.main",
    "chain": "chain",
    "checkpoint": "checkpoint",
    "guard": "guard",
    "lateness": "lateness",
    "link": "link.main",
    "linear": "linear.main",
    "process": "process",
    "record": "record",
    "requirements": "requirements",
    "set_up": "set_up",
    "simulator": "simulator.main",
    "start": "start",
    "telemetry": "telemetry",
    "times": "times",
    "twin": "twin",
    "vars": "vars.main",
    "whole": "whole.main",
    "wire": "wire.main",
}

# The modules here are those of the package `bench`, which is found from the folder that holds it.
sys.path[0] = str(Path(__file__).resolve().parents[1])
if len(sys.argv) > 1:
    name = sys.argv.pop(1)
    if name not in ALONE:
        sys.exit(f"bench: `{name}` is nothing that is measured alone; those are: {', '.join(ALONE)}")
    sys.argv[0] = f"bench {name}"  # as its --help calls it
    runpy.run_module(f"bench.subjects.{ALONE[name]}", run_name="__main__")
else:
    runpy.run_module("bench.figures", run_name="__main__")
