# SPDX-License-Identifier: Apache-2.0
"""W214, with --strict: a request that leads the machine round a circle of states for as long as an input lasts. What the
machine does agrees with the warning."""

import itertools
import json
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine

from fcsl_compiler.driver.passes import compile_machine

LATCH = """from fcsl_builtins import extern


@extern(header="latch.h")
def latch(on: bool) -> bool: ...


"""
PILOT = """class Pilot:
    inputs = {{"go": "bool", "arm": "bool", "x": "f64[2]"}}
    outputs = {{"on": "bool", "seen": "i32", "transition_request": "TransitionRequest"}}
    parameters = {{"wish": "TransitionRequest"}}
    state = {{"was": "bool", "n": "i32", "past": "f64[2]"}}

    def execute(self):
{body}
"""
ASK = 'self.transition_request = "T" if self.go else ""'
THERE, BACK = ({"from": a, "to": b, "request": "T"} for a, b in ("AB", "BA"))


def config(
    folder: Path, body: str, transitions: Any = (THERE, BACK), states: str = "AB", runs: Any = None, **more: Any
) -> Path:
    """A pilot that runs in each state (or those of `runs`), and a sensor and a relay that do so."""
    folder.mkdir(exist_ok=True)
    text = PILOT.format(body="".join(f"        {line}\n" for line in body.splitlines()))
    (folder / "pilot.py").write_text(LATCH * ("latch" in body) + text)
    (folder / "other.py").write_text(
        'class Sensor:\n    outputs = {"on": "bool"}\n\n    def execute(self):\n        pass\n\n\n'
        'class Relay:\n    inputs = {"on": "bool"}\n    outputs = {"same": "bool", "edge": "bool"}\n'
        '    state = {"was": "bool"}\n\n'
        "    def execute(self):\n        self.same = self.on\n"
        "        self.edge = self.on and not self.was\n        self.was = self.on\n"
    )
    is_fed = any(f"pilot.{name}" in json.dumps(more) for name in ("go", "inputs.go"))
    whole = {
        "tick_hz": 10,
        "initial_state": "A",
        "algorithms": {"Pilot": {"source": "pilot.py"}, **{n: {"source": "other.py"} for n in ("Sensor", "Relay")}},
        "instances": {
            "sensor": {"algorithm": "Sensor"},
            "relay": {"algorithm": "Relay", "inputs": {"on": False}},
            "pilot": {
                "algorithm": "Pilot",
                "parameters": {"wish": "T"},
                "inputs": {"arm": False, "x": [0.0, 0.0]} | ({} if is_fed else {"go": False}),
            },
        },
        "states": {
            s: {"schedule": dict.fromkeys(("sensor", "relay", *(["pilot"] if s in (runs or states) else [])), 10)}
            for s in states
        },
        "transitions": [{"priority": -n, **item} for n, item in enumerate(transitions)],
        "requests": ["T", "U"],
        **more,
    }
    (folder / "craft.json").write_text(json.dumps(whole, indent=1))
    return folder / "craft.json"


def circles(path: Path) -> list[str]:
    """The ways that warnings name."""
    found = compile_machine(path, "", strict=True).sink.diagnostics
    return [d.message.rpartition(": ")[2] for d in found if d.code == "W214"]


#: Bodies that request by a level, and those that may not.
LEVELS = [
    ASK,
    'if self.go:\n    self.transition_request = "T"',
    'if self.go:\n    self.transition_request = self.wish\nelse:\n    self.transition_request = ""',
    f"self.n += 1\nself.was = self.go\n{ASK}",  # a memory of something else
    'self.on = self.go and not self.arm\nself.transition_request = "T" if self.on else ""',
    'self.was = self.go\nif self.was:\n    self.transition_request = "T"',  # written before it is read
    "wanted = False\nfor i in range(2):\n    if self.x[i] > 0.5:\n        wanted = True\n        break\n"
    'if wanted:\n    self.transition_request = "T"',
    'if not self.go:\n    return\nself.transition_request = "T"',
    'on = hw_read_gpio(3)\nif on or self.go:\n    self.transition_request = "T"',
    'self.transition_request = "T" if self.go else "U"',
]
MEMORIES = [
    'self.transition_request = "T" if self.go and not self.was else ""\nself.was = self.go',
    'edge = self.go and not self.was\nself.was = self.go\nif edge:\n    self.transition_request = "T"',
    'if self.go == self.was:\n    return\nself.was = self.go\nself.transition_request = "T" if self.go else ""',
    'self.transition_request = "T" if self.go and not self.on else ""\nself.on = self.go',
    "wanted = False\nfor i in range(2):\n    wanted = wanted or self.x[i] > self.past[i]\nself.past = self.x\n"
    'if wanted:\n    self.transition_request = "T"',
    'if self.go:\n    self.n += 1\nelse:\n    self.n = 0\nif self.n == 3:\n    self.transition_request = "T"',
    'was = self.n\nself.n += 1\nfor i in range(2):\n    if was > 3:\n        break\n    self.transition_request = "T"',
    'self.past[0] = self.x[0]\nif self.past[1] > 0.5:\n    self.transition_request = "T"',
    'on = latch(self.go)\nif on:\n    self.transition_request = "T"',
]


