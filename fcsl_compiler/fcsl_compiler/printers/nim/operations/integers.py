# SPDX-License-Identifier: Apache-2.0
"""Nim of checked, wrapping and saturating integer arithmetic, division, shifts, bits."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import INTEGERS, U64, Scalar
from ...spelling import Entry, entry
from .helpers import FAULT, FAULT_HELPER, imported, literal, nim, proc

_ARITHMETIC = (("+", "add"), ("-", "sub"), ("*", "mul"))


def spellings() -> Iterator[Entry]:
    for t in INTEGERS:
        yield from _signed(t) if t.is_signed else _unsigned(t)
        yield from _bits(t)
    for symbol, word in _ARITHMETIC:
        for t in INTEGERS:
            yield _wrapping(symbol, word, t)
            yield _saturating(word, t)


def overflowing(word: str, t: Scalar) -> str:
    """Stores the lowest bits of a result, and says whether it does not fit."""
    arguments = f"a, b: {nim(t)}, to: ptr {nim(t)}"
    return imported(f"fcsl_overflows_{word}_{t}", arguments, "bool", f"__builtin_{word}_overflow")


def _faulting(name: str, arguments: str, t: Scalar, test: str, *rest: str) -> str:
    """A helper that faults and returns 0 if `test` is true."""
    lines = (f"if {test}:", "  fcsl_fault(place, fault)", f"  return {literal(0, t)}", *rest)
    return FAULT_HELPER + "\n" + proc(name, f"{arguments}, {FAULT}", nim(t), *lines)


def _signed(t: Scalar) -> Iterator[Entry]:
    pair, zero = f"a, b: {nim(t)}", literal(0, t)
    for symbol, word in _ARITHMETIC:
        name = f"fcsl_{word}_{t}"
        body = (f"if fcsl_overflows_{word}_{t}(a, b, addr result):", "  fcsl_fault(place, fault)", f"  result = {zero}")
        helper = "\n".join((FAULT_HELPER, overflowing(word, t), proc(name, f"{pair}, {FAULT}", nim(t), *body)))
        yield entry(symbol, (t, t), f"{name}({{0}}, {{1}}, {{place}}, {{fault}})", helper, f"({{0}} {symbol} {{1}})")
    helper = _faulting(f"fcsl_neg_{t}", f"a: {nim(t)}", t, f"a == {literal(t.low, t)}", "-a")
    yield entry("neg", (t,), f"fcsl_neg_{t}({{0}}, {{place}}, {{fault}})", helper, "(-{0})")
    yield from _floor_division(t)


def _floor_division(t: Scalar) -> Iterator[Entry]:
    """Floor division: Nim truncates, Python floors. Each sign of the divisor has a separate branch without an
    intermediate overflow."""
    zero = literal(0, t)
    remainder = ("let remainder = a mod b",)
    quotients = ("if a < 0: not (not a div b) else: a div b", "if a > 0: (a - 1) div b - 1 else: a div b")
    remainders = ("if remainder < 0: remainder + b else: remainder", "if remainder > 0: remainder + b else: remainder")
    # low mod -1 is 0 in Python; the processor faults.
    negated = (f"if b == -1 and a != {literal(t.low, t)}:", "  return -a")
    for symbol, word, first, results, last, places in (
        (
            "//",
            "floordiv",
            (),
            quotients,
            (*negated, "fcsl_fault(if b == 0: place_of_zero else: place_of_overflow, fault)"),
            "place_of_zero, place_of_overflow: uint32, fault: ptr uint32",
        ),
        ("%", "mod", remainder, remainders, ("if b == 0:", "  fcsl_fault(place, fault)"), FAULT),
    ):
        pair, name = f"a, b: {nim(t)}", f"fcsl_{word}_{t}"
        positive = ("if b > 0:", *(f"  {line}" for line in first), f"  return {results[0]}")
        negative = ("if b < -1:", *(f"  {line}" for line in first), f"  return {results[1]}")
        proven = f"fcsl_{word}_proven_{t}"
        yield entry(
            symbol,
            (t, t),
            f"{name}({{0}}, {{1}}, {{place}}, {{fault}})",
            FAULT_HELPER + "\n" + proc(name, f"{pair}, {places}", nim(t), *positive, *negative, *last, zero),
            f"{proven}({{0}}, {{1}})",
            proc(proven, pair, nim(t), *positive, *first, results[1]),
        )


def _unsigned(t: Scalar) -> Iterator[Entry]:
    for symbol, _ in _ARITHMETIC:
        yield entry(symbol, (t, t), f"({{0}} {symbol} {{1}})")
    yield entry("neg", (t,), f"({literal(0, t)} - {{0}})")
    for symbol, word, operator in (("//", "floordiv", "div"), ("%", "mod", "mod")):
        name = f"fcsl_{word}_{t}"
        helper = _faulting(name, f"a, b: {nim(t)}", t, f"b == {literal(0, t)}", f"a {operator} b")
        text = f"{name}({{0}}, {{1}}, {{place}}, {{fault}})"
        yield entry(symbol, (t, t), text, helper, f"({{0}} {operator} {{1}})")


def _bits(t: Scalar) -> Iterator[Entry]:
    for symbol, operator in (("&", "and"), ("|", "or"), ("^", "xor")):
        yield entry(symbol, (t, t), f"({{0}} {operator} {{1}})")
    yield entry("~", (t,), "(not {0})")
    shifts = [("<<", "shl", "a shl n")] if not t.is_signed else []
    # Of a negative number only the complement is shifted, so the result is Python's floor with every compiler.
    shifts.append((">>", "shr", "if a < 0: not (not a shr n) else: a shr n" if t.is_signed else "a shr n"))
    for symbol, word, expression in shifts:
        name, proven = f"fcsl_{word}_{t}", f"fcsl_{word}_proven_{t}"
        arguments = f"a: {nim(t)}, n: uint64"
        # Every count becomes a uint64. A negative count becomes so large that it faults.
        helper = _faulting(name, arguments, t, f"n >= {t.size * 8}'u64", expression)
        proven_helper = proc(proven, arguments, nim(t), expression)
        for count in INTEGERS:
            to = imported(f"fcsl_c_u64_of_{count}", f"x: {nim(count)}", "uint64", "(uint64_t)")
            n = "{1}" if count is U64 else f"fcsl_c_u64_of_{count}({{1}})"
            needs = "" if count is U64 else to + "\n"
            text = f"{name}({{0}}, {n}, {{place}}, {{fault}})"
            yield entry(symbol, (t, count), text, needs + helper, f"{proven}({{0}}, {n})", needs + proven_helper)


def _wrapping(symbol: str, word: str, t: Scalar) -> Entry:
    name = f"wrap_{word}"
    if not t.is_signed:
        return entry(name, (t, t), f"({{0}} {symbol} {{1}})")
    body = f"discard fcsl_overflows_{word}_{t}(a, b, addr result) # leaves the lowest {t.size * 8} bits"
    helper = overflowing(word, t) + "\n" + proc(f"fcsl_{name}_{t}", f"a, b: {nim(t)}", nim(t), body)
    return entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)


def _saturating(word: str, t: Scalar) -> Entry:
    name = f"sat_{word}"
    low, high = literal(t.low, t), literal(t.high, t)
    if not t.is_signed:
        limit = low if word == "sub" else high
    else:
        # a + b overflows only if both have the same sign, a - b only if the signs differ.
        below = "(a < 0) != (b < 0)" if word == "mul" else "a < 0"
        limit = f"(if {below}: {low} else: {high})"
    lines = (f"if fcsl_overflows_{word}_{t}(a, b, addr result):", f"  result = {limit}")
    helper = overflowing(word, t) + "\n" + proc(f"fcsl_{name}_{t}", f"a, b: {nim(t)}", nim(t), *lines)
    return entry(name, (t, t), f"fcsl_{name}_{t}({{0}}, {{1}})", helper)
