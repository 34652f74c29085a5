# SPDX-License-Identifier: Apache-2.0
"""Healths and requests as values like others: in every dictionary, in arrays, structs and helpers, read as names by all hosts."""

from __future__ import annotations

import csv
import json
import random
import re
import struct
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from native import Client, flying
from rosbags.highlevel import AnyReader
from telemetry_page import Port, read
from test_checkpoint import Parts

from fcsl_compiler.driver.cache import build_machine
from simclient import AlgTwin, PyTwin, Twin, TwinError
from simclient.bag import Bag, columns
from simclient.bag.digest import digest
from simclient.bag.export import select, write
from simclient.machine_build import build_config
from simclient.replay import replay
from simclient.replay.outputs import Outputs
from simclient.run import open_run
from simclient.telemetry.receiver import Telemetry
from simclient.vars.client import VarClient

HEALTHS = ["nominal", "degraded", "failed", "stale"]
REQUESTS = ["", "tr_GO", "tr_STOP", "tr_PARK"]
WORDS = """
def worse(one: Health, other: Health) -> Health:
    return other if one == "nominal" else one


class Source:
    outputs = {
        "mode": "Health",  # what a host says
        "modes": "Health[2][2]",
        "wish": "TransitionRequest",
        "wishes": "TransitionRequest[3]",
        "status": "Status",
        "crew": "Status[2]",
    }

    def execute(self):
        pass


class Judge:
    inputs = {
        "seen": "Health",
        "seen_modes": "Health[2][2]",
        "wanted": "TransitionRequest",
        "wanted_each": "TransitionRequest[3]",
        "told": "Status",
        "told_crew": "Status[2]",
        "own": "Health",
    }
    outputs = {
        "verdict": "Health",
        "log": "Health[3]",
        "next": "TransitionRequest",
        "plan": "TransitionRequest[2]",
        "report": "Status",
        "all": "Status[2]",
        "begun": "bool",
        "transition_request": "TransitionRequest",
    }
    parameters = {"on_done": "TransitionRequest", "least": "Health", "route": "TransitionRequest[2]", "home": "Status"}
    state = {"last": "Health", "asked": "TransitionRequest", "memory": "Status", "trail": "Health[3]"}

    def start(self):
        self.last = "failed"
        self.asked = "STOP"
        self.memory.health = "degraded"

    def execute(self):
        self.begun = self.own == "stale"
        self.verdict = worse(worse(self.seen, self.told.health), self.least)
        for i in range(2):
            self.log[i] = self.seen_modes[i, 1]
            self.plan[i] = self.wanted_each[i + 1]
        self.log[2] = self.last
        self.next = self.on_done if self.verdict == "failed" else self.route[1]
        self.report = self.told
        self.report.wish = self.asked
        self.report.trail[1] = self.home.health
        self.all = self.told_crew
        for i in range(2):
            self.trail[2 - i] = self.trail[1 - i]
        self.trail[0] = self.verdict
        if self.memory.wish == "GO":
            self.memory.level += 1.0
        self.memory.wish = self.told.wish
        self.transition_request = self.wanted
        self.last = self.verdict
        self.asked = self.wanted
        self.health = "degraded" if self.verdict == "failed" else "nominal"
"""
HOME = {"level": 2.5, "health": "failed", "wish": "GO", "trail": ["nominal", "degraded"]}
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "IDLE",
    "structs": {"Status": {"level": "f64 m", "health": "Health", "wish": "TransitionRequest", "trail": "Health[2]"}},
    "algorithms": {"Source": {"source": "words.py"}, "Judge": {"source": "words.py"}},
    "instances": {
        "source": {"algorithm": "Source"},
        "judge": {
            "algorithm": "Judge",
            "parameters": {"on_done": "PARK", "least": "nominal", "route": ["", "STOP"], "home": HOME},
        },
    },
    "connections": [
        {"from": "source.mode", "to": "judge.seen"},
        {"from": "source.modes", "to": "judge.seen_modes"},
        {"from": "source.wish", "to": "judge.wanted"},
        {"from": "source.wishes", "to": "judge.wanted_each"},
        {"from": "source.status", "to": "judge.told"},
        {"from": "source.crew", "to": "judge.told_crew"},
        {"from": "judge.health", "to": "judge.own", "delayed": True, "initial": "stale"},
    ],
    "states": {
        "IDLE": {"schedule": {"source": 100, "judge": 100}},
        "RUN": {"schedule": {"source": 100, "judge": 50}},
        "PARKED": {"schedule": {"judge": 100}},
    },
    "transitions": [
        {"from": "IDLE", "to": "RUN", "request": "GO", "priority": 1},
        {"from": "RUN", "to": "IDLE", "request": "STOP", "priority": 1},
        {"from": ["IDLE", "RUN"], "to": "PARKED", "request": "PARK", "priority": 2},
    ],
}
OUTPUTS = [f"judge.outputs.{name}" for name in ("verdict", "log", "next", "plan", "report", "all", "health")]
INSIDE = ["judge.state.last", "judge.state.asked", "judge.state.memory", "judge.state.trail", "judge.inputs.own"]


