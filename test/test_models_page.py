# SPDX-License-Identifier: Apache-2.0
"""docs/guide/simulation.md: its flight prints what is shown, its models compile, its package builds, its tests pass."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from fcsl_sim.model_instance import ModelInstance

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/guide/simulation.md").read_text()
FILES = dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```\n", PAGE, re.DOTALL))


def section(title: str) -> str:
    """From a heading to the next one."""
    return re.split(r"\n#+ ", re.split(rf"\n#+ {title}\n", PAGE)[1])[0]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the machine with the page's files in it, and the page's package built below."""
    above = tmp_path_factory.mktemp("first_flight")
    subprocess.run(["fcslc", "new", "machine", "rover"], cwd=above, check=True, capture_output=True)
    path = above / "rover"
    tests = ["test/test_cart.py", "test/test_flight.py", "test/test_winds.py"]
    assert sorted(FILES) == ["CMakeLists.txt", "cart.cpp", "rover.sim.json", "ruler.cpp", *tests]
    for name, text in FILES.items():
        assert not (path / name).exists()
        (path / name).write_text(text)
    shutil.copytree(ROOT / "examples/models/orbit", path / "orbit", ignore=shutil.ignore_patterns("target"))
    manifest = (ROOT / "examples/models/package.xml").read_text()
    (path / "package.xml").write_text(manifest.replace("<name>models<", "<name>my_vehicle<"))
    for command in (
        ["cmake", "-S", path, "-B", path / "build", f"-DCMAKE_INSTALL_PREFIX={path}/install"],
        ["cmake", "--build", path / "build", "--target", "install"],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout + done.stderr
    return path


def test_the_flight_prints_what_is_shown(folder: Path) -> None:
    *_, commands, printed = re.findall(r"^```\w*\n(.*?)^```$", section("First flight"), re.DOTALL | re.MULTILINE)
    speed = re.compile(r"in [\d.]+ s, \d+ times real time")
    done = subprocess.run(["bash", "-ec", commands], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    machine, simulation, *flown = done.stdout.splitlines(keepends=True)
    assert machine.startswith("rover.json: ok") and simulation.startswith("rover.sim.json: ok")
    assert speed.sub("", "".join(flown)) == speed.sub("", printed)


def test_the_package_has_its_models(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(folder / "install"), prepend=":")
    assert "outputs.sampled" in ModelInstance.load("package://my_vehicle/ruler").fields
    assert ModelInstance.load("package://my_vehicle/orbit").is_second_order


def test_the_cart(folder: Path) -> None:
    cart = ModelInstance.load(f"{folder}/cart.cpp")
    for name, value in {"mass": 0.3, "friction": 0.07, "push": 1.9}.items():
        cart.set(f"parameters.{name}", value)
    cart.set("inputs.force", 5.1)
    acceleration = (5.1 + 1.9 - 0.07 * 1.7) / 0.3
    assert cart.derivative(0.0, [0.4, 1.7]) == pytest.approx([1.7, acceleration])
    cart.output(0.0, [0.4, 1.7])
    for output, value in {"position": 0.4, "speed": 1.7, "acceleration": acceleration}.items():
        assert cart.get(f"outputs.{output}") == pytest.approx(value)
    assert [f.path for f in cart.fields.values() if f.is_feedthrough] == ["outputs.acceleration"]


def test_the_ruler(folder: Path) -> None:
    drawn: list[int] = []

    def number(stream: int) -> float:
        drawn.append(stream)
        return 0.5

    ruler = ModelInstance.load(f"{folder}/ruler.cpp", gaussian=number, uniform=number)
    ruler.set("parameters.sigma", 0.25)
    ruler.set("inputs.truth", 1.0)
    ruler.update()
    assert ruler.sampled and ruler.get("outputs.value") == 1.125
    assert drawn == [0, 1]
    ruler.set("parameters.dropout", 0.75)
    ruler.set("inputs.truth", 0.0)
    ruler.update()
    assert not ruler.sampled and ruler.get("outputs.value") == 1.125
    assert drawn == [0, 1, 0, 1]


def test_its_tests_pass(folder: Path) -> None:
    tests = [name for name in FILES if name.startswith("test/")]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *tests]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert "3 passed" in done.stdout, done.stdout


def test_the_ball_is_that_of_the_example() -> None:
    functions, events = (block.split("```")[0] for block in section("Events and resets").split("```c\n")[1:])
    example = (ROOT / "examples/models/bouncing_ball.c").read_text()
    assert functions in example and events in example


def test_the_refused_functions_are_refused(folder: Path) -> None:
    """The first function of each row that C++ calls as it stands; the message of the first row names what the page says."""
    table = section("Functions that are refused")
    calls = {"sin": "sin(x.speed)", "rand": "rand()", "time": "time(nullptr)", "getenv": '(getenv("A") == nullptr)'}
    (folder / "bad").mkdir()
    for name, call in calls.items():
        assert f"\n| `{name}`" in table
        source = FILES["cart.cpp"].replace("return (", f"return {call} + (", 1)
        (folder / "bad/cart.cpp").write_text(f"#include <cstdlib>\n#include <ctime>\n{source}")
        with pytest.raises(ValueError) as error:
            ModelInstance.load(f"{folder}/bad/cart.cpp")
        calls_it, use = str(error.value).splitlines()
        assert calls_it == f"it calls {name}" and use.startswith(f"  {name}: ")
        assert name != "sin" or ("`cr_sin`" in table and use.startswith("  sin: use cr_sin of fcsl/fcsl_math.h "))
