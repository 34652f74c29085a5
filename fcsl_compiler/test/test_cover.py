# SPDX-License-Identifier: Apache-2.0
"""Coverage of algorithms: counts and reports of a coverage build, and that it computes the same results."""

import ast
import json
import sys
import tempfile
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from fcsl_generator import harness
from fcsl_generator.campaign import BATCH, generate
from fcsl_generator.machines import Case, cases
from fcsl_test_abi import Machine, write_machine
from fcsl_test_cover import Trial, bools, counts

from fcsl_compiler.coverage import probes
from fcsl_compiler.coverage.figures import figures
from fcsl_compiler.coverage.probe_map import CoverError
from fcsl_compiler.driver.library import build_library

EXECUTE = "    def execute(self):\n"


def trial(folder: Path, statements: str, before: str = "", start: str = "", **instance: Any) -> Trial:
    """Statements of execute, one per line. Without `before` and `start` the first is on line 2."""
    body = "".join(f"        {line}\n" for line in statements.split("\n"))
    return Trial(folder, start + EXECUTE + body, before, **instance)


# ---- lines and branches ----------------------------------------------------------------------------------------------


def test_lines_and_outcomes(tmp_path: Path) -> None:
    t = trial(
        tmp_path,
        "if self.x > 1.0:\n    self.z = 1.0\n    self.k = 1\nelif self.x < 0.0:\n    self.z = 2.0\nelse:\n    self.z = 3.0",
    )
    assert t.share("line") == (0, 6) and t.share("branch") == (0, 4)
    assert t.misses() == [("line", 2, "lines 15 to 21 were never executed")]
    t.tick(x=2.0)
    assert t.share("line") == (3, 6) and t.share("branch") == (1, 4)
    assert t.misses() == [
        ("branch", 2, "`self.x > 1.0` was never False"),
        ("line", 5, "lines 18 to 21 were never executed"),
    ]
    t.tick(x=-1.0)
    assert t.misses() == [("branch", 5, "`self.x < 0.0` was never False"), ("line", 8, "never executed")]
    t.tick(x=0.5)
    assert t.misses() == [] and t.share("line") == (6, 6) and t.share("branch") == (4, 4)


@pytest.mark.parametrize(
    ("statement", "name"),
    [
        ("self.z = 1.0 if self.a else 2.0", "self.a"),
        ("self.r = self.x > 0.0", "self.x > 0.0"),
        ("self.r = not self.a", "not self.a"),
        ("self.z = clamp(1.0 if self.x > 0.0 else 2.0, 0.0, 3.0)", "self.x > 0.0"),
        ("self.z = VALUES[0 if self.a else 1]", "self.a"),
    ],
)
def test_decisions_that_are_no_if(tmp_path: Path, statement: str, name: str) -> None:
    t = trial(tmp_path, statement, "VALUES = [1.0, 2.0]\n")
    assert t.share("branch") == (0, 2)
    t.tick(a=True, x=1.0)
    outcome = name != "not self.a"
    assert t.misses() == [("branch", 3, f"`{name}` was never {not outcome}")] and t.share("mcdc") == (0, 1)
    t.tick(a=False, x=-1.0)
    assert t.misses() == [] and t.share("branch") == (2, 2) and t.share("mcdc") == (1, 1)


def test_what_copies_a_bool_decides_nothing(tmp_path: Path) -> None:
    assert trial(tmp_path, "self.r = self.a\nself.z = f64(self.k)").share("branch") == (0, 0)


def test_an_assertion_is_a_line_and_decides_nothing(tmp_path: Path) -> None:
    """No test makes it fail that should hold. Behind one that fails nothing is reached."""
    t = trial(tmp_path, 'assert self.x > 0.0 and self.n != 3, "text"\nself.z = 1.0')
    assert t.share("branch") == (0, 0) and t.share("mcdc") == (0, 0) and t.share("line") == (0, 2)
    t.tick(x=-1.0)
    assert t.share("line") == (1, 2) and t.misses() == [("line", 3, "never executed")]
    t.tick(x=1.0)
    assert t.share("line") == (2, 2)


