# SPDX-License-Identifier: Apache-2.0
"""Requirements: C, Nim and CPython give the verdicts that their definitions give, of generated formulas."""

from __future__ import annotations

import json
import math
import random
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from requirements_oracle import Generator, Values, fields, verdict, written

from simclient import AlgTwin, ProcessTwin, PyTwin, TwinError
from simclient.replay.check_bag import main
from simclient.requirements import Status
from simclient.twin.search import find_violation
from simclient.twin.twin import Twin

TICK_HZ = 100
KINDS = ("when", "then", "never", "at_end")
SOURCE = """\
class Source:
    inputs = {}
    outputs = {"x": "f64", "y": "f32", "n": "i32", "u": "u64", "b": "bool", "v": "f64[3]", "m": "f64[2][2]"}
    parameters = {}
    state = {}

    def execute(self):
        pass


class Slow:
    inputs = {"x": "f64"}
    outputs = {"z": "f64"}
    parameters = {"limit": "f64 = 1.0"}
    state = {}

    def execute(self):
        self.z = 2.0 * self.x


class Other:
    outputs = {"w": "f64"}

    def execute(self):
        self.w = 1.5 - self.w
"""


def machine(folder: Path, requirements: list[Values], name: str = "craft") -> Path:
    (folder / "craft.py").write_text(SOURCE)
    config = {
        "tick_hz": TICK_HZ,
        "initial_state": "A",
        "algorithms": {name: {"source": "craft.py"} for name in ("Source", "Slow", "Other")},
        "instances": {"src": {"algorithm": "Source"}, "slow": {"algorithm": "Slow"}, "other": {"algorithm": "Other"}},
        "connections": [{"from": "src.x", "to": "slow.x"}],
        "states": {
            "A": {"schedule": {"src": 100, "slow": {"hz": 50, "phase": 1}, "other": 100}},
            "B": {"schedule": {"src": 100}},
            "C": {"schedule": {"src": 100, "slow": {"hz": 50, "phase": 1}}},
        },
        "requirements": requirements,
    }
    path = folder / f"{name}.json"
    path.write_text(json.dumps(config))
    return path


def fly(twin: Twin, seed: int, ticks: int) -> list[Values]:
    """Values at random, with NaNs, changes of the state and faults; returns what each tick left."""
    draw = random.Random(seed)
    paths = ("src.outputs.x", "src.outputs.y", "src.outputs.n", "src.outputs.u", "src.outputs.b", "src.outputs.v")
    left = []
    for tick in range(ticks):
        for name in "xy":
            value = draw.choice((math.nan, 0.0, 1.0, 2.0, -1.5, 0.5)) if draw.random() < 0.4 else None
            if value is not None:
                twin.set(f"src.outputs.{name}", value)
        twin.set("src.outputs.n", draw.randint(-1, 3))
        twin.set("src.outputs.u", draw.randint(0, 3))
        if draw.random() < 0.3:
            twin.set("src.outputs.b", draw.random() < 0.5)
        twin.set(
            "src.outputs.v", [draw.choice((0.0, 1.0, math.nan, 3.0)) if draw.random() < 0.1 else 1.0 for _ in "xyz"]
        )
        if draw.random() < 0.1:
            twin.set_state(draw.choice("ABC"))
        faulted = draw.random() < 0.15
        if faulted:
            twin.fault("slow")
        twin.tick()
        state = twin.state()
        ran = twin.get_value("slow.outputs.health") == "nominal" and state in "AC" and tick % 2 == 1
        values = {
            path: twin.get_value(path)
            for path in (
                *paths,
                "slow.outputs.z",
                "other.outputs.w",
                *(f"{i}.outputs.health" for i in ("src", "slow", "other")),
            )
        }
        acting = [f.path for f in twin.fields("requirements.") if f.path.endswith(".outputs.health")]
        left.append(
            {
                **values,
                "acting": {path.split(".")[1].upper().replace("_", "-"): twin.get_value(path) for path in acting},
                "src.outputs.v[1]": values["src.outputs.v"][1],
                "machine.state": state,
                "ran": {"slow"} if ran else set(),
            }
        )
    return left


COUNTS = ("holds", "evaluated", "exercised", "undefined", "violations", "violated_ticks", "first_tick", "last_tick")


