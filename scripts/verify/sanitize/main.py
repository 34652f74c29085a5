# SPDX-License-Identifier: Apache-2.0
"""ASan and UBSan over the native test suite, and TSan over its threads.

The native packages (fcsl_math, fcsl_hal, fcsl_runtime, fcsl_sim) are built by gcc with -fsanitize=address,undefined, and
those that have threads (fcsl_hal, fcsl_runtime) once more with -fsanitize=thread, in out/verify/sanitize-*; the tests'
own C (machines, models, boards, what fcslc compiles) goes through compilers that add the same flags. Any report of any
process is a failure, whoever swallows it.
Leaks are looked for in our programs, not in Python. Rust (fcsl_io) is not instrumented.
"""

from __future__ import annotations

import argparse
import os
import re
import resource
import shutil
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import include_dirs, math_library

from ..shared.cases import ROOT, SHARED, SMALL_EXAMPLES, CheckFailed, run, write_facts
from ..shared.effort import scaled
from .build import GCC, THREADED, Build

HERE = Path(__file__).resolve().parent
_MACHINE_TICKS = 10000
#: Processor time of all commands so far, seconds.
_spent = [0.0]


@dataclass(frozen=True)
class Suite:
    """Python tests of native code: `arguments` of pytest."""

    name: str
    arguments: tuple[str, ...]
    default: bool = True


SUITES = (
    Suite(
        "fcsl-fc: socket, wire, board, watchdog, signals, guard",
        # Sanitizers lock no memory.
        (
            *(
                f"fcsl_runtime/simclient/test/test_{n}.py"
                for n in ("fc", "fc_wire", "fc_time", "fc_telemetry", "guard", "guard_board")
            ),
            "test/test_board_flight.py",
            "test/test_board_hardware.py",
            "-k",
            "not locking and not pinned",
        ),
    ),
    Suite(
        "hardware, structs",
        tuple(f"fcsl_runtime/simclient/test/test_{n}.py" for n in ("hardware", "structs")),
        default=False,
    ),
    Suite("simulator: models, wire, ticks", tuple(f"fcsl_sim/test/test_{n}.py" for n in ("models", "ticks", "wire"))),
    Suite("generated programs", ("fcsl_compiler/test/test_generated.py", "--programs", "40"), default=False),
    Suite("recorder, MCAP", ("fcsl_runtime/simclient/test/test_record.py", "fcsl_hal/test"), default=False),
    Suite(
        "ROS 2 messages",
        tuple(f"fcsl_runtime/simclient/test/test_ros_{n}.py" for n in ("axes", "reader", "topics")),
        False,
    ),
    Suite(
        "twins, replay, bags",
        ("fcsl_runtime/simclient/test", "-k", "simclient and not rerun and not view"),
        default=False,
    ),
    Suite("simulator, all", ("fcsl_sim/test",), default=False),
    Suite(
        "semantics of the language", ("fcsl_compiler/test/test_semantics.py", "fcsl_compiler/test/test_tick.py"), False
    ),
)


@dataclass(frozen=True)
class Row:
    """A line of the table."""

    what: str
    tests: int
    seconds: float
    cpu_s: float = 0.0  # of one core


def ctest(build: Build, package: str, chosen: str = "", wrapped: tuple[str, ...] = ()) -> Row:
    """The C test programs of a package. Raises CheckFailed."""
    started = time.monotonic()
    line = [*wrapped, "ctest", "-E", "pytest", *(("-R", chosen) if chosen else ()), "--output-on-failure"]
    done = subprocess.run(
        line, cwd=build.package(package), env=build.environment(), capture_output=True, text=True, check=False
    )
    judge(build, f"C tests of {package}, -fsanitize={build.kind}", done)
    found = re.search(r"out of (\d+)", done.stdout)
    if not found or int(found[1]) == 0:
        raise CheckFailed(f"no C test of {package} ran:\n{done.stdout}")
    return Row(f"{package}: C tests ({build.kind})", int(found[1]), time.monotonic() - started)


def judge(build: Build, what: str, done: subprocess.CompletedProcess[str]) -> None:
    """Raises CheckFailed for a report of the sanitizer, and for a failure."""
    findings = build.findings()
    if findings:
        raise CheckFailed(f"{what}: {len(findings)} reports\n" + "\n".join(findings[:3]))
    if done.returncode != 0:
        raise CheckFailed(f"{what}: exit status {done.returncode}\n{done.stdout[-6000:]}{done.stderr[-3000:]}")


def pytest(build: Build, suite: Suite, wrapped: tuple[str, ...] = ()) -> Row:
    """Raises CheckFailed."""
    started = time.monotonic()
    line = [*wrapped, sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *suite.arguments]
    done = subprocess.run(line, cwd=ROOT, env=build.environment(), capture_output=True, text=True, check=False)
    judge(build, suite.name, done)
    passed = re.search(r"(\d+) passed", done.stdout)
    if passed is None:
        raise CheckFailed(f"{suite.name}: no test ran\n{done.stdout[-3000:]}")
    return Row(f"{suite.name} ({build.kind})", int(passed[1]), time.monotonic() - started)


