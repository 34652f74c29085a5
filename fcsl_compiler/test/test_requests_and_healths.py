# SPDX-License-Identifier: Apache-2.0
"""Names of requests and healths as literals, parameters and values of the JSON. Compiled machines and CPython side by
side."""

import json
from pathlib import Path

from fcsl_test_abi import write_one_each
from fcsl_test_programs import PARAMETERS, PROGRAMS, REQUESTS, STRUCTS
from fcsl_test_twins import Twins

from fcsl_compiler.driver.passes import compile_machine


def test_a_machine_without_transitions_takes_its_words(tmp_path: Path) -> None:
    """The fixture of a unit test: the literals of methods, helpers, constants and JSON values are its requests, with
    one warning."""
    files = {
        "law.py": """
from frames import WISHES, wish


class Law:
    inputs = {"on": "bool", "seen": "TransitionRequest"}
    outputs = {"same": "bool", "next": "TransitionRequest", "transition_request": "TransitionRequest"}
    parameters = {"on_done": "TransitionRequest", "plan": "TransitionRequest[2]"}

    def execute(self):
        self.next = self.on_done
        self.same = self.seen == "SEEN"
        self.transition_request = wish(self.on) if self.on else WISHES[1] if self.same else self.plan[1]


class Quiet:
    outputs = {"x": "f64"}

    def execute(self):
        self.x = 1.0
""",
        "frames.py": """
WISHES: "TransitionRequest[2]" = ["", "LISTED"]
UNUSED: TransitionRequest = "UNUSED"


def wish(on: bool) -> TransitionRequest:
    return "HELPED" if on else ""


def never(on: bool) -> TransitionRequest:
    return "NEVER" if on else UNUSED
""",
    }
    instances = {
        "law": {
            "algorithm": "Law",
            "parameters": {"on_done": "DONE", "plan": ["", "PLANNED"]},
            "inputs": {"seen": "GIVEN"},
        },
        "quiet": {"algorithm": "Quiet"},
    }
    algorithms = {"Law": {"source": "law.py"}, "Quiet": {"source": "law.py"}}
    path = write_one_each(tmp_path, files, algorithms, instances=instances, transitions=[], requests=[])
    made = compile_machine(path, "")
    assert [d.code for d in made.sink.diagnostics] == ["W208"]
    assert set(made.checked.requests) == {"SEEN", "LISTED", "HELPED", "DONE", "PLANNED", "GIVEN"}
    twins = Twins(path)
    assert twins.get("law.inputs.seen") == "GIVEN" and twins.get("law.parameters.plan") == ["", "PLANNED"]
    number = {name: n for n, name in enumerate(("", *made.checked.requests))}
    rows = [
        ({}, {"law.outputs.transition_request": "PLANNED", "law.outputs.same": False}),
        ({"law.inputs.seen": number["SEEN"]}, {"law.outputs.transition_request": "LISTED", "law.outputs.same": True}),
        ({"law.inputs.on": True}, {"law.outputs.transition_request": "HELPED", "quiet.outputs.transition_request": ""}),
    ]
    twins.expect(rows)
    listed = write_one_each(
        tmp_path / "listed", files, algorithms, instances=instances, requests=sorted(made.checked.requests)
    )
    assert compile_machine(listed, "").sink.diagnostics == []


def test_a_parameter_takes_a_transition(tmp_path: Path) -> None:
    """An algorithm without mission-specific names: they are in the JSON."""
    law = """
class Timer:
    parameters = {"on_done": "TransitionRequest", "ticks": "i64", "level": "Health"}
    outputs = {"transition_request": "TransitionRequest"}
    state = {"n": "i64"}

    def execute(self):
        self.n += 1
        self.transition_request = self.on_done if self.n >= self.ticks else ""
        self.health = self.level


class Follower:
    inputs = {"wish": "TransitionRequest", "level": "Health"}
    outputs = {"seen": "TransitionRequest", "levels": "Health[2]", "stopping": "bool"}

    def execute(self):
        self.seen = self.wish
        self.levels = [self.levels[1], self.level]
        self.stopping = self.wish == "STOP"
"""
    instances = {
        "first": {"algorithm": "Timer", "parameters": {"on_done": "START", "ticks": 2, "level": "nominal"}},
        "second": {
            "algorithm": "Timer",
            "parameters": {"on_done": "STOP", "ticks": 3, "level": "degraded"},
            "frozen": True,
        },
        "idle": {"algorithm": "Timer", "parameters": {"on_done": "", "ticks": 0, "level": "stale"}},
        "follower": {"algorithm": "Follower"},
    }
    rates = dict.fromkeys(instances, 10)
    path = write_one_each(
        tmp_path,
        {"law.py": law},
        {"Timer": {"source": "law.py"}, "Follower": {"source": "law.py"}},
        instances=instances,
        states={"A": {"schedule": rates}, "B": {"schedule": rates}, "C": {"schedule": rates}},
        transitions=[
            {"from": "A", "to": "B", "request": "START"},
            {"from": "B", "to": "C", "request": "STOP", "health": {"instance": "second", "in": ["degraded"]}},
        ],
        connections=[
            {"from": "second.transition_request", "to": "follower.wish"},
            {"from": "idle.health", "to": "follower.level"},
        ],
    )
    assert compile_machine(path, "").sink.diagnostics == []
    columns = [
        "machine.state",
        "first.outputs.transition_request",
        "second.outputs.transition_request",
        "second.outputs.health",
    ]
    columns += [
        "idle.outputs.transition_request",
        "idle.outputs.health",
        "follower.outputs.seen",
        "follower.outputs.stopping",
    ]
    table = [
        ["A", "", "", "degraded", "", "failed", "", False],
        ["A", "START", "", "degraded", "", "failed", "", False],
        ["B", "START", "STOP", "degraded", "", "failed", "STOP", True],
        ["C", "START", "STOP", "degraded", "", "failed", "STOP", True],
    ]
    Twins(path).expect([({}, dict(zip(columns, row, strict=True))) for row in table])


