#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes and checks the table of what a call of fcsl_math, libm and libc costs, in instructions.

A function of fcsl_math has the bound that its machine code gives (as a machine's own does), or, where a loop of it searches
data, twice the most that was ever counted; functions of libm always the latter. `make verify` counts random and special
arguments and demands that none takes more than the table says.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path

from cases import ROOT, SOURCES, CheckFailed, compile_c, run

from fcsl_compiler.build_report import instruction_counts
from fcsl_compiler.build_report.bound import Bounder
from fcsl_compiler.build_report.instruction_table import foreign_bound
from fcsl_compiler.build_report.objects import read_object
from fcsl_compiler.build_report.paths import Unbounded
from fcsl_compiler.toolchain import compiler, include_dirs, math_library

sys.path.insert(0, str(ROOT / "fcsl_compiler" / "test"))
from fcsl_test_points import ONE_ARGUMENT, TWO_ARGUMENTS, points  # type: ignore[import-not-found]  # noqa: E402

_TABLE = Path(instruction_counts.__file__)
#: Of libm, as the generated code calls them; those of fcsl_math alone are below.
LIBM_ONE, LIBM_TWO = ("floor", "ceil", "trunc", "round", "roundeven", "rint", "nearbyint"), ("fmod", "copysign")
#: What fcsl_math calls, for its own bounds: glibc's versions for processors with FMA and SSE4.1, and its floating-point flags.
_INSIDE = dict.fromkeys(("fma", "fmaf"), 8) | dict.fromkeys(("fmin", "fmax", "fminf", "fmaxf"), 32)
_INSIDE |= dict.fromkeys(("nanf", "fegetround", "fetestexcept", "feclearexcept", "fegetexceptflag"), 40)
_INSIDE |= dict.fromkeys(("feraiseexcept", "fesetexceptflag", "feholdexcept", "feupdateenv"), 60)
#: Remainders that take long (each bit of the quotient is a turn of a loop), zeros, halves and limits.
_HARD_PAIRS = [
    (1.7e308, 5e-324),
    (1.7976931348623157e308, 2.3e-308),
    (1e308, 3e-308),
    (5.5, 0.0),
    (-0.0, 3.0),
    (7.25, -2.0),
]
_HARD = [0.0, -0.0, 0.5, -1.5, 2.5, 1e15 + 0.5, 4503599627370496.0, 1e300, 5e-324, 1.7e308]
SIZES = [
    *range(0, 130),
    200,
    255,
    256,
    257,
    500,
    511,
    512,
    1000,
    1024,
    2000,
    2047,
    2049,
    4000,
    4096,
    8000,
    20000,
    60000,
]


def arguments(count: int) -> dict[str, list[tuple[float, float]]]:
    """About `count` arguments for every function of the table, and the special ones of each."""
    found: dict[str, list[tuple[float, float]]] = {}
    for name in (*ONE_ARGUMENT, *TWO_ARGUMENTS):
        for single in (False, True):
            columns = [c.tolist() for c in points(name, count, single=single)]
            pairs = list(zip(columns[0], columns[1] if len(columns) > 1 else [0.0] * len(columns[0]), strict=True))
            found[f"cr_{name}{'f' if single else ''}"] = [*_thinned(pairs, count), *_worst(pairs)]
    for name in LIBM_ONE:
        found |= {name + s: [(x, 0.0) for x in _HARD] for s in ("", "f")}
    for name in LIBM_TWO:
        found |= {name: _HARD_PAIRS, name + "f": [(3.4e38, 1e-45), (1e38, 3e-38), (7.25, -2.0), (5.5, 0.0)]}
    return found


def _thinned(pairs: list[tuple[float, float]], count: int) -> list[tuple[float, float]]:
    return pairs[:: max(1, len(pairs) // count)]


def _worst(pairs: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """The hardest stand together at one end of the list, wherever that is."""
    return [*pairs[:40], *pairs[-40:]]


def counter(folder: Path) -> Path:
    """The program that counts."""
    program = folder / "stepped_math"
    flags = ["-std=gnu11", "-O2", "-fno-builtin", "-Wl,-z,now"]
    includes = [SOURCES, *include_dirs()]
    compile_c(compiler(), flags, [SOURCES / "stepped_math.c", SOURCES / "stepped.c"], includes, program)
    return program


def count(program: Path, calls: Iterable[tuple[str, float, float]]) -> list[int]:
    """Instructions of every call."""
    lines = "".join(f"{name} {x!r} {y!r}\n" for name, x, y in calls)
    done = subprocess.run([str(program)], input=lines, capture_output=True, text=True, check=False, timeout=1200)
    if done.returncode != 0:
        raise CheckFailed(f"{program.name}: exit status {done.returncode}\n{done.stderr}")
    return [int(line) for line in done.stdout.split()]


def most_counted(program: Path, args: dict[str, list[tuple[float, float]]]) -> dict[str, int]:
    """The most instructions that each function took."""
    calls = [(name, x, y) for name, pairs in args.items() for x, y in pairs]
    most: dict[str, int] = {}
    for (name, _, _), n in zip(calls, count(program, calls), strict=True):
        most[name] = max(most.get(name, 0), n)
    return most


def check_table(folder: Path, number: int) -> dict[str, object]:
    """Raises CheckFailed when a call takes more than the table says, or when the check would not notice that."""
    program = counter(folder)
    args = arguments(number)
    most = most_counted(program, args)
    for name, n in most.items():
        if n > foreign_bound(name, None):
            raise CheckFailed(f"`{name}` took {n} instructions, the table says {foreign_bound(name, None)}")
    tight = max(n / foreign_bound(name, None) for name, n in most.items())
    if tight < 0.4:
        raise CheckFailed("control: no function comes near its entry, so the counts cannot be what they should be")
    sizes = [(name, float(n), 0.0) for name in ("memcpy", "memmove", "memset") for n in SIZES]
    for (name, size, _), taken in zip(sizes, count(program, sizes), strict=True):
        if taken > foreign_bound(name, int(size)):
            raise CheckFailed(
                f"`{name}` of {size:.0f} bytes took {taken} instructions, the table says {foreign_bound(name, int(size))}"
            )
    return {
        "functions": len(most),
        "calls": sum(map(len, args.values())) + len(sizes),
        "nearest to its entry": round(tight, 3),
    }


def write_table(folder: Path, number: int) -> None:
    """Counts, bounds, writes instruction_counts.py."""
    program = counter(folder)
    most = most_counted(program, arguments(number))
    instruction_counts.COUNTS.update(_INSIDE)
    libm = {name: 2 * n for name, n in most.items() if not name.startswith("cr_")}
    instruction_counts.COUNTS.update(libm)
    bounds = static_bounds(folder)
    rows = dict(libm)
    for name, n in most.items():
        if name.startswith("cr_"):
            rows[name] = bounds.get(name, 2 * n)
            if rows[name] < n:
                raise CheckFailed(f"`{name}`: {n} instructions counted, bound {rows[name]}")
    lines = [f'    "{n}": {rows[n]},{"" if n in bounds else "  # counted"}' for n in sorted(rows)]
    _TABLE.write_text(
        "# SPDX-License-Identifier: Apache-2.0\n"
        '"""Written by scripts/verify/instruction_table.py --write: the most instructions of one call, libm\'s included.\n\n'
        "x86-64 with FMA and SSE4.1, gcc 12, glibc 2.36. From the machine code, but for lines marked `counted`: twice the most\n"
        'that was counted.\n"""\n\nCOUNTS: dict[str, int] = {\n' + "\n".join(lines) + "\n}\n"
    )


def static_bounds(folder: Path) -> dict[str, int]:
    """From the machine code of fcsl_math, of the functions whose loops end on what is known."""
    run(["ar", "x", "--output", folder, math_library()])
    found: dict[str, int] = {}
    for path in sorted(folder.glob("*.o")):
        code = read_object(path)
        bounder = Bounder(code)
        for name in code.functions:
            if name.startswith("cr_") and "." not in name:
                try:
                    found[name] = bounder.of(name).instructions
                except Unbounded as error:
                    print(f"{name}: {error}", flush=True)
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", action="store_true", help="make the table anew (minutes)")
    parser.add_argument("--points", type=int, default=30, help="arguments per function besides the special ones")
    options = parser.parse_args()
    try:
        with tempfile.TemporaryDirectory(prefix="fcsl-table-") as folder:
            if options.write:
                write_table(Path(folder), options.points)
            else:
                print(check_table(Path(folder), options.points))
    except CheckFailed as error:
        print(f"instruction_table: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
