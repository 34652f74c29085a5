# SPDX-License-Identifier: Apache-2.0
"""C of the operations of f32 and f64."""

from __future__ import annotations

import math
from collections.abc import Iterator

from ....model.c_names import c_literal
from ....model.literals import round_f32
from ....model.ops.floats import ELEMENTARY
from ....model.types import F32, F64, Scalar
from ...spelling import Entry, entry
from .helpers import c_function


def spellings() -> Iterator[Entry]:
    for t in (F64, F32):
        yield from _arithmetic(t)
        yield from _elementary(t)
        yield from _rounding(t)
        yield from _signs(t)
        yield from _tests(t)
    yield from _division()


def _suffix(t: Scalar) -> str:
    return "f" if t is F32 else ""


def _literal(value: float, t: Scalar) -> str:
    return c_literal(round_f32(value) if t is F32 else value, t)


def _arithmetic(t: Scalar) -> Iterator[Entry]:
    for symbol in "+-*/":
        yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
    yield entry("neg", (t,), "(-{0})")


def _elementary(t: Scalar) -> Iterator[Entry]:
    yield entry("sqrt", (t,), f"sqrt{_suffix(t)}({{0}})")
    for name, arity in ELEMENTARY:
        operands = ", ".join(f"{{{i}}}" for i in range(arity))
        yield entry(name, (t,) * arity, f"cr_{name}{_suffix(t)}({operands})")


def _rounding(t: Scalar) -> Iterator[Entry]:
    for name in ("floor", "ceil", "trunc"):
        yield entry(name, (t,), f"{name}{_suffix(t)}({{0}})")
    # Above 2^52 (f32: 2^23) every float is an integer. Below, the sum has no fraction bits left and is rounded half to
    # even. roundeven is not available in libm before C23.
    integral = _literal(2.0**23 if t is F32 else 2.0**52, t)
    helper = c_function(
        f"{t.c} fcsl_round_{t}({t.c} x)",
        f"const {t.c} size = fabs{_suffix(t)}(x);",
        f"return size < {integral} ? copysign{_suffix(t)}((size + {integral}) - {integral}, x) : x;",
    )
    yield entry("round", (t,), f"fcsl_round_{t}({{0}})", helper)
    yield entry("fmod", (t, t), f"fmod{_suffix(t)}({{0}}, {{1}})")


def _signs(t: Scalar) -> Iterator[Entry]:
    suffix = _suffix(t)
    # The sign of a NaN differs between processors, so it must not affect the result.
    helper = c_function(
        f"{t.c} fcsl_copysign_{t}({t.c} x, {t.c} y)",
        f"return y != y ? fabs{suffix}(x) : copysign{suffix}(x, y);",
    )
    yield entry("copysign", (t, t), f"fcsl_copysign_{t}({{0}}, {{1}})", helper)
    one, half = _literal(1.0, t), _literal(0.5, t)
    helper = c_function(
        f"{t.c} fcsl_lerp_{t}({t.c} a, {t.c} b, {t.c} t)",
        f"return t < {half} ? a + t * (b - a) : b - ({one} - t) * (b - a);",
    )
    yield entry("lerp", (t, t, t), f"fcsl_lerp_{t}({{0}}, {{1}}, {{2}})", helper)
    pi, turn = _literal(math.pi, t), _literal(2.0 * math.pi, t)
    helper = c_function(
        f"{t.c} fcsl_wrap_angle_{t}({t.c} x)",
        f"const {t.c} rest = fmod{suffix}(x, {turn});",
        f"return rest > {pi} ? rest - {turn} : rest < -{pi} ? rest + {turn} : rest;",
    )
    yield entry("wrap_angle", (t,), f"fcsl_wrap_angle_{t}({{0}})", helper)


def _tests(t: Scalar) -> Iterator[Entry]:
    infinite = f"fabs{_suffix(t)}(x) == __builtin_inf{_suffix(t)}()"
    for name, c in (("isnan", "x != x"), ("isinf", infinite), ("isfinite", "x - x == 0")):
        helper = c_function(f"bool fcsl_{name}_{t}({t.c} x)", f"return {c};")
        yield entry(name, (t,), f"fcsl_{name}_{t}({{0}})", helper)


def _division() -> Iterator[Entry]:
    """Floor division and remainder as in CPython. A zero divisor gives NaN. f32 is computed in f64."""
    remainder = (
        "if (b == 0.0) {",
        '    return __builtin_nan("");',
        "}",
        "double rest = fmod(a, b);",
        "if (rest == 0.0) {",
        "    rest = copysign(0.0, b);",
        "} else if ((b < 0.0) != (rest < 0.0)) {",
        "    rest += b;",
        "}",
    )
    quotient = (
        *remainder[:3],
        "const double rest = fmod(a, b);",
        "double quotient = (a - rest) / b;",
        "if (rest != 0.0 && (b < 0.0) != (rest < 0.0)) {",
        "    quotient -= 1.0;",
        "}",
        "if (quotient == 0.0) {",
        "    return copysign(0.0, a / b);",
        "}",
        "const double whole = floor(quotient);",
        "return quotient - whole > 0.5 ? whole + 1.0 : whole;",
    )
    for symbol, word, body in (("//", "floordiv", quotient), ("%", "mod", (*remainder, "return rest;"))):
        helper = c_function(f"double fcsl_{word}_f64(double a, double b)", *body)
        yield entry(symbol, (F64, F64), f"fcsl_{word}_f64({{0}}, {{1}})", helper)
        # The operands convert exactly; the result is rounded once.
        yield entry(symbol, (F32, F32), f"((float)fcsl_{word}_f64((double){{0}}, (double){{1}}))", helper)
