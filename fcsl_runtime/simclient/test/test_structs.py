# SPDX-License-Identifier: Apache-2.0
"""Structs through the hosts: by path in twins and fcsl-fc, on channels, as nested messages in bags, replayed and shown."""

from __future__ import annotations

import copy
import json
import math
import re
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from native import flying
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from simclient import AlgTwin, PyTwin, TwinError
from simclient.bag import Bag, columns, field_value
from simclient.machine_build import build_config
from simclient.replay import replay
from simclient.run import open_run
from simclient.view.picture import plot
from simclient.view.recorded import RecordedRun

TRACK = """
class Track:
    inputs = {"scale": "f64"}
    outputs = {
        "targets": "Target[2][3]",  # seen in this tick
        "pose": "Pose",
    }

    def execute(self):
        pass
"""
LAW = """
class Law:
    inputs = {"targets": "Target[2][3]", "pose": "Pose"}
    outputs = {"flag": "bool", "best": "Target", "path": "Pose[2]", "count": "u64"}
    parameters = {"home": "Pose"}
    state = {"last": "Target"}

    def execute(self):
        self.flag = self.pose.valid
        self.best = self.targets[1, 2]
        self.best.weight = self.targets[0, 1].weight + self.last.weight
        self.path[0] = self.home
        self.path[1] = self.pose
        self.path[1].position[2] = 7.5
        self.count += u64(1)
        self.last = self.best
"""
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "RUN",
    "structs": {
        "Pose": {"valid": "bool", "position": "f64[3] m", "attitude": "f32[4]", "level": "i32"},
        "Target": {"id": "u32", "pose": "Pose", "grid": "f32[2][2]", "alive": "bool", "weight": "f64 kg"},
    },
    "algorithms": {"Track": {"source": "track.py"}, "Law": {"source": "law.py"}},
    "instances": {
        "track": {"algorithm": "Track"},
        "law": {
            "algorithm": "Law",
            "parameters": {"home": {"valid": True, "position": [1, 2, 3], "attitude": [1, 0, 0, 0], "level": -4}},
        },
    },
    "connections": [
        {"from": "track.targets", "to": "law.targets"},
        {"from": "track.pose", "to": "law.pose"},
    ],
    "channels": [
        {
            "name": "gps.position",
            "id": 1,
            "field": "track.outputs.pose.position",
            "direction": "sensor",
            "max_age_ticks": 5,
        },
        {"name": "best.weight", "id": 2, "field": "law.outputs.best.weight", "direction": "actuator"},
    ],
    "states": {"RUN": {"schedule": {"track": 100, "law": 100}}},
}
POSE = {"valid": True, "position": [0.25, -1.5, 3.0], "attitude": [0.5, 0.5, 0.5, -0.5], "level": 9}
TARGET = {"id": 7, "pose": POSE, "grid": [[1.0, 2.0], [3.0, 4.0]], "alive": True, "weight": 2.5}


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("structs")
    (folder / "track.py").write_text(TRACK)
    (folder / "law.py").write_text(LAW)
    (folder / "rover.json").write_text(json.dumps(CONFIG))
    return folder / "rover.json"


@pytest.fixture(params=[AlgTwin, PyTwin])
def twin(request: pytest.FixtureRequest, config: Path) -> Iterator[AlgTwin]:
    with request.param.from_config(config) as opened:
        yield opened


def target(k: int) -> dict[str, Any]:
    made = copy.deepcopy(TARGET)
    made["id"], made["weight"], made["alive"] = k, math.sin(k), k % 2 == 0
    made["pose"]["position"] = [k / 7, math.nan if k == 11 else -0.0, 1e300]
    made["grid"][1][0] = float(k)
    return made


def fly(twin: AlgTwin, bag: Path | None, ticks: int = 30) -> list[dict[str, Any]]:
    """Writes structs, elements and members; returns law.outputs.best after every tick."""
    if bag is not None:
        twin.record(bag, "car")
    seen = []
    for k in range(ticks):
        twin.set("track.outputs.targets[1][2]", target(k))
        twin.set("track.outputs.targets[0, 1].weight", 0.5 * k)
        twin.set("track.outputs.pose", {**POSE, "level": k})
        twin.tick()
        seen.append(twin.get_value("law.outputs.best"))
    return seen


