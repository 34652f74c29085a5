# SPDX-License-Identifier: Apache-2.0
"""`fcsl-fc --hal composite:PLAN,wire:SPEC`: the altimeter is a device of this computer (here a folder), all else is the simulator's."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_share_directory

from fcsl_compiler.base.packages import package_prefix
from simclient import VarClient
from simclient.replay import replay
from simclient.vars.wire import VarError

ROOT = Path(__file__).resolve().parents[1]
SIM = ROOT / "examples/lander/sim/lander.sim.json"
LIBRARY = Path(get_package_share_directory("lander")).parents[1] / "lib/lander/liblander_machines.so"
FC = package_prefix("fcsl_runtime") / "bin/fcsl-fc"
LONG_S = 60
LATE = re.compile(r"the simulator is [2-9](\.\d+)? s behind real time at tick \d+: beside real devices")
BOARD = {
    "machine": str(ROOT / "examples/lander/fc/lander_control.json"),
    "devices": {"lidar": {"driver": "iio", "device": "lidar", "rate_hz": 200}},
    "sensors": {
        "altimeter": {
            "kind": "range_finder",
            "channels": {"distance": "altitude"},
            "backends": [{"device": "lidar"}],
        }
    },
}


@pytest.fixture
def plan(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    device = tmp_path / "sys/bus/iio/devices/iio:device0"
    device.mkdir(parents=True)
    (device / "name").write_text("lidar")
    (device / "in_distance_raw").write_text("325")
    (device / "in_distance_scale").write_text("0.01")
    monkeypatch.setenv("FCSL_SYSFS", str(tmp_path / "sys"))
    (tmp_path / "board.json").write_text(json.dumps(BOARD))
    subprocess.run(["fcslc", "board", tmp_path / "board.json"], check=True, capture_output=True)
    return tmp_path / "board.plan"


@contextmanager
def running(line: list[str | Path]) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(line, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()
            process.communicate()


def simulated(wire: str, *options: str) -> AbstractContextManager[subprocess.Popen[str]]:
    return running(["fcsl-sim", "run", SIM, "--external", f"wire:{wire}", *options])


def flown(hal: str, *options: str | Path) -> AbstractContextManager[subprocess.Popen[str]]:
    line = [FC, LIBRARY, "--machine", "lander_control", "--hal", hal, "--timeout", str(LONG_S), *options]
    return running(line)


def until(holds: Callable[[], bool]) -> None:
    deadline = time.monotonic() + LONG_S
    while not holds():
        assert time.monotonic() < deadline, "it does not happen"
        time.sleep(0.01)


def connected(socket: Path) -> VarClient:
    client: list[VarClient] = []

    def tried() -> bool:
        try:
            client.append(VarClient(socket))
        except VarError:
            return False
        return True

    until(tried)
    return client[0]


def test_one_sensor_is_real(plan: Path, tmp_path: Path) -> None:
    """It cannot be paused, it replays, and a simulator that stops is told. On a busy computer the simulator may fall behind
    real time before the test stops it: then this is tried again."""
    for attempt in range(8):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        if fly_with_one_real_sensor(plan, folder):
            return
    raise AssertionError("the simulator was late in every attempt")


def fly_with_one_real_sensor(plan: Path, folder: Path) -> bool:
    """False if the simulator was late by itself."""
    wire, socket, bag = f"unix:{folder / 'wire'}", folder / "socket", folder / "bag"
    hal = f"composite:{plan},wire:{wire}"
    with simulated(wire, "--speed", "1") as sim, flown(hal, "--socket", socket, "--record", bag) as fc:
        client = connected(socket)

        def get(path: str) -> object:
            return client.get(path)[path]

        try:
            until(lambda: get("hal.sensors.altimeter.primary") == 1 and int(str(get("machine.tick"))) > 30)
            assert get("sensors.outputs.pos_z") == 3.25
            assert get("sensors.outputs.vel_z") not in (0.0, 3.25)
            assert get("hal.commands") and get("hal.devices.lidar.samples")
            with pytest.raises(VarError, match="real devices, which do not wait"):
                client.pause()
        except VarError:
            _, complaint = fc.communicate(timeout=LONG_S)
            assert LATE.search(complaint), complaint
            return False
        sim.send_signal(signal.SIGSTOP)
        out, complaint = fc.communicate(timeout=LONG_S)
        client.close()
    assert fc.returncode == 1
    assert LATE.search(complaint), complaint
    assert f"sensors of the board {plan} instead of the simulator's" in out and "paced in real time" in out
    whole = replay(bag, library=str(LIBRARY), machine="lander_control", board=plan)
    assert whole.identical and whole.ticks > 30, str(whole)
    return True


def test_a_simulator_that_is_too_fast(plan: Path, tmp_path: Path) -> None:
    wire = f"unix:{tmp_path / 'wire'}"
    with simulated(wire), flown(f"composite:{plan},wire:{wire}") as fc:
        _, complaint = fc.communicate(timeout=LONG_S)
    assert fc.returncode == 1
    assert re.search(r"the simulator is 0\.\d+ s ahead of real time at tick \d+: .*--speed 1", complaint), complaint


@pytest.mark.parametrize(
    ("hal", "options", "reason"),
    [
        ("composite:board.plan", (), "needs the plan of a board and wire:SPEC"),
        ("composite:,wire:unix:w", (), "needs the plan of a board and wire:SPEC"),
        ("composite:board.plan,wire:carrier pigeon", (), "--hal wire: "),
        ("composite:board.plan,wire:unix:w", ("--paused", "--socket", "s"), "real devices do not wait"),
        ("composite:board.plan,wire:unix:w", ("--restore", "c"), "--restore goes without a simulator"),
        ("composite:board.plan,zenoh:tcp:127.0.0.1:1,free-running", (), "no simulator beside the board"),
    ],
)
def test_lines_that_say_nothing(hal: str, options: tuple[str, ...], reason: str) -> None:
    line = [FC, LIBRARY, "--hal", hal, *options]
    done = subprocess.run(line, capture_output=True, text=True, timeout=LONG_S, check=False, env={**os.environ})
    assert done.returncode == 2 and reason in done.stderr, done.stderr
