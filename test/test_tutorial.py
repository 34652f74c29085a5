# SPDX-License-Identifier: Apache-2.0
"""The tour of README.md and docs/start/tour.md runs as printed: its files, then its commands."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
#: The tour begins in the README and ends in the tutorial.
PAGES = (ROOT / "README.md").read_text() + (ROOT / "docs/start/tour.md").read_text()
FILE = re.compile(r"<!-- file: (\S+) -->\n```\w+\n(.*?)```\n", re.DOTALL)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the tutorial's files."""
    path = tmp_path_factory.mktemp("tutorial")
    files = dict(FILE.findall(PAGES))
    assert sorted(files) == ["hover.py", "hover.sim.json", "hover_control.json", "sensors.py", "test_hover.py"]
    for name, text in files.items():
        (path / name).write_text(text)
    return path


def sh(line: str, folder: Path) -> str:
    done = subprocess.run(line, shell=True, cwd=folder, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, f"$ {line}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def commands(heading: str) -> list[str]:
    """Lines of the first shell block below a heading of the tour."""
    section = PAGES.split(f"## {heading}\n")[1].split("\n## ")[0].split("\n### ")[0]
    block = section.split("```sh\n")[1].split("```")[0]
    return [line.split("  #")[0].strip() for line in block.splitlines()]


def test_check(folder: Path) -> None:
    (line,) = commands("Wire it")
    assert "ok" in sh(line, folder)


def test_pytest(folder: Path) -> None:
    (line,) = commands("Test it")
    assert "3 passed" in sh(line, folder)


def test_fly_replay_look(folder: Path) -> None:
    fly, replay, info, plot, rerun = commands("Fly it")
    assert "bag: flight" in sh(fly, folder)
    assert "3000 ticks, identical" in sh(replay, folder)
    assert "hover_control" in sh(info, folder)
    sh(plot, folder)
    sh(rerun, folder)
    assert (folder / "flight.png").stat().st_size > 10_000
    assert (folder / "flight.rrd").stat().st_size > 10_000


def test_a_mistake_is_explained(folder: Path) -> None:
    text = (folder / "hover_control.json").read_text()
    (folder / "wrong_control.json").write_text(text.replace("hover.pos_z", "hover.posz"))
    done = subprocess.run(
        ["fcslc", "check", "wrong_control.json"], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 1
    assert "wrong_control.json:13:37: error[E216]" in done.stderr
    assert "did you mean `pos_z`?" in done.stderr