@pytest.fixture(scope="module")
def config(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("words")
    (folder / "words.py").write_text(WORDS)
    (folder / "craft.json").write_text(json.dumps(CONFIG))
    return folder / "craft.json"


@pytest.fixture
def twin(open_twin: Callable[[Path], Twin], config: Path) -> Twin:
    return open_twin(config)


def status(chance: random.Random) -> dict[str, Any]:
    trail = [chance.choice(HEALTHS) for _ in range(2)]
    return {"level": chance.random(), "health": chance.choice(HEALTHS), "wish": chance.choice(REQUESTS), "trail": trail}


def values(chance: random.Random) -> dict[str, Any]:
    """What is written in a tick: whole fields, elements, members."""
    health, request = (lambda: chance.choice(HEALTHS)), (lambda: chance.choice(REQUESTS[:3]))
    return {
        "source.outputs.mode": health(),
        "source.outputs.modes": [[health(), health()] for _ in range(2)],
        "source.outputs.wish": request(),
        "source.outputs.wishes": [request() for _ in range(3)],
        "source.outputs.status": status(chance),
        "source.outputs.crew": [status(chance), status(chance)],
        "judge.parameters.least": health(),
        "judge.parameters.route[1]": request(),
        "judge.parameters.home.health": health(),
        "judge.state.memory.wish": request(),
    }


def fly(twin: Twin, ticks: int) -> list[dict[str, Any]]:
    """What it shows after each tick."""
    chance, seen = random.Random(5), []
    for _ in range(ticks):
        twin.set_many(values(chance))
        twin.tick()
        seen.append(twin.get_many([*OUTPUTS, *INSIDE, "judge.outputs.transition_request", "machine.state"]))
    return seen


# ---- twins ------------------------------------------------------------------------------------------------------------


def test_they_are_read_and_set_as_names(twin: Twin) -> None:
    assert twin.get_value("judge.parameters.home") == {**HOME, "wish": "tr_GO"}
    assert twin.get_value("judge.parameters.route") == ["", "tr_STOP"]
    assert twin.get_value("judge.inputs.own") == "stale"  # the connection's `initial`
    assert twin.get_many(["judge.state.last", "judge.state.asked", "judge.state.memory.health"]) == {
        "judge.state.last": "failed",
        "judge.state.asked": "tr_STOP",
        "judge.state.memory.health": "degraded",
    }
    written = {p: v for p, v in values(random.Random(1)).items() if p.startswith("source")}
    twin.set_many(written)
    assert twin.get_many(written) == written
    twin.set("source.outputs.modes[1][0]", "failed")
    twin.set("source.outputs.crew[1].trail[0]", "stale")
    twin.set("source.outputs.wishes[2]", "tr_PARK")
    assert twin.get_value("source.outputs.modes[1]")[0] == "failed"
    assert twin.get_value("source.outputs.crew")[1]["trail"][0] == "stale"
    assert twin.get_value("source.outputs.wishes[2]") == "tr_PARK"
    twin.tick()
    assert twin.get_value("judge.outputs.begun") is True and twin.get_value("judge.outputs.plan")[1] == "tr_PARK"
    assert str(twin.describe("source.outputs.modes")) == "source.outputs.modes: Health[2][2] (output)"
    twin.set("source.outputs.mode", "failed")
    twin.run_until(
        "judge.outputs.verdict == 'failed' and judge.outputs.next == 'tr_PARK' and judge.inputs.own != 'stale'", 5
    )
    with pytest.raises(TwinError, match="does not hold after 3 ticks"):
        twin.run_until("judge.outputs.plan[1] == 'tr_GO'", 3)


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        ("source.outputs.mode", "fialed", "Health wanted, got 'fialed'; did you mean `failed`?"),
        ("source.outputs.mode", 2, "Health wanted, got 2; one of 'nominal', 'degraded', 'failed', 'stale'"),
        ("source.outputs.wish", "GOO", "TransitionRequest wanted, got 'GOO'"),
        ("source.outputs.wish", "tr_tr_GO", "TransitionRequest wanted, got 'tr_tr_GO'"),
        ("source.outputs.wish", "tr_GOO", "did you mean `tr_GO`?"),
        ("source.outputs.wish", None, "one of '', 'tr_GO', 'tr_STOP', 'tr_PARK'"),
        ("source.outputs.modes", [["nominal"] * 2], "Health[2][2] wanted, got a list of 1"),
        ("source.outputs.status", {**HOME, "wish": "tr_"}, "source.outputs.status.wish: TransitionRequest wanted"),
        ("judge.outputs.transition_request", "tr_GO", "read-only"),
    ],
)
def test_what_is_no_name_is_refused(twin: Twin, path: str, value: Any, said: str) -> None:
    before = twin.save()
    with pytest.raises(TwinError, match=re.escape(said)):
        twin.set(path, value)
    assert twin.save() == before