def test_a_coverage_build_checks_results_too(tmp_path: Path) -> None:
    t = trial(tmp_path, "self.z = self.x", nan="fail")
    t.tick(x=float("nan"))
    assert t.machine.get("law.outputs.health") == "failed"
    assert t.share("line") == (1, 1) and t.share("branch") == (0, 0)


def test_loops(tmp_path: Path) -> None:
    """A loop that may run no iteration has two branches. A loop that always or never runs has none."""
    text = "for i in range(3):\n    for j in range(i):\n        self.k = self.k + j\n        if self.a:\n            break\nfor n in range(0):\n    self.k = 0"
    t = trial(tmp_path, text)
    assert t.share("branch") == (0, 4)  # the inner loop and the if
    t.tick()
    assert t.share("branch") == (3, 4)
    assert t.misses() == [("branch", 5, "`self.a` was never True"), ("line", 6, "never executed")]
    t = trial(
        tmp_path / "never",
        "for i in range(2):\n    if self.a:\n        break\n    for j in range(i):\n        self.k = 1",
    )
    t.tick()
    assert ("line", 6, "never executed") not in t.misses()
    t = trial(
        tmp_path / "zero",
        "for i in range(2):\n    if i == 1 and self.a:\n        break\n    for j in range(i):\n        self.k = 1",
    )
    t.tick(a=True)
    assert ("branch", 5, "this loop never ran an iteration") in t.misses()


def test_helpers_and_start_count_and_the_library_does_not(tmp_path: Path) -> None:
    before = "def half(v: f64) -> f64:\n    if v > 1.0:\n        return 0.5 * v\n    return v\n\n\n"
    start = "    def start(self):\n        self.k = 7\n\n"
    text = "q = quat_mul([1.0, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0])\nself.z = half(self.x) + q[0]"
    t = trial(tmp_path, text, before, start)
    assert t.share("line") == (1, 6)  # start runs in init
    t.tick()
    assert t.misses() == [("branch", 2, "`v > 1.0` was never True"), ("line", 3, "never executed")]


def test_a_line_stands_for_all_statements_on_it(tmp_path: Path) -> None:
    t = trial(tmp_path, "if self.a: self.z = 1.0; self.k = 2\nself.r = (\n    self.b\n    and self.c\n)").tick()
    assert t.share("line") == (2, 2)


# ---- conditions --------------------------------------------------------------------------------------------------------


def test_a_missing_pair_is_named(tmp_path: Path) -> None:
    t = trial(tmp_path, "self.r = self.a and (self.b or self.x > self.limit)")
    t.tick(**bools("ab", "11")).tick(**bools("ab", "10"), x=1.0)
    assert t.share("mcdc") == (1, 3) and t.share("branch") == (2, 2)
    assert t.misses() == [
        ("mcdc", 2, "`self.a` was never False while the decision's outcome depended on it"),
        ("mcdc", 2, "`self.x > self.limit` was never True while the decision's outcome depended on it"),
    ]
    first, second = t.figures.misses
    assert first.detail == (
        "`self.a` True, `self.b or self.x > self.limit` True, outcome True (seen); `self.a` False, outcome False (missing)"
    )
    assert second.detail == (
        "`self.x > self.limit` True, `self.a` True, `self.b` False, outcome True (missing); "
        "`self.x > self.limit` False, `self.a` True, `self.b` False, outcome False (seen)"
    )
    assert (second.span.column, second.span.end_column) == (40, 59)
    t.tick(a=False).tick(a=True, x=9.0)
    assert t.misses() == [] and t.share("mcdc") == (3, 3)


