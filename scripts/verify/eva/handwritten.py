# SPDX-License-Identifier: Apache-2.0
"""EVA on C that is written by hand: a program that calls it with anything, and seeded defects that EVA must find."""

from __future__ import annotations

import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.toolchain import include_dirs

from ..shared.cases import ROOT, CheckFailed, write_facts
from .run import LIMIT_S, count_alarms, statements, unproven

#: The model of the machine: LP64, little-endian, IEEE 754, as gcc on x86-64. Loops that EVA knows the rounds of are unrolled,
#: the longest over a whole frame; of the others the first rounds.
_OPTIONS = (
    *("-machdep", "gcc_x86_64", "-kernel-warn-key", "parser:decimal-float=inactive"),
    *("-eva", "-eva-precision", "0", "-eva-msg-key=-initial-state,-final-states"),
    *("-eva-auto-loop-unroll", "260", "-eva-min-loop-unroll", "10", "-eva-no-builtins-auto", "-eva-builtin"),
    ",".join(f"{name}:Frama_C_{name}" for name in ("memcpy", "memset", "memchr", "memmove")),
    *("-warn-special-float", "none", "-warn-right-shift-negative", "-warn-invalid-pointer"),
    "-eva-warn-pointer-subtraction",
)


@dataclass(frozen=True)
class Defect:
    """`old` of a source becomes `new`; EVA must find it in the program with these `defines`."""

    what: str
    file: str
    old: str
    new: str
    defines: tuple[str, ...] = ()


@dataclass(frozen=True)
class Proof:
    """What `program` calls: `sources` of `folder`. With `loops_end` EVA must follow each of their loops to its end."""

    name: str
    program: Path
    folder: Path
    sources: tuple[str, ...]
    defines: tuple[str, ...] = ()
    options: tuple[str, ...] = ()
    loops_end: bool = False


@dataclass(frozen=True)
class Analysis:
    """`unproven` are alarms, assertions and loops; `silent` are signs that code was not looked at."""

    reached: int
    statements: int
    unproven: tuple[str, ...]
    silent: tuple[str, ...]


def analyse(proof: Proof, folder: Path, sources: Sequence[Path], defines: Sequence[str] = ()) -> Analysis:
    """Runs EVA on the program with these sources. Raises CheckFailed when it does not come to an end."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "properties.csv"
    # A source with a seeded defect lies elsewhere, so it finds the headers beside it by their folder.
    beside = {(proof.folder / name).parent: None for name in proof.sources}
    includes = (ROOT / "fcsl_hal/include", *include_dirs(), proof.folder, *beside)
    words = [*defines, *(f"-I{path}" for path in includes)]
    line = ["frama-c", f"-cpp-extra-args={' '.join(words)}", *_OPTIONS, *proof.options, str(proof.program)]
    line += [*map(str, sources), "-then", "-metrics-eva-cover", "-report-csv", str(table)]
    try:
        done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except FileNotFoundError:
        raise CheckFailed("frama-c is not installed; scripts/verify_tools.sh installs it") from None
    except subprocess.TimeoutExpired:
        raise CheckFailed(f"EVA did not end within {LIMIT_S:.0f} s") from None
    if done.returncode != 0:
        raise CheckFailed(f"frama-c: exit status {done.returncode}\n{done.stdout[-3000:]}{done.stderr}")
    silent = []
    if "No errors or warnings raised during the analysis." not in done.stdout:
        silent.append("EVA warns of more than alarms")
    if "Unreached functions" in done.stdout:
        silent.append("EVA never reached " + done.stdout.partition("Unreached functions")[2].partition("\n[")[0])
    counts = statements(done.stdout).values()
    found = unproven(table, count_alarms(done.stdout))
    if proof.loops_end:
        found += _endless(done.stdout, proof)
    return Analysis(sum(n for n, _ in counts), sum(of for _, of in counts), tuple(found), tuple(silent))


def _endless(text: str, proof: Proof) -> list[str]:
    """Loops of the sources with more turns than are unrolled. One that repeats a state would not be among them."""
    places = re.findall(r"^\[eva:loop-unroll:partial\] (\S+?):(\d+):", text, re.M)
    return [
        f"{file}:{line}: a loop that EVA does not follow to its end"
        for file, line in places
        if Path(file).name in {Path(name).name for name in proof.sources}
    ]


def _prove(proof: Proof, folder: Path) -> Analysis:
    """Raises CheckFailed where something is not proven."""
    found = analyse(proof, folder, [proof.folder / name for name in proof.sources], proof.defines)
    if found.unproven or found.silent:
        raise CheckFailed("\n  ".join(("not proven:", *found.unproven, *found.silent)))
    return found


def _find(proof: Proof, defect: Defect, folder: Path) -> str:
    """What EVA no longer proves. Raises CheckFailed if it proves all."""
    text = (proof.folder / defect.file).read_text()
    if text.count(defect.old) != 1:
        raise CheckFailed(f"`{defect.old}` stands {text.count(defect.old)} times in {defect.file}; change this defect")
    (folder / defect.file).parent.mkdir(parents=True)
    (folder / defect.file).write_text(text.replace(defect.old, defect.new))
    sources = [(folder if name == defect.file else proof.folder) / name for name in proof.sources]
    found = analyse(proof, folder, sources, defect.defines)
    if not found.unproven:
        raise CheckFailed(f"not found: {defect.what}")
    return found.unproven[0]


def check(proof: Proof, defects: Sequence[Defect]) -> int:
    """Proves, and finds every defect; prints and writes the figures. Returns the exit status."""
    with tempfile.TemporaryDirectory(prefix=f"fcsl-{proof.name}-") as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        proven = pool.submit(_prove, proof, folder / "proof")
        controls = [pool.submit(_find, proof, defect, folder / str(n)) for n, defect in enumerate(defects)]
        try:
            for defect, control in zip(defects, controls, strict=True):
                print(f"found: {defect.what}: {control.result()}", flush=True)
            found = proven.result()
        except CheckFailed as error:
            for waiting in controls:
                waiting.cancel()
            print(f"{proof.name}: {error}", file=sys.stderr)
            return 1
    print(f"0 alarms; {found.reached} of {found.statements} statements reached", flush=True)
    facts = {"alarms": 0, "statements": found.statements, "statements_reached": found.reached}
    write_facts(proof.name, facts | {"defects found": len(defects)})
    return 0
