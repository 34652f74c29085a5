# SPDX-License-Identifier: Apache-2.0
"""Meaning of a program's tree: Python integers with explicit ranges, NumPy scalars for f32 and f64.

The oracle uses the types in the tree and is independent of the compiler and the reference. An integer is an int, f32 is
np.float32, f64 is np.float64; an array is a list of rows, a struct a dict. Stored values are copies.
"""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import cache
from typing import Any

import numpy as np

from fcsl_compiler.base.packages import package_prefix

from . import oracle_library
from . import tree as t
from .externs import Calls
from .hardware import Board
from .types import FLOATS, INTEGERS, RANGE, SIGNED, WIDTH, Array, Struct, Type, row, zero


class Fault(Exception):
    """A contained fault. str() is its cause."""


class _Break(Exception):
    pass


class _Continue(Exception):
    pass


class _Return(Exception):
    def __init__(self, value: Any):
        self.value = value


_FLOAT = {"f32": np.float32, "f64": np.float64}


def typed(type_: Type, value: Any) -> Any:
    """A value in JSON form (or of this oracle) as a new value of this oracle."""
    if isinstance(type_, Array):
        return [typed(row(type_), v) for v in value]
    if isinstance(type_, Struct):
        return {n: typed(m, value[n]) for n, m in type_.members}
    return _FLOAT[type_](value) if type_ in FLOATS else value


class Constant(list[Any]):
    """A whole module constant or a whole frozen parameter, or the transpose of one. Its copies are lists."""


def copy(value: Any) -> Any:
    if isinstance(value, list):
        return [copy(v) for v in value]
    return {n: copy(v) for n, v in value.items()} if isinstance(value, dict) else value


def integer(type_: Type, value: int) -> int:
    """A mathematical result in its type: unsigned types wrap, signed types fault."""
    low, high = RANGE[str(type_)]
    if type_ not in SIGNED:
        return value & high
    if not low <= value <= high:
        raise Fault(f"the result does not fit {type_}")
    return value


# ---- scalar operations ---------------------------------------------------------------------------------------------


