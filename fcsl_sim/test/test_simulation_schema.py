# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema of a simulation agrees with the front end: the same keys and words, and no stricter rules."""

import copy
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from conftest import RAMP

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.base.packages import package_share
from fcsl_compiler.cli.fcsl import main
from fcsl_compiler.cli.scaffold import machine_files
from fcsl_compiler.parse.json_reader import ConfigReader
from fcsl_sim import SimError, load
from fcsl_sim.integrators import MAX_HZ, METHODS
from fcsl_sim.verbs import SIMULATION_SCHEMA
from fcsl_sim.wiring import MAX_SECONDS

ROOT = Path(__file__).resolve().parents[2]
#: The repository's; those of builds are links to them.
SIMULATIONS = [
    *sorted((ROOT / "examples").rglob("*.sim.json")),
    *sorted((ROOT / "scripts/interop").rglob("*.sim.json")),
]
TEXT = json.loads(SIMULATION_SCHEMA.read_text())
MACHINE = json.loads((package_share("fcsl_compiler") / "machine.schema.json").read_text())
VALIDATOR = jsonschema.Draft202012Validator(TEXT)
#: Parts of the machine's schema, word for word.
OF_MACHINES = ("name", "path", "views", "frame", "frame_id", "panel", "curves", "shown", "body")
#: Every key at least once, but for `axes`, which needs a vector.
RICH: dict[str, Any] = copy.deepcopy(RAMP) | {
    "$schema": "simulation.schema.json",
    "description": "everything",
    "integrator": {"method": "rk45", "rtol": 1e-9, "atol": 1e-9, "max_step_s": 0.1, "min_step_s": 1e-9},
    "rates": {"altimeter": 100, "velocimeter": {"hz": 50, "phase_s": 0.005}, "line": 1000},
    "events": [{"at_s": 0.5, "set": "altimeter.parameters.bias", "value": 1.0}],
    "until": {"condition": "ramp.outputs.x > 5.0", "for_s": 0.1},
    "ros": [
        {
            "output": "ramp.outputs.x",
            "type": "nav_msgs/Odometry",
            "field": "pose.pose.position.x",
            "topic": "odom",
            "frame": "map",
            "child_frame": "base_link",
        }
    ],
    "views": {"panels": [{"title": "x", "truth": ["ramp.outputs.x"]}]},
}
RICH["controller"]["link"] = "line"
RICH["connections"][2]["first_sample_s"] = 0.25
RICH["models"]["serial_link"] = {"source": "package://fcsl_sim/models/serial_link.c"}
RICH["instances"]["ramp"] |= {"integrator": {"method": "rk45", "atol": 1e-6}, "tolerances": {"state.x": 1e-6}}
RICH["instances"]["line"] = {
    "model": "serial_link",
    "parameters": {
        "reliable": True,
        "halts": True,
        "drop_percent": 0.0,
        "corrupt_percent": 0.0,
        "bit_error_percent": 0.0,
        "delay_s": 0.0,
        "baud": 0.0,
        "retransmit_ticks": 3,
    },
}
#: Names of objects in the reader, and their places in the schema.
OBJECTS = {
    "`controller`": "controller",
    "`integrator`": "integrator",
    r"model `\w+`": "model",
    r"instance `\w+`": "instance",
    "a connection": "connection",
    "a rate": "rate",
    "an event": "event",
    "`until`": "until",
    "a mapping of truth": "truth",
}
Accepted = Callable[[Any], bool]


@pytest.fixture
def accepted(write_sim: Callable[..., Path], hopper: tuple[Path, str]) -> Accepted:
    path = write_sim()

    def loads(config: Any) -> bool:
        path.write_text(json.dumps(config))
        try:
            load(path, machine=hopper)
        except (DiagnosticError, SimError):
            return False
        return True

    return loads


