# SPDX-License-Identifier: Apache-2.0
"""Messages of a package that is not standard: definitions found, stored and hashed; values into a machine and out of it."""

from __future__ import annotations

import ctypes
import json
import os
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from fcsl_compiler.cli.main import main
from simclient.bag import columns
from simclient.errors import TwinError
from simclient.machine_build import build_config
from simclient.replay import replay_foreign
from simclient.ros.topics import SampleInput, composer_of, topics_of
from simclient.run import Run, open_run

OWN = {
    "rover_msgs/msg/Setpoint": """
# What to do.      'quoted' # twice
uint64 timestamp                # time since system start
uint8 MODE_IDLE = 0
uint8 MODE_AUTO=3               # drives itself
string NAME="a # b"

uint8 mode
float32[3] velocity 	# [m/s]
float32 yaw 1.5
bool[2] flags [true, false]
int16 reserve
string<=8 frame "world"
float64[] weights
int8[<=4] pads
""",
    "rover_msgs/msg/Wheel": "string name\nint32 id\nfloat64 speed\nfloat32[] currents\nsensor_msgs/Range range\n",
    "rover_msgs/msg/Status": "std_msgs/Header header\nstring phase\nWheel[] wheels\nWheel[2] spare\nfloat32[] ranges\nuint8 last\n",
    "rover_msgs/msg/Picture": "uint32 width\nuint8[] data\n",
}
BEFORE = os.environ.get("AMENT_PREFIX_PATH", "")
STORE = get_typestore(Stores.ROS2_JAZZY)
for _name, _text in OWN.items():
    STORE.register(get_types_from_msg(_text, _name))
T = STORE.types

ALGORITHM = '''class Drive:
    """Shows what it is given."""

    inputs = {
        "phase": "i32", "left": "f64", "left_id": "u32", "left_range": "f32", "first": "f64", "wheels": "u32",
        "ranges": "f32[6]", "count": "u32", "last": "u32", "spare": "f64", "currents": "f32[2]",
    }
    outputs = {
        "mode": "u32", "velocity": "f64[3]", "frame": "i32", "weights": "f64[4]", "used": "u32", "pads": "i32[3]",
        "seen": "f64",
    }

    def execute(self):
        self.seen = self.left + self.first + f64(self.ranges[0]) + f64(self.left_range) + self.spare
        self.seen = self.seen + f64(self.currents[0])
        if self.count + self.wheels + self.last + self.left_id > u32(0) and self.phase > 0:
            self.seen = 0.0
'''
STATUS = {
    "phase": ("phase", {"choices": ["stop", "drive", "dück"]}),
    "left": ("wheels[name=left].speed", {}),
    "left_id": ("wheels[name=left].id", {"choices": [7, -1, 9]}),
    "left_range": ("wheels[name=left].range.range", {}),
    "currents": ("wheels[name=left].currents", {}),
    "first": ("wheels[0].speed", {}),
    "wheels": ("wheels.count", {}),
    "ranges": ("ranges", {}),
    "count": ("ranges.count", {}),
    "last": ("last", {}),
    "spare": ("spare[1].speed", {}),
}
SETPOINT = {
    "mode": ("mode", {"choices": ["MODE_IDLE", "MODE_AUTO", 9]}),
    "velocity": ("velocity", {}),
    "frame": ("frame", {"choices": ["world", "body", ""]}),
    "weights": ("weights", {}),
    "used": ("weights.count", {}),
    "pads": ("pads", {}),
}


def channels() -> list[dict[str, Any]]:
    rows = [("sensor", "inputs", "Status", STATUS), ("report", "outputs", "Setpoint", SETPOINT)]
    return [
        {"name": f"{kind.lower()}.{name}", "id": 100 * i + j, "field": f"drive.{record}.{name}", "direction": direction}
        | {"ros": {"type": f"rover_msgs/{kind}", "field": field, **keys}}
        for i, (direction, record, kind, table) in enumerate(rows)
        for j, (name, (field, keys)) in enumerate(table.items())
    ]