def machines(build: Build) -> Row:
    """The C of four examples with externs and fcsl_math, under the stimulus; the same hashes as without. Raises CheckFailed."""
    started = time.monotonic()
    folder = build.folder / "machines"
    compilations = emit(list(SMALL_EXAMPLES.values()), folder)
    sources = [HERE / "machines.c", SHARED / "stimulus.c", folder / "fcsl_machines.c"]
    includes = [SHARED, folder, *include_dirs()]
    for c in compilations:
        sources += [*(folder / name for name in c.c_names), *c.target.sources]
        includes += c.target.include
    line = [
        "-std=c11",
        "-O3",
        "-ffp-contract=off",
        "-fno-math-errno",
        *(f"-I{d}" for d in includes),
        *map(str, sources),
    ]
    hashes = []
    sanitized = build.folder / "install/fcsl_compiler/lib/libfcsl_math.a"
    for compiler, library in ((build.compiler, sanitized), (GCC, math_library())):
        program = folder / ("plain" if compiler == GCC else "sanitized")
        run([compiler, *line, str(library), "-lm", "-o", str(program)])
        done = subprocess.run(
            [program, str(_MACHINE_TICKS)], env=build.environment(), capture_output=True, text=True, check=False
        )
        judge(build, "machines of the examples", done)
        hashes.append(done.stdout)
    if hashes[0] != hashes[1]:
        raise CheckFailed(f"with the sanitizers machines compute something else:\n{hashes[0]}{hashes[1]}")
    return Row(f"machines of the examples, {_MACHINE_TICKS} ticks each", len(compilations), time.monotonic() - started)


def controls(build: Build, defects: dict[str, str], python: bool) -> Row:
    """Seeded defects, in a program built as the tests are and in a Python process: each must be reported."""
    started = time.monotonic()
    folder = build.folder / "control"
    folder.mkdir(exist_ok=True)
    source = str(HERE / "control.c")
    run([GCC, "-O1", *build.flags, source, "-lpthread", "-o", str(folder / "control")])
    commands = {defect: ([str(folder / "control"), defect], build.environment()) for defect in defects}
    if python:
        run([GCC, "-O1", *build.flags, "-shared", "-fPIC", source, "-o", str(folder / "control.so")])
        for defect in (d for d in defects if d != "leak"):
            call = f"import ctypes; ctypes.CDLL({str(folder / 'control.so')!r}).control({defect.encode()!r})"
            commands[f"{defect} in Python"] = ([sys.executable, "-c", call], build.environment())
    for name, (line, own) in commands.items():
        empty(build.reports)
        done = subprocess.run(line, env=own, capture_output=True, text=True, check=False)
        expected = defects[name.split()[0]]
        if done.returncode == 0 or not any(expected in finding for finding in build.findings()):
            raise CheckFailed(f"control: a seeded {name} was not reported as `{expected}` (-fsanitize={build.kind})")
    empty(build.reports)
    return Row(f"controls: seeded {', '.join(defects)} ({build.kind})", len(commands), time.monotonic() - started)


def empty(folder: Path) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)


def check_address(every: bool) -> list[Row]:
    build = Build("address")
    rows = [timed_build(build)]
    defects = {
        "bounds": "heap-buffer-overflow",
        "overflow": "signed integer overflow",
        "cast": "outside the range of representable values",
        "leak": "detected memory leaks",
    }
    rows.append(told(controls(build, defects, python=True)))
    rows += [told(ctest(build, package)) for package in ("fcsl_hal", "fcsl_runtime", "fcsl_sim")]
    rows.append(told(machines(build)))
    rows += [told(pytest(build, suite)) for suite in SUITES if suite.default or every]
    return rows


def check_threads() -> list[Row]:
    build = Build("thread")
    # TSan wants its shadow where a kernel's larger randomisation may put libraries.
    fixed = ("setarch", os.uname().machine, "-R")
    rows = [timed_build(build), told(controls(build, {"race": "data race"}, python=False))]
    rows += [told(ctest(build, p, THREADED, fixed)) for p in ("fcsl_hal", "fcsl_runtime")]
    return [*rows, told(pytest(build, SUITES[0], fixed))]


def timed_build(build: Build) -> Row:
    started = time.monotonic()
    print(f"building with -fsanitize={build.kind} in {build.folder.relative_to(ROOT)} ...", flush=True)
    build.make()
    empty(build.reports)
    return told(Row(f"build ({build.kind})", 0, time.monotonic() - started))


def told(row: Row) -> Row:
    """Prints a row, and completes it with the processor time of what ran since the last one."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    total = spent.ru_utime + spent.ru_stime
    row = replace(row, cpu_s=total - _spent[0])
    _spent[0] = total
    print(f"{row.what}: {row.tests or ''} {row.seconds:.1f} s ({row.cpu_s:.1f} s of a core)", flush=True)
    return row


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--all",
        action="store_true",
        default=scaled(False, True),
        help="every Python test of native code; else those of " + "; ".join(s.name for s in SUITES if s.default),
    )
    parser.add_argument("--only", choices=["address", "thread"], help="one of the two builds")
    options = parser.parse_args()
    try:
        rows = check_address(options.all) if options.only != "thread" else []
        rows += check_threads() if options.only != "address" else []
    except CheckFailed as error:
        print(f"sanitize: {error}", file=sys.stderr)
        return 1
    print(f"\n{'what':70} {'tests':>6} {'s':>6} {'core s':>7}")
    for row in rows:
        print(f"{row.what:70} {row.tests or '':>6} {row.seconds:6.1f} {row.cpu_s:7.1f}")
    print("no report")
    name = f"sanitize_{options.only}" if options.only else "sanitize"
    write_facts(name, {"all": options.all, "rows": [vars(row) for row in rows]})
    return 0


if __name__ == "__main__":
    sys.exit(main())
