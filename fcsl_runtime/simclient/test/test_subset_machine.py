# SPDX-License-Identifier: Apache-2.0
"""Subset machines: fed with what the whole machine had in their open inputs, they leave its bits, tick by tick."""

from __future__ import annotations

import json
import random
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from simclient import AlgTwin, BagError, PyTwin, Twin, TwinError
from simclient.descriptor import Field
from simclient.replay import replay
from simclient.twin.pytest_twins import twin_class

ROOT = Path(__file__).resolve().parents[3]
pytestmark = pytest.mark.filterwarnings("ignore::simclient.OverwrittenWarning")

SOURCE = """
class Source:
    outputs = {"pose": "Pose", "n": "i32"}

    def execute(self):
        pass
"""

MIX = """
class Mix:
    inputs = {
        "seen": "Pose",
        "height": "f64 m",
        "other": "f64",
        "dividend": "i32",
        "wish": "f64",
        "source_health": "Health",
        "dt": "f64 s",
        "tick": "u64",
    }
    outputs = {"sum": "f64", "pose": "Pose", "n": "i32", "transition_request": "TransitionRequest"}
    parameters = {"gain": "f64", "table": "f64[2]"}
    state = {"total": "f64"}

    def execute(self):
        self.total += self.gain * (self.seen.height + self.height) + self.table[1] * self.other + self.wish
        self.sum = self.total * self.dt + f64(i64(self.tick))
        self.pose.height = self.seen.height - self.sum
        self.n = self.dividend // (self.n + 1)
        if self.source_health != "nominal":
            self.health = "degraded"
        if self.n > 3:
            self.transition_request = "UP"
        if self.total > 1e4:
            self.transition_request = "ABORT"
"""

#: Every thing of the machine JSON that a subset has to keep or to cut.
CONFIG: dict[str, Any] = {
    "tick_hz": 100,
    "initial_state": "IDLE",
    "structs": {"Pose": {"height": "f64 m", "valid": "bool"}},
    "algorithms": {"Source": {"source": "source.py"}, "Mix": {"source": "mix.py"}},
    "instances": {
        "d": {"algorithm": "Mix", "parameters": {"gain": 0.5, "table": [1, 2]}, "max_wcet_us": 100000},
        "b": {
            "algorithm": "Mix",
            "parameters": {"gain": 2, "table": [0, 0.25]},
            "frozen": ["table"],
            "inputs": {"wish": 1.5},
        },
        "a": {"algorithm": "Source"},
        "c": {"algorithm": "Mix", "parameters": {"gain": -1, "table": [3, 4]}, "frozen": True},
        "spare": {"algorithm": "Source"},
    },
    "connections": [
        {"from": "a.pose", "to": "b.seen"},
        {"from": "a.n", "to": "b.dividend"},
        {"from": "b.pose.height", "to": "c.height"},
        {"from": "b.n", "to": "c.dividend"},
        {"from": "b.health", "to": "c.source_health"},
        {"from": "c.sum", "to": "d.other"},
        {"from": "a.pose.height", "to": "d.height"},
        {"from": "d.sum", "to": "b.other", "delayed": True, "initial": 7.5},
        {"from": "d.pose", "to": "c.seen", "delayed": True, "initial": {"height": 2.5, "valid": True}},
        {"from": "machine.dt", "to": "d.dt"},
        {"from": "machine.tick", "to": "c.tick"},
    ],
    "states": {
        "IDLE": {"schedule": {"a": 100, "b": {"hz": 20, "phase": 2}}},
        "RUN": {"schedule": {"a": 100, "b": 50, "c": {"every": 3, "phase": 1}, "d": 100}},
        "LAND": {"schedule": {"d": 100, "c": {"hz": 50, "phase": 1}}},
        "SAFE": {"schedule": {"a": 100, "d": 25}},
    },
    "transitions": [
        {"from": ["IDLE", "LAND"], "to": "RUN", "request": "UP", "priority": 2},
        {"from": "RUN", "to": "LAND", "request": "UP", "priority": 1},
        {"from": "*", "to": "SAFE", "request": "ABORT", "priority": 5},
        {"from": "RUN", "to": "SAFE", "health": {"instance": "c", "in": ["failed"]}, "priority": 4},
        {"from": "LAND", "to": "IDLE", "health": {"instance": "b", "in": ["failed", "degraded"]}, "priority": 3},
    ],
    "requests": ["NEVER"],
    "channels": [
        {"name": "height", "id": 1, "field": "a.outputs.pose.height", "direction": "sensor", "max_age_ticks": 3},
        {"name": "sum", "id": 2, "field": "c.outputs.sum", "direction": "actuator"},
    ],
}


