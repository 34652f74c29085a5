# SPDX-License-Identifier: Apache-2.0
"""Nim of order, min and max, clamp, abs, sign, small powers, equality, and `not`."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import BOOL, NUMBERS, Scalar
from ...spelling import Entry, comparisons, entry
from .floats import c_function
from .helpers import FAULT, FAULT_HELPER, literal, nim, proc
from .integers import overflowing


def spellings() -> Iterator[Entry]:
    yield from comparisons()
    for t in NUMBERS:
        yield from _choosing(t)
        yield from _powers(t)
    for t in (*NUMBERS, BOOL):
        helper = proc(f"fcsl_where_{t}", f"c: bool, a, b: {nim(t)}", nim(t), "if c: a else: b")
        yield entry("where", (BOOL, t, t), f"fcsl_where_{t}({{0}}, {{1}}, {{2}})", helper)
    yield entry("not", (BOOL,), "(not {0})")
    lines = ("if not condition:", "  fcsl_fault(place, fault)", "condition")
    helper = FAULT_HELPER + "\n" + proc("fcsl_assert", f"condition: bool, {FAULT}", "bool", *lines)
    yield entry("assert", (BOOL,), "fcsl_assert({0}, {place}, {fault})", helper)


def _choosing(t: Scalar) -> Iterator[Entry]:
    if t.is_float:
        yield entry("abs", (t,), f"fcsl_c_fabs_{t}({{0}})", c_function("fabs", 1, t))
    elif t.is_signed:
        size = "if a < 0: -a else: a"
        lines = (f"if a == {literal(t.low, t)}:", "  fcsl_fault(place, fault)", f"  return {literal(0, t)}", size)
        helper = FAULT_HELPER + "\n" + proc(f"fcsl_abs_{t}", f"a: {nim(t)}, {FAULT}", nim(t), *lines)
        proven_helper = proc(f"fcsl_abs_proven_{t}", f"a: {nim(t)}", nim(t), size)
        text = f"fcsl_abs_{t}({{0}}, {{place}}, {{fault}})"
        yield entry("abs", (t,), text, helper, f"fcsl_abs_proven_{t}({{0}})", proven_helper)
    for name, test in (("min", "b < a"), ("max", "b > a")):
        helper = proc(f"fcsl_{name}_{t}", f"a, b: {nim(t)}", nim(t), f"if {test}: b else: a")
        yield entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)
    helper = proc(
        f"fcsl_clamp_{t}",
        f"x, low, high: {nim(t)}",
        nim(t),
        "let raised = if low > x: low else: x",
        "if high < raised: high else: raised",
    )
    yield entry("clamp", (t, t, t), f"fcsl_clamp_{t}({{0}}, {{1}}, {{2}})", helper)
    if t.is_float or t.is_signed:
        one, zero = literal(1, t), literal(0, t)
        helper = proc(
            f"fcsl_sign_{t}",
            f"x: {nim(t)}",
            nim(t),
            f"if x > {zero}: {one} elif x < {zero}: -{one} else: x",
        )
        yield entry("sign", (t,), f"fcsl_sign_{t}({{0}})", helper)


def _powers(t: Scalar) -> Iterator[Entry]:
    """x ** 0, 2, 3, 4: repeated multiplication from the left. Signed products can fault."""
    for exponent in (0, 2, 3, 4):
        symbol, faulting, plain = f"**{exponent}", f"fcsl_pow{exponent}_{t}", f"fcsl_pow{exponent}_proven_{t}"
        product = " * ".join(["a"] * exponent) or literal(1, t)
        if not (exponent and t.is_signed):
            yield entry(symbol, (t,), f"{faulting}({{0}})", proc(faulting, f"a: {nim(t)}", nim(t), product))
            continue
        helper = proc(
            faulting,
            f"a: {nim(t)}, {FAULT}",
            nim(t),
            "var product = a",
            f"for i in 1 ..< {exponent}:",
            f"  if fcsl_overflows_mul_{t}(product, a, addr product):",
            "    fcsl_fault(place, fault)",
            f"    return {literal(0, t)}",
            "product",
        )
        needs = "\n".join((FAULT_HELPER, overflowing("mul", t), helper))
        proven_helper = proc(plain, f"a: {nim(t)}", nim(t), product)
        yield entry(symbol, (t,), f"{faulting}({{0}}, {{place}}, {{fault}})", needs, f"{plain}({{0}})", proven_helper)
