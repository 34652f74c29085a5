# SPDX-License-Identifier: Apache-2.0
"""The simulator has the same bits everywhere: a SHA-256 over all values at all ticks, whoever compiles it, wherever it runs.

    python3 scripts/verify plant_bits [--all]

Simulator, models and the lander's controller are built for each target and fly: the lander with noisy sensors; an aircraft of
nearly every model of the library; bouncing balls, whose events end steps; Kepler's orbit and the Pleiades, with each integrator. Each flight is flown twice in one process, which must
not differ either. The first difference is named by tick and value. Then the controls: builds that must be found different.
"""

from __future__ import annotations

import argparse
import hashlib
import subprocess
import sys
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path

from ..bits.targets import AARCH64, FAST_MATH, REFERENCE, Target, cross, native, with_flags
from ..shared.cases import CheckFailed, write_facts
from ..shared.effort import scaled
from .build import FOLDER, SIMULATOR, Builder, Built
from .plans import PLANS, plan_text


def clang_cross(machine: str) -> Target:
    """Of another processor by clang; headers and libraries are those of the cross gcc."""
    of_gcc = cross(machine)
    compiler = ("clang-19", f"--target={machine}-linux-gnu")
    return replace(of_gcc, name=f"{machine} clang-19 -O3", compiler=compiler)


TARGETS = [
    *native("gcc", ("-O0", "-O3")),
    *native("clang-19", ("-O0", "-O3")),
    *(cross(machine, (level,)) for machine in ("aarch64", "riscv64") for level in ("-O0", "-O3")),
    *(clang_cross(machine) for machine in ("aarch64", "riscv64")),
]
#: What `--all` adds.
MORE = [*native("gcc", ("-O2", "-Os", "-O3 -march=native")), *native("clang-19", ("-O2", "-O3 -march=native"))]
_WORD_BYTES = 8
_TICKS_MIN = 100
_RUN_TIMEOUT_S = 600.0
#: Where the loader of another processor finds its own libraries.
_SYSROOTS = {"qemu-aarch64-static": "/usr/aarch64-linux-gnu", "qemu-riscv64-static": "/usr/riscv64-linux-gnu"}


@dataclass(frozen=True)
class Defect:
    """A text of the simulator that is changed: what must be found."""

    name: str
    file: str
    text: str
    instead: str


#: The last bit of one constant; and numbers that depend on what the process has drawn before.
DEFECTS = (
    Defect("control: last bit of one constant", "integrators/rk45.c", "44.0 / 45.0", "0x1.f49f49f49f49ep-1"),
    Defect(
        "control: noise remembers the run before",
        "models/noise.c",
        "const uint64_t number = noise->streams[stream].drawn++",
        "static uint64_t drawn;\n    const uint64_t number = drawn++",
    ),
)


def command(built: Built, *arguments: str) -> list[str]:
    """The program's command line, behind the emulator of its processor."""
    runner = [w for e in built.target.runner for w in (e, "-L", _SYSROOTS[e])]
    return [*runner, str(built.program), *arguments]


def output(built: Built, *arguments: str) -> tuple[bytes, str]:
    """What it prints, and what on standard error. Raises CheckFailed."""
    line = command(built, *arguments)
    done = subprocess.run(line, capture_output=True, timeout=_RUN_TIMEOUT_S, check=False)
    words = done.stderr.decode(errors="replace")
    if done.returncode != 0:
        raise CheckFailed(f"{built.target.name}: {' '.join(line)}: exit status {done.returncode}\n{words[-2000:]}")
    return done.stdout, words


def write_plan(built: Built, name: str) -> str:
    """A plan that names the target's libraries."""
    path = built.program.parent / f"{name}.plan"
    path.write_text(plan_text(name, built.libraries))
    return str(path)


def fly(built: Built, name: str) -> list[bytes]:
    """All values at all ticks, of each of two runs. Raises CheckFailed."""
    values, counts = output(built, "values", write_plan(built, name), "2")
    ticks = [int(n) for n in counts.split()]
    row = len(values) // sum(ticks)
    if len(ticks) != 2 or min(ticks) < _TICKS_MIN or len(values) != row * sum(ticks):
        raise CheckFailed(f"{built.target.name}: {name}: {len(values)} bytes of {ticks} ticks")
    return [values[: ticks[0] * row], values[ticks[0] * row :]]


