# SPDX-License-Identifier: Apache-2.0
"""From an edit of the lander to its first tested tick."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from ..harness.size import sized

CONFIG = Path(__file__).resolve().parents[3] / "examples/lander/fc/lander_control.json"
#: Processes of which the figures are the best.
LOOPS = sized(7, 1)
_CHECK = """
import sys, time
from pathlib import Path
from fcsl_compiler.driver.passes import compile_machine
begun = time.perf_counter()
compile_machine(Path(sys.argv[1]), "", until="verify")
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

    check: of the first `fcsl check` after import. cold: from the edit of one algorithm to the end of a process that imported
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
