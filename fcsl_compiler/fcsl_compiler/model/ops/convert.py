# SPDX-License-Identifier: Apache-2.0
"""Conversions between numbers: checked (`i32(x)`), modulo 2^n (`wrap_i32(x)`), saturating (`sat_i32(x)`)."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import F32, F64, NUMBERS, Scalar
from .op import Doc, Op, c_function

GROUP = "Conversions"
_INTEGERS = tuple(t for t in NUMBERS if t.is_integer)


def operations() -> Iterator[Op]:
    for source in NUMBERS:
        for target in NUMBERS:
            yield _to_float(source, target) if target.is_float else _checked(source, target)
    for target in _INTEGERS:
        for source in _INTEGERS:
            yield _wrapping(source, target)
    for target in _INTEGERS:
        for source in NUMBERS:
            yield _saturating(source, target)


def least(t: Scalar) -> str:
    """C name of the smallest value of an integer type."""
    return f"INT{t.size * 8}_MIN" if t.is_signed else "0"


def greatest(t: Scalar) -> str:
    return f"{'' if t.is_signed else 'U'}INT{t.size * 8}_MAX"


def _to_float(source: Scalar, target: Scalar) -> Op:
    doc = Doc(GROUP, f"{target}(x)", f"x as {target}", "rounded once, half to even", "beyond the range: an infinity")
    return Op(target.name, (source,), target, f"(({target.c}){{0}})", doc=doc)


def _checked(source: Scalar, target: Scalar) -> Op:
    doc = Doc(
        GROUP, f"{target}(x)", f"x as {target}, toward zero", "exact but for the fraction", "out of range or NaN: fault"
    )
    if source.is_float:
        test = _float_fits(source, target)
    else:
        test = _integer_fits(source, target)
    if not test:
        return Op(target.name, (source,), target, f"(({target.c}){{0}})", doc=doc)
    name = f"fcsl_{target}_from_{source}"
    helper = c_function(
        f"{target.c} {name}({source.c} x, uint32_t place, uint32_t *fault)",
        f"if (!({test})) {{",
        "    fcsl_fault(place, fault);",
        "    return 0;",
        "}",
        f"return ({target.c})x;",
    )
    why, proven = (f"the value does not fit {target}",), f"(({target.c}){{0}})"
    return Op(target.name, (source,), target, f"{name}({{0}}, {{place}}, {{fault}})", why, helper, doc, proven)


def _float_fits(source: Scalar, target: Scalar) -> str:
    # Both bounds must be exact in the float type: -2^n - 1 is not, hence >= low for 64 bits and for f32.
    low, above = float(target.low), float(target.high + 1)
    exclusive = target.size == 4 and source is F64
    lower = f"x > {low - 1.0!r}" if exclusive or not target.low else f"x >= {low!r}"
    suffix = "f" if source is F32 else ""
    # The first test is for static value analysis, which does not derive from `x >= low` that x is not NaN.
    return f"x == x && {lower}{suffix} && x < {above!r}{suffix}"


def _integer_fits(source: Scalar, target: Scalar) -> str:
    """The C test that a value fits, or "" if every value fits."""
    tests = [f"x >= {least(target)}"] if source.low < target.low else []
    if source.high > target.high:
        # A signed source is not negative here, so the comparison can be unsigned.
        both_signed = target.is_signed and source.is_signed
        tests.append(f"x <= {greatest(target)}" if both_signed else f"(uint64_t)x <= (uint64_t){greatest(target)}")
    return " && ".join(tests)


def _wrapping(source: Scalar, target: Scalar) -> Op:
    """A cast. Conversion to a signed type is implementation-defined in C; gcc and clang define it as modulo 2^n."""
    name = f"wrap_{target}"
    meaning = f"x of any integer type, modulo 2^{target.size * 8}, as {target}"
    doc = Doc(GROUP, f"{name}(x)", meaning, "exact: the lowest bits stay", "none")
    return Op(name, (source,), target, f"(({target.c}){{0}})", doc=doc)


def _saturating(source: Scalar, target: Scalar) -> Op:
    name = f"sat_{target}"
    meaning = f"x toward zero, or the value of {target} that is nearest to it"
    doc = Doc(GROUP, f"{name}(x)", meaning, "exact but for the fraction", "NaN: 0; an infinity: the end of the range")
    lines = []
    if source.is_float:
        suffix = "f" if source is F32 else ""
        lines += ["if (x != x) {", "    return 0;", "}"]
        lines += [f"if (x <= {float(target.low)!r}{suffix}) {{", f"    return {least(target)};", "}"]
        lines += [f"if (x >= {float(target.high + 1)!r}{suffix}) {{", f"    return {greatest(target)};", "}"]
    else:
        if source.low < target.low:
            lines += [f"if (x < {least(target)}) {{", f"    return {least(target)};", "}"]
        if source.high > target.high:
            limit = greatest(target) if source.is_signed else f"({source.c}){greatest(target)}"
            lines += [f"if (x > {limit}) {{", f"    return {greatest(target)};", "}"]
    if not lines:
        return Op(name, (source,), target, f"(({target.c}){{0}})", doc=doc)
    function = f"fcsl_{name}_from_{source}"
    helper = c_function(f"{target.c} {function}({source.c} x)", *lines, f"return ({target.c})x;")
    return Op(name, (source,), target, f"{function}({{0}})", helper=helper, doc=doc)
