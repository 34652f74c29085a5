# SPDX-License-Identifier: Apache-2.0
"""Conversions of ROS 2 messages in the compiler; simclient's tests execute them."""

import json
from pathlib import Path

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError, Severity
from fcsl_compiler.driver.passes import Compilation, compile_machine
from fcsl_compiler.ros.channels import payload_of

ALONE = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"law": 10}}},
}


def test_a_message_of_too_many_channels(tmp_path: Path) -> None:
    """A conversion has limits; the compiler says so, and what to do, where the channels are."""
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


def with_bus(folder: Path, bus: object) -> Compilation:
    ports = {
        "a": "bool",
        "b": "i32[2][3]",
        "c": "f32",
        "d": "bool[4]",
        "e": "u64[1]",
        "f": "u32[9]",
        "g": "f64[3] rad/s",
    }
    inputs = ", ".join(f'"{name}": "{kind}"' for name, kind in ports.items())
    (folder / "law.py").write_text(f"class Law:\n    inputs = {{{inputs}}}\n\n    def execute(self): ...\n")
    channels: list[dict[str, object]] = [
        {"name": name, "id": i, "field": f"law.inputs.{name}", "direction": "sensor"} for i, name in enumerate(ports)
    ]
    channels[5]["as"] = "blob"
    channels[6]["ros"] = {"type": "sensor_msgs/Imu", "field": "angular_velocity", "topic": "imu"}
    (folder / "law.json").write_text(json.dumps({**ALONE, "channels": channels, "bus": bus}))
    return compile_machine(folder / "law.json", "")


def test_messages_on_the_bus(tmp_path: Path) -> None:
    """Each channel has one, by its type or its `ros` block."""
    compiled = with_bus(tmp_path, {"payload": "cdr"})
    messages = [payload_of(channel) for channel in compiled.checked.channels]
    types = ["Bool", "Int32MultiArray", "Float32", "UInt8MultiArray", "UInt64MultiArray", "UInt8MultiArray"]
    assert [m.type for m in messages] == [*(f"std_msgs/msg/{name}" for name in types), "sensor_msgs/msg/Imu"]
    assert all(len(m.channels) == 1 and m.reader.nan_allowed for m in messages[:5])
    numbers = [sum(row.more + 1 for row in m.reader.rows) for m in messages]
    assert numbers == [1, 6, 1, 4, 1, 0, 3]
    assert len(messages[1].composer.rows) == 1  # an array is one row, however long
    assert ".payloads = fcsl_ros_law_payloads," in compiled.source
    assert ".payloads" not in with_bus(tmp_path, {"payload": "raw"}).source


@pytest.mark.parametrize(
    ("bus", "code", "said"),
    [
        ({"payload": "cbor"}, "E205", "`payload` cannot be `cbor`"),
        ({"payload": 1}, "E208", "`payload`"),
        ({}, "E202", "`payload`"),
        ({"payload": "cdr", "name": 1}, "E201", "`name`"),
        ("cdr", "E208", "`bus` is an object"),
    ],
)
def test_a_bus_that_is_none(bus: object, code: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(DiagnosticError) as failed:
        with_bus(tmp_path, bus)
    assert [(d.code, said in d.message) for d in failed.value.diagnostics if d.severity is Severity.ERROR] == [
        (code, True)
    ]
