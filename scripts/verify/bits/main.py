# SPDX-License-Identifier: Apache-2.0
"""Same bits everywhere: one hash over all fields of every example, whoever compiles it, wherever it runs, PyTwin included.

    python3 scripts/verify bits [--all] [--ticks 10000] [--python-ticks 10000] [--seed 1]

Every machine meets the same inputs (shared/stimulus.h) on each target, and all its fields after every tick enter a chained hash
(NaNs are one value, whatever their sign and payload). Beside the examples runs shared/machines/numbers.json, which holds what they
lack: every elementary function, integers of every width, matrices, hardware. The first difference is named by tick and field.
Then the controls: builds that must be found different.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from pathlib import Path

from fcsl_compiler.driver.library import emit
from fcsl_compiler.model.choices import BACKENDS, DEFAULT_BACKEND

from ..shared.cases import EXAMPLES, NUMBERS, OUT, SMALL_EXAMPLES, CheckFailed, write_facts
from ..shared.effort import scaled
from . import python as bits_python
from .controls import SEEDED, controls
from .targets import MORE, REFERENCE, TARGETS, Sources, Target, build, run_program

MARKS = (100, 1000, 10_000, 100_000, 1_000_000)
#: PyTwin's run of numbers.json is as long as it takes to call every function often, not as the examples'.
PYTHON_NUMBERS_TICKS = 1000

#: machine → ticks → hash
Hashes = dict[str, dict[int, str]]
#: The words of printed lines.
Rows = list[list[str]]
#: For `trace` or `dump` and a number of ticks, what two sides print.
Sides = Callable[[str, int], tuple[Rows, Rows]]


def emit_machines(configs: list[Path], folder: Path, backend: str = DEFAULT_BACKEND) -> Sources:
    """All machines as C in one folder, for one program."""
    made = emit(configs, folder, backend=backend)
    externs = dict.fromkeys(source for c in made for source in c.target.sources)
    includes = dict.fromkeys(d for c in made for d in c.target.include)
    names = [name for c in made for name in c.c_names] + ["fcsl_machines.c"]
    return Sources((*(folder / n for n in names), *externs), (folder, *includes))


def marks_up_to(ticks: int) -> tuple[int, ...]:
    return tuple(sorted({m for m in MARKS if m < ticks} | {ticks}))


def folder_of(target: Target) -> Path:
    return OUT / "bits" / target.name.replace(" ", "_")


def measure(target: Target, sources: Sources, seed: int, ticks: int) -> tuple[Hashes, float]:
    """Builds and runs; hashes, and ticks a second of all machines together, stimulus and hash included."""
    program = build(target, sources, folder_of(target))
    began = time.perf_counter()
    rows = run_program(target, program, ["hash", "all", str(seed), str(ticks), *map(str, marks_up_to(ticks))])
    spent = time.perf_counter() - began
    found: Hashes = {}
    for machine, tick, value in rows:
        found.setdefault(machine, {})[int(tick)] = value
    return found, ticks * len(found) / spent


def first_row(one: list[list[str]], other: list[list[str]]) -> int:
    """Index of the first row that differs. Raises CheckFailed when none does."""
    for index, (a, b) in enumerate(zip(one, other, strict=True)):
        if a != b:
            return index
    raise CheckFailed("two runs with different hashes do not differ when they are repeated: is a run deterministic?")


def explain(machine: str, seed: int, ticks: int, both: Sides) -> str:
    """Where two runs part: tick, field and both values."""
    tick = first_row(*both("trace", ticks))
    one, other = both("dump", tick + 1)
    row = first_row(one, other)
    path, element, value = one[row]
    return f"{machine}, tick {tick}: {path}[{element}] is {value} there and {other[row][2]} here (seed {seed})"


def compiled_rows(target: Target, mode: str, machine: str, seed: int, ticks: int) -> Rows:
    """What the program of `measure` prints."""
    return run_program(target, folder_of(target) / "bits", [mode, machine, str(seed), str(ticks)])


def first_difference(target: Target, machine: str, seed: int, ticks: int) -> str:
    """Where `target` parts from the reference."""

    def both(mode: str, n: int) -> tuple[Rows, Rows]:
        return compiled_rows(REFERENCE, mode, machine, seed, n), compiled_rows(target, mode, machine, seed, n)

    return f"{explain(machine, seed, ticks, both)}\n  there: {REFERENCE.line}\n  here:  {target.line}"


def python_difference(target: Target, config: Path, seed: int, ticks: int) -> str:
    """Where PyTwin parts from `target`."""
    machine = config.stem

    def both(mode: str, n: int) -> tuple[Rows, Rows]:
        python = bits_python.trace if mode == "trace" else bits_python.dump
        return compiled_rows(target, mode, machine, seed, n), python(config, seed, n)

    return f"{explain(machine, seed, ticks, both)}\n  there: {target.line}\n  here:  CPython"


def python_runs(
    pool: ProcessPoolExecutor, seed: int, ticks: int, numbers: int
) -> dict[Path, tuple[int, Future[dict[int, str]]]]:
    """Starts PyTwin on every machine, the longest first."""
    lengths = {NUMBERS: min(numbers, ticks)} | {config: ticks for config in reversed(EXAMPLES.values())}
    ordered = sorted(lengths, key=lambda c: c != EXAMPLES["lander_control"])
    return {
        c: (lengths[c], pool.submit(bits_python.hashes, c, seed, lengths[c], marks_up_to(lengths[c]))) for c in ordered
    }


def compare_python(
    runs: dict[Path, tuple[int, Future[dict[int, str]]]], wanted: Hashes, seed: int
) -> dict[str, dict[str, object]]:
    """PyTwin's hashes against the compiled ones. Raises CheckFailed with the first difference."""
    rows: dict[str, dict[str, object]] = {}
    for config, (ticks, future) in runs.items():
        found, machine = future.result(), config.stem
        common = [n for n in found if n in wanted[machine]]
        if not common or any(found[n] != wanted[machine][n] for n in common):
            raise CheckFailed(f"PyTwin: {python_difference(REFERENCE, config, seed, ticks)}")
        rows[machine] = {"ticks": max(common), "hash": found[max(common)]}
    return rows


