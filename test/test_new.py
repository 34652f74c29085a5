# SPDX-License-Identifier: Apache-2.0
"""`fcslc new`: its output compiles under --strict, passes its test, and builds as a package."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TIMEOUT_S = 240


def run(*command: object, cwd: Path, status: int = 0) -> str:
    """Standard output, or standard error if a failure was expected."""
    done = subprocess.run(
        [str(c) for c in command], cwd=cwd, capture_output=True, text=True, check=False, timeout=TIMEOUT_S
    )
    assert done.returncode == status, done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    return done.stdout if status == 0 else done.stderr


def files(folder: Path) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file() and "__pycache__" not in p.parts}


def pytest_in(folder: Path, *arguments: object) -> str:
    return run(sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments, cwd=folder)


def test_a_machine(tmp_path: Path) -> None:
    printed = run("fcslc", "new", "machine", "craft", cwd=tmp_path)
    assert files(tmp_path) == set(printed.splitlines()[:-1])
    assert printed.splitlines()[-1] == "next: python3 -m pytest craft/test; then change it, as craft/README.md says"
    assert "ok (2 instances, 1 state)" in run("fcslc", "check", "--strict", "craft.json", cwd=tmp_path / "craft")
    assert "3 passed" in pytest_in(tmp_path, "craft/test")
    assert json.loads((tmp_path / "craft/pyrightconfig.json").read_text()) == {"ignore": ["algorithms"]}
    schema = json.loads((tmp_path / "craft/craft.json").read_text())["$schema"]
    assert (tmp_path / "craft" / schema).read_text() == run("fcslc", "schema", cwd=tmp_path)
    run("ruff", "check", "--select", "E,F,I", "--line-length", "120", "craft/test", "craft/algorithms", cwd=tmp_path)
    run(sys.executable, "-c", "import controller, sensors", cwd=tmp_path / "craft/algorithms")


def test_an_algorithm(tmp_path: Path) -> None:
    run("fcslc", "new", "machine", "craft", cwd=tmp_path)
    craft = tmp_path / "craft"
    printed = run("fcslc", "new", "algorithm", "slew", cwd=craft)
    made = ["algorithms/slew.py", "slew_bench.json", "test/test_slew.py"]
    assert printed.splitlines()[:-1] == made and "algorithms/slew.py" in printed.splitlines()[-1]
    run("fcslc", "check", "--strict", "slew_bench.json", cwd=craft)
    assert "5 passed" in pytest_in(craft)
    run("fcslc", "new", "algorithm", "rate_limit2", cwd=tmp_path)
    assert "class RateLimit2:" in (tmp_path / "algorithms/rate_limit2.py").read_text()
    assert "2 passed" in pytest_in(tmp_path, "test")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("machine", "craft"), "`craft` exists; nothing was written"),
        (("machine", "craft", "--package"), "`craft` exists; nothing was written"),
        (("algorithm", "slew"), "`test/test_slew.py` exists; nothing was written"),
        (("machine", "Craft"), "`Craft` is not a valid name"),
        (("machine", "math"), "`math` is not a valid name"),
        (("machine", "../craft2"), "is not a valid name"),
        (("machine", ""), "is not a valid name"),
        (("algorithm", "two__lines"), "is not a valid name"),
        (("algorithm", "state"), "`state` is reserved"),
        (("algorithm", "transition_request"), "`TransitionRequest` is a name of the language"),
    ],
)
def test_nothing_is_overwritten_and_names_are_checked(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "craft").mkdir()
    (tmp_path / "test").mkdir()
    (tmp_path / "test" / "test_slew.py").write_text("mine")
    before = files(tmp_path)
    assert message in run("fcslc", "new", *arguments, cwd=tmp_path, status=2)
    assert files(tmp_path) == before and (tmp_path / "test" / "test_slew.py").read_text() == "mine"


def test_a_package(tmp_path: Path) -> None:
    """As colcon does: configure and build, here only the machine's library, then its pytest."""
    run("fcslc", "new", "machine", "craft", "--package", cwd=tmp_path)
    craft = tmp_path / "craft"
    assert {"CMakeLists.txt", "package.xml", "launch/sil.launch.py", "launch/robot.launch.py"} <= files(craft)
    run("ruff", "check", "--select", "E,F,I", "--line-length", "120", "craft", cwd=tmp_path)
    run("cmake", "-S", craft, "-B", tmp_path / "build", cwd=tmp_path)
    run("cmake", "--build", tmp_path / "build", "--target", "craft_machines", cwd=tmp_path)
    assert (tmp_path / "build" / "libcraft_machines.so").is_file()
    assert "5 passed" in pytest_in(craft, "test"), "the machine alone, and its flight"
    # STRICT stands in its CMakeLists.txt.
    law = craft / "algorithms" / "controller.py"
    law.write_text(law.read_text().replace('"speed": "f64 m/s"}', '"speed": "f64 m/s", "wind": "f64 m/s"}'))
    failed = run("cmake", "--build", tmp_path / "build", "--target", "craft_machines", cwd=tmp_path, status=2)
    assert "E240" in failed and "`wind`" in failed
