# SPDX-License-Identifier: Apache-2.0
"""The op table: one entry per scalar operation of the language.

An operation is selected by its source name and the scalar type of its operands. `c` is the C expression, with {0}, {1}, …
for the operands and {fault} for the pointer that faulting operations set; `proven` is the expression where the checker knows
that the operands cannot fault. `helper` and `proven_helper` are the C functions they call, emitted once into a machine.
"""

from __future__ import annotations

from dataclasses import dataclass

from .types import BOOL, F32, F64, HEALTH, I32, I64, NUMBERS, REQUEST, U32, U64, Scalar


@dataclass(frozen=True)
class Op:
    name: str  # as written: "+", "sin", "i32"
    args: tuple[Scalar, ...]
    result: Scalar
    c: str
    faults: str = ""  # when it faults; "" never
    helper: str = ""
    doc: str = ""
    proven: str = ""
    proven_helper: str = ""

    @property
    def id(self) -> str:
        """Unique name in IR dumps."""
        return f"{self.name}:{','.join(map(str, self.args))}"


_TABLE: dict[tuple[str, tuple[Scalar, ...]], Op] = {}
#: Names callable as builtins, in table order, with their documentation.
BUILTINS: dict[str, str] = {}


def find(name: str, args: tuple[Scalar, ...]) -> Op | None:
    """The operation of this name on these operand types."""
    return _TABLE.get((name, args))


def all_ops() -> list[Op]:
    return list(_TABLE.values())


def arity_of(name: str) -> int:
    """Operands of builtin `name`."""
    return next(len(op.args) for (n, _), op in _TABLE.items() if n == name)


def _add(
    name: str,
    args: tuple[Scalar, ...],
    result: Scalar,
    c: str,
    faults: str = "",
    helper: str = "",
    doc: str = "",
    proven: str = "",
    proven_helper: str = "",
) -> None:
    _TABLE[(name, args)] = Op(name, args, result, c, faults, helper, doc, proven, proven_helper)
    if doc:
        BUILTINS.setdefault(name, doc)


def _helper(signature: str, *body: str) -> str:
    lines = "\n".join("    " + line for line in body)
    return f"static inline {signature}\n{{\n{lines}\n}}\n"


# ---- arithmetic ----------------------------------------------------------------------------------------------------

_OVERFLOW = "the result does not fit its type"


def _checked(symbol: str, word: str, t: Scalar) -> None:
    helper = _helper(
        f"{t.c} fcsl_{word}_{t}({t.c} a, {t.c} b, int32_t *fault)",
        f"{t.c} result = 0;",
        f"if (__builtin_{word}_overflow(a, b, &result)) {{",
        "    *fault = 1;",
        "    result = 0;",
        "}",
        "return result;",
    )
    # The cast keeps 64-bit arithmetic on two literals from being done in int.
    proven = f"(({t.c}){{0}} {symbol} {{1}})" if t.size == 8 else f"({{0}} {symbol} {{1}})"
    _add(symbol, (t, t), t, f"fcsl_{word}_{t}({{0}}, {{1}}, {{fault}})", _OVERFLOW, helper, proven=proven)


