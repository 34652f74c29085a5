# SPDX-License-Identifier: Apache-2.0
"""Plans of ROS 2 messages in the compiler; simclient's tests execute them."""

import json
from pathlib import Path

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError, Severity
from fcsl_compiler.driver.passes import compile_machine

ALONE = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 10}}},
}


def test_a_message_of_too_many_channels(tmp_path: Path) -> None:
    """A plan has limits; the compiler says so, and what to do, where the channels are."""
    joints = range(257)
    (tmp_path / "law.py").write_text(
        "class Law:\n    outputs = {"
        + ", ".join(f'"q{i}": "f64"' for i in joints)
        + "}\n\n    def execute(self):\n        pass\n"
    )
    ros = {"type": "sensor_msgs/JointState", "topic": "joints"}
    channels = [
        {"name": f"q{i}", "id": i, "field": f"law.outputs.q{i}", "direction": "actuator"}
        | {"ros": {**ros, "field": f"position[j{i}]"}}
        for i in joints
    ]
    machine = {**ALONE, "channels": channels}
    (tmp_path / "arm.json").write_text(json.dumps(machine))
    with pytest.raises(DiagnosticError) as failed:
        compile_machine(tmp_path / "arm.json", "")
    (found,) = [d for d in failed.value.diagnostics if d.severity is Severity.ERROR]
    assert found.code == "E241" and "topic `joints`" in found.message and "too many" in found.message
    assert "another `topic`" in found.help