def test_frozen_words_are_the_same(tmp_path: Path) -> None:
    """Requests, healths, arrays and structs of them, folded into the code."""
    parameters = PARAMETERS["words"]
    instances = {
        "plain": {"algorithm": "Words", "parameters": parameters},
        "frozen": {"algorithm": "Words", "parameters": parameters, "frozen": True},
    }
    path = write_one_each(
        tmp_path,
        {"words.py": PROGRAMS["words"]},
        {"Words": {"source": "words.py"}},
        instances=instances,
        states={"A": {"schedule": dict.fromkeys(instances, 10)}},
        structs=STRUCTS,
        requests=list(REQUESTS),
    )
    twins = Twins(path)
    paths = [p.removeprefix("plain.") for p in twins.native.fields if p.startswith(("plain.outputs.", "plain.state."))]
    for i in range(2):
        for level in range(4):
            for on in (False, True):
                for name in instances:
                    for port, value in {
                        "i": i,
                        "level": level,
                        "on": on,
                        "wish": level,
                        "levels": [0, level, 1],
                    }.items():
                        twins.set(f"{name}.inputs.{port}", value)
                twins.step(where=f"{i} {level} {on}")
                for p in paths:
                    assert list(twins.native.raw(f"plain.{p}")) == list(twins.native.raw(f"frozen.{p}")), p


def test_words_in_the_json(tmp_path: Path) -> None:
    """Values of requests and healths, in lists and structs, as parameters, inputs and the initial value of a connection."""
    path = write_one_each(
        tmp_path,
        {"words.py": PROGRAMS["words"]},
        {"Words": {"source": "words.py"}},
        instances={
            name: {
                "algorithm": "Words",
                "parameters": PARAMETERS["words"],
                "inputs": {"levels": ["stale", "failed", "degraded"], "wishes": ["ABORT", ""]},
            }
            for name in ("one", "two")
        },
        states={"A": {"schedule": {"one": 10, "two": 10}}},
        connections=[
            {"from": "one.last", "to": "two.wish", "delayed": True, "initial": "GO"},
            {"from": "two.worst", "to": "one.level", "delayed": True, "initial": "stale"},
            {
                "from": "one.sent",
                "to": "two.seen",
                "delayed": True,
                "initial": {"level": "failed", "wishes": ["", "HOLD"], "weight": 2},
            },
        ],
        structs=STRUCTS,
        requests=list(REQUESTS),
    )
    twins = Twins(path)
    assert [twins.get(p) for p in ("two.inputs.wish", "one.inputs.level", "two.inputs.seen.level")] == [
        "GO",
        "stale",
        "failed",
    ]
    assert twins.get("one.inputs.levels") == ["stale", "failed", "degraded"]
    assert twins.get("one.inputs.wishes") == ["ABORT", ""] and twins.get("two.inputs.seen.wishes") == ["", "HOLD"]
    assert twins.get("one.state.kept.level") == "stale" and twins.get("one.state.before") == "stale"
    twins.step(5)
    described = json.loads(path.read_text())
    assert described["structs"]["Report"]["level"] == "Health"


def test_a_constant_word_in_arrays(tmp_path: Path) -> None:
    """Its type follows from the other elements at any position."""
    text = """
CALM = "nominal"


class Law:
    inputs = {"h": "Health"}
    outputs = {"rows": "Health[2][2]", "row": "Health[2]", "same": "bool"}

    def execute(self):
        self.rows[0:] = [["failed", CALM], [self.h, self.h]]
        self.row = [CALM, self.h]
        self.same = CALM == self.h
"""
    twins = Twins(write_one_each(tmp_path, {"law.py": text}, {"Law": {"source": "law.py"}}))
    expected = {
        "law.outputs.rows": ["failed", "nominal", "degraded", "degraded"],
        "law.outputs.row": ["nominal", "degraded"],
        "law.outputs.same": False,
    }
    twins.expect([({"law.inputs.h": 1}, expected)])
