# SPDX-License-Identifier: Apache-2.0
"""The targets of the check `bits`: how machines, fcsl_math and the stimulus become a program there, and how it is run."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from fcsl_compiler.base.files import digest
from fcsl_compiler.driver.toolchain import FLAGS, include_dirs, math_library

from ..shared.cases import OUT, ROOT, SHARED, CheckFailed, run

HERE = Path(__file__).resolve().parent
#: What there is below a program on a bare Cortex-M7.
BARE_METAL = ROOT / "fcsl_compiler" / "bare_metal"
BOARD = ROOT / "fcsl_hal" / "firmware" / "mps2-an500"
MATH = ROOT / "fcsl_compiler" / "math"
#: The project's own flags but for the level of optimisation.
BASE = tuple(f for f in FLAGS if not f.startswith("-O"))
#: As fcsl_compiler/math/CMakeLists.txt compiles CORE-MATH.
_MATH_FLAGS = ("-std=gnu11", "-O2", "-ffp-contract=off", "-fno-math-errno", "-w")
_RUN_TIMEOUT_S = 900.0


@dataclass(frozen=True)
class Target:
    """`flags` compile the machines; `own_math`: fcsl_math is compiled by this compiler, too; `runner` begins the command line."""

    name: str
    compiler: tuple[str, ...]
    flags: tuple[str, ...]
    own_math: bool = False
    link: tuple[str, ...] = ()
    runner: tuple[str, ...] = ()
    bare: bool = False
    backend: str = "c"

    @property
    def line(self) -> str:
        return " ".join(
            [*(["fcslc --backend nim,"] if self.backend == "nim" else []), *self.compiler, *BASE, *self.flags]
        )


def native(compiler: str, levels: Sequence[str] = ("-O0", "-O2", "-O3", "-O3 -march=native")) -> list[Target]:
    """Of this computer, with each of these flags."""
    return [Target(f"{compiler} {level}", (compiler,), tuple(level.split())) for level in levels]


def cross(machine: str, flags: tuple[str, ...] = ("-O3",)) -> Target:
    """Of another processor, emulated."""
    compiler, emulator = f"{machine}-linux-gnu-gcc", f"qemu-{machine}-static"
    return Target(f"{machine} {' '.join(flags)}", (compiler,), flags, True, ("-static",), (emulator,))


def by_nim(target: Target) -> Target:
    """The same with the machines written by the Nim backend."""
    return replace(target, name=f"Nim, {target.name}", backend="nim")


def _cortex_m7(flags: tuple[str, ...] = ("-O3",)) -> Target:
    # Enums and 128-bit integers as CORE-MATH needs them; no position-independent code on a bare processor.
    line = "clang-19 --target=thumbv7em-none-eabihf -mcpu=cortex-m7 -fforce-enable-int128 -fshort-enums -fno-pic"
    compiler = (*line.split(), f"-I{BARE_METAL / 'include'}")
    link = ("-nostdlib", "-fuse-ld=lld-19", f"-Wl,-T,{BOARD / 'memory.ld'}")
    runner = tuple("qemu-system-arm -M mps2-an500 -display none -monitor none -serial none".split())
    return Target(f"Cortex-M7 {' '.join(flags)}", compiler, flags, True, link, runner, bare=True)


REFERENCE = Target("gcc -O3", ("gcc",), ("-O3",))
AARCH64 = cross("aarch64")
CORTEX_M7 = _cortex_m7()
TARGETS = [
    *native("gcc"),
    *native("clang-19"),
    Target("clang-19 -O3, its own fcsl_math", ("clang-19",), ("-O3",), own_math=True),
    AARCH64,
    cross("riscv64"),
    CORTEX_M7,
    *map(by_nim, (REFERENCE, Target("clang-19 -O3", ("clang-19",), ("-O3",)), AARCH64)),
]
#: What `--all` adds.
MORE = [
    Target("gcc -Os", ("gcc",), ("-Os",)),
    Target("gcc -O3 -flto", ("gcc",), ("-O3", "-flto")),
    Target("gcc -O3, its own fcsl_math", ("gcc",), ("-O3",), own_math=True),
    cross("aarch64", ("-O0",)),
    cross("riscv64", ("-O0",)),
    _cortex_m7(("-O0",)),
    _cortex_m7(("-Os",)),
]


@dataclass(frozen=True)
class Sources:
    """Machines in C: `machines` are compiled with the flags of a target, `includes` holds their headers and their externs'."""

    machines: tuple[Path, ...]
    includes: tuple[Path, ...]


