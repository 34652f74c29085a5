# SPDX-License-Identifier: Apache-2.0
"""What EVA analyses: the examples, the blocks, machines of the test generator, each with the world around it."""

from __future__ import annotations

from pathlib import Path

from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import include_dirs

from ..shared import cases
from .entry import any_externs, entry
from .run import Subject

HERE = Path(__file__).resolve().parent
#: EVA did not end within ten minutes for the glider. The others are larger.
LARGE = ("glider", "quadrotor", "rocket_landing")
NEVER_FAULTS = ("inverted_pendulum",)


def subject(config: Path, folder: Path, dead_helpers: bool = False, never_faults: bool = False) -> Subject:
    """A machine as C in `folder`, with its entry. Raises DiagnosticError, ToolchainError."""
    compilation = emit([config], folder)[0]
    machine, target = compilation.checked, compilation.target
    program = folder / f"{machine.name}_eva.c"
    program.write_text(entry(machine))
    externs = () if any_externs(machine) else target.sources
    sources = (folder / f"{machine.name}.c", program, HERE / "world.c", *externs)
    includes = (folder, *include_dirs(), *target.include)
    return Subject(machine.name, folder, sources, includes, dead_helpers, never_faults)


def examples(folder: Path) -> list[Subject]:
    chosen = {name: config for name, config in cases.EXAMPLES.items() if name not in LARGE}
    return [subject(c, folder / name, never_faults=name in NEVER_FAULTS) for name, c in chosen.items()]


def blocks(folder: Path) -> Subject:
    """A machine with every block of fcsl_blocks."""
    return subject(cases.ROOT / "fcsl_runtime/fcsl_blocks/test/every_block.json", folder / "blocks")


def generated(folder: Path, count: int, seed: int) -> list[Subject]:
    """Machines of the compiler's own test generator: the same ones for the same seed."""
    made = cases.generated(folder / "sources", count, seed)
    return [subject(config, folder / name, dead_helpers=True) for name, config in made]
