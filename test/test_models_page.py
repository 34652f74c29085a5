# SPDX-License-Identifier: Apache-2.0
"""docs/guide/simulation.md: its models compile and are the same in each language; its package builds, its test passes."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fcsl_sim import Simulation, load
from fcsl_sim.model_instance import ModelInstance

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/guide/simulation.md").read_text()
FILES = dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```\n", PAGE, re.DOTALL))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the page's files, and its package built below."""
    path = tmp_path_factory.mktemp("drives")
    names = [
        "CMakeLists.txt",
        "gust.json",
        "gust.py",
        "gyro.cpp",
        "motor.c",
        "motor.cpp",
        "motor/Cargo.toml",
        "motor/src/lib.rs",
    ]
    assert sorted(FILES) == [*names, "test_motor.py"]
    for name, text in FILES.items():
        (path / name).parent.mkdir(parents=True, exist_ok=True)
        (path / name).write_text(text)
    shutil.copy(ROOT / "examples/models/package.xml", path)
    manifest = (path / "package.xml").read_text().replace("<name>models<", "<name>drives<")
    (path / "package.xml").write_text(manifest)
    for command in (
        ["cmake", "-S", path, "-B", path / "build", f"-DCMAKE_INSTALL_PREFIX={path}/install"],
        ["cmake", "--build", path / "build", "--target", "install"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return path


@pytest.fixture
def motors(folder: Path, monkeypatch: pytest.MonkeyPatch) -> list[ModelInstance]:
    """The motor in C, C++ and Rust, with the same parameters and input."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(folder / "install"), prepend=":")
    made = [ModelInstance.load(text) for text in (f"{folder}/motor.c", f"{folder}/motor.cpp", "package://drives/motor")]
    for motor in made:
        for name, value in {"inertia": 0.3, "friction": 0.07, "torque_constant": 1.9, "resistance": 3.3}.items():
            motor.set(f"parameters.{name}", value)
        motor.set("inputs.voltage", 5.1)
    return made


def test_the_motor_is_the_same_in_each_language(motors: list[ModelInstance]) -> None:
    in_c, *others = motors
    x = [0.4, 1.7]
    rates = in_c.derivative(0.0, x)
    assert rates == pytest.approx([1.7, (1.9 * (5.1 - 1.9 * 1.7) / 3.3 - 0.07 * 1.7) / 0.3])
    in_c.output(0.0, x)
    for other in others:
        assert {f.path: (f.unit, f.is_feedthrough) for f in other.fields.values()} == {
            f.path: (f.unit, f.is_feedthrough) for f in in_c.fields.values()
        }
        assert other.derivative(0.0, x) == rates
        other.output(0.0, x)
        for output in ("angle", "speed", "current"):
            assert other.get(f"outputs.{output}") == in_c.get(f"outputs.{output}")


def test_the_gust(folder: Path) -> None:
    simulation = {
        "tick_hz": 50,
        "seed": 1,
        "duration": 4.0,
        "integrator": {"method": "rk4", "hz": 50},
        "models": {"gust": {"machine": "gust.json"}},
        "instances": {"wind": {"model": "gust", "parameters": {"strength": 3.0}}},
        "rates": {"wind": 50},
    }
    (folder / "gust.sim.json").write_text(json.dumps(simulation))
    config = load(folder / "gust.sim.json")
    assert not config.warnings
    with Simulation(config.plan, config.tables) as sim:
        sim.run(50)
        assert sim.get("wind.outputs.force") == pytest.approx(3.0)
        sim.run(100)
        assert sim.get("wind.outputs.force") == pytest.approx(-3.0)


def test_the_gyroscope(folder: Path) -> None:
    drawn: list[int] = []

    def number(stream: int) -> float:
        drawn.append(stream)
        return 0.5

    gyro = ModelInstance.load(f"{folder}/gyro.cpp", gaussian=number, uniform=number)
    gyro.set("parameters.sigma", 0.25)
    gyro.set("parameters.bias_walk", 0.125)
    gyro.set("inputs.rate", [1.0, 2.0, 3.0])
    gyro.update()
    assert gyro.sampled and gyro.get("outputs.rate") == [1.1875, 2.1875, 3.1875]
    assert drawn == [2, 1, 0, 1, 0, 1, 0]
    gyro.set("parameters.dropout", 0.75)
    gyro.set("inputs.rate", [0.0, 0.0, 0.0])
    gyro.update()
    assert not gyro.sampled and gyro.get("outputs.rate") == [1.1875, 2.1875, 3.1875]


def test_its_test(folder: Path) -> None:
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_motor.py"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert "1 passed" in done.stdout, done.stdout


def test_the_ball_is_that_of_the_example() -> None:
    section = PAGE.split("## Events and resets")[1].split("\n## ")[0]
    functions, events = (block.split("```")[0] for block in section.split("```c\n")[1:])
    example = (ROOT / "examples/models/bouncing_ball.c").read_text()
    assert functions in example and events in example


def test_the_refusal_is_what_is_printed(folder: Path) -> None:
    line = PAGE.split("error[E801]")[1].split("^^^^^^^^\n")[1].split("\n```")[0]
    source = FILES["motor.c"].replace("return (", "return sin(", 1)
    (folder / "bad").mkdir()
    (folder / "bad/motor.c").write_text(source)
    with pytest.raises(ValueError) as error:
        ModelInstance.load(f"{folder}/bad/motor.c")
    assert str(error.value).splitlines() == ["it calls sin", line]
