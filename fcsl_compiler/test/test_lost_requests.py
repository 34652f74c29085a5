# SPDX-License-Identifier: Apache-2.0
"""`machine.lost_requests`: for each transition, how often another one was taken while its request, guard and time held."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine
from fcsl_test_tables import kind, puppet_machine

__all__ = ["kind"]  # runs all tests here on both kinds of machine

GO = {"from": "A", "to": "B", "request": "GO", "priority": 2}
HALT = {"from": "A", "to": "C", "request": "HALT", "priority": 1}
ILL = {"instance": "two", "in": ["failed"]}


def lost(tmp_path: Path, *edges: dict[str, Any], ticks: int = 1, **inputs: int) -> Sequence[int]:
    """The counts after some ticks in which the inputs (`one_ask`) have these values."""
    m = puppet_machine(tmp_path, transitions=list(edges), requests=["GO", "HALT"])
    for name, value in inputs.items():
        m.set(name.replace("_", ".inputs."), value)
    m.step(ticks)
    counts: Sequence[int] = m.get("machine.lost_requests")
    return counts


def test_both_asked_for_in_one_tick(tmp_path: Path) -> None:
    assert lost(tmp_path, GO, HALT, one_ask=1, two_ask=2) == [0, 1]


def test_nothing_is_lost_alone(tmp_path: Path) -> None:
    for number, (ask, other) in enumerate([(1, 0), (0, 1), (2, 0), (1, 1), (2, 2), (0, 0)]):
        assert lost(tmp_path / str(number), GO, HALT, one_ask=ask, two_ask=other) == [0, 0]


def test_in_each_tick_and_state_anew(tmp_path: Path) -> None:
    """In A and B by turns: rows of the descriptor are those of A, then those of B."""
    back = {"from": "B", "to": "A", "request": "GO", "priority": 3}
    both = {**HALT, "from": ["A", "B"]}
    assert lost(tmp_path, GO, both, back, ticks=5, one_ask=1, two_ask=2) == [0, 3, 0, 2]


@pytest.mark.parametrize(
    ("winner", "loser"),
    [
        ({"health": ILL}, {}),
        ({"after_s": 0.001}, {}),
        ({"request": "GO"}, {"health": ILL}),
        ({"request": "GO"}, {"after_s": 0.001}),
    ],
)
def test_whatever_is_taken_instead(tmp_path: Path, winner: dict[str, Any], loser: dict[str, Any]) -> None:
    taken = {"from": "A", "to": "B", "priority": 2, **winner}
    assert lost(tmp_path, taken, {**HALT, **loser}, one_ask=1, two_ask=2, two_ill=2) == [0, 1]


@pytest.mark.parametrize(
    ("loser", "inputs"),
    [
        ({"health": ILL}, {}),
        ({"after_s": 0.002}, {}),
        ({"to": "B"}, {}),  # what was asked for happens
    ],
)
def test_what_is_not_lost(tmp_path: Path, loser: dict[str, Any], inputs: dict[str, int]) -> None:
    more = {"from": "A", "to": "C", "request": "HALT", "priority": 0}  # the field is there
    assert lost(tmp_path, GO, {**HALT, **loser}, {**more, "health": ILL}, one_ask=1, two_ask=2) == [0, 0, 0]


def test_a_request_that_another_transition_answers_is_not_lost(tmp_path: Path) -> None:
    healthy = {
        "from": "A",
        "to": "B",
        "request": "HALT",
        "priority": 2,
        "health": {"instance": "two", "in": ["nominal"]},
    }
    assert lost(tmp_path, healthy, HALT, {**GO, "to": "C", "priority": 0}, one_ask=2, two_ask=1) == [0, 0, 1]


def test_an_old_request_does_not_count(tmp_path: Path) -> None:
    """`two` runs in C in every third tick, and asks for A only there; the time ends the state in another one."""
    out = {"from": "C", "to": "B", "after_s": 0.005, "priority": 2}
    ask = {"from": "C", "to": "A", "request": "GO", "priority": 1, "after_s": 0.005}
    for start, count in ((0, 0), (1, 0), (2, 1)):  # the fifth tick in C is tick start + 4
        m = puppet_machine(tmp_path / str(start), transitions=[out, ask], requests=["HALT"])
        m.step(start)
        m.force_state("C")
        m.set("two.inputs.ask", 1)
        m.step(6)
        assert m.state == "B" and m.get("machine.lost_requests") == [0, count]


@pytest.mark.parametrize(
    "edges",
    [
        [],
        [GO],
        [GO, {"from": "A", "to": "C", "health": ILL, "priority": 1}],
        [GO, {"from": "B", "to": "C", "request": "HALT", "priority": 1}],
        [GO, {**HALT, "to": "B"}],
        [{**GO, "health": ILL}, {**GO, "to": "C", "priority": 1}],
    ],
)
def test_without_a_request_to_lose_there_is_no_count(tmp_path: Path, edges: list[dict[str, Any]]) -> None:
    m: Machine = puppet_machine(tmp_path, transitions=edges, requests=["GO", "HALT"])
    assert "machine.lost_requests" not in m.fields
