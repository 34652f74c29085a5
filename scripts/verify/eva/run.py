# SPDX-License-Identifier: Apache-2.0
"""One run of Frama-C's EVA, and what it says, read from three places that must agree."""

from __future__ import annotations

import csv
import re
import subprocess
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..shared import cases

HERE = Path(__file__).resolve().parent
#: No machine of subjects.py comes near; an analysis that does has lost its way.
LIMIT_S = 600.0

#: The model of the machine: LP64, little-endian, IEEE 754, as gcc on x86-64.
_OPTIONS = (
    *("-machdep", "gcc_x86_64"),
    # As C reads them, to nearest: no news.
    *("-kernel-warn-key", "parser:decimal-float=inactive,annot:missing-spec=error"),
    *("-eva", "-eva-precision", "0", "-eva-msg-key=-initial-state,-final-states"),
    # So many rounds as a local has elements that is not filled before a library function computes it (emit/expressions.py).
    *("-eva-auto-loop-unroll", "256"),
    # Only math_contract.h says what the math library does; copies and fills are modelled byte by byte.
    *("-eva-no-builtins-auto", "-eva-builtin", "memcpy:Frama_C_memcpy,memset:Frama_C_memset"),
    # NaN and infinities are values of the language; arithmetic on them is no error, a cast of them to an integer is.
    *("-warn-special-float", "none", "-warn-right-shift-negative", "-warn-invalid-pointer"),
    "-eva-warn-pointer-subtraction",
)
#: Constants whose sum does not fit never come to the case "did not overflow" of dialect.h, which alone has such ensures.
_NEVER_EXACT = (
    *("-eva-warn-key", "ensures-false=feedback"),
    *("-nonterm-ignore", "eva_store_add,eva_store_sub,eva_store_mul"),
)
_AFTER = ("-then", "-metrics-eva-cover", "-nonterm", "-report-csv")
#: What runs an instance or a tick, as the compiler names it.
_TICK = re.compile(r"fcsl_(init|step|tick|force_state|enter)_\w+|\w+_(init|execute)|\w+__(start|execute)")
_FAULT = "fcsl_fault"
#: The world around a machine, whose functions are not counted.
_WORLD = re.compile(r"main|substitute|host_writes|(eva_)?any_\w+")


@dataclass(frozen=True)
class Subject:
    """A program for EVA: `sources[0]` is the file under proof, the others are the world around it."""

    name: str
    folder: Path
    sources: tuple[Path, ...]
    includes: tuple[Path, ...]
    #: The test generator writes conditions that are constant, so helpers behind them may never run; hand-written code is
    #: to be reached whole, and so is everything that the tick itself calls.
    dead_helpers: bool = False
    #: EVA proves what fcslc does not, that no operation can fault, so it does not reach `fcsl_fault`.
    never_faults: bool = False


@dataclass(frozen=True)
class Analysis:
    """What EVA found; the counts are of the file under proof."""

    name: str
    lines: int
    functions: int
    statements: int
    reached: int
    alarms: int
    seconds: float
    unreached: tuple[str, ...]
    problems: tuple[str, ...]

    def facts(self) -> dict[str, Any]:
        names = ("name", "lines", "functions", "statements", "reached", "alarms")
        return {
            **{name: getattr(self, name) for name in names},
            "unreached": self.unreached,
            "seconds": round(self.seconds, 1),
        }


def analyse(subject: Subject) -> Analysis:
    """Runs EVA. Raises CheckFailed when it does not come to an end, or does not say what it should."""
    started = time.monotonic()
    table = subject.folder / "properties.csv"
    table.unlink(missing_ok=True)
    text = _run(subject, table)
    seconds = time.monotonic() - started
    (subject.folder / "eva.log").write_text(text)
    alarms = count_alarms(text)
    own = {name: counts for name, counts in statements(text).items() if not _WORLD.fullmatch(name)}
    if not own:
        raise cases.CheckFailed(f"{subject.name}: EVA reached no function of it; see {subject.folder / 'eva.log'}")
    return Analysis(
        subject.name,
        subject.sources[0].read_text().count("\n"),
        len(own),
        sum(of for _, of in own.values()),
        sum(n for n, _ in own.values()),
        alarms,
        seconds,
        tuple(_unreached(subject, text)),
        tuple(f"{subject.name}: {p}" for p in (*unproven(table, alarms), *_silent(subject, text))),
    )


