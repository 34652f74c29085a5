# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema of a machine agrees with the compiler: the same keys, and no stricter rules."""

import copy
import itertools
import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.packages import package_share
from fcsl_compiler.base.source import MAX_NAME
from fcsl_compiler.cli.main import main
from fcsl_compiler.cli.scaffold import algorithm_files, machine_files
from fcsl_compiler.cli.verbs import MACHINE_SCHEMA
from fcsl_compiler.config import views
from fcsl_compiler.config.arming import MAX_TIMEOUT_S
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model.machine import CHANNEL_SOURCES, MACHINE_SOURCES
from fcsl_compiler.model.types import HEALTH_NAMES
from fcsl_compiler.parse.json_reader import ConfigReader, is_name
from fcsl_compiler.parse.parts import MAX_TICK_HZ, RESERVED_INSTANCES

ROOT = Path(__file__).parents[2]
MACHINES = [
    *(p for p in sorted((ROOT / "examples").rglob("*.json")) if "states" in json.loads(p.read_text())),
    ROOT / "fcsl_compiler/test/golden/small.json",
]
TEXT = json.loads(MACHINE_SCHEMA.read_text())
VALIDATOR = jsonschema.Draft202012Validator(TEXT)

SENSOR = """class Sensor:
    inputs = {"dt": "f64 s", "heard": "bool", "offset": "f64[2]", "raw": "f64"}
    outputs = {
        "rate": "f64[2]",
        "spin": "f64[3] rad/s",
        "pose": "Pose",
        "word": "f64",
        "q": "f64[4]",
        "transition_request": "TransitionRequest",
    }
    parameters = {"gain": "f64", "on": "bool", "where": "Pose", "done": "TransitionRequest", "rows": "f64[2][2]"}
    def execute(self):
        self.word = self.raw * self.gain + self.rows[1][0]
        self.pose = self.where
        self.transition_request = "GO" if self.on else self.done
"""
LAW = """class Force:
    inputs = {"rate": "f64[2]", "at": "f64[3] m", "nav_health": "Health"}
    outputs = {"force": "f64", "armed": "bool"}
    def execute(self):
        self.force = self.rate[0]
        self.armed = True
"""
#: Every existing key at least once.
RICH: dict[str, Any] = {
    "$schema": "machine.schema.json",
    "description": "everything",
    "tick_hz": 100,
    "initial_state": "A",
    "structs": {"Pose": {"at": "f64[3] m", "valid": "bool"}},
    "algorithms": {"Sensor": {"source": "sensor.py"}, "law": {"source": "law.py", "class": "Force"}},
    "instances": {
        "sensor": {
            "algorithm": "Sensor",
            "parameters": {
                "gain": 1.5,
                "on": True,
                "where": {"at": [0, 1, 2.5], "valid": False},
                "done": "STOP",
                "rows": [[1, 2], [3, 4]],
            },
            "inputs": {"offset": [0, 0.5]},
            "max_wcet_us": 200,
            "frozen": ["gain"],
        },
        "law": {"algorithm": "law", "inputs": {"nav_health": "nominal"}, "frozen": True},
    },
    "connections": [
        {"from": "machine.dt", "to": "sensor.dt"},
        {"from": "channels.imu.rate.fresh", "to": "sensor.heard"},
        {"from": "sensor.rate", "to": "law.rate", "delayed": True, "initial": [0, 0]},
        {"from": "sensor.pose.at", "to": "law.at", "delayed": False},
    ],
    "always": {"law": {"hz": 50, "phase": 1}},
    "states": {
        "A": {"schedule": {"sensor": 100}, "description": "flying"},
        "B": {"schedule": {"sensor": {"every": 300}}},
        "C": {},
    },
    "transitions": [
        {"from": "A", "to": "B", "request": "GO", "priority": 1, "description": "the usual way"},
        {"from": ["A", "B"], "to": "C", "request": "STOP", "priority": 2},
        {"from": "*", "to": "A", "health": {"instance": "sensor", "in": ["failed", "stale"]}, "priority": -1},
        {"from": "A", "to": "C", "after_s": 0.25, "priority": 0},
    ],
    "requests": ["HOME"],
    "publish": ["sensor"],
    "targets": {"simulation": {"sources": ["c/stub.c", "c/board.nim"], "include": ["c"], "libraries": ["m"]}},
    "channels": [
        {
            "name": "imu.rate",
            "id": 1,
            "field": "sensor.outputs.rate",
            "direction": "sensor",
            "max_age_ticks": 5,
        },
        {
            "name": "imu.spin",
            "id": 4,
            "field": "sensor.outputs.spin",
            "direction": "sensor",
            "ros": {"type": "sensor_msgs/Imu", "field": "angular_velocity", "frame": "imu", "axes": "frd"},
        },
        {
            "name": "raw",
            "id": 3,
            "field": "sensor.inputs.raw",
            "direction": "sensor",
            "ros": {
                "type": "nav_msgs/Odometry",
                "field": "twist.twist.linear.x",
                "topic": "wheel/odom",
                "frame": "odom",
                "child_frame": "base_link",
            },
        },
        {"name": "force", "id": 2, "field": "law.outputs.force", "direction": "actuator", "safe": 0.5},
    ],
    "arm": "law.armed",
    "command_timeout_s": 0.1,
    "views": {
        "panels": [
            {
                "title": "place",
                "truth": ["sensor.outputs.pose.at"],
                "measured": ["law.inputs.at[0]"],
                "estimate": ["sensor.outputs.rate"],
                "command": ["sensor.parameters.gain"],
                "values": [],
            },
            {"title": "attitude", "angles": True, "estimate": ["sensor.outputs.q"]},
        ],
        "body": {
            "shape": "mesh",
            "mesh": "craft.stl",
            "size": 0.5,
            "position": [0, "sensor.outputs.word", 1.5],
            "attitude": "sensor.outputs.q",
            "thrust": "law.outputs.force",
            "up": "-z",
        },
    },
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "sensor.py").write_text(SENSOR)
    (tmp_path / "law.py").write_text(LAW)
    (tmp_path / "craft.stl").write_text("solid\n")
    (tmp_path / "c").mkdir()
    (tmp_path / "c" / "stub.c").write_text("/* no extern is called */\n")
    (tmp_path / "c" / "board.nim").write_text("# no extern is called\n")
    return tmp_path


