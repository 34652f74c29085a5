# SPDX-License-Identifier: Apache-2.0
"""Helpers with several results. Compiled and in CPython."""

import ast
from pathlib import Path

from fcsl_test_abi import write_one_each
from fcsl_test_twins import Twins

SOURCE = '''
from fcsl_builtins import Health, f64, norm

LIMIT = 4


def split(v: "f64[3]") -> tuple[f64, "f64[3]"]:
    """Length and direction."""
    length = norm(v)
    if length > 0:
        return length, v / length
    return 0, v


def again(v: "f64[3]") -> tuple[f64, "f64[3]"]:
    return split(v)


def judged(goal: Pose, at: i32) -> tuple[Pose, Health, bool, f32]:
    moved = goal
    moved.position[at] += 1
    word = "failed" if moved.position[0] > LIMIT else "nominal"
    return moved, word, word == "failed", 0.1


class Law:
    inputs = {"v": "f64[3]", "goal": "Pose", "at": "i32"}
    outputs = {"length": "f64", "way": "f64[3]", "rows": "f64[2][3]", "pose": "Pose", "bad": "bool", "f": "f32"}
    state = {"seen": "i64"}

    def execute(self):
        self.seen += 1
        length, way = split(self.v)
        self.length, self.rows[1] = again(way * 2)
        self.length += length
        self.way = way
        self.pose, self.health, self.bad, tenth = judged(self.goal, self.at)
        self.f = tenth + 0.2
'''.replace('word = "failed" if', 'word: Health = "failed" if')


def test_results(tmp_path: Path) -> None:
    structs = {"Pose": {"position": "f64[3]", "valid": "bool"}}
    twins = Twins(write_one_each(tmp_path, {"law.py": SOURCE}, {"Law": {"source": "law.py"}}, structs=structs))
    found = {
        "law.outputs.length": 7.0,
        "law.outputs.way": [0.6, 0.0, 0.8],
        "law.outputs.rows": [0.0] * 3 + [0.6, 0, 0.8],
    }
    twins.expect(
        [
            ({}, {"law.outputs.length": 0.0, "law.outputs.pose.position": [1.0, 0.0, 0.0]}),
            ({"law.inputs.v": [3.0, 0.0, 4.0], "law.inputs.at": 2}, found),
            ({"law.inputs.goal.position": [5.0, 1.0, 1.0]}, {"law.outputs.bad": True, "law.outputs.health": "failed"}),
            ({"law.inputs.at": 3}, {"law.counters.faults": 1, "law.state.seen": 3}),
            ({"law.inputs.at": 0}, {"law.outputs.pose.position": [6.0, 1.0, 1.0], "law.state.seen": 4}),
        ]
    )


def test_the_types_are_pythons(tmp_path: Path) -> None:
    """The annotation has the same meaning for CPython."""
    (tmp_path / "plain.py").write_text(SOURCE.split("class Law")[0].split("def judged")[0])
    names: dict[str, object] = {}
    exec(compile(ast.parse((tmp_path / "plain.py").read_text()), "plain.py", "exec"), names)
    assert str(names["split"].__annotations__["return"]).startswith("tuple[")  # type: ignore[attr-defined]
