# SPDX-License-Identifier: Apache-2.0
"""Instances of parts through the hosts: their names have dots, their topics slashes."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from native import flying
from rosbags.highlevel import AnyReader

from simclient import AlgTwin, OverwrittenWarning, PyTwin, TwinError
from simclient.bag import Bag, columns
from simclient.errors import did_you_mean
from simclient.live.channels import channels_of
from simclient.machine_build import build_config
from simclient.paths import split_path
from simclient.replay import replay
from simclient.telemetry.configuration import Channel
from simclient.view.picture import plot
from simclient.view.recorded import RecordedRun

RATE = """
class Rate:
    inputs = {"target": "f64 rad/s", "scale": "f64"}
    parameters = {"gain": "f64"}
    outputs = {"torque": "f64 N*m"}
    state = {"last": "f64"}

    def execute(self):
        self.torque = self.gain * self.target + self.scale * self.last
        self.last = self.target
"""
LAW = """
class Law:
    inputs = {"angle": "f64 rad"}
    outputs = {"rate": "f64 rad/s", "size": "f64"}

    def execute(self):
        self.rate = 0.5 - self.angle
"""
PART: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Rate": {"source": "rate.py"}, "Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law"}, "rate": {"algorithm": "Rate", "parameters": {"gain": 2.0}}},
    "connections": [{"from": "law.rate", "to": "rate.target"}],
    "states": {"RUN": {"schedule": {"law": 100, "rate": 50}}},
    "ports": {"inputs": {"angle": "law.angle"}, "outputs": {"torque": "rate.torque"}},
    "requirements": [
        {"id": "ATT-1", "text": "The torque is small.", "never": "rate.outputs.torque > 2.0", "clock": "rate"}
    ],
}
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "algorithms": {"Body": {"source": "body.py"}},
    "instances": {"body": {"algorithm": "Body"}, "att": {"machine": "parts/att.json"}},
    "connections": [
        {"from": "att.torque", "to": "body.torque"},
        {"from": "body.angle", "to": "att.angle", "delayed": True, "initial": 0.25},
    ],
    "channels": [{"name": "torque", "id": 1, "field": "att.outputs.torque", "direction": "actuator"}],
    "views": {"panels": [{"title": "torque", "values": ["att.outputs.torque", "att.rate.state.last"]}]},
    "states": {"RUN": {"schedule": {"body": 100, "att": True}}},
}
BODY = """
class Body:
    inputs = {"torque": "f64 N*m"}
    outputs = {"angle": "f64 rad"}

    def execute(self):
        self.angle += 0.01 * self.torque
