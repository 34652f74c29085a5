# SPDX-License-Identifier: Apache-2.0
"""Requests that a transition loses to another one, on /diagnostics."""

from __future__ import annotations

import json
import re
import subprocess

from bridge_harness import Domain
from controller_client import ControllerClient, figures
from diagnostic_msgs.msg import DiagnosticStatus

_PILOT = """
class Pilot:
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"wish": "TransitionRequest"}

    def execute(self):
        self.transition_request = self.wish
"""


def test_lost_requests_are_a_warning(domain: Domain) -> None:
    """Ten times per second GO is taken and HALT is lost."""
    config = {
        "tick_hz": 100,
        "initial_state": "A",
        "publish": [],
        "algorithms": {"Pilot": {"source": "pilot.py"}},
        "instances": {n: {"algorithm": "Pilot", "parameters": {"wish": n.upper()}} for n in ("go", "halt")},
        "always": {"go": 100, "halt": 100},
        "states": {"A": {}, "B": {}, "C": {}},
        "transitions": [
            {"from": "A", "to": "B", "request": "GO", "priority": 2, "after_s": 0.05},
            {"from": "A", "to": "C", "request": "HALT", "priority": 1, "after_s": 0.05},
            {"from": "B", "to": "A", "after_s": 0.05},
        ],
    }
    (domain.folder / "pilot.py").write_text(_PILOT)
    (domain.folder / "rig.json").write_text(json.dumps(config))
    subprocess.run(["fcslc", "build", "rig.json", "-o", "built"], cwd=domain.folder, check=True, capture_output=True)
    domain.start("controller_node", machine=domain.folder / "built/librig.so", mode="realtime")
    client = ControllerClient(domain.listener())
    while "lost requests A -> C: HALT" not in figures(status := client.diagnosed()[0]["rig"]):
        pass
    assert re.search(r"; [1-9]\d* lost requests A -> C: HALT$", status.message)
    assert status.level == DiagnosticStatus.WARN
