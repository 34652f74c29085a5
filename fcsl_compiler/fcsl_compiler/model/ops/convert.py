# SPDX-License-Identifier: Apache-2.0
"""Conversions between numbers: checked (`i32(x)`), modulo 2^n (`wrap_i32(x)`), saturating (`sat_i32(x)`)."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import INTEGERS, NUMBERS, Scalar
from .op import Doc, Op

GROUP = "Conversions"


def operations() -> Iterator[Op]:
    for source in NUMBERS:
        for target in NUMBERS:
            yield _to_float(source, target) if target.is_float else _checked(source, target)
    for target in INTEGERS:
        for source in INTEGERS:
            yield _wrapping(source, target)
    for target in INTEGERS:
        for source in NUMBERS:
            yield _saturating(source, target)


def _to_float(source: Scalar, target: Scalar) -> Op:
    doc = Doc(GROUP, f"{target}(x)", f"x as {target}", "rounded once, half to even", "beyond the range: an infinity")
    return Op(target.name, (source,), target, doc=doc)


def _checked(source: Scalar, target: Scalar) -> Op:
    doc = Doc(
        GROUP, f"{target}(x)", f"x as {target}, toward zero", "exact but for the fraction", "out of range or NaN: fault"
    )
    fits = source.is_integer and source.low >= target.low and source.high <= target.high
    return Op(target.name, (source,), target, () if fits else (f"the value does not fit {target}",), doc)


def _wrapping(source: Scalar, target: Scalar) -> Op:
    name = f"wrap_{target}"
    meaning = f"x of any integer type, modulo 2^{target.size * 8}, as {target}"
    doc = Doc(GROUP, f"{name}(x)", meaning, "exact: the lowest bits stay", "none")
    return Op(name, (source,), target, doc=doc)


def _saturating(source: Scalar, target: Scalar) -> Op:
    name = f"sat_{target}"
    meaning = f"x toward zero, or the value of {target} that is nearest to it"
    doc = Doc(GROUP, f"{name}(x)", meaning, "exact but for the fraction", "NaN: 0; an infinity: the end of the range")
    return Op(name, (source,), target, doc=doc)