def _signed(t: Scalar) -> None:
    for symbol, word in (("+", "add"), ("-", "sub"), ("*", "mul")):
        _checked(symbol, word, t)
    low = f"INT{t.size * 8}_MIN"
    for word, symbol, expression in (("neg", "neg", "-a"), ("abs", "abs", "a < 0 ? -a : a")):
        helper = _helper(
            f"{t.c} fcsl_{word}_{t}({t.c} a, int32_t *fault)",
            f"if (a == {low}) {{",
            "    *fault = 1;",
            "    return 0;",
            "}",
            f"return {expression};",
        )
        doc = "abs(x): |x|; the smallest integer faults." if word == "abs" else ""
        why = f"the operand is the smallest {t}"
        proven = "(-{0})" if word == "neg" else ""
        _add(symbol, (t,), t, f"fcsl_{word}_{t}({{0}}, {{fault}})", why, helper, doc, proven)
    floor = "(remainder != 0 && ((remainder ^ b) < 0))"
    division = (f"if (b == 0 || (a == {low} && b == -1)) {{", "    *fault = 1;", "    return 0;", "}")
    why = f"the divisor is zero, or the smallest {t} is divided by -1"
    divide = (f"const {t.c} remainder = a % b;", f"return a / b - {floor};")
    quotient = _helper(f"{t.c} fcsl_floordiv_{t}({t.c} a, {t.c} b, int32_t *fault)", *division, *divide)
    proven = f"fcsl_floordiv_proven_{t}({{0}}, {{1}})"
    proven_helper = _helper(f"{t.c} fcsl_floordiv_proven_{t}({t.c} a, {t.c} b)", *divide)
    c = f"fcsl_floordiv_{t}({{0}}, {{1}}, {{fault}})"
    _add("//", (t, t), t, c, why, quotient, proven=proven, proven_helper=proven_helper)
    # MIN % -1 is 0 in Python, so only a zero divisor faults; C must not evaluate it.
    remainder = _helper(
        f"{t.c} fcsl_mod_{t}({t.c} a, {t.c} b, int32_t *fault)",
        "if (b == 0) {",
        "    *fault = 1;",
        "    return 0;",
        "}",
        "if (b == -1) {",
        "    return 0;",
        "}",
        f"const {t.c} remainder = a % b;",
        f"return {floor} ? remainder + b : remainder;",
    )
    proven = f"fcsl_mod_proven_{t}({{0}}, {{1}})"
    proven_helper = _helper(
        f"{t.c} fcsl_mod_proven_{t}({t.c} a, {t.c} b)",
        f"const {t.c} remainder = a % b;",
        f"return {floor} ? remainder + b : remainder;",
    )
    c = f"fcsl_mod_{t}({{0}}, {{1}}, {{fault}})"
    _add("%", (t, t), t, c, "the divisor is zero", remainder, proven=proven, proven_helper=proven_helper)
    for exponent in (2, 3, 4):
        helper = _helper(
            f"{t.c} fcsl_pow{exponent}_{t}({t.c} a, int32_t *fault)",
            f"{t.c} result = a;",
            f"for (int32_t i = 1; i < {exponent}; ++i) {{",
            "    if (__builtin_mul_overflow(result, a, &result)) {",
            "        *fault = 1;",
            "        return 0;",
            "    }",
            "}",
            "return result;",
        )
        _add(f"**{exponent}", (t,), t, f"fcsl_pow{exponent}_{t}({{0}}, {{fault}})", _OVERFLOW, helper)


def _unsigned(t: Scalar) -> None:
    # The cast of the first operand keeps 64-bit arithmetic on two literals from being done in 32 bits.
    for symbol in "+-*":
        _add(symbol, (t, t), t, f"(({t.c}){{0}} {symbol} {{1}})")
    _add("neg", (t,), t, f"(({t.c})0 - {{0}})")
    for symbol, word, c_op in (("//", "floordiv", "/"), ("%", "mod", "%")):
        helper = _helper(
            f"{t.c} fcsl_{word}_{t}({t.c} a, {t.c} b, int32_t *fault)",
            "if (b == 0) {",
            "    *fault = 1;",
            "    return 0;",
            "}",
            f"return a {c_op} b;",
        )
        c = f"fcsl_{word}_{t}({{0}}, {{1}}, {{fault}})"
        _add(symbol, (t, t), t, c, "the divisor is zero", helper, proven=f"({{0}} {c_op} {{1}})")


def _powers(t: Scalar) -> None:
    """x ** 0 … x ** 4 where no product can fault: repeated multiplication from the left."""
    for exponent in (0, 2, 3, 4):
        if exponent and t.is_signed:
            continue
        product = " * ".join(["a"] * exponent) or "(void)a, 1"
        helper = _helper(f"{t.c} fcsl_pow{exponent}_{t}({t.c} a)", f"return {product};")
        _add(f"**{exponent}", (t,), t, f"fcsl_pow{exponent}_{t}({{0}})", helper=helper)


