# SPDX-License-Identifier: Apache-2.0
"""Operations of all numbers: order, min and max as in Python, clamp, abs, sign, small powers. Also equality of other
types, and `not`."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import BOOL, F32, HEALTH, NUMBERS, REQUEST, Scalar
from .op import Doc, Op, c_function, overflow

_GROUP = "Order and size"
_EXACT = "exact"
_MIN = Doc(
    _GROUP,
    "min(a, b)",
    "b if b < a else a",
    "exact; more arguments fold from the left",
    "a NaN in b is passed over, one in a stays; of equal operands a, so min(0.0, -0.0) is 0.0",
)
_MAX = Doc(_GROUP, "max(a, b)", "b if b > a else a", _MIN.order, "as min")
_CLAMP = Doc(
    _GROUP,
    "clamp(x, low, high)",
    "low if x < low else high if high < x else x",
    "exact; compared with low first",
    "x NaN: NaN; a bound that is NaN does not bind",
)
_SIGN = Doc(_GROUP, "sign(x)", "1, -1, or x itself when it is zero or NaN", _EXACT, "none")
_ABS = Doc(_GROUP, "abs(x)", "|x|", _EXACT, "the smallest integer of a signed type faults")


def operations() -> Iterator[Op]:
    for t in NUMBERS:
        for symbol in ("<", "<=", ">", ">=", "==", "!="):
            yield Op(symbol, (t, t), BOOL, f"({{0}} {symbol} {{1}})")
        yield from _choosing(t)
        yield from _powers(t)
    for t in (BOOL, REQUEST, HEALTH):
        for symbol in ("==", "!="):
            yield Op(symbol, (t, t), BOOL, f"({{0}} {symbol} {{1}})")
    yield Op("not", (BOOL,), BOOL, "(!{0})")


def _choosing(t: Scalar) -> Iterator[Op]:
    if t.is_float:
        yield Op("abs", (t,), t, f"fabs{'f' if t is F32 else ''}({{0}})", doc=_ABS)
    elif t.is_signed:
        helper = c_function(
            f"{t.c} fcsl_abs_{t}({t.c} a, uint32_t place, uint32_t *fault)",
            f"if (a == INT{t.size * 8}_MIN) {{",
            "    fcsl_fault(place, fault);",
            "    return 0;",
            "}",
            "return a < 0 ? -a : a;",
        )
        proven = f"fcsl_abs_proven_{t}"
        proven_helper = c_function(f"{t.c} {proven}({t.c} a)", "return a < 0 ? -a : a;")
        c = f"fcsl_abs_{t}({{0}}, {{place}}, {{fault}})"
        yield Op("abs", (t,), t, c, (overflow(t),), helper, _ABS, f"{proven}({{0}})", proven_helper)
    for name, test, doc in (("min", "b < a", _MIN), ("max", "b > a", _MAX)):
        helper = c_function(f"{t.c} fcsl_{name}_{t}({t.c} a, {t.c} b)", f"return {test} ? b : a;")
        yield Op(name, (t, t), t, f"fcsl_{name}_{t}({{0}}, {{1}})", helper=helper, doc=doc)
    helper = c_function(
        f"{t.c} fcsl_clamp_{t}({t.c} x, {t.c} low, {t.c} high)", "return x < low ? low : high < x ? high : x;"
    )
    yield Op("clamp", (t, t, t), t, f"fcsl_clamp_{t}({{0}}, {{1}}, {{2}})", helper=helper, doc=_CLAMP)
    if t.is_float or t.is_signed:
        helper = c_function(f"{t.c} fcsl_sign_{t}({t.c} x)", "return x > 0 ? 1 : x < 0 ? -1 : x;")
        yield Op("sign", (t,), t, f"fcsl_sign_{t}({{0}})", helper=helper, doc=_SIGN)


def _powers(t: Scalar) -> Iterator[Op]:
    """x ** 0, 2, 3, 4: repeated multiplication from the left. Signed products can fault."""
    for exponent in (0, 2, 3, 4):
        symbol, faulting, plain = f"**{exponent}", f"fcsl_pow{exponent}_{t}", f"fcsl_pow{exponent}_proven_{t}"
        product = " * ".join(["a"] * exponent) or "(void)a, 1"
        if not (exponent and t.is_signed):
            helper = c_function(f"{t.c} {faulting}({t.c} a)", f"return {product};")
            yield Op(symbol, (t,), t, f"{faulting}({{0}})", helper=helper)
            continue
        helper = c_function(
            f"{t.c} {faulting}({t.c} a, uint32_t place, uint32_t *fault)",
            f"{t.c} result = a;",
            f"for (int32_t i = 1; i < {exponent}; ++i) {{",
            "    if (__builtin_mul_overflow(result, a, &result)) {",
            "        fcsl_fault(place, fault);",
            "        return 0;",
            "    }",
            "}",
            "return result;",
        )
        c = f"{faulting}({{0}}, {{place}}, {{fault}})"
        proven_helper = c_function(f"{t.c} {plain}({t.c} a)", f"return {product};")
        yield Op(symbol, (t,), t, c, (overflow(t),), helper, None, f"{plain}({{0}})", proven_helper)
