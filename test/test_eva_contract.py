# SPDX-License-Identifier: Apache-2.0
"""The contract of scripts/verify/eva/math_contract.h, which EVA assumes of the math library, holds of the real one."""

import ctypes
import math
import random
import re
import struct
import subprocess
from collections.abc import Callable
from pathlib import Path

from fcsl_compiler.base.packages import package_prefix

HEADER = Path(__file__).parents[1] / "scripts/verify/eva/math_contract.h"
CONTRACT = re.findall(r"/\*@ assigns \\result \\from ([xy, ]+); \*/\n(double|float) (\w+)\((.*)\);", HEADER.read_text())
SPECIAL = (
    0.0,
    -0.0,
    5e-324,
    -5e-324,
    1.0,
    -1.0,
    0.5,
    2.0**63,
    -(2.0**63),
    1.7976931348623157e308,
    math.inf,
    -math.inf,
    math.nan,
)
POINTS = 400

OVERFLOW = r"""
#include <stdint.h>
#include <stdio.h>

static uint64_t random_bits(void)
{
    static uint64_t state = 1u;
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (state >> 32) ^ (state << 32);
}

static int fits, overflows;

#define CHECK(T, word, sign)                                                             \
    for (int n = 0; n < 20000; ++n) {                                                    \
        const T edges[] = {0, 1, (T)-1, (T)1 << (sizeof(T) * 8 - 2), low_##T, high_##T}; \
        const T a = n % 3 == 0 ? edges[n / 3 % 6] : (T)(random_bits() >> n % 64);        \
        const T b = n % 5 == 0 ? edges[n / 5 % 6] : (T)(random_bits() >> n / 64 % 64);   \
        T result = 0;                                                                    \
        const __int128 exact = (__int128)a sign (__int128)b;                             \
        if (!__builtin_##word##_overflow(a, b, &result)) {                               \
            if (result != exact) {                                                       \
                printf(#word " of " #T ": %lld, %lld", (long long)a, (long long)b);      \
                return 1;                                                                \
            }                                                                            \
            ++fits;                                                                      \
        } else {                                                                         \
            ++overflows;                                                                 \
        }                                                                                \
    }

#define low_int32_t  INT32_MIN
#define high_int32_t INT32_MAX
#define low_int64_t  INT64_MIN
#define high_int64_t INT64_MAX

int main(void)
{
    CHECK(int32_t, add, +)
    CHECK(int32_t, sub, -)
    CHECK(int32_t, mul, *)
    CHECK(int64_t, add, +)
    CHECK(int64_t, sub, -)
    CHECK(int64_t, mul, *)
    printf("%d %d", fits, overflows);
    return 0;
}
"""


def libraries() -> list[ctypes.CDLL]:
    return [ctypes.CDLL(str(package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.so")), ctypes.CDLL("libm.so.6")]


def functions() -> dict[str, tuple[Callable[..., float], type, int]]:
    """By name: the real function, its scalar type, its number of arguments."""
    own, system = libraries()
    found = {}
    for sources, c_type, name, arguments in CONTRACT:
        scalar = ctypes.c_double if c_type == "double" else ctypes.c_float
        count = len(sources.split(","))
        assert arguments == ", ".join(f"{c_type} {x}" for x in "xy"[:count]), name
        function = getattr(own if name.startswith("cr_") else system, name)
        function.argtypes, function.restype = [scalar] * count, scalar
        found[name] = (function, scalar, count)
    return found


def points(count: int, scalar: type) -> list[tuple[float, ...]]:
    """Special values, and numbers of random bits."""
    draw = random.Random(1)
    code, width = ("<d", 64) if scalar is ctypes.c_double else ("<f", 32)

    def bits() -> float:
        return float(struct.unpack(code, draw.getrandbits(width).to_bytes(width // 8, "little"))[0])

    special = [(x, *([y] if count == 2 else [])) for x in SPECIAL for y in (SPECIAL if count == 2 else (0.0,))]
    return special + [tuple(bits() for _ in range(count)) for _ in range(POINTS)]


def writable() -> dict[str, bytes]:
    """The bytes of the writable pages of the two libraries."""
    maps = re.findall(
        r"^(\w+)-(\w+) rw.. .* (/\S*(?:libfcsl_math|libm)[.]so\S*)$", Path("/proc/self/maps").read_text(), re.M
    )
    return {f"{file} {low}": ctypes.string_at(int(low, 16), int(high, 16) - int(low, 16)) for low, high, file in maps}


def value(bits: float) -> str:
    return "nan" if math.isnan(bits) else bits.hex()


def test_it_covers_what_generated_code_may_call() -> None:
    header = package_prefix("fcsl_compiler") / "include" / "fcsl" / "fcsl_math.h"
    own = set(re.findall(r"\bcr_\w+(?=\()", header.read_text()))
    named = {name for *_, name, _ in CONTRACT}
    assert own == {name for name in named if name.startswith("cr_")}
    assert len(named) == len(CONTRACT)


def test_a_result_depends_on_the_arguments_alone() -> None:
    """The same bits again, after every other call, in the other order."""
    calls = [(f, x) for f, scalar, count in functions().values() for x in points(count, scalar)]
    first = [value(f(*x)) for f, x in calls]
    second = [value(f(*x)) for f, x in reversed(calls)]
    assert first == second[::-1]


def test_nothing_but_the_result_changes() -> None:
    every = functions()
    for function, _, count in every.values():
        function(*[1.0] * count)  # the loader binds symbols at the first call
    before = writable()
    assert any("libfcsl_math" in name for name in before) and any("libm." in name for name in before)
    for function, scalar, count in every.values():
        for x in points(count, scalar):
            function(*x)
    assert writable() == before
    # The control: lgamma leaves the sign of its result in a variable of the library.
    lgamma = libraries()[1].lgamma
    lgamma.argtypes, lgamma.restype = [ctypes.c_double], ctypes.c_double
    lgamma(-0.5)
    assert writable() != before


def test_overflow_builtins_are_as_assumed(tmp_path: Path) -> None:
    """No overflow comes with the exact result: gcc's builtins against 128 bits, on edges and random numbers."""
    source = tmp_path / "overflow.c"
    source.write_text(OVERFLOW)
    subprocess.run(["cc", "-std=gnu11", "-O2", "-Wall", "-Werror", source, "-o", tmp_path / "overflow"], check=True)
    done = subprocess.run([tmp_path / "overflow"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    fits, overflows = map(int, done.stdout.split())
    assert fits > 1000 and overflows > 1000  # both cases occurred