@pytest.mark.parametrize("body", LEVELS)
def test_a_level(tmp_path: Path, body: str) -> None:
    assert circles(config(tmp_path, body)) == ["A → B → A"]


@pytest.mark.parametrize("body", MEMORIES)
def test_a_memory(tmp_path: Path, body: str) -> None:
    assert circles(config(tmp_path, body)) == []


def test_without_strict_there_is_none(tmp_path: Path) -> None:
    found = compile_machine(config(tmp_path, ASK), "").sink.diagnostics
    assert "W214" not in [d.code for d in found]


CHANNEL = {"name": "switch", "id": 1, "direction": "sensor"}


@pytest.mark.parametrize(
    ("more", "warned"),
    [
        ({"channels": [{**CHANNEL, "field": "pilot.inputs.go"}]}, True),
        ({"connections": [("sensor.on", "go")], "channels": [{**CHANNEL, "field": "sensor.outputs.on"}]}, True),
        ({"connections": [("relay.same", "go")]}, True),
        ({"connections": [("relay.edge", "go")]}, False),
        ({"connections": [("machine.resumed", "go")]}, False),
        ({"connections": [("channels.switch.valid", "go")]}, True),
        ({"connections": [("channels.switch.fresh", "go")]}, False),
        ({"connections": [("pilot.seen_before", "go")]}, False),  # what it has told itself
    ],
)
def test_where_the_input_comes_from(tmp_path: Path, more: dict[str, Any], warned: bool) -> None:
    body = ASK
    connections = [{"from": a, "to": f"pilot.{b}"} for a, b in more.get("connections", [])]
    for connection in connections:
        if connection["from"] == "pilot.seen_before":
            connection |= {"from": "pilot.on", "delayed": True, "initial": False}
            body += "\nself.on = not self.go"
    channels = more.get("channels", [{**CHANNEL, "field": "sensor.outputs.on"}])
    path = config(tmp_path, body, connections=connections, channels=channels)
    assert circles(path) == (["A → B → A"] if warned else [])


def edge(way: str, **more: Any) -> dict[str, Any]:
    return {"from": way[0], "to": way[1], "request": "T", **more}


def guard(*healths: str) -> dict[str, Any]:
    return {"health": {"instance": "sensor", "in": list(healths)}}


@pytest.mark.parametrize(
    ("transitions", "runs", "ways"),
    [
        ([edge("AB")], "ABC", []),
        ([edge("AB"), edge("BA")], "ABC", ["A → B → A"]),
        ([edge("AB"), edge("BA", request="U")], "ABC", []),
        ([edge("AB"), edge("BA")], "AC", []),  # it makes no request in B
        ([edge("AB"), edge("BC"), edge("CA")], "ABC", ["A → B → C → A"]),
        ([edge("AB"), edge("BC"), edge("CB")], "ABC", ["B → C → B"]),
        ([{**edge("AB"), "from": "*"}, edge("BA")], "ABC", ["A → B → A"]),
        # A request without condition is answered by the largest priority alone.
        ([edge("BC"), edge("AB"), edge("BA")], "ABC", []),
        ([edge("BC", **guard("failed")), edge("AB"), edge("BA")], "ABC", ["A → B → A"]),
        # Guards of which one holds at most; times of each step.
        ([edge("AB", **guard("nominal")), edge("BA", **guard("failed"))], "ABC", []),
        ([edge("AB", **guard("nominal")), edge("BA", **guard("nominal", "failed"))], "ABC", ["A → B → A"]),
        ([edge("AB", after_s=0.5), edge("BA", after_s=0.5)], "ABC", []),
        ([edge("AB", after_s=0.5), edge("BA")], "ABC", ["A → B → A"]),
    ],
)
def test_ways(tmp_path: Path, transitions: Any, runs: str, ways: list[str]) -> None:
    assert circles(config(tmp_path, ASK, transitions, "ABC", runs)) == ways


@pytest.mark.parametrize(("body", "changes"), [(LEVELS[0], True), (LEVELS[3], True), (MEMORIES[0], False)])
def test_the_machine_does_so(tmp_path: Path, body: str, changes: bool) -> None:
    m = Machine.build(config(tmp_path, body))
    m.set("pilot.inputs.go", True)
    seen = []
    for _ in range(9):
        m.step()
        seen.append(m.state)
    assert all(a != b for a, b in itertools.pairwise(seen)) == changes


def test_the_message_names_instance_request_and_ways(tmp_path: Path) -> None:
    (found,) = (d for d in compile_machine(config(tmp_path, ASK), "", strict=True).sink.diagnostics if d.code == "W214")
    assert found.message == "while `pilot` requests `T`, the state changes in each of its runs: A → B → A"
    assert [n.text for n in found.notes] == ["and this one leads on", "requested here"]
