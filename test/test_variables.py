# SPDX-License-Identifier: Apache-2.0
"""docs/reference/variables.md: its commands print the shown output, and its Python runs, in order, with one flight program."""

import re
import shlex
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from fcsl_compiler.base.packages import package_prefix

DOC = Path(__file__).resolve().parents[1] / "docs/reference/variables.md"


def blocks(kind: str) -> list[str]:
    return re.findall(rf"^```{kind}\n(.*?)^```$", DOC.read_text(), re.DOTALL | re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """The folder with the socket of the page's flight program."""
    folder = tmp_path_factory.mktemp("variables")
    (start,) = blocks("sh start")
    program, library, *options = shlex.split(start)
    library = str(Path(package_prefix("minimal")) / library.partition("install/minimal/")[2])
    with subprocess.Popen([program, library, *options], cwd=folder, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert any(b"commands on fc.sock" in line for line in process.stdout)
        yield folder
        process.terminate()
    assert process.returncode == 0


def test_the_page(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("FCSL_SOCKET", "fc.sock")
    (transcript,) = blocks("console")
    commands = transcript.removeprefix("$ ").split("\n$ ")
    assert len(commands) >= 13
    for text in commands:
        command, _, expected = text.partition("\n")
        done = subprocess.run(shlex.split(command), cwd=folder, capture_output=True, text=True, check=False)
        assert done.stdout + done.stderr == expected.rstrip("\n") + "\n", command
        assert done.returncode == (1 if done.stdout == "" else 0), command
    (python,) = blocks("python")
    subprocess.run([sys.executable, "-c", python], cwd=folder, check=True)