@pytest.fixture(scope="module")
def craft(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("craft")
    (folder / "source.py").write_text(SOURCE)
    (folder / "mix.py").write_text(MIX)
    (folder / "craft.json").write_text(json.dumps(CONFIG, indent=1))
    return folder / "craft.json"


# ---- the whole machine and a part of it, side by side -----------------------------------------------------------------

EXAMPLES = {
    "lander": ROOT / "examples/lander/fc/lander_control.json",
    "ahrs": ROOT / "examples/ahrs/ahrs.json",
    "minimal": ROOT / "examples/minimal/minimal.json",
}
#: Algorithms in CPython take a thousand times as long.
TICKS = {AlgTwin: 120, PyTwin: 25}


class Pair:
    """A whole machine that random inputs, faults and states befall, and a subset that is fed with what it had."""

    def __init__(self, kind: type[Twin], config: Path, names: list[str], seed: int):
        self.whole, self.part = kind.from_config(config), kind.from_instances(config, names)
        self.random, self.names = random.Random(seed), names
        self.opened = set(self.part.machine.host_inputs) - set(self.whole.machine.host_inputs)
        self.kept = [p for p in self.part.machine.fields if p.split(".")[0] in names]

    def close(self) -> None:
        self.whole.close()
        self.part.close()

    def tick(self) -> None:
        self._disturb()
        self._follow()
        self.whole.tick()
        self.part.set_many({path: self.whole.get_value(path) for path in self.opened})
        self.part.tick()

    def check(self) -> None:
        """Every field of the kept instances has the whole machine's bits."""
        whole, part = self.whole._save(), self.part._save()
        for path in self.kept:
            ours, theirs = self.part.machine.fields[path], self.whole.machine.fields[path]
            found, expected = part[ours.offset :][: ours.size], whole[theirs.offset :][: theirs.size]
            tick = self.whole.get_value("machine.tick")
            if path.endswith(".counters.fault_place"):  # each machine numbers its own
                instance = path.removesuffix(".counters.fault_place")
                assert self.part.last_fault(instance) == self.whole.last_fault(instance), (path, tick)
            else:
                assert found == expected, (path, tick)

    def _disturb(self) -> None:
        for field in self.whole.machine.fields.values():
            if field.writable and field.role in ("input", "output", "state") and self.random.random() < 0.2:
                self._both(field)
        for name in self.names:
            if self.random.random() < 0.05:
                for twin in (self.whole, self.part):
                    twin.fault(name)

    def _both(self, field: Field) -> None:
        value = _value(field, self.random)
        self.whole.set(field.path, value)
        if field.path in self.kept:
            self.part.set(field.path, value)

    def _follow(self) -> None:
        """The subset is in the whole machine's state; where it has no such state, both are put into one that it has."""
        states, wanted = self.part.machine.states, self.whole.get_value("machine.next_state")
        if wanted not in states or self.random.random() < 0.05:
            wanted = self.random.choice(states)
            self.whole.set_state(wanted)
            self.part.set_state(wanted)
        elif self.part.get_value("machine.next_state") != wanted:
            self.part.set_state(str(wanted))


def _value(field: Field, chance: random.Random) -> Any:
    """Any value of the field's type, as `set` takes it."""

    def scalar() -> Any:
        if field.type == "Health":
            return chance.choice(["nominal", "degraded", "failed", "stale"])
        if field.type == "bool":
            return chance.random() < 0.5
        return chance.uniform(-50.0, 50.0) if field.type.startswith("f") else chance.randrange(100)

    def nested(shape: tuple[int, ...]) -> Any:
        return [nested(shape[1:]) for _ in range(shape[0])] if shape else scalar()

    return nested(field.shape)


@cache
def _instances(config: Path) -> dict[str, bool]:
    """Instances of a machine, and whether some state schedules them."""
    said = json.loads(config.read_text())
    scheduled = {name for state in said["states"].values() for name in state["schedule"]}
    return {name: name in scheduled for name in said["instances"]}


def _follows(kind: type[Twin], config: Path, names: list[str], seed: int) -> None:
    pair = Pair(kind, config, names, seed)
    try:
        for _ in range(TICKS[kind]):
            pair.tick()
            pair.check()
    finally:
        pair.close()


@st.composite
def _subsets(draw: st.DrawFn, known: tuple[str, ...]) -> list[str]:
    return draw(st.lists(st.sampled_from(known), min_size=1, unique=True))


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
@pytest.mark.parametrize("example", sorted(EXAMPLES))
@settings(max_examples=4)
@given(data=st.data(), seed=st.integers(0, 2**32))
def test_a_subset_of_an_example_has_its_bits(kind: type[Twin], example: str, data: st.DataObject, seed: int) -> None:
    known = tuple(_instances(EXAMPLES[example]))
    _follows(kind, EXAMPLES[example], data.draw(_subsets(known)), seed)


@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
@settings(max_examples=6)
@given(data=st.data(), seed=st.integers(0, 2**32))
def test_a_subset_with_everything_has_its_bits(craft: Path, kind: type[Twin], data: st.DataObject, seed: int) -> None:
    known = tuple(_instances(craft))
    names = data.draw(_subsets(known).filter(lambda names: any(_instances(craft)[n] for n in names)))
    _follows(kind, craft, names, seed)


@pytest.mark.parametrize("defect", ["a value", "a state", "a fault"])
def test_a_difference_is_found(craft: Path, defect: str) -> None:
    """The control: the comparison sees one wrong input, one wrong state, one fault that the other did not have."""
    pair = Pair(AlgTwin, craft, ["b", "c"], 7)
    try:
        for _ in range(30):
            pair.tick()
            pair.check()
        pair.part.set_state("RUN")
        pair.whole.set_state("RUN")
        if defect == "a value":
            pair.opened.remove("b.inputs.seen.height")
        elif defect == "a fault":
            pair._disturb = lambda: None  # type: ignore[method-assign]
            for _ in range(3):  # faults of both that c has not had yet
                pair.whole.tick()
                pair.part.tick()
            pair.part.fault("c")
        else:
            pair._follow = lambda: pair.part.set_state("LAND")  # type: ignore[method-assign]
        with pytest.raises(AssertionError, match=r"\('[bc]\."):
            for _ in range(30):
                pair.tick()
                pair.check()
    finally:
        pair.close()


# ---- what it is -------------------------------------------------------------------------------------------------------


@pytest.fixture(params=["native", "process", "python"])
def part(request: pytest.FixtureRequest, craft: Path) -> Iterator[Twin]:
    with twin_class(request.param).from_instances(craft, ["c", "b"]) as twin:
        yield twin


def test_a_subset_machine(part: Twin, craft: Path) -> None:
    m = part.machine
    assert m.name == "craft" and [i.name for i in m.instances] == ["b", "c"]
    assert m.states == ("IDLE", "RUN", "LAND") and m.requests == ("UP", "ABORT", "NEVER")
    edges = [(t.source, t.target, t.request, t.guard_instance) for t in m.transitions]
    assert edges == [
        ("IDLE", "RUN", "UP", ""),
        ("RUN", "LAND", "UP", ""),
        ("LAND", "IDLE", "", "b"),
        ("LAND", "RUN", "UP", ""),
    ]
    assert m.host_inputs == (
        "b.inputs.seen.height",
        "b.inputs.seen.valid",
        "b.inputs.height",
        "b.inputs.other",
        "b.inputs.dividend",
        "b.inputs.wish",
        "b.inputs.source_health",
        "b.inputs.dt",
        "b.inputs.tick",
        "c.inputs.seen.height",
        "c.inputs.seen.valid",
        "c.inputs.other",
        "c.inputs.wish",
        "c.inputs.dt",
    )
    told = "a host input of this subset, in the whole machine from d.outputs.pose.height"
    assert m.fields["c.inputs.seen.height"].doc == told
    assert "subset" not in m.fields["b.inputs.wish"].doc
    assert m.fields["c.inputs.height"].connected_from == "b.outputs.pose.height"
    assert [c.name for c in m.channels] == ["sum"]
    given = part.get_many(["b.inputs.other", "c.inputs.seen.height", "c.inputs.seen.valid", "b.inputs.wish"])
    assert list(given.values()) == [7.5, 2.5, True, 1.5]
    assert m.fields["c.parameters.gain"].frozen and part.get_value("machine.state") == "IDLE"


def test_its_hashes_are_its_own(craft: Path) -> None:
    with AlgTwin.from_config(craft) as whole:
        checkpoint = whole.save()
        hashes = {(whole.machine.source_hash, whole.machine.layout_hash, whole.machine.build_hash)}
    for names in (["b", "c"], ["c", "b"], ["b"]):  # two of them are one
        with AlgTwin.from_instances(craft, names) as twin:
            hashes.add((twin.machine.source_hash, twin.machine.layout_hash, twin.machine.build_hash))
            with pytest.raises(TwinError):
                twin.restore(checkpoint)
    assert [len(set(column)) for column in zip(*hashes, strict=True)] == [3, 3, 3]


def test_where_the_initial_state_is_gone_the_first_that_remains_is_initial(craft: Path) -> None:
    with AlgTwin.from_instances(craft, ["d"]) as twin:
        assert twin.machine.states == ("RUN", "LAND", "SAFE") and twin.get_value("machine.state") == "RUN"


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (["bb"], "error[E206]: no instance `bb`"),
        (["b", "speed"], "error[E206]: no instance `speed`"),
        ([], "error[E242]: a subset of no instances"),
        (["b", "c", "b"], "error[E242]: a subset with `b` twice"),
        (["spare"], "error[E242]: no state schedules `spare`"),
        ("b", 'from_instances(…, "b"): a list of names wanted: ["b"]'),
    ],
)
@pytest.mark.parametrize("kind", [AlgTwin, PyTwin])
def test_what_is_no_subset_is_refused(craft: Path, kind: type[Twin], names: Any, said: str) -> None:
    with pytest.raises(TwinError) as failed:
        kind.from_instances(craft, names)
    assert said in str(failed.value)
    if "error[" in said:
        assert str(failed.value).startswith("craft.json:") and '"instances"' in str(failed.value)


