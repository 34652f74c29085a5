# SPDX-License-Identifier: Apache-2.0
"""The part attitude_control.json: a body that it turns, against its linear model; what its ports reach."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.spatial.transform import Rotation

from simclient import AlgTwin

PART = "package://fcsl_blocks/attitude_control.json"
INERTIA = np.diag([0.02, 0.02, 0.04])
PARAMETERS: dict[str, Any] = {"gain": [6, 6, 3], "kp": [0.3, 0.3, 0.2]}


def craft(folder: Path, tick_hz: int = 1000, **changes: Any) -> Path:
    config = {
        "tick_hz": tick_hz,
        "initial_state": "FLY",
        "algorithms": {},
        "instances": {"att": {"machine": PART, "parameters": PARAMETERS, **changes}},
        "states": {"FLY": {"schedule": {"att": True}}},
    }
    path = folder / "craft.json"
    path.write_text(json.dumps(config))
    return path


def turned(twin: AlgTwin, start: Rotation, seconds: float) -> tuple[Rotation, np.ndarray]:
    """Attitude and rates of a rigid body after some time, in steps of a tick."""
    attitude, rate, dt = start, np.zeros(3), 1.0 / twin.machine.tick_hz
    for _ in range(round(seconds / dt)):
        twin.set("att.law.inputs.attitude", attitude.as_quat(scalar_first=True))
        twin.set("att.rate.inputs.rate", rate)
        twin.tick()
        torque = np.array(twin.get_value("att.rate.outputs.torque"))
        rate = rate + np.linalg.solve(INERTIA, torque - np.cross(rate, INERTIA @ rate)) * dt
        attitude = attitude * Rotation.from_rotvec(rate * dt)
    return attitude, rate


def test_a_body_turns_level_as_its_linear_model(tmp_path: Path) -> None:
    """angle' = -rate, J rate' = kp (gain angle - rate): per axis, by SciPy's matrix exponential."""
    start = Rotation.from_rotvec([0.05, -0.04, 0.06])
    for seconds in (0.1, 0.2, 0.5):
        with AlgTwin.from_config(craft(tmp_path)) as twin:
            attitude, rate = turned(twin, start, seconds)
        for axis in range(3):
            kp, gain = PARAMETERS["kp"][axis] / INERTIA[axis, axis], PARAMETERS["gain"][axis]
            a = np.array([[0.0, 1.0], [-kp * gain, -kp]])
            expected = expm(a * seconds) @ [start.as_rotvec()[axis], 0.0]
            assert attitude.as_rotvec()[axis] == pytest.approx(expected[0], abs=2e-3)
            assert rate[axis] == pytest.approx(expected[1], abs=2e-2)


def test_a_large_tilt_is_taken_back(tmp_path: Path) -> None:
    limited = {**PARAMETERS, "rate_limit": [3, 3, 3], "torque_limit": [0.3, 0.3, 0.3]}
    with AlgTwin.from_config(craft(tmp_path, parameters=limited)) as twin:
        attitude, rate = turned(twin, Rotation.from_euler("ZYX", [100.0, 40.0, -70.0], degrees=True), 4.0)
        assert {id_: v.status for id_, v in twin.requirements.items()} == {"att.ATT-1": "met", "att.ATT-2": "met"}
    assert attitude.magnitude() < 1e-3 and np.abs(rate).max() < 1e-3


def test_ports_reach_both_loops(tmp_path: Path) -> None:
    part = json.loads((Path(__file__).resolve().parents[1] / "blocks/attitude_control.json").read_text())
    names = part["ports"]["parameters"]
    given = {name: 0.5 if name in ("yaw_weight", "derivative_time", "tracking_time") else [1, 2, 3] for name in names}
    inputs = {
        name: True if name == "hold" else [1, 0, 0, 0] if name in ("attitude", "target") else [4, 5, 6]
        for name in part["ports"]["inputs"]
    }
    with AlgTwin.from_config(craft(tmp_path, parameters=given, inputs=inputs)) as twin:
        for record, values in (("parameters", given), ("inputs", inputs)):
            for name, value in values.items():
                instance, _, field = part["ports"][record][name].partition(".")
                found = twin.get_value(f"att.{instance}.{record}.{field}")
                assert np.array_equal(found, value), name


def test_its_rates_divide_those_of_the_machine(tmp_path: Path) -> None:
    with AlgTwin.from_config(craft(tmp_path, tick_hz=500)) as twin:
        twin.tick(2)
        assert (
            twin.get_value("att.rate.inputs.period") == 0.002 and twin.get_value("att.law.outputs.health") == "nominal"
        )