def _floor_float(type_: Type, op: str, a: Any, b: Any) -> Any:
    """Python's // and % in binary64, rounded once for f32. A zero divisor gives NaN."""
    x, y = float(a), float(b)
    if y == 0:
        return _FLOAT[str(type_)](math.nan)
    return _FLOAT[str(type_)](x // y if op == "//" else x % y)


def _power(type_: Type, a: Any, exponent: Any, literal: bool) -> Any:
    if literal and isinstance(exponent, int) and 0 <= exponent <= 4:
        result = scalar("*", type_, a, a) if exponent > 1 else a
        for _ in range(exponent - 2):
            result = scalar("*", type_, result, a)
        return result if exponent else typed(type_, 1)
    return elementary("pow", type_, a, exponent)


def scalar(op: str, type_: Type, a: Any, b: Any) -> Any:
    """One operation on operands of its result type."""
    if type_ in FLOATS:
        if op in ("//", "%"):
            return _floor_float(type_, op, a, b)
        return {"+": np.add, "-": np.subtract, "*": np.multiply, "/": np.divide}[op](a, b)
    if op in ("//", "%"):
        if b == 0:
            raise Fault("the divisor is zero")
        return integer(type_, a // b if op == "//" else a % b)
    if op in ("<<", ">>"):
        if not 0 <= b < WIDTH[str(type_)]:
            raise Fault(f"the shift count is outside [0, {WIDTH[str(type_)]})")
        return integer(type_, a << b) if op == "<<" else a >> b
    exact = {"+": a + b, "-": a - b, "*": a * b, "&": a & b, "|": a | b, "^": a ^ b}
    return integer(type_, exact[op])


def _sum(op: str, type_: Type, a: Any, b: Any, constant: str) -> Any:
    """A sum or difference of arrays with one constant operand. Its zeros leave the other operand unchanged."""
    if isinstance(type_, Array):
        return [_sum(op, row(type_), x, y, constant) for x, y in zip(a, b, strict=True)]
    if (b if constant == "right" else a) == 0:
        return a if constant == "right" else b
    return scalar(op, type_, a, b)


def elementwise(op: str, type_: Type, a: Any, b: Any) -> Any:
    if not isinstance(type_, Array):
        return scalar(op, type_, a, b)
    if op in ("+", "-") and type_.element in FLOATS:
        if isinstance(b, Constant):
            return _sum(op, type_, a, b, "right")
        if isinstance(a, Constant) and op == "+":
            return _sum(op, type_, a, b, "left")
    rows = range(type_.shape[0])
    left = a if isinstance(a, list) else [a] * len(rows)
    right = b if isinstance(b, list) else [b] * len(rows)
    return [elementwise(op, row(type_), left[i], right[i]) for i in rows]


def unary(op: str, type_: Type, a: Any) -> Any:
    if isinstance(type_, Array):
        return [unary(op, row(type_), v) for v in a]
    if op == "not":
        return not a
    if op == "~":
        return integer(type_, ~a)
    return np.negative(a) if type_ in FLOATS else integer(type_, -a)


def literal(e: t.Literal) -> Any:
    """Value of a literal. A decimal f32 literal is rounded once, to the nearest of the three values around the f64."""
    if e.type != "f32" or not math.isfinite(e.value):
        return typed(e.type, e.value)
    text = e.name if re.fullmatch(r"[0-9.]+", e.name) else t.number_text(e.value)
    exact, near = Fraction(text), np.float32(e.value)
    around = [near, *(np.nextafter(near, np.float32(side)) for side in (-math.inf, math.inf))]
    finite = [x for x in around if np.isfinite(x)]
    return min(finite, key=lambda x: (abs(Fraction(float(x)) - exact), int(x.view(np.uint32)) & 1))


COMPARE: dict[str, Callable[[Any, Any], Any]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}

# ---- builtins ------------------------------------------------------------------------------------------------------

ELEMENTARY_1 = tuple("sin cos tan asin acos atan sinh cosh tanh exp expm1 log log1p log2 log10 cbrt".split())
ELEMENTARY_2 = ("atan2", "pow", "hypot")


@cache
def _math() -> ctypes.CDLL:
    return ctypes.CDLL(str(package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.so"))


#: Functions of numbers that also take arrays.
_OF_NUMBERS = frozenset(
    (
        *ELEMENTARY_1,
        *ELEMENTARY_2,
        *FLOATS,
        *INTEGERS,
        *(f"{k}_{i}" for k in ("wrap", "sat") for i in INTEGERS),
        "where",
    )
) | frozenset("abs sqrt floor ceil trunc round wrap_angle fmod copysign lerp min max clamp sign".split())


def elementary(name: str, type_: Type, *args: Any) -> Any:
    f = getattr(_math(), f"cr_{name}" + ("f" if type_ == "f32" else ""))
    c = ctypes.c_float if type_ == "f32" else ctypes.c_double
    f.argtypes, f.restype = [c] * len(args), c
    return _FLOAT[str(type_)](f(*map(float, args)))


def convert(target: Type, value: Any) -> Any:
    """Conversions such as i32(x)."""
    if target == "f32" and isinstance(value, int):
        return (np.uint64(value) if value >= 0 else np.int64(value)).astype(np.float32)  # rounded once
    if target in FLOATS:
        return _FLOAT[str(target)](value)
    if not isinstance(value, int):
        if not math.isfinite(value):
            raise Fault(f"the value does not fit {target}")
        value = int(value)
    low, high = RANGE[str(target)]
    if not low <= value <= high:
        raise Fault(f"the value does not fit {target}")
    return value


def saturate(target: Type, value: Any) -> int:
    low, high = RANGE[str(target)]
    if not isinstance(value, int):
        if math.isnan(value):
            return 0
        if math.isinf(value):
            return low if value < 0 else high
    return max(low, min(high, int(value)))


def wrap(target: Type, value: int) -> int:
    low, high = RANGE[str(target)]
    return (value - low) % (high - low + 1) + low


_ADD = {"add": lambda a, b: a + b, "sub": lambda a, b: a - b, "mul": lambda a, b: a * b}


def mapped(function: Callable[..., Any], type_: Type, args: list[Any]) -> Any:
    """A function of numbers, element by element. A number beside arrays is that of every element."""
    if not isinstance(type_, Array):
        return function(*args)
    rows = (([a] * type_.shape[0]) if not isinstance(a, list) else a for a in args)
    return [mapped(function, row(type_), list(r)) for r in zip(*rows, strict=True)]


def builtin(name: str, type_: Type, args: list[Any]) -> Any:
    a = args[0]
    if isinstance(type_, Array) and name in _OF_NUMBERS:
        return mapped(lambda *numbers: builtin(name, type_.element, list(numbers)), type_, args)
    if name == "where":
        return args[1] if a else args[2]
    if name in (*INTEGERS, *FLOATS):
        return convert(name, a)
    kind, _, rest = name.partition("_")
    if kind in ("wrap", "sat") and rest in _ADD:
        return (wrap if kind == "wrap" else saturate)(type_, _ADD[rest](*args))
    if kind in ("wrap", "sat") and rest in INTEGERS:
        return (wrap if kind == "wrap" else saturate)(rest, a)
    if name in ("min", "max") and len(args) > 1:
        for b in args[1:]:
            a = b if (b < a if name == "min" else b > a) else a
        return a
    simple: dict[str, Callable[[], Any]] = {
        "abs": lambda: np.abs(a) if type_ in FLOATS else integer(type_, abs(a)),
        "sqrt": lambda: np.sqrt(a),
        "floor": lambda: np.floor(a),
        "ceil": lambda: np.ceil(a),
        "trunc": lambda: np.trunc(a),
        "round": lambda: np.rint(a),
        "isnan": lambda: bool(np.isnan(a)),
        "isinf": lambda: bool(np.isinf(a)),
        "isfinite": lambda: bool(np.isfinite(a)),
        "clamp": lambda: _clamp(*args),
        "sign": lambda: typed(type_, 1) if a > 0 else typed(type_, -1) if a < 0 else a,
        "copysign": lambda: np.abs(a) if np.isnan(args[1]) else np.copysign(a, args[1]),
        "lerp": lambda: _lerp(type_, *args),
        "wrap_angle": lambda: _wrap_angle(type_, a),
        "fmod": lambda: np.fmod(a, args[1]),
    }
    if name in simple:
        return simple[name]()
    if name == "eye":
        return [[np.float64(i == j) for j in range(a)] for i in range(a)]
    if name == "zeros":
        return typed(type_, zero(type_))
    if name in (*ELEMENTARY_1, *ELEMENTARY_2):
        return elementary(name, type_, *args)
    return oracle_library.call(name, args)


def _clamp(x: Any, low: Any, high: Any) -> Any:
    if x < low:
        return high if high < low else low
    return high if high < x else x


def _lerp(type_: Type, a: Any, b: Any, t_: Any) -> Any:
    return a + t_ * (b - a) if t_ < 0.5 else b - (typed(type_, 1.0) - t_) * (b - a)


def _wrap_angle(type_: Type, x: Any) -> Any:
    half, turn = typed(type_, math.pi), typed(type_, 2.0 * math.pi)
    rest = np.fmod(x, turn)
    return rest - turn if rest > half else rest + turn if rest < -half else rest


# ---- trees ---------------------------------------------------------------------------------------------------------

Records = dict[str, dict[str, Any]]
#: Text and values of an event.
Told = tuple[str, list[Any]]


class Frame:
    """One call: evaluates expressions from left to right and runs statements. `board` exists in execute only."""

    def __init__(self, constants: dict[str, Any], names: dict[str, Any], records: Records, board: Board | None = None):
        self.constants, self.names, self.records, self.board = constants, names, records, board
        self.events: list[Told] = []

    def value(self, e: t.Expr) -> Any:
        with np.errstate(all="ignore"):
            return getattr(self, f"_{type(e).__name__.lower()}")(e)

    def _literal(self, e: t.Literal) -> Any:
        return literal(e)

    def _word(self, e: t.Word) -> Any:
        return e.word

    def _name(self, e: t.Name) -> Any:
        return self.constants[e.name] if e.constant else self.names[e.name]

    def _loopvar(self, e: t.LoopVar) -> Any:
        return self.names[e.name]

    def _field(self, e: t.Field) -> Any:
        return self.records[e.record][e.name]

    def _member(self, e: t.Member) -> Any:
        return self.value(e.base)[e.name]

    def _index(self, e: t.Index) -> Any:
        return _at(self.value(e.base), self._indices(e))

    def _indices(self, e: t.Index) -> list[Any]:
        """Integers in range and slices. All are evaluated before one of them faults. A constant index may count from
        the end."""
        assert isinstance(e.base.type, Array)
        pairs = list(zip(e.indices, e.base.type.shape, strict=False))
        out: list[Any] = [slice(*i.bounds(extent)) if isinstance(i, t.Slice) else self.value(i) for i, extent in pairs]
        for n, (i, extent) in enumerate(pairs):
            if isinstance(i, t.Slice):
                continue
            if isinstance(i, t.Literal) and out[n] < 0:
                out[n] += extent
            if not 0 <= out[n] < extent:
                raise Fault(f"the index is outside [0, {extent})")
        return out

    def _unary(self, e: t.Unary) -> Any:
        return unary(e.op, e.type, self.value(e.a))

    def _binary(self, e: t.Binary) -> Any:
        a, b = self.value(e.a), self.value(e.b)
        if e.op == "**":
            return _power(e.type, a, b, isinstance(e.b, t.Literal) and e.b.bare and e.b.type == "i64")
        return elementwise(e.op, e.type, a, b)

    def _compare(self, e: t.Compare) -> Any:
        if isinstance(e.type, Array):
            pair = [self.value(o) for o in e.operands]
            return mapped(lambda a, b: COMPARE[e.ops[0]](a, b), e.type, pair)
        left = self.value(e.operands[0])
        for op, operand in zip(e.ops, e.operands[1:], strict=True):
            right = self.value(operand)
            if not COMPARE[op](left, right):
                return False
            left = right
        return True

    def _logic(self, e: t.Logic) -> bool:
        wanted = e.op == "or"
        return wanted if any(self.value(o) is wanted for o in e.operands) else not wanted

    def _choose(self, e: t.Choose) -> Any:
        return copy(self.value(e.then if self.value(e.condition) else e.otherwise))

    def _arrayof(self, e: t.ArrayOf) -> Any:
        return [copy(self.value(i)) for i in e.items]

    def _resultsof(self, e: t.ResultsOf) -> Any:
        return [copy(self.value(i)) for i in e.items]

    def _structof(self, e: t.StructOf) -> Any:
        values = {n: copy(self.value(a)) for n, a in e.args}
        assert isinstance(e.type, Struct)
        return {n: values[n] for n, _ in e.type.members}

    def _call(self, e: t.Call) -> Any:
        args = [self.value(a) for a in e.args]
        if e.name in t.HARDWARE:
            assert self.board is not None
            found = self.board.call(e.name, *args)
            return typed(e.type, zero(e.type) if found is None else found)
        if e.extern is not None:
            assert self.board is not None and isinstance(self.board.externs, Calls)
            found = self.board.externs.call(e.extern, args)
            return None if e.extern.result is None else typed(e.type, found)
        if e.helper is None:
            return builtin(e.name, e.type, args)
        given = zip(e.helper.arguments, args, strict=True)
        names = {n: a if isinstance(a, Constant) else copy(a) for (n, _), a in given}
        try:
            Frame(constants_of(e.helper.constants), names, {}).run(e.helper.block)
        except _Return as done:
            return done.value
        raise AssertionError("a helper without a result")

    # ---- statements ------------------------------------------------------------------------------------------------

    def run(self, block: t.Block) -> None:
        for s in block:
            getattr(self, f"_do_{type(s).__name__.lower()}")(s)

    def _do_assign(self, s: t.Assign) -> None:
        if s.op:
            target = self._settled(s.target)
            a, b = self.value(target), self.value(s.value)
            if s.op == "**":
                raise AssertionError("not generated")
            with np.errstate(all="ignore"):
                self.store(target, elementwise(s.op, target.type, a, b))
        else:
            self.store(s.target, self.value(s.value))

    def _settled(self, place: t.Expr) -> t.Expr:
        """The place with its indices evaluated once."""
        if isinstance(place, t.Member):
            return replace(place, base=self._settled(place.base))
        if not isinstance(place, t.Index):
            return place
        place = replace(place, base=self._settled(place.base))
        found = zip(place.indices, self._indices(place), strict=True)
        indices = tuple(i if isinstance(i, t.Slice) else t.Literal("i64", value) for i, value in found)
        return replace(place, indices=indices)

    def _do_unpack(self, s: t.Unpack) -> None:
        values = [copy(self.value(v)) for v in s.values]
        for target, value in zip(s.targets, values if len(s.values) > 1 else values[0], strict=True):
            self.store(target, value)

    def store(self, target: t.Expr, value: Any) -> None:
        new = copy(value)
        if isinstance(target, t.Name):
            self.names[target.name] = new
        elif isinstance(target, t.Field):
            self.records[target.record][target.name] = new
        elif isinstance(target, t.Member):
            self.value(target.base)[target.name] = new
        else:
            assert isinstance(target, t.Index)
            _put(self.value(target.base), self._indices(target), new)

    def _do_perform(self, s: t.Perform) -> None:
        self.value(s.call)

    def _do_event(self, s: t.Event) -> None:
        self.events.append((s.text, [self.value(v) for v in s.values]))

    def _do_if(self, s: t.If) -> None:
        for condition, block in s.branches:
            if condition is None or self.value(condition):
                self.run(block)
                return

    def _do_for(self, s: t.For) -> None:
        for i in range(*(self.value(a) for a in s.args)):
            self.names[s.variable] = i
            try:
                self.run(s.block)
            except _Continue:
                continue
            except _Break:
                break

    def _do_jump(self, s: t.Jump) -> None:
        if s.word == "break":
            raise _Break
        if s.word == "continue":
            raise _Continue
        if s.word == "return":
            raise _Return(copy(self.value(s.value)) if s.value is not None else None)


def _at(value: Any, indices: list[Any]) -> Any:
    if not indices:
        return value
    first, rest = indices[0], indices[1:]
    return [_at(v, rest) for v in value[first]] if isinstance(first, slice) else _at(value[first], rest)


def _put(value: Any, indices: list[Any], new: Any) -> None:
    first, rest = indices[0], indices[1:]
    if isinstance(first, slice):
        for n, at in enumerate(range(first.start, first.stop)):
            if rest:
                _put(value[at], rest, new[n])
            else:
                value[at] = new[n]
    elif rest:
        _put(value[first], rest, new)
    else:
        value[first] = new


def constants_of(constants: tuple[t.Constant, ...]) -> dict[str, Any]:
    """Their values."""
    return {c.name: constant(typed(c.type, c.value)) for c in constants}


def constant(value: Any) -> Any:
    return Constant(value) if isinstance(value, list) else value


def records_of(algorithm: t.Algorithm) -> Records:
    """Records with all fields zero, and the outputs health and transition_request."""
    records = {r: {n: typed(k, zero(k)) for n, k in ports} for r, ports in algorithm.ports.items()}
    records["outputs"] |= {"transition_request": "", "health": "stale"}
    return records


def call(function: t.Function, records: Records, board: Board | None = None) -> list[Told]:
    """Runs execute or start on these records. Raises Fault; earlier writes remain. Returns its events."""
    frame = Frame(constants_of(function.constants), {}, records, board)
    try:
        frame.run(function.block)
    except _Return:
        pass
    return frame.events


def assigned(block: t.Block) -> set[str]:
    """The fields that statements assign, wholly or in part."""
    found: set[str] = set()
    for s in block:
        if isinstance(s, t.If):
            found.update(*(assigned(part) for _, part in s.branches))
        elif isinstance(s, t.For):
            found |= assigned(s.block)
        targets = [s.target] if isinstance(s, t.Assign) else s.targets if isinstance(s, t.Unpack) else []
        for place in targets:
            while isinstance(place, t.Index | t.Member):
                place = place.base
            if isinstance(place, t.Field):
                found.add(place.name)
    return found


def is_finite(value: Any) -> bool:
    """Whether no float of a value is a NaN or an infinity."""
    if isinstance(value, float | np.floating):
        return bool(np.isfinite(value))
    if isinstance(value, np.ndarray):
        return all(map(is_finite, value.flat))
    if isinstance(value, dict):
        return all(map(is_finite, value.values()))
    return all(map(is_finite, value)) if isinstance(value, list | tuple) else True
