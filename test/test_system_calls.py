# SPDX-License-Identifier: Apache-2.0
"""A tick of the compiled lander makes no system call: it runs where the kernel kills whoever makes one."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
from pathlib import Path

import pytest

from fcsl_compiler.ament import package_prefix
from fcsl_compiler.build_cache import build_machine
from fcsl_compiler.toolchain import compiler, include_dirs

ROOT = Path(__file__).resolve().parents[1]
TICKS = 10_000
CANNOT = 77


@pytest.fixture(scope="module")
def strict(tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("strict") / "strict"
    includes = [f"-I{path}" for path in include_dirs()]
    flags = ["-std=c11", "-O2", "-Wall", "-Wextra", "-Werror", *includes]
    subprocess.run([*compiler(), *flags, str(ROOT / "test/strict.c"), "-o", str(program), "-ldl"], check=True)
    return program


@pytest.fixture(scope="module")
def timed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The lander with one instance whose time is measured, so that its step asks the host for the time."""
    folder = tmp_path_factory.mktemp("timed") / "fc"
    shutil.copytree(ROOT / "examples/lander/fc", folder)
    config = folder / "lander_control.json"
    machine = json.loads(config.read_text(encoding="utf-8"))
    machine["instances"]["engine"]["max_wcet_us"] = 1000
    config.write_text(json.dumps(machine), encoding="utf-8")
    return build_machine(config).library


def fly(strict: Path, library: Path, clock: str) -> tuple[int, str]:
    """Exit status and what was printed."""
    command = [str(strict), str(library), str(TICKS), clock]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    if done.returncode == CANNOT:
        pytest.skip("this kernel does not give the strict seccomp mode")
    assert done.stderr == ""
    return done.returncode, done.stdout


def test_the_lander_makes_no_system_call(strict: Path) -> None:
    library = package_prefix("lander") / "lib/lander/liblander_machines.so"
    assert fly(strict, library, "none") == (0, f"{TICKS} ASCENT COAST DESCENT")


def test_a_step_that_makes_one_is_killed(strict: Path, timed: Path) -> None:
    """The control: the same flight, but for what stands behind the host's clock."""
    assert fly(strict, timed, "counter") == (0, f"{TICKS} ASCENT COAST DESCENT")
    assert fly(strict, timed, "kernel") == (-signal.SIGKILL, "")
