# SPDX-License-Identifier: Apache-2.0
"""The tests that may notice a mutant: what each reaches, found by one run of all of them, and the nearest run against one mutant."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..shared.cases import CheckFailed
from .hook.fcsl_mutants import SIZE
from .mutants import Mutant

if TYPE_CHECKING:  # it needs the grammar of C, which `make test` does not install
    from .tree import Tree

#: Each has a run of its own. Of the workspace's tests, those of `fcsl new`.
PYTEST_FOLDERS = (
    *("fcsl_compiler/test", "fcsl_hal/test", "fcsl_runtime/simclient/test", "fcsl_sim/test"),
    "test/test_new.py",
)
#: A recorded run may take so long, seconds.
RECORD_LIMIT_S = 3600.0
#: Tests in pytest are chosen, the shortest first, until they took so long when they were recorded: seconds.
BUDGET_S = 120.0
#: With a mutant they may take so many times as long before they count as hanging, and so much more.
PATIENCE, START_S = 4.0, 120.0


@dataclass(frozen=True)
class Test:
    """`command` of a C program; empty for a test of pytest, whose name is its node id."""

    name: str
    seconds: float
    reaches: frozenset[int]
    command: tuple[str, ...] = ()


def record(tree: Tree, environment: Mapping[str, str], workers: int) -> list[Test]:
    """Runs every test once without a mutant. Tests that do not pass, or are skipped, are left out. Raises CheckFailed."""
    tests = [t for t in (_recorded(tree, environment, line) for line in _programs(tree)) if t is not None]
    folder = tree.folder / "reached"
    folder.mkdir(exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    for name in PYTEST_FOLDERS:
        _record_pytest(tree, {**environment, "FCSL_MUTANTS_REACHED": str(_blank(folder / "pytest"))}, name, workers)
    facts = [json.loads(line) for file in folder.glob("*.tests") for line in file.read_text().splitlines()]
    tests += [Test(f["test"], f["seconds"], frozenset(f["mutants"])) for f in facts if f["passed"]]
    if not tests or not any(t.reaches for t in tests):
        raise CheckFailed("no test reached a mutant")
    return tests


def _blank(path: Path) -> Path:
    path.write_bytes(bytes(SIZE))
    return path


def _programs(tree: Tree) -> list[tuple[str, ...]]:
    """The C tests, as CTest runs them."""
    runtime = tree.folder / "build/fcsl_runtime"
    found: list[tuple[str, ...]] = []
    for package in ("fcsl_hal", "fcsl_runtime", "fcsl_sim"):
        files = sorted((tree.folder / "build" / package).glob("test_*"))
        more = (str(runtime / "libfixture.so"),) if package == "fcsl_runtime" else ()
        found += [(str(f), *more) for f in files if os.access(f, os.X_OK) and f.is_file()]
    return found


def _recorded(tree: Tree, environment: Mapping[str, str], line: tuple[str, ...]) -> Test | None:
    reached = _blank(tree.folder / "reached.bytes")
    begun = time.monotonic()
    if not _passes(line, {**environment, "FCSL_MUTANTS_REACHED": str(reached)}, tree.folder, 120.0):
        return None
    numbers = frozenset(n for n, byte in enumerate(reached.read_bytes()) if byte)
    return Test(Path(line[0]).name, time.monotonic() - begun, numbers, line)


def _record_pytest(tree: Tree, environment: Mapping[str, str], folder: str, workers: int) -> None:
    line = [*_PYTEST, "-q", f"-n{workers}", "--dist=worksteal", folder]
    log = tree.folder / f"record-{folder.replace('/', '-')}.txt"
    with log.open("wb") as output:
        done = subprocess.run(
            line, cwd=tree.folder, env=environment, stdout=output, stderr=output, timeout=RECORD_LIMIT_S, check=False
        )
    if done.returncode not in (0, 1):  # 1: some test failed
        raise CheckFailed(f"pytest {folder}: exit status {done.returncode}, see {log}")


_PYTEST = [sys.executable, "-m", "pytest", "-p", "fcsl_mutants", "-p", "no:cacheprovider"]


def nearest(tests: Sequence[Test], number: int) -> tuple[list[Test], list[Test]]:
    """C programs that reach the mutant, and tests of pytest until their budget is spent; the shortest first."""
    reaching = sorted((t for t in tests if number in t.reaches), key=lambda t: t.seconds)
    chosen: list[Test] = []
    spent = 0.0
    for t in (t for t in reaching if not t.command):
        if chosen and spent + t.seconds > BUDGET_S:
            break
        chosen.append(t)
        spent += t.seconds
    return [t for t in reaching if t.command], chosen


def killer(
    tree: Tree, environment: Mapping[str, str], tests: Sequence[Test], mutant: Mutant, is_on: bool
) -> str | None:
    """What notices a mutant, or a control if it is not on, among the tests nearest to it: a name, or None.

    Each run compiles into a cache of its own: what a mutated compiler wrote must not meet another mutant.
    """
    with tempfile.TemporaryDirectory(prefix="mutant-", dir=tree.folder) as folder:
        own = {**environment, "FCSL_MUTANT": str(mutant.number if is_on else 0), "FCSL_CACHE_DIR": f"{folder}/cache"}
        programs, chosen = nearest(tests, mutant.number)
        for t in programs:
            if not _passes(t.command, own, tree.folder, START_S + PATIENCE * t.seconds):
                return t.name
        if not chosen:
            return None
        limit = START_S + PATIENCE * sum(t.seconds for t in chosen)
        names = Path(folder) / "tests.txt"  # too many for a command line
        for part in by_folder(chosen):
            names.write_text("\n".join(t.name for t in part))
            if not _passes([*_PYTEST, "-x", "-q", f"@{names}"], own, tree.folder, limit):
                return f"pytest ({len(part)} tests of {part[0].name.split('/')[0]})"
        return None


def by_folder(tests: Sequence[Test]) -> list[list[Test]]:
    """Tests of pytest by their folder: one run of several imports but one of their files of a name (conftest.py)."""
    parts = [[t for t in tests if t.name.startswith(folder)] for folder in PYTEST_FOLDERS]
    return [part for part in parts if part]


def _passes(line: Sequence[str], environment: Mapping[str, str], folder: Path, limit_s: float) -> bool:
    """Whether a command ends with 0 in time; it and what it started are ended."""
    process = subprocess.Popen(
        line, cwd=folder, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )
    try:
        return process.wait(limit_s) == 0
    except subprocess.TimeoutExpired:
        return False
    finally:
        try:
            os.killpg(process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        process.wait()
