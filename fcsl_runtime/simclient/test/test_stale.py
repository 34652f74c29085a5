# SPDX-License-Identifier: Apache-2.0
"""A library that is older than its sources is not loaded, and the refusal says what has changed since."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.cli.main import main
from simclient import AlgTwin, TwinError
from simclient.replay import replay
from simclient.twin.process_twin import ProcessTwin

ALGORITHM = """
from fcsl_builtins import extern


@extern(header="board.h", lang="c")
def board_twice(x: f64) -> f64: ...


class Twice:
    inputs = {"x": "f64"}
    outputs = {"y": "f64"}

    def execute(self):
        self.y = board_twice(self.x)
"""
HEADER = "#pragma once\ndouble board_twice(double x);\n"
BOARD = '#include "board.h"\ndouble board_twice(double x) { return 2.0 * x; }\n'
CONFIG: dict[str, Any] = {
    "tick_hz": 10,
    "initial_state": "RUN",
    "algorithms": {"Twice": {"source": "alg.py"}},
    "instances": {"a": {"algorithm": "Twice"}, "b": {"algorithm": "Twice"}},
    "states": {"RUN": {"schedule": {"a": 10, "b": 10}}},
    "targets": {"simulation": {"sources": ["board/board.c"], "include": ["board"]}},
}


@pytest.fixture
def craft(tmp_path: Path) -> Path:
    folder = tmp_path / "craft"
    (folder / "board").mkdir(parents=True)
    (folder / "alg.py").write_text(ALGORITHM)
    (folder / "board/board.h").write_text(HEADER)
    (folder / "board/board.c").write_text(BOARD)
    (folder / "craft.json").write_text(json.dumps(CONFIG))
    return folder / "craft.json"


@pytest.fixture
def library(craft: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    assert main(["build", str(craft), "-o", str(craft.parent / "out")]) == 0
    capsys.readouterr()
    return craft.parent / "out/libcraft.so"


def load(library: Path) -> None:
    with AlgTwin.from_library(library) as twin:
        twin.set("a.inputs.x", 2.0)
        twin.tick()
        assert twin.get_value("a.outputs.y") == 4.0


def refusal(library: Path) -> str:
    with pytest.raises(TwinError) as failed:
        load(library)
    return str(failed.value)


@pytest.mark.parametrize(
    ("file", "what"),
    [
        ("craft.json", "machine"),
        ("alg.py", "algorithm"),
        ("board/board.c", "extern"),
        ("board/board.h", "extern"),
    ],
)
def test_a_changed_source_is_named(craft: Path, library: Path, file: str, what: str) -> None:
    load(library)  # the control: before the change it is fresh
    path = craft.parent / file
    before = path.read_text()
    path.write_text(before + "\n")
    assert refusal(library).splitlines() == [
        f"{library}: it is older than its sources",
        f"  {what} {path} has changed",
        f"run `fcsl build {craft} -o {library.parent}`, or open {craft} itself: it is recompiled after a change",
    ]
    path.write_text(before)  # it is the text that counts, not its time
    load(library)


def test_what_it_says_to_run_mends_it(craft: Path, library: Path) -> None:
    (craft.parent / "alg.py").write_text(ALGORITHM + "        self.y = self.y + 0.0\n")
    command = refusal(library).split("run `")[1].split("`")[0]
    assert main(command.split()[1:]) == 0
    load(library)


def test_a_source_that_is_gone(craft: Path, library: Path) -> None:
    (craft.parent / "alg.py").unlink()
    assert f"  algorithm {craft.parent / 'alg.py'}: no such file" in refusal(library)


def test_a_deployed_library_loads(craft: Path, library: Path, tmp_path: Path) -> None:
    """Without its sources, with its record or without; and elsewhere while its sources are there, when they are the same."""
    shutil.copytree(library.parent, tmp_path / "vehicle")
    load(tmp_path / "vehicle/libcraft.so")
    shutil.copytree(craft.parent, tmp_path / "moved")
    shutil.rmtree(craft.parent)
    load(tmp_path / "vehicle/libcraft.so")
    load(tmp_path / "moved/out/libcraft.so")
    (tmp_path / "vehicle/libcraft.so.sources.json").unlink()
    load(tmp_path / "vehicle/libcraft.so")


def test_another_compiler(library: Path, tmp_path: Path, craft: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The record names the compiler; a newer one in its place is another. Without it nobody can tell, and nothing is said."""
    compiler = tmp_path / "wrapped"

    def version(number: str) -> None:
        compiler.write_text(f'#!/bin/sh\n[ "$1" = --version ] && {{ echo "wrapped {number}"; exit; }}\nexec cc "$@"\n')
        compiler.chmod(0o755)

    build = f"""import sys; from fcsl_compiler.cli.main import main; sys.exit(main(["build", {str(craft)!r}, "-o", {str(library.parent)!r}]))"""
    open_it = f"from simclient import AlgTwin; AlgTwin.from_library({str(library)!r}).close()"
    version("1.0")
    run(build, CC=str(compiler))
    assert run(open_it) == ""
    version("1.1")
    said = run(open_it, status=1)
    assert "  C compiler or flags: built with `wrapped 1.0 -std=c11" in said and "now `wrapped 1.1 -std=c11" in said
    compiler.unlink()
    assert run(open_it) == ""