@pytest.mark.parametrize("seed", range(4))
def test_generated_formulas_equal_their_definitions(seed: int, tmp_path: Path) -> None:
    generator = Generator(seed, TICK_HZ)
    requirements = [generator.requirement(f"R-{i}") for i in range(60)]
    path = machine(tmp_path, [written(requirement) for requirement in requirements])
    opened: list[tuple[str, Any]] = [("C", AlgTwin.from_config(path)), ("CPython", PyTwin.from_config(path))]
    if seed == 0:
        opened.append(("Nim", AlgTwin.from_config(path, backend="nim")))
    for name, twin in opened:
        with twin:
            left = fly(twin, seed, 90)
            found = twin.requirements
        for requirement in requirements:
            expected = verdict(requirement, left, TICK_HZ)
            got = found[requirement["id"]]
            if "effect" in requirement:
                acted = [tick for tick, values in enumerate(left) if values["acting"][requirement["id"]] == "degraded"]
                ends = (acted[0], acted[-1]) if acted else (None, None)
                assert (len(acted), *ends) == (got.violated_ticks, got.first_tick, got.last_tick), (name, requirement)
            shown = {count: getattr(got, count) for count in COUNTS}
            assert shown == {count: getattr(expected, count) for count in COUNTS}, (name, written(requirement))
            assert got.faults == 0
            if got.kind == "at_end":
                assert got.status == (("met" if expected.holds else "violated") if expected.asked else "not exercised")
    assert sum(v.violations > 0 for v in found.values()) > 10 and sum(v.undefined > 0 for v in found.values()) > 5
    assert {v.status for v in found.values()} == set(Status)


def test_the_flight_program_has_the_same_verdicts(tmp_path: Path) -> None:
    """In its statistics, as fields of the variable server, and at its end."""
    generator = Generator(11, TICK_HZ)
    requirements = [generator.requirement(f"R-{i}") for i in range(30)]
    path = machine(tmp_path, [written(requirement) for requirement in requirements])
    with AlgTwin.from_config(path) as native, ProcessTwin.from_config(path) as process:
        fly(native, 11, 60)
        fly(process, 11, 60)
        flown, found = native.requirements, process.requirements
        assert repr(flown) == repr(found)  # NaNs, too
        assert process._client.get_value("requirements.r_3.exercised") == flown["R-3"].exercised


def judged(capsys: pytest.CaptureFixture[str], bag: Path, config: Path, *more: str) -> tuple[int, dict[str, Any]]:
    """Status and JSON of `fcsl check-bag`."""
    status = main([str(bag), "--config", str(config), "--json", *more])
    return status, json.loads(capsys.readouterr().out)


def without(bag: Path, topic: str, ticks: range) -> None:
    """Writes the bag again without the messages of a topic in these ticks."""
    (file,) = bag.glob("*.mcap")
    with file.open("rb") as stream:
        kept = list(make_reader(stream).iter_messages(log_time_order=False))
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start("ros2")
        channels: dict[str, int] = {}
        for schema, channel, message in kept:
            if channel.topic not in channels:
                number = writer.register_schema(schema.name, schema.encoding, schema.data)
                channels[channel.topic] = writer.register_channel(channel.topic, "cdr", number)
            if channel.topic != topic or int.from_bytes(message.data[20:28], "little") not in ticks:
                writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
        writer.finish()