def accepted(folder: Path, config: Any) -> bool:
    """Whether the compiler reports no error."""
    path = folder / "craft.json"
    path.write_text(json.dumps(config))
    try:
        compile_machine(path, "", until="schedule")
    except DiagnosticError:
        return False
    return True


def test_it_is_a_schema_and_installed(capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(TEXT)
    assert (package_share("fcsl_compiler") / "machine.schema.json").read_text() == MACHINE_SCHEMA.read_text()
    assert main(["schema"]) == 0 and capsys.readouterr().out == MACHINE_SCHEMA.read_text()


@pytest.mark.parametrize("path", MACHINES, ids=lambda p: p.stem)
def test_every_machine_validates(path: Path) -> None:
    VALIDATOR.validate(json.loads(path.read_text()))


def test_what_fcslc_new_writes_validates() -> None:
    for files in (machine_files("craft", True), algorithm_files("limiter")):
        written = [json.loads(t) for p, t in files.items() if p.suffix == ".json" and "schema" not in p.name]
        machines = [j for j in written if "tick_hz" in j]
        assert len(machines) == 1
        VALIDATOR.validate(machines[0])
    schema = next(t for p, t in machine_files("craft", False).items() if p.name == "machine.schema.json")
    assert schema == MACHINE_SCHEMA.read_text()


def test_the_rich_machine_is_good(folder: Path) -> None:
    VALIDATOR.validate(RICH)
    assert accepted(folder, RICH)


#: Names of objects in the reader, and their places in the schema.
OBJECTS = {
    "a machine": (),
    r"algorithm `\w+`": ("$defs", "algorithm"),
    r"instance `\w+`": ("$defs", "instance"),
    "a connection": ("$defs", "connection"),
    r"state `\w+`": ("$defs", "state"),
    "a rate": ("$defs", "rate", "then"),
    "a transition": ("$defs", "transition"),
    "`health`": ("$defs", "guard"),
    "a channel": ("$defs", "channel"),
    "`ros`": ("$defs", "ros"),
    r"target `\w+`": ("$defs", "target"),
    "`views`": ("$defs", "views"),
    "a panel": ("$defs", "panel"),
    "`body`": ("$defs", "body"),
}


def agree(text: Any, objects: Mapping[str, Sequence[str]], keys: dict[str, tuple[set[str], set[str]]]) -> None:
    """`keys`: known and required ones of each object that the reader read; `objects`: its place in the schema."""
    assert set(keys) == set(objects)
    for kind, steps in objects.items():
        place = text
        for step in steps:
            place = place[step]
        known, required = keys[kind]
        assert place["additionalProperties"] is False
        assert set(place["properties"]) == known, kind
        assert set(place.get("required", ())) == required, kind


def test_schema_and_reader_have_the_same_keys(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys: dict[str, tuple[set[str], set[str]]] = {}
    original = ConfigReader.object

    def record(self: ConfigReader, node: Any, what: str, required: Any, optional: Any = (), *rest: Any) -> Any:
        kind = next((k for k in OBJECTS if re.fullmatch(k, what)), None)
        if kind is not None:
            known, always = keys.setdefault(kind, (set(), set(required)))
            known.update(required, optional)
            always &= set(required)
        else:
            assert "Pose" in what, f"the schema's place for {what} is not listed in OBJECTS"
        return original(self, node, what, required, optional, *rest)

    monkeypatch.setattr(ConfigReader, "object", record)
    assert accepted(folder, RICH)
    agree(TEXT, OBJECTS, keys)


def test_words_and_limits_are_the_compilers() -> None:
    defs, top = TEXT["$defs"], TEXT["properties"]
    for word in ("a", "A1_b2", "a__b", "_a", "a_", "1a", "", "ä", "a b", "a\n", "a" * MAX_NAME, "a" * (MAX_NAME + 1)):
        valid = jsonschema.Draft202012Validator(defs["name"]).is_valid(word)
        assert valid == is_name(word) or word.endswith("\n"), word  # Python's $ also matches before a final newline
    assert defs["channel"]["properties"]["name"]["maxLength"] == MAX_NAME
    assert top["instances"]["propertyNames"]["allOf"][1]["not"]["enum"] == list(RESERVED_INSTANCES)
    assert defs["guard"]["properties"]["in"]["items"]["enum"] == list(HEALTH_NAMES)
    sources = defs["connection"]["properties"]["from"]["anyOf"]
    assert sources[0]["enum"] == [f"machine.{n}" for n in MACHINE_SOURCES]
    assert sources[1]["pattern"].endswith(f"({'|'.join(CHANNEL_SOURCES)})$")
    panel, body = defs["panel"]["properties"], defs["body"]["properties"]
    assert {name for name, place in panel.items() if place.get("$ref") == "#/$defs/curves"} == set(views.ROLES)
    assert (panel["title"]["maxLength"], body["shape"]["enum"]) == (views.MAX_TITLE, list(views.SHAPES))
    assert defs["views"]["properties"]["panels"]["maxItems"] == views.MAX_PANELS
    assert body["mesh"]["allOf"][1]["pattern"] == f"\\.({'|'.join(s[1:] for s in views.MESH_SUFFIXES)})$"
    assert top["command_timeout_s"]["maximum"] == MAX_TIMEOUT_S
    assert top["tick_hz"]["maximum"] == defs["hz"]["maximum"] == MAX_TICK_HZ


def test_every_key_is_described() -> None:
    def walk(place: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(place, dict):
            yield from place.get("properties", {}).items()
            for keyword, part in place.items():
                if keyword not in ("if", "else"):  # conditions on objects described elsewhere
                    yield from walk(part)

    found = [(k, v) for k, v in walk(TEXT) if "pattern" not in v or len(v) > 1]
    for key, place in found:
        target = TEXT["$defs"][place["$ref"].split("/")[-1]] if "$ref" in place else place
        assert place.get("description") or target.get("description") or place == {"const": place.get("const")}, key


# ---- what the schema rejects, the compiler rejects -----------------------------------------------------------------

#: FCSL_VERIFY=1 tries all.
EVERY = 5 if os.environ.get("FCSL_VERIFY", "") in ("", "0") else 1
REPLACEMENTS: tuple[Any, ...] = (None, True, -1, 1.5, "", "../x y", "none", "*", [], {"a": 1})


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    if isinstance(node, dict | list):
        for key in node if isinstance(node, dict) else range(len(node)):
            yield from places(node[key], (*path, key))


def mutants(config: Any) -> Iterator[tuple[str, Any]]:
    """Every value replaced, every member removed, every object with one additional key: one in five of these, to save time,
    or all. Five and 12, the changes at a place, have no common divisor, so every change is made somewhere."""
    changes = ((path, change) for path in places(config) for change in ("remove", "add", *REPLACEMENTS))
    for path, change in itertools.islice(changes, 0, None, EVERY):
        copied = copy.deepcopy(config)
        at = copied
        for step in path[:-1]:
            at = at[step]
        if change == "add":
            inner = at[path[-1]] if path else copied
            if not isinstance(inner, dict):
                continue
            inner["surplus key"] = 1
        elif not path:
            continue
        elif change == "remove":
            del at[path[-1]]
        else:
            at[path[-1]] = change
        yield f"{'/'.join(map(str, path))}: {change!r}", copied


def test_what_the_schema_rejects_the_compiler_rejects(folder: Path) -> None:
    rejected = [(what, config) for what, config in mutants(RICH) if not VALIDATOR.is_valid(config)]
    assert len(rejected) > 900 // EVERY
    wrong = [what for what, config in rejected if accepted(folder, config)]
    assert not wrong, f"{len(wrong)} of {len(rejected)}, such as {wrong[:20]}"
