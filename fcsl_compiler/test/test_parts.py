# SPDX-License-Identifier: Apache-2.0
"""Machines among the instances of a machine: they are what the same machine without parts is, and errors name both files."""

import copy
import json
import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_twins import Twins

from fcsl_compiler.base.diagnostics import Diagnostic, DiagnosticError
from fcsl_compiler.base.source import Span
from fcsl_compiler.driver.cache import build_machine
from fcsl_compiler.driver.passes import compile_machine

LOOP = """
from gains import limited


class Pi:
    inputs = {"target": "f64 rad/s", "rate": "f64 rad/s", "period": "f64 s", "resumed": "bool"}
    parameters = {"kp": "f64", "ki": "f64 = 0.5", "table": "f64[n]", "floor": "Health", "least": "Health = \\"nominal\\"", "word": "TransitionRequest = \\"wound\\""}
    outputs = {"u": "f64", "pair": "Pair", "transition_request": "TransitionRequest"}
    state = {"integral": "f64"}

    def execute(self):
        error = self.target - self.rate
        self.integral += self.ki * error * self.period
        self.u = limited(self.kp * error + self.integral + self.table[0])
        self.pair.first = self.u
        self.health = self.floor if self.u > 0.0 else self.least
        if abs(self.integral) > 0.2:
            self.transition_request = "wound"
        if abs(self.integral) > 0.4:
            self.transition_request = self.word
"""
LAW = """
class Law:
    inputs = {"angle": "f64 rad", "target": "f64 rad", "order": "TransitionRequest"}
    parameters = {"gain": "f64 1/s", "begin": "TransitionRequest"}
    outputs = {"rate": "f64 rad/s", "seen": "i32", "transition_request": "TransitionRequest"}

    def execute(self):
        self.rate = self.gain * (self.target - self.angle)
        self.seen = 1 if self.order == "far" else 2 if self.order == self.begin else 0
        if self.rate > 1e3:
            self.transition_request = "far"
"""
BODY = """
class Body:
    inputs = {"u": "f64", "first": "f64", "period": "f64 s"}
    outputs = {"angle": "f64 rad", "rate": "f64 rad/s", "order": "TransitionRequest"}

    def execute(self):
        self.rate += self.u * self.period
        self.angle += self.rate * self.period
        self.order = "STOP" if self.rate > 0.0 else "far"
"""
GAINS = "def limited(x: f64) -> f64:\n    return clamp(x, -9.0, 9.0)\n"
PAIR = {"Pair": {"first": "f64", "second": "f64"}}

#: A part in a part.
RATE: dict[str, Any] = {
    "tick_hz": 200,
    "initial_state": "ON",
    "structs": PAIR,
    "constants": "numbers.json",
    "algorithms": {"Loop": {"source": "loop.py", "class": "Pi", "sizes": {"n": "points"}}},
    "instances": {
        "pi": {
            "algorithm": "Loop",
            "parameters": {"kp": "2 * k", "floor": "degraded", "table": {"csv": "table.csv", "column": "bias"}},
            "frozen": ["kp"],
        }
    },
    "connections": [
        {"from": "machine.period", "to": "pi.period"},
        {"from": "machine.resumed", "to": "pi.resumed"},
    ],
    "requests": ["wound"],
    "states": {"ON": {"schedule": {"pi": {"hz": 50, "phase": 2}}}},
    "ports": {
        "inputs": {"target": "pi.target", "rate": "pi.rate"},
        "outputs": {"u": "pi.u", "pair": "pi.pair", "first": "pi.pair.first"},
        "parameters": {"ki": "pi.ki", "kp": "pi.kp"},
    },
}
ATTITUDE: dict[str, Any] = {
    "tick_hz": 500,
    "initial_state": "RUN",
    "structs": {"Angles": {"roll": "f64"}},
    "constants": {"k": 3},
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {
        "law": {"algorithm": "Law", "parameters": {"gain": "k / 2", "begin": "far"}},
        "rate": {"machine": "rate/rate.json", "parameters": {"ki": "k"}, "requests": {"wound": "far"}},
    },
    "connections": [{"from": "law.rate", "to": "rate.target"}],
    "requests": ["far"],
    "states": {"RUN": {"schedule": {"law": 250, "rate": True}}},
    "ports": {
        "inputs": {"angle": "law.angle", "target": ["law.target"], "rate": "rate.rate", "order": "law.order"},
        "outputs": {"u": "rate.u", "pair": "rate.pair", "first": "rate.first"},
        "parameters": {"gain": "law.gain", "ki": ["rate.ki"]},
    },
}
CRAFT: dict[str, Any] = {
    "tick_hz": 1000,
    "initial_state": "FLY",
    "algorithms": {"Body": {"source": "body.py"}},
    "instances": {
        "body": {"algorithm": "Body"},
        "att": {
            "machine": "parts/attitude.json",
            "parameters": {"gain": 7.5},
            "inputs": {"target": 0.25},
            "requests": {"far": "STOP"},
        },
        "spare": {"machine": "parts/attitude.json", "requests": {"far": "far"}},
    },
    "connections": [
        {"from": "att.u", "to": "body.u"},
        {"from": "att.pair.first", "to": "body.first"},
        {"from": "body.angle", "to": "att.angle", "delayed": True, "initial": 0.1},
        {"from": "body.angle", "to": "spare.angle", "delayed": True, "initial": 0.1},
        {"from": "body.rate", "to": "att.rate", "delayed": True, "initial": 0.0},
        {"from": "body.order", "to": "att.order", "delayed": True, "initial": "far"},
        {"from": "body.order", "to": "spare.order", "delayed": True, "initial": "STOP"},
        {"from": "machine.period", "to": "body.period"},
    ],
    "always": {"body": 1000, "att": True},
    "states": {"FLY": {"schedule": {"spare": True}}, "HOLD": {}},
    "transitions": [
        {"from": "FLY", "to": "HOLD", "request": "STOP", "priority": 1},
        {"from": "HOLD", "to": "FLY", "request": "far"},
        {
            "from": "FLY",
            "to": "HOLD",
            "request": "far",
            "priority": 2,
            "health": {"instance": "att.law", "in": ["failed"]},
        },
    ],
    "channels": [
        {"name": "target", "id": 1, "field": "spare.inputs.target", "direction": "sensor"},
        {"name": "u", "id": 2, "field": "att.outputs.first", "direction": "actuator"},
    ],
    "publish": ["body", "att"],
    "views": {"panels": [{"title": "u", "values": ["att.outputs.u", "att.rate.pi.state.integral"]}]},
}
FILES = {
    "body.py": BODY,
    "parts/law.py": LAW,
    "parts/rate/loop.py": LOOP,
    "parts/rate/gains.py": GAINS,
    "parts/rate/table.csv": "bias\n0.125\n0\n",
    "parts/rate/numbers.json": '{"k": 2, "points": 2, "unused": 1}',
}

