# SPDX-License-Identifier: Apache-2.0
"""A fuzzer on each native parser: libFuzzer with ASan and UBSan on harnesses/, from seeds in corpus/.

A crash ends in out/verify/fuzz/<target>/crash-*: it becomes a seed once it is fixed. Of each parser one defect
(targets.py) is seeded and must be found, so that a harness that feeds nothing cannot pass.
"""

from __future__ import annotations

import argparse
import hashlib
import os
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import include_dirs, math_library

from ..shared.cases import OUT, ROOT, SMALL_EXAMPLES, CheckFailed, run, write_facts
from ..shared.effort import EFFORT
from .targets import TARGETS, Defect, Target

HARNESSES = Path(__file__).resolve().parent / "harnesses"
#: Of each harness a folder of inputs to begin with.
CORPUS = Path(__file__).resolve().parent / "corpus"
FOLDER = OUT / "fuzz"
#: Inputs that a seeded defect may take to be found: a number, since a time would depend on how busy the computer is.
CONTROL_INPUTS = 100_000
CLANG = "clang-19"
#: float-cast-overflow: undefined in C, and no part of -fsanitize=undefined.
SANITIZE = "address,undefined,float-cast-overflow"
FLAGS = (
    *("-std=c11", "-O1", "-g", "-fno-omit-frame-pointer", "-ffp-contract=off", "-fPIC", "-Wall", "-Wextra"),
    *(f"-fsanitize={SANITIZE}", "-fno-sanitize-recover=all"),
)
_NATIVE = (
    *("fcsl_hal/src/*", "fcsl_hal/src/drivers/*", "build/fcsl_hal/drivers"),
    *(f"fcsl_runtime/fcsl_runtime/{folder}" for folder in ("src/*", "fc", "observers", "ros_graph", "board")),
    "fcsl_sim/src/*",
)
_INCLUDES = (
    *("fcsl_hal/include", "fcsl_runtime/fcsl_runtime/include", "fcsl_sim/include", "fcsl_compiler/include"),
    *(
        "fcsl_hal/src",
        "fcsl_hal/src/*/",
        "fcsl_hal/src/drivers/*/",
        "fcsl_runtime/fcsl_runtime",
        "fcsl_runtime/fcsl_runtime/src",
        "fcsl_runtime/fcsl_runtime/src/*/",
        "fcsl_runtime/fcsl_runtime/fc",
        "fcsl_runtime/fcsl_runtime/board",
    ),
    *("fcsl_runtime/fcsl_runtime/test", "fcsl_hal/test", "fcsl_hal/test/support", "fcsl_sim/src", "fcsl_sim/src/*/"),
)


def compiled(source: Path, includes: Sequence[Path], more: Sequence[str] = ()) -> Path:
    """An object; one that was made of the same text by the same flags before is used again. Raises CheckFailed."""
    # Headers beside the sources are no system headers, whatever their names.
    folders = [f"{'-I' if d.name == 'include' else '-iquote'}{d}" for d in includes]
    flags = [*FLAGS, "-fsanitize=fuzzer-no-link", *more, *folders]
    text = run([CLANG, *flags, "-E", source])
    made = FOLDER / "objects" / f"{hashlib.sha256((' '.join(flags) + text).encode()).hexdigest()[:24]}.o"
    if not made.exists():
        made.parent.mkdir(parents=True, exist_ok=True)
        part = made.with_suffix(f".{threading.get_ident()}.part")  # two harnesses may need one object at once
        run([CLANG, *flags, "-c", source, "-o", part])
        part.replace(made)
    return made