def test_every_kind_of_twin_computes_the_same(config: Path, open_twin: Callable[[Path], Twin], tmp_path: Path) -> None:
    twin = open_twin(config)
    twin.record(tmp_path / "bag")
    seen = fly(twin, 60)
    twin.stop_recording()
    with AlgTwin.from_config(config) as other:
        other.record(tmp_path / "other")
        assert fly(other, 60) == seen
    assert digest(tmp_path / "bag") == digest(tmp_path / "other")
    for path in ("judge.outputs.verdict", "judge.outputs.next", "machine.state"):
        assert len({after[path] for after in seen}) > 1, path
    verdict = replay(tmp_path / "bag", str(config))
    assert verdict.identical and verdict.ticks == 60, str(verdict)


def test_a_table_of_a_bag_spells_them_as_a_twin_does(config: Path, tmp_path: Path) -> None:
    """In arrays and structs, too; the bag has numbers, and the definitions that name them."""
    import pyarrow.parquet

    with AlgTwin.from_config(config) as twin, twin.trace(*OUTPUTS, "judge.outputs.transition_request") as trace:
        twin.record(tmp_path / "bag")
        fly(twin, 60)
        trace.to_csv(tmp_path / "twin.csv")
    exported = select(Bag(tmp_path / "bag"))
    write(exported, tmp_path / "bag.csv")
    wanted, found = (list(csv.DictReader((tmp_path / f"{of}.csv").open())) for of in ("twin", "bag"))
    judged = [name for name in wanted[0] if name.startswith("judge.") and not name.endswith(".level")]
    assert len(judged) == 21
    for name in judged:
        assert [row[name] for row in found] == [row[name] for row in wanted], name
    assert {row["judge.outputs.log[0]"] for row in found} == set(HEALTHS)
    assert {row["judge.outputs.transition_request"] for row in found} == set(REQUESTS[:3])
    write(exported, tmp_path / "bag.parquet")
    table = pyarrow.parquet.read_table(tmp_path / "bag.parquet")
    assert table.schema.field("judge.outputs.verdict").type == table.schema.field("machine.state").type
    assert table["judge.outputs.log[1]"].to_pylist() == [row["judge.outputs.log[1]"] for row in wanted]


