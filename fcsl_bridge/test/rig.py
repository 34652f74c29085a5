# SPDX-License-Identifier: Apache-2.0
"""A small machine with parameters of every kind, one mapped sensor and one mapped actuator, and no message package."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

_IMU = """
class Imu:
    outputs = {"rate": "f64[3] rad/s"}

    def execute(self):
        pass
"""
_PILOT = """
class Pilot:
    inputs = {"rate": "f64[3] rad/s"}
    outputs = {"torque": "f64 N", "ticks": "i64", "on": "bool"}
    parameters = {
        "gain": "f64 N/rad in 0..10",  # torque for each radian
        "limit": "f32",
        "steps": "i32 in -5..5",
        "large": "u64",
        "armed": "bool",
        "weights": "f64[3] in -1..1",
        "offsets": "f64[2]",
        "masks": "bool[2]",
        "table": "i64[2][2]",
        "least": "Health",
        "on_done": "TransitionRequest",
        "plan": "TransitionRequest[2]",
        "shape": "f64",
    }

    def execute(self):
        self.torque = self.gain * self.rate[2] + self.shape
        self.ticks += 1
        self.on = True
"""
_SLOW = """
class Slow:
    outputs = {"angle": "f64 rad"}

    def execute(self):
        for i in range(20000):
            self.angle = sin(self.angle + 1.0)
"""
PARAMETERS = {
    "gain": 1.0,
    "limit": 0.5,
    "steps": 2,
    "large": 7,
    "armed": True,
    "weights": [0.0, 0.5, 1.0],
    "offsets": [0.0, 0.25],
    "masks": [True, False],
    "table": [[1, 2], [3, 4]],
    "least": "degraded",
    "on_done": "",
    "plan": ["", ""],
    "shape": 0.25,
}


def build(
    folder: Path, tick_hz: int = 100, publish: tuple[str, ...] = (), safe: float | None = None, times: bool = False
) -> Path:
    """The library of machine `rig`; its published instances have no message package. safe: of the torque, which the
    pilot then arms. times: of its instances are measured."""
    (folder / "imu.py").write_text(_IMU)
    (folder / "pilot.py").write_text(_PILOT)
    (folder / "slow.py").write_text(_SLOW)
    sensor = {"type": "sensor_msgs/Imu", "field": "angular_velocity", "topic": "imu/data", "frame": "imu_link"}
    config = {
        "tick_hz": tick_hz,
        "initial_state": "IDLE",
        "publish": list(publish),
        "algorithms": {"Imu": {"source": "imu.py"}, "Pilot": {"source": "pilot.py"}, "Slow": {"source": "slow.py"}},
        "instances": {
            "imu": {"algorithm": "Imu"},
            "pilot": {"algorithm": "Pilot", "parameters": PARAMETERS, "frozen": ["shape"], "max_wcet_us": 900_000},
            "slow": {"algorithm": "Slow", "max_wcet_us": 10},
        },
        "connections": [{"from": "imu.rate", "to": "pilot.rate"}],
        "states": {
            "IDLE": {"schedule": {"imu": tick_hz}},
            "SLOW": {"schedule": {"slow": tick_hz}},
            "FLY": {"schedule": {"imu": tick_hz, "pilot": tick_hz}},
        },
        "transitions": [{"from": "IDLE", "to": "FLY", "health": {"instance": "imu", "in": ["nominal", "degraded"]}}],
        "requests": ["LAND", "HOLD"],
        "channels": [
            {
                "name": "imu.rate",
                "id": 1,
                "field": "imu.outputs.rate",
                "direction": "sensor",
                "max_age_ticks": tick_hz // 2,
                "ros": sensor,
            },
            {
                "name": "motor.torque",
                "id": 2,
                "field": "pilot.outputs.torque",
                "direction": "actuator",
                "ros": {"type": "std_msgs/Float64", "field": "data", "topic": "motor/torque"},
            },
        ],
    }
    if safe is not None:
        config["arm"], config["channels"][1]["safe"] = "pilot.on", safe  # type: ignore[index]
    (folder / "rig.json").write_text(json.dumps(config))
    line = ["fcslc", "build", str(folder / "rig.json"), "-o", str(folder / "out"), *(["--times"] if times else [])]
    done = subprocess.run(line, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder / "out" / "librig.so"
