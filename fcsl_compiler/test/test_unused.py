# SPDX-License-Identifier: Apache-2.0
"""Warnings about unused declarations (W303 to W305), transitions that cannot occur (W209, W210) and comparisons with
NaN (W306), and their exceptions."""

import json
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.driver.passes import compile_machine

IMPORTS = "from fcsl_builtins import hw_read_gpio, isnan, nan\n\n\n"


def codes(folder: Path, text: str, **keys: Any) -> list[str]:
    """Diagnostics of the class Alg in its machine as `code name`."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "alg.py").write_text(IMPORTS + text)
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "structs": {"Pose": {"at": "f64[3]", "ok": "bool"}},
        "algorithms": {"Alg": {"source": "alg.py"}},
        "instances": {"one": {"algorithm": "Alg"}},
        "states": {"A": {"schedule": {"one": 10}}},
        **keys,
    }
    (folder / "craft.json").write_text(json.dumps(config))
    found = compile_machine(folder / "craft.json", "").sink.diagnostics
    return [f"{d.code} {d.message.split('`')[1]}" for d in found]


def execute(body: str, ports: str = "") -> str:
    return f"class Alg:\n{ports}\n    def execute(self):\n" + "".join(f"        {line}\n" for line in body.split("\n"))


OUTPUTS = '    outputs = {"y": "f64", "v": "f64[3]", "pose": "Pose"}\n'


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("a = 1.0\nself.y = a", []),
        ("a = 1.0\na += 1.0\nself.y = a", []),
        ("a = 1.0\na += 1.0", ["W303 a"]),
        ("a = 1.0\na = a + 1.0", []),  # it is read, if only by itself
        ("a: f64 = 1.0", ["W303 a"]),
        ("v = [1.0, 2.0]\nv[0] = 3.0", ["W303 v"]),
        ("v = [1.0, 2.0]\nv[0] = 3.0\nself.y = v[1]", []),
        ("i = 1\nself.v[i] = 3.0", []),  # an index is read
        ("i = 1\nw = [1.0, 2.0]\nw[i] = 3.0", ["W303 w"]),
        ("p = Pose([1.0, 2.0, 3.0], True)\np.at[0] = 0.0", ["W303 p"]),
        ("for i in range(3):\n    self.y += 1.0", []),
        ("for i in range(0):\n    a = 1.0\n    self.y = a", []),  # a loop that never runs counts as a read
        ("a, _b = self.v[0], self.v[1]\nself.y = a", []),
        ("a, b = self.v[0], self.v[1]\nself.y = a", ["W303 b"]),
        ("_level = hw_read_gpio(1)", []),
        ("level = hw_read_gpio(1)", ["W303 level"]),
        (
            "if self.y > 0.0:\n    level = 1.0\nelse:\n    level = 2.0",
            ["W303 level"],
        ),  # once
        ("y = self.y\nself.y = y + 1.0", []),  # a local of a port's name is a local
    ],
)
def test_locals(tmp_path: Path, body: str, said: list[str]) -> None:
    found = codes(tmp_path, execute(body, OUTPUTS))
    assert [f for f in found if not f.startswith("W304")] == said


def test_a_local_that_was_meant_to_be_an_output(tmp_path: Path) -> None:
    codes(tmp_path, execute("torque = 1.0", '    outputs = {"torque": "f64"}\n'))
    found = compile_machine(tmp_path / "craft.json", "").sink.diagnostics
    assert [(d.code, d.help) for d in found] == [
        ("W303", "did you mean `self.torque`?"),
        ("W304", "write `self.torque = …`, or remove it"),
    ]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("self.y = 1.0\nself.v[1] = 1.0\nself.pose.at[0] = 1.0", []),
        ("self.y += 1.0\nself.v, self.pose.ok = [1.0, 2.0, 3.0], True", []),
        ("self.y = self.v[0]", ["W304 v", "W304 pose"]),
        ("pass", []),  # a host writes them
        ('"""Filled by the host."""', []),
        ("...", []),
    ],
)
def test_outputs(tmp_path: Path, body: str, said: list[str]) -> None:
    assert codes(tmp_path, execute(body, OUTPUTS)) == said


def test_an_output_that_start_or_a_channel_writes(tmp_path: Path) -> None:
    ports = '    outputs = {"y": "f64", "raw": "f64", "zero": "f64", "left": "f64"}\n\n    def start(self):\n        self.zero = 2.0\n'
    channel = {"name": "raw", "id": 1, "field": "one.outputs.raw", "direction": "sensor"}
    assert codes(tmp_path, execute("self.y = self.raw", ports), channels=[channel]) == ["W304 left"]


@pytest.mark.parametrize(
    ("body", "said"),
    [
        ("self.n = self.u * self.k", ["W305 unused"]),
        ("self.n += self.u * self.k", ["W305 unused"]),  # state that is only written is for observers
        ("if self.n > 0.0:\n    self.unused = self.u * self.k", []),
        ("self.n = self.u\nself.unused = 1.0", ["W305 k"]),
        ("self.n = self.k\nself.unused = 1.0", ["W305 u"]),
    ],
)
def test_other_ports(tmp_path: Path, body: str, said: list[str]) -> None:
    ports = '    inputs = {"u": "f64"}\n    parameters = {"k": "f64"}\n    state = {"n": "f64", "unused": "f64"}\n'
    instances = {name: {"algorithm": "Alg", "parameters": {"k": 1.0}} for name in ("one", "two")}
    found = codes(
        tmp_path, execute(body, ports), instances=instances, states={"A": {"schedule": {"one": 10, "two": 10}}}
    )
    assert found == said  # once, for any number of instances


def test_a_parameter_that_start_alone_reads(tmp_path: Path) -> None:
    ports = (
        '    parameters = {"k": "f64"}\n    outputs = {"y": "f64"}\n\n    def start(self):\n        self.y = self.k\n'
    )
    instances = {"one": {"algorithm": "Alg", "parameters": {"k": 1.0}}}
    assert codes(tmp_path, execute("self.y += 1.0", ports), instances=instances) == []


def test_classes_that_the_machine_does_not_use(tmp_path: Path) -> None:
    other = '\n\nclass Other:\n    outputs = {"y": "Elsewhere"}\n\n    def execute(self):\n        a = 1.0\n'
    assert codes(tmp_path, execute("self.y = 1.0", '    outputs = {"y": "f64"}\n') + other) == []


@pytest.mark.parametrize(
    ("test", "said"),
    [
        ("self.y == nan", ["W306 =="]),
        ("not (nan <= self.y)", ["W306 <="]),
        ("self.y != -NOTHING", ["W306 !="]),
        ("self.y > 0.0 * inf", ["W306 >"]),
        ("isnan(self.y)", []),
        ("self.y != self.y", []),
        ("isnan(nan) or self.y == inf", []),
    ],
)
def test_nan(tmp_path: Path, test: str, said: list[str]) -> None:
    text = "NOTHING: f32 = nan\n\n\n" if "NOTHING" in test else ""
    kind = "f32" if text else "f64"
    ports = f'    outputs = {{"y": "{kind}", "b": "bool"}}\n\n    def start(self):\n        self.y = 1.0\n'
    assert codes(tmp_path, text + execute(f"self.b = {test}", ports)) == said


def test_nan_in_a_helper(tmp_path: Path) -> None:
    helper = "def same(a: f64) -> bool:\n    return a == nan\n\n\n"
    assert codes(tmp_path, helper + execute("self.b = same(1.0)", '    outputs = {"b": "bool"}\n')) == ["W306 =="]


ASKS = '    outputs = {"transition_request": "TransitionRequest"}\n'
WISHES = '    inputs = {"wish": "TransitionRequest"}\n' + ASKS


@pytest.mark.parametrize(
    ("states", "transitions", "said"),
    [
        # One of several sources is sufficient.
        ({"A": ["one"], "B": [], "C": ["two"]}, [(["A", "B"], "C", "GO"), ("C", "A", "GO")], []),
        ({"A": ["one"], "B": ["one"], "C": []}, [("A", "B", "GO"), ("B", "C", "GO")], []),
        ({"A": ["one"], "B": []}, [("A", "B", "GO"), ("B", "A", "GO")], ["W210 GO"]),
        ({"A": ["one"], "B": []}, [("A", "B", "one"), ("*", "A", "one")], ["W209 B"]),
        ({"A": ["one"], "B": ["two"]}, [("A", "B", "one"), ("B", "A", "two")], []),
        # An instance that never runs gets its own warning.
        ({"A": ["one"], "B": []}, [("A", "B", "GO"), ("B", "A", "two")], ["W204 two"]),
    ],
)
def test_transitions(tmp_path: Path, states: Any, transitions: Any, said: list[str]) -> None:
    rows = [
        {"from": source, "to": target, "priority": n}
        | ({"request": by} if by == "GO" else {"health": {"instance": by, "in": ["failed"]}})
        for n, (source, target, by) in enumerate(transitions)
    ]
    named = {by for _, _, by in transitions} | {name for due in states.values() for name in due}
    found = codes(
        tmp_path,
        execute('self.transition_request = "GO"', ASKS),
        instances={name: {"algorithm": "Alg"} for name in ("one", "two") if name in named},
        states={name: {"schedule": dict.fromkeys(due, 10)} for name, due in states.items()},
        transitions=rows,
        requests=["GO"],
    )
    assert [f for f in found if not f.startswith("W203")] == said


def test_an_instance_that_is_given_requests_may_make_any(tmp_path: Path) -> None:
    text = (
        execute("self.transition_request = self.wish", WISHES)
        + "\n\n"
        + execute('self.transition_request = "GO"', ASKS).replace("Alg", "Asks")
    )
    found = codes(
        tmp_path,
        text,
        algorithms={"Alg": {"source": "alg.py"}, "Asks": {"source": "alg.py"}},
        instances={"one": {"algorithm": "Alg"}, "asks": {"algorithm": "Asks"}},
        states={"A": {"schedule": {"one": 10}}, "B": {"schedule": {"asks": 10}}},
        transitions=[{"from": "A", "to": "B", "request": "GO"}],
    )
    assert found == []