def install(folder: Path, own: dict[str, str] = OWN) -> Path:
    """The package with these messages, as colcon installs one."""
    for name, text in own.items():
        package, _, bare = name.split("/")
        file = folder / "share" / package / "msg" / f"{bare}.msg"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        index = folder / "share/ament_index/resource_index/packages"
        index.mkdir(parents=True, exist_ok=True)
        (index / package).write_text("")
    return folder


def source(monkeypatch: pytest.MonkeyPatch, workspace: Path) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{workspace}:{BEFORE}")


def write(folder: Path, rows: list[dict[str, Any]] | None = None) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "drive.py").write_text(ALGORITHM)
    machine = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "algorithms": {"Drive": {"source": "drive.py"}},
        "instances": {"drive": {"algorithm": "Drive"}},
        "states": {"RUN": {"schedule": {"drive": 10}}},
        "channels": channels() if rows is None else rows,
    }
    (folder / "rover.json").write_text(json.dumps(machine))
    return folder / "rover.json"


@pytest.fixture
def config(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    source(monkeypatch, install(tmp_path / "ws"))
    return write(tmp_path / "machine")


@pytest.fixture
def run(config: Path) -> Iterator[Run]:
    library, name = build_config(config)
    opened = open_run(library, name)
    opened.attach()
    yield opened
    opened.close()


def value(run: Run, name: str) -> Any:
    field = run.machine.fields[f"drive.{'inputs' if name in STATUS else 'outputs'}.{name}"]
    found = np.frombuffer(run.read(field.offset, field.size), field.type.replace("32", "4").replace("64", "8"))
    return found.tolist() if field.shape else found[0].item()


def write_value(memory: Any, run: Run, name: str, numbers: Any) -> None:
    field = run.machine.fields[f"drive.outputs.{name}"]
    data = np.asarray(numbers, field.type.replace("32", "4").replace("64", "8")).tobytes()
    ctypes.memmove(ctypes.addressof(memory) + field.offset, data, len(data))


def header(stamp_ns: int) -> Any:
    return T["std_msgs/msg/Header"](T["builtin_interfaces/msg/Time"](stamp_ns // 10**9, stamp_ns % 10**9), "")


def wheel(name: str, speed: float, number: int = 7, currents: tuple[float, ...] = (1.0, 2.0)) -> Any:
    at = T["sensor_msgs/msg/Range"](header(0), 0, 0.0, 0.0, 0.0, speed / 4, 0.0)
    return T["rover_msgs/msg/Wheel"](name, number, speed, np.array(currents, np.float32), at)


def status(stamp_ns: int, phase: str, wheels: list[Any], ranges: list[float]) -> bytes:
    spare = [wheel("a", 0.5), wheel("left", 0.75)]
    message = T["rover_msgs/msg/Status"](header(stamp_ns), phase, wheels, spare, np.array(ranges, np.float32), 5)
    return bytes(STORE.serialize_cdr(message, "rover_msgs/msg/Status"))


# ---- into the machine -----------------------------------------------------------------------------------------------------


def test_a_message_of_any_definition_becomes_samples(run: Run) -> None:
    (topic,) = (t for t in topics_of(run.machine) if t.direction == "sensor")
    samples, now = SampleInput(run, topic), 5 * 10**9
    wheels = [wheel("right", 1.0), wheel("left", 2.0, 9, (0.5, -0.5)), wheel("left", 3.0)]
    assert samples.deliver(status(now, "dück", wheels, [1.0, 2.0, 4.0]), now) == len(STATUS)
    found = {name: value(run, name) for name in STATUS}
    assert found == {
        **{"phase": 2, "left": 2.0, "left_id": 2, "left_range": 0.5, "first": 1.0, "wheels": 3, "spare": 0.75},
        **{"ranges": [1.0, 2.0, 4.0, 0.0, 0.0, 0.0], "count": 3, "last": 5, "currents": [0.5, -0.5]},
    }
    assert samples.counts() == {"taken": 1}


def test_what_a_message_does_not_have_is_refused_and_counted(run: Run) -> None:
    (topic,) = (t for t in topics_of(run.machine) if t.direction == "sensor")
    samples, now = SampleInput(run, topic), 5 * 10**9
    all_ = len(STATUS)
    right, left = wheel("right", 1.0), wheel("left", 2.0)
    assert samples.deliver(status(now, "fly", [right, left], []), now) == all_ - 1  # the phase is none of the choices
    assert samples.deliver(status(now + 1, "stop", [wheel("left", 2.0, 8)], [1.0] * 6), now) == all_ - 1  # nor the id
    assert samples.counts() == {"taken": 2, "unknown": 2}
    assert samples.deliver(status(now + 2, "stop", [right], [1.0]), now) == all_ - 4  # no left wheel
    assert samples.deliver(status(now + 3, "stop", [left], [1.0] * 7), now) == all_ - 1  # the length itself is taken
    assert value(run, "count") == 7 and value(run, "ranges") == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert samples.counts()["shape"] == 5
    assert samples.deliver(status(now + 4, "stop", [], [1.0]), now) == 0  # no first one: nothing is taken


# ---- out of it ------------------------------------------------------------------------------------------------------------


def test_what_is_made_is_what_another_reads(run: Run) -> None:
    """Random values, compared with rosbags' bytes."""
    (topic,) = (t for t in topics_of(run.machine) if t.direction == "report")
    composer, memory = composer_of(topic), ctypes.create_string_buffer(run.machine.size)
    rng = random.Random(3)
    for _ in range(200):
        used = rng.randint(0, 4)
        numbers = {
            "mode": rng.randrange(3),
            "velocity": [rng.uniform(-9, 9) for _ in range(3)],
            "frame": rng.randrange(3),
            "weights": [rng.uniform(-9, 9) for _ in range(4)],
            "used": used,
            "pads": [rng.randint(-128, 127) for _ in range(3)],
        }
        for name, number in numbers.items():
            write_value(memory, run, name, number)
        made = composer.compose([ctypes.addressof(memory)], 0)
        wanted = T["rover_msgs/msg/Setpoint"](
            timestamp=0,
            mode=[0, 3, 9][numbers["mode"]],
            velocity=np.array(numbers["velocity"], np.float32),
            yaw=1.5,
            flags=np.array([True, False]),
            reserve=0,
            frame=["world", "body", ""][numbers["frame"]],
            weights=np.array(numbers["weights"][:used]),
            pads=np.array(numbers["pads"], np.int8),
        )
        assert made == bytes(STORE.serialize_cdr(wanted, "rover_msgs/msg/Setpoint"))
    for name, beyond in (("mode", 3), ("frame", -1), ("used", 5)):
        was = {"mode": 0, "frame": 0, "used": 0}
        for other, number in was.items():
            write_value(memory, run, other, number)
        write_value(memory, run, name, beyond)
        assert composer.compose([ctypes.addressof(memory)], 0) is None
    assert composer.refused == 3


def test_type_hashes(run: Run) -> None:
    assert {t.type: t.type_hash for t in topics_of(run.machine)} == {
        name: STORE.hash_rihs01(name) for name in ("rover_msgs/msg/Status", "rover_msgs/msg/Setpoint")
    }


# ---- definitions -------------------------------------------------------------------------------------------------------------


def errors(config: Path) -> str:
    with pytest.raises(TwinError) as failed:
        build_config(config)
    return str(failed.value)


def test_stored_definitions(config: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any) -> None:
    """They build the same machine where the package is not installed; where it is, both must be equal."""
    without = source_hash(config)
    assert main(["interfaces", str(config)]) == 0
    stored = config.with_suffix(".interfaces.json")
    assert capsys.readouterr().out.strip() == str(stored)
    assert sorted(json.loads(stored.read_text())) == ["rover_msgs/Setpoint", "rover_msgs/Status", "rover_msgs/Wheel"]
    assert source_hash(config) == without
    monkeypatch.setenv("AMENT_PREFIX_PATH", BEFORE)
    assert source_hash(config) == without
    stored.rename(tmp_path / "away")
    text = errors(config)
    assert "E236" in text and "package `rover_msgs` is not installed" in text and "fcsl interfaces" in text
    (tmp_path / "away").rename(stored)
    changed = {**OWN, "rover_msgs/msg/Wheel": OWN["rover_msgs/msg/Wheel"].replace("int32 id", "int64 id # wider")}
    source(monkeypatch, install(tmp_path / "other", changed))
    text = errors(config)
    assert "stored definition of `rover_msgs/Wheel` is not the installed one: - int32 id; + int64 id" in text
    assert main(["interfaces", str(config)]) == 0
    assert source_hash(config) != without


def source_hash(config: Path) -> str:
    library, name = build_config(config)
    with_run = open_run(library, name)
    found = with_run.machine.source_hash
    with_run.close()
    return str(found)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("int32 a\nint32 a\n", "a second field of this name"),
        ("int33 a\n", "package `rover_msgs` has no message `int33`"),
        ("int32[0] a\n", "a length is a number from 1"),
        ("int32 Big\n", "lower-case letters"),
        ("int32 a 1.5\n", "`1.5` is not a int32"),
        ("float64<=3 a\n", "only strings have a length"),
        ("Wheel a\n", "contains itself"),
        ("wstring a\nint32 b\n", "a wstring"),
        ("float64[9000] a\n", "has 144017 bytes; channels carry 65536"),
        ("}{\n", "not a type and a name"),
        ("std_msgs/srv/Empty a\n", "not a type and a name"),
        ("\0\xff\n", "not a type and a name"),
    ],
)
def test_definitions_that_are_refused(config: Path, text: str, reason: str) -> None:
    folder = config.parents[1] / "ws/share/rover_msgs/msg"
    (folder / "Wheel.msg").write_text(text)
    found = errors(config)
    assert "E236" in found and reason in found


def test_a_definition_that_grows_without_bound(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    own = {f"deep_msgs/msg/L{i}": "".join(f"L{i + 1} m{j}\n" for j in range(20)) for i in range(15)}
    source(monkeypatch, install(tmp_path / "ws", own | {"deep_msgs/msg/L15": "int8 x\n"}))
    row = channels()[0]
    row["ros"] = {"type": "deep_msgs/L0", "field": "m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.m0.x"}
    assert "has more than 65536 fields" in errors(write(tmp_path / "machine", [row]))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("{", "cannot be read"),
        ("[1]", "is not what `fcsl interfaces` writes"),
        ('{"rover_msgs/Status": 3}', "is not what `fcsl interfaces` writes"),
        ('{"rover_msgs/Status": ["int32"]}', "the definition of `rover_msgs/Status` is not valid"),
        ('{"rover_msgs/Status": ["Wheel wheel"]}', "does not have `rover_msgs/Wheel`"),
    ],
)
def test_stored_files_that_are_refused(config: Path, text: str, reason: str) -> None:
    config.with_suffix(".interfaces.json").write_text(text)
    found = errors(config)
    assert "E236" in found and reason in found