def linked(output: Path, parts: Sequence[Path], flags: Sequence[str]) -> Path:
    """A program or library of objects and archives; the one that was made of the same parts before is used again."""
    line = [CLANG, "-fuse-ld=lld", f"-fsanitize={SANITIZE}", *flags, *map(str, parts)]
    stamp = output.with_suffix(".parts")
    wanted = " ".join([*line, *(str(p.stat().st_mtime_ns) for p in parts)])
    if not output.exists() or not stamp.exists() or stamp.read_text() != wanted:
        output.parent.mkdir(parents=True, exist_ok=True)
        run([*line, "-o", output])
        stamp.write_text(wanted)
    return output


class Builder:
    """Compiles harnesses: all native sources once, as an archive from which each takes what it calls."""

    def __init__(self, targets: Sequence[Target]) -> None:
        self.includes = [d for pattern in _INCLUDES for d in sorted(ROOT.glob(pattern))]
        sources = [s for d in _NATIVE for s in sorted(ROOT.glob(f"{d}/*.c")) if s.name != "main.c"]
        harnesses = [HARNESSES / f"{target.name}.c" for target in targets]
        with ThreadPoolExecutor(2) as pool:
            objects = list(pool.map(lambda s: compiled(s, self.includes), sources))
            # Here, so that one that no longer compiles is heard of before the minutes of the others.
            list(pool.map(lambda s: compiled(s, self.includes), harnesses))
        self.archive = FOLDER / "libnative.a"
        self.archive.unlink(missing_ok=True)
        run(["llvm-ar-19", "rcs", self.archive, *objects])
        rust = package_prefix("fcsl_hal") / "lib" / "libfcsl_io.a"
        self.libraries = [self.archive, rust, math_library()]

    def of_machines(self, configs: Sequence[Path], folder: Path) -> list[Path]:
        """Objects of machines, whose C is put into the folder; the last one is the table that a library exports."""
        sources: list[Path] = []
        includes = [folder, *include_dirs()]
        for compilation in emit(configs, folder):
            sources += [*(folder / name for name in compilation.c_names), *compilation.target.sources]
            includes += compilation.target.include
        return [compiled(s, includes, ["-Wno-unused"]) for s in [*sources, folder / "fcsl_machines.c"]]

    def machines(self, target: Target) -> list[Path]:
        """Objects that define fcsl_machines."""
        if target.machines == "fixture":
            test, folder = ROOT / "fcsl_runtime/fcsl_runtime/test", FOLDER / "fixture"
            machine, _ = self.of_machines([test / "fixture/fixture.json"], folder)
            return [machine, compiled(test / "fixture_machine.c", [folder, *self.includes])]
        return self.of_machines(list(SMALL_EXAMPLES.values()), FOLDER / "examples") if target.machines else []

    def plugin(self, source: Path) -> list[Path]:
        """Objects of a library that a harness loads: a machine, or a model in C."""
        if source.suffix == ".json":
            return self.of_machines([source], FOLDER / source.stem)
        return [compiled(source, self.includes)]

    def program(self, target: Target, defect: Defect | None = None) -> Path:
        """The harness, with the seeded defect if there is one. Raises CheckFailed."""
        folder = FOLDER / target.name
        includes = list(self.includes)
        first: list[Path] = []
        if defect is not None:
            patched = patch(defect, folder / "defect")
            includes.insert(0, patched.parent)
            if not included(target, patched.name):
                first.append(compiled(patched, [*includes, (ROOT / defect.source).parent]))
        harness = compiled(HARNESSES / f"{target.name}.c", includes)
        output = folder / ("defect/program" if defect is not None else "program")
        parts = [harness, *first, *self.machines(target), *self.libraries]
        for plugin in target.plugins:
            source = ROOT / plugin
            linked(folder / f"{source.stem}.so", self.plugin(source), ["-shared"])
        return linked(output, parts, ["-fsanitize=fuzzer", "-lm", "-ldl", "-lpthread"])


def included(target: Target, source: str) -> bool:
    """Whether the harness includes this source for its static functions."""
    return f'#include "{source}"' in (HARNESSES / f"{target.name}.c").read_text()