def run(code: str, status: int = 0, **environment: str) -> str:
    """A process of its own: a compiler's version is asked once in each. Returns what it says of its failure."""
    done = subprocess.run(
        [sys.executable, "-c", code], env={**os.environ, **environment}, capture_output=True, text=True, check=False
    )
    assert done.returncode == status, done.stderr
    return done.stderr


def test_a_library_and_the_record_of_another_build(craft: Path, library: Path) -> None:
    old = library.read_bytes()
    (craft.parent / "alg.py").write_text(ALGORITHM + "        self.y = self.y + 0.0\n")
    assert main(["build", str(craft), "-o", str(library.parent)]) == 0
    library.unlink()
    library.write_bytes(old)
    assert "it belongs to a different build than its source record, libcraft.so.sources.json" in refusal(library)


@pytest.mark.parametrize("text", ["", "{", "[]", "null", '{"version": 1}', '{"version": 2, "machines": {}}'])
def test_a_damaged_record_is_refused(library: Path, text: str) -> None:
    Path(f"{library}.sources.json").write_text(text)
    assert "not a source record of this fcslc version; build the library again" in refusal(library)


def test_a_record_with_a_changed_letter_is_refused(library: Path) -> None:
    """Also in the path of the machine: it would be that of a computer without its sources."""
    record = Path(f"{library}.sources.json")
    text = record.read_text()
    for old in ("craft.json", '"build_hash": "', "alg.py"):
        assert old in text
        record.write_text(text.replace(old, old.replace("a", "b", 1) if "a" in old else f"{old}0", 1))
        assert "damaged, or not a source record" in refusal(library)


def test_a_subset_says_how_it_is_built(craft: Path, library: Path) -> None:
    assert main(["build", str(craft), "-o", str(library.parent), "--instances", "a"]) == 0
    load(library)
    (craft.parent / "alg.py").write_text(ALGORITHM + "\n")
    assert "--instances a`" in refusal(library)


def test_every_python_host_looks(craft: Path, library: Path, tmp_path: Path) -> None:
    """ProcessTwin and replay; fcsl-sim and the nodes of fcsl_bridge open machines by the same function."""
    with AlgTwin.from_library(library) as twin:
        twin.record(tmp_path / "bag")
        twin.tick(5)
    hosts: list[Callable[[], Any]] = [
        lambda: ProcessTwin.from_library(library).close(),
        lambda: replay(str(tmp_path / "bag"), library=str(library)),
    ]
    for host in hosts:
        host()
    (craft.parent / "alg.py").write_text(ALGORITHM + "\n")
    for host in hosts:
        with pytest.raises(TwinError, match=r"alg\.py has changed"):
            host()
