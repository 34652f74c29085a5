# SPDX-License-Identifier: Apache-2.0
"""A machine with a parameter of every kind, whose start() reads some, and parameter files for it."""

from __future__ import annotations

import json
from copy import deepcopy
from pathlib import Path
from typing import Any

_LAW = """
class Law:
    inputs = {"x": "f64"}
    outputs = {"u": "f64 N", "mode": "Health", "next": "TransitionRequest"}
    parameters = {
        "gain": "f64 N/rad in 0..10",
        "narrow": "f32",
        "steps": "i32 in -5..5",
        "large": "u64",
        "on": "bool",
        "table": "f64[2][3]",
        "masks": "bool[2]",
        "least": "Health",
        "on_done": "TransitionRequest",
        "loop": "Loop",
        "targets": "Loop[2]",
        "shape": "f64",
    }
    state = {"begun": "f64", "sum": "f64"}

    def start(self):
        self.begun = self.gain * 2.0 + self.loop.kp + self.table[1, 2] + self.targets[1].ki

    def execute(self):
        self.sum += self.begun * self.x + f64(self.narrow)
        self.u = self.gain * self.sum * self.shape
        self.mode = self.least
        self.next = self.on_done
"""
PARAMETERS: dict[str, Any] = {
    "gain": 1.0,
    "narrow": 0.5,
    "steps": 2,
    "large": 7,
    "on": True,
    "table": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
    "masks": [True, False],
    "least": "nominal",
    "on_done": "",
    "loop": {"kp": 0.25, "ki": 0.125},
    "targets": [{"kp": 1.0, "ki": 2.0}, {"kp": 3.0, "ki": 4.0}],
    "shape": 0.25,
}
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Loop": {"kp": "f64", "ki": "f64 1/s"}},
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law", "parameters": PARAMETERS, "frozen": ["shape"]}},
    "states": {"RUN": {"schedule": {"law": 100}}, "END": {"schedule": {"law": 100}}},
    "transitions": [{"from": "RUN", "to": "END", "request": "STOP"}],
    "requests": ["GO"],
}
#: A file that a user of ROS 2 would write, for CHANGED.
FILE = """\
# tuned on Tuesday
/**:
  ros__parameters:
    use_sim_time: true        # of the node itself
    law.gain: 3               # [N/rad]
    law:
      narrow: 0.1
      steps: -5
      large: 18446744073709551615
      on: false  # switched off
      table: [9.0, 8.5, 7,
              6.0, 5e0, -4.0]
      masks: [[false, true]]
      least: "failed"
      loop: {kp: 1.5, ki: 2.5e-1}
      targets.1.ki: .5        # [1/s]
      targets:
        0: {"kp":-2.0}

/quad1/tuned:
  ros__parameters: {law.gain: 0.0}
tuned:
  ros__parameters:
    law.on_done: GO
"""
FILE = FILE.replace("masks: [[false, true]]", "masks: [false, true]")
CHANGED: dict[str, Any] = {
    "gain": 3.0,
    "narrow": 0.1,
    "steps": -5,
    "large": 2**64 - 1,
    "on": False,
    "table": [[9.0, 8.5, 7.0], [6.0, 5.0, -4.0]],
    "masks": [False, True],
    "least": "failed",
    "on_done": "GO",
    "loop": {"kp": 1.5, "ki": 0.25},
    "targets": [{"kp": -2.0, "ki": 2.0}, {"kp": 3.0, "ki": 0.5}],
    "shape": 0.25,
}


def config(**parameters: Any) -> dict[str, Any]:
    changed = deepcopy(CONFIG)
    changed["instances"]["law"]["parameters"] |= parameters
    return changed


def write(folder: Path, **parameters: Any) -> Path:
    """The machine JSON of `tuned`, with these parameters instead of its own."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "law.py").write_text(_LAW)
    path = folder / "tuned.json"
    path.write_text(json.dumps(config(**parameters), indent=2))
    return path


def file(folder: Path, text: str = FILE) -> Path:
    path = folder / "params.yaml"
    path.write_text(text)
    return path