def patch(defect: Defect, folder: Path) -> Path:
    """The source with the defect, in `folder`. Raises CheckFailed when it no longer says what is to be replaced."""
    source = ROOT / defect.source
    text = source.read_text()
    if text.count(defect.text) != 1:
        raise CheckFailed(f"{defect.source} does not hold `{defect.text}` once: seed another defect in fuzz/targets.py")
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.[ch]"):  # of a defect that was seeded elsewhere once
        old.unlink()
    (folder / source.name).write_text(text.replace(defect.text, defect.instead))
    return folder / source.name


@dataclass
class Run:
    """What libFuzzer told. `crash` is the reproducer; the figures are of the last line that gave them."""

    executions: int = 0
    seconds: float = 0.0
    features: int = 0
    corpus: int = 0
    crash: Path | None = None
    reason: str = ""
    text: str = field(default="", repr=False)


def fuzz(target: Target, program: Path, inputs: int, seconds: int, seeds: Path, scratch: Path) -> Run:
    """Runs the harness on so many inputs, copies of the seeds first, for so many seconds at most (0: no bound).

    What it finds new is left in `scratch`. libFuzzer's own seed is fixed: a number of inputs gives the same inputs again.
    """
    shutil.rmtree(scratch, ignore_errors=True)
    (scratch / "corpus").mkdir(parents=True)
    dictionary = HARNESSES / f"{target.name}.dict"
    line = [
        str(program),
        "-seed=1",
        f"-runs={inputs or -1}",
        f"-max_total_time={seconds}",
        f"-max_len={target.longest}",
        "-timeout=10",
    ]
    line += ["-close_fd_mask=1", "-print_final_stats=1", "-rss_limit_mb=4096", f"-artifact_prefix={scratch}/"]
    line += [f"-dict={dictionary}"] if dictionary.exists() else []
    line += [str(scratch / "corpus"), *([str(seeds)] if seeds.is_dir() else [])]
    started = time.monotonic()
    done = subprocess.run(line, cwd=FOLDER / target.name, capture_output=True, text=True, errors="replace", check=False)
    result = Run(seconds=time.monotonic() - started, text=done.stderr)
    result.executions = max([0, *(int(n) for n in re.findall(r"number_of_executed_units: (\d+)", done.stderr))])
    for features, corpus in re.findall(r" ft: (\d+) corp: (\d+)", done.stderr):
        result.features, result.corpus = int(features), int(corpus)
    left = [p for p in scratch.iterdir() if p.is_file()]
    if done.returncode != 0:
        result.crash = left[0] if left else scratch
        result.reason = reason(done.stderr)
    return result


def passes(target: Target, program: Path, case: Path) -> bool:
    """Whether the harness takes this one input without a word."""
    line = [str(program), "-timeout=10", "-rss_limit_mb=4096", str(case)]
    return subprocess.run(line, cwd=FOLDER / target.name, capture_output=True, check=False).returncode == 0


def reason(text: str) -> str:
    """The line that says what happened."""
    for pattern in (r".*does not hold: .*", r".*runtime error: .*", r"SUMMARY: .*", r"ERROR: .*"):
        found = re.search(pattern, text)
        if found:
            return found[0].strip()
    return text.strip().splitlines()[-1] if text.strip() else "no word"


