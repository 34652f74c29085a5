# SPDX-License-Identifier: Apache-2.0
"""Values that a simulation file gives to inputs without a connection, and to parameters that are tables."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, Simulation

Load = Callable[..., SimConfig]
Change = Callable[[dict[str, Any]], None]


def curve(**keys: Any) -> Change:
    """Adds an instance of test/models/curve.c."""

    def change(config: dict[str, Any]) -> None:
        config["models"]["curve"] = {"source": "curve.c"}
        config["instances"]["curve"] = {"model": "curve", "parameters": {"values": [1.0]}} | keys

    return change


def heads(error: DiagnosticError) -> list[str]:
    return [f"{d.code}: {d.message}" for d in error.diagnostics]


def y(sim: Simulation) -> float:
    sim.run(1)
    value = sim.get("curve.outputs.y")
    assert isinstance(value, float)
    return value


# ---- inputs --------------------------------------------------------------------------------------------------------


def test_an_optional_input_may_stay_unconnected(load_sim: Load) -> None:
    """The other one is missed."""
    heads = [warning.splitlines()[0].split(": ", 1)[1] for warning in load_sim(curve()).warnings]
    assert heads == ["warning[W802]: nothing feeds input `x` of `curve`"]


def test_an_input_has_the_value_of_the_file(load_sim: Load, open_sim: Callable[..., Simulation]) -> None:
    change = curve(inputs={"x": 5.0, "offset": 0.25})
    assert load_sim(change).warnings == ()
    with open_sim(change) as sim:
        assert y(sim) == 4 * 1.0 + 5.25
        assert y(sim) == 4 * 1.0 + 5.25


def test_the_command_line_sets_an_input(load_sim: Load) -> None:
    config = load_sim(curve(inputs={"x": 5.0}), sets=["curve.inputs.x=7.0"])
    assert "set curve inputs.x 0 401c000000000000" in config.plan.text.splitlines()
    assert "401400000000000" not in config.plan.text
    assert load_sim(curve(), sets=["curve.inputs.x=7.0"]).warnings == ()


def test_an_event_changes_an_input_that_has_a_value(open_sim: Callable[..., Simulation]) -> None:
    def change(config: dict[str, Any]) -> None:
        curve(inputs={"x": 5.0})(config)
        config["events"] = [{"at_s": 0.01, "set": "curve.inputs.x", "value": 6.0}]

    with open_sim(change) as sim:
        assert [y(sim), y(sim)] == [9.0, 10.0]


@pytest.mark.parametrize(
    ("inputs", "expected"),
    [
        ({"x": True}, "E207: input `x` is f64, not a bool"),
        ({"z": 1.0}, "E216: model `curve` has no input `z`"),
    ],
)
def test_wrong_inputs(load_sim: Load, inputs: dict[str, Any], expected: str) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_sim(curve(inputs=inputs))
    assert heads(error.value) == [expected]


def test_an_input_has_a_value_or_a_connection(load_sim: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        curve(inputs={"x": 1.0})(config)
        config["connections"].append({"from": "ramp.x", "to": "curve.x"})

    with pytest.raises(DiagnosticError) as error:
        load_sim(change)
    assert heads(error.value) == ["E212: `curve.x` has a value and a connection"]


# ---- tables --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("values", "total"), [([1.0], 4.0), ([1.0, 2.0], 7.0), ([1.0, 2.0, 3.0, 4.0], 10.0), ([0, 1], 3.0)]
)
def test_the_last_value_fills_the_rest(open_sim: Callable[..., Simulation], values: list[float], total: float) -> None:
    with open_sim(curve(parameters={"values": values}, inputs={"x": 0.0})) as sim:
        assert y(sim) == total
        assert sim.get("curve.outputs.last") == values[-1]


def test_a_column_of_a_file(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    (tmp_path / "wing.csv").write_text("\ufeffangle, lift \n0.1,1.5\n\n0.2,2.5e0\n", encoding="utf-8")
    column = {"csv": "wing.csv", "column": "lift"}
    with open_sim(curve(parameters={"values": column}, inputs={"x": 0.0})) as sim:
        assert y(sim) == 1.5 + 3 * 2.5


def test_the_command_line_sets_a_table(open_sim: Callable[..., Simulation], load_sim: Load) -> None:
    config = load_sim(curve(inputs={"x": 0.0}), sets=["curve.parameters.values=[8.0, 9.0]"])
    with Simulation(config.plan, config.tables) as sim:
        assert y(sim) == 8.0 + 3 * 9.0


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], "E207: parameter `values` has 1 to 4 values, not 0"),
        ([0.0] * 5, "E207: parameter `values` has 1 to 4 values, not 5"),
        ([True], "E207: parameter `values` is f64, not a bool"),
        (1.0, "E208: parameter `values` is a table, not a float"),
        ({"csv": "wing.csv"}, "E202: parameter `values` has no `column`"),
        ({"csv": "none.csv", "column": "lift"}, "E253: `none.csv` cannot be used: no such file: "),
        ({"csv": "../wing.csv", "column": "lift"}, "E253: `../wing.csv` cannot be used: "),
        ({"csv": "wing.csv", "column": "lif"}, "E253: `wing.csv` has no column `lif`"),
        ({"csv": "wing.csv", "column": "drag"}, "E253: line 3 of `wing.csv`: `x` in column `drag` is no finite number"),
        (
            {"csv": "wing.csv", "column": "short"},
            "E253: line 3 of `wing.csv`: `` in column `short` is no finite number",
        ),
        ({"csv": "long.csv", "column": "a"}, "E207: parameter `values` has 1 to 4 values, not 5"),
        ({"csv": "head.csv", "column": "a"}, "E207: parameter `values` has 1 to 4 values, not 0"),
        ({"csv": "empty.csv", "column": "a"}, "E253: `empty.csv` has no column `a`"),
        ({"csv": "binary.csv", "column": "a"}, "E253: `binary.csv` cannot be used: it is no text in UTF-8"),
        ({"csv": "quote.csv", "column": "a"}, "E253: `quote.csv` cannot be used: unexpected end of data"),
        ({"csv": "large.csv", "column": "a"}, "E253: `large.csv` cannot be used: it is larger than 1048576 bytes"),
        ({"csv": ".", "column": "a"}, "E253: `.` cannot be used: "),
    ],
)
def test_wrong_tables(load_sim: Load, tmp_path: Path, values: Any, expected: str) -> None:
    (tmp_path / "wing.csv").write_text("lift,drag,short\n1.0,2.0,3.0\n1.5,x\n")
    (tmp_path / "long.csv").write_text("a\n1\n2\n3\n4\n5\n")
    (tmp_path / "head.csv").write_text("a\n")
    (tmp_path / "empty.csv").write_text("")
    (tmp_path / "binary.csv").write_bytes(b"a\n\xff\xfe\n")
    (tmp_path / "quote.csv").write_text('a\n"1\n')
    (tmp_path / "large.csv").write_text("a\n" + "1\n" * 600_000)
    with pytest.raises(DiagnosticError) as error:
        load_sim(curve(parameters={"values": values}))
    (found,) = heads(error.value)
    assert found.startswith(expected)
