# SPDX-License-Identifier: Apache-2.0
"""Where a fault happened, as users see it: twins, bags, a start() that faults, and fcsl-fc's log, last state and `stats`."""

from __future__ import annotations

import json
import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from native import NEGATIVE, flying

from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin, FaultPlace, Twin, TwinError
from simclient.bag import Bag
from simclient.replay import replay

Open = Callable[[Path], Twin]
LAW = """class Law:
    inputs = {"i": "i32", "divisor": "i32"}
    outputs = {"x": "i32"}
    parameters = {"first": "i32"}
    state = {"v": "i32[3]"}

    def start(self):
        self.v[self.first] = 7

    def execute(self):
        self.x = self.v[self.i]
        self.x += 12 // self.divisor
"""
INDEX = FaultPlace("algorithms/law.py", 11, 18, "the index is outside [0, 3)")
DIVISOR = FaultPlace("algorithms/law.py", 12, 19, "the divisor is zero")


def write(folder: Path, first: int = 0) -> Path:
    """A machine of two instances, in whose `other` nothing faults."""
    law = {"algorithm": "Law", "parameters": {"first": first}, "inputs": {"divisor": 1}}
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Law": {"source": "algorithms/law.py"}},
        "instances": {"other": {**law, "parameters": {"first": 0}}, "law": law},
        "states": {"RUN": {"schedule": {"other": 100, "law": 100}}},
    }
    (folder / "algorithms").mkdir(parents=True)
    (folder / "algorithms" / "law.py").write_text(LAW)
    (folder / "places.json").write_text(json.dumps(config))
    return folder / "places.json"


def test_twins_name_the_last_fault(open_twin: Open, tmp_path: Path) -> None:
    twin = open_twin(write(tmp_path))
    twin.tick()
    assert twin.last_fault("law") is None and twin.get_value("law.counters.fault_place") == 0
    for inputs, expected in (
        ({"law.inputs.i": 7}, INDEX),
        ({"law.inputs.i": 7, "law.inputs.divisor": 0}, INDEX),  # the first one counts
        ({"law.inputs.i": 0, "law.inputs.divisor": 0}, DIVISOR),
        ({"law.inputs.divisor": 1}, DIVISOR),  # it stays
    ):
        twin.set_many(inputs)
        twin.tick()
        assert twin.last_fault("law") == expected
    assert str(expected) == "algorithms/law.py:12:19: the divisor is zero"
    assert twin.get_value("law.counters.faults") == 3 and twin.get_value("law.outputs.health") == "nominal"
    number = twin.get_value("law.counters.fault_place")
    assert isinstance(number, int) and twin.machine.fault_places[number - 1] == DIVISOR
    twin.fault("law")
    twin.tick()
    injected = twin.last_fault("law")
    assert injected is not None and (injected.file, str(injected)) == ("", "injected")
    assert twin.last_fault("other") is None
    with pytest.raises(TwinError, match="`lav` is not an instance; did you mean `law`"):
        twin.last_fault("lav")


def test_a_place_is_part_of_a_checkpoint(open_twin: Open, tmp_path: Path) -> None:
    twin = open_twin(write(tmp_path))
    twin.set("law.inputs.i", -1)
    twin.tick()
    saved = twin.save()
    twin.fault("law")
    twin.tick()
    twin.restore(saved)
    assert twin.last_fault("law") == INDEX
    with pytest.raises(TwinError, match="read-only"):
        twin.set("law.counters.fault_place", 0)


def test_a_start_that_faults_names_its_line(open_twin: Open, tmp_path: Path) -> None:
    place = "algorithms/law.py:8:9: the index is outside [0, 3)"
    with pytest.raises(TwinError, match=re.escape(f"start() of instance 'law' faulted: {place}")):
        open_twin(write(tmp_path, first=3))


