# SPDX-License-Identifier: Apache-2.0
"""Nim of the conversions between numbers."""

from __future__ import annotations

from collections.abc import Iterator

from ....model.types import F64, INTEGERS, NUMBERS, Scalar
from ...spelling import Entry, entry
from .helpers import FAULT, FAULT_HELPER, imported, literal, nim, proc


def spellings() -> Iterator[Entry]:
    for source in NUMBERS:
        for target in NUMBERS:
            yield _cast(target.name, source, target) if target.is_float else _checked(source, target)
    for target in INTEGERS:
        for source in INTEGERS:
            yield _cast(f"wrap_{target}", source, target)
    for target in INTEGERS:
        for source in NUMBERS:
            yield _saturating(source, target)


def _to(source: Scalar, target: Scalar) -> str:
    return f"fcsl_c_{target}_of_{source}"


def _conversion(source: Scalar, target: Scalar) -> str:
    """C's conversion. To integers it is defined where the value fits, between integers modulo 2^n."""
    return imported(_to(source, target), f"x: {nim(source)}", nim(target), f"({target.c})")


def _cast(name: str, source: Scalar, target: Scalar) -> Entry:
    if source is target:
        return entry(name, (source,), "({0})")
    return entry(name, (source,), f"{_to(source, target)}({{0}})", _conversion(source, target))


def _checked(source: Scalar, target: Scalar) -> Entry:
    test = _float_fits(source, target) if source.is_float else _integer_fits(source, target)
    if not test:
        return _cast(target.name, source, target)
    name, conversion = f"fcsl_{target}_from_{source}", _conversion(source, target)
    helper = proc(
        name,
        f"x: {nim(source)}, {FAULT}",
        nim(target),
        f"if not ({test}):",
        "  fcsl_fault(place, fault)",
        f"  return {literal(0, target)}",
        f"{_to(source, target)}(x)",
    )
    proven = f"{_to(source, target)}({{0}})"
    needs = "\n".join((FAULT_HELPER, conversion, helper))
    return entry(target.name, (source,), f"{name}({{0}}, {{place}}, {{fault}})", needs, proven, conversion)


def _float_fits(source: Scalar, target: Scalar) -> str:
    # Both bounds must be exact in the float type: -2^n - 1 is not, hence >= low for 64 bits and for f32.
    low, above = float(target.low), float(target.high + 1)
    exclusive = target.size == 4 and source is F64
    lower = f"x > {literal(low - 1.0, source)}" if exclusive or not target.low else f"x >= {literal(low, source)}"
    return f"{lower} and x < {literal(above, source)}"


def _integer_fits(source: Scalar, target: Scalar) -> str:
    """The test that a value fits, or "" if every value fits."""
    tests = []
    if source.low < target.low:
        tests.append(f"x >= {literal(max(target.low, source.low), source)}")
    if source.high > target.high:
        tests.append(f"x <= {literal(target.high, source)}")
    return " and ".join(tests)


def _saturating(source: Scalar, target: Scalar) -> Entry:
    name = f"sat_{target}"
    lines: list[str] = []
    low, high = literal(target.low, target), literal(target.high, target)
    if source.is_float:
        lines += ["if x != x:", f"  return {literal(0, target)}"]
        lines += [f"if x <= {literal(float(target.low), source)}:", f"  return {low}"]
        lines += [f"if x >= {literal(float(target.high + 1), source)}:", f"  return {high}"]
    else:
        if source.low < target.low:
            lines += [f"if x < {literal(target.low, source)}:", f"  return {low}"]
        if source.high > target.high:
            lines += [f"if x > {literal(target.high, source)}:", f"  return {high}"]
    if not lines:
        return _cast(name, source, target)
    function = f"fcsl_{name}_from_{source}"
    helper = proc(function, f"x: {nim(source)}", nim(target), *lines, f"{_to(source, target)}(x)")
    return entry(name, (source,), f"{function}({{0}})", "\n".join((_conversion(source, target), helper)))
