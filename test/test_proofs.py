# SPDX-License-Identifier: Apache-2.0
"""What `fcsl prove` shows of the vehicles for all inputs: their modes, aborts and interlocks."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"
#: Requirements that take no more than two seconds. Others of these vehicles are proven with more time, or stay open.
PROVEN = {
    "glider/fc/glider.json": ["GLI-2", "GLI-4"],
    "inverted_pendulum/fc/inverted_pendulum.json": ["PEN-2"],
    "lander/fc/lander_control.json": ["LND-7", "LND-8", "LND-9"],
    "quadrotor/fc/quadrotor.json": ["QUA-2", "QUA-3"],
    "rocket_landing/fc/rocket_landing.json": ["RKT-4"],
    "rover/fc/rover.json": ["ROV-2", "ROV-4", "ROV-5"],
    "satellite/fc/satellite.json": ["SAT-5"],
}


@pytest.mark.parametrize("machine", PROVEN)
def test_a_vehicle(machine: str) -> None:
    only = [word for id_ in PROVEN[machine] for word in ("--only", id_)]
    line = ["fcsl", "prove", str(EXAMPLES / machine), "--seconds", "100", "--json", *only]
    found = subprocess.run(line, capture_output=True, text=True, timeout=600, check=False)
    assert found.returncode == 0, found.stderr
    assert {r["id"]: r["answer"] for r in json.loads(found.stdout)["results"]} == dict.fromkeys(
        PROVEN[machine], "proven"
    )
