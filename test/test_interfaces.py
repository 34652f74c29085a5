# SPDX-License-Identifier: Apache-2.0
"""A machine's ROS 2 interfaces: the same text and hash in rosidl, in bags and in the machine; the steps of a build."""

from __future__ import annotations

import json
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from mcap.reader import make_reader
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosidl_adapter.parser import parse_message_file

from fcsl_compiler.cli.main import main as fcslc
from simclient import AlgTwin

PACKAGE = Path(__file__).with_name("interfaces")
LIMIT_S = 600
INDEX = "share/ament_index/resource_index/fcsl_machines"
SEPARATOR = "=" * 80 + "\nMSG: "


def cmake(*arguments: object, status: int | None = 0) -> str:
    done = subprocess.run(["cmake", *map(str, arguments)], capture_output=True, text=True, timeout=LIMIT_S)
    output = done.stdout + done.stderr
    assert status is None or done.returncode == status, output[-6000:]
    return output


def configure(folder: Path, status: int = 0) -> str:
    prefix = f"-DCMAKE_INSTALL_PREFIX={folder / 'install'}"
    return cmake("-S", folder, "-B", folder / "build", prefix, "-DBUILD_TESTING=OFF", status=status)


def work_of_a_build(folder: Path, *options: str) -> list[str]:
    """The steps of a build, a line for each; none if everything was up to date."""
    output = cmake("--build", folder / "build", "--parallel", "2", *options)
    idle = re.compile(
        r"Built target|Consolidate compiler generated|ninja: |gmake\[?|^\s*$|^\[0/\d+\]|a step needs at most"
    )
    return [line for line in output.splitlines() if not idle.search(line)]