def test_what_is_wrong_elsewhere_in_the_machine_is_said(craft: Path, tmp_path: Path) -> None:
    for name in ("source.py", "mix.py"):
        (tmp_path / name).write_text((craft.parent / name).read_text())
    (tmp_path / "craft.json").write_text(craft.read_text().replace('"IDLE",', '"IDEL",', 1))
    with pytest.raises(TwinError, match=r"E206.*IDEL"):
        AlgTwin.from_instances(tmp_path / "craft.json", ["a"])


# ---- records of a part --------------------------------------------------------------------------------------------------


def test_a_bag_of_a_part_is_replayed_with_that_part(craft: Path, tmp_path: Path) -> None:
    """From the machine's JSON as it stands: the bag tells which instances ran, and the layout that it was these."""
    with AlgTwin.from_instances(craft, ["b", "c"]) as part:
        part.record(tmp_path / "part")
        part.set("b.inputs.seen.height", 2.0)
        part.tick(30)
        part.stop_recording()
    with AlgTwin.from_config(craft) as whole:
        whole.record(tmp_path / "whole")
        whole.set("a.outputs.pose.height", 2.0)
        whole.tick(30)
        whole.stop_recording()
    verdict = replay(tmp_path / "part", str(craft))
    assert verdict.identical and verdict.ticks == 30, str(verdict)
    assert "the bag records a part of `craft`, so only that part ran: b, c" in verdict.notes
    verdict = replay(tmp_path / "whole", str(craft))
    assert verdict.identical and not [note for note in verdict.notes if "part" in note], str(verdict)
    edited = tmp_path / "edited"
    edited.mkdir()
    for name, said in (
        ("source.py", SOURCE),
        ("mix.py", MIX.replace("self.dividend // (self.n + 1)", "self.dividend")),
    ):
        (edited / name).write_text(said)
    (edited / "craft.json").write_text(craft.read_text())
    with pytest.raises(BagError, match="recorded from other sources of `craft`"):
        replay(tmp_path / "part", str(edited / "craft.json"))
    verdict = replay(tmp_path / "part", str(edited / "craft.json"), ignore_source_hash=True)
    assert verdict.identical and verdict.ticks == 30, str(verdict)
