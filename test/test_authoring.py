# SPDX-License-Identifier: Apache-2.0
"""docs/guide/authoring.md: its machine, each change of it, and each rule are compiled and tested as printed.

FCSL_UPDATE_GOLDEN=1 rewrites the reports that the page shows.
"""

import ast
import json
import os
import platform
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_compiler.cli.main import main
from fcsl_compiler.driver.passes import compile_machine

DOC = Path(__file__).resolve().parent.parent / "docs/guide/authoring.md"
PAGE = DOC.read_text()
BLOCK = re.compile(r"(?:<!-- (file|change): (\S+) -->\n)?```(\w+)(?: (\w+))?\n(.*?)```\n", re.DOTALL)
BLOCKS: list[tuple[str, str, str, str, str]] = BLOCK.findall(PAGE)
#: The recipes of a change: a mode and its bumpless change are the second and the third.
CHANGES = PAGE.split("\n## Changes\n")[1].split("\n## ")[0].split("\n### ")[1:]

RULES = """class Alone:
    inputs = {"a": "f64", "n": "i64", "ok": "bool", "rate": "f64[3]"}
    outputs = {"x": "f64", "v": "f64[3]"}

    def execute(self):
"""
ALONE = {
    "tick_hz": 10,
    "initial_state": "R",
    "algorithms": {"Alone": {"source": "alone.py"}},
    "instances": {"one": {"algorithm": "Alone"}},
    "states": {"R": {"schedule": {"one": 10}}},
}


def write(folder: Path, blocks: list[tuple[str, str, str, str, str]]) -> None:
    """The files of these blocks; a change is merged into its file as the page describes."""
    for kind, name, _, _, text in blocks:
        path = folder / name
        path.parent.mkdir(exist_ok=True)
        if kind == "change" and name.endswith(".json"):
            text = json.dumps(merged(json.loads(path.read_text()), json.loads(text)), indent=2)
        elif kind == "change":
            text = with_members(path.read_text(), text)
        path.write_text(text)


def merged(config: dict[str, Any], change: dict[str, Any]) -> dict[str, Any]:
    for key, value in change.items():
        if key == "connections":
            targets = {c["to"] for c in value}
            config[key] = [c for c in config[key] if c["to"] not in targets] + value
        elif key == "states":
            for name, state in value.items():
                config[key].setdefault(name, {"schedule": {}})["schedule"] |= state["schedule"]
        elif isinstance(value, dict):
            config[key] = config.get(key, {}) | value
        else:
            config[key] = value
    return config


def with_members(source: str, change: str) -> str:
    """A file of one class, with the members of `change` in place of those of the same name; what stands above the class in
    `change`, if anything, in place of what stood there."""
    above, head, old = class_of(source)
    new_above, _, new = class_of(change)
    return (new_above or above) + head + "\n\n".join((old | new).values()) + "\n"


def class_of(text: str) -> tuple[str, str, dict[str, str]]:
    """What stands above the class; its first line; its members by name, the docstring under none."""
    node = next(n for n in ast.parse(text).body if isinstance(n, ast.ClassDef))
    lines = text.splitlines()
    members = {}
    for member in node.body:
        name = ""
        if isinstance(member, ast.FunctionDef):
            name = member.name
        elif isinstance(member, ast.Assign):
            name = ast.unparse(member.targets[0])
        members[name] = "\n".join(lines[member.lineno - 1 : member.end_lineno])
    return "".join(line + "\n" for line in lines[: node.lineno - 1]), lines[node.lineno - 1] + "\n", members


@pytest.fixture
def rover(tmp_path: Path) -> Path:
    write(
        tmp_path,
        [b for b in BLOCKS if b[0] == "file" and b[1] not in ("algorithms/slew.py", "algorithms/estimator.py")],
    )
    return tmp_path


def run_tests(folder: Path) -> str:
    line = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test"]
    done = subprocess.run(line, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_every_block_is_tried() -> None:
    """Files, changes, the commands of the beginning, the rules, the message, the coverage."""
    assert PAGE.count("```") == 2 * len(BLOCKS)
    plain = [(language, mark) for kind, _, language, mark, _ in BLOCKS if not kind]
    assert plain == [("sh", ""), ("python", "rules"), ("text", "message"), ("sh", "cover"), ("text", "cover")]
    assert len(CHANGES) == 4


def test_the_machine(rover: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "--strict", str(rover / "rover.json")]) == 0
    assert capsys.readouterr().err == ""
    assert "5 passed" in run_tests(rover)