def test_a_bag_is_judged_as_the_flight_was(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    generator = Generator(7, TICK_HZ)
    requirements = [generator.requirement(f"R-{i}") for i in range(60)]
    path = machine(tmp_path, [written(requirement) for requirement in requirements])
    with AlgTwin.from_config(path) as twin:
        twin.record(tmp_path / "flight")
        fly(twin, 7, 200)
        twin.stop_recording()
        flown = twin.requirements
    status, found = judged(capsys, tmp_path / "flight", path)
    assert status == 1 and found["ticks"] == 200
    for id_, flew in flown.items():
        got = found["requirements"][id_]
        assert {k: got[k] for k in (*COUNTS, "undecided")} == {k: getattr(flew, k, "") for k in (*COUNTS, "undecided")}


def test_a_bag_is_judged_without_the_machine_as_the_flight_was(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the messages that a map names, with their types, NaNs and all."""
    generator = Generator(3, TICK_HZ)
    every = [generator.requirement(f"R-{i}") for i in range(150)]
    chosen = [
        r
        for r in every
        if "clock" not in r and all(f.startswith("src.") for k in KINDS if k in r for f in fields(r[k]))
    ]
    path = machine(tmp_path, [written(requirement) for requirement in chosen[:25]])
    with AlgTwin.from_config(path) as twin:
        twin.record(tmp_path / "flight")
        fly(twin, 3, 200)
        twin.stop_recording()
        flown = twin.requirements
    (tmp_path / "f.json").write_text(json.dumps({"requirements": json.loads(path.read_text())["requirements"]}))
    values = {f"src.outputs.{name}": {"topic": "/craft/src", "field": name} for name in "xynubv"}
    (tmp_path / "map.json").write_text(json.dumps({"time": "log", "tick_hz": TICK_HZ, "values": values}))
    more = ["--requirements", str(tmp_path / "f.json"), "--map", str(tmp_path / "map.json"), "--json"]
    assert main([str(tmp_path / "flight"), *more]) == 1
    found = json.loads(capsys.readouterr().out)
    assert found["ticks"] == 200 and len(flown) == 25
    for id_, flew in flown.items():
        got = found["requirements"][id_]
        assert {k: got[k] for k in (*COUNTS, "undecided")} == {k: getattr(flew, k, "") for k in (*COUNTS, "undecided")}


def test_ticks_and_fields_that_a_bag_lacks_are_undecided(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    requirements: list[Values] = [
        {"id": "N", "text": "now", "then": "src.outputs.x < 1.0"},
        {"id": "H", "text": "held", "then": "held(src.outputs.x < 1.0, 0.1)", "when": "machine.tick > 20"},
        {"id": "Z", "text": "z stays", "then": "slow.outputs.z < 1.0"},
        {"id": "P", "text": "a parameter", "then": "slow.outputs.z < slow.parameters.limit"},
        {"id": "C", "text": "not recorded", "then": "slow.counters.overruns < 1"},
    ]
    path = machine(tmp_path, requirements)
    with AlgTwin.from_config(path) as twin:
        twin.record(tmp_path / "flight")
        twin.tick(100)
        twin.stop_recording()
    without(tmp_path / "flight", "/craft/src", range(50, 56))
    status, found = judged(capsys, tmp_path / "flight", path)
    verdicts = found["requirements"]
    assert status == 0 and found["ticks"] == 100
    assert verdicts["Z"]["evaluated"] == 99  # `slow` is stale in tick 0
    assert verdicts["N"]["evaluated"] == 94 and verdicts["N"]["undecided_ticks"] == 6
    assert verdicts["H"]["evaluated"] == 50 and verdicts["H"]["undecided_ticks"] == 50  # it remembers
    assert verdicts["P"]["status"] == "met" and verdicts["P"]["undecided"] == ""
    assert verdicts["C"]["undecided"] == "the bag has no `slow.counters.overruns`"


TESTS = """\
import pytest


def test_low(fcsl):
    fcsl("craft.json").tick(5)


@pytest.mark.requirement("LOW")
@pytest.mark.violates("LOW", "SEEN")
def test_high(fcsl):
    twin = fcsl("craft.json")
    twin.set("src.outputs.x", 3.0)
    twin.tick(2)
    twin.close()


@pytest.mark.skip
def test_skipped(fcsl):
    fcsl("craft.json").tick()


@pytest.mark.violates("LOW")
@pytest.mark.violates("SEEN")
def test_two_marks(fcsl):
    twin = fcsl("craft.json")
    twin.set("src.outputs.x", 3.0)
    twin.tick()


@pytest.mark.violates("END")
def test_the_end(fcsl):
    fcsl("craft.json").tick()


def test_not_told(fcsl):
    twin = fcsl("craft.json")
    twin.set("src.outputs.x", 3.0)
    twin.tick()


@pytest.mark.violates("LOW", "NONE")
def test_nothing_happens(fcsl):
    fcsl("craft.json").tick()


@pytest.mark.violates
def test_anything(fcsl):
    fcsl("craft.json").tick()


def test_the_world(fcsl):
    twin = fcsl("craft.json")
    twin.set("src.outputs.y", 9.0)
    twin.tick()


@pytest.fixture
def landed(fcsl):
    twin = fcsl("craft.json")
    yield twin
    twin.set("src.outputs.x", 3.0)
    twin.tick()


def test_before_its_fixture_ends(landed):
    landed.tick()
"""
CRAFT: list[Values] = [
    {"id": "LOW", "text": "x is low.", "then": "src.outputs.x < 2.0"},
    {"id": "SEEN", "text": "High x is not there.", "when": "src.outputs.x > 2.0", "never": "src.outputs.x > 2.5"},
    {"id": "WORLD", "text": "The world is low.", "then": "src.outputs.y < 2.0", "assume": True},
    {"id": "END", "text": "It ends high.", "at_end": "src.outputs.x > 100.0"},
    {"id": "NEVER", "text": "Not asked.", "when": "src.outputs.n > 5", "then": "src.outputs.b"},
]


@pytest.mark.parametrize("processes", [(), ("-n", "2")], ids=["alone", "xdist"])
def test_pytest_judges_and_traces(tmp_path: Path, processes: tuple[str, ...]) -> None:
    """A violation fails the test that does not tell it, and a mark without violation its own; an assumption none."""
    machine(tmp_path, CRAFT)
    (tmp_path / "test_craft.py").write_text(TESTS)
    line = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        *processes,
        "--fcsl-requirements",
        "tests.json",
    ]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "4 failed, 5 passed, 1 skipped, 1 error" in done.stdout, done.stdout
    assert "requirement LOW violated 1 time, first at tick 0 (0 s), last at tick 0: x is low." in done.stdout
    assert "LOW was not violated" in done.stdout and "no requirement was violated" in done.stdout
    assert "END is of the end of a run, which a test is not" in done.stdout
    assert "no machine of this test has a requirement NONE" in done.stdout
    assert not list(tmp_path.glob("*.part"))
    traced = ["fcsl", "trace", "craft.json", "--tests", "tests.json"]
    for form in ("html", "csv", "json"):
        done = subprocess.run(
            [*traced, "-o", f"trace.{form}"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 1, done.stderr
    rows = {row["id"]: row for row in json.loads((tmp_path / "trace.json").read_text())["requirements"]}
    assert [row["id"] for row in rows.values() if row["gaps"]][-1] == "NEVER"
    assert rows["NEVER"]["gaps"] == ["no test exercises it"]
    assert rows["LOW"]["gaps"] == ["5 tests that exercise it fail"]
    names = {id_: {key: [n.rpartition("::")[2] for n in row[key]] for key in ("tests", "violating", "named")}
             for id_, row in rows.items()}  # fmt: skip
    both = {"test_high", "test_two_marks"}
    assert set(names["LOW"]["violating"]) == set(names["SEEN"]["tests"]) == both
    assert names["LOW"]["named"] == ["test_high"]
    assert (
        "<b>NEVER</b>" in (tmp_path / "trace.html").read_text() and "\nWORLD," in (tmp_path / "trace.csv").read_text()
    )


SUM: list[Values] = [
    {"id": "SUM", "text": 'The sum is "low".', "then": "held(src.outputs.x + src.outputs.y > 5.0, 0.05) == False"},
    {"id": "WORLD", "text": "y is low.", "then": "src.outputs.y < 2.0", "assume": True},
]


def test_a_search_finds_the_simplest_violation_and_writes_it_as_a_test(tmp_path: Path) -> None:
    path = machine(tmp_path, SUM)
    found = find_violation(path, {"src.outputs.x": (0.0, 10.0), "src.outputs.y": (0.0, 1.0)}, ticks=20)
    assert found is not None and found.verdict.id == "SUM" and found.verdict.first_tick == 5
    assert [len(own) for own in found.inputs.values()] == [1, 1]
    again = find_violation(path, {"src.outputs.x": (0.0, 10.0), "src.outputs.y": (0.0, 1.0)}, ticks=20)
    assert again is not None and again.inputs == found.inputs
    (tmp_path / "test_found.py").write_text(found.test())
    line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_found.py"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "1 passed" in done.stdout, done.stdout


def test_what_a_search_found_is_repeated_with_all_that_it_set(tmp_path: Path) -> None:
    """Vectors, NaNs and parameters; requirements with a clock, over stale instances, and with time to react."""
    path = machine(
        tmp_path,
        [
            {"id": "VEC", "text": "v is short.", "then": "norm(src.outputs.v) < 3.0"},
            {"id": "NUM", "text": "y is finite.", "then": "isfinite(src.outputs.y)"},
            {"id": "CLK", "text": "z is low.", "clock": "slow", "then": "slow.outputs.z < slow.parameters.limit"},
            {"id": "LAG", "text": "u", "stale": "hold", "when": "slow.outputs.z > 3.0", "then": "slow.outputs.z > 4.0",
             "within_s": 0.04},
        ],
    )  # fmt: skip
    x = {"src.outputs.x": (0.0, 5.0)}
    inputs: dict[str, dict[str, Any]] = {
        "VEC": {"src.outputs.v": [[0.0, 0.0, 0.0], [1.0, 2.0, 3.0]]},
        "NUM": {"src.outputs.y": [0.0, math.nan]},
        "CLK": x,
        "LAG": x,
    }
    for id_, domains in inputs.items():
        limit = {"slow.parameters.limit": 7.0} if id_ == "CLK" else {"slow.parameters.limit": 99.0}
        found = find_violation(path, domains, ticks=20, requirement=id_, parameters=limit, examples=100)
        assert found is not None and (id_ != "CLK" or found.inputs["src.outputs.x"] == [(20, 4.0)])
        (tmp_path / f"test_{id_}.py").write_text(found.test())
    line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider"]
    done = subprocess.run(line, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "4 passed" in done.stdout, done.stdout


def test_a_search_keeps_to_assumptions_and_ranges(tmp_path: Path) -> None:
    path = machine(tmp_path, SUM)
    ranges: dict[str, Any] = {"src.outputs.x": (0.0, 2.0), "src.outputs.y": (0.0, 10.0)}
    assert find_violation(path, ranges, ticks=20, examples=200) is None
    assert find_violation(path, {"src.outputs.x": [0.0, 4.9]}, ticks=20, examples=50) is None
    assert find_violation(path, {"src.outputs.x": [0.0, 5.5]}, ticks=20) is not None
    with pytest.raises(TwinError, match="the machine has no requirement NONE"):
        find_violation(path, ranges, ticks=20, requirement="NONE")
    with pytest.raises(TwinError, match="is no range"):
        find_violation(path, {"src.outputs.x": (1.0, 0.0)}, ticks=20)


def test_verdicts_on_the_edge(tmp_path: Path) -> None:
    """What a tick with a fault, a restore to the same tick and values beyond 64 bits leave."""
    path = machine(
        tmp_path,
        [
            {"id": "END", "text": "n is low.", "at_end": "src.outputs.n * 3000000000 * 3000000000 < 100"},
            {"id": "SAME", "text": "n stays.", "then": "previous(src.outputs.n) == src.outputs.n"},
            {"id": "SMALL", "text": "u is low.", "then": "src.outputs.u < 5"},
        ],
    )
    with AlgTwin.from_config(path) as twin:
        twin.tick(5)
        begin = twin.save()
        twin.set("src.outputs.n", 3)
        twin.set("src.outputs.u", 2**64 - 1)
        twin.tick()
        assert twin.requirements["END"].status == "not exercised"  # not evaluated in the last tick
        assert twin.requirements["SMALL"].line.endswith("or a division by 0, in 1 tick")
        assert twin.requirements["SAME"].violations == 1
        twin.restore(begin)
        assert twin.requirements["SAME"].violations == 0
        twin.tick()
        assert twin.requirements["SAME"].violations == 0  # the tick before is that of the checkpoint
        assert twin.requirements["END"].status == "met"


def test_values_that_are_no_json_are_texts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = machine(tmp_path, [{"id": "LOW", "text": "x is low.", "then": "src.outputs.x < 2.0"}])
    with AlgTwin.from_config(path) as twin:
        twin.record(tmp_path / "flight")
        twin.set("src.outputs.x", math.nan)
        twin.tick()
        twin.stop_recording()
    assert main([str(tmp_path / "flight"), "--config", str(path), "--json"]) == 1
    found = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    assert found["requirements"]["LOW"]["first"] == {"src.outputs.x": "nan"}


def test_a_row_and_an_element_of_a_matrix(tmp_path: Path) -> None:
    condition = "norm(src.outputs.m[1]) < 5.0 and src.outputs.m[1, 0] < 3.0"
    path = machine(tmp_path, [{"id": "ROW", "text": "m is small.", "then": condition, "effect": {"degrade": "src"}}])
    with AlgTwin.from_config(path) as twin:
        found = []
        for row in ([2.0, 4.0], [3.0, 4.0], [3.0, 3.0]):
            twin.set("src.outputs.m", [[9.0, 9.0], row])
            twin.tick()
            found.append((twin.requirements["ROW"].holds, twin.get_value("src.outputs.health")))
        assert found == [(True, "nominal"), (False, "degraded"), (False, "degraded")]