def test_outputs_in_memory_are_those_of_a_recording(config: Path, tmp_path: Path) -> None:
    """All kinds of outputs: the digest, and columns, also of an output that no message has."""
    kept = ["judge.outputs.verdict", "judge.outputs.plan", "machine.state", "source.outputs.transition_request"]
    with closing(open_run(*build_config(config))) as run:
        outputs = Outputs(run, kept)
        run.record(tmp_path / "bag", "", True)
        wanted = run.machine.fields["source.outputs.wish"]
        for tick, request in enumerate((0, 1, 0, 2, 3, 0)):
            run.set(wanted.index, 0, struct.pack("<i", request))
            run.step(1 + 7 * tick)
            outputs.collect()
        run.record_stop()
    assert outputs.digest() == digest(tmp_path / "bag")
    for path in kept[:3]:
        assert outputs.column(path).tolist() == columns(tmp_path / "bag", path)[1].tolist(), path
    assert set(outputs.column("machine.state")) == {"IDLE", "RUN", "PARKED"}
    assert outputs.column(kept[3]).tolist() == [0] * len(outputs.column("machine.state"))


def test_a_table_of_chosen_fields_has_healths_in_words(config: Path, tmp_path: Path) -> None:
    """Definitions made for chosen fields have no constants, so requests stay numbers there."""
    with closing(open_run(*build_config(config))) as run:
        run.record(tmp_path / "bag", "", True, "judge.outputs.verdict,judge.outputs.next,judge.inputs.told*")
        run.step(3)
        run.record_stop()
    (judge,) = [s for s in select(Bag(tmp_path / "bag")).series if s.prefix == "judge.outputs."]
    (told,) = [s for s in select(Bag(tmp_path / "bag")).series if s.prefix == "judge.inputs."]
    assert judge.columns["judge.outputs.verdict"].tolist() == ["nominal"] * 3
    assert judge.columns["judge.outputs.next"].tolist() == [2, 2, 2]
    assert told.columns["judge.inputs.told.trail"].tolist() == [["nominal", "nominal"]] * 3


ASKS = """
class Asks:
    inputs = {"wanted": "TransitionRequest", "told": "Wish"}
    outputs = {"shown": "TransitionRequest[2]", "transition_request": "TransitionRequest"}
    parameters = {"on_done": "TransitionRequest"}
    state = {"kept": "TransitionRequest"}

    def execute(self):
        for request in range(1):
            self.transition_request = self.on_done
        if self.wanted != "":
            self.transition_request = self.wanted
        if self.told.request != "":
            self.transition_request = self.told.request
        if self.kept != "":
            self.transition_request = self.kept
        if self.shown[1] != "":
            self.transition_request = self.shown[1]
"""


@pytest.mark.parametrize(
    "path",
    ["inputs.wanted", "inputs.told.request", "outputs.shown[1]", "parameters.on_done", "state.kept"],
)
def test_a_request_counts_wherever_it_came_from(open_twin: Callable[[Path], Twin], path: str, tmp_path: Path) -> None:
    """No code names it: a host, or a connection, brings it."""
    (tmp_path / "asks.py").write_text(ASKS)
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "structs": {"Wish": {"request": "TransitionRequest"}},
        "algorithms": {"Asks": {"source": "asks.py"}},
        "instances": {"asks": {"algorithm": "Asks", "parameters": {"on_done": ""}}},
        "states": {"A": {"schedule": {"asks": 10}}, "B": {"schedule": {"asks": 10}}},
        "transitions": [{"from": "A", "to": "B", "request": "GO"}],
    }
    (tmp_path / "craft.json").write_text(json.dumps(config))
    twin = open_twin(tmp_path / "craft.json")
    twin.tick(2)
    assert twin.state() == "A"
    twin.set(f"asks.{path}", "tr_GO")
    twin.tick(2)
    assert twin.state() == "B"