def test_the_commands(rover: Path) -> None:
    commands = next(text for _, _, language, _, text in BLOCKS if language == "sh")
    done = subprocess.run(["bash", "-e", "-c", commands], cwd=rover, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert "<svg" in (rover / "rover.svg").read_text()


def test_the_coverage(rover: Path) -> None:
    """The output of `fcsl cover` for the page's tests equals that of the page."""
    command, shown = (text for _, _, _, mark, text in BLOCKS if mark == "cover")
    done = subprocess.run(
        ["bash", "-e", "-c", command], cwd=rover, capture_output=True, text=True, check=False, timeout=120
    )
    assert done.returncode == 0, done.stdout + done.stderr
    printed = done.stdout[done.stdout.index("coverage of rover") :].replace(str(rover), "/…/rover")
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        DOC.write_text(DOC.read_text().replace(shown, printed.rstrip("\n") + "\n"))
    assert shown == printed.rstrip("\n") + "\n", "FCSL_UPDATE_GOLDEN=1 rewrites it"


@pytest.mark.parametrize("number", range(len(CHANGES)))
def test_the_changes(rover: Path, number: int, capsys: pytest.CaptureFixture[str]) -> None:
    """Each separately, except the third, which builds on the second; and all together."""
    for change in [*(CHANGES[1:2] if number == 2 else []), *CHANGES[number:]]:
        write(rover, BLOCK.findall(change))
    assert main(["check", "--strict", str(rover / "rover.json")]) == 0
    assert capsys.readouterr().err == ""


def test_the_new_mode_is_reached(rover: Path) -> None:
    write(rover, BLOCK.findall(CHANGES[1]))
    (rover / "test" / "test_rover.py").write_text("""
from simclient import AlgTwin


def test_past_something_near():
    with AlgTwin.from_config("../rover.json") as twin:
        twin.set("watch.inputs.go", True)
        for distance, state in ((1.5, "CREEP"), (3.0, "DRIVE"), (1.5, "CREEP"), (0.5, "HOLD")):
            twin.set("sensors.outputs.distance", distance)
            twin.tick(6)
            assert twin.state() == state
            if state == "CREEP":
                assert twin.get_value("motor.outputs.force") == twin.get_value("creep.outputs.force") > 0.0
""")
    assert "1 passed" in run_tests(rover)


def test_a_change_of_mode_has_no_bump(rover: Path) -> None:
    """At any time the force continues without a step; and a controller that stays inactive is detected."""
    write(rover, BLOCK.findall(CHANGES[1]) + BLOCK.findall(CHANGES[2]))
    (rover / "test" / "test_rover.py").write_text("""
import pytest
from simclient import AlgTwin, PyTwin


@pytest.mark.parametrize("twin", [AlgTwin, PyTwin])
@pytest.mark.parametrize("after", range(50, 54))
def test_a_rover_that_changes_its_mode(twin, after):
    with twin.from_config("../rover.json") as twin:
        for path, value in (("watch.inputs.go", True), ("sensors.outputs.distance", 1.5), ("drive.inputs.wanted", 0.2)):
            twin.set(path, value)
        twin.tick(after)
        assert twin.state() == "CREEP"
        force = twin.get_value("motor.outputs.force")
        twin.set("sensors.outputs.distance", 3.0)
        for _ in range(12):
            twin.tick()
            step = twin.get_value("motor.outputs.force") - force
            force += step
            assert abs(step) < 0.5
        assert twin.state() == "DRIVE" and twin.get_value("drive.outputs.force") == force
        twin.set("sensors.outputs.speed", 0.1)
        twin.set("watch.inputs.go", False)
        twin.tick(30)
        assert twin.state() == "HOLD" and twin.get_value("motor.outputs.force") < 0.0
""")
    assert "8 passed" in run_tests(rover)


def test_a_fault_of_a_controller_makes_no_bump(rover: Path) -> None:
    """At any tick, also in the first run of a controller whose last output was large."""
    write(rover, BLOCK.findall(CHANGES[1]) + BLOCK.findall(CHANGES[2]))
    (rover / "test" / "test_rover.py").write_text("""
import pytest
from simclient import AlgTwin, PyTwin


def forces(twin, faults_at):
    with twin.from_config("../rover.json") as twin:
        twin.set("watch.inputs.go", True)
        twin.set("drive.inputs.wanted", 3.0)
        twin.set("sensors.outputs.distance", 10.0)
        twin.tick(120)
        assert twin.state() == "DRIVE" and twin.get_value("drive.outputs.force") > 20.0
        twin.set("sensors.outputs.distance", 0.5)
        twin.tick(50)
        assert twin.state() == "HOLD" and abs(twin.get_value("motor.outputs.force")) < 1e-9
        twin.set("drive.inputs.wanted", 0.0)
        found = []
        for tick in range(60):
            twin.set("sensors.outputs.distance", 10.0 if tick < 40 else 1.5)
            if tick == faults_at:
                twin.fault("drive")
                twin.fault("creep")
            twin.tick()
            found.append(twin.get_value("motor.outputs.force"))
        assert twin.state() == "CREEP"
        return found


@pytest.mark.parametrize("twin", [AlgTwin, PyTwin])
def test_no_bump(twin):
    for faults_at in range(-1, 60):
        found = forces(twin, faults_at)
        assert max(abs(f) for f in found) < 2.0, (faults_at, found)
""")
    assert "2 passed" in run_tests(rover)


def test_the_estimate_settles(rover: Path) -> None:
    """On the true speed, without a lasting lag, in both twins, with a sample in every tick or in every fifth."""
    write(rover, BLOCK.findall(CHANGES[3]))
    (rover / "test" / "test_rover.py").write_text("""
import pytest
from simclient import AlgTwin, PyTwin


@pytest.mark.parametrize("every", [1, 5])
@pytest.mark.parametrize("twin", [AlgTwin, PyTwin])
def test_a_ramp(twin, every):
    with twin.from_config("../rover.json") as twin:
        for tick in range(1000):
            if tick % every == 0:
                twin.sample("speed", 0.02 * tick)
            twin.tick()
        motion = twin.get_value("estimate.outputs.motion")
        assert motion["valid"] is True
        assert motion["speed"] == pytest.approx(0.02 * 999, abs=0.02)
        assert motion["acceleration"] == pytest.approx(2.0, abs=0.1)
        twin.set_state("DRIVE")
        twin.tick()
        assert twin.get_value("drive.inputs.speed") == twin.get_value("estimate.outputs.motion.speed")
""")
    assert "4 passed" in run_tests(rover)


def rules() -> list[tuple[str, list[str]]]:
    """Every statement of the rules, with the lines indented below it, and the code of the diagnostic that rejects it."""
    text = next(text for _, _, _, mark, text in BLOCKS if mark == "rules")
    statements: list[list[str]] = []
    for line in text.splitlines():
        if line.startswith(" "):
            statements[-1].append(line)
        else:
            statements.append([line])
    found = []
    for lines in statements:
        code = re.search(r"# (E\d{3}) ", lines[0])
        found.append((code[1] if code else "", lines))
    return found


@pytest.mark.parametrize(("code", "lines"), [r for r in rules() if r[0]], ids=lambda v: v if isinstance(v, str) else "")
def test_refused_rules(tmp_path: Path, code: str, lines: list[str]) -> None:
    assert codes(tmp_path, lines) == [code]


def test_accepted_rules(tmp_path: Path) -> None:
    lines = [line for code, lines in rules() if not code for line in lines]
    found = codes(tmp_path, lines)
    assert len(lines) >= 8 and [c for c in found if c not in ("W303", "W305")] == []  # they are examples, and end there


def codes(folder: Path, lines: list[str]) -> list[str]:
    (folder / "alone.py").write_text(RULES + "".join(f"        {line}\n" for line in lines))
    (folder / "craft.json").write_text(json.dumps(ALONE))
    try:
        return [d.code for d in compile_machine(folder / "craft.json", "").sink.diagnostics]
    except DiagnosticError as error:
        return [d.code for d in error.diagnostics]


def test_the_message_is_what_the_compiler_prints(
    rover: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(rover)
    config = rover / "rover.json"
    config.write_text(config.read_text().replace('"sensors.speed", "to"', '"sensors.sped", "to"'))
    assert main(["check", "rover.json"]) == 1
    printed = capsys.readouterr().err.removesuffix("\n1 error\n")
    shown = next(text for _, _, _, mark, text in BLOCKS if mark == "message")
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        DOC.write_text(DOC.read_text().replace(shown, printed))
    assert shown == printed, "FCSL_UPDATE_GOLDEN=1 rewrites it"


def cost_as_shown() -> list[str]:
    block = re.search(r"(?m)^    == rover, 100 Hz\n(?:    .*\n|\n)+", PAGE)
    assert block
    return [line.strip() for line in block[0].splitlines() if line.strip()]


def cells(line: str) -> list[str]:
    return re.split(r"\s{2,}|\s+…\s+", line.strip())


@pytest.mark.skipif(platform.machine() != "x86_64", reason="the bounds are of x86-64")
def test_the_cost_report(rover: Path) -> None:
    """The page shows some lines and columns of the report, in order; of another compiler than the page's, all but the numbers."""
    line = ["fcsl", "build", "rover.json", "--report", "-o", "out"]
    printed = subprocess.run(line, cwd=rover, capture_output=True, text=True, check=True).stdout.splitlines()
    compiler = subprocess.run([os.environ.get("CC", "cc"), "--version"], capture_output=True, text=True, check=True)
    version = re.search(r"\(gcc (\d+);", PAGE)
    assert version
    is_pages = "Free Software Foundation" in compiler.stdout and f" {version[1]}." in compiler.stdout.splitlines()[0]

    def same(text: str) -> str:
        return " ".join(text.split()) if is_pages else re.sub(r"\d+", "#", " ".join(text.split()))

    header = next(cells(line) for line in printed if line.startswith("instance "))
    chosen: list[str] = []
    rest = iter(printed)
    for shown in cost_as_shown():
        names = cells(shown)
        if names[0] == "instance":
            chosen = names
            assert set(chosen) <= set(header)
        elif chosen and names[0] == "math call":
            chosen = []
        if not chosen:
            begin = same(shown.removesuffix("…"))
            assert any(same(line)[: len(begin)] == begin for line in rest), shown
        elif names[0] != "instance":
            row = next(dict(zip(header, cells(line), strict=False)) for line in rest if cells(line)[0] == names[0])
            assert [same(row[name]) for name in chosen] == list(map(same, names)), shown
