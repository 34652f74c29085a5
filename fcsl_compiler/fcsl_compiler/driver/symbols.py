# SPDX-License-Identifier: Apache-2.0
"""Functions that a compiled machine may call. A scan of the binary checks this in every build."""

from __future__ import annotations

import os
import shlex
import subprocess
from collections.abc import Collection, Sequence
from pathlib import Path

#: Allowed functions: those whose result is exact or correctly rounded on every machine; rounding mode and flags; memory
#: moves. The `cr_` functions of fcsl_math are linked in. The last line is what hardened compilers insert around arrays
#: and memory moves.
ALLOWED = frozenset(
    [
        f + s
        for f in "fma fmod round roundeven rint nearbyint floor ceil trunc fmin fmax sqrt".split()
        for s in ("", "f")
    ]
    + [f + s for f in "ldexp scalbn copysign fabs".split() for s in ("", "f")]
    + "fegetround fesetround fegetexceptflag fesetexceptflag feclearexcept feraiseexcept fetestexcept".split()
    + "fegetenv fesetenv feholdexcept feupdateenv memcpy memmove memset memcmp".split()
    + "__stack_chk_fail __memcpy_chk __memmove_chk __memset_chk".split()
)


#: Further symbols that an object file may need: the math library, and symbols of position-independent code.
_LINKED_PREFIX = "cr_"
_LINKED = frozenset({"_GLOBAL_OFFSET_TABLE_"})


class SymbolError(RuntimeError):
    """The library calls a function that a machine must not call, or cannot be read. str() gives the names."""


def check_symbols(library: Path, objects: Sequence[Path] = (), externs: Collection[str] = ()) -> list[str]:
    """Raises SymbolError if machines call anything but the allowed functions and their declared externs.

    `objects`: object files of the machines alone; without externs the library is sufficient. Returns the other
    functions that the library needs: the calls of the externs' own code, for which their author is responsible.
    """
    needed, _ = _symbols(["-D", "--undefined-only"], [library])
    besides = needed - ALLOWED - set(externs)
    own: set[str] = set()
    if objects:
        undefined, defined = _symbols([], objects)
        own = undefined - defined - ALLOWED - _LINKED - set(externs)
        own = {name for name in own if not name.startswith(_LINKED_PREFIX)}
    wrong = own if externs else besides | own
    if wrong:
        why = "a step allocates nothing and calls only the math library" + (" and its externs" if externs else "")
        raise SymbolError(f"{library.name} would call {', '.join(sorted(wrong))}; {why}")
    return sorted(besides)


def _symbols(options: list[str], files: Sequence[Path]) -> tuple[set[str], set[str]]:
    """Symbols that these files need and define, from nm."""
    tool = shlex.split(os.environ.get("NM", "")) or ["nm"]
    try:
        done = subprocess.run(
            [*tool, *options, *map(str, files)], capture_output=True, text=True, timeout=60, check=False
        )
    except (OSError, subprocess.TimeoutExpired):
        raise SymbolError(f"`{tool[0]}` does not run; install binutils, or set NM") from None
    if done.returncode != 0:
        raise SymbolError(f"{files[0]}: {done.stderr.strip() or 'not a library'}")
    # Rows are "[address] kind name". Kind U is undefined; weak symbols are hooks of the loader.
    rows = [r for r in (line.split() for line in done.stdout.splitlines()) if len(r) > 1]
    needed = {r[-1].split("@")[0] for r in rows if r[-2] == "U"}
    return needed, {r[-1] for r in rows if len(r) > 2}