def same(a: Any, b: Any) -> bool:
    """Equal, every NaN to every other."""
    return json.dumps(a, sort_keys=True) == json.dumps(b, sort_keys=True)


# ---- twins ------------------------------------------------------------------------------------------------------------


def test_whole_structs_members_and_elements(twin: AlgTwin) -> None:
    assert twin.get_value("law.parameters.home") == CONFIG["instances"]["law"]["parameters"]["home"]
    twin.set("track.outputs.targets[1][2]", TARGET)
    twin.set("track.outputs.pose", POSE)
    twin.set("track.outputs.targets[0][1].weight", 10)
    twin.tick()
    assert twin.get_value("law.outputs.best") == {**TARGET, "weight": 10.0}
    assert twin.get_value("law.outputs.best.pose") == POSE
    assert twin.get_value("law.outputs.best.grid") == [[1.0, 2.0], [3.0, 4.0]]
    assert twin.get_value("law.outputs.best.grid[1]") == [3.0, 4.0]
    assert twin.get_value("law.outputs.path[1].position[2]") == 7.5
    assert twin.get_value("law.outputs.path") == [
        twin.get_value("law.parameters.home"),
        {**POSE, "position": [0.25, -1.5, 7.5]},
    ]
    rows = twin.get_value("law.inputs.targets")
    assert (
        [len(row) for row in rows] == [3, 3]
        and rows[1][2] == TARGET
        and rows[1] == twin.get_value("law.inputs.targets[1]")
    )
    twin.set("track.outputs.targets", rows[::-1])  # what is read can be set
    twin.set("law.parameters.home", {**POSE, "position": np.arange(3.0), "level": np.int32(5)})
    twin.tick()
    assert twin.get_value("track.outputs.targets[0, 2]") == TARGET and twin.get_value("law.outputs.best.id") == 0
    assert twin.get_value("law.outputs.path[0]") == {**POSE, "position": [0.0, 1.0, 2.0], "level": 5}


REFUSED: list[tuple[str, Any, str]] = [
    ("track.outputs.pose", 1.0, "track.outputs.pose: a dict with valid, position, attitude, level wanted, got 1.0"),
    ("track.outputs.pose", {}, "member `valid` is missing"),
    ("track.outputs.pose", {**POSE, "levl": 1}, "no member 'levl'; did you mean `level`?"),
    ("track.outputs.pose", {**POSE, "level": 1.5}, "track.outputs.pose.level: i32 wanted, got 1.5"),
    ("track.outputs.pose", {**POSE, "position": [1.0]}, "track.outputs.pose.position: f64[3] wanted, got a list of 1"),
    ("track.outputs.targets", [TARGET], "track.outputs.targets: a list of 2 wanted, got a list of 1"),
    ("track.outputs.targets[0]", TARGET, "track.outputs.targets[0]: a list of 3 wanted, got {"),
    ("track.outputs.targets[2][0].id", 1, "index `2` is not in 0..1"),
    ("track.outputs.targets[0][3]", TARGET, "index `3` is not in 0..2"),
    ("track.outputs.targets[0][0].ids", 1, "did you mean `track.outputs.targets[0][0].id`?"),
    ("track.outputs", {}, "`track.outputs` is not a field but a group of fields: track.outputs.targets[0][0].id, "),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "reason"), REFUSED, ids=[f"{p}-{i}" for i, (p, *_) in enumerate(REFUSED)])
def test_refusals_change_nothing(config: Path, path: str, value: Any, reason: str) -> None:
    with AlgTwin.from_config(config) as twin:
        before = twin.save()
        with pytest.raises(TwinError, match=re.escape(reason)):
            twin.set(path, value)
        assert twin.save() == before


