# SPDX-License-Identifier: Apache-2.0
"""C of order, min and max, clamp, abs, sign, small powers, equality, and `not`."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import BOOL, F32, NUMBERS, Scalar
from ...spelling import Entry, comparisons, entry
from .helpers import c_function


def spellings() -> Iterator[Entry]:
    yield from comparisons()
    for t in NUMBERS:
        yield from _choosing(t)
        yield from _powers(t)
    for t in (*NUMBERS, BOOL):
        helper = c_function(f"{t.c} fcsl_where_{t}(bool c, {t.c} a, {t.c} b)", "return c ? a : b;")
        yield entry("where", (BOOL, t, t), f"fcsl_where_{t}({{0}}, {{1}}, {{2}})", helper)
    yield entry("not", (BOOL,), "(!{0})")
    signature = "bool fcsl_assert(bool condition, uint32_t place, uint32_t *fault)"
    helper = c_function(signature, "if (!condition) {", "    fcsl_fault(place, fault);", "}", "return condition;")
    yield entry("assert", (BOOL,), "fcsl_assert({0}, {place}, {fault})", helper)


def _choosing(t: Scalar) -> Iterator[Entry]:
    if t.is_float:
        yield entry("abs", (t,), f"fabs{'f' if t is F32 else ''}({{0}})")
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
        yield entry("abs", (t,), c, helper, f"{proven}({{0}})", proven_helper)
    for name, test in (("min", "b < a"), ("max", "b > a")):
        helper = c_function(f"{t.c} fcsl_{name}_{t}({t.c} a, {t.c} b)", f"return {test} ? b : a;")
        yield entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)
    helper = c_function(  # gcc makes maxsd and minsd of it, and no branch
        f"{t.c} fcsl_clamp_{t}({t.c} x, {t.c} low, {t.c} high)",
        f"const {t.c} raised = low > x ? low : x;",
        "return high < raised ? high : raised;",
    )
    yield entry("clamp", (t, t, t), f"fcsl_clamp_{t}({{0}}, {{1}}, {{2}})", helper)
    if t.is_float or t.is_signed:
        helper = c_function(f"{t.c} fcsl_sign_{t}({t.c} x)", "return x > 0 ? 1 : x < 0 ? -1 : x;")
        yield entry("sign", (t,), f"fcsl_sign_{t}({{0}})", helper)


def _powers(t: Scalar) -> Iterator[Entry]:
    """x ** 0, 2, 3, 4: repeated multiplication from the left. Signed products can fault."""
    for exponent in (0, 2, 3, 4):
        symbol, faulting, plain = f"**{exponent}", f"fcsl_pow{exponent}_{t}", f"fcsl_pow{exponent}_proven_{t}"
        product = " * ".join(["a"] * exponent) or "(void)a, 1"
        if not (exponent and t.is_signed):
            helper = c_function(f"{t.c} {faulting}({t.c} a)", f"return {product};")
            yield entry(symbol, (t,), f"{faulting}({{0}})", helper)
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
        yield entry(symbol, (t,), c, helper, f"{plain}({{0}})", proven_helper)
