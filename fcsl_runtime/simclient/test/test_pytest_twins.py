# SPDX-License-Identifier: Apache-2.0
"""The fixture `fcsl`: what it opens, and what is written when a test fails."""

from __future__ import annotations

import csv
import json
import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from simclient import Twin
from simclient.replay import replay
from simclient.twin.black_box import BlackBox

LAW = """
class Law:
    inputs = {"level": "f64", "asked": "f64"}
    outputs = {"sum": "f64", "wish": "f64"}

    def execute(self):
        self.sum += self.level
        self.wish = self.asked
"""
CONFIG = {
    "tick_hz": 100,
    "initial_state": "A",
    "algorithms": {"Law": {"source": "law.py"}},
    "instances": {"law": {"algorithm": "Law", "max_wcet_us": 50}},
    "states": {"A": {"schedule": {"law": 100}}, "B": {"schedule": {"law": 50}}},
    "transitions": [{"from": "A", "to": "B", "health": {"instance": "law", "in": ["failed"]}}],
    "channels": [{"name": "level", "id": 1, "field": "law.inputs.level", "direction": "sensor", "max_age_ticks": 2}],
}
TESTS = """
import pytest


def test_passes(fcsl):
    fcsl("tank.json").tick(5)


def test_fails(fcsl):
    twin, other = fcsl("tank.json"), fcsl("tank.json")
    other.tick()
    twin.set("law.inputs.asked", 3.5)
    twin.tick(2)
    twin.fault("law")
    twin.tick()
    assert twin.get_value("law.outputs.wish") == 4.0, type(twin).__name__
"""


@pytest.fixture(scope="module")
def tank(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("tank")
    (folder / "law.py").write_text(LAW)
    (folder / "tank.json").write_text(json.dumps(CONFIG))
    (folder / "test_tank.py").write_text(TESTS)
    return folder


def run(tank: Path, *arguments: str | Path, outcome: str = "1 failed, 1 passed") -> str:
    line = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "test_tank.py", *map(str, arguments)]
    done = subprocess.run(line, cwd=tank, capture_output=True, text=True, check=False, timeout=300)
    assert re.search(outcome, done.stdout), done.stdout + done.stderr
    return done.stdout


@pytest.mark.parametrize(
    ("arguments", "kind"), [((), "AlgTwin"), (("--fcsl-twin=python",), "PyTwin"), (("-n", "2"), "AlgTwin")]
)
def test_a_failure_leaves_its_last_ticks(tank: Path, tmp_path: Path, arguments: tuple[str, ...], kind: str) -> None:
    told = run(tank, *arguments, f"--fcsl-failures={tmp_path}")
    assert re.search(rf"AssertionError: {kind}$", told, re.MULTILINE)
    files = re.findall(r"^/.*$", told.split("FCSL: the last ticks")[1], re.MULTILINE)
    folder = tmp_path / "test_tank.py_test_fails"
    assert files == [str(folder / n) for n in ("0/tank.csv", "0/tank", "1/tank.csv", "1/tank")]
    assert [p.name for p in tmp_path.iterdir()] == [folder.name]
    with open(files[0], newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(r["tick"], r["law.inputs.asked"], r["law.outputs.health"]) for r in rows] == [
        ("0", "3.5", "nominal"),
        ("1", "3.5", "nominal"),
        ("2", "3.5", "failed"),
    ]
    for bag, ticks in ((files[1], 3), (files[3], 1)):
        verdict = replay(bag, str(tank / "tank.json"))
        assert verdict.identical and verdict.ticks == ticks, str(verdict)


BY_ITSELF = """
from time import sleep


def test_passes(fcsl):
    fcsl("tank.json")


def test_fails(fcsl):
    twin = fcsl("tank.json")
    twin.tick(3)
    twin.resume()
    while twin.get_value("machine.tick") < 5:
        sleep(0.001)
    {then}
    assert False, f"at {twin.tick(0) if not twin.running else 0}."
"""


@pytest.mark.parametrize(
    ("then", "before", "ticks", "said"),
    [
        ("twin.pause(); twin.tick(4)", 4, 4, "ticks before {} are not among them: the flight program ran"),
        ("twin.pause()", 0, 0, "ticks before {} are not among them: the flight program ran"),
        ("twin.set('law.inputs.asked', 4.5)", 0, 3, "ticks from 3 on are not among them: the flight program runs"),
    ],
)
def test_unrecorded_ticks_are_reported(
    tank: Path, tmp_path: Path, then: str, before: int, ticks: int, said: str
) -> None:
    """Ticks that a flight program runs in real time are not recorded: the files begin after them, or end before them."""
    for name in ("law.py", "tank.json"):
        (tmp_path / name).symlink_to(tank / name)
    (tmp_path / "test_tank.py").write_text(BY_ITSELF.replace("{then}", then))
    told = run(tmp_path, "--fcsl-twin=process")
    begin = int(re.findall(r"AssertionError: at (\d+)", told)[0]) - before
    *files, why = told.split("FCSL: the last ticks")[1].splitlines()[1 : 4 if ticks else 2]
    assert why == said.format(begin) + " in real time, unrecorded" and len(files) == (2 if ticks else 0)
    if files:
        with open(files[0], newline="") as file:
            assert [int(row["tick"]) for row in csv.DictReader(file)] == list(range(begin, begin + ticks))
        verdict = replay(files[1], str(tank / "tank.json"))
        assert verdict.identical and verdict.ticks == ticks, str(verdict)