def test_description(twin: AlgTwin) -> None:
    assert str(twin.describe("law.outputs.best.pose.position")).startswith(
        "law.outputs.best.pose.position: f64[3] m (output"
    )
    with pytest.raises(
        TwinError,
        match="`law.outputs.best.pose` is a struct; describe one of its fields: law.outputs.best.pose.valid, ",
    ):
        twin.describe("law.outputs.best.pose")


# ---- messages and bags ------------------------------------------------------------------------------------------------


def as_value(message: Any) -> Any:
    """A decoded message as a twin shows it; arrays flat, as ROS has them."""
    if hasattr(message, "__msgtype__"):
        return {n: as_value(getattr(message, n)) for n in message.__dataclass_fields__ if n != "__msgtype__"}
    if isinstance(message, list):
        return [as_value(item) for item in message]
    return message.tolist() if hasattr(message, "tolist") else message


def test_bags_hold_nested_messages(twin: AlgTwin, tmp_path: Path) -> None:
    seen = fly(twin, tmp_path / "run")
    messages = [twin._run.message(i) for i in range(2)]
    twin.stop_recording()
    store = get_typestore(Stores.ROS2_JAZZY)
    with AnyReader([tmp_path / "run"]) as reader:
        found = {t: [c for c in reader.connections if c.topic == f"/car/rover/{t}"][0] for t in ("law", "track")}
        assert [c.msgtype for c in found.values()] == ["rover/msg/RoverLaw", "rover/msg/RoverTrack"]
        types = get_types_from_msg(found["law"].msgdef.data, "rover/msg/RoverLaw")
        types |= get_types_from_msg(found["track"].msgdef.data, "rover/msg/RoverTrack")
        assert {"rover/msg/RoverPose", "rover/msg/RoverTarget"} <= types.keys()
        store.register({n: f for n, f in types.items() if n not in store.fielddefs})
        decoded: dict[str, list[Any]] = {"law": [], "track": []}
        for connection, _, data in reader.messages():
            name = connection.topic.rpartition("/")[2]
            if name in decoded:
                message = store.deserialize_cdr(data, connection.msgtype)
                # An independent CDR implementation writes the same bytes.
                assert bytes(store.serialize_cdr(message, connection.msgtype)) == bytes(data)
                decoded[name].append(as_value(message))
    assert (
        bytes(store.serialize_cdr(store.deserialize_cdr(messages[1], "rover/msg/RoverLaw"), "rover/msg/RoverLaw"))
        == messages[1]
    )
    for value, message in zip(seen, decoded["law"], strict=True):
        flat = {**value, "grid": [x for row in value["grid"] for x in row]}
        assert same(message["best"], flat)
    assert [m["targets"][5]["id"] for m in decoded["track"]] == list(range(30)) and len(
        decoded["track"][0]["targets"]
    ) == 6


def test_chosen_fields_hold_structs(config: Path, tmp_path: Path) -> None:
    """Fields without an interface of their own keep their structs, arrays of them included; some elements alone are refused."""
    run = open_run(*build_config(str(config)))
    with pytest.raises(
        TwinError, match="'law.inputs.targets' is an array of structs: choose the same members of every"
    ):
        run.record(tmp_path / "some", "", True, "law.inputs.targets[0][1].*,law.outputs.*")
    run.record(tmp_path / "run", "", True, "law.inputs.targets*weight,law.inputs.pose.*,law.parameters.*,law.state.*")
    weights = run.machine.fields["track.outputs.targets[0][1].weight"].index
    run.set(weights, 0, struct.pack("<d", 2.5))
    run.step(5)
    run.close()
    bag = Bag(tmp_path / "run")
    assert columns(bag, "law.inputs.targets[1].weight")[1].tolist() == [2.5] * 5
    assert columns(bag, "law.inputs.targets[4].weight")[1].tolist() == [0.0] * 5
    assert columns(bag, "law.parameters.home.position")[1].tolist() == [[1, 2, 3]] * 5
    assert columns(bag, "law.state.last.weight")[1][0] == 2.5 and columns(bag, "law.state.last.pose.level")[1][0] == 0
    with AnyReader([bag.path]) as reader:
        (inputs,) = [c for c in reader.connections if c.topic.endswith("/law/inputs")]
        message = next(reader.deserialize(raw, inputs.msgtype) for _, _, raw in reader.messages([inputs]))
    assert [target.weight for target in message.targets] == [0, 2.5, 0, 0, 0, 0]
    assert message.pose.attitude.tolist() == [0, 0, 0, 0] and not hasattr(message.targets[0], "id")