"""


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("parts")
    (folder / "parts").mkdir()
    for name, text in {"body.py": BODY, "parts/rate.py": RATE, "parts/law.py": LAW}.items():
        (folder / name).write_text(text)
    (folder / "parts/att.json").write_text(json.dumps(PART))
    (folder / "craft.json").write_text(json.dumps(CONFIG))
    return folder / "craft.json"


@pytest.fixture(params=[AlgTwin, PyTwin])
def twin(request: pytest.FixtureRequest, config: Path) -> Iterator[AlgTwin]:
    with request.param.from_config(config) as opened:
        yield opened


def test_a_twin_names_instances_of_parts(twin: AlgTwin) -> None:
    assert [instance.name for instance in twin.instances()] == ["body", "att.law", "att.rate"]
    twin.set("att.rate.parameters.gain", 3.0)
    assert twin.run_until("att.rate.outputs.torque > 0.5", timeout_ticks=10) == 1
    twin.fault("att.rate")
    twin.tick(2)
    assert twin.get_value("att.rate.outputs.health") == "failed" and twin.get_value("att.rate.counters.faults") == 1
    nested = twin.snapshot().values
    assert nested["att"]["rate"]["parameters"] == {"gain": 3.0} and nested["att"]["law"]["outputs"]["size"] == 0.0
    assert str(twin.describe("att.law.outputs.rate")).startswith("att.law.outputs.rate: f64 rad/s")
    with pytest.warns(
        OverwrittenWarning, match="when `att.rate` next runs; set att.law.outputs.rate, or open `att.rate` wit"
    ):
        twin.set("att.rate.inputs.target", 1.0)
    with pytest.raises(TwinError, match="did you mean `att.rate.outputs.torque`"):
        twin.get_value("att.rate.outputs.torqe")
    with pytest.raises(TwinError, match="did you mean `att.rate`"):
        twin.fault("att.rote")
    with pytest.raises(TwinError, match="`att.rate` is not a field but a group of fields: att.rate.inputs.target, "):
        twin.get_value("att.rate")


def test_a_requirement_of_a_part_is_judged_in_the_machine(twin: AlgTwin) -> None:
    twin.tick(20)
    assert str(twin.requirements["att.ATT-1"]) == "att.ATT-1 met, exercised in 10 ticks"
    twin.set("att.rate.parameters.gain", 9.0)
    twin.tick(2)
    path, verdict = "att.rate.outputs.torque", twin.requirements["att.ATT-1"]
    assert verdict.first_tick == 20 and verdict.first == {path: twin.get_value(path)}


def test_a_port_of_a_part_is_no_field(twin: AlgTwin) -> None:
    with pytest.raises(TwinError, match=r"`att.outputs.torque`: .* did you mean `att.rate.outputs.torque`"):
        twin.get_value("att.outputs.torque")
    known = ["ate.outputs.u", "att.rate.inner.outputs.u"]
    assert did_you_mean("att.outputs.u", known) == "; did you mean `att.rate.inner.outputs.u`?"


def test_a_part_is_no_instance(twin: AlgTwin, config: Path) -> None:
    with pytest.raises(TwinError, match="`att` is a part, not an instance; its instances: att.law, att.rate"):
        twin.fault("att")
    with pytest.raises(TwinError, match=r"`att` is a part, not an instance(.|\n)*instances: att.law, att.rate"):
        AlgTwin.from_instances(config, ["att"])


def test_one_instance_of_a_part_alone(config: Path) -> None:
    with AlgTwin.from_instances(config, ["att.rate"]) as twin:
        twin.set("att.rate.inputs.target", 4.0)
        twin.tick()
        assert twin.get_value("att.rate.outputs.torque") == 8.0


def test_recordings(twin: AlgTwin, config: Path, tmp_path: Path) -> None:
    twin.record(tmp_path / "run", "car")
    twin.tick(3)
    twin.set("att.rate.inputs.scale", -0.5)
    twin.tick(20)
    twin.stop_recording()
    bag = Bag(tmp_path / "run")
    assert {t: bag.topics[t].type for t in bag.topics if "/att/" in t} == {
        "/car/craft/att/law": "craft/msg/CraftAttLaw",
        "/car/craft/att/law/inputs": "craft_fields/msg/CraftAttLawInputs",
        "/car/craft/att/rate": "craft/msg/CraftAttRate",
        "/car/craft/att/rate/inputs": "craft_fields/msg/CraftAttRateInputs",
    }
    machine = bag.machine()
    assert set(machine.outputs) == {"body", "att.law", "att.rate"}
    assert {"att.rate.inputs", "att.law.inputs"} <= set(machine.fields)
    assert columns(bag, "att.rate.inputs.scale")[1].tolist()[-1] == -0.5
    assert columns(bag, "att.rate.outputs.torque")[1].any()
    with AnyReader([bag.path]) as reader:
        (inputs,) = [c for c in reader.connections if c.topic.endswith("/att/rate/inputs")]
        message = next(reader.deserialize(raw, inputs.msgtype) for _, _, raw in reader.messages([inputs]))
        assert message.target == pytest.approx(0.25) and message.scale == 0.0
    verdict = replay(tmp_path / "run", config=str(config))
    assert verdict.identical and verdict.ticks == 23, str(verdict)
    names = {signals.name: (signals.owner, signals.part) for signals in RecordedRun(bag).signals}
    assert names["att.rate"] == ("att.rate", "outputs")
    plot(tmp_path / "run", tmp_path / "run.svg")
    text = (tmp_path / "run.svg").read_text()
    assert "att.rate.torque" in text


def test_a_flight_program_serves_and_records_them(config: Path, tmp_path: Path) -> None:
    library, _ = build_config(config)
    record = ("--record", tmp_path / "run", "--record-fields", "att.rate.*,*.outputs.*")
    with flying("--socket", tmp_path / "fc.sock", "--paused", *record, library=str(library)) as fc:
        client = fc.client(tmp_path / "fc.sock")
        client.set("att.rate.parameters.gain", 5.0)
        client.ok("tick", count=4)
        assert client.get("att.rate.parameters.gain") == 5.0 and client.get("att.rate.outputs.torque") != 0.0
        assert client.ok("describe", path="att.law.outputs.rate")["instance"] == "att.law"
        client.ok("inject", instance="att.law", what="fault")
        client.ok("tick")
        assert client.get("att.law.counters.faults") == 1
        assert fc.stop()[0] == 0
    bag = Bag(tmp_path / "run")
    assert columns(bag, "att.rate.state.last")[1].any() and columns(bag, "att.rate.inputs.target")[1].any()
    assert "/craft/att/law/inputs" not in bag.topics
    assert replay(tmp_path / "run", config=str(config)).identical


def test_telemetry_has_the_topics_of_bags() -> None:
    paths = ("att.rate.outputs.torque", "att.rate.inputs.target", "body.outputs.angle", "channels.torque.stamp_ns")
    found = channels_of("craft", {path: Channel("f64", (), "", ()) for path in paths})
    assert list(found.paths) == ["/craft/att/rate", "/craft/att/rate/inputs", "/craft/body", "/craft/record/channels"]


@pytest.mark.parametrize(
    ("path", "expected"),
    [
        ("nav.outputs.angle", ("nav", "outputs", "angle")),
        ("a.b.c.state.x[3].outputs.y", ("a.b.c", "state", "x[3].outputs.y")),
        ("machine.state", ("", "", "machine.state")),
        ("machine.outputs.state", ("", "", "machine.outputs.state")),
        ("channels.imu.state.valid", ("", "", "channels.imu.state.valid")),
        ("outputs.x", ("", "", "outputs.x")),
        ("nav.outputs", ("", "", "nav.outputs")),
        ("outputs.outputs.x", ("outputs", "outputs", "x")),
    ],
)
def test_parts_of_paths(path: str, expected: tuple[str, str, str]) -> None:
    assert split_path(path) == expected
