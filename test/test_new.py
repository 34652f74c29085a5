# SPDX-License-Identifier: Apache-2.0
"""`fcsl new`: its output compiles under --strict, passes its test, and builds as a package."""

import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

TIMEOUT_S = 240
EXAMPLES = Path(__file__).resolve().parents[1] / "examples"
QUADROTOR = EXAMPLES / "quadrotor"


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
    assert printed.splitlines()[-1] == "next: fcsl test craft; then change it, as craft/README.md says"
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


def test_a_plant(tmp_path: Path) -> None:
    """It flies with the machine of its folder, and its test fails where its stop does not hold."""
    run("fcslc", "new", "machine", "craft", cwd=tmp_path)
    craft = tmp_path / "craft"
    run("fcslc", "new", "algorithm", "slew", cwd=craft)  # its bench is no machine to fly
    *made, following = run("fcslc", "new", "plant", "mass", cwd=craft).splitlines()
    assert made == ["mass.c", "mass.sim.json", "test/test_mass_plant.py"]
    assert following == "next: fcsl plot mass.sim.json; fcsl test test/test_mass_plant.py; then change mass.c"
    checked = run("fcsl-sim", "check", "mass.sim.json", cwd=craft)
    assert checked == "mass.sim.json: ok: `craft` and plant for at most 20 s\n"
    schema = json.loads(run("fcsl", "schema", "simulation", cwd=craft))
    jsonschema.validate(json.loads((craft / "mass.sim.json").read_text()), schema)
    assert "2 passed" in pytest_in(craft, "test/test_mass_plant.py")
    run("ruff", "check", "--select", "E,F,I", "--line-length", "120", "test", cwd=craft)
    plant = craft / "mass.c"
    plant.write_text(plant.read_text().replace("> 0.0;\n}", "< 0.0;\n}"))
    failed = subprocess.run([sys.executable, "-m", "pytest", "-q", "test/test_mass_plant.py"], cwd=craft, check=False)
    assert failed.returncode == 1


def test_a_plant_without_a_machine(tmp_path: Path) -> None:
    *made, remark, following = run("fcslc", "new", "plant", "mass", cwd=tmp_path).splitlines()
    assert made == ["mass.c", "test/test_mass_plant.py"]
    assert remark == "no simulation was written: name a machine with --machine"
    assert following.startswith("next: fcsl describe mass.c; ")
    assert "1 passed" in pytest_in(tmp_path, "test")


