# SPDX-License-Identifier: Apache-2.0
"""docs/hardware/hal.md: its drivers of a winch, built and used as the page says, on a folder that is the winch."""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.cache import build_machine

ROOT = Path(__file__).resolve().parents[1]
(PAGE,) = re.findall(
    r"^## Writing a driver\n(.*?)^## ", (ROOT / "docs/hardware/hal.md").read_text(), re.DOTALL | re.MULTILINE
)
BIN = package_prefix("fcsl_runtime") / "bin"
DRIVER_READ = Path(os.environ.get("FCSL_TEST_RUNTIME", ROOT / "build/fcsl_runtime")) / "driver_read"
#: What the page says of the machine.
HOIST = '''class Hoist:
    """Lowers the hook, armed from its tenth tick on."""

    outputs = {"speed": "f64", "brake": "bool", "armed": "bool"}
    state = {"ticks": "u64"}

    def execute(self):
        self.ticks += 1
        self.armed = self.ticks > 10
        self.brake = False
        self.speed = 0.75
'''
CONFIG = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Hoist": {"source": "hoist.py"}},
    "instances": {"hoist": {"algorithm": "Hoist"}},
    "connections": [],
    "states": {"RUN": {"schedule": {"hoist": 100}}},
    "transitions": [],
    "channels": [
        {"name": "hoist", "id": 1, "field": "hoist.outputs.speed", "direction": "actuator", "safe": 0.0},
        {"name": "hoist.brake", "id": 2, "field": "hoist.outputs.brake", "direction": "actuator", "safe": True},
    ],
    "arm": "hoist.armed",
    "command_timeout_s": 0.5,
}


def block(kind: str, number: int = 0) -> str:
    return str(re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE)[number])


@pytest.fixture(scope="module")
def winch(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the page's library, and a winch `0`."""
    folder = tmp_path_factory.mktemp("winch")
    for package in ("fcsl_hal", "fcsl_compiler"):
        (folder / package).symlink_to(ROOT / package)
    (folder / "winch.c").write_text(block("c"))
    subprocess.run(["bash", "-euc", block("sh").replace("-Wextra", "-Wextra -Werror")], cwd=folder, check=True)
    (folder / "0").mkdir()
    for name in ("command", "length"):
        (folder / "0" / name).touch()
    return folder


@pytest.fixture
def started() -> Iterator[list[subprocess.Popen[str]]]:
    processes: list[subprocess.Popen[str]] = []
    yield processes
    for process in processes:
        process.kill()
        process.communicate()


def wait_for(what: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 30
    while not what():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.002)


def test_the_motor(winch: Path, tmp_path: Path, started: list[subprocess.Popen[str]]) -> None:
    """The page's command drives the winch, and leaves it safe."""
    (tmp_path / "hoist.py").write_text(HOIST)
    (tmp_path / "hoist.json").write_text(json.dumps(CONFIG))
    library, slot = str(build_machine(tmp_path / "hoist.json", "simulation").library), tmp_path / "slot"
    program, *arguments = shlex.split(block("sh", 1).replace("\\\n", "").replace("/run/hoist/slot", str(slot)))
    assert program == "fcsl-guard" and arguments[0] == "libhoist.so"
    arguments = [a.replace("/sys/class/winch/0", "0") for a in arguments[1:]]
    guard = subprocess.Popen([BIN / program, library, *arguments], cwd=winch, stdout=subprocess.PIPE, text=True)
    started.append(guard)

    def winch_has(speed: int, brake: int) -> bool:
        return (winch / "0/command").read_text() == f"{speed:8} {brake}\n"

    wait_for(lambda: winch_has(0, 1))
    wait_for(slot.exists)
    started.append(subprocess.Popen([BIN / "fcsl-fc", library, "--guard", slot], stdout=subprocess.PIPE, text=True))
    wait_for(lambda: winch_has(750, 0))
    guard.terminate()
    assert guard.wait(30) == 0 and winch_has(0, 1)


def test_the_encoder(winch: Path) -> None:
    """Samples with their time, nothing new, and what is no sample."""
    length = winch / "0/length"
    length.write_text("1500 1000000\n")
    command = [DRIVER_READ, f"{winch}/libwinch.so:winch_encoder", winch / "0"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as reader:
        assert reader.stdin and reader.stdout

        def read() -> str:
            assert reader.stdin and reader.stdout
            reader.stdin.write("\n")
            reader.stdin.flush()
            return reader.stdout.readline().rstrip("\n")

        assert read() == "0 1000000  length=1.5"
        assert read() == "1 0  length=1.5"
        length.write_text("-20 2000000\n")
        assert read() == "0 2000000  length=-0.02"
        length.write_text("?\n")
        assert read() == "3 0 the winch does not give a length and a time length=-0.02"
        reader.stdin.close()
        assert reader.wait(30) == 0


def test_no_winch(winch: Path) -> None:
    command = [DRIVER_READ, f"{winch}/libwinch.so:winch_encoder", winch / "1"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert done.returncode == 1 and f"no winch has the folder '{winch}/1'" in done.stderr