@pytest.mark.parametrize("plain", ["GO", "STOP", "PARK"])
def test_a_request_is_set_as_algorithms_write_it(twin: Twin, plain: str) -> None:
    """It reads back as the specification says."""
    twin.set("source.outputs.wish", plain)
    assert twin.get_value("source.outputs.wish") == f"tr_{plain}"
    twin.set("source.outputs.wishes", [plain, f"tr_{plain}", ""])
    assert twin.get_value("source.outputs.wishes") == [f"tr_{plain}", f"tr_{plain}", ""]
    twin.set("source.outputs.status", {**HOME, "wish": plain})
    assert twin.get_value("source.outputs.status") == {**HOME, "wish": f"tr_{plain}"}
    twin.inject({"source.outputs.wish": ["", plain]})
    assert twin.get_value("source.outputs.wish") == f"tr_{plain}"
    with pytest.raises(TwinError, match=f"did you mean `tr_{plain}`|one of"):  # a comparison is of what is read
        twin.run_until(f"source.outputs.wish == '{plain}'", 1)


def test_a_request_whose_name_begins_with_the_prefix(tmp_path: Path, open_twin: Callable[[Path], Twin]) -> None:
    """What is read back goes before what algorithms write."""
    (tmp_path / "law.py").write_text(
        'class Law:\n    inputs = {"wish": "TransitionRequest"}\n\n    def execute(self):\n        pass\n'
    )
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Law": {"source": "law.py"}},
        "instances": {"law": {"algorithm": "Law"}},
        "states": {"A": {"schedule": {"law": 10}}},
        "requests": ["tr_GO", "GO", "tr_STOP"],
    }
    (tmp_path / "craft.json").write_text(json.dumps(config))
    twin = open_twin(tmp_path / "craft.json")
    for given, kept in (
        ("GO", "tr_GO"),
        ("tr_GO", "tr_GO"),
        ("tr_tr_GO", "tr_tr_GO"),
        ("tr_STOP", "tr_tr_STOP"),
        ("", ""),
    ):
        twin.set("law.inputs.wish", given)
        assert twin.get_value("law.inputs.wish") == kept


