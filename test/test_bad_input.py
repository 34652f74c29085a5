# SPDX-License-Identifier: Apache-2.0
"""Bad input to any command: one clear message, a non-zero exit, nothing half-written, no traceback."""

from __future__ import annotations

import json
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
LANDER = ROOT / "examples" / "lander"
CONFIG = LANDER / "fc" / "lander_control.json"
REPLAY = ["fcsl", "replay"]


def refused(line: list[str | Path], folder: Path, *says: str) -> str:
    """Runs a command that must fail; returns its message after checking that nothing was left in `folder`."""
    before = sorted(folder.rglob("*"))
    done = subprocess.run([str(w) for w in line], cwd=folder, capture_output=True, text=True, timeout=120, check=False)
    message = done.stdout + done.stderr
    assert done.returncode > 0, f"{line} exited with {done.returncode}\n{message}"
    assert "Traceback" not in message, message
    for text in says:
        assert text in message, message
    assert sorted(folder.rglob("*")) == before, "something was left behind"
    return message


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two seconds of the lander."""
    path = tmp_path_factory.mktemp("bag") / "flight"
    line = ["fcsl-sim", "run", str(LANDER / "sim" / "lander.sim.json"), "--duration", "2", "--record", str(path)]
    assert subprocess.run(line, capture_output=True, timeout=120, check=False).returncode == 1  # it has not landed
    return path


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("library")
    subprocess.run(["fcslc", "build", str(CONFIG), "-o", str(folder)], check=True, capture_output=True, timeout=120)
    return folder / "liblander_control.so"


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    """A private copy of the lander's machine, to be broken."""
    shutil.copytree(LANDER / "fc", tmp_path / "fc", ignore=shutil.ignore_patterns("build", "__pycache__"))
    return tmp_path / "fc" / "lander_control.json"


def build(machine: Path, *says: str) -> str:
    return refused(["fcslc", "build", machine, "-o", "out"], machine.parent, *says)


# ---- the machine -----------------------------------------------------------------------------------------------------


def test_missing_machine(tmp_path: Path) -> None:
    refused(["fcslc", "build", "no_such.json", "-o", "out"], tmp_path, "no_such.json", "no such file")


def test_broken_json(machine: Path) -> None:
    machine.write_text(machine.read_text().replace('"tick_hz": 100,', '"tick_hz": 100'))
    build(machine, "lander_control.json:3:3: error[E101]", "a comma is missing", "^")


def test_unknown_key(machine: Path) -> None:
    machine.write_text(machine.read_text().replace('"initial_state"', '"inital_state"'))
    build(machine, "lander_control.json:3:3: error[E201]", "did you mean `initial_state`?")


def test_port_that_does_not_exist(machine: Path) -> None:
    machine.write_text(machine.read_text().replace('"coast.pos_z"', '"coast.altitude"'))
    build(machine, "error[E216]", "`coast` has no input `altitude`", "it has pos_z, vel_z")


def test_syntax_error_in_an_algorithm(machine: Path) -> None:
    (machine.parent / "algorithms" / "coast.py").write_text(
        'class Coast:\n    inputs = {"pos_z": "f64"}\n\n    def execute(self:\n        pass\n'
    )
    build(machine, "algorithms/coast.py:4:", "error[E110]", "not valid Python")


def test_missing_algorithm(machine: Path) -> None:
    (machine.parent / "algorithms" / "coast.py").unlink()
    build(machine, "lander_control.json:", "error[E100]", "algorithms/coast.py")


def test_a_twin_of_a_broken_machine(machine: Path) -> None:
    machine.write_text(machine.read_text().replace('"tick_hz": 100,', '"tick_hz": 0,'))
    code = "from simclient import AlgTwin\ntry:\n    AlgTwin.from_config('lander_control.json')\n"
    code += "except Exception as error:\n    print(error)\n"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=machine.parent, capture_output=True, text=True, timeout=60, check=True
    )
    assert "lander_control.json:2:14: error[E204]" in done.stdout


# ---- the simulator and the flight program ------------------------------------------------------------------------------


def test_simulation_with_unknown_key(tmp_path: Path) -> None:
    text = (LANDER / "sim" / "lander.sim.json").read_text().replace('"duration"', '"durations"')
    (tmp_path / "lander.sim.json").write_text(text)
    refused(["fcsl-sim", "run", "lander.sim.json", "--record", "bag"], tmp_path, "durations", "duration")


def test_missing_simulation(tmp_path: Path) -> None:
    refused(["fcsl-sim", "run", "no.sim.json"], tmp_path, "no.sim.json")


def test_recording_onto_an_existing_bag(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    refused(["fcsl-sim", "run", LANDER / "sim" / "lander.sim.json", "--record", "bag"], tmp_path, "exists already")


def test_unloadable_library(tmp_path: Path) -> None:
    (tmp_path / "libbad.so").write_bytes(b"\x7fELF not really")
    refused(["fcsl-fc", "./libbad.so", "--record", "bag"], tmp_path, "libbad.so")


def test_library_without_machines(tmp_path: Path) -> None:
    refused(["fcsl-fc", "libm.so.6"], tmp_path, "libm.so.6")


def test_socket_path_in_use(tmp_path: Path, library: Path) -> None:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as taken:
        taken.bind(str(tmp_path / "taken"))
        taken.listen()
        refused(["fcsl-fc", library, "--socket", "taken", "--ticks", "1"], tmp_path, "taken", "in use")


# ---- bags ------------------------------------------------------------------------------------------------------------------


def test_missing_bag(tmp_path: Path) -> None:
    refused([*REPLAY, "no_bag", "--config", CONFIG], tmp_path, "no_bag")


def test_truncated_bag(tmp_path: Path, bag: Path) -> None:
    copy = tmp_path / "flight"
    shutil.copytree(bag, copy)
    data = next(copy.glob("*.mcap"))
    data.write_bytes(data.read_bytes()[: data.stat().st_size * 2 // 3])
    refused([*REPLAY, copy, "--config", CONFIG], tmp_path, "the bag is incomplete", "breaks off after")


def test_bag_of_another_machine(tmp_path: Path, bag: Path) -> None:
    refused([*REPLAY, bag, "--config", ROOT / "examples" / "minimal" / "minimal.json"], tmp_path, "lander_control")


def test_bag_of_other_sources(machine: Path, bag: Path) -> None:
    config = json.loads(machine.read_text())
    config["instances"]["ascent"]["parameters"]["climb_rate"] = 7.0
    machine.write_text(json.dumps(config))
    refused([*REPLAY, bag, "--config", machine], machine.parent, "source", "--ignore-source-hash")


def test_map_to_a_topic_that_is_not_there(tmp_path: Path, bag: Path) -> None:
    text = (ROOT / "examples" / "ahrs" / "map.yaml").read_text().replace("/imu/data", "/imu/nowhere")
    (tmp_path / "map.yaml").write_text(text)
    line = [*REPLAY, bag, "--config", ROOT / "examples" / "ahrs" / "ahrs.json", "--map", "map.yaml", "-o", "out"]
    refused(line, tmp_path, "/imu/nowhere")
