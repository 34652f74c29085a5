# SPDX-License-Identifier: Apache-2.0
"""Nim of the operations of f32 and f64."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ....model.literals import round_f32
from ....model.ops.floats import ELEMENTARY
from ....model.types import F32, F64, Scalar
from ...spelling import Entry, entry
from .helpers import imported, literal, nim, proc

_MATH = "<math.h>"


def spellings() -> Iterator[Entry]:
    for t in (F64, F32):
        yield from _arithmetic(t)
        yield from _elementary(t)
        yield from _rounding(t)
        yield from _signs(t)
        yield from _tests(t)
    yield from _division()


def c_function(name: str, arity: int, t: Scalar, header: str = _MATH) -> str:
    """A function of C, as the Nim proc fcsl_c_<name>_<type>."""
    arguments = ", ".join("xyz"[:arity])
    suffix = "f" if t is F32 else ""
    return imported(f"fcsl_c_{name}_{t}", f"{arguments}: {nim(t)}", nim(t), name + suffix, header)


def _literal(value: float, t: Scalar) -> str:
    return literal(round_f32(value) if t is F32 else value, t)


def _arithmetic(t: Scalar) -> Iterator[Entry]:
    for symbol in "+-*/":
        yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
    yield entry("neg", (t,), "(-{0})")


def _elementary(t: Scalar) -> Iterator[Entry]:
    yield entry("sqrt", (t,), f"fcsl_c_sqrt_{t}({{0}})", c_function("sqrt", 1, t))
    for name, arity in ELEMENTARY:
        operands = ", ".join(f"{{{i}}}" for i in range(arity))
        helper = c_function(f"cr_{name}", arity, t, "fcsl/fcsl_math.h")
        yield entry(name, (t,) * arity, f"fcsl_c_cr_{name}_{t}({operands})", helper)


def _rounding(t: Scalar) -> Iterator[Entry]:
    for name in ("floor", "ceil", "trunc"):
        yield entry(name, (t,), f"fcsl_c_{name}_{t}({{0}})", c_function(name, 1, t))
    # Above 2^52 (f32: 2^23) every float is an integer. Below, the sum has no fraction bits left and is rounded half to
    # even.
    integral = _literal(2.0**23 if t is F32 else 2.0**52, t)
    helper = proc(
        f"fcsl_round_{t}",
        f"x: {nim(t)}",
        nim(t),
        f"let size = fcsl_c_fabs_{t}(x)",
        f"if size < {integral}: fcsl_c_copysign_{t}((size + {integral}) - {integral}, x) else: x",
    )
    needs = (c_function("fabs", 1, t), c_function("copysign", 2, t))
    yield entry("round", (t,), f"fcsl_round_{t}({{0}})", "\n".join((*needs, helper)))
    yield entry("fmod", (t, t), f"fcsl_c_fmod_{t}({{0}}, {{1}})", c_function("fmod", 2, t))


def _signs(t: Scalar) -> Iterator[Entry]:
    # The sign of a NaN differs between processors, so it must not affect the result.
    helper = proc(
        f"fcsl_copysign_{t}",
        f"x, y: {nim(t)}",
        nim(t),
        f"if y != y: fcsl_c_fabs_{t}(x) else: fcsl_c_copysign_{t}(x, y)",
    )
    needs = (c_function("fabs", 1, t), c_function("copysign", 2, t))
    yield entry("copysign", (t, t), f"fcsl_copysign_{t}({{0}}, {{1}})", "\n".join((*needs, helper)))
    one, half = _literal(1.0, t), _literal(0.5, t)
    helper = proc(
        f"fcsl_lerp_{t}",
        f"a, b, t: {nim(t)}",
        nim(t),
        f"if t < {half}: a + t * (b - a) else: b - ({one} - t) * (b - a)",
    )
    yield entry("lerp", (t, t, t), f"fcsl_lerp_{t}({{0}}, {{1}}, {{2}})", helper)
    pi, turn = _literal(math.pi, t), _literal(2.0 * math.pi, t)
    helper = proc(
        f"fcsl_wrap_angle_{t}",
        f"x: {nim(t)}",
        nim(t),
        f"let rest = fcsl_c_fmod_{t}(x, {turn})",
        f"if rest > {pi}: rest - {turn} elif rest < -{pi}: rest + {turn} else: rest",
    )
    yield entry("wrap_angle", (t,), f"fcsl_wrap_angle_{t}({{0}})", "\n".join((c_function("fmod", 2, t), helper)))


def _tests(t: Scalar) -> Iterator[Entry]:
    infinite, fabs = f"fcsl_c_fabs_{t}(x) == {literal(math.inf, t)}", c_function("fabs", 1, t)
    for name, test, needs in (
        ("isnan", "x != x", ""),
        ("isinf", infinite, fabs + "\n"),
        ("isfinite", f"x - x == {_literal(0.0, t)}", ""),
    ):
        helper = needs + proc(f"fcsl_{name}_{t}", f"x: {nim(t)}", "bool", test)
        yield entry(name, (t,), f"fcsl_{name}_{t}({{0}})", helper)


def _division() -> Iterator[Entry]:
    """Floor division and remainder as in CPython. A zero divisor gives NaN. f32 is computed in f64."""
    remainder = (
        "if b == 0.0:",
        "  return NaN",
        "var rest = fcsl_c_fmod_f64(a, b)",
        "if rest == 0.0:",
        "  rest = fcsl_c_copysign_f64(0.0, b)",
        "elif (b < 0.0) != (rest < 0.0):",
        "  rest = rest + b",
        "rest",
    )
    quotient = (
        *remainder[:2],
        "let rest = fcsl_c_fmod_f64(a, b)",
        "var quotient = (a - rest) / b",
        "if rest != 0.0 and (b < 0.0) != (rest < 0.0):",
        "  quotient = quotient - 1.0",
        "if quotient == 0.0:",
        "  return fcsl_c_copysign_f64(0.0, a / b)",
        "let whole = fcsl_c_floor_f64(quotient)",
        "if quotient - whole > 0.5: whole + 1.0 else: whole",
    )
    fmod, copysign, floor = (
        c_function(name, arity, F64) for name, arity in (("fmod", 2), ("copysign", 2), ("floor", 1))
    )
    for symbol, word, body in (("//", "floordiv", quotient), ("%", "mod", remainder)):
        helper = "\n".join((fmod, copysign, floor, proc(f"fcsl_{word}_f64", "a, b: float64", "float64", *body)))
        yield entry(symbol, (F64, F64), f"fcsl_{word}_f64({{0}}, {{1}})", helper)
        # The operands convert exactly; the result is rounded once.
        yield entry(symbol, (F32, F32), f"float32(fcsl_{word}_f64(float64({{0}}), float64({{1}})))", helper)
