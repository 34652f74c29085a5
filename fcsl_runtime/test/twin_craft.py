# SPDX-License-Identifier: Apache-2.0
"""A machine for tests of what every kind of twin does alike (conftest.py: `craft`, `twin`): a sensor block and what watches it."""

from __future__ import annotations

from typing import Any

SENSORS = """
class Outputs:
    altitude: "f64 m"
    gyro: "f64[3] rad/s"


def execute() -> None:
    pass
"""

WATCH = """
from fcsl_builtins import Health, TransitionRequest


class Inputs:
    altitude: "f64 m"
    sensors_health: Health
    wish: f64


class Parameters:
    limit: "f64 m in 0..1000"
    floor: "f64 m in ..500"


class Outputs:
    count: i64
    table: "f64[2,3]"
    best: Target
    targets: "Target[2]"
    ok: bool


class State:
    sum: "f64 m"


def execute(u: Inputs, p: Parameters, y: Outputs, x: State) -> None:
    y.count += 1
    x.sum += u.altitude
    y.ok = u.altitude < p.limit
    y.table[1, 2] = u.altitude
    y.best.pos[0] = x.sum
    y.best.seen = y.ok
    y.targets[1].pos[1] = u.wish
    if u.sensors_health == Health.failed:
        y.health = Health.degraded
    if u.altitude > p.limit:
        y.transition_request = TransitionRequest.STOP
"""

CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {"Target": {"pos": "f64[2] m", "seen": "bool"}},
    "algorithms": {"sensors": {"source": "sensors.py"}, "watch": {"source": "watch.py"}},
    "instances": {
        "sensors": {"algorithm": "sensors"},
        "watch": {"algorithm": "watch", "parameters": {"limit": 100, "floor": 1}, "max_wcet_us": 100},
    },
    "connections": [
        {"from": "sensors.outputs.altitude", "to": "watch.inputs.altitude"},
        {"from": "sensors.outputs.health", "to": "watch.inputs.sensors_health"},
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
