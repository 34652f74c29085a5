# SPDX-License-Identifier: Apache-2.0
"""Services of a machine: what a caller is told is what the machine did, and a recorded flight with calls replays."""

from __future__ import annotations

import json
import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bridge_harness import Domain
from controller_client import ACTIVATE, CONFIGURE, DEACTIVATE, ControllerClient
from rclpy.serialization import deserialize_message
from std_msgs.msg import Int32
from std_srvs.srv import SetBool, Trigger

from fcsl_bridge.topics import qos
from fcsl_msgs.srv import Describe
from simclient.replay import replay

_OPERATOR = """
class Operator:
    outputs = {"launch": "bool", "arm": "bool"}

    def execute(self):
        pass
"""
_MODE = """
class Mode:
    inputs = {"launch": "bool", "arm": "bool"}
    parameters = {"ready": "bool"}
    outputs = {"armed": "bool", "refused": "bool", "launches": "i32", "transition_request": "TransitionRequest"}
    state = {"before": "bool"}

    def execute(self):
        self.refused = self.arm and not self.ready
        self.armed = self.arm and self.ready
        if self.launch and not self.before:
            self.launches += 1
        self.before = self.launch
        if self.launch and self.armed:
            self.transition_request = "LAUNCH"
"""


def build(folder: Path) -> Path:
    (folder / "operator.py").write_text(_OPERATOR)
    (folder / "mode.py").write_text(_MODE)
    launch = {"type": "std_srvs/Trigger", "service": "launch", "accepted": "machine.state == 'FLY'", "within_s": 2.0}
    arm = {
        "type": "std_srvs/SetBool",
        "service": "arm",
        "accepted": "mode.outputs.armed == operator.outputs.arm",
        "refused": "mode.outputs.refused",
    }
    launches = {"type": "std_msgs/Int32", "field": "data", "topic": "launches"}
    sensor = {"direction": "sensor"}
    config = {
        "tick_hz": 100,
        "initial_state": "IDLE",
        "publish": [],
        "algorithms": {"Operator": {"source": "operator.py"}, "Mode": {"source": "mode.py"}},
        "instances": {
            "operator": {"algorithm": "Operator"},
            "mode": {"algorithm": "Mode", "parameters": {"ready": False}},
        },
        "connections": [
            {"from": "operator.launch", "to": "mode.launch"},
            {"from": "operator.arm", "to": "mode.arm"},
        ],
        "states": {
            # A call is seen by an instance that runs in each tenth tick, too.
            "IDLE": {"schedule": {"operator": 100, "mode": 10}},
            "FLY": {"schedule": {"operator": 100, "mode": 10}},
        },
        "transitions": [{"from": "IDLE", "to": "FLY", "request": "LAUNCH"}],
        "channels": [
            {"name": "operator.launch", "id": 1, "field": "operator.outputs.launch", "ros": launch, **sensor},
            {"name": "operator.arm", "id": 2, "field": "operator.outputs.arm", "ros": arm, **sensor},
            {"name": "launches", "id": 3, "field": "mode.outputs.launches", "ros": launches, "direction": "report"},
        ],
    }
    (folder / "gate.json").write_text(json.dumps(config))
    subprocess.run(["fcslc", "build", folder / "gate.json", "-o", folder / "out"], check=True, capture_output=True)
    return folder / "out" / "libgate.so"


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return build(tmp_path_factory.mktemp("gate"))


class Vehicle:
    """A controller of machine `gate`, and its caller."""

    def __init__(self, domain: Domain, library: Path, **parameters: bool):
        self.bag = domain.folder / "bag"
        self.listener = domain.listener()
        self.process = domain.start("controller_node", machine=library, record=self.bag, mode="realtime", **parameters)
        self.node = ControllerClient(self.listener, "/gate")
        self._machine = ControllerClient(self.listener, "")
        self.listener.subscribe(Int32, "/launches", qos.COMMAND)
        self.launches = self.listener.received["/launches"]

    def launch(self) -> tuple[bool, str]:
        answer = self._machine.call(Trigger, "launch")
        return answer.success, answer.message

    def arm(self, wanted: bool) -> tuple[bool, str]:
        answer = self._machine.call(SetBool, "arm", data=wanted)
        return answer.success, answer.message


@pytest.fixture
def vehicle(domain: Domain, library: Path) -> Iterator[Vehicle]:
    yield Vehicle(domain, library)


def test_what_callers_are_told(vehicle: Vehicle, library: Path) -> None:
    done, why = vehicle.arm(True)
    assert not done and why.startswith("refused: mode.outputs.refused in IDLE at tick "), why
    assert vehicle.node.set(mode__ready=True).successful
    done, why = vehicle.launch()
    assert not done and why.startswith("timed out: not machine.state == 'FLY' in IDLE at tick "), why

    # A refused call and one that timed out are over: neither arms nor launches it later.
    assert vehicle.arm(False)[0]
    done, why = vehicle.arm(True)
    assert done and why.startswith("accepted in IDLE at tick "), why
    done, why = vehicle.launch()
    assert done and why.startswith("accepted in FLY at tick "), why
    assert deserialize_message(vehicle.launches[-1], Int32).data == 2, "each call is one edge"

    assert vehicle.node.change(DEACTIVATE)
    assert vehicle.launch() == (False, "the node is inactive: no tick is made")
    assert vehicle.node.change(ACTIVATE)
    assert vehicle.launch()[0]
    vehicle.process.signal(signal.SIGINT)
    assert vehicle.process.finish() == 0
    assert "nothing fills" not in vehicle.process.err

    replayed = replay(vehicle.bag, library=library)
    assert replayed.identical, replayed


def test_description(vehicle: Vehicle) -> None:
    launch, arm, _ = vehicle.node.call(Describe, "describe").channels
    assert (launch.topic, launch.message, launch.field) == ("/launch", "std_srvs/srv/Trigger", "")
    assert (arm.topic, arm.message, arm.field) == ("/arm", "std_srvs/srv/SetBool", "")


def test_one_call_waits_at_a_time(vehicle: Vehicle) -> None:
    client: Any = vehicle.listener.node.create_client(Trigger, "/launch")
    vehicle.listener.until(client.service_is_ready)
    calls = [client.call_async(Trigger.Request()) for _ in range(3)]
    vehicle.listener.until(lambda: all(call.done() for call in calls))
    said = sorted(call.result().message for call in calls)
    assert said[:2] == ["busy: another call waits for its answer"] * 2 and said[2].startswith("timed out"), said


def test_a_call_that_waits_is_answered_at_the_end(vehicle: Vehicle) -> None:
    client: Any = vehicle.listener.node.create_client(Trigger, "/launch")
    vehicle.listener.until(client.service_is_ready)
    call = client.call_async(Trigger.Request())
    assert vehicle.node.change(DEACTIVATE)
    vehicle.listener.until(call.done)
    answer = call.result()
    assert (answer.success, answer.message) in (
        (False, "the machine stopped before it answered"),
        (False, "the node is inactive: no tick is made"),  # it had not been taken
    )


def test_before_the_first_tick(domain: Domain, library: Path) -> None:
    vehicle = Vehicle(domain, library, autostart=False)
    assert vehicle.node.change(CONFIGURE)
    assert vehicle.launch() == (False, "the node is inactive: no tick is made")
    assert vehicle.node.change(ACTIVATE)
    assert vehicle.arm(False)[0]
