# SPDX-License-Identifier: Apache-2.0
"""`constants` of a machine JSON: expressions in the place of numbers, units, a file of their own, and what the hashes cover."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.cache import build_machine

LAW = """
class Law:
    inputs = {"u": "f64 rad/s"}
    parameters = {
        "half": "f64 m",
        "single": "f32",
        "count": "i32",
        "vector": "f64[3] m",
        "pose": "Pose",
        "word": "Health",
        "plain": "f64",
    }
    outputs = {"y": "f64 m/s"}
    state = {"last": "f64[n]"}

    def execute(self):
        self.last[0] = self.u
        self.health = self.word
        self.y = self.half * self.u + f64(self.single) + f64(self.count) + self.plain + self.pose.height + sum(self.vector)
"""
CONSTANTS = {
    "track": {"value": 0.45, "unit": "m"},
    "radius": {"value": "track / 3", "unit": "m"},
    "ratio": 7,
    "rate": {"value": 50, "unit": "Hz"},
    "unused": 1.0,
}
PARAMETERS = {
    "half": "track / 2",
    "single": "0.1 * ratio",
    "count": "ratio // 2 - 1",
    "vector": ["track", "-radius", 1.0],
    "pose": {"height": "2 * track", "valid": True},
    "word": "degraded",
    "plain": "track ** 2 + sqrt(4)",
}


def machine(folder: Path, constants: Any = CONSTANTS, **changes: Any) -> Path:
    config = {
        "tick_hz": 100,
        "initial_state": "A",
        "constants": constants,
        "structs": {"Pose": {"height": "f64 m", "valid": "bool"}},
        "algorithms": {"Law": {"source": "law.py", "sizes": {"n": "ratio"}}},
        "instances": {
            "law": {"algorithm": "Law", "parameters": {**PARAMETERS, **changes}, "inputs": {"u": "2 * ratio"}}
        },
        "states": {"A": {"schedule": {"law": "rate"}}, "B": {"schedule": {"law": {"every": "ratio", "phase": 1}}}},
        "transitions": [{"from": "A", "to": "B", "after_s": "ratio / 100"}],
    }
    return write_machine(folder, "several", config, {"law": LAW})


def test_expressions_stand_for_numbers(tmp_path: Path) -> None:
    twins = Twins(machine(tmp_path))
    twins.step()
    at = {
        name: twins.native.get(f"law.parameters.{name}") for name in ("half", "count", "vector", "plain", "pose.height")
    }
    assert at == {"half": 0.225, "count": 2, "vector": [0.45, -0.15, 1.0], "plain": 0.45**2 + 2.0, "pose.height": 0.9}
    assert twins.native.get("law.inputs.u") == 14.0 and len(twins.native.get("law.state.last")) == 7
    twins.step(7)
    assert twins.native.state == "B"


def test_a_file_of_constants(tmp_path: Path) -> None:
    (tmp_path / "rover.json").write_text(json.dumps(CONSTANTS))
    twins = Twins(machine(tmp_path, "rover.json"))
    assert twins.native.get("law.parameters.half") == 0.225
    path = machine(tmp_path, "rover.json")
    before = build_machine(path).source_hash
    (tmp_path / "rover.json").write_text(json.dumps({**CONSTANTS, "unused": 2.0}))
    assert build_machine(path).source_hash == before  # another file uses it
    (tmp_path / "rover.json").write_text(json.dumps({**CONSTANTS, "track": {"value": 0.5, "unit": "m"}}))
    after = build_machine(path)
    assert after.source_hash != before
    assert Twins(path).native.get("law.parameters.half") == 0.25


def test_without_constants_a_string_is_no_number(tmp_path: Path) -> None:
    path = machine(tmp_path, {})
    path.write_text(path.read_text().replace('"constants": {},', ""))
    with pytest.raises(DiagnosticError) as caught:
        build_machine(path)
    assert "E252" not in {d.code for d in caught.value.diagnostics}
    assert "parameter `half` is f64, not a string" in str(caught.value)


@pytest.mark.parametrize(
    ("change", "code", "message"),
    [
        ({"half": "trak / 2"}, "E252", "parameter `half`: there is no constant `trak`; did you mean `track`?"),
        ({"half": "track * track"}, "E252", "parameter `half`: its unit is m2, not m"),
        ({"vector": ["rate", 0.0, 0.0]}, "E252", "parameter `vector`: its unit is 1/s, not m"),
        ({"half": "2 * rate"}, "E252", "parameter `half`: its unit is 1/s, not m"),
        ({"half": "1 / rate // 2"}, "E252", "parameter `half`: its unit is s, not m"),
        ({"plain": "1 + ("}, "E252", "`1 + (` is no expression: `(` is not closed"),
        ({"plain": "2 + if"}, "E252", "`2 + if` is no expression from `if` on"),
        ({"plain": "track *"}, "E252", "`track *` is no expression: it breaks off"),
        ({"plain": "1e308 * ratio"}, "E252", "`1e308 * ratio` overflows: it is beyond the range of f64"),
        ({"count": "ratio / 2"}, "E207", "parameter `count` is i32, not a number with a point"),
        ({"plain": "track >"}, "E252", ""),
        ({"plain": "ratio / 0"}, "E252", ""),
        ({"plain": "track > 1"}, "E252", "`track > 1` is no number"),
        ({"word": "track"}, "E205", ""),
    ],
)
def test_wrong_expressions(tmp_path: Path, change: dict[str, Any], code: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path, **change))
    (found,) = caught.value.diagnostics
    assert found.code == code and message in found.message, found


@pytest.mark.parametrize(
    ("constants", "code", "message"),
    [
        ({"a": "b", "b": 1}, "E252", "constant `a`: the constant `b` is defined below: move it above"),
        ({"a": "a"}, "E252", "constant `a`: there is no constant `a`; there are none"),
        ({"a": "b"}, "E252", "constant `a`: there is no constant `b`"),
        ({"if": 1}, "E203", "`if` cannot name a constant"),
        ({"min": 1}, "E203", "`min` cannot name a constant"),
        ({"true": 1}, "E203", "`true` cannot name a constant"),
        ({"a": {"value": 1, "unit": "m!!"}}, "E252", "`m!!` is not a unit"),
        (
            {"a": {"value": 1.0, "unit": "m"}, "b": {"value": "2*a", "unit": "s"}},
            "E252",
            "constant `b`: its unit is m, not s",
        ),
        (
            {"a": {"value": 1.0, "unit": "m"}, "b": {"value": "a", "unit": "s"}},
            "E252",
            "constant `b`: its unit is m, not s",
        ),
        ({"a": True}, "E208", "constant `a` is a number or an expression"),
        ({"a": {"unit": "m"}}, "E202", "constant `a` has no `value`"),
        ({"a b": 1}, "E203", "`a b` is not a name"),
        ([], "E208", "`constants` is an object"),
        ("absent.json", "E100", "cannot read `absent.json`: no such file"),
        ("../up.json", "E100", "it would leave its folder"),
    ],
)
def test_wrong_constants(tmp_path: Path, constants: Any, code: str, message: str) -> None:
    values = {name: 1 for name in PARAMETERS if name not in ("vector", "pose", "word")}
    path = machine(tmp_path, constants, **values, vector=[0, 0, 0], pose={"height": 0, "valid": False}, word="nominal")
    text = path.read_text().replace('"2 * ratio"', "1").replace('"rate"', "50").replace('"ratio / 100"', "1")
    path.write_text(text.replace('"ratio"', "3"))
    with pytest.raises(DiagnosticError) as caught:
        build_machine(path)
    first = caught.value.diagnostics[0]
    assert first.code == code and message in first.message, first


@pytest.mark.parametrize(
    "constants",
    [
        {"track": "late", "late": 1.0},
        {"track": {"unit": "m"}},
        {"track": "1 +", "other": "track / 2"},
        {"track": [1]},
        "absent.json",
    ],
)
def test_one_mistake_is_reported_once(tmp_path: Path, constants: Any) -> None:
    if isinstance(constants, dict):
        constants = {**constants, **{name: CONSTANTS[name] for name in ("ratio", "rate")}, "radius": 1}
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path, constants))
    assert len(caught.value.diagnostics) == 1, caught.value


def test_another_unit_is_converted_by_a_constant(tmp_path: Path) -> None:
    wide = {"mm": {"value": 0.001, "unit": "m/mm"}, "wide": {"value": 400, "unit": "mm"}}
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path, {**CONSTANTS, **wide}, half="wide / 1000"))
    (found,) = caught.value.diagnostics
    assert "its unit is mm, not m" in found.message and "multiply by a constant" in found.help
    assert Twins(machine(tmp_path, {**CONSTANTS, **wide}, half="wide * mm")).native.get("law.parameters.half") == 0.4
    root = {"area": {"value": 4.0, "unit": "m"}, "root": "sqrt(area)", "again": {"value": "root * root", "unit": "m"}}
    assert Twins(machine(tmp_path, {**CONSTANTS, **root}, half="again")).native.get("law.parameters.half") == 4.0


def test_a_factor_of_literals_keeps_the_unit(tmp_path: Path) -> None:
    """One without a unit that is a constant may convert."""
    period = {"value": "ratio / (7 * rate)", "unit": "ms"}
    twins = Twins(
        machine(tmp_path, {**CONSTANTS, "period": period, "double": {"value": "2 * track", "unit": "m"}}, half="double")
    )
    assert twins.native.get("law.parameters.half") == 0.9


@pytest.mark.parametrize("unit", ["Hz", "1/s", "s^-1", ""])
def test_a_rate_is_in_hertz(tmp_path: Path, unit: str) -> None:
    machine(tmp_path, {**CONSTANTS, "rate": {"value": 50, "unit": unit}})
    build_machine(tmp_path / "several.json")


@pytest.mark.parametrize(
    ("rate", "code", "message"),
    [
        ({"value": 50, "unit": "m"}, "E252", "a rate (Hz): its unit is m, not Hz"),
        ({"value": "100 / 2"}, "E208", "a rate (Hz) is an integer, not 50.0"),
    ],
)
def test_wrong_rates(tmp_path: Path, rate: Any, code: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(machine(tmp_path, {**CONSTANTS, "rate": rate}))
    (found,) = caught.value.diagnostics
    assert found.code == code and message in found.message, found


COLUMN = """
class Law:
    inputs = {"u": "f64"}
    parameters = {"xs": "f64[4]", "gains": "f32[4]"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = interp(self.u, self.xs, [0.0, 1.0, 2.0, 3.0]) + f64(self.gains[3])
"""


def of_columns(folder: Path, **gains: Any) -> Path:
    (folder / "tables").mkdir(exist_ok=True)
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {
            "law": {
                "algorithm": "Law",
                "parameters": {
                    "xs": {"csv": "tables/gains.csv", "column": "x"},
                    "gains": {"csv": "tables/gains.csv", "column": "gain", **gains},
                },
            }
        },
        "states": {"A": {"schedule": {"law": 10}}},
    }
    return write_machine(folder, "several", config, {"law": COLUMN})


def test_columns_of_files(tmp_path: Path) -> None:
    path = of_columns(tmp_path)
    table = tmp_path / "tables/gains.csv"
    table.write_text("x, gain\n0, 0.1\n1, 0.2\n\n2, 0.3\n4, 0.7\n")
    twins = Twins(path)
    assert twins.native.get("law.parameters.xs") == [0.0, 1.0, 2.0, 4.0]
    twins.set("law.inputs.u", 3.0)
    twins.step()
    assert twins.native.get("law.outputs.y") == 2.5 + 0.699999988079071
    before = build_machine(path).source_hash
    table.write_text("x,gain,more\n0,0.1,1\n1,0.2,1\n2,0.3,1\n4,0.7,9\n")
    assert build_machine(path).source_hash == before  # the same numbers
    table.write_text("x,gain\n0,0.1\n1,0.2\n2,0.3\n5,0.7\n")
    assert build_machine(path).source_hash != before
    assert Twins(path).native.get("law.parameters.xs") == [0.0, 1.0, 2.0, 5.0]


@pytest.mark.parametrize(
    ("text", "gains", "code", "message"),
    [
        ("x,gain\n0,0\n1,0\n2,0\n", {}, "E207", "parameter `xs` is f64[4], not a column of 3"),
        ("x,gain\n0,0\n1,0\n2,0\n3,0\n", {"column": "gian"}, "E253", "`tables/gains.csv` has no column `gian`"),
        ("x,gain\n0,0\n1,0\n2,0\n3,nan\n", {}, "E253", "line 5 of `tables/gains.csv`: `nan` in column `gain`"),
        (
            "x,gain\n0,0\n1,0\n2,0\n3,1e99\n",
            {},
            "E207",
            "line 5 of `tables/gains.csv`: parameter `gains`: the literal is",
        ),
        ("", {}, "E253", "`tables/gains.csv` has no column `x`"),
        ("x,gain\n0,0\n1,0\n2,0\n3,0\n", {"csv": "../up.csv"}, "E253", "it would leave its folder"),
        ("x,gain\n0,0\n1,0\n2,0\n3,0\n", {"row": 1}, "E201", "unknown key `row`"),
    ],
)
def test_wrong_columns(tmp_path: Path, text: str, gains: dict[str, Any], code: str, message: str) -> None:
    path = of_columns(tmp_path, **gains)
    (tmp_path / "tables/gains.csv").write_text(text)
    with pytest.raises(DiagnosticError) as caught:
        build_machine(path)
    first = caught.value.diagnostics[0]
    assert first.code == code and message in first.message, first


def of_integers(folder: Path, type_: str, text: str) -> Path:
    path = of_columns(folder)
    law = folder / "law.py"
    law.write_text(law.read_text().replace("f32[4]", f"{type_}[4]"))
    (folder / "tables/gains.csv").write_text("x,gain\n" + "".join(f"{x},{y}\n" for x, y in enumerate(text.split())))
    return path


def test_a_column_of_integers(tmp_path: Path) -> None:
    twins = Twins(of_integers(tmp_path, "i64", "3 -4.0 1e3 9007199254740993"))
    twins.step()
    assert twins.native.get("law.parameters.gains") == [3, -4, 1000, 9007199254740993]


@pytest.mark.parametrize(
    ("type_", "text", "message"),
    [
        ("i32", "3 4 5.5 6", "line 4 of `tables/gains.csv`: parameter `gains` is i32, not a number with a point"),
        ("u32", "3 4 5 -6", "line 5 of `tables/gains.csv`: parameter `gains`: -6 does not fit u32"),
        ("i32", "3e9 4 5 6", "line 2 of `tables/gains.csv`: parameter `gains`: 3000000000 does not fit i32"),
        (
            "i32",
            "3 4 5 1e-9999999",
            "line 5 of `tables/gains.csv`: parameter `gains` is i32, not a number with a point",
        ),
    ],
)
def test_no_integers(tmp_path: Path, type_: str, text: str, message: str) -> None:
    with pytest.raises(DiagnosticError) as caught:
        build_machine(of_integers(tmp_path, type_, text))
    (found,) = caught.value.diagnostics
    assert found.code == "E207" and found.message.startswith(message), found


def test_a_table_that_is_no_file(tmp_path: Path) -> None:
    path = of_columns(tmp_path)
    os.mkfifo(tmp_path / "tables/gains.csv")
    with pytest.raises(DiagnosticError) as caught:
        build_machine(path)
    assert caught.value.diagnostics[0].message == "`tables/gains.csv` cannot be used: it is not a regular file"
