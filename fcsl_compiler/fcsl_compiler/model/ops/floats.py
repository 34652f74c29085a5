# SPDX-License-Identifier: Apache-2.0
"""Operations of f32 and f64. All except `lerp` are exact or rounded once. None faults."""

from __future__ import annotations

from collections.abc import Iterator

from ..types import BOOL, F32, F64, Scalar
from .op import Doc, Op

_ELEMENTARY_GROUP = "Elementary functions"
_ROUNDING_GROUP = "Rounding and remainders"
_BLENDING_GROUP = "Signs, blending, angles"
_TESTS_GROUP = "Tests"

_ONCE = "rounded once"
_EXACT = "exact"

#: call, meaning, where it ends
_ELEMENTARY = (
    ("sin(x)", "sine of x rad", "x infinite: NaN"),
    ("cos(x)", "cosine of x rad", "x infinite: NaN"),
    ("tan(x)", "tangent of x rad", "x infinite: NaN; no float is a pole"),
    ("asin(x)", "arc sine, rad, in [-pi/2, pi/2]", "x outside [-1, 1]: NaN"),
    ("acos(x)", "arc cosine, rad, in [0, pi]", "x outside [-1, 1]: NaN"),
    ("atan(x)", "arc tangent, rad, in [-pi/2, pi/2]", "x infinite: pi/2 with the sign of x"),
    ("atan2(y, x)", "angle of the point (x, y), rad, in [-pi, pi]", "both zero: 0 for x = +0, pi for x = -0, with the sign of y"),
    ("sinh(x)", "hyperbolic sine", "overflows to an infinity"),
    ("cosh(x)", "hyperbolic cosine", "overflows to inf"),
    ("tanh(x)", "hyperbolic tangent, in [-1, 1]", "x infinite: 1 with the sign of x"),
    ("exp(x)", "e to the x", "overflows to inf"),
    ("expm1(x)", "e to the x, minus 1, accurate near 0", "overflows to inf"),
    ("log(x)", "natural logarithm", "x = 0: -inf; x < 0: NaN"),
    ("log1p(x)", "natural logarithm of 1 + x, accurate near 0", "x = -1: -inf; x < -1: NaN"),
    ("log2(x)", "logarithm to base 2", "x = 0: -inf; x < 0: NaN"),
    ("log10(x)", "logarithm to base 10", "x = 0: -inf; x < 0: NaN"),
    ("pow(x, y)", "x to the y, as IEEE 754 defines it", "y = 0 or x = 1: 1, even beside NaN; x < 0 and y no integer: NaN; x = 0 and y < 0: an infinity"),
    ("cbrt(x)", "cube root, with the sign of x", "none"),
    ("hypot(x, y)", "sqrt(x*x + y*y), without overflow on the way", "an infinite operand gives inf, even beside NaN"),
)  # fmt: skip


#: Names and numbers of operands of the elementary functions other than sqrt.
ELEMENTARY = tuple((call.split("(")[0], call.count(",") + 1) for call, _, _ in _ELEMENTARY)


def operations() -> Iterator[Op]:
    for t in (F64, F32):
        yield from _arithmetic(t)
        yield from _elementary(t)
        yield from _rounding(t)
        yield from _signs(t)
        yield from _tests(t)
    yield from _division()


def _arithmetic(t: Scalar) -> Iterator[Op]:
    for symbol in "+-*/":
        yield Op(symbol, (t, t), t)
    yield Op("neg", (t,), t)


def _elementary(t: Scalar) -> Iterator[Op]:
    doc = Doc(_ELEMENTARY_GROUP, "sqrt(x)", "square root", _ONCE, "x < 0: NaN; sqrt(-0.0) is -0.0")
    yield Op("sqrt", (t,), t, doc=doc)
    for (name, arity), (call, meaning, singular) in zip(ELEMENTARY, _ELEMENTARY, strict=True):
        yield Op(name, (t,) * arity, t, doc=Doc(_ELEMENTARY_GROUP, call, meaning, _ONCE, singular))


def _rounding(t: Scalar) -> Iterator[Op]:
    none = "infinities, NaN and -0.0 stay"
    for name, how in (("floor", "toward -inf"), ("ceil", "toward +inf"), ("trunc", "toward zero")):
        doc = Doc(_ROUNDING_GROUP, f"{name}(x)", f"the integer {how}, as a float", _EXACT, none)
        yield Op(name, (t,), t, doc=doc)
    doc = Doc(_ROUNDING_GROUP, "round(x)", "the nearest integer, halves to the even one, as a float", _EXACT, none)
    yield Op("round", (t,), t, doc=doc)
    doc = Doc(
        _ROUNDING_GROUP,
        "fmod(x, y)",
        "x - y*trunc(x/y), of the real quotient: the remainder with the sign of x (`%` has that of y)",
        _EXACT,
        "y = 0 or x infinite: NaN; y infinite: x",
    )
    yield Op("fmod", (t, t), t, doc=doc)


def _signs(t: Scalar) -> Iterator[Op]:
    # The sign of a NaN differs between processors, so it does not affect the result.
    doc = Doc(_BLENDING_GROUP, "copysign(x, y)", "|x| with the sign of y", _EXACT, "y NaN: |x|")
    yield Op("copysign", (t, t), t, doc=doc)
    doc = Doc(
        _BLENDING_GROUP,
        "lerp(a, b, t)",
        "a + t*(b - a): a at t = 0, b at t = 1, both exactly; a wherever a = b; t beyond [0, 1] extrapolates",
        "a + t*(b - a) for t < 0.5, else b - (1 - t)*(b - a)",
        "b - a overflows or a, b, t is not finite: an infinity or NaN",
    )
    yield Op("lerp", (t, t, t), t, doc=doc)
    doc = Doc(
        _BLENDING_GROUP,
        "wrap_angle(x)",
        "x - 2*pi*k in [-pi, pi], with the integer k nearest to zero that brings it there; pi is the constant of the type",
        "fmod(x, 2*pi), then - 2*pi where it exceeds pi, + 2*pi where it is below -pi; every step is exact, so the only "
        "error against the real pi is k times that of 2*pi, less than x itself was rounded by",
        "x infinite: NaN; both -pi and pi stay themselves",
    )
    yield Op("wrap_angle", (t,), t, doc=doc)


def _tests(t: Scalar) -> Iterator[Op]:
    for name, meaning in (
        ("isnan", "True where x is NaN"),
        ("isinf", "True where x is an infinity"),
        ("isfinite", "True where x is neither NaN nor infinite"),
    ):
        doc = Doc(_TESTS_GROUP, f"{name}(x)", meaning, _EXACT, "none")
        yield Op(name, (t,), BOOL, doc=doc)


def _division() -> Iterator[Op]:
    """Floor division and remainder as in CPython. A zero divisor gives NaN. f32 is computed in f64: the operands convert
    exactly, and the result is rounded once."""
    for symbol in ("//", "%"):
        for t in (F64, F32):
            yield Op(symbol, (t, t), t)
