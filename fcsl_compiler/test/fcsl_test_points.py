# SPDX-License-Identifier: Apache-2.0
"""Difficult arguments of elementary functions: any exponent, and values near zeros, poles, limits and exact results."""

from __future__ import annotations

import zlib
from collections.abc import Callable
from functools import cache

import mpmath
import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]

ONE_ARGUMENT = "sin cos tan asin acos atan sinh cosh tanh exp expm1 log log1p log2 log10 cbrt".split()
TWO_ARGUMENTS = ("atan2", "pow", "hypot")

#: Largest useful |x| for binary64 and binary32. Functions not listed take every finite number.
_LIMITS = {"asin": (1, 1), "acos": (1, 1), "tanh": (24, 12), "sinh": (712, 91), "cosh": (712, 91)} | {
    name: (746, 105) for name in ("exp", "expm1")
}
_POSITIVE = ("log", "log2", "log10")

#: Arguments with results closest to the midpoint between two binary64 numbers: V. Lefèvre, J.-M. Muller, "Worst cases
#: for correct rounding of the elementary functions in double precision", 2001 and 2003; CORE-MATH's own lists.
_WORST = {
    "sin": "0x1.e0000000001c2p-20 0x1.598bae9e632f6p-7 0x1.9283586503fep-5 0x1.a202b3fb84788p-4 0x1.d037cb27ee6dfp-3 "
    "0x1.fe767739d0f6dp-2 0x1.d98c4c612718dp-1 0x1.921fb54442d18p0 0x1.6756745770a51p1 0x1.6ac5b262ca1ffp849",
    "cos": "0x1.8000000000009p-23 0x1.8000000000024p-22 0x1.800000000009p-21 0x1.20000000000f3p-20 0x1.2000000000f3p-18 "
    "0x1.06b505550e6b2p-9 0x1.549ec0c0c5afap-5 0x1.16e534ee3658p-4 0x1.feb1f7920e248p-2 0x1.6b8a6273d7c21p0",
    "tan": "0x1.dffffffffff1fp-22 0x1.dfffffffffc7cp-21 0x1.67ffffffa114p-18 0x1.50486b2f87014p-5 0x1.52c39ef070cadp-4 "
    "0x1.a33f32ac5ceb5p-3 0x1.d696bfa988db9p-2 0x1.46ac372243536p-1",
    "asin": "0x1.7137449123ef6p-26 0x1.d12ed0af1a27ep-26 0x1.51c4b960778f5p-23 0x1.dfffffffff02ep-20 0x1.2bffffffc233bp-16 "
    "0x1.b3f28593cad2fp-9 0x1.9259e3708bd3ap-5 0x1.d77b117f230d6p-5 0x1.e9950730c4696p-2 0x1.d5b05a89d3e77p-1",
    "acos": "0x1.fd737be914578p-11 0x1.4182199998587p-1 0x1.e45a1c93651ecp-1 0x1.f10fc61e2c78fp-1 0x1.8bp-52 "
    "-0x1.3e827a2cd6d51p-1",
    "atan": "0x1.e000000000546p-21 0x1.22e8d75e2bc7fp-11 0x1.0dc89a3b5501p-7 0x1.0fc9f1fabe658p-5 0x1.5389e6df41979p-4 "
    "0x1.a933fe176b375p-3 0x1.0f6e5d9960397p-2 0x1.7ba49f739829fp-1",
    "sinh": "0x1.dfffffffffe3ep-20 0x1.dfffffffe3ep-18 0x1.364303e1ad8f6p-2 0x1.4169f234f23b9p-2 0x1.a3fc7e4dd47d1p-1 "
    "0x1.2f5d3b178914ap0 0x1.3359640329982p1 0x1.0a19aebb51e9p3 0x1.16369cd53bb69p4",
    "cosh": "0x1.9a5e3cbe1985ep-4 0x1.52a11832e847dp-3 0x1.03923f2b47c07p-1 0x1.104b648f113a1p0 0x1.43180ea854696p1 "
    "0x1.725811dcf6782p2 0x1.743d5609348acp4 0x1.e07e71bfcf06fp5 0x1.2da9e5e6af0bp8",
    "tanh": "0x1.ac343b179fec4p-3 0x1.00764a988bf73p-2 0x1.291c601a05276p-2 0x1.43eaea23649c3p-2 0x1.d88d7550b2826p-2 "
    "0x1.01efe7ac8c15dp-1 0x1.33dfeb0fa4bfep-1 0x1.49f24ac5cac35p-1",
    "exp": "0x1.fffffffffffffp-53 0x1.7ffe7ffee0024p-32 0x1.9e9cbbfd6080bp-31 0x1.ba07d73250de7p-14 0x1.6a4d1af9cc989p-8 "
    "0x1.accfbe46b4efp-1 0x1.273c188aa7b14p2 0x1.c44ce0d716a1ap4 0x1.d6479eba7c971p8 -0x1.0000000000001p-51 "
    "-0x1.1000000000242p-42 -0x1.4bd46601ae1efp-31 -0x1.290ea09e36479p-3 -0x1.2a9cad9998262p0 -0x1.981587ad4542fp7",
    "expm1": "0x1.e923c188ea79bp-4 0x1.1c38132777b26p-2 0x1.8172a0e02f90ep-2 0x1.accfbe46b4efp-1 0x1.273c188aa7b14p2 "
    "0x1.2ee70220fb1c5p5 0x1.0bc04af1b09f5p9 -0x1.ab86cb1743b75p-4 -0x1.9d871e078ebcep-2 -0x1.2a9cad9998262p0",
    "log": "0x1.0000000000001p0 0x1.000976581ce4ep1 0x1.91a8dff540ff7p2 0x1.de37fb31fd5fcp2 0x1.2b1199e497739p3 "
    "0x1.55f0eaa1b2fc8p3 0x1.3d9d7d597a9ddp4 0x1.ac50b409c8aeep8 0x1.de7cd6751029ap16",
    "log2": "0x1.1ba39ff28e3eap1 0x1.7550685a42c64p0 0x1.90661da12d528p0 0x1.cd6b37edeceafp0",
    "cbrt": "0x1.9b78223aa307cp1 0x1.a202bfc89ddffp2 0x1.3a9ccd7f022dbp0 0x1.7845d2faac6fep0 0x1.0a2014f62987cp1 "
    "0x1.fe18a044a5501p1 0x1.a6bb8c803147bp2",
}


