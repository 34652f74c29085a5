# SPDX-License-Identifier: Apache-2.0
"""What a compiled machine may call: the cheap scan of every build, on the binary itself."""

from __future__ import annotations

import os
import shlex
import subprocess
from pathlib import Path

#: Functions whose result is exact, or rounded once, on every machine; rounding mode and flags; memory moves. The `cr_`
#: functions of fcsl_math are linked in. The last line is what hardened compilers put around arrays and memory moves.
ALLOWED = frozenset(
    [
        f + s
        for f in "fma fmod round roundeven rint nearbyint floor ceil trunc fmin fmax sqrt".split()
        for s in ("", "f")
    ]
    + [f + s for f in "ldexp scalbn copysign fabs nan".split() for s in ("", "f")]
    + "fegetround fesetround fegetexceptflag fesetexceptflag feclearexcept feraiseexcept fetestexcept".split()
    + "fegetenv fesetenv feholdexcept feupdateenv memcpy memmove memset memcmp".split()
    + "__stack_chk_fail __memcpy_chk __memmove_chk __memset_chk".split()
)


class SymbolError(RuntimeError):
    """The library calls what a machine may not call, or cannot be read; str() names it."""


def check_symbols(library: Path) -> None:
    """Raises SymbolError when a shared library needs a function that a machine's step may not call."""
    tool = shlex.split(os.environ.get("NM", "")) or ["nm"]
    command = [*tool, "-D", "--undefined-only", str(library)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        raise SymbolError(f"`{tool[0]}` does not run; install binutils, or set NM") from None
    if done.returncode != 0:
        raise SymbolError(f"{library}: {done.stderr.strip() or 'not a library'}")
    # Kind U is needed; weak ones are the loader's own hooks.
    rows = [line.split() for line in done.stdout.splitlines()]
    wrong = sorted({r[-1].split("@")[0] for r in rows if r and r[-2] == "U"} - ALLOWED)
    if wrong:
        why = "a step allocates nothing and calls only the math library"
        raise SymbolError(f"{library.name} would call {', '.join(wrong)}; {why}")
