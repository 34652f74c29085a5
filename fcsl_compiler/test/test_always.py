# SPDX-License-Identifier: Apache-2.0
"""`always`: a schedule that is part of every state."""

from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import write_machine
from fcsl_test_tables import COUNTER, kind, machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.dump import dump_schedule
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.model.machine import Machine as Checked

__all__ = ["kind"]

NAMES = ("slow", "fast", "own")
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "A",
    "instances": {n: {"algorithm": "Counter"} for n in NAMES},
    "always": {"fast": 100, "slow": {"hz": 50, "phase": 1}},
    "states": {"A": {"schedule": {"own": 100}}, "B": {}},
}


def checked(folder: Path, config: dict[str, Any], instances: tuple[str, ...] = ()) -> Checked:
    path = write_machine(folder, "craft", config, {"counter": COUNTER})
    return compile_machine(path, "", until="schedule", instances=instances or None).checked


def test_it_runs_in_every_state_and_no_change_of_mode_cuts_it(tmp_path: Path) -> None:
    m = machine(tmp_path, CONFIG, counter=COUNTER)
    seen = []
    for state in "AABBBA":
        m.force_state(state)
        m.step()
        seen.append([(m.get(f"{n}.outputs.runs"), m.get(f"{n}.outputs.health")) for n in NAMES])
    ok, out = "nominal", "stale"
    assert seen == [
        [(0, out), (1, ok), (1, ok)],  # slow is due at ticks 1, 3, 5
        [(1, ok), (2, ok), (2, ok)],
        [(1, ok), (3, ok), (2, out)],
        [(2, ok), (4, ok), (2, out)],
        [(2, ok), (5, ok), (2, out)],
        [(3, ok), (6, ok), (3, ok)],
    ]


def test_it_is_the_same_machine_as_one_that_lists_everything(tmp_path: Path) -> None:
    always = CONFIG["always"]
    listed = {**CONFIG, "states": {"A": {"schedule": {"own": 100, **always}}, "B": {"schedule": always}}}
    del listed["always"]
    assert dump_schedule(checked(tmp_path / "one", CONFIG)) == dump_schedule(checked(tmp_path / "other", listed))


def test_a_subset_keeps_its_part_of_it(tmp_path: Path) -> None:
    """A subset keeps in all states what `always` runs, and removes the rest."""
    states = checked(tmp_path, CONFIG, ("slow",)).states
    assert [(s.name, [(e.divisor, e.phase) for e in s.entries]) for s in states] == [("A", [(2, 1)]), ("B", [(2, 1)])]
    assert [s.name for s in checked(tmp_path, CONFIG, ("own",)).states] == ["A"]


def test_a_state_that_lists_it_again_is_told_where(tmp_path: Path) -> None:
    config = {**CONFIG, "states": {"A": {"schedule": {"own": 100, "fast": 50}}, "B": {"schedule": {"fast": 100}}}}
    with pytest.raises(DiagnosticError) as caught:
        checked(tmp_path, config)
    found = caught.value.diagnostics
    assert [d.code for d in found] == ["E243", "E243"]
    assert "`fast` is in `always`, so state `A` schedules it already" in found[0].render()
    (note,) = found[0].notes
    assert note.text == "scheduled in every state here"
    assert note.span.line < found[0].span.line
    assert '"fast": 100' in (tmp_path / "craft.json").read_text().splitlines()[note.span.line - 1]


def test_of_a_wrong_entry_there_is_one_message(tmp_path: Path) -> None:
    """An entry in `always` belongs to two states but is one mistake. A state that repeats it gives no second message
    about the rate."""
    for always, states, codes in (
        ({"fsat": 100}, {"A": {}, "B": {}}, ["E206"]),
        ({"fast": 30}, {"A": {}, "B": {"schedule": {"fast": 30}}}, ["E220", "E243"]),
        ({}, {"A": {}, "B": {"schedule": {"fast": 100}}}, ["E202"]),
        ([], {"A": {}, "B": {}}, ["E208"]),
    ):
        with pytest.raises(DiagnosticError) as caught:
            checked(tmp_path, {**CONFIG, "always": always, "states": states})
        assert [d.code for d in caught.value.diagnostics if d.code[0] == "E"] == codes