def test_an_operand_of_a_pair_is_named_whole(tmp_path: Path) -> None:
    """With its `not` and its parentheses, not from its first condition to its last."""
    t = trial(tmp_path, "self.r = (not self.a or self.b) and not (self.b or self.c)").tick()
    details = [m.detail for m in t.figures.misses if m.kind == "mcdc"]
    assert details[0].startswith(
        "`self.a` True, `self.b` False, outcome False (missing); `self.a` False, `not (self.b or self.c)` True,"
    )
    assert details[-1].startswith(
        "`self.c` True, `not self.a or self.b` True, `self.b` False, outcome False (missing);"
    )


def test_neither_value_seen(tmp_path: Path) -> None:
    t = trial(tmp_path, "if self.a or self.b:\n    self.z = 1.0").tick(a=True)
    said = "`self.b` was never True and never False while the decision's outcome depended on it"
    assert ("mcdc", 2, said) in t.misses()


def test_chains_are_conditions_of_their_own(tmp_path: Path) -> None:
    t = trial(tmp_path, "self.r = 0.0 <= self.x * self.x < self.limit and not self.a")
    t.tick(x=0.5).tick(x=5.0)
    assert t.share("mcdc") == (1, 3)
    said = "was never False while the decision's outcome depended on it"
    assert [m for _, _, m in t.misses()] == [
        f"`0.0 <= self.x * self.x` {said}",
        "`self.a` was never True while the decision's outcome depended on it",
    ]
    t.tick(x=float("nan")).tick(x=0.5, a=True)
    assert t.misses() == []


def test_decisions_inside_conditions_are_decisions(tmp_path: Path) -> None:
    before = "def pick(v: bool) -> bool:\n    return v\n\n\n"
    t = trial(tmp_path, "if pick(self.a and self.b) or (self.c if self.x > 0.0 else self.d):\n    self.z = 1.0", before)
    t.tick(**bools("abcd", "1100"))
    assert t.share("mcdc") == (0, 5)  # two of the whole, two of the argument, one of the conditional expression
    for values, x in (("1000", 1.0), ("0010", 1.0), ("0001", -1.0)):
        t.tick(**bools("abcd", values), x=x)
    assert t.misses() == [] and t.share("mcdc") == (5, 5)


def test_constants_are_marked_and_count_for_nothing(tmp_path: Path) -> None:
    text = "if DEBUG and self.a:\n    self.z = 1.0\nif self.b and self.mode > 3:\n    self.z = 2.0\nif self.mode == 1:\n    self.z = 3.0"
    t = trial(tmp_path, text, "DEBUG = True\n\n\n", frozen=["mode"]).tick()
    found = t.figures
    assert [(t.line(c), c.message) for c in found.constants] == [
        (5, "`DEBUG` is a constant in this machine"),
        (7, "`self.mode > 3` is a constant in this machine"),
        (9, "`self.mode == 1` is a constant in this machine"),
    ]
    assert t.share("mcdc") == (0, 2) and t.share("branch") == (2, 4)
    t.tick(a=True, b=True)
    # The frozen parameter makes it False, so `self.b` cannot be shown.
    assert t.share("mcdc") == (1, 2) and [m[1] for m in t.misses() if m[0] == "mcdc"] == [7]


def test_what_no_instance_freezes_alike_is_no_constant(tmp_path: Path) -> None:
    assert trial(tmp_path, "self.r = self.a and self.mode > 3").figures.constants == ()


def test_a_condition_that_faults_was_not_evaluated(tmp_path: Path) -> None:
    t = trial(tmp_path, "v = [1.0, 2.0]\nif self.a and v[self.n] > 1.5:\n    self.z = 1.0").tick(a=True, n=9)
    assert t.machine.get("law.counters.faults") == 1
    assert t.share("line") == (2, 3) and t.share("branch") == (0, 2) and t.share("mcdc") == (0, 2)
    assert ("branch", 3, "`self.a and v[self.n] > 1.5` was never evaluated") in t.misses()
    t.tick(n=1).tick(n=0)
    assert t.share("branch") == (2, 2) and t.share("mcdc") == (1, 2)


