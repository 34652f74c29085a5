# SPDX-License-Identifier: Apache-2.0
"""ROS 2 messages of structs: names, texts, which are generated, and which the descriptor contains."""

from __future__ import annotations

from pathlib import Path

import pytest
from fcsl_test_abi import write_machine

from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.emit.messages import message_definition, message_text
from fcsl_compiler.model.machine import Machine

NAV = """
class Nav:
    outputs = {
        "targets": "Target[2][3]",  # nearest first
        "best": "Target",
        "alive": "bool",
    }

    def execute(self):
        self.alive = True
"""
LAW = """
class Law:
    inputs = {"goal": "Goal"}

    def execute(self):
        pass
"""
CONFIG = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "structs": {
        "Target": {"pose": "Pose", "weight": "f64 kg", "grid": "i32[2][2]"},
        "Goal": {"pose": "Pose"},
        "Pose": {"position": "f64[3] m", "valid": "bool"},
    },
    "instances": {"nav": {"algorithm": "Nav"}, "law": {"algorithm": "Law"}},
    "states": {"RUN": {"schedule": {"nav": 10, "law": 10}}},
}
POSE = "# Struct Pose of machine moon_rover.\nfloat64[3] position # [m]\nbool valid\n"
TARGET = (
    "# Struct Target of machine moon_rover.\nMoonRoverPose pose\nfloat64 weight # [kg]\n"
    "int32[4] grid # 2 x 2, row-major\n"
)


def rover(folder: Path, **changes: object) -> Path:
    return write_machine(folder, "moon_rover", CONFIG | changes, {"nav": NAV, "law": LAW})


def compiled(path: Path) -> Machine:
    return compile_machine(path, "", until="schedule").checked


def test_texts(tmp_path: Path) -> None:
    m = compiled(rover(tmp_path))
    nav, law = m.instances
    own = message_text(m, nav)
    assert "MoonRoverTarget[6] targets # 2 x 3, row-major; nearest first\nMoonRoverTarget best\nbool alive\n" in own
    line = "=" * 80
    parts = [
        own,
        f"{line}\nMSG: moon_rover/MoonRoverPose\n{POSE}",
        f"{line}\nMSG: moon_rover/MoonRoverTarget\n{TARGET}",
    ]
    assert message_definition(m, nav) == "".join(parts)
    assert message_definition(m, law) == message_text(m, law)  # inputs are not in messages


def test_fcslc_writes_the_structs_that_outputs_hold(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["messages", str(rover(tmp_path)), "-o", str(tmp_path / "msg")]) == 0
    listed = capsys.readouterr().out.split()
    names = ["MoonRoverNav", "MoonRoverLaw", "MoonRoverPose", "MoonRoverTarget"]
    assert listed == [f"{tmp_path}/msg/{name}.msg" for name in names]
    assert (tmp_path / "msg/MoonRoverTarget.msg").read_text() == TARGET
    assert (tmp_path / "msg/MoonRoverPose.msg").read_text() == POSE


def test_a_struct_and_an_instance_cannot_share_a_message(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    instances = {"target": {"algorithm": "Nav"}, "law": {"algorithm": "Law"}}
    config = rover(tmp_path, instances=instances, states={"RUN": {"schedule": {"target": 10, "law": 10}}})
    assert main(["messages", str(config), "-o", str(tmp_path / "msg")]) == 1
    said = capsys.readouterr().err
    assert "error[E229]: instance `target` and another would both be `message MoonRoverTarget`" in said
    line = next(n for n, text in enumerate(config.read_text().splitlines(), 1) if '"Target": {' in text)
    assert f":{line}:" in said[said.index("the other") - 100 :] and ":1:1" not in said