def first_difference(built: Built, name: str, there: bytes, here: bytes) -> str:
    """Tick and value where two flights part."""
    names = output(built, "names", write_plan(built, name))[0].decode().split()
    for at in range(0, min(len(there), len(here)), _WORD_BYTES):
        one, other = there[at : at + _WORD_BYTES], here[at : at + _WORD_BYTES]
        if one != other:
            tick, value = divmod(at // _WORD_BYTES, len(names))
            return f"{name}, tick {tick}: {names[value]} is {one[::-1].hex()} there and {other[::-1].hex()} here"
    return f"{name}: {len(there)} bytes there and {len(here)} here"


def measure(builder: Builder, target: Target, patched: Path | None = None) -> tuple[Built, dict[str, list[bytes]]]:
    """Builds, and flies every plan twice."""
    built = builder.build(target, patched)
    return built, {name: fly(built, name) for name in PLANS}


def differences(built: Built, flights: dict[str, list[bytes]], wanted: dict[str, bytes]) -> dict[str, str]:
    """By flight the first difference to the reference, or between two runs in a row."""
    found = {}
    for name, (first, second) in flights.items():
        if first != second:
            found[name] = f"twice in a row: {first_difference(built, name, first, second)}"
        elif first != wanted[name]:
            found[name] = first_difference(built, name, wanted[name], first)
    return found


def seeded(defect: Defect) -> Path:
    """The simulator's file with the defect. Raises CheckFailed when there is nothing to change."""
    text = (SIMULATOR / defect.file).read_text()
    if text.count(defect.text) != 1:
        raise CheckFailed(f"{defect.file} does not hold `{defect.text}` once; the control needs another text")
    changed = FOLDER / "defects" / defect.name.split(": ")[1].replace(" ", "_") / defect.file
    changed.parent.mkdir(parents=True, exist_ok=True)
    changed.write_text(text.replace(defect.text, defect.instead))
    return changed


def control_builds() -> list[tuple[Target, Path | None]]:
    return [
        (with_flags(AARCH64, "control: contraction on aarch64", "-ffp-contract=fast"), None),
        (with_flags(REFERENCE, "control: -ffast-math", *FAST_MATH), None),
        *((with_flags(REFERENCE, d.name), seeded(d)) for d in DEFECTS),
    ]


def check(targets: Sequence[Target]) -> None:
    """Raises CheckFailed, DiagnosticError, ToolchainError."""
    with ThreadPoolExecutor(2) as pool, ThreadPoolExecutor(2) as shared:
        builder = Builder(targets, shared)
        started = [pool.submit(measure, builder, t) for t in targets]
        controls = [(t, pool.submit(measure, builder, t, patched)) for t, patched in control_builds()]
        wanted: dict[str, bytes] = {}
        rows, seen = [], {}
        for target, future in zip(targets, started, strict=True):
            built, flights = future.result()
            wanted = wanted or {name: runs[0] for name, runs in flights.items()}
            found = differences(built, flights, wanted)
            for first in found.values():
                raise CheckFailed(f"{target.name}: {first}\n  there: {targets[0].line}\n  here:  {target.line}")
            print(f"plant_bits: {target.name}: equal", flush=True)
            rows.append({"target": target.name, "flags": target.line})
        for target, control in controls:
            built, flights = control.result()
            found = differences(built, flights, wanted)
            if not found:
                raise CheckFailed(f"{target.name}: not found, and so this check finds nothing: {target.line}")
            first = next(iter(found.values()))
            print(f"plant_bits: {target.name}: found in {', '.join(found)}\n  {first}", flush=True)
            seen[target.name] = first
    hashes = {name: hashlib.sha256(values).hexdigest() for name, values in wanted.items()}
    for name, value in hashes.items():
        print(f"{name:<10} {len(wanted[name]) // _WORD_BYTES:>9} values  {value}")
    write_facts("plant_bits", {"flights": hashes, "targets": rows, "controls": seen})


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", default=scaled(False, True), help="more levels of optimisation")
    given = parser.parse_args()
    began = time.perf_counter()
    try:
        check(TARGETS + (MORE if given.all else []))
    except CheckFailed as error:
        print(f"plant_bits: {error}", file=sys.stderr)
        return 1
    print(f"plant_bits: done in {time.perf_counter() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