def test_bags_tell_the_place_and_replay(open_twin: Open, tmp_path: Path) -> None:
    config = write(tmp_path)
    twin = open_twin(config)
    twin.record(tmp_path / "run")
    twin.tick(2)
    twin.set("law.inputs.i", 3)
    twin.tick(2)
    twin.set_many({"law.inputs.i": 0, "law.inputs.divisor": 0})
    twin.tick()
    twin.fault("other")
    twin.tick()
    twin.stop_recording()
    bag, topic = Bag(tmp_path / "run"), "/places/faults"
    messages = [bag.decode(topic, data) for _, _, data in bag.messages([topic])]
    told = [(m.tick, m.faults.tolist(), m.fault_place) for m in messages]
    assert told == [
        (0, [0, 0], ["", ""]),
        (2, [0, 1], ["", str(INDEX)]),
        (3, [0, 2], ["", str(INDEX)]),
        (4, [0, 3], ["", str(DIVISOR)]),
        (5, [1, 4], ["injected", str(DIVISOR)]),
    ]
    assert replay(tmp_path / "run", config).identical


# ---- fcsl-fc ------------------------------------------------------------------------------------------------------------


def test_the_log_tells_of_new_places_only(tmp_path: Path) -> None:
    """The fixture faults in every tick while the count is negative; an instance that goes on so fills no log."""
    with flying("--socket", tmp_path / "s", "--paused", "--summary", tmp_path / "end") as fc:
        client = fc.client(tmp_path / "s")
        client.ok("tick", count=3)
        assert client.ok("stats")["fault_places"] == {}
        client.set("sensors.outputs.count", -1)
        for _ in range(5):
            client.ok("tick", count=4)
            time.sleep(0.25)  # longer than the period of the monitor thread
        assert client.ok("stats")["fault_places"] == {"pilot": NEGATIVE}
        client.ok("inject", instance="pilot", what="fault")
        client.ok("tick")
        client.close()
        code, _, err = fc.stop()
    assert code == 0
    lines = err.splitlines()
    assert [line.split(" (")[0] for line in lines] == [
        f"fcsl-fc: 'pilot' faulted: {NEGATIVE}",
        "fcsl-fc: 'pilot' faulted: injected",
    ]
    instances = json.loads((tmp_path / "end").read_text())["instances"]
    assert (instances["pilot"]["fault_place"], instances["sensors"]["fault_place"]) == ("injected", "")


def test_a_short_run_tells_its_faults(tmp_path: Path) -> None:
    """Also those of its last tick, which nobody has looked at before it ends."""
    built = build_machine(write(tmp_path))
    with AlgTwin.from_library(built.library) as twin:
        twin.set("law.inputs.divisor", 0)
        twin.save_file(tmp_path / "begin")
    with flying("--restore", tmp_path / "begin", "--ticks", "2", library=str(built.library)) as fc:
        code, _, err = fc.wait()
    assert (code, err) == (0, f"fcsl-fc: 'law' faulted: {DIVISOR} (2 by tick 2)\n")


def test_a_restored_run_tells_only_its_own_faults(tmp_path: Path) -> None:
    """Those that its checkpoint counts happened elsewhere; what faults again is told, with the number of all."""
    built = build_machine(write(tmp_path))
    with AlgTwin.from_library(built.library) as twin:
        twin.set("law.inputs.divisor", 0)
        twin.tick(3)
        twin.save_file(tmp_path / "goes on")
        twin.set("law.inputs.divisor", 1)
        twin.save_file(tmp_path / "recovered")
    for begin, told in (("recovered", ""), ("goes on", f"fcsl-fc: 'law' faulted: {DIVISOR} (5 by tick 5)\n")):
        with flying("--restore", tmp_path / begin, "--ticks", "2", library=str(built.library)) as fc:
            code, _, err = fc.wait()
        assert (code, err) == (0, told)


def test_a_start_that_faults_ends_fcsl_fc(tmp_path: Path) -> None:
    built = build_machine(write(tmp_path, first=-1))
    with flying("--ticks", "1", library=str(built.library)) as fc:
        code, _, err = fc.wait()
    assert code == 1 and "start() of instance 'law' faulted: algorithms/law.py:8:9: the index is outside" in err