@cache
def points(name: str, count: int, *, single: bool) -> tuple[Doubles, ...]:
    """At least `count` arguments (or pairs) of one function, deterministic; binary32 numbers if `single`."""
    rng = np.random.default_rng(zlib.crc32(f"{name} {single}".encode()))
    make = _pairs if name in TWO_ARGUMENTS else _singles
    with np.errstate(all="ignore"):
        columns = make(name, rng, count, single)
        return tuple(_round(c, single) for c in columns)


def _round(x: Doubles, single: bool) -> Doubles:
    return x.astype(np.float32).astype(np.float64) if single else x


def any_float(rng: np.random.Generator, count: int, limit: float, *, single: bool) -> Doubles:
    """Magnitudes up to `limit` with uniformly distributed exponents, subnormal numbers included."""
    if single:
        top = int(np.float32(limit).view(np.uint32))
        return rng.integers(0, top, count, endpoint=True, dtype=np.uint32).view(np.float32).astype(np.float64)
    top = int(np.float64(limit).view(np.uint64))
    return rng.integers(0, top, count, endpoint=True, dtype=np.uint64).view(np.float64)


def _signs(rng: np.random.Generator, count: int) -> Doubles:
    return rng.choice([-1.0, 1.0], count)


def _near(rng: np.random.Generator, centres: Doubles, count: int, single: bool) -> Doubles:
    """Numbers at small and large distances in units in the last place from a centre."""
    c = rng.choice(_round(centres, single), count)
    steps = np.round(_signs(rng, count) * 2.0 ** rng.uniform(-1, 20 if single else 49, count))
    unit = np.spacing(np.abs(c).astype(np.float32)).astype(np.float64) if single else np.spacing(np.abs(c))
    return c + np.where(rng.random(count) < 0.5, np.round(4 * rng.normal(size=count)), steps) * unit


