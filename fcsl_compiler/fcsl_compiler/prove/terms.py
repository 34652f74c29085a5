# SPDX-License-Identifier: Apache-2.0
"""Scalars of the language as terms of Bitwuzla: bits for integers, IEEE 754 for floats.

A scalar is a Python value (bool, int, float; requests and healths are their numbers) where it is known, and a term
otherwise. Known parts of an expression are folded.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterable, Sequence
from typing import Any

from bitwuzla import Kind, RoundingMode, Sort, Term, TermManager

from ..model.types import BOOL, F32, F64, Scalar

#: A scalar: known, or a term.
Value = Any

#: Widths of exponent and significand, the hidden bit included.
_FORMATS = {F32: (8, 24), F64: (11, 53)}


def is_known(value: Value) -> bool:
    return not isinstance(value, Term)


def same(a: Value, b: Value) -> bool:
    """Whether two scalars of one type are certainly equal, bit for bit."""
    if isinstance(a, Term) or isinstance(b, Term):
        return isinstance(a, Term) and isinstance(b, Term) and bool(a == b)
    if isinstance(a, float) and isinstance(b, float):
        return bits_of(a, F64) == bits_of(b, F64)
    return bool(a == b)


def bits_of(value: float, type_: Scalar) -> int:
    """The bits of a float; of each NaN those of the quiet one."""
    if math.isnan(value):
        return 0x7FC00000 if type_ is F32 else 0x7FF8000000000000
    return int.from_bytes(struct.pack(">f" if type_ is F32 else ">d", value), "big")


def float_of(bits: int, type_: Scalar) -> float:
    code, size = (">f", 4) if type_ is F32 else (">d", 8)
    value: float = struct.unpack(code, bits.to_bytes(size, "big"))[0]
    return value


class Terms:
    """Makes terms."""

    def __init__(self) -> None:
        self.manager = TermManager()
        self.nearest = self.manager.mk_rm_value(RoundingMode.RNE)
        self._known: dict[tuple[str, Any], Term] = {}
        self._sorts: dict[Scalar, Sort] = {}
        self._fresh = 0

    def mode(self, mode: RoundingMode) -> Term:
        return self.manager.mk_rm_value(mode)

    def make(self, kind: Kind, *args: Term, indices: Sequence[int] = ()) -> Term:
        return self.manager.mk_term(kind, list(args), list(indices))

    def sort(self, type_: Scalar) -> Sort:
        if type_ not in self._sorts:
            if type_ is BOOL:
                made = self.manager.mk_bool_sort()
            elif type_.is_float:
                made = self.manager.mk_fp_sort(*_FORMATS[type_])
            else:
                made = self.manager.mk_bv_sort(width(type_))
            self._sorts[type_] = made
        return self._sorts[type_]

    def fresh(self, type_: Scalar, name: str) -> Term:
        """A new unknown."""
        self._fresh += 1
        return self.manager.mk_const(self.sort(type_), f"{name}#{self._fresh}")

    def term(self, value: Value, type_: Scalar) -> Term:
        if isinstance(value, Term):
            return value
        key = (type_.name, bits_of(value, F64) if type_.is_float else value)
        if key not in self._known:
            self._known[key] = self._constant(value, type_)
        return self._known[key]

    def _constant(self, value: Any, type_: Scalar) -> Term:
        m = self.manager
        if type_ is BOOL:
            return m.mk_true() if value else m.mk_false()
        if not type_.is_float:
            return m.mk_bv_value(self.sort(type_), value & (1 << width(type_)) - 1)
        exponent, significand = _FORMATS[type_]
        bits, below = bits_of(value, type_), significand - 1
        parts = ((1, bits >> (exponent + below)), (exponent, bits >> below), (below, bits))
        return m.mk_fp_value(*(m.mk_bv_value(m.mk_bv_sort(n), part & (1 << n) - 1) for n, part in parts))

    # ---- conditions -------------------------------------------------------------------------------------------------

    def negation(self, a: Value) -> Value:
        if not isinstance(a, Term):
            return not a
        return a.children()[0] if a.kind() == Kind.NOT else self.make(Kind.NOT, a)

    def all_of(self, parts: Iterable[Value]) -> Value:
        unknown: list[Term] = []
        for part in parts:
            if isinstance(part, Term):
                unknown.append(part)
            elif not part:
                return False
        unknown = list(dict.fromkeys(unknown))
        return self.make(Kind.AND, *unknown) if len(unknown) > 1 else unknown[0] if unknown else True

    def any_of(self, parts: Iterable[Value]) -> Value:
        unknown: list[Term] = []
        for part in parts:
            if isinstance(part, Term):
                unknown.append(part)
            elif part:
                return True
        unknown = list(dict.fromkeys(unknown))
        return self.make(Kind.OR, *unknown) if len(unknown) > 1 else unknown[0] if unknown else False

    def choose(self, condition: Value, then: Value, otherwise: Value, type_: Scalar) -> Value:
        if not isinstance(condition, Term):
            return then if condition else otherwise
        if same(then, otherwise):
            return then
        if type_ is BOOL and (is_known(then) or is_known(otherwise)):
            if is_known(then):
                return (
                    self.any_of((condition, otherwise)) if then else self.all_of((self.negation(condition), otherwise))
                )
            return self.any_of((self.negation(condition), then)) if otherwise else self.all_of((condition, then))
        return self.make(Kind.ITE, condition, self.term(then, type_), self.term(otherwise, type_))

    def equal(self, a: Value, b: Value, type_: Scalar) -> Value:
        """Equality of bits; of any two NaNs, too."""
        if same(a, b):
            return True
        if is_known(a) and is_known(b):
            return False
        return self.make(Kind.EQUAL, self.term(a, type_), self.term(b, type_))


def width(type_: Scalar) -> int:
    """Bits of an integer, a request or a health."""
    return type_.size * 8