def test_bulk_data_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    source(monkeypatch, install(tmp_path / "ws"))
    row = channels()[0]
    row["ros"] = {"type": "rover_msgs/Picture", "field": "width"}
    text = errors(write(tmp_path / "machine", [row]))
    assert "E236" in text and "`data`, an unbounded list of bytes: bulk data" in text and "let a node of yours" in text


@pytest.mark.parametrize(
    ("name", "ros", "code", "reason"),
    [
        ("status.phase", {"choices": None}, "E237", "list the strings that it may be in `choices`"),
        ("status.phase", {"choices": ["a", 3]}, "E258", "`phase` is a string"),
        ("setpoint.mode", {"choices": ["MODE_AUT"]}, "E258", "did you mean `MODE_AUTO`?"),
        ("setpoint.mode", {"choices": [300]}, "E258", "does not fit uint8"),
        ("setpoint.frame", {"choices": ["much too long"]}, "E258", "at most 8 characters"),
        ("setpoint.velocity", {"choices": [1, 2]}, "E258", "neither a string nor an integer"),
        ("status.left", {"field": "wheels[label=left].speed"}, "E237", "write wheels[name=…]"),
        ("status.left", {"field": "wheels[name=left].name"}, "E237", "is the key of its element"),
        ("status.left", {"field": "wheels.speed"}, "E237", "list of messages"),
        ("setpoint.used", {"field": "reserve.count"}, "E237", "without fields"),
    ],
)
def test_mappings_that_are_refused(config: Path, name: str, ros: dict[str, Any], code: str, reason: str) -> None:
    rows = channels()
    row = next(r for r in rows if r["name"] == name)
    row["ros"] = {key: v for key, v in {**row["ros"], **ros}.items() if v is not None}
    found = errors(write(config.parent, rows))
    assert code in found and reason in found


