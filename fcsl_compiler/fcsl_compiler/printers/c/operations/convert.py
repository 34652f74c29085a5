# SPDX-License-Identifier: Apache-2.0
"""C of the conversions between numbers."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import F32, F64, INTEGERS, NUMBERS, Scalar
from ...spelling import Entry, entry
from .helpers import c_function, greatest, least


def spellings() -> Iterator[Entry]:
    for source in NUMBERS:
        for target in NUMBERS:
            yield _cast(target.name, source, target) if target.is_float else _checked(source, target)
    for target in INTEGERS:
        for source in INTEGERS:
            # Conversion to a signed type is implementation-defined in C; gcc and clang define it as modulo 2^n.
            yield _cast(f"wrap_{target}", source, target)
    for target in INTEGERS:
        for source in NUMBERS:
            yield _saturating(source, target)


def _cast(name: str, source: Scalar, target: Scalar) -> Entry:
    return entry(name, (source,), f"(({target.c}){{0}})")


def _checked(source: Scalar, target: Scalar) -> Entry:
    test = _float_fits(source, target) if source.is_float else _integer_fits(source, target)
    if not test:
        return _cast(target.name, source, target)
    name = f"fcsl_{target}_from_{source}"
    helper = c_function(
        f"{target.c} {name}({source.c} x, uint32_t place, uint32_t *fault)",
        f"if (!({test})) {{",
        "    fcsl_fault(place, fault);",
        "    return 0;",
        "}",
        f"return ({target.c})x;",
    )
    return entry(target.name, (source,), f"{name}({{0}}, {{place}}, {{fault}})", helper, f"(({target.c}){{0}})")


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


def _saturating(source: Scalar, target: Scalar) -> Entry:
    name = f"sat_{target}"
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
        return _cast(name, source, target)
    function = f"fcsl_{name}_from_{source}"
    helper = c_function(f"{target.c} {function}({source.c} x)", *lines, f"return ({target.c})x;")
    return entry(name, (source,), f"{function}({{0}})", helper)
