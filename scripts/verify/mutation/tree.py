# SPDX-License-Identifier: Apache-2.0
"""The workspace once more, with mutants: copies of the mutated packages, links to all else, built once with every mutant in it."""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.toolchain import include_dirs

from ..shared.cases import ROOT, CheckFailed, run
from . import c_points, python_points
from .mutants import Candidate, Mutant, equivalents, is_equivalent, with_switches

HERE = Path(__file__).resolve().parent
HOOK = HERE / "hook"
#: Packages that are copied and built, and the folders in which sources are mutated.
COPIED = ("fcsl_compiler", "fcsl_hal", "fcsl_runtime", "fcsl_sim")
MUTATED = {
    "C": ("fcsl_hal/src", "fcsl_runtime/fcsl_runtime/src", "fcsl_runtime/fcsl_runtime/fc", "fcsl_sim/src"),
    "Python": ("fcsl_compiler/fcsl_compiler", "fcsl_runtime/simclient/simclient", "fcsl_sim/fcsl_sim"),
}
#: Programs in the language, which knows no switch.
_DIALECT = ROOT / "fcsl_compiler/fcsl_compiler/library"
_GCC = "/usr/bin/gcc"
_HEADERS = ("fcsl_runtime/fcsl_runtime/include", "fcsl_hal/include", "fcsl_sim/include")


def sources(language: str) -> list[str]:
    """The files that may be mutated, relative to the workspace."""
    pattern = "*.c" if language == "C" else "*.py"
    found = [f for d in MUTATED[language] for f in sorted((ROOT / d).rglob(pattern)) if not f.is_relative_to(_DIALECT)]
    return [str(f.relative_to(ROOT)) for f in found]


def candidates(only: str) -> list[Candidate]:
    """What may be drawn of the files whose path holds `only`."""
    found: list[Candidate] = []
    known = equivalents()
    for language in MUTATED:
        for file in (f for f in sources(language) if only in f):
            source = (ROOT / file).read_bytes()
            lines = source.decode().split("\n")
            every = c_points.points(source) if language == "C" else python_points.points(source)
            found += [Candidate(file, p) for p in every if not is_equivalent(p, file, lines, known)]
    return found


def compiles(candidate: Candidate) -> bool:
    """Whether types allow the mutant: the grammar does not know them."""
    if not candidate.file.endswith(".c"):
        return True
    file = candidate.file
    text = with_switches((ROOT / file).read_bytes(), [Mutant(1, file, candidate.point)], c_switch)
    own = [ROOT / d for d in (*MUTATED["C"], *_HEADERS)]
    includes = [f"-I{d}" for d in ((ROOT / file).parent, *own, *include_dirs())]
    line = [_GCC, "-fsyntax-only", "-std=c11", "-w", '-DFCSL_VERSION=""', *includes, "-x", "c", "-"]
    return subprocess.run(line, input=with_declaration(text), capture_output=True, check=False).returncode == 0


def c_switch(number: int) -> str:
    return f"fcsl_mutant({number}u)"


def python_switch(number: int) -> str:
    return f"__import__('fcsl_mutants').mutant({number})"


def with_declaration(text: bytes) -> bytes:
    return b"int fcsl_mutant(unsigned);\n#line 1\n" + text


