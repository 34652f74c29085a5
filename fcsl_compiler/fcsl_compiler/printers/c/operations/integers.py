# SPDX-License-Identifier: Apache-2.0
"""C of checked, wrapping and saturating integer arithmetic, division, shifts, bits."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import I32, INTEGERS, Scalar
from ...spelling import Entry, entry
from .helpers import c_function, greatest, least

_ARITHMETIC = (("+", "add"), ("-", "sub"), ("*", "mul"))


def spellings() -> Iterator[Entry]:
    for t in INTEGERS:
        yield from _signed(t) if t.is_signed else _unsigned(t)
        yield from _bits(t)
    for symbol, word in _ARITHMETIC:
        for t in INTEGERS:
            yield _wrapping(symbol, word, t)
            yield _saturating(word, t)


def _faulting(signature: str, test: str, *rest: str) -> str:
    """A C helper that faults and returns 0 if `test` is true."""
    return c_function(signature, f"if ({test}) {{", "    fcsl_fault(place, fault);", "    return 0;", "}", *rest)


def _plain(symbol: str, t: Scalar) -> str:
    """C arithmetic. The cast keeps 64-bit arithmetic on two literals from being done in 32 bits."""
    cast = "" if t is I32 else f"({t.c})"
    return f"({cast}{{0}} {symbol} {{1}})"


def _signed(t: Scalar) -> Iterator[Entry]:
    for symbol, word in _ARITHMETIC:
        name = f"fcsl_{word}_{t}"
        helper = c_function(
            f"{t.c} {name}({t.c} a, {t.c} b, uint32_t place, uint32_t *fault)",
            f"{t.c} result = 0;",
            f"if (__builtin_{word}_overflow(a, b, &result)) {{",
            "    fcsl_fault(place, fault);",
            "    result = 0;",
            "}",
            "return result;",
        )
        yield entry(symbol, (t, t), f"{name}({{0}}, {{1}}, {{place}}, {{fault}})", helper, _plain(symbol, t))
    helper = _faulting(
        f"{t.c} fcsl_neg_{t}({t.c} a, uint32_t place, uint32_t *fault)", f"a == {least(t)}", "return -a;"
    )
    yield entry("neg", (t,), f"fcsl_neg_{t}({{0}}, {{place}}, {{fault}})", helper, "(-{0})")
    yield from _floor_division(t)


def _floor_division(t: Scalar) -> Iterator[Entry]:
    """Floor division: C truncates, Python floors. Each sign of the divisor has a separate branch without an
    intermediate overflow. A value analysis can prove this, and a divisor of known sign leaves one branch."""
    remainder = (f"const {t.c} remainder = a % b;",)
    quotients = ("a < 0 ? ~(~a / b) : a / b", "a > 0 ? (a - 1) / b - 1 : a / b")
    remainders = ("remainder < 0 ? remainder + b : remainder", "remainder > 0 ? remainder + b : remainder")
    # MIN % -1 is 0 in Python; it is undefined in C.
    negated = _branch(f"b == -1 && a != {least(t)}", ("return -a;",))
    zero = _branch("b == 0", ("fcsl_fault(place, fault);",))
    for symbol, word, first, results, last, places in (
        (
            "//",
            "floordiv",
            (),
            quotients,
            (*negated, "fcsl_fault(b == 0 ? zero : overflow, fault);"),
            "uint32_t zero, uint32_t overflow",
        ),
        ("%", "mod", remainder, remainders, zero, "uint32_t place"),
    ):
        positive, negative = ((*first, f"return {result};") for result in results)
        signature = f"{t.c} fcsl_{word}_{{}}{t}({t.c} a, {t.c} b{{}})"
        yield entry(
            symbol,
            (t, t),
            f"fcsl_{word}_{t}({{0}}, {{1}}, {{place}}, {{fault}})",
            c_function(
                signature.format("", f", {places}, uint32_t *fault"),
                *_branch("b > 0", positive),
                *_branch("b < -1", negative),
                *last,
                "return 0;",
            ),
            f"fcsl_{word}_proven_{t}({{0}}, {{1}})",
            c_function(signature.format("proven_", ""), *_branch("b > 0", positive), *negative),
        )


def _branch(test: str, lines: tuple[str, ...]) -> tuple[str, ...]:
    return (f"if ({test}) {{", *(f"    {line}" for line in lines), "}")


def _unsigned(t: Scalar) -> Iterator[Entry]:
    for symbol, _ in _ARITHMETIC:
        yield entry(symbol, (t, t), _plain(symbol, t))
    yield entry("neg", (t,), f"(({t.c})0 - {{0}})")
    for symbol, word, c_op in (("//", "floordiv", "/"), ("%", "mod", "%")):
        name = f"fcsl_{word}_{t}"
        helper = _faulting(
            f"{t.c} {name}({t.c} a, {t.c} b, uint32_t place, uint32_t *fault)", "b == 0", f"return a {c_op} b;"
        )
        c = f"{name}({{0}}, {{1}}, {{place}}, {{fault}})"
        yield entry(symbol, (t, t), c, helper, f"({{0}} {c_op} {{1}})")


def _bits(t: Scalar) -> Iterator[Entry]:
    for symbol in "&|^":
        yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
    wide = f"({t.c})" if t.size == 8 else ""  # literals may have 32 bits
    yield entry("~", (t,), f"(~{wide}{{0}})")
    shifts = [("<<", "shl", "a << n")] if not t.is_signed else []
    # A right shift of a negative number is implementation-defined in C. This gives Python's floor on every compiler.
    shifts.append((">>", "shr", "a < 0 ? ~(~a >> n) : a >> n" if t.is_signed else "a >> n"))
    for symbol, word, expression in shifts:
        name = f"fcsl_{word}_{t}"
        # Every count converts to uint64_t. A negative count becomes so large that it faults.
        signature, test = f"{t.c} {name}({t.c} a, uint64_t n, uint32_t place, uint32_t *fault)", f"n >= {t.size * 8}u"
        helper = _faulting(signature, test, f"return {expression};")
        proven, proven_helper = f"({wide}{{0}} {symbol} {{1}})", ""
        if t.is_signed:
            proven = f"fcsl_{word}_proven_{t}({{0}}, (uint64_t){{1}})"
            proven_helper = c_function(f"{t.c} fcsl_{word}_proven_{t}({t.c} a, uint64_t n)", f"return {expression};")
        for count in INTEGERS:
            c = f"{name}({{0}}, (uint64_t){{1}}, {{place}}, {{fault}})"
            yield entry(symbol, (t, count), c, helper, proven, proven_helper)


def _wrapping(symbol: str, word: str, t: Scalar) -> Entry:
    name = f"wrap_{word}"
    if not t.is_signed:
        return entry(name, (t, t), _plain(symbol, t))
    helper = c_function(
        f"{t.c} fcsl_{name}_{t}({t.c} a, {t.c} b)",
        f"{t.c} result = 0;",
        f"(void)__builtin_{word}_overflow(a, b, &result); /* leaves the lowest {t.size * 8} bits */",
        "return result;",
    )
    return entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)


def _saturating(word: str, t: Scalar) -> Entry:
    name = f"sat_{word}"
    if not t.is_signed:
        limit = "0" if word == "sub" else greatest(t)
    else:
        # a + b overflows only if both have the same sign, a - b only if the signs differ.
        below = "(a < 0) != (b < 0)" if word == "mul" else "a < 0"
        limit = f"{below} ? {least(t)} : {greatest(t)}"
    helper = c_function(
        f"{t.c} fcsl_{name}_{t}({t.c} a, {t.c} b)",
        f"{t.c} result = 0;",
        f"if (__builtin_{word}_overflow(a, b, &result)) {{",
        f"    result = {limit};",
        "}",
        "return result;",
    )
    return entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)