Change = Callable[[dict[str, Any], dict[str, Any], dict[str, Any]], Any]


def write(folder: Path, change: Change | None = None, files: Mapping[str, str] = FILES) -> Path:
    craft, attitude, rate = copy.deepcopy((CRAFT, ATTITUDE, RATE))
    if change is not None:
        change(craft, attitude, rate)
    (folder / "parts/rate").mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        (folder / name).write_text(text)
    (folder / "parts/rate/rate.json").write_text(json.dumps(rate, indent=1))
    (folder / "parts/attitude.json").write_text(json.dumps(attitude, indent=1))
    (folder / "craft.json").write_text(json.dumps(craft, indent=1))
    return folder / "craft.json"


def diagnose(folder: Path, change: Change | None = None, files: Mapping[str, str] = FILES) -> list[Diagnostic]:
    try:
        return compile_machine(write(folder, change, files), "", until="schedule").sink.diagnostics
    except DiagnosticError as error:
        return list(error.diagnostics)


def own_names(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
    """Every request is called the same everywhere."""
    attitude["requests"] = ["far", "wound"]
    attitude["instances"]["rate"]["requests"] = {"wound": "wound"}
    for part in ("att", "spare"):
        craft["instances"][part]["requests"] = {"far": "far", "wound": "wound"}
    craft["requests"] = ["wound"]


def flat() -> dict[str, Any]:
    """CRAFT with its own names as its user would write it without parts: an underscore for each dot."""
    craft = copy.deepcopy(CRAFT)
    craft["requests"] = ["wound"]
    craft["structs"] = {"Angles": {"roll": "f64"}, **PAIR}
    craft["algorithms"] = {
        "Body": {"source": "body.py"},
        "Law": {"source": "parts/law.py"},
        "Loop": {"source": "parts/rate/loop.py", "class": "Pi", "sizes": {"n": 2}},
    }
    law: dict[str, Any] = {"algorithm": "Law"}
    loop = {
        "algorithm": "Loop",
        "parameters": {"kp": 4, "ki": 3, "floor": "degraded", "table": [0.125, 0.0]},
        "frozen": ["kp"],
    }
    craft["instances"] = {
        "body": {"algorithm": "Body"},
        "att_law": {**law, "parameters": {"gain": 7.5, "begin": "far"}, "inputs": {"target": 0.25}},
        "att_rate_pi": loop,
        "spare_law": {**law, "parameters": {"gain": 1.5, "begin": "far"}},
        "spare_rate_pi": loop,
    }
    craft["connections"] = []
    for part in ("att", "spare"):
        craft["connections"] += [
            {"from": "machine.period", "to": f"{part}_rate_pi.period"},
            {"from": "machine.resumed", "to": f"{part}_rate_pi.resumed"},
            {"from": f"{part}_law.rate", "to": f"{part}_rate_pi.target"},
        ]
    text = json.dumps(CRAFT["connections"])
    for port, instance in {
        "angle": "law",
        "order": "law",
        "rate": "rate_pi",
        "u": "rate_pi",
        "pair": "rate_pi",
    }.items():
        text = re.sub(rf'"(att|spare)\.{port}\b', rf'"\1_{instance}.{port}', text)
    craft["connections"] += json.loads(text)
    craft["always"] = {"body": 1000, "att_law": 250, "att_rate_pi": {"hz": 50, "phase": 10}}
    craft["states"]["FLY"]["schedule"] = {"spare_law": 250, "spare_rate_pi": {"hz": 50, "phase": 10}}
    craft["transitions"][2]["health"]["instance"] = "att_law"
    craft["channels"][0]["field"] = "spare_law.inputs.target"
    craft["channels"][1]["field"] = "att_rate_pi.outputs.pair.first"
    craft["publish"] = ["body", "att_law", "att_rate_pi"]
    craft["views"]["panels"][0]["values"] = ["att_rate_pi.outputs.u", "att_rate_pi.state.integral"]
    return craft


def code_of(path: Path) -> str:
    """Header and C of a machine, without comments, hashes and what names of parts have more than others."""
    compilation = compile_machine(path, "")
    text = re.sub(r"/\*.*?\*/", "", compilation.header + compilation.source, flags=re.DOTALL)
    text = re.sub(r"0x[0-9a-f]{2}u?|[0-9a-f]{64}|^#line.*", "", text, flags=re.MULTILINE)
    text = re.sub(r"\b(\w*(?:att|spare))(?:__|\.)(?=law|rate)", r"\1_", text)
    return re.sub(r"(att_rate|spare_rate)(?:__|\.)pi", r"\1_pi", text)


def test_a_part_costs_nothing(tmp_path: Path) -> None:
    """The C is that of the same machine without parts."""
    parts = code_of(write(tmp_path / "parts", own_names))
    write(tmp_path / "flat")
    (tmp_path / "flat/craft.json").write_text(json.dumps(flat(), indent=1))
    assert parts.splitlines() == code_of(tmp_path / "flat/craft.json").splitlines()


def test_parts_run_as_the_reference_runs_them(tmp_path: Path) -> None:
    twins = Twins(write(tmp_path))
    expected = {
        "att.law.parameters.gain": 7.5,
        "spare.law.parameters.gain": 1.5,
        "att.law.inputs.target": 0.25,
        "att.rate.pi.parameters.kp": 4.0,
        "att.rate.pi.parameters.ki": 3.0,
        "att.rate.pi.parameters.table": [0.125, 0.0],
    }
    assert {path: twins.get(path) for path in expected} == expected
    visited = set()
    for tick in range(4000):
        if tick % 500 == 400:
            twins.set("spare.law.inputs.target", float(tick - 2000))
        twins.step(where=f"tick {tick}")
        visited.add((twins.native.state, twins.get("att.law.outputs.seen"), twins.get("spare.law.outputs.seen")))
    assert {state for state, _, _ in visited} == {"FLY", "HOLD"}
    # `att` calls STOP `far`, and knows no other request: `far` of the machine is none of its own.
    assert {att for _, att, _ in visited} == {0, 1} and {spare for _, _, spare in visited} == {0, 1}


def test_an_algorithm_of_the_machine_with_the_name_of_one_of_a_part_is_another_one(tmp_path: Path) -> None:
    for name, number in (("one.py", 1.0), ("part/two.py", 2.0), ("three.py", 3.0)):
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(
            f'class F:\n    outputs = {{"o": "f64"}}\n\n    def execute(self):\n        self.o = {number}\n'
        )
    machine: dict[str, Any] = {"tick_hz": 100, "initial_state": "R"}
    part = {**machine, "algorithms": {"F": {"source": "two.py"}}, "instances": {"s": {"algorithm": "F"}}}
    (tmp_path / "part/part.json").write_text(json.dumps({**part, "states": {"R": {"schedule": {"s": 100}}}}))
    machine |= {
        "algorithms": {"F": {"source": "one.py"}, "a_F": {"source": "three.py", "class": "F"}},
        "instances": {"a": {"machine": "part/part.json"}, "f": {"algorithm": "F"}, "g": {"algorithm": "a_F"}},
        "states": {"R": {"schedule": {"a": True, "f": 100, "g": 100}}},
    }
    (tmp_path / "m.json").write_text(json.dumps(machine))
    twins = Twins(tmp_path / "m.json")
    twins.step()
    assert [twins.get(f"{i}.outputs.o") for i in ("f", "a.s", "g")] == [1.0, 2.0, 3.0]


def test_a_title_that_looks_like_a_port_stays(tmp_path: Path) -> None:
    def change(craft: Any, attitude: Any, rate: Any) -> None:
        craft["views"]["panels"][0]["title"] = "att.outputs.u"

    assert '"title":"att.outputs.u"' in compile_machine(write(tmp_path, change), "").machine.views


def test_requests_have_names_of_the_machine(tmp_path: Path) -> None:
    """`wound` is `far` in the part that the part is in, and STOP in the machine."""
    machine = compile_machine(write(tmp_path), "", until="schedule").checked
    made = {i.name: {name for name, _ in i.algorithm.requests} for i in machine.instances}
    assert made["att.rate.pi"] == made["att.law"] == {"STOP"} and made["spare.rate.pi"] == {"far"}
    assert [a.name for a in machine.algorithms] == ["Body", "Law", "Loop", "spare_Law", "spare_rate_Loop"]


def test_rates_and_phases_are_those_of_the_machine(tmp_path: Path) -> None:
    """A phase of two ticks at 200 Hz is ten at 1000 Hz."""
    machine = compile_machine(write(tmp_path), "", until="schedule").checked
    entries = {machine.instances[e.instance].name: (e.divisor, e.phase) for e in machine.states[0].entries}
    assert entries["att.law"] == (4, 0) and entries["att.rate.pi"] == entries["spare.rate.pi"] == (20, 10)
    assert [i.name for i in machine.instances if i.published] == ["body", "att.law", "att.rate.pi"]


def test_a_tick_and_a_phase_of_constants(tmp_path: Path) -> None:
    def change(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
        craft.update(constants={"fast": 1000}, tick_hz="fast")
        rate["states"]["ON"]["schedule"]["pi"]["phase"] = "k"

    machine = compile_machine(write(tmp_path, change), "", until="schedule").checked
    entries = {machine.instances[e.instance].name: (e.divisor, e.phase) for e in machine.states[0].entries}
    assert machine.tick_hz == 1000 and entries["att.rate.pi"] == (20, 10)


def test_a_part_says_what_an_input_is_that_nobody_connects(tmp_path: Path) -> None:
    def change(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
        attitude["instances"]["law"]["inputs"] = {"target": 0.75, "order": "far"}

    twins = Twins(write(tmp_path, change))
    assert twins.get("att.law.inputs.target") == 0.25 and twins.get("spare.law.inputs.target") == 0.75
    machine = compile_machine(tmp_path / "craft.json", "", until="schedule").checked
    assert {i.name: i.inputs for i in machine.instances}["att.law"] == {"target": (0.25,)}  # `order` is connected


def test_a_part_is_a_machine_of_its_own(tmp_path: Path) -> None:
    write(tmp_path)
    twins = Twins(tmp_path / "parts/attitude.json")
    twins.set("law.inputs.target", 0.5)
    twins.step(100)
    assert twins.get("rate.pi.outputs.u") != 0.0


RATE_REQUIREMENTS = """{"requirements": [
    {"id": "R-1", "text": "A large integral gives a large output.", "when": "pi.state.integral > k",
     "then": "pi.outputs.u > k * max_over(pi.inputs.rate, 0.5)", "clock": "pi"}
]}"""


def with_requirements(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
    rate["requirements"] = "required.json"
    attitude["requirements"] = [
        {"id": "A-1", "text": "It is small.", "when": "machine.tick > k", "then": "rate.outputs.pair.first < 9.5"},
        {"id": "A-2", "text": "It ends.", "at_end": "rate.pi.outputs.u - law.outputs.rate * k < 1.0"},
    ]
    craft["requirements"] = [{"id": "C-1", "text": "Both.", "then": "att.outputs.first == spare.rate.pi.outputs.u"}]


def test_requirements_of_parts_are_of_the_machine(tmp_path: Path) -> None:
    """Ids and instances have the part before them; paths are ports, or fields of its instances; constants are its own."""
    files = {**FILES, "parts/rate/required.json": RATE_REQUIREMENTS}
    path = write(tmp_path, with_requirements, files)

    def requirements_of(path: Path) -> dict[str, tuple[list[Any], str | None]]:
        requirements = compile_machine(path, "", until="schedule").requirements
        nodes = {r.id: [node for root in r.expressions for node in root.walk()] for r in requirements}
        named = {id_: [n.value for n in own if n.operator in ("field", "literal")] for id_, own in nodes.items()}
        return {r.id: (named[r.id], r.clock) for r in requirements}

    found = requirements_of(path)
    assert list(found) == ["C-1", "att.A-1", "att.A-2", "att.rate.R-1", "spare.A-1", "spare.A-2", "spare.rate.R-1"]
    pi = "att.rate.pi"
    assert found["C-1"] == (["att.rate.pi.outputs.pair.first", "spare.rate.pi.outputs.u"], None)
    assert found["att.A-1"] == (["machine.tick", 3, f"{pi}.outputs.pair.first", 9.5], None)
    assert found["att.A-2"] == ([f"{pi}.outputs.u", "att.law.outputs.rate", 3, 1.0], None)
    assert found["att.rate.R-1"] == ([f"{pi}.state.integral", 2, f"{pi}.outputs.u", 2, f"{pi}.inputs.rate"], pi)
    alone = requirements_of(tmp_path / "parts/attitude.json")
    assert alone["rate.R-1"][1] == "rate.pi" and list(alone) == ["A-1", "A-2", "rate.R-1"]
    machine = compile_machine(path, "", until="schedule").checked
    assert machine.hashed_text == compile_machine(write(tmp_path), "", until="schedule").checked.hashed_text


def test_a_requirement_of_a_part_acts_on_its_instances(tmp_path: Path) -> None:
    def change(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
        effect = {"degrade": "law"}
        attitude["requirements"] = [{"id": "A-1", "text": "It waits.", "then": "machine.tick < 5", "effect": effect}]
        craft["transitions"].append({"from": "FLY", "to": "HOLD", "requirement": "att.A-1", "priority": 3})

    twins = Twins(write(tmp_path, change))
    twins.step(4)
    assert twins.get("att.law.outputs.health") == "nominal" and twins.native.state == "FLY"
    twins.step(6)
    assert twins.get("att.law.outputs.health") == "degraded" and twins.native.state == "HOLD"


def test_a_wrong_requirement_in_the_file_that_a_part_names(tmp_path: Path) -> None:
    wrong = {**FILES, "parts/rate/required.json": RATE_REQUIREMENTS.replace("pi.state", "pi.stat")}
    found = said(diagnose(tmp_path, with_requirements, wrong)[0])
    assert found[0].startswith('parts/rate/required.json "pi.stat.integral > k" E257: `when`: there is no field')
    assert found[1] == 'parts/attitude.json "rate/rate.json" `att.rate` is a part here'
    (tmp_path / "parts/rate/required.json").unlink()
    missing = said(diagnose(tmp_path, with_requirements)[0])
    assert (
        missing[0] == 'parts/rate/rate.json "required.json" E100: cannot read `parts/rate/required.json`: no such file'
    )
    assert missing[-1] == f"paths are relative to {tmp_path / 'parts/rate'}"


def test_the_source_hash_covers_what_parts_hold(tmp_path: Path) -> None:
    def hash_of(**files: str) -> str:
        changed = {name: files.get(name.rpartition("/")[2].partition(".")[0], text) for name, text in FILES.items()}
        return build_machine(write(tmp_path, files=changed)).source_hash

    before = hash_of()
    assert hash_of(numbers='{"k": 2, "points": 2, "unused": 7}') == before
    changes = (
        {"numbers": '{"k": 2.5, "points": 2}'},
        {"table": "bias\n0.5\n0\n"},
        {"gains": GAINS.replace("9.0", "8.0")},
        {"law": LAW.replace("1e3", "2e3")},
    )
    hashes = {hash_of(**change) for change in changes}
    assert len(hashes) == 4 and before not in hashes
    path = write(tmp_path, lambda craft, attitude, rate: attitude.update(description="another"))
    assert build_machine(path).source_hash != before
    assert build_machine(write(tmp_path)).source_hash == before


def test_both_places_are_shown(tmp_path: Path) -> None:
    (error,) = diagnose(tmp_path, lambda craft, attitude, rate: rate["states"]["ON"]["schedule"].update(pi=300))[:1]
    assert error.code == "E220" and error.span.source.name == "parts/rate/rate.json"
    notes = [(note.span.source.name, note.text) for note in error.notes]
    assert notes == [
        ("parts/attitude.json", "`att.rate` is a part here"),
        ("craft.json", "`att` is a part here"),
    ]
    assert '"machine": "parts/attitude.json"' in error.render()


def instance(name: str, **changes: Any) -> Change:
    return lambda craft, attitude, rate: craft["instances"][name].update(changes)


def connect(source: str, target: str) -> Change:
    return lambda craft, attitude, rate: craft["connections"].append({"from": source, "to": target})


def part(**changes: Any) -> Change:
    return lambda craft, attitude, rate: attitude.update(changes)


def ports(record: str, **changes: Any) -> Change:
    return lambda craft, attitude, rate: attitude["ports"][record].update(changes)


WRONG: dict[str, tuple[Change, str]] = {
    "no such file": (
        instance("att", machine="parts/none.json"),
        "E100: cannot read the part `parts/none.json`: no such",
    ),
    "outside": (instance("att", machine="../x.json"), "E100: cannot read the part `../x.json`: it would leave"),
    "not a text": (instance("att", machine=3), "E208: `machine` is a string, not an integer"),
    "not a machine": (
        instance("att", machine="parts/rate/numbers.json"),
        "E202: a machine that is a part has no `tick_hz`",
    ),
    "in itself": (
        lambda craft, attitude, rate: rate["instances"].update(again={"machine": "../attitude.json"}),
        "E100: cannot read the part `parts/rate/../attitude.json`: it would leave",
    ),
    "itself": (
        lambda craft, attitude, rate: rate["instances"].update(again={"machine": "rate.json"}),
        "E254: `rate.json` cannot be a part here",
    ),
    "its channels": (part(channels=[]), "E201: unknown key `channels` in a machine that is a part"),
    "two states": (
        part(states={"RUN": {"schedule": {"law": 250}}, "B": {"schedule": {}}}),
        "E254: a machine with 2 states cannot be a part",
    ),
    "another initial state": (part(initial_state="B"), "E206: no state `B`"),
    "every": (part(states={"RUN": {"schedule": {"law": {"every": 2}, "rate": True}}}), "E254: `every` in a part"),
    "a phase between ticks": (
        lambda craft, attitude, rate: rate.update(
            tick_hz=3000, states={"ON": {"schedule": {"pi": {"hz": 100, "phase": 1}}}}
        ),
        "E254: a phase that the machine cannot have",
    ),
    "a rate for a part": (
        lambda craft, attitude, rate: craft["always"].update(att=100),
        "E254: a rate of part `att`",
    ),
    "one instance of a part": (
        lambda craft, attitude, rate: craft["always"].update({"att.law": 100}),
        "E254: `att.law` in a schedule",
    ),
    "an instance that looks like one of a part": (
        lambda craft, attitude, rate: craft["instances"].update({"a.b": {"algorithm": "Body"}}),
        "E203: `a.b` is not a name",
    ),
    "a name that paths have": (
        lambda craft, attitude, rate: attitude["instances"].update(outputs={"algorithm": "Law"}),
        "E209: `outputs` is reserved",
    ),
    "a part called as a topic": (
        lambda craft, attitude, rate: craft["instances"].update(record=craft["instances"].pop("spare")),
        "E209: `record` is reserved",
    ),
    "a port that is not there": (connect("body.u", "att.angel"), "E216: part `att` has no input `angel`"),
    "an instance behind the ports": (connect("body.u", "att.law.gain"), "E216: part `att` has no input `law`"),
    "an output as an input": (connect("body.u", "att.u"), "E216: part `att` has no input `u`"),
    "a parameter that is no port": (instance("att", parameters={"kp": 1}), "E216: part `att` has no parameter `kp`"),
    "an input that is no port": (instance("att", inputs={"kp": 1}), "E216: part `att` has no input `kp`"),
    "a value of another type": (
        instance("att", parameters={"gain": True}),
        "E207: parameter `gain` is f64, not a bool",
    ),
    "a key": (instance("att", max_wcet_us=3), "E201: unknown key `max_wcet_us` in part `att`"),
    "a port of nothing": (ports("inputs", more="law.angel"), "E216: `law` has no input `angel`"),
    "a port of an output": (ports("inputs", more="law.rate"), "E216: `law` has no input `rate`"),
    "a port of nobody": (ports("outputs", more="lew.rate"), "E206: no instance `lew`"),
    "a port that is a number": (ports("outputs", more=3), "E208: a port is a string, not an integer"),
    "a channel in a part": (
        part(connections=[{"from": "channels.target.valid", "to": "law.angle"}]),
        "E254: a part has no channels",
    ),
    "a port of nothing at all": (ports("inputs", more=[]), "E208: port `more` stands for nothing"),
    "an empty port": (ports("outputs", more=""), "E208: `` is no path of a port"),
    "a port that is an instance": (ports("outputs", more="law"), "E208: `law` is no path of a port"),
    "parameters that are no object": (
        instance("att", parameters=[3]),
        "E208: `parameters` of `att` is an object from name to definition",
    ),
    "inputs that are no object": (instance("att", inputs=3), "E208: `inputs` of `att` is an object"),
    "an algorithm of the machine": (
        part(instances={**ATTITUDE["instances"], "law": {"algorithm": "Body"}}),
        "E206: no algorithm `Body`",
    ),
    "members in another order": (
        lambda craft, attitude, rate: attitude.update(structs={"Pair": {"second": "f64", "first": "f64"}}),
        "E255: struct `Pair` has other members in another file",
    ),
    "connections of a machine that are no list": (
        lambda craft, attitude, rate: craft.update(connections={}),
        "E208: `connections` is a list, not an object",
    ),
    "a request without a text": (instance("att", requests={"far": ""}), "E203: `` is not a request name"),
    "a request of a part in a part": (
        lambda craft, attitude, rate: attitude["instances"]["rate"]["requests"].update(wound="STOP"),
        "E256: request `STOP` is not listed",
    ),
    "requests that are no texts": (part(requests=[3]), "E208: a request is a string, not an integer"),
    "connections that are no list": (part(connections={}), "E208: `connections` is a list, not an object"),
    "instances that are no object": (part(instances=[]), "E208: `instances` is an object from name to definition"),
    "too many": (
        lambda craft, attitude, rate: craft["instances"].update(
            {f"a{n}": {"machine": "parts/rate/rate.json", "requests": {"wound": "far"}} for n in range(1000)}
        ),
        "E254: `parts/rate/rate.json` cannot be a part here",
    ),
    "a channel behind the ports": (
        lambda craft, attitude, rate: craft["channels"][0].update(field="spare.law.inputs.target"),
        "E254: `spare.law.inputs.target` is no port of a part",
    ),
    "a channel for two inputs": (
        lambda craft, attitude, rate: attitude["ports"]["inputs"].update(target=["law.target", "law.angle"]),
        "E254: `spare.inputs.target` stands for 2 inputs",
    ),
    "other members": (
        lambda craft, attitude, rate: attitude.update(structs={"Pair": {"first": "f64"}}),
        "E255: struct `Pair` has other members in another file",
    ),
    "a request without a name": (
        lambda craft, attitude, rate: craft["instances"]["att"].pop("requests"),
        "E256: request `far` of part `att` has no name here",
    ),
    "a request that it does not make": (
        instance("att", requests={"far": "STOP", "near": "far"}),
        "E206: part `att` has no request `near`",
    ),
    "two of one name": (
        lambda craft, attitude, rate: (
            attitude.update(requests=["far", "near"]),
            craft["instances"]["att"].update(requests={"far": "STOP", "near": "STOP"}),
        ),
        "E256: two requests of `att` are called `STOP`",
    ),
    "a request that it does not list": (part(requests=[]), "E206: part `att` has no request `far`"),
    "a request without transition": (
        instance("att", requests={"far": "NEAR"}),
        "E225: no transition is requested by `NEAR`",
    ),
    "a constant of the machine": (
        lambda craft, attitude, rate: (
            craft.update(constants={"q": 1}),
            rate["instances"]["pi"]["parameters"].update(kp="q"),
        ),
        "E252: parameter `kp`: there is no constant `q`",
    ),
    "a constant of the part": (
        instance("att", parameters={"gain": "k"}),
        "E207: parameter `gain` is f64, not a string",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong(tmp_path: Path, name: str) -> None:
    change, expected = WRONG[name]
    found = [f"{d.code}: {d.message}" for d in diagnose(tmp_path, change) if d.severity.value == "error"]
    assert any(text.startswith(expected) for text in found), found


def inner_source(path: str) -> Change:
    return lambda craft, attitude, rate: attitude["connections"][0].update({"from": path})


def guard(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
    craft["transitions"][2]["health"]["instance"] = "att"


def no_list_of_requests(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
    """`body` makes no request, so the first one is of a part."""
    craft["connections"] = [c for c in craft["connections"] if c["from"] != "body.order"]
    craft["algorithms"]["Body"]["source"] = "silent.py"
    del craft["transitions"], craft["states"]["HOLD"]


#: All that the only error says: file, text at the place, code and message, notes in the same form, correction.
CONDITION = 'write a condition, such as "held(abs(nav.outputs.speed) < 2.0, 0.5)"'


def required(key: str, value: str) -> Change:
    def change(craft: dict[str, Any], attitude: dict[str, Any], rate: dict[str, Any]) -> None:
        attitude["requirements"] = [{"id": "A", "text": "It is small.", "then": "law.outputs.rate < 9.0", key: value}]

    return change


SAYS: dict[str, tuple[Change, list[str]]] = {
    "a struct of the machine": (
        lambda craft, attitude, rate: craft.update(structs=rate.pop("structs")),
        [
            'parts/rate/loop.py "Pair" E301: unknown type `Pair`',
            'parts/rate/rate.json "Loop" an algorithm of a part',
            'craft.json "Pair" only another file declares the struct',
            "declare `Pair` in the `structs` of `parts/rate/rate.json`, too",
        ],
    ),
    "a struct of the machine in a struct": (
        lambda craft, attitude, rate: (
            craft.update(structs={"Vec": {"x": "f64"}}),
            rate["structs"].update(Box={"corner": "Vec[2]"}),
        ),
        [
            'parts/rate/rate.json "Vec[2]" E232: unknown type `Vec`',
            'craft.json "Vec" only another file declares it',
            'parts/attitude.json "rate/rate.json" `att.rate` is a part here',
            'craft.json "parts/attitude.json" `att` is a part here',
            "declare `Vec` in the `structs` of this file, too",
        ],
    ),
    "a request without transition": (
        instance("att", requests={"far": "NEAR"}),
        [
            'parts/law.py "far" E225: no transition is requested by `NEAR`',
            'craft.json "NEAR" `att.law` makes it: `far` of part `att` is called so here',
            'add a transition with it, or list it: `"requests": ["NEAR"]`',
        ],
    ),
    "a request of a parameter": (
        lambda craft, attitude, rate: (
            attitude.update(requests=["far", "near"]),
            attitude["instances"]["law"]["parameters"].update(begin="near"),
            craft["instances"]["att"]["requests"].update(near="NEAR"),
            craft["instances"]["spare"]["requests"].update(near="STOP"),
        ),
        [
            'parts/attitude.json "near" E225: no transition is requested by `NEAR`',
            'craft.json "NEAR" `att` makes it: `near` of part `att` is called so here',
            'craft.json "parts/attitude.json" `att` is a part here',
            'add a transition with it, or list it: `"requests": ["NEAR"]`',
        ],
    ),
    "a part in `always` and in a state": (
        lambda craft, attitude, rate: craft["states"]["FLY"]["schedule"].update(att=True),
        [
            'craft.json "att" E243: `att` is in `always`, so state `FLY` schedules it already',
            'craft.json "att" scheduled in every state here',
            "remove it here; or from `always`, and list it in every state that runs it",
        ],
    ),
    "a phase beyond the period": (
        lambda craft, attitude, rate: rate["states"]["ON"]["schedule"]["pi"].update(phase=4),
        [
            "parts/rate/rate.json 4 E204: `phase` (ticks) is 4",
            'parts/attitude.json "rate/rate.json" `att.rate` is a part here',
            'craft.json "parts/attitude.json" `att` is a part here',
            "it must be in [0, 3]",
        ],
    ),
    "an instance of nobody": (
        inner_source("lew.rate"),
        [
            'parts/attitude.json "lew.rate" E206: no instance `lew`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `law`?",
        ],
    ),
    "a part of nobody": (
        lambda craft, attitude, rate: craft["connections"][0].update({"from": "atr.u"}),
        ['craft.json "atr.u" E206: no instance `atr`', "did you mean `att`?"],
    ),
    "an output of nobody": (
        inner_source("law.rates"),
        [
            'parts/attitude.json "law.rates" E216: `law` has no output `rates`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `rate`?",
        ],
    ),
    "an instance of nobody in a schedule": (
        lambda craft, attitude, rate: attitude["states"]["RUN"]["schedule"].update(lew=250),
        [
            'parts/attitude.json "lew" E206: no instance `lew`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `law`?",
        ],
    ),
    "a parameter of nobody": (
        lambda craft, attitude, rate: rate["instances"]["pi"]["parameters"].update(kq=1),
        [
            'parts/rate/rate.json "kq" E210: algorithm `Loop` has no parameter `kq`',
            'parts/attitude.json "rate/rate.json" `att.rate` is a part here',
            'craft.json "parts/attitude.json" `att` is a part here',
            "it has kp, ki, table, floor, least, word",
        ],
    ),
    "a parameter without a value": (
        lambda craft, attitude, rate: attitude["instances"]["law"]["parameters"].pop("begin"),
        [
            'parts/attitude.json {⏎    "gain": "k / 2"⏎   } E211: parameter `begin` of `law` has no value',
            'parts/law.py "begin": "TransitionRequest" declared here',
            'craft.json "parts/attitude.json" `att` is a part here',
            'add `"begin": …` (TransitionRequest)',
        ],
    ),
    "a value outside, by a port of another name": (
        lambda craft, attitude, rate: (
            attitude["ports"]["parameters"].update(slope="law.gain"),
            craft["instances"]["att"].update(parameters={"slope": True}),
        ),
        ["craft.json true E207: parameter `slope` is f64, not a bool", "write a finite number"],
    ),
    "a port of no parameter": (
        ports("parameters", gain="law.gian"),
        [
            'parts/attitude.json "law.gian" E216: `law` has no parameter `gian`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `gain`?",
        ],
    ),
    "a port of no input": (
        ports("inputs", angle="law.angel"),
        [
            'parts/attitude.json "law.angel" E216: `law` has no input `angel`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `angle`?",
        ],
    ),
    "a connection to no port": (
        connect("body.rate", "att"),
        ['craft.json "att" E216: part `att` without one of its inputs', "it has angle, target, rate, order"],
    ),
    "a name behind the ports": (
        lambda craft, attitude, rate: craft["connections"][0].update({"from": "att.law.rate"}),
        [
            'craft.json "att.law.rate" E216: part `att` has no output `law`',
            "only its `ports` can be named: declare one in `parts/attitude.json`",
        ],
    ),
    "a misspelt request": (
        instance("att", requests={"fra": "STOP"}),
        ['craft.json "fra" E206: part `att` has no request `fra`', "did you mean `far`?"],
    ),
    "a rate between ticks": (
        lambda craft, attitude, rate: attitude["states"]["RUN"]["schedule"].update(law=30),
        [
            "parts/attitude.json 30 E220: 30 Hz does not divide the machine's tick_hz (1000)",
            'craft.json "parts/attitude.json" `att` is a part here',
            "the nearest rates that do are 25 and 40 Hz",
        ],
    ),
    "a folder": (
        instance("att", machine="parts"),
        ['craft.json "parts" E100: cannot read the part `parts`: Is a directory', ""],
    ),
    "an absolute path": (
        lambda craft, attitude, rate: attitude["algorithms"]["Law"].update(source="/etc/passwd"),
        [
            'parts/attitude.json "/etc/passwd" E103: `/etc/passwd` cannot be a source',
            'craft.json "parts/attitude.json" `att` is a part here',
            "",
        ],
    ),
    "an input as a channel": (
        lambda craft, attitude, rate: craft["channels"][0].update(field="spare.target"),
        ['craft.json "spare.target" E254: `spare.target` is no port of a part', 'write "spare.inputs.target"'],
    ),
    "no port as a channel": (
        lambda craft, attitude, rate: craft["channels"][0].update(field="spare.goal"),
        [
            'craft.json "spare.goal" E254: `spare.goal` is no port of a part',
            "`spare` declares inputs.angle, inputs.target, inputs.rate, inputs.order, outputs.u, outputs.pair, outputs.first",
        ],
    ),
    "an input of an instance as a channel": (
        lambda craft, attitude, rate: craft["channels"][0].update(field="body.period"),
        [
            'craft.json "body.period" E215: a sensor is an output or an input, not `body.period`',
            'write "body.inputs.period"',
        ],
    ),
    "a requirement of no field": (
        required("then", "law.outputs.rote < 9.0"),
        [
            'parts/attitude.json "law.outputs.rote < 9.0" E257: `then`: there is no field `law.outputs.rote`; did you mean '
            "`law.outputs.rate`?",
            'craft.json "parts/attitude.json" `att` is a part here',
            CONDITION,
        ],
    ),
    "a requirement of an instance that another part has": (
        required("then", "pi.outputs.u < 9.0"),
        [
            'parts/attitude.json "pi.outputs.u < 9.0" E257: `then`: no instance `pi`; the instances are law, rate.pi',
            'craft.json "parts/attitude.json" `att` is a part here',
            CONDITION,
        ],
    ),
    "a requirement of the machine's state": (
        required("then", "machine.state == 'FLY'"),
        [
            "parts/attitude.json \"machine.state == 'FLY'\" E257: `then`: `machine.state` is of the machine around a part, "
            "which knows only its own and `machine.tick`",
            'craft.json "parts/attitude.json" `att` is a part here',
            CONDITION,
        ],
    ),
    "a clock of a requirement": (
        required("clock", "lew"),
        [
            'parts/attitude.json "lew" E206: no instance `lew`',
            'craft.json "parts/attitude.json" `att` is a part here',
            "did you mean `law`?",
        ],
    ),
    "a requirement of no port": (
        lambda craft, attitude, rate: craft.update(
            requirements=[{"id": "C", "text": "It is small.", "then": "att.outputs.w < 9.0"}]
        ),
        [
            'craft.json "att.outputs.w < 9.0" E257: `then`: there is no field `att.outputs.w`; did you mean `att.outputs.u`?',
            CONDITION,
        ],
    ),
    "a part as a guard": (
        guard,
        [
            'craft.json "att" E206: `att` is a part, not an instance',
            "name one of its instances: att.law, att.rate.pi",
        ],
    ),
}


def said(d: Diagnostic) -> list[str]:
    def at(span: Span) -> str:
        return f"{span.source.name} {span.text}".replace("\n", "⏎")

    return [f"{at(d.span)} {d.code}: {d.message}", *(f"{at(n.span)} {n.text}" for n in d.notes), d.help]


@pytest.mark.parametrize("name", SAYS)
def test_what_an_error_says(tmp_path: Path, name: str) -> None:
    change, expected = SAYS[name]
    assert [said(d) for d in diagnose(tmp_path, change) if d.severity.value == "error"] == [expected]


def test_a_file_that_is_not_text_is_shown(tmp_path: Path) -> None:
    path = write(tmp_path)
    (tmp_path / "parts/attitude.json").write_bytes(b'{"tick_hz": \xff}')
    with pytest.raises(DiagnosticError) as failed:
        compile_machine(path, "")
    assert said(failed.value.diagnostics[0]) == [
        "parts/attitude.json \ufffd E100: cannot read the part `parts/attitude.json`: it is not UTF-8 text",
        'craft.json "parts/attitude.json" it is a part here',
        "remove it, or save the file as UTF-8",
    ]


def test_a_missing_file_is_sought_beside_the_file_of_the_part(tmp_path: Path) -> None:
    found = diagnose(tmp_path, lambda craft, attitude, rate: attitude["algorithms"]["Law"].update(source="lew.py"))
    assert [d.help for d in found] == [f"paths are relative to {tmp_path / 'parts'}"]


def test_a_request_that_a_part_does_not_list_is_reported_there(tmp_path: Path) -> None:
    """Also if another part with the same algorithm lists it."""

    def change(craft: Any, attitude: Any, rate: Any) -> None:
        mute = {
            **rate,
            "requests": [],
            "algorithms": {"Mute": {**rate["algorithms"]["Loop"], "source": "rate/loop.py"}},
        }
        mute["instances"] = {"pi": {**rate["instances"]["pi"], "algorithm": "Mute"}}
        mute["constants"], mute["algorithms"]["Mute"]["sizes"] = {"k": 2, "points": 2}, {"n": 2}
        rate["algorithms"]["Loop"]["sizes"] = {"n": 2}
        mute["instances"]["pi"]["parameters"] = {**mute["instances"]["pi"]["parameters"], "table": [0, 0]}
        (tmp_path / "parts/mute.json").parent.mkdir(exist_ok=True)
        (tmp_path / "parts/mute.json").write_text(json.dumps(mute))
        craft["instances"]["mute"] = {"machine": "parts/mute.json"}
        craft["instances"]["loop"] = {"machine": "parts/rate/rate.json", "requests": {"wound": "wound"}}
        craft["requests"] = ["wound"]

    errors = [said(d) for d in diagnose(tmp_path, change) if d.severity.value == "error"]
    assert errors[0] == [
        'parts/rate/loop.py "wound" E256: request `wound` is not listed',
        'parts/mute.json "Mute" an algorithm of this part',
        'add it to the `requests` of `parts/mute.json`: "wound"',
    ]


def test_requests_that_no_list_has_show_where_parts_get_them(tmp_path: Path) -> None:
    silent = {**FILES, "silent.py": BODY.replace('"STOP" if self.rate > 0.0 else "far"', '""')}
    (warning,) = [d for d in diagnose(tmp_path, no_list_of_requests, silent) if d.code == "W208"]
    assert said(warning)[1:3] == [
        'craft.json "STOP" `att.law` makes it: `far` of part `att` is called so here',
        'craft.json "far" `spare.law` makes it: `far` of part `spare` is called so here',
    ]


def test_a_struct_of_an_algorithm_of_both(tmp_path: Path) -> None:
    """A part has an algorithm of the machine, which alone declares the struct."""
    one = {"tick_hz": 10, "initial_state": "R", "algorithms": {"F": {"source": "f.py"}}}
    part = {**one, "instances": {"f": {"algorithm": "F"}}, "states": {"R": {"schedule": {"f": 10}}}}
    whole = {**one, "structs": {"P": {"x": "f64"}}, "states": {"R": {"schedule": {"f": 10, "p": True}}}}
    whole["instances"] = {"f": {"algorithm": "F"}, "p": {"machine": "part.json"}}
    (tmp_path / "f.py").write_text(
        'class F:\n    outputs = {"o": "P"}\n\n    def execute(self):\n        self.o.x = 1.0\n'
    )
    (tmp_path / "part.json").write_text(json.dumps(part))
    (tmp_path / "whole.json").write_text(json.dumps(whole))
    with pytest.raises(DiagnosticError, match="unknown type `P`"):
        compile_machine(tmp_path / "whole.json", "")
    (tmp_path / "part.json").write_text(json.dumps({**part, "structs": whole["structs"]}))
    assert len(compile_machine(tmp_path / "whole.json", "").machine.algorithms) == 1


def test_an_old_value_of_a_part_is_shown_where_the_state_is(tmp_path: Path) -> None:
    def change(craft: Any, attitude: Any, rate: Any) -> None:
        attitude["ports"]["outputs"]["wish"] = "law.transition_request"
        craft["connections"][5]["from"] = "spare.wish"

    (warning,) = [d for d in diagnose(tmp_path, change) if d.code == "W206"]
    assert warning.span.text == '"HOLD"' and warning.help.startswith("schedule `spare` here, or ")


@pytest.mark.parametrize(
    ("change", "code", "message"),
    [
        (
            lambda craft, attitude, rate: rate["algorithms"].update(
                G={"source": "loop.py", "class": "Pi", "sizes": {"n": 3}}
            ),
            "W201",
            "algorithm `G` has no instance",
        ),
        (
            lambda craft, attitude, rate: attitude["states"]["RUN"]["schedule"].pop("law"),
            "W204",
            "no state schedules instance `law`: it never runs",
        ),
    ],
)
def test_a_warning_names_what_the_file_names(tmp_path: Path, change: Change, code: str, message: str) -> None:
    assert [d.message for d in diagnose(tmp_path, change) if d.code == code] == [message]


def test_a_part_that_no_state_schedules(tmp_path: Path) -> None:
    """One warning, at the part and not at each instance in it."""

    def change(craft: Any, attitude: Any, rate: Any) -> None:
        craft["states"]["FLY"]["schedule"].pop("spare")

    (warning,) = [d for d in diagnose(tmp_path, change) if d.code == "W204"]
    assert warning.message == "no state schedules part `spare`: none of its instances runs"
    assert warning.span.source.name == "craft.json" and '"spare": true' in warning.help


def test_a_part_that_the_part_around_it_does_not_schedule(tmp_path: Path) -> None:
    found = diagnose(tmp_path, lambda craft, attitude, rate: attitude["states"]["RUN"]["schedule"].pop("rate"))
    (warning,) = [d for d in found if d.code == "W204"]
    assert warning.message == "no state schedules part `rate`: none of its instances runs"
    assert warning.span.source.name.endswith("attitude.json")


def test_a_request_in_a_helper_has_the_name_of_no_part(tmp_path: Path) -> None:
    helper = 'def word(x: f64) -> TransitionRequest:\n    return "far" if x > 0.0 else ""\n'
    law = helper + LAW.replace('self.transition_request = "far"', "self.transition_request = word(self.rate)")
    found = [d for d in diagnose(tmp_path, files={**FILES, "parts/law.py": law}) if d.code == "E256"]
    assert found and found[0].message == "request `far` of a part in a helper"