def test_traces_and_profiles_have_names(twin: Twin, tmp_path: Path) -> None:
    chance = random.Random(2)
    modes = np.array([chance.choice(HEALTHS) for _ in range(12 * 4)]).reshape(12, 2, 2)
    wishes = [chance.choice(REQUESTS[:3]) for _ in range(12)]
    paths = ("judge.outputs.log", "source.outputs.wish", "judge.outputs.all", "judge.state.last")
    with twin.trace(*paths) as trace:
        twin.inject({"source.outputs.modes": modes, "source.outputs.wish": wishes})
    assert trace["judge.outputs.log"].shape == (12, 3) and trace["source.outputs.wish"].tolist() == wishes
    ran = [
        k
        for k in range(12)
        if k == 0 or trace["judge.outputs.log"][k].tolist() != trace["judge.outputs.log"][k - 1].tolist()
    ]
    assert all(trace["judge.outputs.log"][k, :2].tolist() == modes[k, :, 1].tolist() for k in ran) and len(ran) > 3
    assert trace["judge.outputs.all"]["wish"].tolist() == [["", ""]] * 12
    trace.to_csv(tmp_path / "trace.csv")
    with open(tmp_path / "trace.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["source.outputs.wish"] for row in rows] == wishes
    assert rows[3]["judge.outputs.log[1]"] == trace["judge.outputs.log"][3, 1]
    with pytest.raises(TwinError, match=r"source.outputs.wish at tick 1: TransitionRequest wanted, got 'LEAVE'"):
        twin.inject({"source.outputs.wish": ["tr_GO", "LEAVE"]})


def test_checkpoints_carry_them(config: Path, open_twin: Callable[[Path], Twin]) -> None:
    twin = open_twin(config)
    fly(twin, 7)
    saved, before = twin.save(), twin.get_many([*OUTPUTS, *INSIDE])
    after = fly(twin, 20)
    for kind in (AlgTwin, PyTwin):
        with kind.from_config(config) as other:
            other.restore(saved)
            assert other.get_many([*OUTPUTS, *INSIDE]) == before and fly(other, 20) == after


@pytest.mark.parametrize(
    ("path", "number"),
    [
        ("judge.state.last", 4),
        ("judge.state.asked", 4),
        ("judge.state.trail", -1),
        ("judge.parameters.route", 9),
        ("judge.outputs.all[1].wish", 4),
        ("source.outputs.crew[0].trail", 2**31 - 1),
    ],
)
def test_a_checkpoint_with_what_is_no_name_is_refused(config: Path, path: str, number: int) -> None:
    with AlgTwin.from_config(config) as twin:
        field = twin.machine.fields[path]
        good = Parts.of(twin.save())
        data = bytearray(good.data)
        struct.pack_into("<i", data, field.offset + field.size - 4, number)
        bad = good._replace(data=bytes(data)).whole()
        with pytest.raises(TwinError, match=re.escape(path)):
            twin.restore(bad)
        assert twin.save() == good.whole()


# ---- bags and messages ------------------------------------------------------------------------------------------------


def numbers(value: Any) -> Any:
    """As ROS has it: the number of each name, arrays flat."""
    if isinstance(value, dict):
        return {name: numbers(member) for name, member in value.items()}
    if isinstance(value, list):
        inner = [numbers(item) for item in value]
        return [x for item in inner for x in (item if isinstance(item, list) else [item])]
    return (HEALTHS if value in HEALTHS else REQUESTS).index(value) if isinstance(value, str) else value


def as_value(message: Any) -> Any:
    if hasattr(message, "__msgtype__"):
        members = [name for name in message.__dataclass_fields__ if name != "__msgtype__" and not name.isupper()]
        return {name: as_value(getattr(message, name)) for name in members}
    if isinstance(message, list):
        return [as_value(item) for item in message]
    return message.tolist() if hasattr(message, "tolist") else message


def test_a_message_has_their_numbers_and_the_constants_that_name_them(twin: Twin, tmp_path: Path) -> None:
    twin.record(tmp_path / "bag")
    seen = fly(twin, 25)
    twin.stop_recording()
    names = ("verdict", "log", "next", "plan", "report", "all", "health")
    with AnyReader([tmp_path / "bag"]) as reader:
        (judge,) = [c for c in reader.connections if c.topic == "/craft/judge"]
        messages = [reader.deserialize(data, judge.msgtype) for _, _, data in reader.messages([judge])]
        constants = dict(re.findall(r"^\w+ (TR_\w+|[A-Z]+)=(\d+)$", judge.msgdef.data, re.MULTILINE))
        own, _, part = judge.msgdef.data.partition("MSG: ")
    for message, after in zip(messages, seen, strict=True):
        assert as_value(message) | {n: numbers(after[f"judge.outputs.{n}"]) for n in names} == as_value(message)
    assert constants == {n.upper(): str(i) for i, n in enumerate(HEALTHS)} | {
        "TR_NONE": "0",
        **{n.upper(): str(i) for i, n in enumerate(REQUESTS) if n},
    }
    for text in (own, part):  # each message by itself says what its numbers are
        assert all(f"{name}=" in text for name in constants)
    assert "uint8 verdict # Health\n" in own and "int32[2] plan # TransitionRequest\n" in own
    assert "int32 wish # TransitionRequest\n" in part


def test_columns_have_the_numbers_of_the_messages(config: Path, tmp_path: Path) -> None:
    run = open_run(*build_config(str(config)))
    chosen = "judge.inputs.*,judge.parameters.*,judge.state.*,judge.outputs.*"
    run.record(tmp_path / "bag", "", True, chosen)
    mode, wish = (run.machine.fields[f"source.outputs.{name}"].index for name in ("mode", "wishes"))
    run.set(mode, 0, struct.pack("<i", 1))
    run.set(wish, 1, struct.pack("<2i", 3, 2))
    run.step(3)
    run.close()
    found = {
        "judge.inputs.seen": [1] * 3,
        "judge.inputs.wanted_each": [[0, 3, 2]] * 3,
        "judge.inputs.own": [3, 0, 0],
        "judge.parameters.on_done": [3] * 3,
        "judge.parameters.home.trail": [[0, 1]] * 3,
        "judge.parameters.home.wish": [1] * 3,
        "judge.state.trail": [[1, 0, 0], [1, 1, 0], [1, 1, 1]],
        "judge.state.memory.health": [1] * 3,
        "judge.outputs.verdict": [1] * 3,
        "judge.outputs.plan": [[3, 2]] * 3,
        "judge.outputs.report.wish": [2, 0, 0],
        "judge.outputs.all[1].trail": [[0, 0]] * 3,
    }
    bag = Bag(tmp_path / "bag")
    assert {path: columns(bag, path)[1].tolist() for path in found} == found
    assert replay(tmp_path / "bag", str(config)).identical


def test_a_divergence_is_told_in_names(config: Path, tmp_path: Path) -> None:
    with AlgTwin.from_config(config) as twin:
        twin.record(tmp_path / "bag")
        fly(twin, 20)
    for old, new, path in (
        ("self.next = self.on_done if", 'self.next = "GO" if', "judge.outputs.next"),
        ("self.log[2] = self.last", 'self.log[2] = "degraded"', "judge.outputs.log[2]"),
        ("self.report.wish = self.asked", 'self.report.wish = ""', "judge.outputs.report.wish"),
    ):
        (tmp_path / "words.py").write_text(WORDS.replace(old, new))
        (tmp_path / "craft.json").write_text(config.read_text())
        divergence = replay(tmp_path / "bag", str(tmp_path / "craft.json"), ignore_source_hash=True).divergence
        assert divergence is not None and divergence.path == path
        said = [*HEALTHS, *REQUESTS]
        assert {divergence.recorded.strip("'"), divergence.replayed.strip("'")} <= set(said), divergence


def test_pictures_of_such_bags(config: Path, tmp_path: Path) -> None:
    from simclient.view.picture import plot
    from simclient.view.rrd import to_rerun

    with AlgTwin.from_config(config) as twin:
        twin.record(tmp_path / "bag")
        fly(twin, 30)
    plot(tmp_path / "bag", tmp_path / "bag.svg")
    to_rerun(tmp_path / "bag", tmp_path / "bag.rrd")
    assert (tmp_path / "bag.rrd").stat().st_size > 10_000 and "<svg" in (tmp_path / "bag.svg").read_text()


# ---- the flight program -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def library(config: Path) -> str:
    return str(build_machine(config).library)


@pytest.fixture
def client(library: str, tmp_path: Path) -> Iterator[Client]:
    with flying("--socket", tmp_path / "s", "--paused", library=library) as fc:
        yield fc.client(tmp_path / "s")


def test_the_variable_server_takes_and_gives_names(client: Client) -> None:
    described = client.ok("describe", path="judge.inputs.seen_modes")
    assert described["type"] == "Health[2][2]"
    assert client.get("judge.parameters.route") == ["", "tr_STOP"] and client.get("judge.inputs.own") == "stale"
    written = {
        "source.outputs.modes": [["failed", "stale"], ["nominal", "degraded"]],
        "source.outputs.wishes[1:]": ["tr_STOP", "tr_PARK"],
        "source.outputs.crew[1].wish": "tr_GO",
        "judge.parameters.least": "failed",
        "judge.state.memory.wish": "",
    }
    client.ok("set", values=written)
    assert client.ok("get", paths=list(written))["values"] == written
    client.ok("tick")
    assert client.get("judge.outputs.log") == ["stale", "degraded", "failed"]
    assert client.get("judge.outputs.plan") == ["tr_STOP", "tr_PARK"] and client.get("judge.outputs.next") == "tr_PARK"
    assert client.get("judge.outputs.all[1].wish") == "tr_GO" and client.get("judge.outputs.health") == "degraded"
    for expression, expected in {
        "judge.outputs.verdict == 'failed'": True,
        "judge.outputs.plan[1] != 'tr_PARK' or judge.outputs.all[1].wish == 'tr_STOP'": False,
        "judge.state.trail[0]": "failed",
    }.items():
        assert client.ok("eval", expression=expression)["value"] == expected
    for path, value in (
        ("source.outputs.mode", "Failed"),
        ("source.outputs.mode", 2),
        ("source.outputs.wish", "LEAVE"),
        ("source.outputs.wish", "tr_tr_GO"),
        ("source.outputs.wishes", ["tr_GO", "tr_NOT", ""]),
        ("judge.outputs.transition_request", "tr_GO"),
    ):
        client.error("set", values={path: value})
    for plain in ("GO", "PARK"):
        client.ok("set", values={"source.outputs.wish": plain})
        assert client.get("source.outputs.wish") == f"tr_{plain}"


@pytest.mark.parametrize("binary", [False, True])
def test_they_are_subscribed_to(client: Client, binary: bool, tmp_path: Path) -> None:
    paths = ["judge.outputs.log", "judge.outputs.next", "judge.state.memory.wish", "source.outputs.wishes[1:]"]
    with VarClient(tmp_path / "s") as other:
        stream = other.subscribe(*paths, binary=binary)
        client.ok("set", values={"source.outputs.status.wish": "tr_PARK", "source.outputs.wishes[2]": "tr_STOP"})
        client.ok("tick")
        sample = next(iter(stream))
        assert sample.values == {
            "judge.outputs.log": ["nominal", "nominal", "failed"],
            "judge.outputs.next": "tr_STOP",
            "judge.state.memory.wish": "tr_PARK",
            "source.outputs.wishes[1:]": ["", "tr_STOP"],
        }


def test_telemetry_carries_their_names(library: str, tmp_path: Path) -> None:
    paths = {
        "judge.outputs.log": ("nominal", "degraded", "failed"),
        "judge.outputs.verdict": "degraded",
        "judge.outputs.plan": ("tr_PARK", ""),
        "judge.outputs.all[0].wish": "tr_GO",
        "judge.parameters.home.trail": ("nominal", "degraded"),
        "judge.state.asked": "",
    }
    with Port() as port, Telemetry(0) as telemetry:
        fields = ("--telemetry-fields", "judge.*,machine.state", "--socket", tmp_path / "s", "--paused")
        addresses = ("--telemetry", port.address)
        with flying(*addresses, *fields, library=library) as fc:
            client = fc.client(tmp_path / "s")
            written = {
                "source.outputs.mode": "degraded",
                "source.outputs.modes": [["failed", "nominal"], ["failed", "degraded"]],
                "source.outputs.wishes": ["tr_GO", "tr_PARK", ""],
                "source.outputs.crew[0].wish": "tr_GO",
            }
            client.ok("set", values=written)
            client.ok("tick")
            fc.stop()
        sent = port.datagrams()
        (packet,) = read(sent).packets
        assert {path: packet.values[path] for path in paths} == paths
        for datagram in sent:
            telemetry.feed(datagram)
        for path, value in paths.items():
            shown = telemetry.latest(path)
            assert (tuple(shown) if isinstance(shown, list) else shown) == value
        window = telemetry.window()
        assert window["judge.outputs.log"].tolist() == [["nominal", "degraded", "failed"]]
