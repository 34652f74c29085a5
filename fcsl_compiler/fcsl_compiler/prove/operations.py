# SPDX-License-Identifier: Apache-2.0
"""The op table as terms: the value of each operation, and when it faults.

Arithmetic of floats is expensive for a solver, and most properties do not need it. So its result begins as an unknown of
which only bounds are known (Loose), and gets its definition where a proof depends on it (refine.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from bitwuzla import Kind, RoundingMode, Term

from ..model.literals import round_f32
from ..model.ops import Op, find
from ..model.types import BOOL, F32, I64, U64, Scalar
from .evaluate import Faulted, evaluate
from .terms import Terms, Value, is_known, width

_FLOAT_KINDS = {"+": Kind.FP_ADD, "-": Kind.FP_SUB, "*": Kind.FP_MUL, "/": Kind.FP_DIV, "sqrt": Kind.FP_SQRT}
_COMPARED = {
    "<": (Kind.FP_LT, Kind.BV_SLT, Kind.BV_ULT),
    "<=": (Kind.FP_LEQ, Kind.BV_SLE, Kind.BV_ULE),
    ">": (Kind.FP_GT, Kind.BV_SGT, Kind.BV_UGT),
    ">=": (Kind.FP_GEQ, Kind.BV_SGE, Kind.BV_UGE),
}
_SIGNED = {
    "+": (Kind.BV_ADD, Kind.BV_SADD_OVERFLOW),
    "-": (Kind.BV_SUB, Kind.BV_SSUB_OVERFLOW),
    "*": (Kind.BV_MUL, Kind.BV_SMUL_OVERFLOW),
}
_UNSIGNED_OVERFLOW = {"+": Kind.BV_UADD_OVERFLOW, "-": Kind.BV_USUB_OVERFLOW, "*": Kind.BV_UMUL_OVERFLOW}
_BITS = {"&": Kind.BV_AND, "|": Kind.BV_OR, "^": Kind.BV_XOR}
_ROUNDED = {
    "floor": RoundingMode.RTN,
    "ceil": RoundingMode.RTP,
    "trunc": RoundingMode.RTZ,
    "round": RoundingMode.RNE,
}
_WORDS = {"add": "+", "sub": "-", "mul": "*"}
#: Bounds of results that are no NaN.
_BOUNDS = {
    "sin": (-1.0, 1.0),
    "cos": (-1.0, 1.0),
    "tanh": (-1.0, 1.0),
    "asin": (-math.pi / 2, math.pi / 2),
    "atan": (-math.pi / 2, math.pi / 2),
    "atan2": (-math.pi, math.pi),
    "acos": (0.0, math.pi),
    "sqrt": (-0.0, math.inf),
    "exp": (0.0, math.inf),
    "hypot": (0.0, math.inf),
    "cosh": (1.0, math.inf),
}


@dataclass(frozen=True)
class Loose:
    """A result that stands for an operation of which the solver does not know the definition yet."""

    result: Term
    op: Op
    args: tuple[Value, ...]


class Operations:
    """`exact`: no result is loose. `folded`: operations of known values are computed here."""

    def __init__(self, terms: Terms, exact: bool = False, folded: bool = True):
        self.t, self.exact, self.folded = terms, exact, folded
        self.loose: dict[Term, Loose] = {}
        self.bounds: list[Term] = []  # what holds of loose results; a solver assumes those that it has not seen
        self._made: dict[tuple[str, tuple[object, ...]], Value] = {}

    def apply(self, op: Op, args: Sequence[Value]) -> tuple[Value, Value]:
        """The value of an operation, and whether it faults. The value of one that faults is arbitrary."""
        if self.folded and all(map(is_known, args)):
            try:
                return evaluate(op, args), False
            except Faulted:
                return _zero(op.result), True
        if op.args[0].is_float:
            return self._of_floats(op, args)
        return (self._of_integers if op.args[0].is_integer else self._of_others)(op, args)

    # ---- bools, requests, healths ------------------------------------------------------------------------------------

    def _of_others(self, op: Op, args: Sequence[Value]) -> tuple[Value, Value]:
        t, (type_, *_) = self.t, op.args
        if op.name == "not":
            return t.negation(args[0]), False
        if op.name == "assert":
            return args[0], t.negation(args[0])
        if op.name == "where":
            return t.choose(args[0], args[1], args[2], op.result), False
        equal = t.equal(args[0], args[1], type_)
        return (equal if op.name == "==" else t.negation(equal)), False

    # ---- floats -------------------------------------------------------------------------------------------------------

    def _of_floats(self, op: Op, args: Sequence[Value]) -> tuple[Value, Value]:
        type_, t = op.args[0], self.t
        if op.result.is_integer:
            return self._to_integer(op, args[0])
        x = [t.term(value, type_) for value, type_ in zip(args, op.args, strict=True)]
        name = op.name
        if name in _COMPARED:
            return t.make(_COMPARED[name][0], *x), False
        if name in ("==", "!="):
            equal = t.make(Kind.FP_EQUAL, *x)
            return (equal if name == "==" else t.negation(equal)), False
        if op.result is BOOL:
            return self._test(name, x[0]), False
        if name in ("min", "max", "clamp", "sign", "copysign", "abs", "neg", *_ROUNDED):
            return self._exactly(op, args, x), False
        if name in ("f32", "f64"):
            return self._converted(op, args[0], x[0]), False
        if name in ("**0", "**2", "**3", "**4"):
            return self._power(op, args[0]), False
        if name == "lerp":
            return self._lerp(type_, *args), False
        if name == "wrap_angle":
            return self._wrap_angle(type_, args[0]), False
        return self._arithmetic(op, args), False

    def _arithmetic(self, op: Op, args: Sequence[Value]) -> Value:
        """An operation whose definition may come later, or never."""
        key = (
            op.id,
            tuple(a if isinstance(a, Term) else self.t.term(a, s) for a, s in zip(args, op.args, strict=True)),
        )
        if key not in self._made:
            if self.exact and op.name in _FLOAT_KINDS:
                self._made[key] = self.definition(op, args)
            else:
                result = self.t.fresh(op.result, op.name)
                self.loose[result] = Loose(result, op, tuple(args))
                self._bound(op, result)
                self._made[key] = result
        return self._made[key]

    def _bound(self, op: Op, result: Term) -> None:
        if op.name in _BOUNDS:
            low, high = ((round_f32(b) if op.result is F32 else b) for b in _BOUNDS[op.name])
            inside = self.within(result, low, high, op.result)
            self.bounds.append(self.t.make(Kind.OR, self.t.make(Kind.FP_IS_NAN, result), inside))

    def within(self, x: Term, low: float, high: float, type_: Scalar) -> Term:
        ends = (self.t.term(low, type_), self.t.term(high, type_))
        return self.t.make(Kind.AND, self.t.make(Kind.FP_GEQ, x, ends[0]), self.t.make(Kind.FP_LEQ, x, ends[1]))

    def definition(self, op: Op, args: Sequence[Value]) -> Term | None:
        """The operation itself. None of those that solvers do not know."""
        if op.name not in _FLOAT_KINDS:
            return None
        x = [self.t.term(value, type_) for value, type_ in zip(args, op.args, strict=True)]
        return self.t.make(_FLOAT_KINDS[op.name], self.t.nearest, *x)

    def rules(self, loose: Loose) -> list[Term]:
        """What holds of a sum, difference, product or quotient, and is cheap: when it is NaN, its sign, and on which side
        of an operand it lies. Rounding keeps order."""
        name, r, type_ = loose.op.name, loose.result, loose.op.result
        if name not in ("+", "-", "*", "/"):
            return []
        make, zero = self.t.make, self.t.term(0.0, type_)
        a, b = (self.t.term(x, type_) for x in loose.args)

        def implies(found: Kind, *when: Term) -> Term:
            """Its sign."""
            return make(Kind.OR, is_nan, make(found, r, zero), *(make(Kind.NOT, w) for w in when))

        is_nan = make(Kind.FP_IS_NAN, r)
        nan = [make(Kind.FP_IS_NAN, a), make(Kind.FP_IS_NAN, b)]
        infinite = [make(Kind.FP_IS_INF, x) for x in (a, b)]
        none = [make(Kind.FP_IS_ZERO, x) for x in (a, b)]
        negative = [make(Kind.FP_LEQ, x, zero) for x in (a, b)]
        positive = [make(Kind.FP_GEQ, x, zero) for x in (a, b)]
        if name in "+-":
            signs = [make(Kind.FP_LT, x, zero) for x in (a, b)]
            differ = make(Kind.XOR, *signs) if name == "+" else make(Kind.IFF, *signs)
            nan.append(make(Kind.AND, *infinite, differ))
            up, down = (positive[1], negative[1]) if name == "+" else (negative[1], positive[1])
            found = [make(Kind.OR, is_nan, make(Kind.NOT, up), make(Kind.FP_GEQ, r, a))]
            found.append(make(Kind.OR, is_nan, make(Kind.NOT, down), make(Kind.FP_LEQ, r, a)))
            if name == "+":
                found.append(make(Kind.OR, is_nan, make(Kind.NOT, positive[0]), make(Kind.FP_GEQ, r, b)))
                found.append(make(Kind.OR, is_nan, make(Kind.NOT, negative[0]), make(Kind.FP_LEQ, r, b)))
            else:
                found.append(implies(Kind.FP_GEQ, make(Kind.FP_GEQ, a, b)))
                found.append(implies(Kind.FP_LEQ, make(Kind.FP_LEQ, a, b)))
        else:
            pairs = ((none[0], infinite[1]), (infinite[0], none[1])) if name == "*" else (none, infinite)
            nan += [make(Kind.AND, *pair) for pair in pairs]
            strict = positive if name == "*" else [positive[0], make(Kind.FP_GT, b, zero)]
            below = negative if name == "*" else [negative[0], make(Kind.FP_LT, b, zero)]
            found = [implies(Kind.FP_GEQ, *strict), implies(Kind.FP_GEQ, *below)]
            found += [implies(Kind.FP_LEQ, strict[0], below[1]), implies(Kind.FP_LEQ, below[0], strict[1])]
            one = self.t.term(1.0, type_)
            factors = ((a, b, 0, 1), (b, a, 1, 0)) if name == "*" else ((a, b, 0, 1),)
            for whole, factor, of_whole, of_factor in factors:
                small = make(Kind.FP_LEQ if name == "*" else Kind.FP_GEQ, factor, one)
                outside = [make(Kind.NOT, small), make(Kind.NOT, positive[of_factor])]
                found.append(make(Kind.OR, is_nan, *outside, negative[of_whole], make(Kind.FP_LEQ, r, whole)))
                found.append(make(Kind.OR, is_nan, *outside, positive[of_whole], make(Kind.FP_GEQ, r, whole)))
        return [make(Kind.IFF, is_nan, make(Kind.OR, *nan)), *found]

    def _test(self, name: str, x: Term) -> Term:
        nan, infinite = self.t.make(Kind.FP_IS_NAN, x), self.t.make(Kind.FP_IS_INF, x)
        if name == "isfinite":
            return self.t.make(Kind.NOT, self.t.make(Kind.OR, nan, infinite))
        return nan if name == "isnan" else infinite

    def _exactly(self, op: Op, args: Sequence[Value], x: list[Term]) -> Value:
        t, type_, name = self.t, op.result, op.name
        if name in ("abs", "neg"):
            return t.make(Kind.FP_ABS if name == "abs" else Kind.FP_NEG, x[0])
        if name in _ROUNDED:
            return t.make(Kind.FP_RTI, t.mode(_ROUNDED[name]), x[0])
        if name == "copysign":
            size = t.make(Kind.FP_ABS, x[0])
            is_negative = t.make(Kind.FP_IS_NEG, x[1])  # of no NaN
            return t.choose(is_negative, t.make(Kind.FP_NEG, size), size, type_)
        if name == "sign":
            zero = t.term(0.0, type_)
            negative = t.choose(t.make(Kind.FP_LT, x[0], zero), -1.0, args[0], type_)
            return t.choose(t.make(Kind.FP_GT, x[0], zero), 1.0, negative, type_)
        if name == "clamp":
            raised = t.choose(t.make(Kind.FP_GT, x[1], x[0]), args[1], args[0], type_)
            below = t.make(Kind.FP_LT, x[2], t.term(raised, type_))
            return t.choose(below, args[2], raised, type_)
        kind = Kind.FP_LT if name == "min" else Kind.FP_GT
        return t.choose(t.make(kind, x[1], x[0]), args[1], args[0], type_)

    def _converted(self, op: Op, arg: Value, x: Term) -> Value:
        """f32 or f64 of the other one."""
        if op.args[0] is op.result:
            return arg
        sizes = (8, 24) if op.result is F32 else (11, 53)
        return self.t.make(Kind.FP_TO_FP_FROM_FP, self.t.nearest, x, indices=sizes)

    def _float(self, name: str, type_: Scalar, *args: Value) -> Value:
        """Arithmetic of floats within an operation."""
        op = find(name, (type_,) * len(args))
        assert op is not None
        return self.apply(op, args)[0]

    def _power(self, op: Op, x: Value) -> Value:
        exponent = int(op.name[2:])
        if exponent == 0:
            return 1.0
        found = x
        for _ in range(exponent - 1):
            found = self._float("*", op.result, found, x)
        return found

    def _lerp(self, type_: Scalar, a: Value, b: Value, s: Value) -> Value:
        f = self._float
        span = f("-", type_, b, a)
        low = f("+", type_, a, f("*", type_, s, span))
        high = f("-", type_, b, f("*", type_, f("-", type_, 1.0, s), span))
        return self.t.choose(f("<", type_, s, 0.5), low, high, type_)

    def _wrap_angle(self, type_: Scalar, x: Value) -> Value:
        f = self._float
        half, turn = (round_f32(v) if type_ is F32 else v for v in (math.pi, 2.0 * math.pi))
        rest = f("fmod", type_, x, turn)
        below = self.t.choose(f("<", type_, rest, -half), f("+", type_, rest, turn), rest, type_)
        return self.t.choose(f(">", type_, rest, half), f("-", type_, rest, turn), below, type_)

    def _to_integer(self, op: Op, arg: Value) -> tuple[Value, Value]:
        """Checked, or saturating (`sat_i32`)."""
        t, target, source = self.t, op.result, op.args[0]
        x = t.term(arg, source)
        bits = width(target)
        converted = t.make(
            Kind.FP_TO_SBV if target.is_signed else Kind.FP_TO_UBV, t.mode(RoundingMode.RTZ), x, indices=(bits,)
        )
        whole = t.make(Kind.FP_RTI, t.mode(RoundingMode.RTZ), x)
        above = t.make(Kind.FP_GEQ, whole, t.term(float(target.high + 1), source))
        below = t.make(Kind.FP_LT, whole, t.term(float(target.low), source))
        nan = t.make(Kind.FP_IS_NAN, x)
        if op.name == target.name:
            return converted, t.any_of((nan, above, below))
        found = t.choose(below, target.low, t.choose(above, target.high, converted, target), target)
        return t.choose(nan, 0, found, target), False

    # ---- integers -----------------------------------------------------------------------------------------------------

    def _of_integers(self, op: Op, args: Sequence[Value]) -> tuple[Value, Value]:
        t, type_, name = self.t, op.args[0], op.name
        x = [t.term(value, of) for value, of in zip(args, op.args, strict=True)]
        if name in _COMPARED:
            return t.make(_COMPARED[name][1 if type_.is_signed else 2], *x), False
        if name in ("==", "!="):
            equal = t.equal(args[0], args[1], type_)
            return (equal if name == "==" else t.negation(equal)), False
        if op.result.is_float:
            kind = Kind.FP_TO_FP_FROM_SBV if type_.is_signed else Kind.FP_TO_FP_FROM_UBV
            sizes = (8, 24) if op.result is F32 else (11, 53)
            return t.make(kind, t.nearest, x[0], indices=sizes), False
        if len(op.args) == 1 and (name == op.result.name or name.startswith(("wrap_", "sat_"))):
            return self._between_integers(op, x[0])
        if name in ("min", "max", "clamp", "sign", "abs", "neg", "~"):
            return self._simple(op, args, x)
        if name in _BITS:
            return t.make(_BITS[name], *x), False
        if name in ("//", "%"):
            return self._divided(op, x)
        if name in ("<<", ">>"):
            return self._shifted(op, x)
        if name.startswith("**"):
            return self._integer_power(op, args[0])
        if name.startswith("wrap_"):
            return t.make(_SIGNED[_WORDS[name[5:]]][0], *x), False
        if name.startswith("sat_"):
            return self._saturated(_WORDS[name[4:]], type_, x), False
        kind, overflow = _SIGNED[name]
        return t.make(kind, *x), t.make(overflow, *x) if type_.is_signed else False

    def _simple(self, op: Op, args: Sequence[Value], x: list[Term]) -> tuple[Value, Value]:
        t, type_, name = self.t, op.args[0], op.name
        less = Kind.BV_SLT if type_.is_signed else Kind.BV_ULT
        if name == "~":
            return t.make(Kind.BV_NOT, x[0]), False
        if name in ("min", "max"):
            first = t.make(less, x[1], x[0]) if name == "min" else t.make(less, x[0], x[1])
            return t.choose(first, args[1], args[0], type_), False
        if name == "clamp":
            raised = t.choose(t.make(less, x[0], x[1]), args[1], args[0], type_)
            return t.choose(t.make(less, x[2], t.term(raised, type_)), args[2], raised, type_), False
        negated = t.make(Kind.BV_NEG, x[0])
        least = t.equal(x[0], type_.low, type_) if type_.is_signed else False
        if name == "neg":
            return negated, least
        zero = t.term(0, type_)
        negative = t.make(Kind.BV_SLT, x[0], zero)
        if name == "abs":
            return t.choose(negative, negated, x[0], type_), least
        positive = t.make(Kind.BV_SGT, x[0], zero)
        return t.choose(positive, 1, t.choose(negative, -1, x[0], type_), type_), False

    def _resized(self, x: Term, source: Scalar, bits: int) -> Term:
        more = bits - width(source)
        if more > 0:
            kind = Kind.BV_SIGN_EXTEND if source.is_signed else Kind.BV_ZERO_EXTEND
            return self.t.make(kind, x, indices=(more,))
        return self.t.make(Kind.BV_EXTRACT, x, indices=(bits - 1, 0)) if more else x

    def _between_integers(self, op: Op, x: Term) -> tuple[Value, Value]:
        t, source, target = self.t, op.args[0], op.result
        found = self._resized(x, source, width(target))
        if op.name.startswith("wrap_"):
            return found, False
        less = Kind.BV_SLT if source.is_signed else Kind.BV_ULT
        below = t.make(less, x, t.term(target.low, source)) if source.low < target.low else False
        above = t.make(less, t.term(target.high, source), x) if source.high > target.high else False
        if op.name == target.name:
            return found, t.any_of((below, above))
        return t.choose(below, target.low, t.choose(above, target.high, found, target), target), False

    def _saturated(self, symbol: str, type_: Scalar, x: list[Term]) -> Value:
        t = self.t
        kind, signed = _SIGNED[symbol]
        overflow = t.make(signed if type_.is_signed else _UNSIGNED_OVERFLOW[symbol], *x)
        if not type_.is_signed:
            return t.choose(overflow, 0 if symbol == "-" else type_.high, t.make(kind, *x), type_)
        negative = [t.make(Kind.BV_SLT, operand, t.term(0, type_)) for operand in x]
        below = t.make(Kind.XOR, *negative) if symbol == "*" else negative[0]
        return t.choose(overflow, t.choose(below, type_.low, type_.high, type_), t.make(kind, *x), type_)

    def _divided(self, op: Op, x: list[Term]) -> tuple[Value, Value]:
        """Floor division as in Python."""
        t, type_ = self.t, op.args[0]
        zero = t.term(0, type_)
        by_zero = t.equal(x[1], zero, type_)
        if not type_.is_signed:
            return t.make(Kind.BV_UDIV if op.name == "//" else Kind.BV_UREM, *x), by_zero
        remainder = t.make(Kind.BV_SMOD, *x)  # has the sign of the divisor
        if op.name == "%":
            return remainder, by_zero
        least = t.all_of((t.equal(x[0], type_.low, type_), t.equal(x[1], -1, type_)))
        toward_zero, rest = t.make(Kind.BV_SDIV, *x), t.make(Kind.BV_SREM, *x)
        has_rest = t.negation(t.equal(rest, zero, type_))
        differ = t.make(Kind.XOR, t.make(Kind.BV_SLT, rest, zero), t.make(Kind.BV_SLT, x[1], zero))
        floored = t.choose(
            t.all_of((has_rest, differ)), t.make(Kind.BV_SUB, toward_zero, t.term(1, type_)), toward_zero, type_
        )
        return floored, t.any_of((by_zero, least))

    def _shifted(self, op: Op, x: list[Term]) -> tuple[Value, Value]:
        t, (type_, count) = self.t, op.args
        bits = width(type_)
        wide = self._resized(x[1], count, 64)
        beyond = t.make(Kind.BV_UGE, wide, t.term(bits, U64))
        by = self._resized(wide, I64, bits)
        kind = Kind.BV_SHL if op.name == "<<" else Kind.BV_ASHR if type_.is_signed else Kind.BV_SHR
        return t.make(kind, x[0], by), beyond

    def _integer_power(self, op: Op, x: Value) -> tuple[Value, Value]:
        exponent, type_ = int(op.name[2:]), op.result
        if exponent == 0:
            return 1, False
        product = find("*", (type_, type_))
        assert product is not None
        found, faults = x, []
        for _ in range(exponent - 1):
            found, fault = self.apply(product, (found, x))
            faults.append(fault)
        return found, self.t.any_of(faults)


def _zero(type_: Scalar) -> Value:
    return False if type_ is BOOL else 0.0 if type_.is_float else 0
