#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Makes and checks the table of what a call of fcsl_math, libm and libc costs, in instructions.

A function of fcsl_math has the bound that its machine code gives (as a machine's own does), with the turns of a few loops read
from its source (loops.py); functions of libm have twice the most that was counted, which is an estimate. `make verify`
counts random, hard and special arguments and demands that none takes more than the table says.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

from fcsl_compiler.build_report import instruction_counts
from fcsl_compiler.build_report.bound import Bounder
from fcsl_compiler.build_report.instruction_counts import Entry
from fcsl_compiler.build_report.instruction_table import Price
from fcsl_compiler.build_report.instruction_table import most as most_of
from fcsl_compiler.build_report.objects import read_object
from fcsl_compiler.driver.toolchain import compiler, include_dirs, math_library

from ..shared.cases import ROOT, CheckFailed, compile_c, run
from .loops import MOST_TURNS

sys.path.insert(0, str(ROOT / "fcsl_compiler" / "test"))
from fcsl_test_points import ONE_ARGUMENT, TWO_ARGUMENTS, points  # type: ignore[import-not-found]  # noqa: E402

HERE = Path(__file__).resolve().parent
_TABLE = Path(instruction_counts.__file__)
Pairs = list[tuple[float, float]]
#: Of libm, as the generated code calls them; those of fcsl_math alone are below.
LIBM_ONE, LIBM_TWO = ("floor", "ceil", "trunc", "round", "roundeven", "rint", "nearbyint"), ("fmod", "copysign")
#: What fcsl_math calls, for its own bounds: glibc's versions for processors with FMA and SSE4.1, and its floating-point flags.
_INSIDE = dict.fromkeys(("fma", "fmaf"), 8) | dict.fromkeys(("fmin", "fmax", "fminf", "fmaxf"), 32)
_INSIDE |= dict.fromkeys(("nanf", "fegetround", "fetestexcept", "feclearexcept", "fegetexceptflag"), 40)
_INSIDE |= dict.fromkeys(("feraiseexcept", "fesetexceptflag", "feholdexcept", "feupdateenv"), 60)
_INSIDE |= {name + s: 42 if name == "round" else 8 for name in LIBM_ONE for s in ("", "f")}
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
#: Arguments whose calls go on to the last way of a function; found among many.
_SLOW: dict[str, Pairs] = {
    "cr_pow": [(4.0, 1023.5), (3.0, 33.0), (9.0, 16.5), (2.0**512, 1.998046875)],  # long loops of is_exact
    "cr_powf": [(4.0, 127.5), (3.0, 15.0), (9.0, 7.5)],
    "cr_log2": [(1.0000000000000016, 0.0)],
    "cr_log10": [(878.395777025217, 0.0), (0.9999999999999998, 0.0)],
    "cr_log1pf": [(0.02160431630909443, 0.0), (-0.02324109710752964, 0.0)],
    "cr_atan2f": [(3.443619884509978e27, 3.081298913297011e35)],
    "cr_hypotf": [(4.9226730359381907e27, 6.571739644891056e26)],
}
#: Functions whose last way none of 20 000 hard arguments took: how high their entries are is told by the code alone.
_UNSEEN = ("cr_atan2f",)
SIZES = [*range(130), 200, 255, 256, 257, 500, 511, 512, 1000, 1024, 2000, 2047, 2049, 4000, 4096, 8000, 20000, 60000]
#: A table in which every entry is one so many times too low is found wrong in that entry.
MOST_MARGIN = 4.0


def arguments(count: int) -> dict[str, Pairs]:
    """About `count` arguments for every function of the table, and the special ones of each."""
    found: dict[str, Pairs] = {}
    for name in (*ONE_ARGUMENT, *TWO_ARGUMENTS):
        for single in (False, True):
            columns = [c.tolist() for c in points(name, count, single=single)]
            pairs = list(zip(columns[0], columns[1] if len(columns) > 1 else [0.0] * len(columns[0]), strict=True))
            symbol = f"cr_{name}{'f' if single else ''}"
            found[symbol] = [*_thinned(pairs, count), *_worst(pairs), *_SLOW.get(symbol, ())]
    for name in LIBM_ONE:
        found |= {name + s: [(x, 0.0) for x in _HARD] for s in ("", "f")}
    for name in LIBM_TWO:
        found |= {name: _HARD_PAIRS, name + "f": [(3.4e38, 1e-45), (1e38, 3e-38), (7.25, -2.0), (5.5, 0.0)]}
    return found


def everyday() -> dict[str, Pairs]:
    """101 arguments between 1/64 and 8 (or 1, where there is nothing beyond) for every function, both signs where it has values there."""
    sizes = [2.0 ** (-6 + 9 * n / 100) for n in range(101)]
    found: dict[str, Pairs] = {}
    for name in (*(f"cr_{n}" for n in (*ONE_ARGUMENT, *TWO_ARGUMENTS)), *LIBM_ONE, *LIBM_TWO):
        inside = [x / 8 for x in sizes] if name in ("cr_asin", "cr_acos") else sizes
        signs = (1.0, 1.0) if name.startswith(("cr_log", "cr_pow")) else (1.0, -1.0)
        pairs = [(x * signs[n % 2], sizes[37 * n % 101] * signs[n // 2 % 2]) for n, x in enumerate(inside)]
        found |= {name: pairs, name + "f": pairs}
    return found


def _thinned(pairs: Pairs, count: int) -> Pairs:
    return pairs[:: max(1, len(pairs) // count)]


def _worst(pairs: Pairs) -> Pairs:
    """The hardest stand together at one end of the list, wherever that is."""
    return [*pairs[:40], *pairs[-40:]]


def counter(folder: Path) -> Path:
    """The program that counts."""
    program = folder / "stepped_math"
    flags = ["-std=gnu11", "-O2", "-fno-builtin", "-Wl,-z,now"]
    includes = [HERE, *include_dirs()]
    compile_c(compiler(), flags, [HERE / "stepped_math.c", HERE / "stepped.c"], includes, program)
    return program


def count(program: Path, calls: Iterable[tuple[str, float, float]]) -> list[int]:
    """Instructions of every call."""
    lines = "".join(f"{name} {x!r} {y!r}\n" for name, x, y in calls)
    done = subprocess.run([str(program)], input=lines, capture_output=True, text=True, check=False, timeout=1200)
    if done.returncode != 0:
        raise CheckFailed(f"{program.name}: exit status {done.returncode}\n{done.stderr}")
    return [int(line) for line in done.stdout.split()]


def counts(program: Path, args: Mapping[str, Pairs]) -> dict[str, list[int]]:
    """Instructions of the calls of each function, sorted."""
    calls = [(name, x, y) for name, pairs in args.items() for x, y in pairs]
    found: dict[str, list[int]] = {name: [] for name in args}
    for (name, _, _), n in zip(calls, count(program, calls), strict=True):
        found[name].append(n)
    return {name: sorted(each) for name, each in found.items()}


def too_low(counted: Mapping[str, int], entry: Callable[[str], int]) -> list[str]:
    """What calls show of a table: the functions that took more than their entries."""
    return [
        f"`{name}` took {n} instructions, the table says {entry(name)}"
        for name, n in counted.items()
        if n > entry(name)
    ]


def check_table(folder: Path, number: int) -> dict[str, object]:
    """Raises CheckFailed when a call takes more than the table says, or when the check would not notice that."""
    program = counter(folder)
    args = arguments(number)
    counted = {name: each[-1] for name, each in counts(program, args).items()}
    table = instruction_counts.COUNTS
    if wrong := too_low(counted, lambda name: table[name].most):
        raise CheckFailed("; ".join(wrong))
    sizes = [(name, float(n), 0.0) for name in ("memcpy", "memmove", "memset") for n in SIZES]
    for (name, size, _), taken in zip(sizes, count(program, sizes), strict=True):
        if taken > most_of(name, int(size)):
            raise CheckFailed(
                f"`{name}` of {size:.0f} bytes took {taken} instructions, the table says {most_of(name, int(size))}"
            )
    margins = {name: round(table[name].most / n, 2) for name, n in counted.items()}
    _control(counted, table, margins)
    worst = sorted(margins, key=lambda name: -margins[name])[:3]
    return {
        "functions": len(counted),
        "calls": sum(map(len, args.values())) + len(sizes),
        "estimates": [name for name in counted if table[name].is_estimate],
        "entry / most counted, median": sorted(margins.values())[len(margins) // 2],
        "entry / most counted, largest": {name: margins[name] for name in worst},
    }


def _control(counted: Mapping[str, int], table: Mapping[str, Entry], margins: Mapping[str, float]) -> None:
    """Two defects, in every entry but those of _UNSEEN: it forgot the slow way of its function, or is MOST_MARGIN times too low."""
    seen = [name for name in counted if name not in _UNSEEN]
    forgetful = {name: table[name].usual for name in seen if table[name].most > 2 * table[name].usual}
    found = too_low({name: counted[name] for name in forgetful}, lambda name: forgetful[name])
    if len(found) != len(forgetful):
        missed = [name for name in forgetful if counted[name] <= forgetful[name]]
        raise CheckFailed(f"control: a table that forgets the slow ways of {', '.join(missed)} passed")
    if loose := [f"{name} ({margins[name]})" for name in seen if margins[name] > MOST_MARGIN]:
        raise CheckFailed(f"control: entries {MOST_MARGIN} times too low would pass: {', '.join(loose)}")


def write_table(folder: Path, number: int) -> None:
    """Counts, bounds, writes instruction_counts.py."""
    program = counter(folder)
    most = {name: each[-1] for name, each in counts(program, arguments(number)).items()}
    usual = {name: each[len(each) * 9 // 10] for name, each in counts(program, everyday()).items()}
    bounds = static_bounds(folder)
    for name, n in most.items():
        if bounds.get(name, n) < n:
            raise CheckFailed(f"`{name}`: {n} instructions counted, bound {bounds[name]}")
    rows = [
        f'    "{name}": Entry({bounds[name]}, {usual[name]}),'
        if name in bounds
        else f'    "{name}": Entry({2 * most[name]}, {usual[name]}, is_estimate=True),'
        for name in sorted(most)
    ]
    _TABLE.write_text(_HEADER + "\n".join(rows) + "\n}\n")


_HEADER = '''# SPDX-License-Identifier: Apache-2.0
"""Written by `python3 scripts/verify instruction_table --write`: instructions of one call, libm's included.

x86-64 with FMA and SSE4.1, gcc 12, glibc 2.36.
"""

from typing import NamedTuple


class Entry(NamedTuple):
    """`most`: on the slowest way; from the machine code, but where it is an estimate: twice the most that was counted. `usual`: what nine
    of ten calls with arguments of everyday size take at most."""

    most: int
    usual: int
    is_estimate: bool = False


COUNTS: dict[str, Entry] = {
'''


def static_bounds(folder: Path) -> dict[str, int]:
    """From the machine code of fcsl_math. Raises Unbounded."""
    run(["ar", "x", "--output", folder, math_library()])
    found: dict[str, int] = {}
    price: Price = lambda name, size: _INSIDE[name]  # noqa: E731
    for path in sorted(folder.glob("*.o")):
        code = read_object(path)
        bounder = Bounder(code, price=price, turns=MOST_TURNS)
        found |= {
            name: bounder.of(name).instructions for name in code.functions if name.startswith("cr_") and "." not in name
        }
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
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
