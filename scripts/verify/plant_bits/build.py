# SPDX-License-Identifier: Apache-2.0
"""How the simulator, models and a machine become a program and libraries on a target of the check `plant_bits`."""

from __future__ import annotations

import shutil
import threading
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.base.files import digest
from fcsl_compiler.driver.toolchain import include_dirs, math_library

from ..bits.targets import BASE, Target, math_objects
from ..shared.cases import EXAMPLES, OUT, ROOT, Case, emit_case, run

HERE = Path(__file__).resolve().parent
FOLDER = OUT / "plant_bits"
SIMULATOR = ROOT / "fcsl_sim" / "src"
_RUNTIME, _HAL = ROOT / "fcsl_runtime/fcsl_runtime/src", ROOT / "fcsl_hal/src"
#: Files of the simulator that move values to others, and compute none.
_MOVERS = {
    "crash_handler",
    "describe_model",
    "lockstep",
    "observers",
    "publish",
    "ros_graph",
    "simulation_topics",
    "telemetry",
    "tick_pacing",
    "variable_server",
}
#: The rest of what a flight calls: hosting a machine, and messages of channels. Not under test. Recording, sockets and the bus are
#: left out: in their place are functions that end the program, but for those that close nothing.
_CARRIERS = (
    *(_RUNTIME / folder for folder in ("run", "machine", "base", "expression", "history", "messages")),
    *(_HAL / "codec", _HAL / "link/crc16.c", _HAL / "hal/fcsl_hw.c", _HAL / "guard/gate.c"),
    *(_HAL / "named_values/payload.c", _HAL / "base/plan_text.c"),
)
_INCLUDES = (
    *(ROOT / f"{package}/include" for package in ("fcsl_hal", "fcsl_runtime/fcsl_runtime", "fcsl_sim")),
    *(SIMULATOR, *sorted(SIMULATOR.glob("*/")), _RUNTIME, _RUNTIME / "run", _HAL),
)
_STUB = """void {name}(const void *of);
void {name}(const void *of)
{{
    if ({ends} || of != NULL) {{
        (void)fputs("plant: {name} is left out here\\n", stderr);
        abort();
    }}
}}
"""
#: Models of the library that the flights have not.
_OTHERS = ("serial_link", "earth_round", "earth_wgs84", "rigid_body_geodetic")
#: By name: source, and the flags that select what is in it.
MODELS = {
    "lander_plant": (ROOT / "examples/lander/sim/lander_plant.c", ()),
    **{path.stem: (path, ()) for path in sorted((ROOT / "fcsl_sim/models").glob("*.c")) if path.stem not in _OTHERS},
    "ball": (ROOT / "fcsl_sim/test/models/ball.c", ()),
    "kepler": (ROOT / "fcsl_sim/test/models/problem.c", ("-DPROBLEM=1",)),
    "pleiades": (ROOT / "fcsl_sim/test/models/problem.c", ("-DPROBLEM=3",)),
}
MACHINE = "lander_control"


@dataclass(frozen=True)
class Built:
    """What a target made: the program, and the libraries that plans name."""

    target: Target
    program: Path
    libraries: dict[str, Path]


def _compile(target: Target, flags: Sequence[str], source: Path, includes: Sequence[Path]) -> Path:
    """An object; one that was made of the same file by the same line before is used again."""
    folders = [f"{'-I' if d.name == 'include' else '-iquote'}{d}" for d in includes]
    line = [*target.compiler, *BASE, *flags, *folders, "-c", str(source)]
    made = FOLDER / "objects" / f"{digest(*line)[:16]}-{source.stem}.o"
    if not made.exists():
        made.parent.mkdir(parents=True, exist_ok=True)
        part = made.with_suffix(f".{threading.get_ident()}.part")  # two targets may need one object at once
        run([*line, "-o", part])
        part.replace(made)
    return made


class Builder:
    """Keeps what targets of one processor share: fcsl_math and the carriers."""

    def __init__(self, targets: Sequence[Target], pool: ThreadPoolExecutor) -> None:
        shutil.rmtree(FOLDER, ignore_errors=True)
        self.machine: Case = emit_case(EXAMPLES[MACHINE], FOLDER / "c")
        self.includes = [*_INCLUDES, *include_dirs()]
        first = {self._key(t): t for t in reversed(targets)}  # of each processor
        self._shared = {key: pool.submit(self._make_shared, t) for key, t in first.items()}

    @staticmethod
    def _key(target: Target) -> str:
        return target.runner[0] if target.runner else "native"

    def _make_shared(self, target: Target) -> list[Path]:
        sources = [s for p in _CARRIERS for s in (sorted(p.glob("*.c")) if p.is_dir() else [p])]
        sources += [HERE / "plant.c", *(s for s in sorted(SIMULATOR.glob("*/*.c")) if s.stem in _MOVERS)]
        flags = ("-O1", "-w")
        objects = [_compile(target, flags, s, self.includes) for s in sources]
        if not target.own_math:
            return [*objects, math_library()]
        archive = FOLDER / self._key(target) / "libmath.a"
        archive.parent.mkdir()
        run(["llvm-ar-19", "rcs", archive, *math_objects(target)])
        return [*objects, archive]

    def build(self, target: Target, patched: Path | None = None) -> Built:
        """The program of a target; `patched` stands in for the simulator's file of its name. Raises CheckFailed."""
        folder = FOLDER / target.name.replace(" ", "_").replace(":", "")
        folder.mkdir()
        sources = [s for s in sorted(SIMULATOR.glob("*/*.c")) if s.stem not in _MOVERS]
        sources = [patched if patched is not None and s.name == patched.name else s for s in sources]
        core = [_compile(target, target.flags, s, self.includes) for s in sources]
        shared = self._shared[self._key(target)].result()
        libraries = {}
        for name, (source, flags) in MODELS.items():
            model = _compile(target, (*target.flags, *flags), source, self.includes)
            libraries[name] = self._library(target, [model], shared[-1], folder / f"{name}.so")
        case = self.machine
        machine = [_compile(target, target.flags, s, case.includes) for s in (*case.sources, *case.externs)]
        libraries[MACHINE] = self._library(target, machine, shared[-1], folder / f"{MACHINE}.so")
        program = folder / "plant"
        stubs = self._stubs(target, [*core, *shared[:-1]], folder / "stubs.c")
        run([*target.compiler, *target.flags, *core, stubs, *shared, "-lm", "-ldl", "-lpthread", "-o", program])
        return Built(target, program, libraries)

    @staticmethod
    def _stubs(target: Target, objects: Sequence[Path], source: Path) -> Path:
        """An object that defines what these leave undefined of FCSL."""
        names: dict[bool, set[str]] = {}
        for line in run(["llvm-nm-19", "--no-sort", *objects]).splitlines():
            words = line.split()
            if len(words) >= 2 and words[-1].startswith("fcsl_"):
                names.setdefault(words[-2] == "U", set()).add(words[-1])
        missing = sorted(names[True] - names[False])
        text = [_STUB.format(name=n, ends=int(not n.endswith(("_close", "_free")))) for n in missing]
        source.write_text("\n".join(["#include <stdio.h>\n#include <stdlib.h>\n", *text]))
        return _compile(target, ("-O1",), source, [])

    @staticmethod
    def _library(target: Target, objects: Sequence[Path], math: Path, made: Path) -> Path:
        run([*target.compiler, *target.flags, "-shared", *objects, math, "-lm", "-o", made])
        return made
