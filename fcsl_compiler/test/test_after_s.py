# SPDX-License-Identifier: Apache-2.0
"""`after_s` in the machine JSON: times are exact, and transitions that are never taken are reported."""

import json
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine
from fcsl_test_tables import PUPPET

from fcsl_compiler.base.diagnostics import Diagnostic, DiagnosticError
from fcsl_compiler.driver.passes import Compilation, compile_machine
from fcsl_compiler.graph.model import transition_text


def compiled(folder: Path, transitions: str, tick_hz: int = 100) -> Compilation:
    """Compiles transitions given as text, so that a test can use unusual notations of numbers."""
    config = {
        "tick_hz": tick_hz,
        "initial_state": "A",
        "instances": {n: {"algorithm": "Puppet"} for n in ("one", "two")},
        "always": {"one": {"every": 1}},
        "states": {"A": {"schedule": {"two": {"every": 1}}}, "B": {}},
        "transitions": "HERE",
        "requests": ["GO", "HALT"],
    }
    path = write_machine(folder, "timed", config, {"puppet": PUPPET})
    path.write_text(path.read_text().replace('"HERE"', transitions))
    return compile_machine(path, "", until="schedule")


def after(folder: Path, time: str, tick_hz: int) -> list[int]:
    edge = f'[{{"from": "A", "to": "B", "request": "GO", "after_s": {time}}}]'
    return [e.after_ticks for e in compiled(folder, edge, tick_hz).checked.edges]


def refused(folder: Path, time: str, tick_hz: int) -> Diagnostic:
    with pytest.raises(DiagnosticError) as caught:
        after(folder, time, tick_hz)
    (found,) = caught.value.diagnostics
    return found


def test_times_are_exact(tmp_path: Path) -> None:
    """Times are decimal: in binary 0.29 * 100 is below 29, and 0.57 * 100 above 56.99999999999999."""
    for time, tick_hz, ticks in (
        ("0.29", 100, 29),
        ("0.57", 100, 57),
        ("5", 100, 500),
        ("5e0", 100, 500),
        ("0.1", 1000, 100),
        ("0.01", 300, 3),
        ("2097151.9999980926513671875", 1 << 19, (1 << 40) - 1),
        (str(1 << 40), 1, 1 << 40),
    ):
        assert after(tmp_path, time, tick_hz) == [ticks], time


def test_a_time_between_two_ticks_is_refused_with_its_neighbours(tmp_path: Path) -> None:
    for time, tick_hz, near in (
        ("0.125", 100, "0.12 or 0.13"),
        ("0.30000000000000001", 100, "0.3 or 0.31"),  # equal to 0.3 in binary
        ("0.001", 100, "0.01"),
        ("2.5", 3, "2 or 3"),  # 7/3 and 8/3 have no finite decimal representation
        ("0.5", 3, "1"),
        ("0.005", 300, "0.01"),
    ):
        found = refused(tmp_path, time, tick_hz)
        assert found.code == "E244" and found.message == f"{time} s is not a whole number of ticks at {tick_hz} Hz"
        assert found.help == f"write {near}"


@pytest.mark.parametrize("time", ["0", "0.0", "-0.5", "1e-400", str((1 << 40) + 1), "1e300"])
def test_a_time_that_cannot_be_waited_for(tmp_path: Path, time: str) -> None:
    found = refused(tmp_path, time, 1)
    assert found.code == "E204" and found.message == f"`after_s` is {time}"
    assert found.help == f"it is positive and at most {1 << 40} s, {1 << 40} ticks"


def warned(folder: Path, *edges: dict[str, Any]) -> list[tuple[str, int]]:
    """Code and number of the transition of each warning."""
    ranked = [{"from": "A", "to": "B", **e} for e in edges]
    text = "[\n" + ",\n".join(map(json.dumps, ranked)) + "\n]"
    found = compiled(folder, text).sink.diagnostics
    first = next(n for n, line in enumerate((folder / "timed.json").read_text().splitlines(), 1) if '"from"' in line)
    return sorted((d.code, d.span.line - first) for d in found)


def test_transitions_that_never_come_are_told(tmp_path: Path) -> None:
    guard = {"instance": "one", "in": ["failed"]}
    one = {"after_s": 5, "priority": 1}
    for edges, expected in (
        ([one], []),
        ([one, {"after_s": 4, "priority": 0, "health": guard}], []),
        ([one, {"after_s": 5, "priority": 2, "health": guard}], []),
        ([one, {"after_s": 5, "priority": 0, "health": guard}], [("W211", 1)]),
        ([one, {"after_s": 6, "priority": 2, "request": "GO"}], [("W211", 1)]),
        ([one, {"after_s": 6, "priority": 2}, {"after_s": 7, "priority": 3}], [("W211", 1), ("W211", 2)]),
        ([one, {"request": "GO", "priority": 0}], []),
        ([{**one, "after_s": 0.01}, {"request": "GO", "priority": 0}], [("W211", 1)]),  # the state lasts one tick
        ([{**one, "request": "GO"}, {"after_s": 6, "priority": 0}], []),
    ):
        assert warned(tmp_path, *edges) == expected, edges


def test_a_state_that_only_time_reaches_is_reached(tmp_path: Path) -> None:
    edge = '[{"from": "A", "to": "B", "after_s": 1.0}]'
    found = compiled(tmp_path, edge).sink.diagnostics
    assert not [d.render() for d in found]


def test_a_subset_keeps_the_times_of_its_states(tmp_path: Path) -> None:
    """`two` runs in A alone. A guard on it is removed with it, and with the last timed edge the tick counter of the
    state."""
    guard = {"instance": "two", "in": ["failed"]}
    edges = [{"from": "A", "to": "B", "after_s": 1.0}, {"from": "B", "to": "A", "after_s": 2.0, "health": guard}]
    whole = compiled(tmp_path, json.dumps(edges))
    path = tmp_path / "timed.json"
    part = compile_machine(path, "", until="schedule", instances=["one"]).checked
    assert [e.after_ticks for e in whole.checked.edges] == [100, 200]
    assert [e.after_ticks for e in part.edges] == [100] and part.counts_state_ticks
    assert not compile_machine(path, "", until="schedule", instances=["two"]).checked.counts_state_ticks


def test_a_picture_shows_the_time(tmp_path: Path) -> None:
    guard = {"instance": "one", "in": ["failed"]}
    edges = [
        {"after_s": 5.0},
        {"after_s": 0.25, "request": "GO"},
        {"after_s": 0.25, "request": "GO", "health": guard},
    ]
    shown = []
    for edge in edges:
        checked = compiled(tmp_path, json.dumps([{"from": "A", "to": "B", **edge}])).checked
        shown.append(transition_text(checked, checked.edges[0]))
    assert shown == ["after 5 s", "GO after 0.25 s", "GO when one failed after 0.25 s"]