@dataclass(frozen=True)
class Tree:
    """A workspace with mutants."""

    folder: Path

    @property
    def switch(self) -> Path:
        return self.folder / "bin/libfcsl_mutants.so"

    def make(self, mutants: list[Mutant]) -> None:
        """Writes and builds it, anew where a source differs. Raises CheckFailed with what the compiler says."""
        self._link()
        for package in COPIED:
            self._copy(package, mutants)
        self._make_tools()
        self._build()

    def _link(self) -> None:
        self.folder.mkdir(parents=True, exist_ok=True)
        (self.folder / "COLCON_IGNORE").touch()  # these packages are none of the workspace around it
        tracked = run(["git", "-C", str(ROOT), "ls-files"]).splitlines()
        for name in {Path(f).parts[0] for f in tracked} - {*COPIED}:
            if not (self.folder / name).is_symlink():
                (self.folder / name).symlink_to(ROOT / name)

    def _copy(self, package: str, mutants: list[Mutant]) -> None:
        """Only what differs is written, so that only that is compiled again."""
        tracked = run(["git", "-C", str(ROOT), "ls-files", "--cached", "--others", "--exclude-standard", package])
        wanted = {file for file in tracked.splitlines() if (ROOT / file).is_file()}
        for old in (p for p in (self.folder / package).rglob("*") if p.is_file()):
            if str(old.relative_to(self.folder)) not in wanted and "__pycache__" not in old.parts:
                old.unlink()
        by_file: dict[str, list[Mutant]] = {}
        for m in mutants:
            by_file.setdefault(m.file, []).append(m)
        for file in wanted:
            text, target = (ROOT / file).read_bytes(), self.folder / file
            if file in by_file:
                is_c = file.endswith(".c")
                text = with_switches(text, by_file[file], c_switch if is_c else python_switch)
                text = with_declaration(text) if is_c else text
            if not target.is_file() or target.read_bytes() != text:
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_bytes(text)
                target.chmod((ROOT / file).stat().st_mode)

    def _make_tools(self) -> None:
        """The switch, and compilers that link it to what holds mutants, in the build and in tests that compile sources of their own."""
        tools = self.folder / "bin"
        tools.mkdir(exist_ok=True)
        run([_GCC, "-O1", "-shared", "-fPIC", HOOK / "fcsl_mutants.c", "-o", self.switch])
        for name in ("cc", "gcc"):
            program = tools / name
            program.write_text(
                f'#!/bin/sh\nfor word; do case $word in -c|-E|-S|-M*|-fsyntax-only) exec {_GCC} "$@" ;; esac; done\n'
                f'exec {_GCC} "$@" -x none -Wl,--as-needed {shlex.quote(str(self.switch))}\n'
            )
            program.chmod(0o755)

    def _build(self) -> None:
        cargo = self.folder / "build/fcsl_hal/cargo"
        if not cargo.exists() and (ROOT / "build/fcsl_hal/cargo").exists():
            # The crates that Rust's own depends on are compiled there.
            cargo.parent.mkdir(parents=True, exist_ok=True)
            cargo.symlink_to(ROOT / "build/fcsl_hal/cargo")
        line = [
            *("colcon", "build", "--base-paths", *COPIED, "--cmake-args"),
            *("-DCMAKE_BUILD_TYPE=Release", f"-DCMAKE_C_COMPILER={self.folder / 'bin/cc'}", "-DCMAKE_C_FLAGS=-w"),
        ]
        # The build runs the compiler, whose switches need theirs.
        environment = os.environ | {"PYTHONPATH": f"{HOOK}{os.pathsep}{os.environ.get('PYTHONPATH', '')}"}
        done = subprocess.run(line, cwd=self.folder, env=environment, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            logs = sorted((self.folder / "log/latest_build").glob("*/stderr.log"))
            said = "\n".join(log.read_text(errors="replace")[-2000:] for log in logs)
            raise CheckFailed(f"the build with mutants failed\n{done.stderr[-2000:]}\n{said}")

    def environment(self) -> dict[str, str]:
        """For its tests: what was built here, above the workspace's own."""
        script = f". {shlex.quote(str(self.folder / 'install/local_setup.bash'))} && exec {sys.executable} -c '{_DUMP}'"
        done = subprocess.run(["bash", "-c", script], capture_output=True, check=True)
        own = dict(entry.split("=", 1) for entry in done.stdout.decode().split("\0") if entry)
        own |= {
            "PATH": f"{self.folder / 'bin'}{os.pathsep}{own['PATH']}",
            "PYTHONPATH": f"{HOOK}{os.pathsep}{own.get('PYTHONPATH', '')}",
            "PYTHONDONTWRITEBYTECODE": "1",
            "FCSL_CACHE_DIR": str(self.folder / "cache"),
            # pytest removes folders of earlier runs, those of others, too. Paths of sockets must be short.
            "PYTEST_DEBUG_TEMPROOT": tempfile.mkdtemp(prefix="mutants-"),
        }
        return own


_DUMP = 'import os; print("\\0".join(f"{k}={v}" for k, v in os.environ.items()))'
