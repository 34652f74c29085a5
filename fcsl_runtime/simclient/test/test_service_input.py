# SPDX-License-Identifier: Apache-2.0
"""What calls of a service leave in a machine, also across checkpoints."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest

from simclient.machine_build import build_config
from simclient.ros.services import ServiceInput
from simclient.run import Run, open_run
from simclient.values import decode

_MODE = """
class Mode:
    inputs = {"launch": "bool", "arm": "bool", "ready": "bool"}
    outputs = {"armed": "bool", "refused": "bool", "launches": "i32"}
    state = {"before": "bool"}

    def execute(self):
        self.refused = self.arm and not self.ready
        self.armed = self.arm and self.ready
        if self.launch and not self.before:
            self.launches += 1
        self.before = self.launch
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("services")
    (folder / "mode.py").write_text(_MODE)
    launch = {"type": "std_srvs/Trigger", "service": "launch", "accepted": "mode.outputs.armed", "within_s": 0.03}
    arm = {"type": "std_srvs/SetBool", "service": "arm", "accepted": "mode.outputs.armed == mode.inputs.arm"}
    arm |= {"refused": "mode.outputs.refused"}
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Mode": {"source": "mode.py"}},
        "instances": {"mode": {"algorithm": "Mode"}},
        "connections": [],
        "states": {"RUN": {"schedule": {"mode": 100}}},
        "channels": [
            {"name": "launch", "id": 1, "field": "mode.inputs.launch", "direction": "sensor", "ros": launch},
            {"name": "arm", "id": 2, "field": "mode.inputs.arm", "direction": "sensor", "ros": arm},
        ],
    }
    (folder / "gate.json").write_text(json.dumps(machine))
    return folder / "gate.json"


class Gate:
    def __init__(self, run: Run):
        self.run = run
        run.attach()
        self.launch, self.arm = (ServiceInput(run, service) for service in run.machine.services)
        for one in (self.launch, self.arm):
            one.begin(0)

    def get(self, path: str) -> object:
        field = self.run.machine.fields[path]
        return decode(self.run.read(field.offset, field.size), field, (), self.run.machine)

    def set_ready(self, ready: bool) -> None:
        self.run.set(self.run.machine.fields["mode.inputs.ready"].index, 0, bytes([ready]))

    def tick(self, launch: bool = False, arm: bool | None = None) -> str:
        """A tick with these calls, those that can be taken; the last answer after it, without its tick."""
        given = ((self.launch, launch or None), (self.arm, arm))
        for one, value in given:
            if one.prepare(0) and value is not None:
                assert one.call(value, 0) is None
        self.run.step(1)
        answers = [answer for one, _ in given if (answer := one.poll()) is not None]
        return answers[-1].message.partition(" at tick")[0] if answers else ""


@pytest.fixture
def gate(config: Path) -> Iterator[Gate]:
    run = open_run(*build_config(str(config)))
    yield Gate(run)
    run.close()


def test_a_level_stays_and_a_failure_goes_back(gate: Gate) -> None:
    assert gate.tick(arm=True) == "refused: mode.outputs.refused in RUN"
    assert gate.get("mode.inputs.arm") is True, "what the tick saw stays until the next one"
    gate.set_ready(True)
    assert gate.tick() == "" and not gate.get("mode.inputs.arm") and not gate.get("mode.outputs.armed")
    assert gate.tick(arm=True) == "accepted in RUN"
    assert gate.tick() == "" and gate.get("mode.outputs.armed")
    assert gate.tick(arm=False) == "accepted in RUN" and not gate.get("mode.outputs.armed")


def test_each_trigger_is_an_edge(gate: Gate) -> None:
    gate.set_ready(True)
    gate.tick(arm=True)
    said = [gate.tick(launch=True) for _ in range(6)]
    assert said == ["accepted in RUN", ""] * 3 and gate.get("mode.outputs.launches") == 3


def test_a_trigger_times_out(gate: Gate) -> None:
    assert [gate.tick(launch=n == 0) for n in range(4)] == ["", "", "timed out: not mode.outputs.armed in RUN", ""]
    assert gate.get("mode.inputs.launch") is False


def test_a_level_of_a_checkpoint(gate: Gate) -> None:
    """Of the run that was restored, not of the one before."""
    gate.set_ready(True)
    disarmed = gate.run.save()
    assert gate.tick(arm=True) == "accepted in RUN"
    gate.run.restore(disarmed)
    gate.set_ready(False)
    assert gate.tick(arm=True) == "refused: mode.outputs.refused in RUN"
    gate.set_ready(True)
    assert gate.tick() == "" and not gate.get("mode.outputs.armed")


def test_a_checkpoint_ends_a_call(gate: Gate) -> None:
    gate.tick()
    before = gate.run.save()
    gate.tick()
    assert gate.tick(launch=True) == ""
    gate.run.restore(before)
    assert gate.tick() == "a checkpoint was restored before it was answered"
    assert gate.tick() == "" and gate.get("mode.inputs.launch") is False


def test_a_restored_level_begins(gate: Gate) -> None:
    gate.set_ready(True)
    gate.tick(arm=True)
    gate.arm.begin(0)
    assert gate.tick() == "" and gate.get("mode.outputs.armed")
    assert gate.arm.prepare(0) and gate.arm.call(False, 0) is None
    stopped = gate.arm.end()
    assert stopped and stopped.message == "the machine stopped before it answered"
    gate.arm.begin(0)
    assert gate.tick() == "" and gate.get("mode.outputs.armed")