def test_type_hashes_of_nested_messages(twin: AlgTwin, tmp_path: Path) -> None:
    fly(twin, tmp_path / "run", 1)
    twin.stop_recording()
    text = (tmp_path / "run/metadata.yaml").read_text()
    store = get_typestore(Stores.ROS2_JAZZY)
    for instance in twin.instances():
        types = get_types_from_msg(instance.message_text, instance.message_type)
        store.register({n: f for n, f in types.items() if n not in store.fielddefs})
    for name in ("RoverLaw", "RoverTrack"):
        assert store.hash_rihs01(f"rover/msg/{name}") in text


def test_replay(config: Path, twin: AlgTwin, tmp_path: Path) -> None:
    fly(twin, tmp_path / "run")
    twin.stop_recording()
    verdict = replay(tmp_path / "run", config=str(config))
    assert verdict.identical and verdict.ticks == 30, str(verdict)
    other = tmp_path / "other"
    other.mkdir()
    for name, text in (("track.py", TRACK), ("law.py", LAW.replace("position[2] = 7.5", "position[2] = 7.25"))):
        (other / name).write_text(text)
    (other / "rover.json").write_text(config.read_text())
    verdict = replay(tmp_path / "run", config=str(other / "rover.json"), ignore_source_hash=True)
    found = verdict.divergence
    assert found is not None and (found.tick, found.path) == (0, "law.outputs.path[1].position[2]")
    assert (found.recorded, found.replayed) == ("7.5", "7.25")


def test_columns_and_pictures(config: Path, tmp_path: Path) -> None:
    with AlgTwin.from_config(config) as twin:
        seen = fly(twin, tmp_path / "run")
    bag = Bag(tmp_path / "run")
    for path, shape in (
        ("best.weight", (30,)),
        ("best.pose.position", (30, 3)),
        ("best.grid", (30, 4)),
        ("path[1].level", (30,)),
    ):
        t_s, values = columns(bag, f"law.outputs.{path}")
        assert t_s.shape == (30,) and values.shape == shape
    assert np.array_equal(columns(bag, "law.outputs.best.weight")[1], [v["weight"] for v in seen])
    assert columns(bag, "law.outputs.best.pose.valid")[1].dtype == np.bool_
    assert columns(bag, "track.outputs.targets[5].id")[1].tolist() == list(range(30))
    law = next(signals for signals in RecordedRun(bag).signals if signals.name == "law")
    assert law.units == {
        "best.pose.position": "m",
        "best.weight": "kg",
        "path[0].position": "m",
        "path[1].position": "m",
    }
    plot(tmp_path / "run", tmp_path / "run.svg", paths=["law.outputs.best", "law.outputs.path[1].position[2]"])
    text = (tmp_path / "run.svg").read_text()
    assert "law.best.pose.attitude[3]" in text and "law.path[1].position[2]" in text


def test_rerun_files_hold_members(config: Path, tmp_path: Path, recwarn: pytest.WarningsRecorder) -> None:
    from simclient.view.rrd import to_rerun

    with AlgTwin.from_config(config) as twin:
        fly(twin, tmp_path / "run")
    to_rerun(tmp_path / "run", tmp_path / "run.rrd")
    assert (tmp_path / "run.rrd").stat().st_size > 10_000
    assert not [w for w in recwarn if "path" in str(w.message).lower()]


def test_fields_of_decoded_messages(twin: AlgTwin, tmp_path: Path) -> None:
    fly(twin, tmp_path / "run", 2)
    twin.stop_recording()
    bag = Bag(tmp_path / "run")
    topic = bag.topic("/car/rover/track")
    message = next(bag.decode(t, d) for t, _, d in bag.messages({topic.name}))
    assert field_value(topic, message, "targets[5].pose.level") == 9
    for wrong in ("targets[6].id", "targets.id", "targets[0]..id", "pose[0]"):
        with pytest.raises(Exception, match=r"has no field `.*; fields: .*targets\[0\]\.id, "):
            field_value(topic, message, wrong)


