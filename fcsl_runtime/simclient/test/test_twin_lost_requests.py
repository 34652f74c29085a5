# SPDX-License-Identifier: Apache-2.0
"""Requests that transitions have lost to others, as users see them: twins, fcsl-fc's end and its summary."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from native import flying

from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin, Twin, TwinError

Open = Callable[[Path], Twin]
PILOT = """class Pilot:
    inputs = {"go": "bool"}
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"wish": "TransitionRequest"}

    def execute(self):
        self.transition_request = self.wish if self.go else ""
"""


def write(folder: Path, abort_priority: int = 1) -> Path:
    """HOVER, CRUISE, SAFE. A monitor's ABORT has two transitions that differ in their guards alone."""

    def one(wish: str) -> dict[str, object]:
        return {"algorithm": "Pilot", "parameters": {"wish": wish}, "inputs": {"go": False}}

    abort = {"from": "*", "to": "SAFE", "request": "ABORT"}
    healthy, not_stale = ({"instance": "pilot", "in": words} for words in (["nominal"], ["nominal", "failed"]))
    config = {
        "tick_hz": 100,
        "initial_state": "HOVER",
        "algorithms": {"Pilot": {"source": "law.py"}},
        "instances": {"pilot": one("CRUISE"), "monitor": one("ABORT")},
        "always": {"pilot": 100, "monitor": 100},
        "states": {"HOVER": {}, "CRUISE": {}, "SAFE": {}},
        "transitions": [
            {**abort, "priority": abort_priority, "health": healthy},
            {**abort, "priority": abort_priority - 1, "health": not_stale},
            {"from": "HOVER", "to": "CRUISE", "request": "CRUISE", "priority": 5},
        ],
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "law.py").write_text(PILOT)
    (folder / "craft.json").write_text(json.dumps(config))
    return folder / "craft.json"


BOTH = {"pilot.inputs.go": True, "monitor.inputs.go": True}


def test_twins_name_what_is_lost(open_twin: Open, tmp_path: Path) -> None:
    twin = open_twin(write(tmp_path))
    assert twin.lost_requests() == {}
    twin.set_many(BOTH)
    twin.tick()
    lost = {"HOVER -> SAFE: ABORT": 2}  # the two transitions have one name
    assert twin.lost_requests() == lost
    saved = twin.save()
    twin.tick(2)
    assert (twin.state(), twin.lost_requests()) == ("SAFE", lost)
    twin.set_state("HOVER")
    twin.tick()
    assert twin.lost_requests() == {"HOVER -> SAFE: ABORT": 4}
    twin.restore(saved)
    assert twin.lost_requests() == lost
    assert twin.get_value("machine.lost_requests") == [0, 1, 1, 0, 0]
    with pytest.raises(TwinError, match="read-only"):
        twin.set("machine.lost_requests[0]", 0)


def test_what_cannot_be_lost_is_not_counted(open_twin: Open, tmp_path: Path) -> None:
    twin = open_twin(write(tmp_path / "first", abort_priority=9))
    twin.set_many(BOTH)
    twin.tick(2)
    assert (twin.state(), twin.lost_requests()) == ("SAFE", {"HOVER -> CRUISE: CRUISE": 1})
    path = write(tmp_path)
    config = json.loads(path.read_text())
    config |= {"transitions": config["transitions"][:2], "requests": ["CRUISE"]}
    path.write_text(json.dumps(config))
    assert open_twin(path).lost_requests() == {}


def test_a_flight_names_them_at_its_end(tmp_path: Path) -> None:
    built = build_machine(write(tmp_path))
    for inputs, lost in ((BOTH, {"HOVER -> SAFE: ABORT": 2}), ({}, {})):
        with AlgTwin.from_library(built.library) as twin:
            twin.set_many(inputs)
            twin.save_file(tmp_path / "begin")
        summary, begin = tmp_path / "end", tmp_path / "begin"
        with flying("--restore", begin, "--ticks", "3", "--summary", summary, library=str(built.library)) as fc:
            code, out, err = fc.wait()
        told = [line for line in out.splitlines() if "lost requests" in line]
        assert (code, err, told) == (0, "", [f"fcsl-fc: lost requests: {name} {n}" for name, n in lost.items()])
        assert json.loads(summary.read_text())["lost_requests"] == lost


def test_the_variable_server_names_them(tmp_path: Path) -> None:
    built = build_machine(write(tmp_path))
    with flying("--socket", tmp_path / "s", "--paused", library=str(built.library)) as fc:
        client = fc.client(tmp_path / "s")
        assert client.ok("stats")["lost_requests"] == {}
        for path, value in BOTH.items():
            client.set(path, value)
        client.ok("tick")
        assert client.ok("stats")["lost_requests"] == {"HOVER -> SAFE: ABORT": 2}
        client.close()
        fc.stop()
