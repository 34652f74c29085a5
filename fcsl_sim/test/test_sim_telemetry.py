# SPDX-License-Identifier: Apache-2.0
"""A simulation's values over UDP (docs/guide/monitoring.md): machine and models, at every speed of the simulation."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from fcsl_sim import SimError, Simulation
from simclient.telemetry.receiver import Telemetry

FCSL_SIM = Path(__file__).resolve().parents[1] / "bin/fcsl-sim"
LANDER = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"
#: Few enough ticks that the history still has all of them when the sender reads it.
TICKS = 60
PATHS = ("ramp.outputs.x", "altimeter.outputs.value", "pilot.outputs.throttle", "machine.tick")


@pytest.fixture
def receiver() -> Iterator[Telemetry]:
    """A receiver without a thread: `poll` reads received datagrams."""
    telemetry = Telemetry(0)
    yield telemetry
    telemetry.close()


def address(receiver: Telemetry) -> str:
    return f"udp:localhost:{receiver.port}"


def value(sim: Simulation, path: str) -> object:
    return sim.machine_value(path) if path.split(".")[0] in ("pilot", "machine") else sim.get(path)


def test_machine_and_models_tick_by_tick(open_sim: Callable[..., Simulation], receiver: Telemetry) -> None:
    with open_sim() as sim:
        sim.telemetry(address(receiver), None)
        truth: dict[str, list[object]] = {path: [] for path in PATHS}
        for _ in range(TICKS):
            assert sim.run(1) == 1
            for path in PATHS:
                truth[path].append(value(sim, path))
        counts = sim.telemetry_stop()
    receiver.poll()
    window = receiver.window()
    assert counts["packets"] == TICKS and counts["overwritten"] == counts["failures"] == 0
    assert window.tick.tolist() == list(range(TICKS))
    assert {path: window[path].tolist() for path in PATHS} == truth
    assert len(set(truth["ramp.outputs.x"])) > TICKS / 2
    assert not any(".parameters." in path or ".state." in path for path in receiver.channels)


def test_chosen_fields_of_every_so_many_ticks(open_sim: Callable[..., Simulation], receiver: Telemetry) -> None:
    with open_sim() as sim:
        sim.telemetry(f"{address(receiver)}/8", "ramp.*,machine.state")
        while sim.tick < TICKS:
            sim.run(TICKS - sim.tick)
        sim.telemetry_stop()
    receiver.poll()
    assert receiver.window().tick.tolist() == list(range(0, TICKS, 8))
    assert {path.split(".")[0] for path in receiver.channels} == {"ramp", "machine"}


def test_what_is_refused(open_sim: Callable[..., Simulation]) -> None:
    with open_sim() as sim:
        with pytest.raises(SimError, match="write udp:HOST:PORT"):
            sim.telemetry("127.0.0.1:7600", None)
        with pytest.raises(SimError, match="no field matches 'plant"):
            sim.telemetry("udp:127.0.0.1:7600", "plant.*")
        sim.telemetry("udp:127.0.0.1:7600", None)
        with pytest.raises(SimError, match="before the first tick"):
            sim.telemetry("udp:127.0.0.1:7600", None)
    with open_sim() as sim:
        assert sim.run(1) == 1 and sim.telemetry_stop()["packets"] == 0
        with pytest.raises(SimError, match="before the first tick"):
            sim.telemetry("udp:127.0.0.1:7600", None)


def run(*options: str) -> subprocess.CompletedProcess[str]:
    line = [sys.executable, str(FCSL_SIM), "run", str(LANDER), *options]
    return subprocess.run(line, capture_output=True, text=True, timeout=120, check=False)


def test_a_run_of_few_ticks(receiver: Telemetry) -> None:
    done = run("--json", "--duration", "0.5", "--telemetry", address(receiver))
    assert done.returncode == 1, done.stderr  # it has not landed
    summary = json.loads(done.stdout)
    receiver.poll()
    window = receiver.window()
    assert (
        summary["telemetry"]["packets"] == summary["ticks"] == len(window) and window.tick[-1] == summary["ticks"] - 1
    )
    assert window["machine.state"][-1] == summary["state"]
    assert all(window[path].tolist()[-1] == value for path, value in summary["truth"].items())


def test_a_simulation_overtakes_its_telemetry_and_says_so(receiver: Telemetry) -> None:
    """Thousands of ticks in a few milliseconds: each of them is sent or counted as overwritten."""
    done = run("--json", "--telemetry", address(receiver))
    summary = json.loads(done.stdout)
    counts = summary["telemetry"]
    assert counts["packets"] + counts["overwritten"] == summary["ticks"] > 2000 and counts["packets"] >= 32
    receiver.poll()
    window = receiver.window(["machine.tick"])
    assert (
        receiver.counts.overwritten <= counts["overwritten"]
        and window["machine.tick"].tolist() == (window.tick + 1).tolist()
    )


def test_in_lock_step_each_side_sends_what_is_its_own(receiver: Telemetry, tmp_path: Path) -> None:
    """The simulator sends the plant's values, the flight program the machine's, of the same ticks."""
    wire = f"wire:unix:{tmp_path / 'w'}"
    line = [sys.executable, str(FCSL_SIM), "run", str(LANDER), "--duration", "0.5", "--external", wire]
    flight_receiver = Telemetry(0)
    with subprocess.Popen([*line, "--telemetry", address(receiver)], stdout=subprocess.PIPE, text=True) as simulator:
        assert simulator.stdout is not None
        command = simulator.stdout.readline().split(": ")[1].split()
        subprocess.run([*command, "--telemetry", address(flight_receiver)], capture_output=True, timeout=60, check=True)
        simulator.communicate(timeout=60)
    for telemetry in (receiver, flight_receiver):
        telemetry.poll()
        assert telemetry.window().tick.tolist() == list(range(50))
    flight_receiver.close()
    assert "lander.outputs.pos_z" in receiver.channels and "machine.state" not in receiver.channels
    assert "machine.state" in flight_receiver.channels and "lander.outputs.pos_z" not in flight_receiver.channels


def test_the_command_line() -> None:
    done = run("--duration", "0.5", "--telemetry", "udp:127.0.0.1:1")
    assert done.returncode == 1 and "telemetry: " in done.stdout and " overwritten, " in done.stdout
    for options, text in (
        (("--telemetry", "udp:example.org:7600"), "write udp:HOST:PORT"),
        (("--telemetry-fields", "*"), "`--telemetry-fields` needs `--telemetry`"),
        (("--telemetry", "udp:127.0.0.1:1", "--telemetry-fields", "x"), "no field matches 'x'"),
    ):
        done = run(*options)
        assert done.returncode == 2 and text in done.stderr and "Traceback" not in done.stderr
