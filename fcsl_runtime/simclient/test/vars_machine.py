# SPDX-License-Identifier: Apache-2.0
"""A machine whose fields have every kind of shape, for tests of the variable server."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

HOLD = '''
class Hold:
    """Keeps what a client writes."""

    inputs = {"u": "f64[3]", "free": "f64"}
    outputs = {"y": "f64"}
    parameters = {"k": "f64[2][3]"}
    state = {
        "p": "f64[4][5]",
        "cube": "i32[2][3][4]",
        "line": "f32[7]",
        "big": "u64",
        "flag": "bool",
        "count": "i64",
    }

    def execute(self):
        self.y = self.u[0] + self.p[0, 0]
        self.count += 1
'''
_SOURCE = """
class Source:
    outputs = {"u": "f64[3]"}

    def execute(self):
        pass
"""
CONFIG: dict[str, Any] = {
    "tick_hz": 1000,
    "initial_state": "RUN",
    "algorithms": {"Hold": {"source": "hold.py"}, "Source": {"source": "source.py"}},
    "instances": {
        "source": {"algorithm": "Source"},
        "hold": {"algorithm": "Hold", "parameters": {"k": [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]}},
    },
    "connections": [{"from": "source.u", "to": "hold.u"}],
    "channels": [
        {"name": "probe", "id": 1, "field": "source.outputs.u", "direction": "sensor", "max_age_ticks": 5},
        {"name": "out", "id": 2, "field": "hold.outputs.y", "direction": "actuator"},
    ],
    "states": {"RUN": {"schedule": {"source": 1000, "hold": 1000}}, "WAIT": {"schedule": {"source": 1000}}},
    "transitions": [],
}


def build(folder: Path, hold: str = HOLD) -> str:
    """The machine's library, made in `folder`."""
    (folder / "hold.py").write_text(hold)
    (folder / "source.py").write_text(_SOURCE)
    (folder / "shapes.json").write_text(json.dumps(CONFIG))
    command = [sys.executable, "-m", "fcsl_compiler.cli.main", "build", str(folder / "shapes.json"), "-o", str(folder)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    (library,) = folder.glob("*.so")
    return str(library)