def _run(subject: Subject, table: Path) -> str:
    prelude = [f"-include {HERE / name}" for name in ("dialect.h", "math_contract.h")]
    words = [*prelude, *(f"-I{d}" for d in (*subject.includes, HERE))]
    line = [
        "frama-c",
        f"-cpp-extra-args={' '.join(words)}",
        *_OPTIONS,
        *_NEVER_EXACT,
        *map(str, subject.sources),
        *_AFTER,
        str(table),
    ]
    try:
        done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except FileNotFoundError:
        raise cases.CheckFailed("frama-c is not installed; scripts/verify_tools.sh installs it") from None
    except subprocess.TimeoutExpired:
        raise cases.CheckFailed(f"{subject.name}: EVA did not end within {LIMIT_S:.0f} s") from None
    if done.returncode != 0:
        raise cases.CheckFailed(
            f"{subject.name}: frama-c: exit status {done.returncode}\n{done.stdout[-3000:]}{done.stderr}"
        )
    return done.stdout + done.stderr


def statements(text: str) -> dict[str, tuple[int, int]]:
    """Of each function, how many statements EVA reached, and how many there are."""
    found = re.findall(r"^  (\w+): (\d+) stmts out of (\d+)", text, re.M)
    return {name: (int(n), int(of)) for name, n, of in found}


def count_alarms(text: str) -> int:
    """Of EVA's summary. Raises CheckFailed where there is none."""
    found = re.findall(r"^  (\d+) alarms? generated by the analysis", text, re.M)
    if len(found) != 1:
        raise cases.CheckFailed(f"EVA's summary counts no alarms:\n{text[-2000:]}")
    return int(found[0])


def unproven(table: Path, alarms: int) -> list[str]:
    """Properties, of code that EVA reached, without a proof: alarms and preconditions of what is called."""
    with table.open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t", quoting=csv.QUOTE_NONE))
    proven = ("Considered valid", "Valid", "Dead")
    found = [
        f"{r['file']}:{r['line']}: {r['property kind']}: {r['property']}" for r in rows if r["status"] not in proven
    ]
    if len(found) < alarms:
        found.append(f"EVA's summary counts {alarms} alarms, its table {len(found)}")
    return found


def _silent(subject: Subject, text: str) -> list[str]:
    """Signs that code was not looked at: warnings, functions not reached, calls and loops that never end."""
    problems = []
    if "No errors or warnings raised during the analysis." not in text:
        warnings = re.findall(r"^\[\S+\].*Warning:.*(?:\n  .*)?", text.split("= ANALYSIS SUMMARY =")[0], re.M)
        problems.append("EVA warns: " + "; ".join(w for w in warnings if "[eva:alarm]" not in w))
    for name in _unreached(subject, text):
        dead = subject.dead_helpers or (subject.never_faults and name == _FAULT)
        if not dead or _TICK.fullmatch(name):
            problems.append(f"EVA never reached {name}")
    endless = re.findall(r"^\[nonterm:stmt\] (\S+) Warning: *\n  (.*)", text, re.M)
    problems += [f"{where} {what}" for where, what in endless if subject.sources[0].name in where]
    if len(endless) != 1:
        problems.append(f"the endless loop of the entry is one of {len(endless)} places that do not end: {endless}")
    return problems


def _unreached(subject: Subject, text: str) -> list[str]:
    """Functions of the file under proof that its entry may call by the text, and that no path of values comes to."""
    listed = re.findall(r"^    <([^>]*)>: ([^<]*?;) *$", _section(text, "Unreached functions"), re.M)
    return [
        n for file, names in listed if Path(file).name == subject.sources[0].name for n in re.findall(r"\w+", names)
    ]


def _section(text: str, head: str) -> str:
    return text.partition(head)[2].partition("\n[")[0]