def check(builder: Builder, target: Target, inputs: int, seconds: int) -> tuple[Run, Run]:
    """The parser as it is, on so many inputs or for so many seconds, and with its defect. Raises CheckFailed."""
    seeds = CORPUS / target.name
    found = fuzz(target, builder.program(target), inputs, seconds, seeds, FOLDER / target.name / "found")
    if found.crash is not None:
        again = f"cd {FOLDER / target.name} && ./program {found.crash}"
        raise CheckFailed(f"{target.name}: {found.reason}\n  reproduce: {again}\n{tail(found.text)}")
    if found.executions < 100:
        raise CheckFailed(f"{target.name}: only {found.executions} inputs\n{tail(found.text)}")
    control = fuzz(
        target, builder.program(target, target.defect), CONTROL_INPUTS, 0, seeds, FOLDER / target.name / "control"
    )
    if control.crash is None or not control.crash.is_file():  # without an input it has only failed to run
        raise CheckFailed(
            f"{target.name}: the defect seeded in {target.defect.source} (`{target.defect.text}` -> "
            f"`{target.defect.instead}`) was not found in {CONTROL_INPUTS} inputs: the harness does not reach it"
        )
    if not passes(target, builder.program(target), control.crash):
        raise CheckFailed(
            f"{target.name}: what was found with the seeded defect fails without it, too: {control.reason}\n"
            f"  reproduce: cd {FOLDER / target.name} && ./program {control.crash}"
        )
    rate = found.executions / max(found.seconds, 0.001)
    print(
        f"{target.name:16} {found.executions:9} inputs, {rate:7.0f}/s, {found.features:5} features; "
        f"its defect after {control.seconds:.1f} s: {control.reason[:90]}",
        flush=True,
    )
    return found, control


def tail(text: str) -> str:
    return "\n".join(f"  {line}" for line in text.splitlines()[-40:])


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=int, help="search each parser for so long (default: as FCSL_EFFORT says)")
    parser.add_argument(
        "--only", action="append", choices=[t.name for t in TARGETS], help="this parser; may be given again"
    )
    at_once = min(2, len(os.sched_getaffinity(0)))
    parser.add_argument("--jobs", type=int, default=at_once, help=f"parsers at a time (default {at_once})")
    options = parser.parse_args()
    chosen = [t for t in TARGETS if not options.only or t.name in options.only]
    if options.seconds is not None:
        chosen = [replace(t, seconds=options.seconds) for t in chosen]
    searched = EFFORT == "full" or options.seconds is not None
    targets = sorted(chosen, key=lambda t: -t.seconds)  # at the end no core waits for a long one
    started = time.monotonic()
    try:
        print("compiling ...", flush=True)
        builder = Builder(targets)
        built = time.monotonic() - started
        with ThreadPoolExecutor(options.jobs) as pool:
            results = list(
                pool.map(
                    lambda t: check(builder, t, 0 if searched else t.inputs, t.seconds if searched else 0), targets
                )
            )
    except CheckFailed as error:
        print(f"fuzz: {error}", file=sys.stderr)
        return 1
    report(targets, results, built)
    return 0


def report(targets: Sequence[Target], results: Sequence[tuple[Run, Run]], built: float) -> None:
    rows = []
    print(
        f"\n{'parser':16} {'bytes come from':26} {'s':>5} {'inputs':>9} {'per s':>7} {'features':>8} {'defect found':>12}"
    )
    for target, (found, control) in zip(targets, results, strict=True):
        rate = round(found.executions / max(found.seconds, 0.001))
        print(
            f"{target.name:16} {target.takes:26} {found.seconds:5.0f} {found.executions:9} {rate:7} {found.features:8} "
            f"{control.seconds:10.1f} s"
        )
        rows.append(
            {
                "parser": target.name,
                "what": target.what,
                "from": target.takes,
                "seconds": round(found.seconds, 1),
                "inputs": found.executions,
                "inputs_per_s": rate,
                "features": found.features,
                "defect": target.defect.source,
                "defect_found_s": round(control.seconds, 1),
                "defect_reported_as": control.reason,
            }
        )
    total = sum(found.executions for found, _ in results)
    seconds = round(sum(found.seconds for found, _ in results))
    print(f"{len(rows)} parsers, {seconds} s in all, {total} inputs, no crash; compiled in {built:.0f} s")
    if len(rows) == len(TARGETS):
        write_facts("fuzz", {"seconds": seconds, "inputs": total, "parsers": rows})


if __name__ == "__main__":
    sys.exit(main())
