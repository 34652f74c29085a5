# SPDX-License-Identifier: Apache-2.0
"""The JSON Schema of a board agrees with the compiler: the same keys and words, and no stricter rules."""

import json
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest
from fcsl_test_boards import BOARD, write_board, write_machine
from test_schema import EVERY, agree, mutants

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.board import devices, drivers, hardware, health, limits, pulses
from fcsl_compiler.board import machine as board_machine
from fcsl_compiler.board.board import board_schema, check_board
from fcsl_compiler.board.kinds import KINDS, MAX_BACKENDS, MAX_SECTIONS, STICKS
from fcsl_compiler.board.rotations import NAMED
from fcsl_compiler.cli.main import main
from fcsl_compiler.parse.json_reader import ConfigReader

TEXT = json.loads(board_schema())
VALIDATOR = jsonschema.Draft202012Validator(TEXT)

#: Names of objects in the reader, and their places in the schema.
OBJECTS = {
    "a board": (),
    r"device `\w+`": ("$defs", "device"),
    r"sensor `\w+`": ("$defs", "sensor"),
    "a backend": ("$defs", "backend"),
    r"the correction of `\w+`": ("$defs", "correction"),
    "a stick": ("$defs", "stick"),
    "`health`": ("$defs", "health"),
    "a notch": ("$defs", "notch"),
    r"output `\w+`": ("$defs", "output"),
    "an element": ("$defs", "element"),
    "`hardware`": ("properties", "hardware"),
    r"`gpio` \d+": ("$defs", "pin"),
    r"`adc` \d+": ("$defs", "converter"),
    r"the registers `\w+`": ("$defs", "registers"),
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write_machine(tmp_path)
    return tmp_path


def accepted(folder: Path, board: Any) -> bool:
    try:
        check_board(write_board(folder, board))
    except DiagnosticError:
        return False
    return True


def test_it_is_a_schema_and_printed(capsys: pytest.CaptureFixture[str]) -> None:
    jsonschema.Draft202012Validator.check_schema(TEXT)
    assert main(["schema", "board"]) == 0 and capsys.readouterr().out == board_schema()


def test_the_board_with_every_key_is_good(folder: Path) -> None:
    VALIDATOR.validate(BOARD)
    assert accepted(folder, BOARD)


def test_schema_and_reader_have_the_same_keys(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    keys: dict[str, tuple[set[str], set[str]]] = {}
    original = ConfigReader.object

    def record(self: ConfigReader, node: Any, what: str, required: Any, optional: Any = ()) -> Any:
        kind = next((k for k in OBJECTS if re.fullmatch(k, what)), None)
        if kind is not None:
            keys[kind] = {*required, *optional}, set(required)
        return original(self, node, what, required, optional)

    monkeypatch.setattr(ConfigReader, "object", record)
    assert accepted(folder, BOARD)
    agree(TEXT, OBJECTS, keys)


def test_words_and_limits_are_the_compilers() -> None:
    defs, top = TEXT["$defs"], TEXT["properties"]
    device, sensor, backend = (defs[name]["properties"] for name in ("device", "sensor", "backend"))
    assert device["driver"]["anyOf"][0]["enum"] == list(drivers.known_drivers())
    assert (device["rate_hz"]["minimum"], device["rate_hz"]["maximum"]) == (devices.MIN_RATE_HZ, devices.MAX_RATE_HZ)
    assert sensor["kind"]["enum"] == list(KINDS)
    quantities = {q for kind in KINDS.values() for q in kind}
    assert set(defs["measured"]["enum"]) == {q.name for q in quantities if q.measured}
    assert set(defs["quantity"]["anyOf"][1]["enum"]) == {q.name for q in quantities if not q.measured}
    listed = "; ".join(f"{kind}: {', '.join(q.name for q in of_kind)}" for kind, of_kind in KINDS.items())
    assert listed in defs["quantity"]["description"]
    assert sensor["backends"]["maxItems"] == MAX_BACKENDS and backend["sticks"]["maxItems"] == STICKS.count
    assert sensor["notch"]["additionalProperties"]["maxItems"] == MAX_SECTIONS
    assert top["devices"]["maxProperties"] == limits.MAX_DEVICES
    assert top["sensors"]["maxProperties"] == limits.MAX_SENSORS
    assert top["outputs"]["maxProperties"] == limits.MAX_OUTPUTS
    assert defs["output"]["properties"]["elements"]["maxItems"] == limits.MAX_PULSES
    assert defs["number"]["maximum"] == -defs["number"]["minimum"] == pulses.MAX_NUMBER
    element = defs["element"]["properties"]
    assert element["slew_per_s"]["maximum"] == pulses.MAX_NUMBER
    assert defs["signal"]["maxLength"] == limits.MAX_PLAN_NAME
    builtins = top["hardware"]["properties"]
    assert builtins["gpio"]["maxProperties"] == limits.MAX_PINS
    assert builtins["adc"]["maxProperties"] == limits.MAX_CONVERTERS
    assert builtins["registers"]["maxProperties"] == limits.MAX_REGISTERS
    assert defs["registers"]["properties"]["offset"]["maximum"] == hardware.MAX_OFFSET
    assert defs["registers"]["properties"]["bytes"]["maximum"] == hardware.MAX_U32
    assert element["signal"]["maxLength"] == limits.MAX_PLAN_NAME
    assert defs["name"]["maxLength"] == backend["signals"]["additionalProperties"]["maxLength"] == limits.MAX_PLAN_NAME
    assert defs["text"]["maxLength"] == limits.MAX_TEXT
    age = defs["health"]["properties"]["max_age_s"]
    assert (age["minimum"], age["maximum"]) == (health.MIN_AGE_S, health.MAX_TIME_S)
    assert top["machine"]["maxLength"] == board_machine.MAX_PATH


def test_rotations_have_their_names() -> None:
    rotation = jsonschema.Draft202012Validator(
        {**TEXT, **TEXT["$defs"]["backend"]["properties"]["rotation"]}["anyOf"][0]
    )
    assert all(rotation.is_valid(name) for name in NAMED)
    for word in ("", "roll_0", "roll_30", "yaw_90_roll_90", "roll_90_", "roll_90_roll_90", "pitch_45_", "None"):
        assert word not in NAMED and not rotation.is_valid(word), word


def test_every_key_is_described() -> None:
    def walk(place: Any) -> Iterator[tuple[str, Any]]:
        if isinstance(place, dict):
            yield from place.get("properties", {}).items()
            for part in place.values():
                yield from walk(part)

    for key, place in walk(TEXT):
        target = TEXT["$defs"][place["$ref"].split("/")[-1]] if "$ref" in place else place
        assert place.get("description") or target.get("description"), key


def test_what_the_schema_rejects_the_compiler_rejects(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # The machine is the same in all of them.
    monkeypatch.setattr(board_machine, "compile_machine", cache(board_machine.compile_machine))
    rejected = [(what, board) for what, board in mutants(BOARD) if not VALIDATOR.is_valid(board)]
    assert len(rejected) > 900 // EVERY
    wrong = [what for what, board in rejected if accepted(folder, board)]
    assert not wrong, f"{len(wrong)} of {len(rejected)}, such as {wrong[:20]}"
