# SPDX-License-Identifier: Apache-2.0
"""A model that crashes, hangs or makes no number ends `fcsl-sim` with its name, a status and JSON."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

TEST = Path(__file__).resolve().parent
FCSL_SIM = TEST.parent / "bin/fcsl-sim"
LANDER = TEST.parents[1] / "examples/lander"
Write = Callable[[int], Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """The lander's simulation with a faulty model beside it."""

    def write_faulty(how: int) -> Path:
        for folder in ("fc", "sim"):
            shutil.copytree(LANDER / folder, tmp_path / folder)
        shutil.copy(TEST / "models/faulty.c", tmp_path / "sim")
        path = tmp_path / "sim/faulty.sim.json"
        change: dict[str, Any] = {
            "extends": "lander.sim.json",
            "models": {"faulty": {"source": "faulty.c"}},
            "instances": {"bad": {"model": "faulty", "parameters": {"at_s": 1.25, "how": how}}},
            "rates": {"bad": 100},
        }
        path.write_text(json.dumps(change))
        return path

    return write_faulty


def fly(path: Path, *options: str | Path) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, FCSL_SIM, "run", path, "--json", *options]
    return subprocess.run(list(map(str, line)), capture_output=True, text=True, timeout=120, check=False)


@pytest.mark.parametrize(("how", "name"), [(1, "SIGSEGV"), (3, "SIGABRT"), (4, "SIGSEGV")])
def test_a_crash_names_the_model(how: int, name: str, write: Write) -> None:
    done = fly(write(how))
    message = f"`update` of `bad` crashed at 1.250000000 s: {name}"
    assert (done.returncode, done.stderr) == (2, f"fcsl-sim: error: {message}\n")
    assert json.loads(done.stdout) == {"end": "error", "error": message}


@pytest.mark.parametrize("how", [5, 15])
def test_a_model_that_leaves_another_rounding_is_named(how: int, write: Write) -> None:
    done = fly(write(how))
    assert done.returncode == 2 and "bad left another floating-point mode" in done.stderr, done.stderr


def test_a_model_that_hangs_is_named_and_the_bag_is_whole(write: Write, tmp_path: Path) -> None:
    done = fly(write(2), "--record", tmp_path / "bag")
    message = "`update` of `bad` does not return, at 1.250000000 s"
    assert (done.returncode, done.stderr) == (2, f"fcsl-sim: error: {message}\n")
    assert json.loads(done.stdout) == {"end": "error", "error": message}
    line = ["fcsl", "bag", "info", str(tmp_path / "bag")]
    info = subprocess.run(line, capture_output=True, text=True, check=False)
    assert info.returncode == 0, info.stdout + info.stderr


def test_handlers_from_before_come_back(write: Write) -> None:
    """Python's faulthandler, after a run that ends before the landing."""
    program = (
        "import ctypes, faulthandler, sys; faulthandler.enable(); from fcsl_sim.cli import main; "
        f"assert main(['run', {str(LANDER / 'sim/lander.sim.json')!r}, '--duration', '1']) == 1; ctypes.string_at(0)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=False)
    assert (done.returncode, "Fatal Python error: Segmentation fault" in done.stderr) == (-signal.SIGSEGV, True)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_model_that_hangs(number: signal.Signals, write: Write) -> None:
    line = [sys.executable, str(FCSL_SIM), "run", str(write(2))]
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        time.sleep(2.5)
        process.send_signal(number)
        _, stderr = process.communicate(timeout=60)
    assert process.returncode == 128 + number, stderr


def test_no_number_is_an_error_as_json(write: Write) -> None:
    done = fly(
        write(1),
        "--set",
        "bad.parameters.at_s=1e9",
        "--set",
        "lander.parameters.pos_z=1e308",
        "--set",
        "lander.parameters.vel_z=1e308",
    )
    assert done.returncode == 2
    assert json.loads(done.stdout)["error"].startswith("lander.")


@pytest.mark.parametrize(("how", "name"), [(11, "SIGSEGV"), (13, "SIGABRT")])
def test_a_crash_while_it_is_opened(how: int, name: str, write: Write) -> None:
    done = fly(write(how))
    message = f"`init` of `bad` crashed at 0.000000000 s: {name}"
    assert (done.returncode, done.stderr) == (2, f"fcsl-sim: error: {message}\n")
    assert json.loads(done.stdout) == {"end": "error", "error": message}


def test_a_hang_while_it_is_opened(write: Write) -> None:
    done = fly(write(12))
    assert (done.returncode, done.stderr) == (
        2,
        "fcsl-sim: error: `init` of `bad` does not return, at 0.000000000 s\n",
    )
