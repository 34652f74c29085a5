# SPDX-License-Identifier: Apache-2.0
"""`fcsl tune` brings the roll rate loop from poor gains to the margins of the design."""

from __future__ import annotations

import json
import math
import subprocess
from pathlib import Path

SIM = Path(__file__).resolve().parents[1] / "sim"
ROLL = [f"motor_{number}.inputs.throttle={sign}" for number, sign in enumerate((-1, 1, 1, -1), 1)]


def phase_margin(parameters: Path, folder: Path) -> float:
    """Of the roll rate loop with the compiled controller, in hover, in degrees."""
    line = ["fcsl", "response", SIM / "calm.sim.json", "--at", "12", "-o", folder / "response.json"]
    line += [
        "--parameters",
        parameters,
        "--from",
        "12",
        "--to",
        "50",
        "--points",
        "7",
        *(word for path in ROLL for word in ("--input", path)),
    ]
    subprocess.run(list(map(str, line)), check=True, capture_output=True)
    return math.degrees(json.loads((folder / "response.json").read_text())["margins"]["phase_margin"])


def test_it_finds_the_margins_of_the_design(tmp_path: Path) -> None:
    """With a smaller search than that of the file."""
    study = json.loads((SIM / "rate_loop.study.json").read_text())
    study |= {"simulation": str(SIM / study["simulation"]), "cases": 3}
    study["tune"] |= {"cases": 1, "population": 8, "generations": 4}
    (tmp_path / "loop.study.json").write_text(json.dumps(study))
    line = ["fcsl", "tune", "loop.study.json", "--parameters", SIM / "poor_gains.yaml", "--json"]
    done = subprocess.run(list(map(str, line)), cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    result = json.loads(done.stdout)
    assert result["before"]["passed"] == 0 and result["after"]["passed"] == 2
    poor = phase_margin(SIM / "poor_gains.yaml", tmp_path)
    tuned = phase_margin(tmp_path / "loop.tune/parameters.yaml", tmp_path)
    assert poor < 36.0 and tuned > 45.0, (poor, tuned)  # that of the machine's own gains is 49 degrees