ELSEWHERE = """
import pytest


def test_passes(fcsl):
    pass


@pytest.fixture
def twin(fcsl):
    twin = fcsl("tank.json")
    twin.set("law.inputs.asked", 2.5)
    twin.tick(3)
    {before}
    yield twin
    {after}


def test_fails(twin{more}):
    {test}
"""


@pytest.mark.parametrize("kind", ["native", "process"])
@pytest.mark.parametrize(
    ("where", "ticks"),
    [
        ({"before": "assert False"}, 3),
        ({"after": "twin.tick(); assert False"}, 4),
        ({"test": "with twin: assert False"}, 3),
        ({"more": ", fcsl", "test": "twin.close(); fcsl('tank.json'); assert False"}, 3),
    ],
)
def test_a_failure_elsewhere_leaves_them_too(
    tank: Path, tmp_path: Path, kind: str, where: dict[str, str], ticks: int
) -> None:
    """In a fixture, before and after the test, and when the twin was closed before that."""
    for name in ("law.py", "tank.json"):
        (tmp_path / name).symlink_to(tank / name)
    parts = {"before": "pass", "after": "pass", "test": "pass", "more": ""} | where
    (tmp_path / "test_tank.py").write_text(ELSEWHERE.format(**parts))
    told = run(tmp_path, f"--fcsl-twin={kind}", outcome="1 failed|1 error")
    (section,) = re.findall("FCSL: the last ticks.*\n((?:/.*\n)+)", told)
    table, bag = section.splitlines()
    with open(table, newline="") as file:
        assert [(row["tick"], row["law.outputs.wish"]) for row in csv.DictReader(file)] == [
            (str(i), "2.5") for i in range(ticks)
        ]
    verdict = replay(bag, str(tank / "tank.json"))
    assert verdict.identical and verdict.ticks == ticks, str(verdict)


def test_without_a_folder_they_lie_in_that_of_pytest(tank: Path, tmp_path: Path) -> None:
    told = run(tank, f"--basetemp={tmp_path / 'base'}")
    files = re.findall(r"^/.*$", told.split("FCSL: the last ticks")[1], re.MULTILINE)
    assert len(files) == 4 and all(Path(f).exists() and str(tmp_path / "base") in f for f in files)


def test_an_unknown_kind_is_refused(tank: Path) -> None:
    line = [sys.executable, "-m", "pytest", "--fcsl-twin=other", "test_tank.py"]
    done = subprocess.run(line, cwd=tank, capture_output=True, text=True, check=False, timeout=60)
    assert done.returncode == 4 and "invalid choice: 'other'" in done.stderr


def by_itself(twin: Twin, wish: float) -> None:
    """Some ticks in real time, in the midst of which an input is set."""
    twin.resume()
    twin.set("law.inputs.asked", wish)
    begin = twin.get_value("machine.tick")
    while twin.get_value("machine.tick") == begin:
        time.sleep(0.001)
    twin.set("law.inputs.asked", -wish)
    twin.pause()


ACTIONS: dict[str, Callable[[Twin, float], object]] = {
    "tick": lambda twin, x: twin.tick(),
    "ticks": lambda twin, x: twin.tick(7),
    "set": lambda twin, x: twin.set("law.inputs.asked", x),
    "sample": lambda twin, x: twin.sample("level", x, age_ticks=int(x) % 4, stamp_ns=5),
    "silence": lambda twin, x: twin.silence("level"),
    "attach": lambda twin, x: twin.attach("level"),
    "fault": lambda twin, x: twin.fault("law"),
    "overrun": lambda twin, x: twin.overrun("law"),
    "degrade": lambda twin, x: twin.force_health("law", "degraded"),
    "state": lambda twin, x: twin.set_state("A"),
    "inject": lambda twin, x: twin.inject({"level": np.full(5, x), "law.inputs.asked": np.arange(5.0)}),
    "restore": lambda twin, x: twin.restore(twin.save()),
    "by itself": by_itself,
}


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.sampled_from(sorted(ACTIONS)), st.floats(0, 100)), max_size=40))
def test_the_bag_is_what_recording_would_have_given(
    open_twin: Callable[..., Twin],
    tank: Path,
    tmp_path_factory: pytest.TempPathFactory,
    monkeypatch: pytest.MonkeyPatch,
    actions: list[tuple[str, float]],
) -> None:
    """Whatever was done: it replays, and its end is the twin's. The ring is small, so that most of it is written over."""
    monkeypatch.setattr("simclient.twin.black_box._TICKS", 16)
    folder = tmp_path_factory.mktemp("box")
    twin = open_twin(tank / "tank.json")
    box = BlackBox(twin)
    for what, x in actions:
        ACTIONS[what](twin, x)
    rows = box.rows()
    written = box.write(folder)
    if rows == 0:
        assert written == []
        return
    table, bag = written
    verdict = replay(bag, str(tank / "tank.json"))
    assert verdict.identical and verdict.ticks == (rows if rows <= 16 else 15), str(verdict)
    with open(table, newline="") as file:
        last = list(csv.DictReader(file))[-1]
    changed_since = actions and actions[-1][0] not in ("tick", "ticks", "inject")
    assert changed_since or float(last["law.outputs.sum"]) == twin.get_value("law.outputs.sum")
