# SPDX-License-Identifier: Apache-2.0
"""Structs, slices, unpacking, bits and frozen parameters, as a host sees them in the machine of golden/values.json."""

import struct
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_abi import ROLES, Machine, write_machine

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.driver.passes import compile_machine
from fcsl_compiler.driver.toolchain import FLAGS, compiler, include_dirs

CONFIG = Path(__file__).parent / "golden" / "values.json"
WRITABLE, FROZEN, IMPURE, ASSIGNED = 1, 2, 4, 8


def f32(x: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", x))[0])


@pytest.fixture
def machine() -> Machine:
    return Machine.build(CONFIG)


def test_leaves_have_paths(machine: Machine) -> None:
    """One field per scalar or array of scalars, in the order of the members; units come from the struct."""
    paths = [p for p in machine.fields if p.startswith("nav.inputs.targets[2].") or p.startswith("nav.outputs.best")]
    assert paths == [
        "nav.inputs.targets[2].pose.position",
        "nav.inputs.targets[2].pose.attitude",
        "nav.inputs.targets[2].pose.valid",
        "nav.inputs.targets[2].weight",
        "nav.outputs.best.pose.position",
        "nav.outputs.best.pose.attitude",
        "nav.outputs.best.pose.valid",
        "nav.outputs.best.weight",
    ]
    assert machine.fields["nav.outputs.best.weight"].unit == b"kg"
    assert machine.fields["nav.state.history[1][0].pose.position"].count == 3
    channel = machine.channels["best"]
    assert machine.d.fields[channel.field].path == b"nav.outputs.best.pose.position"


def test_initial_values_and_start(machine: Machine) -> None:
    assert machine.get("nav.inputs.measured.position") == [4, 5, 6]
    assert machine.get("nav.parameters.home.attitude") == [1, 0, 0, 0]
    assert machine.get("nav.state.history[0][0].pose.position") == [1, 2, 3]
    assert machine.get("cold.state.history[0][0].pose.position") == [-1, -2, -3]
    assert machine.get("cold.state.history[0][0].pose.valid") is False


def test_one_tick(machine: Machine) -> None:
    """Expected values computed by hand from golden/algorithms/navigation.py."""
    machine.set("nav.inputs.targets[0].weight", 1.0)
    machine.set("nav.inputs.targets[1].weight", 3.0)
    machine.set("nav.inputs.targets[1].pose.position", [7, 8, 9])
    machine.set("nav.inputs.n", 0)
    machine.set("nav.inputs.word", 0xF0000001)
    machine.step()
    assert machine.get("nav.counters.faults") == 0
    assert machine.get("nav.outputs.pose.position") == [-8, 5, 6]
    assert machine.get("nav.outputs.pose.valid") is False
    assert machine.get("nav.inputs.measured.position") == [4, 5, 6]  # the helper had a copy
    assert machine.get("nav.outputs.best.weight") == 1.0  # targets[0] against itself
    assert machine.get("nav.state.history[0][1].weight") == 2.5
    assert machine.get("nav.state.history[0][1].pose.position") == [4, 5, 6]
    assert machine.get("nav.state.history[1][0].pose.position") == [7, 0, 0]
    assert machine.get("nav.state.m") == [4, 5, 5 + 4, 5, 6, 6 + 5]
    assert machine.get("nav.outputs.column") == [5, 6]
    # line = [5, 4, 0, 0, 0]; [5, 5, 4, 0, 0] after the copy; the last three then grow by [1, 0.5, 6]
    assert machine.get("nav.state.line") == [5, 5, 5, 0.5, 6]
    assert machine.get("nav.outputs.sum") == 0.5 + 6 + 3
    assert machine.get("nav.outputs.bits") == ((((0xF0000001 << 4) & 0xFFFFFFFF) | 3) & ~1) ^ 0xF0
    assert machine.get("nav.outputs.half") == f32(0.5 * 1 - 3)


def test_frozen_parameters_are_in_the_code(machine: Machine) -> None:
    """They can be read, not set. The other instance keeps fields that a host can set."""
    for path in ("home.position", "matrix", "gain"):
        assert machine.fields[f"cold.parameters.{path}"].flags == FROZEN
        assert machine.fields[f"nav.parameters.{path}"].flags == WRITABLE
    assert machine.get("cold.parameters.matrix") == [10, 20, 30, 40]
    for name in ("nav", "cold"):
        machine.set(f"{name}.parameters.matrix", [0, 0, 100, 0])  # bypasses the flags, as only a defective host does
        machine.set(f"{name}.parameters.gain", 8.0)
    machine.step()
    assert machine.get("nav.outputs.sum") == 0.5 + 6 + 100
    # cold sees nav's mirrored pose: [-8, 5, 6], not valid
    assert machine.get("cold.outputs.sum") == 0.5 + 6 + 30
    assert machine.get("cold.outputs.half") == -0.25 * 2 - 1


def test_an_index_that_faults_keeps_everything(machine: Machine) -> None:
    machine.step()
    before = machine.save()
    machine.set("nav.inputs.n", 2)  # history[1, 2] is outside; targets[2] is not
    machine.step()
    assert machine.get("nav.outputs.health") == "failed"
    assert machine.get("nav.counters.faults") == 1
    after = Machine.build(CONFIG)
    after.restore(before)
    for path in (
        p for p in machine.fields if p.startswith("nav.") and ROLES[machine.fields[p].role] in ("output", "state")
    ):
        if path != "nav.outputs.health":
            assert machine.get(path) == after.get(path), path


def test_connected_structs(machine: Machine) -> None:
    """A connection copies every leaf, and the descriptor gives its source."""
    fields = list(machine.fields)
    for leaf in ("position", "attitude", "valid"):
        f = machine.fields[f"cold.inputs.measured.{leaf}"]
        assert fields[f.connected_from] == f"nav.outputs.pose.{leaf}"
        assert f.flags == WRITABLE  # until the next copy
    machine.step()
    assert machine.get("cold.inputs.measured.position") == [-8, 5, 6]
    assert machine.get("cold.inputs.word") == 5


def test_what_reads_hardware_is_impure(machine: Machine) -> None:
    assert machine.fields["nav.outputs.column"].flags == WRITABLE | IMPURE | ASSIGNED
    assert machine.fields["nav.state.m"].flags == WRITABLE | IMPURE
    assert machine.fields["nav.inputs.n"].flags == WRITABLE


def test_outputs_that_execute_assigns_are_flagged(tmp_path: Path) -> None:
    """Wholly, in part, in a branch not taken, by an effect; not outputs that only `start` or nothing assigns, which
    keep the values of a host."""
    source = """
from fcsl_builtins import hw_read_adc
class Law:
    inputs = {"go": "bool", "i": "i32"}
    outputs = {
        "whole": "Pair",
        "part": "Pair",
        "many": "Pair[2]",
        "line": "f64[3]",
        "branch": "f64",
        "read": "u32",
        "kept": "f64",
        "kept_pair": "Pair",
        "started": "f64",
    }
    state = {"kept_here": "f64"}

    def start(self):
        self.started = 1.0

    def execute(self):
        self.whole = Pair(2.0, [1, 1])
        self.part.a = 2.0
        self.many[self.i].b[0] = 2
        self.line[1:] = [2.0, 2.0]
        if self.go:
            self.branch = 2.0
        self.read = hw_read_adc(0)
        self.kept_here = self.kept
"""
    config: dict[str, Any] = {**MEMBERS, "states": {"S": {"schedule": {"one": 10}}}}
    machine = Machine.build(
        write_machine(tmp_path, "m", {**config, "instances": {"one": {"algorithm": "Law"}}}, {"a": source})
    )
    outputs = [p for p in machine.fields if p.startswith("one.outputs.") and machine.fields[p].flags & WRITABLE]
    flagged = {p.removeprefix("one.outputs.") for p in outputs if machine.fields[p].flags & ASSIGNED}
    assert flagged == {"whole.a", "whole.b", "part.a", "many[0].b", "many[1].b", "line", "branch", "read"}
    written = {path: [7] * machine.fields[path].count if machine.fields[path].rank else 7 for path in outputs}
    for path, value in written.items():
        machine.set(path, value)
    machine.step()
    changed = {p.removeprefix("one.outputs.") for p, value in written.items() if machine.get(p) != value}
    # An assignment under a condition, or at another index, did not occur in this tick.
    assert changed == flagged - {"branch", "many[1].b"}


MEMBERS = {
    "tick_hz": 10,
    "initial_state": "S",
    "structs": {"Pair": {"a": "f64 m", "b": "i32[2]"}},
    "states": {"S": {"schedule": {"one": 10, "two": 10}}},
}


def test_a_connection_from_a_member(tmp_path: Path) -> None:
    """`from` may name a member of an output, and its unit is checked."""
    source = """
class Source:
    outputs = {"p": "Pair"}

    def execute(self):
        self.p = Pair(b=[1, 2], a=3.5)
"""
    target = """
class Target:
    inputs = {"v": "f64 {unit}"}
    state = {"seen": "f64"}

    def execute(self):
        self.seen = self.v
"""
    config: dict[str, Any] = {
        **MEMBERS,
        "instances": {"one": {"algorithm": "Source"}, "two": {"algorithm": "Target"}},
        "connections": [{"from": "one.p.a", "to": "two.v"}],
    }
    machine = Machine.build(
        write_machine(tmp_path / "m", "members", config, {"source": source, "target": target.replace("{unit}", "m")})
    )
    machine.step()
    assert machine.get("two.state.seen") == 3.5
    wrong = write_machine(
        tmp_path / "s", "members", config, {"source": source, "target": target.replace("{unit}", "s")}
    )
    with pytest.raises(DiagnosticError, match="E218"):
        compile_machine(wrong, "")


ONE = {"tick_hz": 10, "initial_state": "S", "states": {"S": {"schedule": {"one": 10}}}}


def test_a_frozen_index_out_of_range_faults(tmp_path: Path) -> None:
    """The compiler knows the value but keeps the check: a frozen parameter is not a constant of the language."""
    source = """
class Law:
    outputs = {"x": "f64"}
    parameters = {"i": "i64"}
    state = {"v": "f64[3]"}

    def execute(self):
        self.x = self.v[self.i] + 1.0
"""
    for frozen in (False, True):
        instance = {"algorithm": "Law", "parameters": {"i": 7}, "frozen": frozen}
        machine = Machine.build(
            write_machine(tmp_path / str(frozen), "m", {**ONE, "instances": {"one": instance}}, {"a": source})
        )
        machine.step()
        assert (machine.get("one.outputs.health"), machine.get("one.outputs.x")) == ("failed", 0.0)


def test_frozen_conditions_leave_no_dead_code(tmp_path: Path) -> None:
    source = """
class Law:
    inputs = {"a": "f64"}
    outputs = {"x": "f64"}
    parameters = {"fast": "bool", "n": "i32"}

    def execute(self):
        self.x = self.a * 2.0 if self.fast else self.a / f64(self.n - 4)
        if self.fast and self.n > 3:
            self.x += f64(self.n * 2)
            return
        self.x = 0.0
"""
    instance = {"algorithm": "Law", "parameters": {"fast": True, "n": 4}, "frozen": True, "inputs": {"a": 1.5}}
    path = write_machine(tmp_path, "m", {**ONE, "instances": {"one": instance}}, {"a": source})
    c = compile_machine(path, "").source
    begun = c.index("alg_Law__one__execute(")
    body = c[begun : c.index("\n}", begun)]
    assert "if (" not in body and "?" not in body and "fault" not in body and "outputs->x = 0.0" not in body
    machine = Machine.build(path)
    machine.step()
    assert machine.get("one.outputs.x") == 11.0


def test_arrays_of_structs_copy_without_a_warning(tmp_path: Path) -> None:
    """gcc takes a memcpy to an array of structs for one to its first member."""
    source = """
def twice(p: "Pose") -> "Pose[2]":
    return [p, p]
class Law:
    state = {"last": "Deep"}

    def execute(self):
        self.last.poses[1].position[2] += 1.0
        self.last.poses = twice(self.last.poses[1])
"""
    structs = {"Pose": {"position": "f64[3]", "valid": "bool"}, "Deep": {"poses": "Pose[2]", "n": "i32"}}
    config = {**ONE, "structs": structs, "instances": {"one": {"algorithm": "Law"}}}
    path = write_machine(tmp_path, "m", config, {"a": source})
    compilation = compile_machine(path, "")
    (tmp_path / "m.h").write_text(compilation.header)
    (tmp_path / "m.c").write_text(compilation.source)
    strict = ["-Wall", "-Wextra", "-Werror", f"-I{include_dirs()[0]}", "-c", "-o", "/dev/null", str(tmp_path / "m.c")]
    subprocess.run([*compiler(), *FLAGS, *strict], check=True)
    machine = Machine.build(path)
    machine.step(3)
    assert machine.get("one.state.last.poses[0].position") == [0.0, 0.0, 3.0]


def test_accepted_as_in_python(tmp_path: Path) -> None:
    """Code after an `if` is reachable if only its else ends; rows of a literal adopt its type, also after zeros()."""
    source = """
from fcsl_builtins import zeros
class Law:
    inputs = {"go": "bool"}
    outputs = {"x": "f64", "m": "f64[2][2]"}

    def execute(self):
        self.m = [zeros(2), [3, 4]]
        if self.go:
            self.x = 1.0
        else:
            return
        self.x += 0.5
"""
    config = {**ONE, "instances": {"one": {"algorithm": "Law", "inputs": {"go": True}}}}
    machine = Machine.build(write_machine(tmp_path, "m", config, {"a": source}))
    machine.step()
    assert (machine.get("one.outputs.x"), machine.get("one.outputs.m")) == (1.5, [0.0, 0.0, 3.0, 4.0])


def test_slices_into_slices(tmp_path: Path) -> None:
    """Columns from blocks, blocks from columns, overlapping parts of the same array."""
    source = """
class Law:
    state = {"m": "f64[3][4]", "v": "f64[2][5]"}

    def start(self):
        for i in range(2):
            for j in range(5):
                self.v[i, j] = f64(10 * i + j)

    def execute(self):
        i = 1
        self.m[:, i] = self.v[i, 2:]
        self.m[0:2, 2:] = self.v[:, 1:3]
        self.m[1:, 0:2] = self.m[0:2, 1:3]
        self.v[:, 4] = self.m[0:2, 3]
"""
    config = {**ONE, "instances": {"one": {"algorithm": "Law"}}}
    machine = Machine.build(write_machine(tmp_path, "m", config, {"a": source}))
    machine.step()
    v = np.array([[0.0, 1, 2, 3, 4], [10, 11, 12, 13, 14]])
    m = np.zeros((3, 4))
    m[:, 1] = v[1, 2:]
    m[0:2, 2:] = v[:, 1:3]
    m[1:, 0:2] = m[0:2, 1:3].copy()
    v[:, 4] = m[0:2, 3]
    assert machine.get("one.state.m") == m.ravel().tolist()
    assert machine.get("one.state.v") == v.ravel().tolist()


@pytest.mark.parametrize(
    ("statement", "code"),
    [
        ("self.a = self.h[0:0]", "E438"),
        ("self.a[0:3] = self.h[2:5]", "E438"),
        ("self.a[0:2] = self.h[0:4:2]", "E438"),
        ("self.a[0:2] = self.h[self.n:2]", "E438"),
        ("self.f = self.h[0:2][0]", "E438"),
        ("self.a[0:2] = self.h[0:3]", "E402"),
        ("a, b = self.h", "E437"),
        ("a, b = 1, 2, 3", "E437"),
        ("a, (b, c) = 1, 2", "E437"),
        ("a, b = self.f", "E437"),
        ("self.p = Pair(1.0)", "E436"),
        ("self.p = Pair(1.0, [1, 2], c=3)", "E436"),
        ("self.p = Pair(1.0, [1, 2], a=3)", "E436"),
        ("self.p = Pair(1.0, [1, 2, 3])", "E402"),
        ("self.p.c = 1.0", "E408"),
        ("self.f = self.f.a", "E408"),
        ("self.f = Pair(1.0, [1, 2]).c", "E408"),
        ("self.q = self.p == self.p", "E413"),
        ("self.p = self.p + self.p", "E415"),
        ("Pair = 1.0", "E422"),
        ("self.n = self.n << 1", "E415"),
        ("self.w = self.w << 32", "E439"),
        ("self.n = self.n >> -1", "E439"),
        ("self.w = self.w & self.n", "E415"),
        ("self.q = self.q & self.q", "E415"),
        ("self.f = self.f | 1.0", "E415"),
        ("self.q = self.q and hw_read_gpio(0)", "E434"),
        ("self.f = hw_read_adc(0) + 1.0", "E401"),
        ("hw_read_adc(0)", "E421"),
        ("self.n = hw_write_gpio(0, True)", "E421"),
        ("self.n = hw_read_adc(0)", "E402"),
        ("hw_write_gpio(0)", "E416"),
    ],
)
def test_refused(statement: str, code: str, tmp_path: Path) -> None:
    """One mistake, one message."""
    algorithm = f"""
class Law:
    outputs = {{"a": "f64[3]", "f": "f64", "n": "i32", "w": "u32", "q": "bool", "p": "Pair"}}
    state = {{"h": "f64[4]"}}

    def execute(self):
        {statement}
"""
    config = {**MEMBERS, "instances": {"one": {"algorithm": "Law"}, "two": {"algorithm": "Law"}}}
    with pytest.raises(DiagnosticError) as error:
        compile_machine(write_machine(tmp_path, "refused", config, {"a": algorithm}), "")
    assert [d.code for d in error.value.diagnostics] == [code], str(error.value)


@pytest.mark.parametrize(
    ("structs", "fragment"),
    [
        ({"A": {"b": "B"}, "B": {"a": "A"}}, "contain itself: A → B → A"),
        ({"A": {"b": "A[2]"}}, "contain itself"),
        ({"pose": {"a": "f64"}}, "CamelCase"),
        ({"A": {"x": "f65"}}, "unknown type `f65`"),
        ({"A": {"X": "f64", "x": "f64"}}, "one field of a ROS 2 message"),
        ({"A": {"int": "f64"}}, "word of C"),
        ({"A": {}}, "no members"),
        ({"A": {"x": "f64[100000]"}}, "at most 65536"),
        ({"Health": {"x": "f64"}}, "name of the language"),
    ],
)
def test_structs_refused(structs: dict[str, Any], fragment: str, tmp_path: Path) -> None:
    config = {
        "tick_hz": 10,
        "initial_state": "S",
        "structs": structs,
        "instances": {"i": {"algorithm": "Law"}},
        "states": {"S": {"schedule": {"i": 10}}},
    }
    path = write_machine(tmp_path, "refused", config, {"a": "class Law:\n    def execute(self):\n        pass\n"})
    with pytest.raises(DiagnosticError) as error:
        compile_machine(path, "")
    assert fragment in str(error.value)
    assert {d.code for d in error.value.diagnostics} == {"E232"}