def test_the_machine_of_a_plant(tmp_path: Path) -> None:
    """One of several, of another folder, with channels of other names and a unit that does not fit."""
    for name in ("one", "two"):
        run("fcslc", "new", "machine", name, cwd=tmp_path)
    (tmp_path / "two/two.json").rename(tmp_path / "one/two.json")
    assert "name one of one.json, two.json with --machine" in run("fcslc", "new", "plant", "a", cwd=tmp_path / "one")
    machine = tmp_path / "one/one.json"
    content = json.loads(machine.read_text())
    for channel, name in zip(content["channels"], ("altitude", "speed", "motor"), strict=True):
        channel["name"] = name
        del channel["ros"]
    machine.write_text(json.dumps(content))
    printed = run("fcslc", "new", "plant", "mass", "--machine", "one/one.json", cwd=tmp_path)
    assert "not connected" not in printed
    simulation = json.loads((tmp_path / "mass.sim.json").read_text())
    assert simulation["controller"] == {"machine": "one/one.json"}
    assert {(c["from"], c["to"]) for c in simulation["connections"]} == {
        ("plant.position", "controller.altitude"),
        ("plant.speed", "controller.speed"),
        ("controller.motor", "plant.force"),
    }
    law = tmp_path / "one/algorithms/controller.py"
    law.write_text(law.read_text().replace('"f64 N"}', '"f64 V"}'))
    printed = run("fcslc", "new", "plant", "volt", "--machine", "one/one.json", cwd=tmp_path)
    assert "\nnot connected: motor\n" in printed
    assert (
        "W802"
        in subprocess.run(
            ["fcsl-sim", "check", "volt.sim.json"], cwd=tmp_path, capture_output=True, text=True, check=True
        ).stderr
    )
    assert "error[E100]" in run("fcslc", "new", "plant", "b", "--machine", "no.json", cwd=tmp_path, status=1)
    assert not (tmp_path / "b.c").exists()


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
        (("plant", "slew"), "`slew.c` exists; nothing was written"),
        (("plant", "Plant"), "`Plant` is not a valid name"),
        (("plant", "../plant"), "is not a valid name"),
        (("vehicle", "Craft2", "--like", QUADROTOR), "`Craft2` is not a name of a package"),
        (("vehicle", "craft", "--like", QUADROTOR), "`craft` exists; nothing was written"),
        (("vehicle", "quadrotor", "--like", QUADROTOR), "`quadrotor` is the other vehicle's name"),
        (
            ("vehicle", "craft2", "--like", "nowhere/at_all"),
            "is neither a folder with a package.xml nor the name of a package",
        ),
        (("vehicle", "craft2", "--like", "no_such_package"), "no_such_package"),
        (("vehicle", "craft2", "--like", "fcsl_msgs"), "is no vehicle: it has no CMakeLists.txt"),
        (("vehicle", "craft2", "--like", EXAMPLES / "minimal"), "is no vehicle: it has no simulation in sim/"),
        (("algorithm", "transition_request"), "`TransitionRequest` is a name of the language"),
    ],
)
def test_nothing_is_overwritten_and_names_are_checked(tmp_path: Path, arguments: tuple[str, ...], message: str) -> None:
    (tmp_path / "craft").mkdir()
    (tmp_path / "test").mkdir()
    (tmp_path / "test" / "test_slew.py").write_text("mine")
    (tmp_path / "slew.c").write_text("mine")
    before = files(tmp_path)
    assert message in run("fcslc", "new", *arguments, cwd=tmp_path, status=2)
    assert files(tmp_path) == before and (tmp_path / "test" / "test_slew.py").read_text() == "mine"


@pytest.mark.parametrize("like", [QUADROTOR, "quadrotor"], ids=["folder", "package"])
def test_a_vehicle(tmp_path: Path, like: object) -> None:
    """Another airframe by parameters alone: heavier, and the machine knows it."""
    run("fcslc", "new", "vehicle", "falcon", "--like", like, cwd=tmp_path)
    made = files(tmp_path / "falcon")
    assert {"CMakeLists.txt", "package.xml", "README.md", "fc/falcon.json", "sim/falcon.sim.json"} <= made
    others = [name for name in made - {"README.md"} if "quadrotor" in (tmp_path / "falcon" / name).read_text()]
    assert others == []
    run("fcslc", "check", "--strict", "fc/falcon.json", cwd=tmp_path / "falcon")
    assert " passed" in pytest_in(tmp_path / "falcon", "test/test_mixer.py")
    for name, text in (("sim/falcon.sim.json", '"dry_mass": 1.2'), ("fc/falcon.json", '"mass": 1.2')):
        path = tmp_path / "falcon" / name
        assert text in path.read_text()
        path.write_text(path.read_text().replace(text, text.replace("1.2", "1.5")))
    flown = run("fcsl-sim", "run", "sim/falcon.sim.json", "--json", cwd=tmp_path / "falcon")
    assert json.loads(flown)["until_held"] is True


def test_a_rover(tmp_path: Path) -> None:
    """Its view shows the shape of a rover, whatever it is called; machine and simulation share the file of its geometry."""
    run("fcslc", "new", "vehicle", "carrier", "--like", "rover", cwd=tmp_path)
    assert '"shape": "rover"' in (tmp_path / "carrier/fc/carrier.json").read_text()
    assert " passed" in pytest_in(tmp_path / "carrier", "test/test_rover.py")


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