def table(rows: list[dict[str, object]], python: dict[str, dict[str, object]], wanted: Hashes) -> None:
    print(f"\n{'machine':<18} {'ticks':>7}  {'hash':<16}  PyTwin")
    for machine, found in wanted.items():
        last = max(found)
        print(f"{machine:<18} {last:>7}  {found[last]:>16}  equal over {python[machine]['ticks']} ticks")
    print(f"\n{'target':<34} {'ticks/s':>9}  all hashes")
    for row in rows:
        print(f"{row['target']:<34} {row['ticks_per_s']:>9,.0f}  equal")


def check(seed: int, ticks: int, python_ticks: int, targets: list[Target], python_numbers: int) -> None:
    """Raises CheckFailed, DiagnosticError, ToolchainError."""
    machines = [*EXAMPLES.values(), NUMBERS]
    by_backend = {b: emit_machines(machines, OUT / "bits" / b, b) for b in BACKENDS}
    with ProcessPoolExecutor(2) as processes, ThreadPoolExecutor(2) as threads:
        python = python_runs(processes, seed, min(python_ticks, ticks), python_numbers)
        started = [(t, threads.submit(measure, t, by_backend[t.backend], seed, ticks)) for t in targets]
        wanted: Hashes = {}
        rows: list[dict[str, object]] = []
        for target, future in started:
            found, speed = future.result()
            wanted = wanted or found
            for machine, hashes in wanted.items():
                if found.get(machine) != hashes:
                    started[[t for t, _ in started].index(REFERENCE)][1].result()
                    raise CheckFailed(f"{target.name}: {first_difference(target, machine, seed, ticks)}")
            print(f"bits: {target.name}: equal, {speed:,.0f} ticks/s", flush=True)
            rows.append({"target": target.name, "flags": target.line, "ticks_per_s": round(speed)})
        print("bits: PyTwin ...", flush=True)
        twins = compare_python(python, wanted, seed)
        # Each control is found in these.
        few = emit_machines([*SMALL_EXAMPLES.values()], OUT / "bits" / "controls")
        seen = controls(few, wanted, seed, min(ticks, 10_000), measure, first_difference, threads)
        seen["PyTwin"] = python_difference(SEEDED, EXAMPLES["lander_control"], seed, 100).splitlines()[0]
        print(f"bits: control: PyTwin and that build: {seen['PyTwin']}", flush=True)
    table(rows, twins, wanted)
    write_facts(
        "bits", {"seed": seed, "ticks": ticks, "machines": wanted, "python": twins, "targets": rows, "controls": seen}
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ticks", type=int, default=10_000, help="of every target (default 10000)")
    parser.add_argument("--python-ticks", type=int, default=10_000, help="of PyTwin, at most --ticks (default 10000)")
    parser.add_argument(
        "--python-numbers", type=int, default=PYTHON_NUMBERS_TICKS, help="of PyTwin's numbers.json (1000)"
    )
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument(
        "--all",
        action="store_true",
        default=scaled(False, True),
        help="more levels of optimisation, also on the other processors",
    )
    given = parser.parse_args()
    began = time.perf_counter()
    try:
        check(given.seed, given.ticks, given.python_ticks, TARGETS + (MORE if given.all else []), given.python_numbers)
    except CheckFailed as error:
        print(f"bits: {error}", file=sys.stderr)
        return 1
    print(f"bits: done in {time.perf_counter() - began:.0f} s")
    return 0


if __name__ == "__main__":
    sys.exit(main())
