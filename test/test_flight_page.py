# SPDX-License-Identifier: Apache-2.0
"""docs/hardware/flight_computer.md: its flight with a simulator, run as it is written."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

from simclient.replay import replay

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = "install/lander/lib/lander/liblander_machines.so"


def test_the_flight_with_a_simulator(tmp_path: Path) -> None:
    page = (ROOT / "docs/hardware/flight_computer.md").read_text()
    found = re.search(r"^### With a simulator\n.*?```sh\n(.*?)```", page, re.MULTILINE | re.DOTALL)
    assert found and LIBRARY in found[1]
    for folder in ("examples", "install"):
        (tmp_path / folder).symlink_to(ROOT / folder)
    done = subprocess.run(
        ["bash", "-euc", found[1]], cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "end: the stop condition held" in done.stdout
    verdict = replay(tmp_path / "flight", library=str(ROOT / LIBRARY))
    assert verdict.identical and verdict.ticks > 1000, str(verdict)