def _float(t: Scalar) -> None:
    for symbol in "+-*/":
        _add(symbol, (t, t), t, f"({{0}} {symbol} {{1}})")
    suffix = "f" if t is F32 else ""
    _add("neg", (t,), t, "(-{0})")
    _add("abs", (t,), t, f"fabs{suffix}({{0}})", doc="abs(x): |x|; the smallest integer faults.")
    _add("sqrt", (t,), t, f"sqrt{suffix}({{0}})", doc="sqrt(x): correctly rounded; negative x gives NaN.")
    for name, doc in _ELEMENTARY.items():
        _add(name, (t,), t, f"cr_{name}{suffix}({{0}})", doc=f"{name}(x): {doc}; correctly rounded.")
    for name, doc in _ELEMENTARY_2.items():
        _add(name, (t, t), t, f"cr_{name}{suffix}({{0}}, {{1}})", doc=f"{doc}; correctly rounded.")
    for name, doc in (("floor", "toward -inf"), ("ceil", "toward +inf"), ("trunc", "toward zero")):
        _add(name, (t,), t, f"{name}{suffix}({{0}})", doc=f"{name}(x): the integer {doc}, as a float.")
    for name, c, doc in (
        ("isnan", "({0} != {0})", "x is NaN"),
        ("isfinite", "({0} - {0} == 0)", "x is neither NaN nor infinite"),
    ):
        helper = _helper(f"bool fcsl_{name}_{t}({t.c} x)", f"return {c.format('x')};")
        _add(name, (t,), BOOL, f"fcsl_{name}_{t}({{0}})", helper=helper, doc=f"{name}(x): {doc}.")


def _float_division() -> None:
    """Floor division and remainder as CPython computes them; a zero divisor gives NaN. f32 is computed in f64."""
    remainder = (
        "if (b == 0.0) {",
        '    return __builtin_nan("");',
        "}",
        "double rest = fmod(a, b);",
        "if (rest == 0.0) {",
        "    rest = copysign(0.0, b);",
        "} else if ((b < 0.0) != (rest < 0.0)) {",
        "    rest += b;",
        "}",
    )
    quotient = (
        *remainder[:3],
        "const double rest = fmod(a, b);",
        "double quotient = (a - rest) / b;",
        "if (rest != 0.0 && (b < 0.0) != (rest < 0.0)) {",
        "    quotient -= 1.0;",
        "}",
        "if (quotient == 0.0) {",
        "    return copysign(0.0, a / b);",
        "}",
        "const double whole = floor(quotient);",
        "return quotient - whole > 0.5 ? whole + 1.0 : whole;",
    )
    for symbol, word, body in (("//", "floordiv", quotient), ("%", "mod", (*remainder, "return rest;"))):
        helper = _helper(f"double fcsl_{word}_f64(double a, double b)", *body)
        _add(symbol, (F64, F64), F64, f"fcsl_{word}_f64({{0}}, {{1}})", helper=helper)
        # The operands convert exactly, the result is rounded once.
        _add(symbol, (F32, F32), F32, f"((float)fcsl_{word}_f64((double){{0}}, (double){{1}}))", helper=helper)


_ELEMENTARY = {
    "sin": "sine of x rad",
    "cos": "cosine of x rad",
    "tan": "tangent of x rad",
    "asin": "arc sine, rad; NaN outside [-1, 1]",
    "acos": "arc cosine, rad; NaN outside [-1, 1]",
    "atan": "arc tangent, rad",
    "exp": "e to the x",
    "log": "natural logarithm; -inf at 0, NaN below",
}
_ELEMENTARY_2 = {
    "atan2": "atan2(y, x): angle of the point (x, y), rad, in [-pi, pi]",
    "pow": "pow(x, y): x to the y as IEEE 754 defines it",
    "hypot": "hypot(x, y): sqrt(x*x + y*y) without overflow on the way",
}


