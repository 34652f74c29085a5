# SPDX-License-Identifier: Apache-2.0
"""A fault gives file, line, column and cause, in compiled machines and in CPython. If several are possible, it is the
first in Python's order."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from fcsl_test_abi import Machine, write_machine, write_one_each
from fcsl_test_programs import build
from fcsl_test_twins import InReference, Twins

from fcsl_compiler.driver.passes import compile_machine

#: Each faults for these inputs. `|` precedes the expression that faults first.
FIRST = {
    "self.i = |self.big + self.one": "the result does not fit i32",
    "self.i = |self.low - self.one": "the result does not fit i32",
    "self.l = |self.long * self.two": "the result does not fit i64",
    "self.i = |-self.low": "the result does not fit i32",
    "self.i = |abs(self.low)": "the result does not fit i32",
    "self.i = |self.big ** 3": "the result does not fit i32",
    "self.i = |self.one // self.zero": "the divisor is zero",
    "self.i = |self.one % self.zero": "the divisor is zero",
    "self.i = |self.low // -self.one": "the result does not fit i32",
    "self.u = |self.word // self.none": "the divisor is zero",
    "self.u = |self.word << self.many": "the shift count is outside [0, 32)",
    "self.l = |self.long >> self.long": "the shift count is outside [0, 64)",
    "self.i = |i32(self.x)": "the value does not fit i32",
    "self.u = |u32(self.low)": "the value does not fit u32",
    "self.i = |self.v[self.seven]": "the index is outside [0, 3)",
    "|self.v[self.seven] = 1": "the index is outside [0, 3)",
    "self.i = |self.m[self.one, self.seven]": "the index is outside [0, 3)",
    "self.i = |self.m[self.seven, self.one]": "the index is outside [0, 2)",
    "self.v = |self.m[self.seven]": "the index is outside [0, 2)",
    "self.v[0:2] = |self.m[self.seven, 0:2]": "the index is outside [0, 2)",
    "|self.v[0] += self.big": "the result does not fit i32",
    "|self.v[self.seven] += 1": "the index is outside [0, 3)",
    "self.v = |self.v + self.v * 1": "the result does not fit i32",
    "self.i = half(|self.big + self.one)": "the result does not fit i32",
    "if |self.big + self.one > 0:\n            self.i = 0": "the result does not fit i32",
    "|assert self.zero == 1, 'is one'": "assertion failed: is one",
    "|assert self.b": "assertion failed",
    # Of two, the first in Python's order.
    "assert |self.one // self.zero > 0, 'never said'": "the divisor is zero",
    "assert self.one > 0 and |self.v[self.seven] > 0": "the index is outside [0, 3)",
    "|assert self.zero > 0, 'first'\n        self.i = self.one // self.zero": "assertion failed: first",
    "self.i = (|self.one // self.zero) + self.v[self.seven]": "the divisor is zero",
    "self.i = |self.v[self.seven] + (self.one // self.zero)": "the index is outside [0, 3)",
    "self.i = both(|self.v[self.seven], self.one // self.zero)": "the index is outside [0, 3)",
    "self.i = both(|self.one // self.zero, self.v[self.seven])": "the divisor is zero",
    "self.i = clamp(|self.big + self.one, self.v[self.seven], self.one % self.zero)": "the result does not fit i32",
    "self.i = self.m[|self.one // self.zero, self.v[self.seven]]": "the divisor is zero",
    "self.i = self.m[|self.v[self.seven], self.one // self.zero]": "the index is outside [0, 3)",
    "self.i = self.m[self.seven, |self.one // self.zero]": "the divisor is zero",
    "self.i = |self.m[self.seven, self.eight]": "the index is outside [0, 2)",
    "self.v[self.seven] = |self.big + self.one": "the result does not fit i32",
    "self.m[self.seven] = |self.v + self.v": "the result does not fit i32",
    "self.m[self.seven, 0:2] = |self.v[0:2] + self.v[1:]": "the result does not fit i32",
    "self.m[0:2, self.seven] = |self.v[0:2] + self.v[1:]": "the result does not fit i32",
    "self.v = self.v - |self.v * self.big": "the result does not fit i32",
    "self.v = |self.v * self.big - self.m[self.seven]": "the result does not fit i32",
    "self.v = |self.m[self.seven] - self.v * self.big": "the index is outside [0, 2)",
    "self.v = [self.one, |self.one // self.zero, self.v[self.seven]]": "the divisor is zero",
    "self.pair = Pair(second=|self.one // self.zero, first=self.v[self.seven])": "the divisor is zero",
    "self.i = |self.pairs[self.seven].row[self.one // self.zero]": "the index is outside [0, 2)",
    "self.i = self.pairs[self.one].row[|self.one // self.zero]": "the divisor is zero",
    "self.i = |self.pairs[self.seven].row[self.eight]": "the index is outside [0, 2)",
    "self.i = |self.pairs[self.one].row[self.eight]": "the index is outside [0, 3)",
    "self.i = self.v[self.seven] if |self.big + self.one > 0 else self.one // self.zero": "the result does not fit i32",
    "self.b = |self.one // self.zero > self.v[self.seven]": "the divisor is zero",
    "self.b = |self.big + self.one > self.v[self.seven] > self.one // self.zero": "the result does not fit i32",
    "self.b = self.one < |self.v[self.seven] < self.one // self.zero": "the index is outside [0, 3)",
    "self.b = self.one > 0 and |self.v[self.seven] > self.one // self.zero": "the index is outside [0, 3)",
    "self.i, self.u = |self.v[self.seven], u32(self.low)": "the index is outside [0, 3)",
    "self.v[self.seven], self.v[0] = self.one, |self.big + self.one": "the result does not fit i32",
}
PROGRAM = """
def half(x: i32) -> i32:
    return x // 2