def test_too_many_conditions_are_said(tmp_path: Path) -> None:
    t = trial(tmp_path, "self.r = " + " and ".join(f"self.n > {n}" for n in range(40))).tick(n=50).tick(n=0)
    assert t.share("mcdc") == (0, 40) and t.share("branch") == (2, 2)
    assert t.misses() == [("mcdc", 2, "40 conditions: MC/DC is measured for up to 31 per decision")]


def test_lost_combinations_are_reported(tmp_path: Path) -> None:
    """512 combinations of nine pairs, of which 256 are stored."""
    pairs = " and ".join(f"(self.n >> {2 * n} & 1 == 1 or self.n >> {2 * n + 1} & 1 == 1)" for n in range(9))
    t = trial(tmp_path, f"self.r = {pairs}")
    for number in range(1 << 18):
        if all(number >> 2 * n & 3 for n in range(9)) and number % 7 == 0:
            t.tick(n=number)
    assert any("had more combinations than can be stored" in m for _, _, m in t.misses())


def test_two_algorithms_of_one_class(tmp_path: Path) -> None:
    """Two algorithms of one class have common counts."""
    t = trial(tmp_path, "self.r = self.a or self.b")
    config = json.loads(t.config.read_text())
    config["algorithms"]["other"] = {"source": "law.py", "class": "Law"}
    config["instances"]["second"] = {"algorithm": "other", "parameters": {"mode": 1, "limit": 2.0}}
    config["states"]["RUN"]["schedule"]["second"] = 10
    t.config.write_text(json.dumps(config))
    build_library([t.config], tmp_path / "two" / "libtwo.so", cover=True)
    m = Machine(tmp_path / "two" / "libtwo.so", "trial")
    m.set("law.inputs.a", True)
    m.set("second.inputs.b", True)
    m.step()
    (found,) = figures(counts(m))
    assert sorted(found.file.algorithms) == ["Law", "other"]
    assert (found.shares["line"].met, found.shares["line"].total, found.shares["mcdc"].total) == (1, 1, 2)
    m.set("law.inputs.a", False)
    m.step()
    m.set("second.inputs.b", False)
    m.step()
    assert figures(counts(m))[0].shares["mcdc"].met == 2


def test_two_classes_of_one_file_and_helpers_of_another(tmp_path: Path) -> None:
    """Figures are per file: a file with two classes, and a file that contains only their imports."""
    (tmp_path / "frames.py").write_text("def low(v: f64) -> bool:\n    return v < 0.0 or v > 9.0\n")
    law = """\
class {}:
    inputs = {{"x": "f64"}}
    outputs = {{"r": "bool"}}

    def execute(self):
        self.r = low(self.x)
"""
    names = {"first": "One", "second": "Two"}
    machine = {
        "tick_hz": 10,
        "initial_state": "RUN",
        "instances": {name: {"algorithm": of} for name, of in names.items()},
        "states": {"RUN": {"schedule": {"first": 10}}},
    }
    laws = "from frames import low\n\n\n" + "\n\n".join(law.format(of) for of in names.values())
    config = write_machine(tmp_path, "trial", machine, {"laws": laws})
    build_library([config], tmp_path / "out" / "libtrial.so", cover=True)
    m = Machine(tmp_path / "out" / "libtrial.so", "trial")
    for x in (-1.0, 1.0):
        m.set("first.inputs.x", x)
        m.step()
    found = {f.file.name: f for f in figures(counts(m))}
    assert {name: f.file.algorithms for name, f in found.items()} == {"laws.py": ["One", "Two"], "frames.py": []}
    assert [(m.span.line, m.message) for m in found["laws.py"].misses] == [(17, "never executed")]
    assert [(f.shares["line"].met, f.shares["line"].total) for f in found.values()] == [(1, 2), (1, 1)]
    helpers = found["frames.py"]
    assert (helpers.shares["branch"].met, helpers.shares["mcdc"].met, helpers.shares["mcdc"].total) == (2, 1, 2)
    assert [m.kind for m in helpers.misses] == ["mcdc"]