def _ordered(t: Scalar) -> None:
    """What every number has: order, Python's own min and max, clamp, sign."""
    for symbol in ("<", "<=", ">", ">=", "==", "!="):
        _add(symbol, (t, t), BOOL, f"({{0}} {symbol} {{1}})")
    for name, test, doc in (
        ("min", "b < a", "min(a, b): b if b < a else a, so a NaN in b is passed over and one in a stays"),
        ("max", "b > a", "max(a, b): b if b > a else a"),
    ):
        helper = _helper(f"{t.c} fcsl_{name}_{t}({t.c} a, {t.c} b)", f"return {test} ? b : a;")
        _add(name, (t, t), t, f"fcsl_{name}_{t}({{0}}, {{1}})", helper=helper, doc=doc + ".")
    helper = _helper(
        f"{t.c} fcsl_clamp_{t}({t.c} x, {t.c} low, {t.c} high)", "return x < low ? low : high < x ? high : x;"
    )
    doc = "clamp(x, low, high): low if x < low else high if high < x else x; NaN passes through."
    _add("clamp", (t, t, t), t, f"fcsl_clamp_{t}({{0}}, {{1}}, {{2}})", helper=helper, doc=doc)
    if t.is_float or t.is_signed:
        helper = _helper(f"{t.c} fcsl_sign_{t}({t.c} x)", "return x > 0 ? 1 : x < 0 ? -1 : x;")
        doc = "sign(x): 1, -1, or x itself when it is zero or NaN."
        _add("sign", (t,), t, f"fcsl_sign_{t}({{0}})", helper=helper, doc=doc)


# ---- conversions ---------------------------------------------------------------------------------------------------


def _convert(source: Scalar, target: Scalar) -> None:
    doc = f"{target}(x): converts, toward zero; out of range or NaN faults."
    if target.is_float:
        doc = f"{target}(x): converts, to the nearest; beyond the range is an infinity, nothing faults."
    if target.is_float or source is target:
        _add(target.name, (source,), target, f"(({target.c}){{0}})", doc=doc)
        return
    if source.is_float:
        # Both bounds are exact in the float: -2^n - 1 is not, hence >= low for 64 bits and for f32.
        low = float(target.low) if target.low else 0.0
        above = float(2 ** (target.size * 8 - (1 if target.is_signed else 0)))
        exclusive = target.size == 4 and source is F64
        lower = f"x > {low - 1.0!r}" if exclusive or not target.low else f"x >= {low!r}"
        suffix = "f" if source is F32 else ""
        test = f"{lower}{suffix} && x < {above!r}{suffix}"
    else:
        lower_needed, upper_needed = source.low < target.low, source.high > target.high
        if not (lower_needed or upper_needed):
            _add(target.name, (source,), target, f"(({target.c}){{0}})", doc=doc)
            return
        high = f"{'U' if not target.is_signed else ''}INT{target.size * 8}_MAX"
        tests = [f"x >= {'0' if not target.is_signed else f'INT{target.size * 8}_MIN'}"] if lower_needed else []
        # A signed source is not negative here, so the comparison may be made unsigned.
        tests += [
            f"(uint64_t)x <= (uint64_t){high}" if not (target.is_signed and source.is_signed) else f"x <= {high}"
        ] * (upper_needed)
        test = " && ".join(tests)
    helper = _helper(
        f"{target.c} fcsl_{target}_from_{source}({source.c} x, int32_t *fault)",
        f"if (!({test})) {{",
        "    *fault = 1;",
        "    return 0;",
        "}",
        f"return ({target.c})x;",
    )
    _add(
        target.name,
        (source,),
        target,
        f"fcsl_{target}_from_{source}({{0}}, {{fault}})",
        f"the value does not fit {target}",
        helper,
        doc,
        f"(({target.c}){{0}})",
    )


for _t in (F64, F32):
    _float(_t)
_float_division()
for _t in (I32, I64):
    _signed(_t)
for _t in (U32, U64):
    _unsigned(_t)
for _t in NUMBERS:
    _ordered(_t)
    _powers(_t)
for _source in NUMBERS:
    for _target in NUMBERS:
        _convert(_source, _target)
for _t in (BOOL, REQUEST, HEALTH):
    for _symbol in ("==", "!="):
        _add(_symbol, (_t, _t), BOOL, f"({{0}} {_symbol} {{1}})")
_add("not", (BOOL,), BOOL, "(!{0})")