def both(x: i32, y: i32) -> i32:
    return x - y
class Faulty:
    inputs = {
        "big": "i32", "low": "i32", "long": "i64", "two": "i64", "one": "i32", "zero": "i32", "word": "u32",
        "none": "u32", "many": "i64", "x": "f64", "seven": "i32", "eight": "i32", "pairs": "Rows[2]",
    }
    outputs = {
        "i": "i32", "l": "i64", "u": "u32", "b": "bool", "v": "i32[3]", "m": "i32[2][3]", "pair": "Pair",
        "f": "f64[3]", "g": "f64[3][3]",
    }
    def execute(self):
        self.v = [2000000000, 2000000000, 2000000000]
        @STATEMENT@
"""
STRUCTS = {"Pair": {"first": "i32", "second": "i32"}, "Rows": {"row": "i32[3]"}}
INPUTS: dict[str, Any] = {
    "big": 2**31 - 1,
    "low": -(2**31),
    "long": 2**62,
    "two": 2,
    "one": 1,
    "word": 1,
    "many": 32,
    "x": 3e9,
    "seven": 7,
    "eight": 8,
}


def run(folder: Path, statement: str) -> tuple[Twins, list[str]]:
    """State after a tick that executed the statement, and the lines of its file."""
    text = PROGRAM.replace("@STATEMENT@", statement)
    twins = build(folder, "faulty", text, {}, STRUCTS)
    for name, value in INPUTS.items():
        twins.set(f"one.inputs.{name}", value)
    twins.step()
    return twins, text.split("\n")


@pytest.mark.parametrize("marked", FIRST)
def test_the_first_fault_is_told(marked: str, tmp_path: Path) -> None:
    twins, lines = run(tmp_path, marked.replace("|", ""))
    assert (twins.get("one.outputs.health"), twins.get("one.counters.faults")) == ("failed", 1)
    line = next(n for n, text in enumerate(lines, 1) if text.strip() == marked.replace("|", "").split("\n")[0])
    column = lines[line - 1].index(marked.split("|")[1].split("\n")[0]) + 1
    assert twins.native.fault("one") == twins.python.fault("one") == ("faulty.py", line, column, FIRST[marked])


SHARED = """
from tools import third