def test_a_length_without_its_list(config: Path) -> None:
    rows = [row for row in channels() if row["name"] != "setpoint.weights"]
    found = errors(write(config.parent, rows))
    assert "E241" in found and "map the whole list, too: `weights`" in found


def test_a_bounded_list_has_no_more(config: Path) -> None:
    (config.parent / "drive.py").write_text(ALGORITHM.replace("i32[3]", "i32[5]"))
    found = errors(config)
    assert "E238" in found and "has at most 4 elements" in found


# ---- bags --------------------------------------------------------------------------------------------------------------------


def test_a_bag_is_replayed_as_its_messages_are_taken_in_flight(config: Path, tmp_path: Path) -> None:
    start = 100 * 10**9
    parts = [("drive", [wheel("left", 2.0)], [1.0]), ("fly", [wheel("left", 4.0, 9), wheel("b", 1.0)], [1.0, 3.0])]
    with Writer(tmp_path / "bag", version=9) as writer:
        connection = writer.add_connection("/status", "rover_msgs/msg/Status", typestore=STORE)
        for i, (phase, wheels, ranges) in enumerate(parts):
            stamp = start + i * 10**8
            writer.write(connection, stamp, status(stamp, phase, wheels, ranges))
    (tmp_path / "map.yaml").write_text("channels: from machine")
    library, _ = build_config(config)
    done = replay_foreign(tmp_path / "bag", tmp_path / "map.yaml", library=str(library), output=tmp_path / "out")
    assert not done.unmapped
    assert columns(tmp_path / "out", "drive.inputs.ranges")[1].tolist()[-1][:3] == [1.0, 3.0, 0.0]
    assert columns(tmp_path / "out", "drive.inputs.phase")[1].tolist() == [1, 1]
    assert columns(tmp_path / "out", "drive.inputs.left_id")[1].tolist() == [0, 2]


def test_a_build_system_builds_again_when_a_definition_changes(config: Path, tmp_path: Path) -> None:
    assert main(["interfaces", str(config)]) == 0
    depfile = tmp_path / "rover.d"
    assert main(["build", "--c-only", str(config), "-o", str(tmp_path / "c"), "--depfile", str(depfile)]) == 0
    folder = config.parents[1] / "ws/share/rover_msgs/msg"
    needs = {*map(str, (config.with_suffix(".interfaces.json"), folder / "Wheel.msg", folder / "Status.msg"))}
    assert needs <= set(depfile.read_text().split()) and str(folder / "Picture.msg") not in depfile.read_text()


def test_a_library_is_older_than_its_definitions(config: Path, tmp_path: Path) -> None:
    assert main(["interfaces", str(config)]) == 0
    assert main(["build", str(config), "-o", str(tmp_path / "out")]) == 0
    open_run(tmp_path / "out/librover.so", "rover").close()
    stored = config.with_suffix(".interfaces.json")
    stored.write_text(stored.read_text().replace("int32 id", "int64 id"))
    with pytest.raises(TwinError, match=r"definitions .*rover\.interfaces\.json has changed"):
        open_run(tmp_path / "out/librover.so", "rover")
