# SPDX-License-Identifier: Apache-2.0
"""docs/guide/testing.md: its files and parts of files are those of the lander's tests, which run; so do its commands, and its failing test fails as shown.

FCSL_UPDATE_GOLDEN=1 copies the files into the page.
"""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from simclient.replay import replay

ROOT = Path(__file__).resolve().parent.parent
LANDER = ROOT / "examples/lander"
DOC = ROOT / "docs/guide/testing.md"
PAGE = DOC.read_text()
BLOCK = re.compile(r"(?:<!-- (file|part|fails): (\S+) -->\n)?```(\w+)(?: (\w+))?\n(.*?)```\n", re.DOTALL)
BLOCKS: list[tuple[str, str, str, str, str]] = BLOCK.findall(PAGE)
FILES = {name: text for kind, name, _, _, text in BLOCKS if kind == "file"}
PARTS = [(name, text) for kind, name, _, _, text in BLOCKS if kind == "part"]


def block(mark: str) -> str:
    return next(text for _, name, _, found, text in BLOCKS if mark in (found, name))


@pytest.fixture(scope="module")
def lander(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page") / "lander"
    shutil.copytree(LANDER, folder)
    return folder


def run(lander: Path, *line: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(line, cwd=lander, capture_output=True, text=True, check=False, timeout=300)


def test_every_block_is_tried() -> None:
    assert PAGE.count("```") == 2 * len(BLOCKS)
    plain = [(language, mark) for kind, _, language, mark, _ in BLOCKS if not kind]
    assert plain == [("python", "api"), ("sh", "options"), ("text", "report")]


@pytest.mark.parametrize("name", FILES)
def test_files_are_those_of_the_example(name: str) -> None:
    own = (LANDER / name).read_text().removeprefix("# SPDX-License-Identifier: Apache-2.0\n")
    if os.environ.get("FCSL_UPDATE_GOLDEN"):
        DOC.write_text(DOC.read_text().replace(FILES[name], own))
    else:
        assert own == FILES[name]


@pytest.mark.parametrize(("name", "text"), PARTS, ids=[name for name, _ in PARTS])
def test_parts_of_files_are_in_those_of_the_example(name: str, text: str) -> None:
    assert text.count("\n") > 3 and f"\n{text}" in (LANDER / name).read_text()


def test_the_first_example(lander: Path) -> None:
    done = run(lander, sys.executable, "-c", block("api"))
    assert done.returncode == 0, done.stderr


def test_the_commands(lander: Path) -> None:
    for command in block("options").splitlines():
        done = run(lander, "bash", "-c", command)
        assert done.returncode == 0 and "18 passed" in done.stdout, done.stdout + done.stderr


def test_the_failure(lander: Path, tmp_path: Path) -> None:
    (lander / "test_fails.py").write_text(block("test_fails.py"))
    done = run(lander, sys.executable, "-m", "pytest", "test_fails.py", f"--basetemp={tmp_path / 'base'}")
    assert done.returncode == 1
    folder = re.findall(r"^(/.*)/lander_control$", done.stdout, re.MULTILINE)[0]
    told = done.stdout.replace(folder, "/…").splitlines()
    shown = block("report").splitlines()
    assert [line for line in told if line in shown] == shown, done.stdout
    assert replay(Path(folder) / "lander_control", str(LANDER / "fc/lander_control.json")).identical
