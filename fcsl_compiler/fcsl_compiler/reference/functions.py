# SPDX-License-Identifier: Apache-2.0
"""The builtins, implemented from their documentation. Elementary functions are those of CORE-MATH (libfcsl_math.so)."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Any

from ..base.packages import package_prefix
from .arrays import eye, zeros
from .types import SCALARS
from .values import F32, I64, INTEGERS, Fault, IllTyped, TypedInt, as_f32, as_f64, round_int_to_f32

_UNARY = "sin cos tan asin acos atan sinh cosh tanh exp expm1 log log1p log2 log10 cbrt".split()
_BINARY = ("atan2", "pow", "hypot")

#: Builtins of integers and floats. The others accept only floats.
ON_INTEGERS = frozenset(
    [
        "abs",
        "min",
        "max",
        "clamp",
        "sign",
        "where",
        *(f"{k}_{o}" for k in ("wrap", "sat") for o in ("add", "sub", "mul")),
    ]
)
#: Builtins that convert any operand to the type they are named after.
CONVERSIONS = {name: name for name in (*INTEGERS, "f32", "f64")}
CONVERSIONS |= {f"{kind}_{name}": name for kind in ("wrap", "sat") for name in INTEGERS}
PREDICATES = frozenset(("isnan", "isinf", "isfinite"))


def settle(*args: Any) -> list[Any]:
    """Converts numbers to one type. Literals adopt the type of the others. If all are literals and one is a float, the
    type is f64."""
    for typed in args:
        if type(typed) is F32:
            return [as_f32(a) for a in args]
        if isinstance(typed, TypedInt):
            return [typed.adopt(a) for a in args]
    return [as_f64(a) for a in args] if any(type(a) is float for a in args) else list(args)


def _alike(args: Sequence[Any]) -> Sequence[Any]:
    """Like `settle`, which does nothing to numbers of one type."""
    kind = type(args[0])
    for arg in args:
        if type(arg) is not kind:
            return settle(*args)
    return args


def settle_floats(*args: Any) -> list[Any]:
    """Like `settle`, for functions of floats only."""
    for arg in args:
        if type(arg) is not float:
            break
    else:
        return list(args)
    settled = settle(*args)
    if isinstance(settled[0], TypedInt):
        raise IllTyped("an integer where a float is needed")
    return settled if type(settled[0]) is F32 else [as_f64(a) for a in settled]


def _settle_integers(*args: Any) -> list[Any]:
    """Like `settle`, for functions of integers only. A literal without type becomes i64."""
    settled = [I64.adopt(a) if type(a) is int else a for a in settle(*args)]
    if not isinstance(settled[0], TypedInt):
        raise IllTyped("a float where an integer is needed")
    return settled


# ---- floats --------------------------------------------------------------------------------------------------------


@cache
def _math() -> ctypes.CDLL:
    return ctypes.CDLL(str(package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.so"))


def _elementary(name: str, count: int) -> Callable[..., Any]:
    double, single = getattr(_math(), f"cr_{name}"), getattr(_math(), f"cr_{name}f")
    double.argtypes, double.restype = [ctypes.c_double] * count, ctypes.c_double
    single.argtypes, single.restype = [ctypes.c_float] * count, ctypes.c_float

    def general(*args: Any) -> Any:
        settled = settle_floats(*args)
        return F32(single(*settled)) if type(settled[0]) is F32 else double(*settled)

    def unary(x: Any) -> Any:
        return double(x) if type(x) is float else general(x)

    return unary if count == 1 else general


def _like(model: Any, value: float) -> Any:
    """A result with the type of the operand."""
    return as_f32(value) if type(model) is F32 else value


def _to_whole(f: Callable[[float], int]) -> Callable[[Any], Any]:
    def call(x: Any) -> Any:
        v = x if type(x) is float else settle_floats(x)[0]
        return _like(v, math.copysign(float(f(v)), v)) if math.isfinite(v) else v

    return call


def sqrt(x: Any) -> Any:
    if type(x) is float:
        return math.sqrt(x) if x >= 0.0 else math.nan
    (v,) = settle_floats(x)
    return _like(v, math.nan if v < 0.0 else math.sqrt(v))


def fmod(x: Any, y: Any) -> Any:
    a, b = settle_floats(x, y)
    undefined = math.isinf(a) or b == 0.0
    return _like(a, math.nan if undefined else math.fmod(a, b))


def copysign(x: Any, y: Any) -> Any:
    a, b = settle_floats(x, y)
    return abs(a) if math.isnan(b) else _like(a, math.copysign(a, b))


def lerp(a: Any, b: Any, t: Any) -> Any:
    a, b, t = settle_floats(a, b, t)
    return a + t * (b - a) if t < 0.5 else b - (1.0 - t) * (b - a)


def wrap_angle(x: Any) -> Any:
    (v,) = settle_floats(x)
    half, turn = _like(v, math.pi), _like(v, 2.0 * math.pi)
    rest = fmod(v, turn)
    return rest - turn if rest > half else rest + turn if rest < -half else rest


def _predicate(f: Callable[[float], bool]) -> Callable[[Any], bool]:
    return lambda x: f(x if type(x) is float else settle_floats(x)[0])


# ---- every number --------------------------------------------------------------------------------------------------


def absolute(x: Any) -> Any:
    return abs(x)


def minimum(*args: Any) -> Any:
    best, *rest = _alike(args)
    for x in rest:
        best = x if x < best else best
    return best


def maximum(*args: Any) -> Any:
    best, *rest = _alike(args)
    for x in rest:
        best = x if x > best else best
    return best


def clamp(x: Any, low: Any, high: Any) -> Any:
    if not type(x) is type(low) is type(high):
        x, low, high = settle(x, low, high)
    raised = low if low > x else x
    return high if high < raised else raised


def where(c: bool, a: Any, b: Any) -> Any:
    a, b = settle(a, b) if type(a) is not type(b) else (a, b)
    return a if c else b


def sign(x: Any) -> Any:
    if x > 0:
        return type(x)(1)
    return type(x)(-1) if x < 0 else x


# ---- conversions ---------------------------------------------------------------------------------------------------


def _number(x: Any) -> Any:
    if type(x) is bool or not isinstance(x, int | float):
        raise IllTyped(f"{x!r} where a number is needed")
    return x


def _to_integer(cls: type[TypedInt]) -> Callable[[Any], Any]:
    def call(x: Any) -> Any:
        n = int(x) if isinstance(_number(x), int) or math.isfinite(x) else None
        if n is None or not cls.low <= n <= cls.high:
            raise Fault(f"the value does not fit {cls.__name__.lower()}")
        return cls(n)

    return call


def to_f32(x: Any) -> Any:
    return F32(round_int_to_f32(int(x))) if isinstance(_number(x), int) else as_f32(x)


def to_f64(x: Any) -> float:
    if type(x) is float:
        return x
    return float(_number(x))


def wrap(cls: type[TypedInt], n: int) -> Any:
    """n modulo 2 to the width of the type."""
    return cls(((n - cls.low) & ((1 << cls.bits) - 1)) + cls.low)


def saturate(cls: type[TypedInt], n: int) -> Any:
    return cls(max(cls.low, min(cls.high, n)))


def _wrap_to(cls: type[TypedInt]) -> Callable[[Any], Any]:
    return lambda x: wrap(cls, int(_settle_integers(x)[0]))


def _saturate_to(cls: type[TypedInt]) -> Callable[[Any], Any]:
    def call(x: Any) -> Any:
        if isinstance(_number(x), float) and not math.isfinite(x):
            return cls(0 if math.isnan(x) else cls.high if x > 0 else cls.low)
        return saturate(cls, int(x))

    return call


def _exact(put: Callable[[type[TypedInt], int], Any], f: Callable[[int, int], int]) -> Callable[[Any, Any], Any]:
    def call(a: Any, b: Any) -> Any:
        a, b = _settle_integers(a, b)
        return put(type(a), f(int(a), int(b)))

    return call


# ---- names ---------------------------------------------------------------------------------------------------------


@cache
def builtins() -> dict[str, Any]:
    """All builtins by name, to be copied into a new namespace."""
    names: dict[str, Any] = {n: _elementary(n, 1) for n in _UNARY} | {n: _elementary(n, 2) for n in _BINARY}
    for name, cls in INTEGERS.items():
        names |= {name: _to_integer(cls), f"wrap_{name}": _wrap_to(cls), f"sat_{name}": _saturate_to(cls)}
    for kind, put in (("wrap", wrap), ("sat", saturate)):
        names |= {f"{kind}_add": _exact(put, int.__add__), f"{kind}_sub": _exact(put, int.__sub__)}
        names[f"{kind}_mul"] = _exact(put, int.__mul__)
    names |= {n: _to_whole(f) for n, f in (("floor", math.floor), ("ceil", math.ceil), ("trunc", math.trunc))}
    names |= {n: _predicate(getattr(math, n)) for n in PREDICATES}
    names |= {"f32": to_f32, "f64": to_f64, "round": _to_whole(round), "sqrt": sqrt, "fmod": fmod, "copysign": copysign}
    names |= {"lerp": lerp, "wrap_angle": wrap_angle}
    names |= {"abs": absolute, "min": minimum, "max": maximum, "clamp": clamp, "sign": sign}
    names |= {"zeros": partial(zeros, SCALARS["f64"]), "eye": partial(eye, SCALARS["f64"]), "where": where}
    return names | {"pi": math.pi, "inf": math.inf, "nan": math.nan}