@pytest.fixture(scope="module")
def zoo(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The package of test/interfaces, built and installed as by colcon."""
    folder = tmp_path_factory.mktemp("zoo") / "zoo"
    shutil.copytree(PACKAGE, folder)
    configure(folder)
    cmake("--build", folder / "build", "--target", "install", "--parallel", "2")
    return folder


def installed(zoo: Path) -> dict[str, Path]:
    """The prefixes of all machines, such as "lander/lander_control": the workspace's and the zoo's."""
    prefixes = [*map(Path, os.environ["AMENT_PREFIX_PATH"].split(":")), zoo / "install"]
    return {e.name.replace("__", "/", 1): p for p in prefixes for e in (p / INDEX).glob("*__*")}


def share(zoo: Path, type_name: str) -> Path | None:
    """The installed file of "package/msg/Name", without its suffix; None if no package has it."""
    for prefix in (zoo / "install", *map(Path, os.environ["AMENT_PREFIX_PATH"].split(":"))):
        if (found := prefix / "share" / f"{type_name}.msg").is_file():
            return found.with_suffix("")
    return None


def sections(type_name: str, text: str) -> Iterator[tuple[str, str]]:
    """Message name and text of a definition and of its nested messages, as ros2msg separates them."""
    own, *held = text.split(SEPARATOR)
    yield type_name, own
    for part in held:
        name, _, body = part.partition("\n")
        yield "/msg/".join(name.replace("/msg/", "/").split("/")), body


def declarations(text: str) -> list[str]:
    """Fields and constants in order; comments are not part of the type."""
    lines = (" ".join(line.partition("#")[0].split()) for line in text.splitlines())
    return [re.sub(r"\s*=\s*", "=", line) for line in lines if line]


def hash_by_rosbags(type_name: str, text: str) -> str:
    store = get_typestore(Stores.ROS2_JAZZY)
    store.register({n: f for n, f in get_types_from_msg(text, type_name).items() if n not in store.fielddefs})
    return store.hash_rihs01(type_name)


def record_a_tick(zoo: Path, machine: str, bag: Path) -> tuple[AlgTwin, list[tuple[str, str, str]]]:
    """The machine, closed, and of each topic of its bag: type, schema, hash."""
    prefix = installed(zoo)[machine]
    library = prefix / (prefix / INDEX / machine.replace("/", "__")).read_text().strip()
    with AlgTwin.from_library(library, machine.split("/")[1]) as twin:
        twin.record(bag)
        twin.tick(3)
        twin.stop_recording()
    with next(bag.glob("*.mcap")).open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    schemas = summary.schemas
    topics = [
        (schemas[c.schema_id].name, schemas[c.schema_id].data.decode(), c.metadata["topic_type_hash"])
        for c in summary.channels.values()
    ]
    return twin, topics


MACHINES = [
    "lander/lander_control",
    "ahrs/ahrs",
    "arming/arming",
    "thermal_guard/thermal_guard",
    "minimal/minimal",
    "rover/rover",
    "zoo/rover",
    "zoo/probe",
]


#: Their packages generate no messages.
WITHOUT_MESSAGES = [
    "glider/glider",
    "inverted_pendulum/inverted_pendulum",
    "quadrotor/quadrotor",
    "rocket_landing/rocket_landing",
    "satellite/satellite",
]


def test_no_machine_is_forgotten(zoo: Path) -> None:
    assert set(installed(zoo)) == {*MACHINES, *WITHOUT_MESSAGES}


@pytest.mark.parametrize("machine", MACHINES)
def test_one_text_and_one_hash(zoo: Path, tmp_path: Path, machine: str) -> None:
    twin, topics = record_a_tick(zoo, machine, tmp_path / "bag")
    texts = {i.message_type: i.message_text for i in twin.instances()}
    published = {i.message_type for i in twin.instances() if i.published}
    assert texts.keys() <= {name for name, _, _ in topics}
    for name, schema, type_hash in topics:
        file = share(zoo, name)
        if name in texts:
            assert schema.startswith(texts[name]), "the bag has another text than the machine's descriptor"
            assert (file is not None) == (name in published), name
        if file is None:  # not published: it occurs in bags only
            assert type_hash == hash_by_rosbags(name, schema)
            continue
        described = json.loads(file.with_suffix(".json").read_text())
        hashes = {entry["type_name"]: entry["hash_string"] for entry in described["type_hashes"]}
        assert type_hash == hashes[name] == hash_by_rosbags(name, schema)
        for held, text in sections(name, schema):
            other = share(zoo, held)
            assert other is not None, held
            assert declarations(text) == declarations(other.with_suffix(".msg").read_text()), held
            if held.partition("/")[0] == machine.partition("/")[0]:
                assert text == other.with_suffix(".msg").read_text()


def test_fcslc_writes_what_rosidl_builds(zoo: Path, tmp_path: Path) -> None:
    machines = [str(PACKAGE / "rover.json"), str(PACKAGE / "probe.json")]
    assert fcslc(["messages", *machines, "-o", str(tmp_path / "msg"), "--package", "zoo"]) == 0
    ours = {file.name: file.read_text() for file in (tmp_path / "msg").iterdir()}
    theirs = {file.name: file.read_text() for file in (zoo / "install/share/zoo/msg").glob("*.msg")}
    names = ("RoverTrack", "RoverSideScale", "RoverTarget", "RoverPose", "ProbeMixed", "ProbeQuiet")
    assert ours.keys() == {f"{name}.msg" for name in names}
    assert ours.items() <= theirs.items() and theirs.keys() - ours.keys() == {"Note.msg"}
    assert "RoverTarget[4] targets # 2 x 2, row-major; row-major in the message\n" in ours["RoverTrack.msg"]
    assert "float32[6] ratio # [1/s] 2 x 3, row-major; rows, columns\n" in ours["ProbeMixed.msg"]
    assert "uint8[4] modes # Health; 2 x 2, row-major; rows, columns\n" in ours["ProbeMixed.msg"]
    assert "uint8 mode # Health\nint32[3] wishes # TransitionRequest\n" in ours["RoverTarget.msg"]
    parsed = parse_message_file("zoo", str(tmp_path / "msg/ProbeMixed.msg"))
    units = {f.name: f.annotations["unit"] for f in parsed.fields if "unit" in f.annotations}
    assert units == {"wide": "Pa", "ratio": "1/s", "cube": "m/s^2"}


#: Runs in a separate process, whose environment has the new package.
CHECK = """
import dataclasses, random, struct
from rclpy.serialization import deserialize_message, serialize_message
from fcsl_bridge.errors import BridgeError
from fcsl_bridge.topics.interfaces import instance_class
from fcsl_bridge.base.machine_index import find_machine
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from simclient import AlgTwin
from simclient.ros.cdr import fixed_layout
from zoo.msg import Note, RoverPose
from zoo.srv import Ask

HEALTHS = ["nominal", "degraded", "failed", "stale"]
note = deserialize_message(serialize_message(Note(pose=RoverPose(level=-3), text="x")), Note)
assert note.pose.level == -3 and Ask.Response(answer=note).answer.text == "x"

def same_but_padding(message, data, layout):
    theirs = serialize_message(message)
    assert len(theirs) == len(data)  # what they leave in the padding is whatever was there
    for leaf in layout.leaves.values():
        at = slice(leaf.offset, leaf.offset + leaf.dtype.itemsize)
        assert theirs[at] == data[at], leaf

def opened(machine, at):
    library, name = find_machine(machine)
    twin = AlgTwin.from_library(library, name)
    instance = twin.instances()[at]
    store = get_typestore(Stores.ROS2_JAZZY)
    types = get_types_from_msg(instance.message_text, instance.message_type)
    store.register({n: f for n, f in types.items() if n not in store.fielddefs})
    return twin, instance, instance_class(instance), fixed_layout(store.fielddefs, instance.message_type)

twin, track, kind, layout = opened("zoo/rover", 0)
with twin:
    assert len(layout.leaves) == 3 + 4 * 9 + 4 + 2 and layout.size == len(twin._run.message(0))
    for seed in range(20):
        r = random.Random(seed)
        pose = lambda: {"valid": r.random() < 0.5, "position": [r.gauss(0, 1e3) for _ in range(3)],
                        "attitude": [r.randrange(-8, 8) / 8 for _ in range(4)], "level": r.randrange(-9, 9)}
        word = lambda: r.choice(["", "tr_HOLD", "tr_GoOn"])
        target = lambda: {"id": r.randrange(2**32), "pose": pose(), "alive": r.random() < 0.5, "weight": r.random(),
                          "mode": r.choice(HEALTHS), "wishes": [word() for _ in range(3)]}
        twin.set("track.outputs.targets", [[target(), target()], [target(), target()]])
        twin.set("track.outputs.pose", pose())
        twin.set("track.outputs.alive", r.random() < 0.5)
        twin.tick()
        data = twin._run.message(0)
        message = deserialize_message(data, kind)
        assert message.tick == seed and message.header.stamp.nanosec == seed * 10_000_000
        assert [t.id for t in message.targets] == [t["id"] for row in twin.get_value("track.outputs.targets") for t in row]
        for got, path in ((message.pose, "pose"), (message.targets[3].pose, "targets[1][1].pose")):
            want = twin.get_value(f"track.outputs.{path}")
            assert (got.valid, list(got.position), list(got.attitude), got.level) == tuple(want.values())
        assert message.targets[2].weight == twin.get_value("track.outputs.targets[1][0].weight")
        assert message.alive == twin.get_value("track.outputs.alive")
        kind_of, rows = type(message.targets[0]), twin.get_value("track.outputs.targets")
        requests = {"": kind_of.TR_NONE, "tr_HOLD": kind_of.TR_HOLD, "tr_GoOn": kind_of.TR_GO_ON}
        for got, want in zip(message.targets, [*rows[0], *rows[1]], strict=True):
            assert got.mode == getattr(kind_of, want["mode"].upper()), want
            assert got.wishes.tolist() == [requests[wish] for wish in want["wishes"]], want
        same_but_padding(message, data, layout)
changed = dataclasses.replace(track, message_text=track.message_text.replace("int32 level", "int64 level"))
try:
    instance_class(changed)
except BridgeError as error:
    assert "message zoo/msg/RoverPose of package `zoo` is not the one" in str(error), error
else:
    raise AssertionError("a struct of another build was accepted")

twin, mixed, kind, layout = opened("zoo/probe", 0)
with twin:
    r = random.Random(1)
    flat = lambda v: [x for e in v for x in flat(e)] if isinstance(v, (list, tuple)) else [v]
    single = lambda x: struct.unpack("<f", struct.pack("<f", x))[0]
    requests = []
    for tick in range(12):
        twin.set("mixed.outputs.counts", [r.randrange(-2**31, 2**31) for _ in range(5)])
        twin.set("mixed.outputs.wide", r.randrange(-2**63, 2**63))
        twin.set("mixed.outputs.modes", [[r.choice(HEALTHS) for _ in range(2)] for _ in range(2)])
        twin.set("mixed.outputs.after", r.choice(["", "tr_STOP_NOW", "tr_GoOn"]))
        twin.set("mixed.outputs.mask", r.randrange(2**32))
        twin.set("mixed.outputs.ratio", [[single(r.gauss(0, 1)) for _ in range(3)] for _ in range(2)])
        twin.set("mixed.outputs.cube", [[[r.gauss(0, 1) for _ in range(4)] for _ in range(3)] for _ in range(2)])
        twin.tick()
        data = twin._run.message(0)
        message = deserialize_message(data, kind)
        for name in ("flag", "wide", "mask", "big"):
            assert getattr(message, name) == twin.get_value(f"mixed.outputs.{name}"), name
        for name in ("counts", "ratio", "cube"):
            assert list(getattr(message, name)) == flat(twin.get_value(f"mixed.outputs.{name}")), name
        assert [HEALTHS[n] for n in message.modes] == flat(twin.get_value("mixed.outputs.modes"))
        after = {"": kind.TR_NONE, "tr_STOP_NOW": kind.TR_STOP_NOW, "tr_GoOn": kind.TR_GO_ON}
        assert message.after == after[twin.get_value("mixed.outputs.after")]
        requests.append(message.transition_request)
        same_but_padding(message, data, layout)
    assert [t for t in requests if t] == [kind.TR_STOP_NOW, kind.TR_GO_ON] and requests[6]
print("same bytes")
"""


def test_rosidl_reads_and_writes_the_same_bytes(zoo: Path) -> None:
    prefix = zoo / "install"
    python = next(prefix.glob("l*/python3*/*-packages"))
    env = os.environ | {
        "AMENT_PREFIX_PATH": f"{prefix}:{os.environ['AMENT_PREFIX_PATH']}",
        "PYTHONPATH": f"{python}:{os.environ.get('PYTHONPATH', '')}",
        "LD_LIBRARY_PATH": f"{prefix / 'lib'}:{os.environ.get('LD_LIBRARY_PATH', '')}",
    }
    done = subprocess.run([sys.executable, "-c", CHECK], capture_output=True, text=True, env=env, timeout=LIMIT_S)
    assert (done.returncode, done.stdout) == (0, "same bytes\n"), done.stderr


# ---- what a build does ---------------------------------------------------------------------------------------------


def msg_times(zoo: Path) -> dict[str, int]:
    return {file.name: file.stat().st_mtime_ns for file in (zoo / "build/fcsl_messages/msg").glob("*.msg")}


def generated_times(zoo: Path) -> dict[str, int]:
    """Of what the generator of C wrote."""
    return {f.name: f.stat().st_mtime_ns for f in (zoo / "build/rosidl_generator_c/zoo/msg").rglob("*.[ch]")}


def edit(file: Path, old: str, new: str) -> None:
    assert old in file.read_text()
    file.write_text(file.read_text().replace(old, new))


@pytest.fixture
def editable(zoo: Path) -> Iterator[Path]:
    """The same package. Its sources are as before afterwards: other tests open its machines, which compare them."""
    files = [file for file in zoo.rglob("*") if file.suffix in (".py", ".json") and zoo / "build" not in file.parents]
    before = {file: file.read_bytes() for file in files if zoo / "install" not in file.parents}
    yield zoo
    for file, content in before.items():
        file.write_bytes(content)


def test_the_steps_of_a_build(editable: Path) -> None:
    """One test, since each build begins where the one before it ended."""
    zoo = editable
    assert work_of_a_build(zoo) == [], "an untouched package; not even what ament does in every build of its Python"

    before = msg_times(zoo)
    edit(zoo / "algorithms/mixed.py", "self.big += 1", "self.big += 2")
    edit(zoo / "probe.json", '"description": "', '"description": "Changed. ')
    work = work_of_a_build(zoo)
    assert any("probe.c" in line for line in work)
    assert not [line for line in work if "rosidl" in line and not line.startswith("-- ")], "no message has changed"
    assert msg_times(zoo) == before
    assert work_of_a_build(zoo) == []

    # A changed message is written alone. rosidl also regenerates its package; the test waits for two of its generators.
    c_before = generated_times(zoo)
    edit(zoo / "algorithms/quiet.py", "    def execute", '    outputs = {"level": "f64 m"}\n\n    def execute')
    work_of_a_build(zoo, "--target", "zoo__rosidl_generator_type_description")
    after = msg_times(zoo)
    assert {name for name in after if after[name] != before[name]} == {"ProbeQuiet.msg"}
    text = (zoo / "build/fcsl_messages/msg/ProbeQuiet.msg").read_text()
    described = json.loads((zoo / "build/rosidl_generator_type_description/zoo/msg/ProbeQuiet.json").read_text())
    assert described["type_hashes"][0]["hash_string"] == hash_by_rosbags("zoo/msg/ProbeQuiet", text)

    work = work_of_a_build(zoo, "--target", "zoo__rosidl_generator_c")
    c_after = generated_times(zoo)
    changed = {name for name in c_after if c_after[name] != c_before.get(name)}
    assert "probe_quiet__struct.h" in changed and {name[:13] for name in changed} == {"probe_quiet__"}
    compiled = [line for line in work if "Building C object" in line]
    assert compiled and not [line for line in compiled if "/probe_quiet__" not in line], "only what has changed"
    work = work_of_a_build(zoo, "--target", "zoo__rosidl_generator_c")
    assert not [line for line in work if "Building" in line]


# ---- what is refused -----------------------------------------------------------------------------------------------

MISUSES = {
    "a list of machines": (
        ("fcsl_generate_interfaces(", "fcsl_generate_interfaces(rover.json "),
        "it uses the machines of fcsl_add_machine()",
    ),
    "twice": (
        ("ament_export", "fcsl_generate_interfaces()\nament_export"),
        "is called twice: rosidl runs once in a package",
    ),
    "no machine": (("fcsl_add_machine", "# "), "comes before any machine: move it after the last fcsl_add_machine()"),
    "a machine too late": (
        ("ament_package()", "fcsl_add_machine(late ${CMAKE_CURRENT_LIST_DIR}/late.json)\nament_package()"),
        "fcsl_add_machine(late …) comes after fcsl_generate_interfaces()",
    ),
    "too late": (
        ("fcsl_generate_interfaces(", "ament_package()\nfcsl_generate_interfaces("),
        "comes after ament_package(): move it before ament_package()",
    ),
    "no generators": (
        ("find_package(rosidl_default_generators REQUIRED)", ""),
        "write find_package(rosidl_default_generators REQUIRED) before it",
    ),
    "no std_msgs": (
        ("find_package(std_msgs REQUIRED)", "set(std_msgs_FOUND FALSE)"),
        "write find_package(std_msgs REQUIRED) before it",
    ),
    "a dependency not found": (
        ("find_package(geometry_msgs REQUIRED)", ""),
        "write find_package(geometry_msgs REQUIRED)",
    ),
    "not in the group": (
        ("<member_of_group>rosidl_interface_packages</member_of_group>", ""),
        "<member_of_group>rosidl_interface_packages</member_of_group>",
    ),
    "a name that a machine has": (("msg/Note.msg", "msg/RoverPose.msg"), "has the name of a machine's message"),
    "another package's machine": (("rover.json probe.json", "../other/rover.json"), "is in package `other`"),
    "a wrong machine": (("rover.json probe.json", "wrong.json"), "its diagnostics are above"),
}


def prepare(folder: Path, old: str, new: str) -> None:
    """A copy of the package with one change, beside a package of another name."""
    shutil.copytree(PACKAGE, folder)
    (folder / "wrong.json").write_text("{}")
    shutil.copy(folder / "rover.json", folder / "late.json")
    other = folder.parent / "other"
    shutil.copytree(PACKAGE, other)
    edit(other / "package.xml", "<name>zoo", "<name>other")
    edit(folder / ("package.xml" if old.startswith("<") else "CMakeLists.txt"), old, new)


@pytest.mark.parametrize("case", MISUSES)
def test_misuse_is_told(tmp_path: Path, case: str) -> None:
    change, message = MISUSES[case]
    prepare(tmp_path / "zoo", *change)
    output = configure(tmp_path / "zoo", status=1)
    assert "CMake Error" in output and message in " ".join(output.split()), output[-3000:]


def test_two_machines_cannot_have_one_message(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, instance in (("a", "b_c"), ("a_b", "c")):
        machine = (PACKAGE / "probe.json").read_text().replace('"mixed": {"algorithm"', f'"{instance}": {{"algorithm"')
        (tmp_path / f"{name}.json").write_text(machine.replace('{"mixed": 1000', f'{{"{instance}": 1000'))
    shutil.copytree(PACKAGE / "algorithms", tmp_path / "algorithms")
    assert fcslc(["messages", str(tmp_path / "a.json"), str(tmp_path / "a_b.json"), "-o", str(tmp_path / "msg")]) == 2
    assert "message `ABC` also belongs to another machine" in capsys.readouterr().err


def test_nothing_published(tmp_path: Path) -> None:
    """A package without any message: rosidl, which rejects that, is not called."""
    folder = tmp_path / "zoo"
    prepare(folder, "rover.json probe.json STRICT", "rover.json STRICT")
    edit(folder / "CMakeLists.txt", "fcsl_generate_interfaces(MSGS msg/Note.msg SRVS srv/Ask.srv DEPENDENCIES geometry_msgs)",
         "fcsl_generate_interfaces()")  # fmt: skip
    edit(folder / "rover.json", '"publish": ["track", "side"]', '"publish": []')
    configure(folder)
    cmake("--build", folder / "build", "--target", "install")
    assert (folder / "install/lib/zoo/libzoo_machines.so").is_file()
    assert not (folder / "install/share/zoo/msg").exists()
