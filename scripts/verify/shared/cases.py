# SPDX-License-Identifier: Apache-2.0
"""What the checks of `make verify` have in common: the machines they run on, as C, and where their figures go."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import include_dirs, math_library

ROOT = Path(__file__).resolve().parents[3]
OUT = ROOT / "out" / "verify"

#: Machines of examples; their externs are linked from the target `simulation`.
SMALL_EXAMPLES = {
    path.stem: path
    for path in (
        ROOT / "examples/minimal/minimal.json",
        ROOT / "examples/lander/fc/lander_control.json",
        ROOT / "examples/thermal_guard/thermal_guard.json",
        ROOT / "examples/ahrs/ahrs.json",
    )
}
#: The machine of every example.
EXAMPLES = SMALL_EXAMPLES | {
    path.stem: path
    for path in (
        ROOT / "examples/arming/arming.json",
        ROOT / "examples/glider/fc/glider.json",
        ROOT / "examples/inverted_pendulum/fc/inverted_pendulum.json",
        ROOT / "examples/quadrotor/fc/quadrotor.json",
        ROOT / "examples/rocket_landing/fc/rocket_landing.json",
        ROOT / "examples/rover/fc/rover.json",
        ROOT / "examples/satellite/fc/satellite.json",
    )
}
#: Calls every function of the math library, hardware, and the clock; integers of every width, matrices.
NUMBERS = Path(__file__).resolve().parent / "machines" / "numbers.json"
#: Holds stimulus.c and its header; other C is in the folder of its check.
SHARED = Path(__file__).resolve().parent


class CheckFailed(Exception):
    """What a check found; str() says what, and where."""


@dataclass(frozen=True)
class Case:
    """A machine as C: `sources` are its own file and the list of machines, `externs` what its externs are linked from."""

    name: str
    config: Path
    folder: Path
    sources: tuple[Path, ...]
    externs: tuple[Path, ...]
    includes: tuple[Path, ...]


def emit_case(config: Path, folder: Path) -> Case:
    """Compiles a machine to C in `folder`. Raises DiagnosticError, ToolchainError."""
    compilation = emit([config], folder)[0]
    target = compilation.target
    return Case(
        compilation.checked.name,
        config,
        folder,
        (*(folder / name for name in compilation.c_names), folder / "fcsl_machines.c"),
        target.sources,
        (folder, *include_dirs(), *target.include),
    )


def generated(folder: Path, count: int, seed: int) -> Iterator[tuple[str, Path]]:
    """(name, config) of machines from the generator of the compiler's tests, the same ones for the same seed.

    A few of those have a start() that faults, so that there is nothing to run: they are left out. So are those with
    externs, whose C notes its calls in variables of its own: what is shown here is shown of machines.
    """
    sys.path.insert(0, str(ROOT / "fcsl_compiler" / "test"))
    from fcsl_generator.campaign import generate
    from fcsl_generator.machines import cases
    from fcsl_generator.ticks import OracleMachine

    made = (case for n in itertools.count() for case in generate(cases(), 1, seed, first=n))
    running = (case for case in made if not case.program.externs and not OracleMachine(case).failed_start)
    for n, case in enumerate(itertools.islice(running, count)):
        yield f"generated{n}", case.write(folder / f"generated{n}", f"generated{n}")


def compile_c(
    compiler: Sequence[str], flags: Sequence[str], sources: Sequence[Path], includes: Sequence[Path], output: Path
) -> None:
    """A program, with fcsl_math and libm. Raises CheckFailed with the compiler's words."""
    line = [*compiler, *flags, *(f"-I{d}" for d in includes), *map(str, sources), str(math_library()), "-lm"]
    run([*line, "-o", str(output)])


def run(line: Sequence[str | Path], timeout_s: float = 600.0) -> str:
    """Standard output. Raises CheckFailed when the command does not end with 0."""
    try:
        done = subprocess.run([str(w) for w in line], capture_output=True, text=True, check=False, timeout=timeout_s)
    except subprocess.TimeoutExpired:
        raise CheckFailed(f"{' '.join(map(str, line))}: still running after {timeout_s:.0f} s") from None
    except FileNotFoundError:
        raise CheckFailed(f"`{line[0]}` is not installed; scripts/verify_tools.sh installs what is missing") from None
    if done.returncode != 0:
        raise CheckFailed(f"{' '.join(map(str, line))}: exit status {done.returncode}\n{done.stdout}{done.stderr}")
    return done.stdout


def write_facts(name: str, facts: dict[str, Any]) -> None:
    """Figures of a check, for people and for docs/internals/evidence.md: out/verify/<name>.json."""
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / f"{name}.json").write_text(json.dumps(facts, indent=2) + "\n")