def core_math() -> list[Path]:
    """The C files of fcsl_math, in the crate that Cargo.lock pins. Raises CheckFailed."""
    line = [
        "cargo",
        "metadata",
        "--locked",
        "--offline",
        "--format-version",
        "1",
        "--manifest-path",
        str(MATH / "Cargo.toml"),
    ]
    found = [p["manifest_path"] for p in json.loads(run(line))["packages"] if p["name"] == "core-math-sys"]
    source = Path(found[0]).parent / "vendor" / "src"
    listed = (MATH / "CMakeLists.txt").read_text().split("set(functions ")[1].split(")")[0].split()
    return [source / f"binary{bits}/{f}/{f}{suffix}.c" for f in listed for bits, suffix in ((64, ""), (32, "f"))]


def math_objects(target: Target) -> list[Path]:
    """fcsl_math by the target's compiler; kept in out/verify until compiler or flags change."""
    flags = [*target.compiler, *_MATH_FLAGS, "-include", str(MATH / "no_stdio.h")]
    sources = core_math()
    key = digest(run([*target.compiler, "--version"]), *flags, *map(str, sources), (MATH / "no_stdio.h").read_text())
    folder = OUT / "math" / key[:16]
    objects = [folder / f"{s.stem}.o" for s in sources]
    if not all(o.is_file() for o in objects):
        folder.mkdir(parents=True, exist_ok=True)
        for source, made in zip(sources, objects, strict=True):
            part = made.with_suffix(f".{os.getpid()}.part")  # another check may compile it at the same time
            run([*flags, "-c", str(source), "-o", str(part)])
            part.replace(made)
    return objects


def build(target: Target, sources: Sources, folder: Path, platform: Sequence[Path] = ()) -> Path:
    """The program of bits.c, or the one that `platform` holds besides start-up code. Raises CheckFailed."""
    folder.mkdir(parents=True, exist_ok=True)
    below = [BOARD / "start.c", BARE_METAL / "runtime.c"] if target.bare else [HERE / "hosted.c"]
    harness = [*(platform or [HERE / "bits.c", SHARED / "stimulus.c"]), *below]
    includes = [f"-I{d}" for d in (*sources.includes, *include_dirs(), HERE, SHARED, BOARD.parent)]
    # The flags under test compile the machines alone: what measures stays what it is.
    parts = [(target.flags, sources.machines), (("-O2",), tuple(harness))]
    objects: list[Path] = []
    for flags, files in parts:
        for file in files:
            objects.append(folder / f"{len(objects)}-{file.stem}.o")
            run([*target.compiler, *BASE, *flags, *includes, "-c", str(file), "-o", str(objects[-1])])
    math = math_objects(target) if target.own_math else [math_library()]
    libm = [] if target.bare else ["-lm"]
    program = folder / "bits"
    run([*target.compiler, *target.flags, *map(str, [*objects, *math]), *libm, *target.link, "-o", str(program)])
    return program


def run_program(target: Target, program: Path, arguments: Sequence[str]) -> list[list[str]]:
    """The words of every line it prints. Raises CheckFailed."""
    if target.bare:
        given = "".join(f",arg={a}" for a in ("bits", *arguments))
        line = [*target.runner, "-semihosting-config", f"enable=on,target=native{given}", "-kernel", str(program)]
    else:
        line = [*target.runner, str(program), *arguments]
    done = subprocess.run(line, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=_RUN_TIMEOUT_S)
    if done.returncode != 0:
        raise CheckFailed(f"{target.name}: {' '.join(line)}: exit status {done.returncode}\n{done.stdout[-2000:]}")
    return [row.split() for row in done.stdout.splitlines()]


#: Fast math, without what tells the sources of it: they refuse it (fcsl_exact_math.h).
FAST_MATH = (
    "-ffast-math",
    *(f"-U__{name}__" for name in ("FAST_MATH", "FINITE_MATH_ONLY", "ASSOCIATIVE_MATH", "RECIPROCAL_MATH")),
    "-U__NO_SIGNED_ZEROS__",
)


def with_flags(target: Target, name: str, *flags: str) -> Target:
    """The same target, its machines compiled with more flags."""
    return replace(target, name=name, flags=(*target.flags, *flags))
