# SPDX-License-Identifier: Apache-2.0
"""The gate before the actuators of a simulation. The machine and its plant are those of docs/hardware/arming.md."""

from __future__ import annotations

import contextlib
import json
import re
import subprocess
import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, SimError, Simulation, load
from fcsl_sim.plot import draw as draw_simulation
from fcsl_sim.runner import run
from simclient import bag
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.link.message import Channel, Kind, Message, decode, encode
from simclient.replay import replay
from simclient.run import open_run
from simclient.vars.client import VarClient
from simclient.vars.wire import VarError
from simclient.view.picture import choose, draw
from simclient.view.recorded import RecordedRun

PAGE = (Path(__file__).resolve().parents[2] / "docs/hardware/arming.md").read_text()
FILES = dict(re.findall(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```\n", PAGE, re.DOTALL))
DISARMED, ARMED, SILENT = 0, 1, 2
#: Ticks in which the page's flight is armed.
ON, OFF = 100, 200

BOOL, F64 = 0, 6
#: The channel table of drive.json, as the wire has it.
TABLE = [
    Channel(1, False, F64),
    Channel(2, False, F64),
    Channel(3, False, BOOL),
    Channel(16, True, F64),
    Channel(17, True, BOOL),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("arming")
    assert sorted(FILES) == ["cart.cpp", "drive.json", "drive.py", "drive.sim.json"]
    for name, text in FILES.items():
        (path / name).write_text(text)
    return path


@pytest.fixture(scope="module")
def config(folder: Path) -> SimConfig:
    return load(folder / "drive.sim.json")


def changed(folder: Path, name: str, change: Callable[[dict[str, Any]], object]) -> Path:
    """A simulation of the page's machine, changed, under another name."""
    machine = json.loads(FILES["drive.json"])
    change(machine)
    (folder / f"{name}.json").write_text(json.dumps(machine))
    path = folder / f"{name}.sim.json"
    path.write_text(FILES["drive.sim.json"].replace("drive.json", f"{name}.json"))
    return path


# ---- the page ------------------------------------------------------------------------------------------------------


def test_the_page_flies_and_replays(folder: Path) -> None:
    for line in PAGE.split("```sh\n")[1].split("```")[0].splitlines():
        done = subprocess.run(line, shell=True, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
        assert done.returncode == 0, f"$ {line}\n{done.stdout}\n{done.stderr}"
    assert "400 ticks, identical" in done.stdout
    header, *rows = (folder / "actuators.csv").read_text().splitlines()
    assert len(rows) == 400 and all(f"sim/actuators:{name}" in header for name in ("gate", "force", "brake"))

    flight = Bag(folder / "flight")
    time_s, gate = bag.columns(flight, "/sim/actuators:gate")
    _, force = bag.columns(flight, "/sim/actuators:force")
    _, brake = bag.columns(flight, "/sim/actuators:brake")
    _, wanted = bag.columns(flight, "/drive/drive:force")
    _, armed = bag.columns(flight, "/drive/drive:armed")
    assert [list(gate).index(ARMED), list(gate[ON:]).index(DISARMED)] == [ON, OFF - ON]
    assert np.allclose(time_s * 100.0, np.arange(400.0))
    assert (gate == armed).all() and (brake == (gate == DISARMED)).all()
    assert (force == np.where(gate == ARMED, wanted, 0.0)).all()
    # the machine commands all the time, and the plant moves only while it is armed
    assert (wanted[:ON] == 2.0).all() and np.abs(wanted[OFF:]).min() > 0.01
    _, speed = bag.columns(flight, "/sim/plant:speed")
    assert (speed[: ON + 1] == 0.0).all() and speed[ON:OFF].max() > 0.5 and np.abs(speed[OFF + 10 :]).max() < 0.01


def test_a_picture_has_what_passed_the_gate(config: SimConfig, tmp_path: Path) -> None:
    """Behind each command: of the page's bag, of a picture that flies itself, and of a bag without the gate's topic."""
    run(config, bag=tmp_path / "flight")
    recorded = RecordedRun(Bag(tmp_path / "flight"))
    chosen = choose(recorded, ["drive.outputs.force", "drive.outputs.brake", "plant.outputs.speed"])
    labels = [[curve.label for curve in panel.curves] for panel in chosen.panels]
    assert labels == [
        ["drive.force (command)", "actuators.force (after the gate)"],
        ["drive.brake (command)", "actuators.brake (after the gate)"],
        ["plant.speed (plant)"],
    ]
    force, brake, speed = draw(recorded, chosen, "").axes
    lines = {line.get_label(): line for axis in (force, brake) for line in axis.get_lines()}
    passed = lines["actuators.force (after the gate)"]
    wanted = lines["drive.force (command)"].get_ydata()
    assert (passed.get_ydata() == np.where(np.isin(np.arange(400), range(ON, OFF)), wanted, 0.0)).all()
    assert passed.get_drawstyle() == "steps-post" and speed.get_ylabel() == "speed, m/s"
    default = choose(recorded)
    assert [panel.name for panel in default.panels][:3] == ["force, N", "gate", "brake"]
    assert default.left_out == []

    drawn = tmp_path / "flown.svg"
    assert draw_simulation(config, drawn, ["drive.outputs.force"], "") == []
    assert "actuators.force (after the gate)" in drawn.read_text()

    line = ["fcsl-fc", str(config.library), "--hal", "stub", "--ticks", "10", "--record", str(tmp_path / "alone")]
    subprocess.run(line, check=True, timeout=60, capture_output=True)
    alone = choose(RecordedRun(Bag(tmp_path / "alone")), ["drive.outputs.force"])
    assert [curve.label for curve in alone.panels[0].curves] == ["drive.force"]


def test_every_host_arms_alike(config: SimConfig, tmp_path: Path) -> None:
    """The flight in one process and over a wire: the same bits, the same end of the plant, and both replay."""
    alone = run(config, bag=tmp_path / "alone")
    wire, flight = f"unix:{tmp_path / 'wire'}", tmp_path / "flight"
    line = ["fcsl-fc", str(config.library), "--hal", f"wire:{wire}", "--timeout", "60", "--record", str(flight)]
    with subprocess.Popen(line, stdout=subprocess.PIPE, text=True) as controller:
        apart = run(config, external=f"wire:{wire}", timeout_ms=60_000)
        said, _ = controller.communicate(timeout=60)
        assert controller.returncode == 0
    assert re.findall(r"(\w+) at tick (\d+)", said) == [("armed", str(ON)), ("disarmed", str(OFF))]
    assert apart.truth == alone.truth
    assert digest(tmp_path / "alone") == digest(flight)
    for recorded in (tmp_path / "alone", flight):
        verdict = replay(recorded, library=str(config.library))
        assert verdict.identical and verdict.ticks == 400, str(verdict)


def test_the_message_says_what_the_output_says(config: SimConfig) -> None:
    hosted = open_run(config.library, "drive")
    with Simulation(config.plan, config.tables) as sim:
        for tick in range(OFF + 10):
            hosted.sense(sim.sense())
            hosted.step(1)
            message = hosted.actuate()
            sim.actuate(message)
            said = decode(message, Kind.ACTUATORS, TABLE)
            assert (said.tick, said.armed) == (tick, ON <= tick < OFF)
    hosted.close()


# ---- what the plant gets -------------------------------------------------------------------------------------------


@given(commands=st.lists(st.tuples(st.booleans(), st.floats(-1e6, 1e6), st.booleans()), min_size=1, max_size=40))
@settings(max_examples=50)
def test_a_disarmed_plant_gets_nothing_but_safe_values(
    config: SimConfig, commands: Sequence[tuple[bool, float, bool]]
) -> None:
    """Whatever a controller commands: the plant's inputs are those of the last command if it armed, else safe."""
    with Simulation(config.plan, config.tables) as sim:
        expected: tuple[float, bool] = (0.0, True)
        for tick, (armed, force, brake) in enumerate(commands):
            sim.sense()
            assert np.array_equal(inputs(sim), expected, equal_nan=True), f"before tick {tick}"
            sim.actuate(encode(Message(Kind.ACTUATORS, tick, {16: [force], 17: [brake]}, armed=armed), TABLE))
            expected = (force, brake) if armed else (0.0, True)


def inputs(sim: Simulation) -> tuple[float, bool]:
    force, brake = sim.get("plant.inputs.force"), sim.get("plant.inputs.brake")
    assert isinstance(force, float) and isinstance(brake, bool)
    return force, brake


@given(switched=st.lists(st.booleans(), min_size=2, max_size=30))
@settings(max_examples=20)
def test_the_machine_arms_in_the_tick_that_says_so(folder: Path, switched: list[bool]) -> None:
    """The switch of tick k arms the command of tick k, which the plant has until t_k+1."""
    simulation = json.loads(FILES["drive.sim.json"])
    path = "plant.parameters.switch_on"
    simulation["events"] = [{"at_s": tick / 100, "set": path, "value": on} for tick, on in enumerate(switched)]
    (folder / "random.sim.json").write_text(json.dumps(simulation))
    config = load(folder / "random.sim.json")
    with Simulation(config.plan, config.tables) as sim:
        before, wanted = False, 0.0
        for on in switched:
            sim.run(1)
            assert inputs(sim) == ((wanted, False) if before else (0.0, True))
            before, wanted = on, float(str(sim.machine_value("drive.outputs.force")))
            assert sim.machine_value("drive.outputs.armed") is on


def test_a_line_that_falls_silent_makes_the_plant_safe(folder: Path, tmp_path: Path) -> None:
    """The line loses everything from 1.5 s to 1.8 s. The gate closes 0.1 s after the last command, not before, and
    the first command that comes through opens it again."""
    line = {"reliable": False, "halts": False, "drop_percent": 0.0, "corrupt_percent": 0.0, "bit_error_percent": 0.0}
    simulation = json.loads(FILES["drive.sim.json"])
    simulation["controller"]["link"] = "line"
    simulation["models"]["serial_link"] = {"source": "package://fcsl_sim/models/serial_link.c"}
    parameters = {**line, "delay_s": 0.0, "baud": 0.0, "retransmit_ticks": 3}
    simulation["instances"]["line"] = {"model": "serial_link", "parameters": parameters}
    simulation["rates"] = {"line": 1000}
    lost = "line.parameters.drop_percent"
    simulation["events"] += [{"at_s": 1.5, "set": lost, "value": 100.0}, {"at_s": 1.8, "set": lost, "value": 0.0}]
    (folder / "silent.sim.json").write_text(json.dumps(simulation))
    run(load(folder / "silent.sim.json"), bag=tmp_path / "flight")
    flight = Bag(tmp_path / "flight")
    _, gate = bag.columns(flight, "/sim/actuators:gate")
    _, force = bag.columns(flight, "/sim/actuators:force")
    _, brake = bag.columns(flight, "/sim/actuators:brake")
    silent = np.flatnonzero(gate == SILENT)
    assert list(silent) == list(range(silent[0], silent[-1] + 1)), "one silence"
    assert 159 <= silent[0] <= 161 and 180 <= silent[-1] <= 182
    assert (gate[silent[0] - 9 : silent[0]] == ARMED).all() and gate[silent[-1] + 1] == ARMED
    assert (force[silent] == 0.0).all() and brake[silent].all()
    assert replay(tmp_path / "flight", config=str(folder / "drive.json")).identical


# ---- the names of the record, and machines without one -------------------------------------------------------------


def test_clients_see_the_gate_and_cannot_open_it(config: SimConfig, tmp_path: Path) -> None:
    paths = ("actuators.outputs.gate", "actuators.outputs.force", "actuators.outputs.brake")
    with Simulation(config.plan, config.tables) as sim:
        sim.serve(str(tmp_path / "s"), None, True)
        with driven(sim), VarClient(tmp_path / "s") as client:
            assert [*client.get(*paths).values()] == [DISARMED, 0.0, True]
            client.tick(ON + 1)
            assert [*client.get(*paths).values()] == [ARMED, 2.0, False]
            with pytest.raises(VarError, match="cannot be set|read-only|nobody"):
                client.set({"actuators.outputs.force": 5.0})
            kept = client.save()
            client.tick(OFF - ON)
            assert client.get_value("actuators.outputs.gate") == DISARMED
            client.restore(kept)
            assert [*client.get(*paths).values()] == [ARMED, 2.0, False]
            client.tick(1)
            assert client.get_value("plant.inputs.force") == 2.0


@contextlib.contextmanager
def driven(sim: Simulation) -> Iterator[None]:
    """Runs the simulation, which a client keeps paused, in a thread of its own."""
    over = threading.Event()

    def fly() -> None:
        while not over.is_set() and sim.status == "running":
            sim.run(100)

    thread = threading.Thread(target=fly)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def test_an_instance_with_the_name_of_the_topic(folder: Path, tmp_path: Path) -> None:
    text = FILES["drive.sim.json"].replace('"plant"', '"actuators"').replace("plant.", "actuators.")
    (folder / "named.sim.json").write_text(text)
    with pytest.raises(DiagnosticError) as error:
        load(folder / "named.sim.json")
    assert [d.message for d in error.value.diagnostics] == ["`actuators` is reserved"]

    def rename(machine: dict[str, Any]) -> None:
        machine.update(
            instances={"actuators": {"algorithm": "Drive"}},
            states={"RUN": {"schedule": {"actuators": 100}}},
            arm="actuators.armed",
            channels=[{**c, "field": c["field"].replace("drive", "actuators")} for c in machine["channels"]],
        )

    config = load(changed(folder, "renamed", rename))
    with Simulation(config.plan, config.tables) as sim:
        assert sim.run(1) == 1
    with Simulation(config.plan, config.tables) as sim, pytest.raises(SimError, match="machine's instance `actuators`"):
        sim.serve(str(tmp_path / "s"), None, True)


@pytest.mark.parametrize("key", ["arm", "command_timeout_s"])
def test_one_of_the_two_alone(folder: Path, tmp_path: Path, key: str) -> None:
    """Without `arm` the machine is armed from its first command on, and safe before it."""
    config = load(changed(folder, f"without_{key}", lambda machine: machine.pop(key)))
    run(config, bag=tmp_path / "flight")
    _, gate = bag.columns(Bag(tmp_path / "flight"), "/sim/actuators:gate")
    assert list(gate) == [ARMED if key == "arm" or ON <= tick < OFF else DISARMED for tick in range(400)]


def test_a_machine_with_neither_has_no_such_topic(folder: Path, tmp_path: Path) -> None:
    def remove(machine: dict[str, Any]) -> None:
        del machine["arm"], machine["command_timeout_s"]

    config = load(changed(folder, "plain", remove))
    run(config, bag=tmp_path / "flight")
    assert "/sim/plant" in Bag(tmp_path / "flight").topics and "/sim/actuators" not in Bag(tmp_path / "flight").topics
    with Simulation(config.plan, config.tables) as sim:
        sim.run(1)
        assert inputs(sim) == (0.0, True)  # safe until the first command, which holds from t_0 on
        sim.run(1)
        assert inputs(sim) == (2.0, False)