def test_it_is_a_schema_and_installed(capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(TEXT)
    assert main(["schema", "simulation"]) == 0 and capsys.readouterr().out == SIMULATION_SCHEMA.read_text()
    assert (package_share("fcsl_sim") / "simulation.schema.json").read_text() == SIMULATION_SCHEMA.read_text()


@pytest.mark.parametrize("path", SIMULATIONS, ids=lambda p: p.name)
def test_every_simulation_validates(path: Path) -> None:
    VALIDATOR.validate(json.loads(path.read_text()))


def test_what_fcslc_new_writes_validates() -> None:
    (text,) = [t for p, t in machine_files("craft", True).items() if p.name.endswith(".sim.json")]
    VALIDATOR.validate(json.loads(text))


def test_the_rich_simulation_is_good(accepted: Accepted) -> None:
    VALIDATOR.validate(RICH)
    assert accepted(RICH)


def test_schema_and_reader_have_the_same_keys(accepted: Accepted, monkeypatch: pytest.MonkeyPatch) -> None:
    keys: dict[str, tuple[set[str], set[str]]] = {}
    original = ConfigReader.object

    def record(self: ConfigReader, node: Any, what: str, required: Any, optional: Any = (), *rest: Any) -> Any:
        keys[next((k for k in OBJECTS if re.fullmatch(k, what)), what)] = {*required, *optional}, set(required)
        return original(self, node, what, required, optional, *rest)

    monkeypatch.setattr(ConfigReader, "object", record)
    assert accepted(RICH)
    assert keys.pop("a simulation") == (set(TEXT["properties"]), set(TEXT["else"]["required"]))
    assert set(keys) - {"`ros`", "`views`", "a panel"} == set(OBJECTS)
    for kind, name in OBJECTS.items():
        place = TEXT["$defs"][name]
        if name == "rate":
            place = place["anyOf"][1]
        assert place["additionalProperties"] is False
        assert (set(place["properties"]), set(place.get("required", ()))) == keys[kind], kind


def test_words_and_limits_are_those_of_the_simulator() -> None:
    defs = TEXT["$defs"]
    assert defs["integrator"]["properties"]["method"]["enum"] == list(METHODS)
    assert defs["integrator"]["properties"]["hz"]["maximum"] == defs["hz"]["maximum"] == MAX_HZ
    assert defs["duration"]["maximum"] == defs["event"]["properties"]["at_s"]["maximum"] == MAX_SECONDS
    assert {name: defs[name] for name in OF_MACHINES} == {name: MACHINE["$defs"][name] for name in OF_MACHINES}
    ros = MACHINE["$defs"]["ros"]["properties"]
    assert {key: defs["truth"]["properties"][key] for key in ros} == ros


def keys_of(place: Any) -> Iterator[tuple[str, Any]]:
    """The keys of a schema's objects, each with its part of the schema."""
    if isinstance(place, dict):
        yield from place.get("properties", {}).items()
        for keyword, part in place.items():
            if keyword not in ("if", "then", "else"):  # conditions on objects described elsewhere
                yield from keys_of(part)


def test_every_key_is_described() -> None:
    for key, place in keys_of(TEXT):
        target = TEXT["$defs"][place["$ref"].split("/")[-1]] if "$ref" in place else place
        assert place.get("description") or target.get("description"), key


@pytest.mark.parametrize(
    ("wrong", "right"),
    [
        ({"sead": 1}, {}),
        ({"seed": "1"}, {"seed": 2}),
        ({"duration": 0}, {"duration": 2.5}),
        ({"integrator": {"method": "rk5", "hz": 1000}}, {"integrator": {"method": "ab4", "hz": 1000}}),
        ({"integrator": {"method": "rk45", "hz": 1000}}, {"integrator": {"method": "rk45"}}),
        ({"integrator": {"method": "rk4", "hz": 1000, "rtol": 1e-9}}, {"integrator": {"method": "rk2", "hz": 100}}),
        ({"models": {"a": {"source": "a.c", "library": "package://p/a"}}}, {"models": {"a": {"source": "a.c"}}}),
        ({"models": {"a": {"library": "liba.so"}}}, {"models": {"a": {"library": "package://p/a"}}}),
        ({"rates": {"a": 0}}, {"rates": {"a": {"hz": 5, "phase_s": 0.02}}}),
        ({"events": [{"at_s": 1.0, "set": "a.b"}]}, {"events": [{"at_s": 1.0, "set": "a.b", "value": [1, 2]}]}),
        ({"until": {"field": "a.b", "equals": True}}, {"until": {"condition": "a.b"}}),
        ({"instances": {"controller": {"model": "a"}}}, {"instances": {"b": {"model": "a"}}}),
        ({"extends": 1}, {"extends": "base.sim.json"}),
    ],
)
def test_wrong_ones_are_rejected(wrong: dict[str, Any], right: dict[str, Any]) -> None:
    assert not VALIDATOR.is_valid(RAMP | wrong)
    assert VALIDATOR.is_valid(RAMP | right)


def test_a_file_that_extends_another_says_as_little_as_it_wants() -> None:
    for right in ({}, {"until": None}, {"rates": {"line": None}}, {"instances": {"a": {"parameters": {"b": 1}}}}):
        VALIDATOR.validate({"extends": "base.sim.json"} | right)
    for wrong in ({"sead": 1}, {"seed": "1"}, {"events": {}}, {"connections": [{"from": "a.b"}]}, {"rates": 5}):
        assert not VALIDATOR.is_valid({"extends": "base.sim.json"} | wrong)


# ---- what the schema rejects, the front end rejects ------------------------------------------------------------------

REPLACEMENTS: tuple[Any, ...] = (None, True, -1, 1.5, "", [], {"a": 1})


def places(node: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    yield path
    if isinstance(node, dict | list):
        for key in node if isinstance(node, dict) else range(len(node)):
            yield from places(node[key], (*path, key))


def mutants(config: Any) -> Iterator[tuple[str, Any]]:
    """Every value replaced, and every member removed."""
    for path in places(config):
        for change in ("remove", *REPLACEMENTS) if path else ():
            copied = copy.deepcopy(config)
            at = copied
            for step in path[:-1]:
                at = at[step]
            if change == "remove":
                del at[path[-1]]
            else:
                at[path[-1]] = change
            yield f"{'/'.join(map(str, path))}: {change!r}", copied


def test_what_the_schema_rejects_the_front_end_rejects(accepted: Accepted) -> None:
    """One in three, to save time. The machine is given, so nothing reads its path."""
    rejected = [(what, config) for what, config in mutants(RICH) if not VALIDATOR.is_valid(config)]
    rejected = [(what, config) for what, config in rejected if not what.startswith("controller/machine: ''")]
    assert len(rejected) > 500
    wrong = [what for what, config in rejected[::3] if accepted(config)]
    assert not wrong, f"{len(wrong)}, such as {wrong[:20]}"