def _greatest(single: bool) -> float:
    return float(np.finfo(np.float32 if single else np.float64).max)


def _specials(single: bool) -> Doubles:
    info = np.finfo(np.float32 if single else np.float64)
    sizes = [0.0, float(info.smallest_subnormal), float(info.smallest_normal), float(info.eps), 0.5, 1.0, 1.5, 2.0, 3.0]
    sizes += [float(info.max), np.inf]
    return np.array([s * v for v in sizes for s in (1.0, -1.0)] + [np.nan])


# ---- one argument --------------------------------------------------------------------------------------------------


def _singles(name: str, rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles]:
    limit = float(_LIMITS.get(name, (_greatest(single),) * 2)[single])
    wide = any_float(rng, count * 2 // 5, limit, single=single)
    usual = rng.uniform(0.0, min(limit, 1e3), count * 3 // 10)
    near = _near(rng, _centres(name, rng, single), count - wide.size - usual.size, single)
    if name == "log1p":  # any value above; none below -1
        wide = np.where((rng.random(wide.size) < 0.5) & (wide < 1.0), -wide, wide)
    elif name not in _POSITIVE:
        wide, usual = wide * _signs(rng, wide.size), usual * _signs(rng, usual.size)
    worst = np.array([float.fromhex(h) for h in _WORST.get(name, "").split()])
    return (np.concatenate([wide, usual, near, worst, -worst, _specials(single)]),)


def _centres(name: str, rng: np.random.Generator, single: bool) -> Doubles:
    """Zeros, poles, limits, exact values, and arguments with results at powers of two."""
    exponents = np.arange(-149, 128) if single else np.arange(-1074, 1024)
    powers = 2.0**exponents
    if name in ("sin", "cos", "tan"):
        return _quarter_turns(rng, 126 if single else 1022)
    if name in ("exp", "expm1", "sinh", "cosh", "tanh"):
        limits = [104.0, 88.7228, 87.3365, 17.3, 9.0] if single else [745.1332, 709.7827, 708.3964, 37.4, 22.0, 19.06]
        return np.concatenate([exponents * np.log(2.0), limits, [0.0, 1.0], powers[powers < 1]])
    if name in ("asin", "acos", "atan"):
        return np.array([0.0, 1.0, -1.0, 0.5, -0.5, np.sqrt(0.5), np.sqrt(3.0), *powers[:: exponents.size // 60]])
    if name == "log10":
        return np.concatenate([10.0 ** np.arange(-44 if single else -323, 39 if single else 309), [1.0]])
    if name == "cbrt":
        return rng.integers(1, 250 if single else 200_000, 2000).astype(np.float64) ** 3 * 8.0 ** rng.integers(
            -20, 20, 2000
        )
    return np.concatenate([powers, powers - 1.0 if name == "log1p" else [1.0] * 2000])


def _quarter_turns(rng: np.random.Generator, top: int) -> Doubles:
    """Numbers nearest to multiples of pi/2, of every size."""
    turns = [int(rng.integers(1, 1 << int(b))) for b in rng.integers(1, 62, 2000)]
    turns += [int(rng.integers(1, 1 << 53)) << int(b) for b in rng.integers(0, top - 53, 1000)]
    with mpmath.workprec(2200):
        quarter = mpmath.pi / 2
        return np.array([0.0, *(float(k * quarter) for k in turns)])


# ---- two arguments -------------------------------------------------------------------------------------------------


def _pairs(name: str, rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, ...]:
    s = _specials(single)
    parts = [np.array([(a, b) for a in s for b in s]).T]
    makers = {"pow": _POW, "atan2": _ATAN2, "hypot": _HYPOT}[name]
    for maker in makers:
        parts.append(np.array(maker(rng, -(-count // len(makers)), single)))
    joined = np.concatenate(parts, axis=1)
    return joined[0], joined[1]


Maker = Callable[[np.random.Generator, int, bool], tuple[Doubles, Doubles]]


def _wide_pair(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    x, y = (any_float(rng, count, _greatest(single), single=single) * _signs(rng, count) for _ in range(2))
    return x, y


def _comparable(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """Pairs with exponents so close that both matter."""
    x = any_float(rng, count, _greatest(single), single=single) * _signs(rng, count)
    y = x * rng.uniform(1.0, 2.0, count) * 2.0 ** rng.integers(-60, 60, count)
    return x, np.where(np.isfinite(y), y, x)


def _usual_pair(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    return rng.uniform(-100, 100, count), rng.uniform(-100, 100, count)


def _quotients_at_the_edge(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """y/x near the smallest numbers, and near powers of two."""
    x = any_float(rng, count, _greatest(single), single=single)
    exponents = np.where(rng.random(count) < 0.5, rng.integers(-30, 30, count), -(149 if single else 1074))
    return x * 2.0 ** (exponents + rng.integers(0, 60, count)) * rng.choice([1.0, 1.5], count), x * _signs(rng, count)


def _triples(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """Pythagorean triples: the hypotenuse is exact, or exactly the midpoint of two numbers."""
    top = 1 << (12 if single else 26)
    m, n = (rng.integers(1, top, count).astype(np.float64) for _ in range(2))
    scale = 2.0 ** rng.integers(-100 if single else -900, 70 if single else 900, count)
    return np.abs(m * m - n * n) * scale, 2.0 * m * n * scale


def _hypot_limits(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """Sums near overflow, and subnormal ones."""
    big = _greatest(single) / np.sqrt(2.0) * rng.uniform(0.999999, 1.000001, (2, count))
    least = np.finfo(np.float32 if single else np.float64).smallest_subnormal
    small = rng.integers(0, 1 << 24, (2, count)).astype(np.float64) * float(least)
    x, y = np.where(rng.random(count) < 0.5, big, small)
    return x, y


def _powers_in_range(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """x^y of every magnitude, up to both ends of the range."""
    x = any_float(rng, count, _greatest(single), single=single)
    return x, rng.uniform(-155 if single else -1080, 130 if single else 1026, count) / np.log2(x)


def _powers_near_one(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """x near 1 with large y, and any x with a y that makes the result nearly 1."""
    x = 1.0 + _signs(rng, count) * 2.0 ** rng.uniform(-24 if single else -53, -1, count)
    x = _round(x, single)
    return x, rng.uniform(-1, 1, count) * 2.0 ** rng.uniform(-60, 8, count) / np.log2(x)


def _exact_powers(rng: np.random.Generator, count: int, single: bool) -> tuple[Doubles, Doubles]:
    """Integers whose powers are exact or midpoints of two numbers, roots of such powers, negative bases."""
    exponent = rng.integers(1, 9, count).astype(np.float64)
    digits = (25.0 if single else 54.0) / exponent
    base = np.floor(2.0 ** rng.uniform(0, digits)) * _signs(rng, count)
    scale = 2.0 ** rng.integers(-3, 4, count)
    kind = rng.integers(0, 3, count)
    root = np.where(exponent % 2 == 0, exponent / 2, 0.5)
    x = np.where(kind == 0, base * scale, np.where(kind == 1, base, _round(np.abs(base) ** 2, single)))
    return x, np.where(kind == 0, exponent, np.where(kind == 1, -exponent, root))


_POW: tuple[Maker, ...] = (_powers_in_range, _powers_near_one, _exact_powers, _wide_pair, _usual_pair)
_ATAN2: tuple[Maker, ...] = (_wide_pair, _comparable, _usual_pair, _quotients_at_the_edge)
_HYPOT: tuple[Maker, ...] = (_wide_pair, _comparable, _usual_pair, _triples, _hypot_limits)
