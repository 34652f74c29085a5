# SPDX-License-Identifier: Apache-2.0
"""`python3 scripts/verify [OPTIONS]` runs the checks that checks.py lists, `python3 scripts/verify NAME [OPTIONS]` one alone."""

import runpy
import sys
from pathlib import Path

#: What can be run alone, and its module.
ALONE = {
    "binary": "binary.main",
    "bits": "bits.main",
    "codec": "codec.main",
    "coverage": "coverage.main",
    "eva": "eva.main",
    "foxglove": "foxglove.main",
    "fuzz": "fuzz.main",
    "fuzz_telemetry": "fuzz.telemetry",
    "hardware": "hardware.main",
    "instruction_table": "instructions.table",
    "instructions": "instructions.main",
    "link": "link.main",
    "mutation": "mutation.main",
    "pil": "pil.main",
    "plant_bits": "plant_bits.main",
    "ray": "ray.main",
    "receivers": "receivers.main",
    "sanitize": "sanitize.main",
    "workspace": "workspace.main",
    "wheel": "wheel.main",
}

# The modules here are those of the package `verify`, which is found from the folder that holds it.
sys.path[0] = str(Path(__file__).resolve().parents[1])
if len(sys.argv) > 1 and sys.argv[1] in ALONE:
    name = sys.argv.pop(1)
    sys.argv[0] = f"verify {name}"  # as its --help calls it
    runpy.run_module(f"verify.{ALONE[name]}", run_name="__main__")
else:
    sys.argv[0] = "verify"
    runpy.run_module("verify.checks", run_name="__main__")
