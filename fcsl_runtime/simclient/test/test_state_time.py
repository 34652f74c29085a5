# SPDX-License-Identifier: Apache-2.0
"""Timed transitions as a host sees them: in every kind of twin, in checkpoints, in recordings and their replay."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from simclient import AlgTwin, Twin
from simclient.bag import Bag
from simclient.replay import replay

LAW = """
class Law:
    inputs = {"go": "bool"}
    outputs = {"transition_request": "TransitionRequest"}

    def execute(self):
        if self.go:
            self.transition_request = "GO"
"""
#: Two ways from A to B: asked for at any time, or by itself after three ticks.
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "A",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law", "inputs": {"go": False}}},
    "always": {"law": 100},
    "states": {"A": {}, "B": {}},
    "transitions": [
        {"from": "A", "to": "B", "after_s": 0.03, "priority": 2},
        {"from": "A", "to": "B", "request": "GO", "priority": 1},
        {"from": "B", "to": "A", "after_s": 0.02, "request": "GO"},
    ],
}


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("timed")
    (folder / "law.py").write_text(LAW)
    (folder / "timed.json").write_text(json.dumps(CONFIG))
    return folder / "timed.json"


def states(twin: Twin, ticks: int) -> str:
    found = ""
    for _ in range(ticks):
        twin.tick()
        found += twin.state()
    return found


def test_every_twin_waits_as_long(open_twin: Callable[[Path], Twin], config: Path) -> None:
    twin = open_twin(config)
    assert states(twin, 5) == "AAABB" and twin.get_value("machine.ticks_in_state") == 2
    twin.set_state("A")
    assert states(twin, 2) == "AA"
    kept = twin.save()
    twin.set_state("A")  # begins anew
    assert states(twin, 4) == "AAAB"
    twin.restore(kept)
    assert twin.get_value("machine.ticks_in_state") == 2 and states(twin, 2) == "AB"


def test_a_checkpoint_goes_on_in_another_twin(open_twin: Callable[[Path], Twin], config: Path, tmp_path: Path) -> None:
    twin = open_twin(config)
    twin.tick(2)
    twin.save_file(tmp_path / "two.fcslcp")
    with AlgTwin.from_config(config) as other:
        other.restore_file(tmp_path / "two.fcslcp")
        assert states(other, 2) == "AB"


def test_a_recording_names_the_edge_and_replays(
    open_twin: Callable[[Path], Twin], config: Path, tmp_path: Path
) -> None:
    """The first change was asked for before the time of the other edge had come, the second not."""
    twin = open_twin(config)
    twin.record(tmp_path / "run")
    for tick in range(20):
        twin.set("law.inputs.go", tick in (1, 2, 3, 4, 10, 11))
        if tick == 8:
            twin.set_state("A")
        twin.tick()
    twin.close()
    bag = Bag(tmp_path / "run")
    events = [
        (m.tick, m.from_state, m.to_state, m.request)
        for topic, _, data in bag.messages(["/timed/transitions"])
        for m in [bag.decode_own(topic, data, ("tick", "from_state", "to_state", "request"))]
    ]
    assert events == [
        (1, "A", "B", "GO"),
        (3, "B", "A", "GO"),  # the request of tick 2 came too early
        (4, "A", "B", "GO"),
        (8, "B", "A", ""),  # by the host
        (10, "A", "B", ""),  # by time: the request of this tick has the smaller priority
    ]
    verdict = replay(tmp_path / "run", str(config))
    assert verdict.identical and verdict.ticks == 20


def test_the_table_of_transitions_has_the_times(config: Path) -> None:
    with AlgTwin.from_config(config) as twin:
        assert [(t.source, t.request, t.after_ticks) for t in twin.machine.transitions] == [
            ("A", "", 3),
            ("A", "GO", 0),
            ("B", "GO", 2),
        ]
