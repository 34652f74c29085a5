# SPDX-License-Identifier: Apache-2.0
"""Functions that a compiled machine or a model may call. A scan of the binary checks this in every build."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
from collections.abc import Collection, Sequence
from pathlib import Path

from .elf import Symbols, read_symbols

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


#: Functions of fcsl_math, each in place of one of the C library.
_MATH = "sin cos tan asin acos atan atan2 sinh cosh tanh exp expm1 log log1p log2 log10 pow cbrt hypot".split()
_BITS = "its bits differ between machines"
_NONE = "fcsl_math has no such function"
#: What a model writes in place of an inexact function of the C library, by its name for doubles. Compilers make some of
#: these calls: gcc sincos of sin and cos, clang exp2 of pow(2.0, x).
_INEXACT = (
    {name: f"use cr_{name}{{suffix}} of fcsl/fcsl_math.h" for name in _MATH}
    | {
        "sincos": "use cr_sin{suffix} and cr_cos{suffix} of fcsl/fcsl_math.h",
        "exp2": "use cr_pow{suffix}(2, x) of fcsl/fcsl_math.h",
        "exp10": "use cr_pow{suffix}(10, x) of fcsl/fcsl_math.h",
        "pow10": "use cr_pow{suffix}(10, x) of fcsl/fcsl_math.h",
        "asinh": f"{_NONE}; write asinh with cr_log1p{{suffix}} and sqrt{{suffix}}",
        "acosh": f"{_NONE}; write acosh with cr_log1p{{suffix}} and sqrt{{suffix}}",
        "atanh": f"{_NONE}; write atanh as 0.5 * cr_log1p{{suffix}}(2 * x / (1 - x))",
    }
    | {name: f"{_NONE}; approximate it in the model" for name in "erf erfc tgamma lgamma gamma j0 j1 y0 y1".split()}
    | {name: f"{_NONE}; approximate it in the model" for name in "jn yn lgamma_r drem scalb significand".split()}
    | {name: f"{_NONE}; write it with real numbers" for name in "cexp clog cpow csqrt csin ccos ctan cabs carg".split()}
    | {name: f"{_NONE}; write it with real numbers" for name in "casin cacos catan csinh ccosh ctanh".split()}
    | {name: f"{_NONE}; write it with real numbers" for name in "casinh cacosh catanh".split()}
)
#: Exact for double and float. A long double has other bits on other machines.
_EXACT = (
    "fma fmod remainder round roundeven rint nearbyint floor ceil trunc fmin fmax sqrt ldexp scalbn modf frexp".split()
)
_NOISE = "use the instance's own noise, context->uniform or context->gaussian"
_TIME = "use context->time_ns, or the argument t"
#: Functions whose results would not repeat: what a model uses in their place.
_UNREPEATABLE = {
    **dict.fromkeys("rand rand_r random random_r srand srandom initstate setstate".split(), _NOISE),
    **dict.fromkeys("drand48 erand48 lrand48 nrand48 mrand48 jrand48 srand48".split(), _NOISE),
    **dict.fromkeys("arc4random arc4random_buf arc4random_uniform getrandom getentropy".split(), _NOISE),
    **dict.fromkeys("time clock clock_gettime gettimeofday timespec_get ftime times getrusage".split(), _TIME),
    **dict.fromkeys("getenv secure_getenv".split(), "use a parameter"),
}
#: The same of the C++ libraries of gcc and clang, by the beginning of the symbol and its name in a source.
_UNREPEATABLE_CXX = {
    "_ZNSt3__113random_device": ("std::random_device", _NOISE),
    "_ZNSt3__16chrono12system_clock3now": ("std::chrono::system_clock::now", _TIME),
    "_ZNSt3__16chrono12steady_clock3now": ("std::chrono::steady_clock::now", _TIME),
    "_ZNSt13random_device": ("std::random_device", _NOISE),
    "_ZNSt6chrono3_V212system_clock3now": ("std::chrono::system_clock::now", _TIME),
    "_ZNSt6chrono3_V212steady_clock3now": ("std::chrono::steady_clock::now", _TIME),
}


class SymbolError(RuntimeError):
    """The library calls a function that it must not call, or cannot be read. str() gives the names."""


def check_symbols(library: Path, objects: Sequence[Path] = (), externs: Collection[str] = ()) -> list[str]:
    """Raises SymbolError if machines call anything but the allowed functions and their declared externs.

    `objects`: object files of the machines alone; without externs the library is sufficient. Returns the other
    functions that the library needs: the calls of the externs' own code, for which their author is responsible.
    """
    needed, _ = _symbols([library], dynamic=True)
    besides = needed - ALLOWED - set(externs)
    own: set[str] = set()
    if objects:
        undefined, defined = _symbols(objects, dynamic=False)
        own = undefined - defined - ALLOWED - _LINKED - set(externs)
        own = {name for name in own if not name.startswith(_LINKED_PREFIX)}
    wrong = own if externs else besides | own
    if wrong:
        why = "a step allocates nothing and calls only the math library" + (" and its externs" if externs else "")
        raise SymbolError(f"{library.name} would call {', '.join(sorted(wrong))}; {why}")
    return sorted(besides)


def check_model_symbols(library: Path) -> None:
    """Raises SymbolError if a model calls what has other results on another machine or in another run. The first line
    of its text names the functions; each has a line of its own, with what to write in its place."""
    needed, _ = _symbols([library], dynamic=True)
    # zig links its C++ library into the model.
    needed |= {name for name in _symbols([library], dynamic=False).defined if name.startswith(tuple(_UNREPEATABLE_CXX))}
    refused = list(dict.fromkeys(found for found in map(_refused_in_models, sorted(needed)) if found))
    if refused:
        lines = [f"  {name}: {fix} ({why})" for name, why, fix in refused]
        raise SymbolError("\n".join([f"it calls {', '.join(name for name, _, _ in refused)}", *lines]))


def _refused_in_models(symbol: str) -> tuple[str, str, str] | None:
    """Name, reason and replacement of a function that a model must not call; None for every other one."""
    if symbol in _UNREPEATABLE:
        return symbol, "its results do not repeat", _UNREPEATABLE[symbol]
    for beginning, (name, fix) in _UNREPEATABLE_CXX.items():
        if symbol.startswith(beginning):
            return name, "its results do not repeat", fix
    # glibc calls a function by further names: with -ffast-math __sin_finite, with vectors _ZGVbN2v_sin.
    bare = re.sub(r"^_ZGV\w+?_(\w+)$", r"\1", re.sub(r"^__(\w+)_finite$", r"\1", symbol))
    for suffix in ("", "f", "l", "f32", "f64", "f32x", "f64x", "f128"):
        name = bare.removesuffix(suffix)
        if bare.endswith(suffix) and (name in _INEXACT or (name in _EXACT and suffix in ("l", "f64x", "f128"))):
            is_float = suffix in ("f", "f32")
            fix = _INEXACT.get(name, f"use {name}").format(suffix="f" if is_float else "")
            return symbol, _BITS, fix + (", with doubles" if suffix in ("l", "f64x", "f128") else "")
    return None


def _symbols(files: Sequence[Path], dynamic: bool) -> Symbols:
    """Symbols that these files need and define: read from ELF, or asked of $NM."""
    if os.environ.get("NM"):
        return _symbols_by_nm(files, dynamic)
    found = Symbols(set(), set())
    for file in files:
        try:
            one = read_symbols(file, dynamic)
        except OSError as error:
            raise SymbolError(f"{file}: {error.strerror}") from None
        except ValueError as error:
            raise SymbolError(f"{file}: {error}") from None
        found.needed.update(one.needed)
        found.defined.update(one.defined)
    return found


def _symbols_by_nm(files: Sequence[Path], dynamic: bool) -> Symbols:
    command = [*shlex.split(os.environ["NM"]), *(["-D"] if dynamic else []), *map(str, files)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
    except (OSError, subprocess.TimeoutExpired):
        raise SymbolError(f"`{command[0]}` does not run; unset NM, which names it") from None
    if done.returncode != 0:
        raise SymbolError(f"{files[0]}: {done.stderr.strip() or 'not a library'}")
    # Rows are "[address] kind name". Kind U is undefined; weak symbols are hooks of the loader.
    rows = [r for r in (line.split() for line in done.stdout.splitlines()) if len(r) > 1]
    needed = {r[-1].split("@")[0] for r in rows if r[-2] == "U"}
    return Symbols(needed, {r[-1] for r in rows if len(r) > 2})
