# SPDX-License-Identifier: Apache-2.0
"""A vehicle with two estimators of height and attitude, of which one runs in TRACK alone; outputs are structs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

from simclient import AlgTwin

TICKS, TRACK_FROM, TRACK_UNTIL, STEP_S = 100, 30, 70, 0.01
_ALGORITHMS = {
    "reference": """
class Reference:
    outputs = {"height": "f64 m", "q": "f64[4]"}

    def execute(self):
        pass
""",
    "coarse": """
class Coarse:
    inputs = {"height": "f64 m", "q": "f64[4]"}
    outputs = {"pose": "Pose", "noise": "f64[9]"}

    def execute(self):
        self.pose.height = self.height + 0.5
        self.pose.q = self.q
        self.pose.valid = self.height > 2.0
""",
    "fine": """
class Fine:
    inputs = {"height": "f64 m", "q": "f64[4]"}
    outputs = {"pose": "Pose", "stamp": "u64"}

    def execute(self):
        self.pose.height = self.height + 0.1
        self.pose.q = self.q
        self.stamp += u64(1)
""",
    "guide": """
class Guide:
    outputs = {"height": "f64 m", "force": "f64[3] N"}

    def execute(self):
        self.height = 4.0
        self.force[2] = 5.0
""",
}
VIEWS: dict[str, Any] = {
    "panels": [
        {
            "title": "height",
            "truth": ["reference.outputs.height"],
            "estimate": ["coarse.outputs.pose.height", "fine.outputs.pose.height"],
            "command": ["guide.outputs.height"],
        },
        {
            "title": "attitude",
            "angles": True,
            "truth": ["reference.outputs.q"],
            "estimate": ["coarse.outputs.pose.q", "fine.outputs.pose.q"],
        },
        {"title": "valid", "values": ["coarse.outputs.pose.valid", "fine.outputs.pose.valid"]},
        {"title": "seen", "measured": ["fine.inputs.height"]},
    ],
    "body": {
        "shape": "multirotor",
        "size": 0.5,
        "position": [0, 1.5, "fine.outputs.pose.height"],
        "attitude": "reference.outputs.q",
        "thrust": "guide.outputs.force",
    },
}
_ALWAYS = {"reference": 100, "coarse": 100, "guide": 100}
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "WAIT",
    "structs": {"Pose": {"q": "f64[4]", "height": "f64 m", "valid": "bool"}},
    "algorithms": {name.capitalize(): {"source": f"{name}.py"} for name in _ALGORITHMS},
    "instances": {**{name: {"algorithm": name.capitalize()} for name in _ALGORITHMS}, "spare": {"algorithm": "Fine"}},
    "connections": [
        {"from": f"reference.{field}", "to": f"{name}.{field}"}
        for name in ("coarse", "fine", "spare")
        for field in ("height", "q")
    ],
    "states": {
        "WAIT": {"schedule": _ALWAYS},
        "TRACK": {"schedule": {**_ALWAYS, "fine": 100}},
        "LOST": {"schedule": {**_ALWAYS, "spare": 100}},
    },
    "transitions": [],
}


def write_config(folder: Path, views: dict[str, Any] | None = None) -> Path:
    """The machine JSON, below `folder`, with these views if there are any."""
    for name, text in _ALGORITHMS.items():
        (folder / f"{name}.py").write_text(text)
    config = CONFIG if views is None else {**CONFIG, "views": views}
    (folder / "pair.json").write_text(json.dumps(config))
    return folder / "pair.json"


def height(k: int) -> float:
    """The true height in tick k, in m."""
    return 3.0 + math.sin(k / 10)


def turn(k: int) -> float:
    """The true yaw in tick k, in rad: it passes 180 degrees."""
    return 2.5 + k / 50


def fly(config: Path, bag: Path) -> None:
    with AlgTwin.from_config(config) as twin:
        twin.record(bag)
        for k in range(TICKS):
            twin.set("reference.outputs.height", height(k))
            twin.set("reference.outputs.q", [math.cos(turn(k) / 2), 0.0, 0.0, math.sin(turn(k) / 2)])
            if k in (TRACK_FROM, TRACK_UNTIL):
                twin.set_state("TRACK" if k == TRACK_FROM else "WAIT")
            twin.tick()
