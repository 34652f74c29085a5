# SPDX-License-Identifier: Apache-2.0
"""The machine of a simulation without a controller: it has a tick, and neither instances nor channels."""

from __future__ import annotations

import json

from fcsl_compiler.api.build import BuiltMachine, build_machine, cache_dir, make_entry_folder, unwritten
from fcsl_compiler.api.files import write_whole

NAME = "plant_only"
#: Of any machine (fcsl_compiler/config/machine.py, which would import the compiler).
MAX_TICK_HZ = 1_000_000


def build_plant_only(tick_hz: int) -> BuiltMachine:
    """Compiles it, or takes it from the cache of builds, in which its JSON is, too. Raises ToolchainError."""
    machine = {
        "description": "of a simulation without a controller",
        "tick_hz": tick_hz,
        "initial_state": "RUN",
        "algorithms": {},
        "instances": {},
        "states": {"RUN": {"schedule": {}}},
    }
    try:
        config = make_entry_folder(NAME, str(tick_hz)) / f"{NAME}.json"
        write_whole(config, json.dumps(machine, indent=2) + "\n")
    except OSError as error:
        raise unwritten(error, cache_dir()) from None
    return build_machine(config)