class Law:
    inputs = {"i": "i32"}
    outputs = {"x": "i32"}
    parameters = {"divisor": "i32", "at": "i32"}
    state = {"v": "i32[3]"}

    def start(self):
        self.v[self.at] = 1

    def execute(self):
        self.x = third(self.v, self.i // self.divisor)
"""
TOOLS = """

def third(v: "i32[3]", i: i32) -> i32:
    return v[i]
"""


def shared(folder: Path, at: int = 0) -> Path:
    law = {"algorithm": "Law", "parameters": {"divisor": 1, "at": at}}
    config = {
        "tick_hz": 10,
        "initial_state": "A",
        "instances": {"one": law, "two": law, "frozen": {**law, "frozen": ["divisor"]}},
        "states": {"A": {"schedule": {"one": 10, "two": 10, "frozen": 10}}},
        "algorithms": {"Law": {"source": "law.py"}},
    }
    return write_machine(folder, "shared", config, {"law": SHARED, "tools": TOOLS})


def test_places_are_shared_and_in_order(tmp_path: Path) -> None:
    """Instances and specialised functions share the places of their source. The table lists each once, sorted."""
    twins = Twins(shared(tmp_path))
    assert twins.native.fault_places() == [
        ("", 0, 0, "injected"),
        ("law.py", 11, 9, "the index is outside [0, 3)"),
        ("law.py", 14, 32, "the divisor is zero"),
        ("law.py", 14, 32, "the result does not fit i32"),
        ("tools.py", 4, 12, "the index is outside [0, 3)"),
    ]
    for name in ("one", "two", "frozen"):
        twins.set(f"{name}.inputs.i", 3)
    twins.set("two.parameters.divisor", 0)
    twins.step()
    found = {name: twins.get(f"{name}.counters.fault_place") for name in ("one", "two", "frozen")}
    assert found == {"one": 5, "two": 3, "frozen": 5}


def test_a_place_stays_until_the_next_fault_and_in_a_checkpoint(tmp_path: Path) -> None:
    twins = Twins(shared(tmp_path))
    rows = [(0, None), (3, "tools.py"), (0, "tools.py")]
    for value, file in rows:
        twins.set("one.inputs.i", value)
        twins.step()
        assert (twins.native.fault("one") or (None,))[0] == file
    saved = twins.native.save()
    for m in (twins.native, twins.python):
        m.byte(m.instances["one"].inject_fault_offset)[0] = 1
    twins.step()
    assert twins.native.fault("one") == twins.python.fault("one") == ("", 0, 0, "injected")
    twins.native.restore(saved)
    assert twins.native.fault("one") == ("tools.py", 4, 12, "the index is outside [0, 3)")


def test_a_forced_health_is_no_fault(tmp_path: Path) -> None:
    m = Machine.build(shared(tmp_path))
    m.byte(m.instances["one"].inject_fault_offset)[0] = 3
    m.step()
    assert (m.get("one.outputs.health"), m.get("one.counters.fault_place")) == ("failed", 0)


@pytest.mark.parametrize("kind", [Machine, InReference])
def test_a_start_that_faults_tells_its_place(kind: type[Machine], tmp_path: Path) -> None:
    m = kind.build(shared(tmp_path, at=3))
    assert m.init_result == 1
    assert m.fault("one") == ("law.py", 11, 9, "the index is outside [0, 3)") and m.fault("two") is None


def test_columns_count_characters(tmp_path: Path) -> None:
    """After characters of several bytes. In an expression of several lines, the place is that of the operation
    itself."""
    text = """class Law:
    inputs = {"i": "i32", "j": "i32"}
    outputs = {"x": "i32"}

    def execute(self):
        "é ü"; self.x = 7 // self.j
        self.x = 7 - (
            4 + 3 %
            self.i)
"""
    twins = Twins(write_one_each(tmp_path, {"law.py": text}, {"Law": {"source": "law.py"}}))
    for j, place in ((0, (6, 25)), (1, (8, 17))):
        twins.set("law.inputs.j", j)
        twins.step()
        expected = ("law.py", *place, "the divisor is zero")
        assert twins.native.fault("law") == twins.python.fault("law") == expected


def test_python_without_columns_tells_the_line(tmp_path: Path) -> None:
    """`python -X no_debug_ranges` stores no columns. The place is then the first one of the line with this cause."""
    config = shared(tmp_path)
    Machine.build(config)
    code = f"""
from pathlib import Path
from fcsl_test_twins import InReference
m = InReference.build(Path({str(config)!r}))
m.set("one.inputs.i", 3)
m.step()
print(m.fault("one"))
"""
    done = subprocess.run(
        [sys.executable, "-X", "no_debug_ranges", "-c", code], cwd=Path(__file__).parent, capture_output=True, text=True
    )
    assert done.stdout.strip() == "('tools.py', 4, 12, 'the index is outside [0, 3)')", done.stderr


def test_what_cannot_fault_has_no_place(tmp_path: Path) -> None:
    text = """class Law:
    outputs = {"v": "i32[3]"}

    def execute(self):
        for i in range(3):
            self.v[i] = i32(10 // (i + 1))
"""
    path = write_one_each(tmp_path, {"law.py": text}, {"Law": {"source": "law.py"}})
    source = compile_machine(path, "").source
    assert ".fault_place_count = 1u" in source and "fault_" not in source.split("alg_Law__execute")[1].split("}")[0]
