# SPDX-License-Identifier: Apache-2.0
"""fcsl_math is correctly rounded, and calls nothing but exact functions."""

import ctypes
import math
import random
import struct
import subprocess
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import mpmath
import pytest

from fcsl_compiler.ament import package_prefix

LIBRARIES = package_prefix("fcsl_compiler") / "lib"

#: Everything that may stay undefined: functions whose result is exact (or one IEEE rounding) on every machine, access to
#: the rounding mode and flags, memory moves, and the linker's own.
ALLOWED = {
    *(f + s for f in ("fma", "fmod", "round", "roundeven", "rint", "nearbyint", "floor", "ceil") for s in ("", "f")),
    *(
        f + s
        for f in ("trunc", "fmin", "fmax", "sqrt", "ldexp", "scalbn", "copysign", "fabs", "nan")
        for s in ("", "f")
    ),
    *(
        "fegetround",
        "fesetround",
        "fegetexceptflag",
        "fesetexceptflag",
        "feclearexcept",
        "feraiseexcept",
        "fetestexcept",
    ),
    *("fegetenv", "fesetenv", "feholdexcept", "feupdateenv"),
    *("memcpy", "memmove", "memset", "memcmp"),
    "_GLOBAL_OFFSET_TABLE_",
}

ONE_ARGUMENT: dict[str, tuple[Callable[..., mpmath.mpf], float, float]] = {
    # name: (reference, least, greatest argument of the ordinary points)
    "sin": (mpmath.sin, -1e6, 1e6),
    "cos": (mpmath.cos, -1e6, 1e6),
    "tan": (mpmath.tan, -1e6, 1e6),
    "asin": (mpmath.asin, -1, 1),
    "acos": (mpmath.acos, -1, 1),
    "atan": (mpmath.atan, -1e3, 1e3),
    "sinh": (mpmath.sinh, -80, 80),
    "cosh": (mpmath.cosh, -80, 80),
    "tanh": (mpmath.tanh, -20, 20),
    "exp": (mpmath.exp, -80, 80),
    "expm1": (mpmath.expm1, -80, 80),
    "log": (mpmath.log, 0, 1e6),
    "log1p": (mpmath.log1p, -1, 1e3),
    "log2": (lambda x: mpmath.log(x) / mpmath.log(2), 0, 1e6),
    "log10": (mpmath.log10, 0, 1e6),
    "cbrt": (lambda x: mpmath.sign(x) * mpmath.cbrt(abs(x)), -1e6, 1e6),
}
TWO_ARGUMENTS: dict[str, tuple[Callable[..., mpmath.mpf], float, float]] = {
    "atan2": (mpmath.atan2, -1e3, 1e3),
    "pow": (mpmath.power, 0, 20),
    "hypot": (mpmath.hypot, -1e6, 1e6),
}
FUNCTIONS = {**ONE_ARGUMENT, **TWO_ARGUMENTS}
POINTS = 300


def to_f32(x: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", x))[0])


def nearest(value: mpmath.mpf, *, single: bool) -> float:
    """`value`, rounded once, to nearest even, to binary64 or binary32."""
    sign, mantissa, exponent, _ = value._mpf_
    exact = Fraction(mantissa) * Fraction(2) ** exponent * (-1 if sign else 1)
    bits, least = (24, -149) if single else (53, -1074)
    if exact == 0:
        return 0.0
    magnitude = abs(exact).numerator.bit_length() - abs(exact).denominator.bit_length()
    if Fraction(2) ** magnitude > abs(exact):
        magnitude -= 1
    unit = Fraction(2) ** max(magnitude - bits + 1, least)
    return float(round(exact / unit) * unit)  # Fraction rounds half to even; the product is exact


def points(name: str, arity: int, *, single: bool) -> list[tuple[float, ...]]:
    _, low, high = FUNCTIONS[name]
    source = random.Random(f"{name} {single}")
    result = []
    while len(result) < POINTS:
        arguments = tuple(
            # half of them spread evenly, half over many magnitudes down to tiny ones
            source.uniform(low, high)
            if source.random() < 0.5
            else (1 if low >= 0 else source.choice((-1, 1))) * min(1.0, abs(high)) * 2.0 ** source.uniform(-30, 0)
            for _ in range(arity)
        )
        arguments = tuple(map(to_f32, arguments)) if single else arguments
        if all(low < x < high for x in arguments):
            result.append(arguments)
    return result


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    return ctypes.CDLL(str(LIBRARIES / "libfcsl_math.so"))


@pytest.mark.parametrize("single", [False, True], ids=["binary64", "binary32"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_correctly_rounded(library: ctypes.CDLL, name: str, single: bool) -> None:
    arity = 2 if name in TWO_ARGUMENTS else 1
    function = getattr(library, f"cr_{name}" + ("f" if single else ""))
    scalar = ctypes.c_float if single else ctypes.c_double
    function.argtypes, function.restype = [scalar] * arity, scalar
    wrong = []
    with mpmath.workprec(400):
        for arguments in points(name, arity, single=single):
            expected = nearest(FUNCTIONS[name][0](*map(mpmath.mpf, arguments)), single=single)
            if function(*arguments) != expected:
                wrong.append((arguments, function(*arguments).hex(), expected.hex()))
    assert not wrong, f"{len(wrong)} of {POINTS} misrounded, first: {wrong[0]}"


def test_special_values(library: ctypes.CDLL) -> None:
    def call(name: str, *arguments: float) -> float:
        function = getattr(library, f"cr_{name}")
        function.argtypes, function.restype = [ctypes.c_double] * len(arguments), ctypes.c_double
        return float(function(*arguments))

    assert math.copysign(1, call("sin", -0.0)) == -1
    assert math.isnan(call("sin", math.inf)) and math.isnan(call("log", -1.0)) and math.isnan(call("acos", 1.5))
    assert call("log", 0.0) == -math.inf and call("exp", 1000.0) == math.inf and call("exp", -1000.0) == 0.0
    assert call("atan2", 0.0, -1.0) == math.pi and call("atan2", -0.0, -1.0) == -math.pi
    assert call("pow", 0.0, 0.0) == 1.0 and call("hypot", math.inf, math.nan) == math.inf


def symbols(path: Path, *options: str) -> list[tuple[str, str]]:
    listing = subprocess.run(["nm", *options, path], capture_output=True, text=True, check=True).stdout
    return [(words[-2], words[-1]) for line in listing.splitlines() if len(words := line.split()) >= 2]


def test_calls_only_exact_functions() -> None:
    found = symbols(LIBRARIES / "libfcsl_math.a")
    defined = {name for kind, name in found if kind not in "Uw"}
    undefined = {name for kind, name in found if kind in "Uw"} - defined
    assert undefined <= ALLOWED, f"not allowed: {sorted(undefined - ALLOWED)}"


def test_exports_every_function_and_nothing_else() -> None:
    exported = {name for kind, name in symbols(LIBRARIES / "libfcsl_math.so", "-D", "--defined-only") if kind == "T"}
    assert exported == {f"cr_{name}{suffix}" for name in FUNCTIONS for suffix in ("", "f")}