# ---- generated programs ------------------------------------------------------------------------------------------------


class Lines:
    """The lines of some files that CPython executes."""

    def __init__(self, folder: Path):
        self.folder, self.found = str(folder), set[tuple[str, int]]()

    def __call__(self, frame: FrameType, event: str, argument: Any) -> Any:
        if not frame.f_code.co_filename.startswith(self.folder):
            return None
        if event == "line":
            self.found.add((frame.f_code.co_filename, frame.f_lineno))
        return self


def _check(made: Any) -> list[str]:
    """A coverage build computes the same bits, and counts the lines that CPython executes."""
    with tempfile.TemporaryDirectory(prefix="fcsl-cover-") as scratch:
        folder = Path(scratch)
        configs = [case.write(folder / f"g{n}", f"g{n}") for n, case in enumerate(made)]
        plain, covered = folder / "plain" / "libg.so", folder / "cover" / "libg.so"
        compiled = build_library(configs, plain)
        build_library(configs, covered, cover=True)
        problems = []
        for n, (case, one) in enumerate(zip(made, compiled, strict=True)):
            machine = Machine(covered, f"g{n}")
            found = harness.run(machine, case)
            problem = harness.difference(found, harness.run(Machine(plain, f"g{n}"), case), "plain")
            problems.append(problem or _line_difference(machine, plain, one, case, folder / f"g{n}"))
        return problems


def _line_difference(machine: Machine, library: Path, compiled: Any, case: Case, folder: Path) -> str:
    try:
        counted = counts(machine)
    except CoverError as error:
        return str(error)
    traced = Lines(folder)
    sys.settrace(traced)
    try:
        harness.run(harness.in_reference(library, compiled, case), case)
    finally:
        sys.settrace(None)
    for file in counted.map.files:
        words = counted.words
        own = {line for line, (_, word) in file.lines.items() if words[word]}
        theirs = {line for name, line in traced.found if name == file.path} & file.lines.keys()
        # After a fault, C still evaluates calls in the same expression. Helpers that cannot fault do not receive the
        # fault flag.
        helpers = (own - theirs) & _lines_of_helpers(Path(file.path))
        if own - helpers != theirs or (helpers and not _faults(machine)):
            return f"{file.name}: lines {sorted(own ^ theirs)} in one only, CPython {sorted(theirs - own)}"
    return ""


def _lines_of_helpers(path: Path) -> set[int]:
    functions = [n for n in ast.parse(path.read_text()).body if isinstance(n, ast.FunctionDef)]
    return {line for f in functions for line in range(f.lineno, (f.end_lineno or f.lineno) + 1)}


def _faults(machine: Machine) -> int:
    return sum(machine.get(path) for path in machine.fields if path.endswith(".counters.faults"))


def test_generated_machines(request: pytest.FixtureRequest) -> None:
    made = generate(
        cases(), max(16, request.config.getoption("--programs") // 20), request.config.getoption("--program-seed")
    )
    for at in range(0, len(made), BATCH):
        batch = made[at : at + BATCH]
        for case, problem in zip(batch, _check(batch), strict=True):
            assert not problem, f"{problem}\n\n{case}"


def test_a_wrong_probe_would_be_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """A probe that inverts a decision, and a line that is counted as another."""
    made = generate(cases(), 2, 1)
    right = probes._PRELUDE
    for old, new in (
        ("    return outcome;\n}\n", "    return !outcome;\n}\n"),
        ("        fcsl_cover_set(word);", "        fcsl_cover_set(word == 0 ? 0 : word - 1);"),
    ):
        assert right.count(old) == 1
        monkeypatch.setattr(probes, "_PRELUDE", right.replace(old, new))
        assert any(_check(made))