# ---- channels, flight program -----------------------------------------------------------------------------------------


def test_a_channel_on_a_member(config: Path) -> None:
    run = open_run(*build_config(config))
    run.attach()
    run.write_channels({0: np.array([1.0, 2.0, 3.0]).tobytes()})
    run.step(1)
    position = run.machine.fields["law.outputs.path[1].position"]
    assert np.frombuffer(run.read(position.offset, position.size)).tolist() == [1.0, 2.0, 7.5]
    assert run.machine.channels[1].field.path == "law.outputs.best.weight" and len(run.actuate()) > 8
    run.close()


def test_the_flight_program_takes_paths_of_members(config: Path, tmp_path: Path) -> None:
    library, _ = build_config(config)
    with flying("--socket", tmp_path / "fc.sock", "--paused", library=str(library)) as fc:
        client = fc.client(tmp_path / "fc.sock")
        client.set("track.outputs.targets[1][2].pose.position", [1.0, 2.0, 3.0])
        client.set("track.outputs.targets[1,2].pose.position[1]", 5.5)
        client.set("track.outputs.targets[0][1].weight", 0.5)
        client.ok("tick")
        assert client.get("law.outputs.best.pose.position") == [1.0, 5.5, 3.0]
        assert client.get("law.outputs.best.weight") == 0.5
        assert client.ok("describe", path="law.outputs.path[1].level")["type"] == "i32"
        for beyond in ("targets[1][2].pose.position[3]", "targets[2][0].id"):
            assert client.error("get", paths=[f"track.outputs.{beyond}"])["code"] == "bad_index"
        for unknown in ("track.outputs.targets[1,2", "law.outputs.bst.pose"):
            assert client.error("get", paths=[unknown])["code"] == "unknown_path"
        pose = client.get("law.outputs.best.pose")
        assert pose == {"valid": False, "position": [1.0, 5.5, 3.0], "attitude": [0.0] * 4, "level": 0}
        client.close()


NAMES = """
class Names:
    outputs = {"bas": "Bas", "pose": "Pose", "poses": "PoseSet", "base": "Base[2]"}

    def execute(self):
        self.bas.n = i64(4)
        self.base[0].x = 5.5
        self.base[1].x = 6.5
        self.pose.flag = True
        self.pose.n = i64(7)
        self.poses.pose[1].n = i64(8)
        self.poses.base.x = 9.5
"""


def test_structs_whose_names_are_alike_are_told_apart(tmp_path: Path) -> None:
    """One name begins another, or is as long: each has its own section of the message's text."""
    (tmp_path / "names.py").write_text(NAMES)
    structs = {
        "Bas": {"n": "i64"},
        "Base": {"x": "f64"},
        "Pose": {"flag": "bool", "n": "i64"},
        "PoseSet": {"base": "Base", "pose": "Pose[2]"},
    }
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "structs": structs,
        "algorithms": {"Names": {"source": "names.py"}},
        "instances": {"names": {"algorithm": "Names"}},
        "states": {"RUN": {"schedule": {"names": 100}}},
    }
    (tmp_path / "alike.json").write_text(json.dumps(config))
    with AlgTwin.from_config(tmp_path / "alike.json") as twin:
        twin.record(tmp_path / "bag", "")
        twin.tick()
    with AnyReader([tmp_path / "bag"]) as reader:
        (connection,) = [c for c in reader.connections if c.topic == "/alike/names"]
        ((_, _, data),) = reader.messages([connection])
        seen: Any = reader.deserialize(data, connection.msgtype)
    assert (seen.bas.n, seen.pose.flag, seen.pose.n, [one.x for one in seen.base]) == (4, True, 7, [5.5, 6.5])
    assert (seen.poses.base.x, [one.n for one in seen.poses.pose]) == (9.5, [0, 8])
