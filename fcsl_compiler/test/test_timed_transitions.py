# SPDX-License-Identifier: Apache-2.0
"""`after_s`: a transition that requires a minimum time in the state."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine
from fcsl_test_tables import kind, puppet_machine

__all__ = ["kind"]  # runs all tests here on both kinds of machine


def timed(tmp_path: Path, *edges: dict[str, Any]) -> Machine:
    """A machine at 1000 Hz whose puppets run in A and B at every tick, with these transitions."""
    return puppet_machine(tmp_path, transitions=list(edges), requests=["GO", "HALT"])


def states(m: Machine, ticks: int, **inputs: Sequence[int]) -> str:
    """States of the coming ticks. Each input (`one_ask`) is set to one value before each tick."""
    seen = ""
    for tick in range(ticks):
        for name, values in inputs.items():
            instance, _, port = name.partition("_")
            m.set(f"{instance}.inputs.{port}", values[tick])
        m.step()
        seen += m.state
    return seen


@pytest.mark.parametrize("after", [1, 2, 5])
def test_the_state_runs_so_many_ticks(tmp_path: Path, after: int) -> None:
    m = timed(tmp_path, {"from": "A", "to": "B", "after_s": after / 1000})
    assert states(m, after + 2) == "A" * after + "BB"


def test_each_entry_begins_anew(tmp_path: Path) -> None:
    there, back = ({"from": a, "to": b, "after_s": n} for a, b, n in (("A", "B", 0.003), ("B", "A", 0.002)))
    m = timed(tmp_path, there, back)
    seen = []
    for _ in range(7):
        m.step()
        seen.append((m.state, m.get("machine.ticks_in_state")))
    assert seen == [("A", 1), ("A", 2), ("A", 3), ("B", 1), ("B", 2), ("A", 1), ("A", 2)]


def test_a_request_counts_from_then_on(tmp_path: Path) -> None:
    """At the third tick and later; earlier requests are lost."""
    m = timed(tmp_path, {"from": "A", "to": "B", "after_s": 0.003, "request": "GO"})
    assert states(m, 7, one_ask=[1, 1, 0, 0, 1, 0, 0]) == "AAAAABB"
    m.force_state("A")
    assert states(m, 5, one_ask=[0, 1, 1, 0, 0]) == "AAABB"


def test_a_guard_is_looked_at_from_then_on(tmp_path: Path) -> None:
    guard = {"instance": "one", "in": ["failed"]}
    m = timed(tmp_path, {"from": "A", "to": "B", "after_s": 0.003, "health": guard})
    assert states(m, 7, one_ill=[2, 2, 0, 0, 2, 0, 0]) == "AAAAABB"


def test_the_larger_priority_wins_when_both_hold(tmp_path: Path) -> None:
    for time, request, expected in ((1, 2, "AAAC"), (2, 1, "AAAB")):
        edges = (
            {"from": "A", "to": "B", "after_s": 0.003, "priority": time},
            {"from": "A", "to": "C", "request": "HALT", "priority": request},
        )
        m = timed(tmp_path / expected, *edges)
        assert states(m, 4, two_ask=[0, 0, 2, 0]) == expected
        m.force_state("A")
        assert states(m, 2, two_ask=[2, 0]) == "AC"  # before its time the timed transition is not taken


def test_set_state_begins_anew_and_restore_brings_back(tmp_path: Path) -> None:
    m = timed(tmp_path, {"from": "A", "to": "B", "after_s": 0.004})
    assert states(m, 3) == "AAA"
    saved = m.save()
    m.force_state("A")
    assert m.get("machine.ticks_in_state") == 0 and m.get("one.outputs.health") == "nominal"
    assert states(m, 5) == "AAAAB"
    m.restore(saved)
    assert m.get("machine.ticks_in_state") == 3 and states(m, 2) == "AB"
    m.force_state("A")
    assert states(m, 5) == "AAAAB"


def test_set_state_cancels_what_time_has_latched(tmp_path: Path) -> None:
    m = timed(tmp_path, {"from": "A", "to": "B", "after_s": 0.002})
    assert states(m, 2) == "AA" and m.get("machine.next_state") == "B"
    m.force_state("A")
    assert states(m, 3) == "AAB"


def test_machines_without_time_do_not_count_it(tmp_path: Path) -> None:
    m = puppet_machine(tmp_path)
    assert "machine.ticks_in_state" not in m.fields and not m.d.after_ticks
