# SPDX-License-Identifier: Apache-2.0
"""`extends`: what a file takes over from its base, and that messages and paths are those of the file that says it."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from conftest import RAMP

from fcsl_compiler.base.diagnostics import DiagnosticError, DiagnosticSink
from fcsl_compiler.parse.machine_files import parse_machine
from fcsl_sim import SimConfig, load

Extend = Callable[[dict[str, Any]], Path]
Load = Callable[..., SimConfig]


@pytest.fixture
def extend(write_sim: Callable[..., Path]) -> Extend:
    """Writes a file that extends RAMP and says this; returns its path."""

    def write(members: dict[str, Any]) -> Path:
        path = write_sim().with_name("more.sim.json")
        path.write_text(json.dumps({"extends": "ramp.sim.json"} | members, indent=2))
        return path

    return write


@pytest.fixture
def read(hopper: tuple[Path, str]) -> Load:
    return lambda path, **options: load(path, machine=hopper, **options)


def refused(read: Load, path: Path) -> list[str]:
    """`file:line: code: message` of each error."""
    with pytest.raises(DiagnosticError) as error:
        read(path)
    return [f"{Path(d.span.source.name).name}:{d.span.line}: {d.code}: {d.message}" for d in error.value.diagnostics]


def test_nothing_said_nothing_changed(extend: Extend, read: Load) -> None:
    path = extend({})
    assert read(path).plan == read(path.with_name("ramp.sim.json")).plan


def test_objects_are_merged_and_all_else_replaces(extend: Extend, read: Load, write_sim: Callable[..., Path]) -> None:
    bias = [{"at_s": 0.5, "set": "altimeter.parameters.bias", "value": 1.0}]
    path = extend({"seed": 7, "instances": {"altimeter": {"parameters": {"sigma": 0.5}}}, "events": bias})

    def same(config: dict[str, Any]) -> None:
        config |= {"seed": 7, "events": bias}
        config["instances"]["altimeter"]["parameters"]["sigma"] = 0.5

    assert read(path).plan == read(write_sim(same)).plan
    path.write_text(json.dumps({"extends": "ramp.sim.json", "events": []}))
    assert "\nevent " not in read(path).plan.text, "an array replaces that of the base"


def test_null_removes(extend: Extend, read: Load, write_sim: Callable[..., Path]) -> None:
    connections = [
        c for c in RAMP["connections"] if not c["from"].startswith("velo") and not c["to"].startswith("velo")
    ]
    removed = {"instances": {"velocimeter": None}, "rates": {"velocimeter": None}, "connections": connections}

    def same(config: dict[str, Any]) -> None:
        del config["instances"]["velocimeter"], config["rates"]["velocimeter"]
        config["connections"] = connections

    assert read(extend(removed)).plan == read(write_sim(same)).plan
    nothing = read(extend({"until": None, "instances": {"ramp": {"integrator": None}}})).plan
    assert nothing == read(extend({})).plan, "the base has none"


def test_a_chain(extend: Extend, read: Load) -> None:
    first = extend({"seed": 2, "duration": 0.5})
    last = first.with_name("last.sim.json")
    last.write_text('{"extends": "more.sim.json", "seed": 3}')
    config = read(last)
    assert (config.seed, config.ticks) == (3, 50)


def test_paths_of_the_base_are_relative_to_the_base(extend: Extend, read: Load, tmp_path: Path) -> None:
    plan = read(extend({})).plan
    (tmp_path / "campaign").mkdir()
    path = tmp_path / "campaign" / "windy.sim.json"
    path.write_text('{"extends": "../ramp.sim.json"}')
    assert read(path).plan == plan
    shutil.copy(tmp_path / "ramp.c", tmp_path / "campaign" / "ramp.c")
    path.write_text('{"extends": "../ramp.sim.json", "models": {"ramp": {"source": "ramp.c"}}}')
    assert read(path).plan.text.count("\nmodel ") == plan.text.count("\nmodel ")
    path.write_text('{"extends": "../ramp.sim.json", "models": {"ramp": {"source": "romp.c"}}}')
    (message,) = refused(read, path)
    assert message.startswith("windy.sim.json:1: E801: ") and str(tmp_path / "campaign" / "romp.c") in message
    path.write_text('{"extends": "../ramp.sim.json", "controller": {"machine": "../no_such.json"}}')
    with pytest.raises(DiagnosticError) as error:
        load(path)
    assert str(tmp_path / "campaign" / ".." / "no_such.json") in str(error.value)


def test_a_base_of_a_package(tmp_path: Path) -> None:
    path = tmp_path / "mine.sim.json"
    path.write_text('{"extends": "package://lander/sim/lander.sim.json", "duration": 1.0}')
    config = load(path)
    assert (config.ticks, config.warnings) == (100, ())


def test_messages_point_into_the_file_that_says_it(extend: Extend, read: Load) -> None:
    path = extend({"rates": {"altimeter": 0}})
    base = path.with_name("ramp.sim.json")
    base.write_text(base.read_text().replace('"rk4"', '"rk5"'))
    line = next(n for n, text in enumerate(base.read_text().splitlines(), 1) if "rk5" in text)
    messages = refused(read, path)
    assert f"ramp.sim.json:{line}: E205: `method` cannot be `rk5`" in messages
    assert "more.sim.json:4: E204: a rate (Hz) is 0" in messages


@pytest.mark.parametrize(
    ("base", "message"),
    [
        ('"nowhere.sim.json"', "more.sim.json:1: E807: `nowhere.sim.json` cannot be extended: no such file"),
        ('""', "more.sim.json:1: E807: `` cannot be extended: Is a directory"),
        ('"a\\u0000b"', "more.sim.json:1: E807: `a\\x00b` cannot be extended: it contains a null byte"),
        (
            '"package://nowhere/x.sim.json"',
            "more.sim.json:1: E807: `package://nowhere/x.sim.json` cannot be extended: ",
        ),
        ('"package://lander/../x"', "more.sim.json:1: E807: `package://lander/../x` cannot be extended: "),
        ('"more.sim.json"', "more.sim.json:1: E807: a simulation extends itself: more.sim.json -> more.sim.json"),
        ("7", "more.sim.json:1: E208: `extends` is a string, not an integer"),
        ("null", "more.sim.json:1: E208: `extends` is a string, not null"),
        ('"list.json"', "list.json:1: E208: a simulation is an object, not a list"),
        ('"latin.json"', "more.sim.json:1: E807: `latin.json` cannot be extended: it is not UTF-8 text"),
        ('"broken.json"', "broken.json:1: E101: "),
        ('"twice.json"', "twice.json:1: E102: duplicate key `seed`"),
        ('"' + "x" * 5000 + '"', "more.sim.json:1: E807: `"),
    ],
)
def test_a_base_that_cannot_be_used(base: str, message: str, extend: Extend, read: Load) -> None:
    path = extend({})
    path.with_name("list.json").write_text("[]")
    path.with_name("latin.json").write_bytes(b'{"seed": "\xff"}')
    path.with_name("broken.json").write_text('{"seed": }')
    path.with_name("twice.json").write_text('{"seed": 1, "seed": 2}')
    path.write_text(f'{{"extends": {base}}}')
    first = refused(read, path)[0]
    assert first.startswith(message)


def test_a_circle_of_files_is_named(extend: Extend, read: Load) -> None:
    path = extend({})
    base = path.with_name("ramp.sim.json")
    base.write_text(json.dumps(RAMP | {"extends": "./last.sim.json"}))
    path.with_name("last.sim.json").write_text('{"extends": "more.sim.json"}')
    (message,) = refused(read, path)
    names = "more.sim.json -> ramp.sim.json -> last.sim.json -> more.sim.json"
    assert message == f"last.sim.json:1: E807: a simulation extends itself: {names}"


def test_a_misspelt_key_is_found(write_sim: Callable[..., Path], read: Load) -> None:
    path = write_sim(lambda config: config.update(extend="base.sim.json"))
    with pytest.raises(DiagnosticError, match="unknown key `extend` in a simulation(.|\n)*did you mean `extends`"):
        read(path)


def test_it_is_known_as_a_simulation(extend: Extend) -> None:
    sink = DiagnosticSink()
    assert parse_machine(extend({}), sink) is None
    assert [d.code for d in sink.diagnostics] == ["E104"]
