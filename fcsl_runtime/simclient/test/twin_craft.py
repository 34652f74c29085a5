# SPDX-License-Identifier: Apache-2.0
"""A machine for tests of what every kind of twin does alike (conftest.py: `craft`, `twin`): a sensor block and what watches it."""

from __future__ import annotations

from typing import Any

SENSORS = """
class Sensors:
    outputs = {"altitude": "f64 m", "gyro": "f64[3] rad/s"}

    def execute(self):
        pass
"""

WATCH = """
class Watch:
    inputs = {"altitude": "f64 m", "sensors_health": "Health", "wish": "f64"}
    outputs = {
        "count": "i64",
        "table": "f64[2][3]",
        "best": "Target",
        "targets": "Target[2]",
        "ok": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {"limit": "f64 m in 0..1000", "floor": "f64 m in ..500"}
    state = {"sum": "f64 m"}

    def execute(self):
        self.count += 1
        self.sum += self.altitude
        self.ok = self.altitude < self.limit
        self.table[1, 2] = self.altitude
        self.best.pos[0] = self.sum
        self.best.seen = self.ok
        self.targets[1].pos[1] = self.wish
        if self.sensors_health == "failed":
            self.health = "degraded"
        if self.altitude > self.limit:
            self.transition_request = "STOP"
"""

CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Target": {"pos": "f64[2] m", "seen": "bool"}},
    "algorithms": {"Sensors": {"source": "sensors.py"}, "Watch": {"source": "watch.py"}},
    "instances": {
        "sensors": {"algorithm": "Sensors"},
        "watch": {"algorithm": "Watch", "parameters": {"limit": 100, "floor": 1}, "max_wcet_us": 100},
    },
    "connections": [
        {"from": "sensors.altitude", "to": "watch.altitude"},
        {"from": "sensors.health", "to": "watch.sensors_health"},
    ],
    "states": {"RUN": {"schedule": {"sensors": 100, "watch": 100}}, "SAFE": {"schedule": {"sensors": 100}}},
    "transitions": [
        {"from": "RUN", "to": "SAFE", "request": "STOP", "priority": 2},
        {"from": "RUN", "to": "SAFE", "health": {"instance": "watch", "in": ["failed"]}, "priority": 1},
    ],
    "channels": [
        {"name": "alt", "id": 1, "field": "sensors.outputs.altitude", "direction": "sensor", "max_age_ticks": 3},
        {"name": "gyro", "id": 2, "field": "sensors.outputs.gyro", "direction": "sensor"},
        {"name": "sum", "id": 3, "field": "watch.outputs.count", "direction": "actuator"},
    ],
}
