# SPDX-License-Identifier: Apache-2.0
"""--strict: every input is listed, and the message contains the correction."""

import json
import re
from pathlib import Path
from typing import Any

import pytest
from test_schema import MACHINES

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.passes import compile_machine

ALGORITHM = """class Alg:
    inputs = {
        "a": "f64 m",
        "m": "i32[2][2]",
        "on": "bool",
        "h": "Health",
        "pose": "Pose",
        "wish": "TransitionRequest",
    }
    outputs = {"y": "f64 m"}

    def execute(self):
        pass
"""
CONFIG: dict[str, Any] = {
    "tick_hz": 10,
    "initial_state": "R",
    "structs": {"Pose": {"at": "f32[2]", "ok": "bool"}},
    "algorithms": {"Alg": {"source": "alg.py"}},
    "instances": {"one": {"algorithm": "Alg", "inputs": {"a": 1}}, "two": {"algorithm": "Alg"}},
    "connections": [{"from": "one.y", "to": "two.a"}],
    "channels": [{"name": "m", "id": 1, "field": "two.inputs.m", "direction": "sensor"}],
    "states": {"R": {"schedule": {"one": 10, "two": 10}}},
}


@pytest.fixture
def config(tmp_path: Path) -> Path:
    (tmp_path / "alg.py").write_text(ALGORITHM)
    path = tmp_path / "craft.json"
    path.write_text(json.dumps(CONFIG))
    return path


def test_every_open_input_is_named(config: Path) -> None:
    with pytest.raises(DiagnosticError) as caught:
        compile_machine(config, "", strict=True)
    found = caught.value.diagnostics
    assert [d.code for d in found] == ["E240", "E240"]
    assert "inputs `m`, `on`, `h`, `pose`, `wish` of `one`" in found[0].message
    assert "inputs `on`, `h`, `pose`, `wish` of `two`" in found[1].message  # a is connected, m has a channel
    assert [str(n.span) for n in found[1].notes] == ["alg.py:5:9", "alg.py:6:9", "alg.py:7:9", "alg.py:8:9"]
    assert found[1].notes[0].text == "`on` (bool) is declared here"
    assert found[1].span.source.line(1)[found[1].span.column - 1 :].startswith('"two"')


def test_what_the_message_says_to_write_is_right(config: Path) -> None:
    with pytest.raises(DiagnosticError) as caught:
        compile_machine(config, "", strict=True)
    changed = json.loads(config.read_text())
    for name, diagnostic in zip(("one", "two"), caught.value.diagnostics, strict=True):
        written = re.search(r'"inputs": (\{.*\})$', diagnostic.help)
        assert written
        changed["instances"][name]["inputs"] = json.loads(written[1].replace("…", "1.0"))
    config.write_text(json.dumps(changed))
    assert compile_machine(config, "", strict=True).sink.diagnostics == []


def test_without_it_they_are_host_inputs(config: Path) -> None:
    assert compile_machine(config, "").sink.diagnostics == []


@pytest.mark.parametrize("path", MACHINES, ids=lambda p: p.stem)
def test_the_examples_pass(path: Path) -> None:
    compile_machine(path, "", strict=True)


def test_commands(config: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    for arguments in (["check"], ["build", "-o", str(out)], ["build", "-o", str(out), "--c-only"]):
        assert main([*arguments, "--strict", str(config)]) == 1
        assert capsys.readouterr().err.count("error[E240]") == 2 and not out.exists()
    assert main(["check", str(config)]) == 0
    assert main(["build", "--c-only", "-o", str(out), str(config)]) == 0
