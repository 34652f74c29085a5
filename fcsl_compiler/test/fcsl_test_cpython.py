# SPDX-License-Identifier: Apache-2.0
"""The dialect's own Python, executed by CPython: typed numbers, fixed arrays as values, the correctly rounded functions.

Written from the rules of the language and independent of the compiler: the only thing both share is libfcsl_math.
"""

from __future__ import annotations

import ast
import ctypes
import math
import re
import struct
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

import fcsl_compiler
from fcsl_compiler.ament import package_prefix

BITS = {"i32": (True, 32), "i64": (True, 64), "u32": (False, 32), "u64": (False, 64)}
FLOATS = ("f32", "f64")
_MATH = ctypes.CDLL(str(package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.so"))


class Fault(Exception):
    """A contained fault."""


def to_f32(x: float) -> float:
    try:
        return float(struct.unpack("<f", struct.pack("<f", x))[0])
    except OverflowError:
        return math.copysign(math.inf, x)


def int_to_f32(x: int) -> float:
    """Rounded once, to nearest even."""
    sign, n = (-1 if x < 0 else 1), abs(x)
    shift = max(0, n.bit_length() - 24)
    kept, rest, half = n >> shift, n & ((1 << shift) - 1), (1 << shift) >> 1
    kept += rest > half or (shift > 0 and rest == half and kept & 1)
    return sign * float(kept << shift)


def make(t: str, value: Any) -> Any:
    """A literal or a result as a value of scalar type t; integers must fit."""
    if t == "bool" or t in ("Health", "TransitionRequest"):
        return value
    if t in BITS:
        signed, bits = BITS[t]
        if not signed:
            return Num(t, value % (1 << bits))
        if not -(1 << (bits - 1)) <= value < 1 << (bits - 1):
            raise Fault
        return Num(t, value)
    if t == "f32":
        return Num(t, int_to_f32(value) if isinstance(value, int) else to_f32(value))
    return Num(t, float(value))


def divide(a: float, b: float) -> float:
    if b != 0 or math.isnan(b):
        return a / b
    if a == 0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, math.copysign(1, a) * math.copysign(1, b))


class Num:
    """One number of a type."""

    __slots__ = ("t", "v")

    def __init__(self, t: str, v: Any):
        self.t, self.v = t, v

    def __repr__(self) -> str:
        return f"{self.t}({self.v!r})"

    def _other(self, other: Any) -> Any:
        if isinstance(other, Num):
            assert other.t == self.t, f"{self.t} mixed with {other.t}"
            return other.v
        assert not isinstance(other, bool)
        assert isinstance(other, int) or self.t in FLOATS
        return make(self.t, other).v

    def _binary(self, other: Any, f: Callable[[Any, Any], Any], swap: bool) -> Any:
        if isinstance(other, Arr):
            return NotImplemented
        a, b = self.v, self._other(other)
        return make(self.t, f(b, a) if swap else f(a, b))

    def __add__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a + b, False)

    def __radd__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a + b, True)

    def __sub__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a - b, False)

    def __rsub__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a - b, True)

    def __mul__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a * b, False)

    def __rmul__(self, o: Any) -> Any:
        return self._binary(o, lambda a, b: a * b, True)

    def __truediv__(self, o: Any) -> Any:
        assert self.t in FLOATS
        return self._binary(o, divide, False)

    def __rtruediv__(self, o: Any) -> Any:
        assert self.t in FLOATS
        return self._binary(o, divide, True)

    def __floordiv__(self, o: Any) -> Any:
        return self._binary(o, _floordiv, False)

    def __rfloordiv__(self, o: Any) -> Any:
        return self._binary(o, _floordiv, True)

    def __mod__(self, o: Any) -> Any:
        return self._binary(o, _mod, False)

    def __rmod__(self, o: Any) -> Any:
        return self._binary(o, _mod, True)

    def __neg__(self) -> Any:
        return make(self.t, -self.v)

    def __abs__(self) -> Any:
        return make(self.t, abs(self.v))

    def __pow__(self, o: Any) -> Any:
        if type(o) is int and 0 <= o <= 4:
            result = make(self.t, 1)
            for _ in range(o):
                result = result * self if result is not None else self
            return result
        return call_math("pow", self, o)

    def __rpow__(self, o: Any) -> Any:
        return call_math("pow", make(self.t, o), self)

    def __eq__(self, o: object) -> bool:
        return bool(self.v == self._other(o))

    def __lt__(self, o: Any) -> bool:
        return bool(self.v < self._other(o))

    def __le__(self, o: Any) -> bool:
        return bool(self.v <= self._other(o))

    def __gt__(self, o: Any) -> bool:
        return bool(self.v > self._other(o))

    def __ge__(self, o: Any) -> bool:
        return bool(self.v >= self._other(o))

    __hash__ = None  # type: ignore[assignment]

    def __bool__(self) -> bool:
        raise AssertionError("a number is no bool")

    def __index__(self) -> int:
        return int(self.v)


def _floordiv(a: Any, b: Any) -> Any:
    if b == 0:
        return _zero_divisor(a)
    return a // b


def _zero_divisor(a: Any) -> float:
    if isinstance(a, int):
        raise Fault
    return math.nan


def _mod(a: Any, b: Any) -> Any:
    if b == 0:
        return _zero_divisor(a)
    return a % b


class FromEnd:
    """A constant negative index."""

    def __init__(self, n: int):
        self.n = n


class Arr:
    """A view of scalars: `data[at : at + count]`, row-major. Copies are made where values are stored."""

    def __init__(self, t: str, shape: tuple[int, ...], data: list[Any], at: int = 0):
        self.t, self.shape, self.data, self.at = t, shape, data, at
        self.count = math.prod(shape)

    def items(self) -> list[Any]:
        return self.data[self.at : self.at + self.count]

    def copy(self) -> Arr:
        return Arr(self.t, self.shape, self.items())

    def _locate(self, index: Any) -> tuple[int, tuple[int, ...]]:
        at, shape = self.at, self.shape
        for i in index if isinstance(index, tuple) else (index,):
            n = shape[0] - i.n if isinstance(i, FromEnd) else int(i.__index__())
            if not 0 <= n < shape[0]:
                raise Fault
            shape = shape[1:]
            at += n * math.prod(shape)
        return at, shape

    def __getitem__(self, index: Any) -> Any:
        at, shape = self._locate(index)
        return Arr(self.t, shape, self.data, at) if shape else self.data[at]

    def __setitem__(self, index: Any, value: Any) -> None:
        at, shape = self._locate(index)
        new = typed(self.t, shape, value)
        self.data[at : at + math.prod(shape)] = new.items() if isinstance(new, Arr) else [new]

    def _each(self, f: Callable[..., Any], *others: Any) -> Arr:
        rows = [o.items() if isinstance(o, Arr) else [o] * self.count for o in others]
        for o in others:
            assert not isinstance(o, Arr) or o.shape == self.shape
        return Arr(self.t, self.shape, [f(*parts) for parts in zip(self.items(), *rows, strict=True)])

    def __add__(self, o: Any) -> Arr:
        return self._each(lambda a, b: a + b, o)

    def __sub__(self, o: Any) -> Arr:
        return self._each(lambda a, b: a - b, o)

    def __mul__(self, o: Any) -> Arr:
        return self._each(lambda a, b: a * b, o)

    def __rmul__(self, o: Any) -> Arr:
        return self._each(lambda a, b: b * a, o)

    def __truediv__(self, o: Any) -> Arr:
        return self._each(lambda a, b: a / b, o)

    def __neg__(self) -> Arr:
        return self._each(lambda a: -a)


def flatten(value: Any) -> tuple[tuple[int, ...], list[Any]]:
    if isinstance(value, Arr):
        return value.shape, value.items()
    if isinstance(value, list):
        parts = [flatten(v) for v in value]
        return (len(value), *parts[0][0]), [item for _, items in parts for item in items]
    return (), [value]


def typed(t: str, shape: tuple[int, ...], value: Any) -> Any:
    """A copy of the value, with this type; literals adopt it."""
    found, items = flatten(value)
    assert found == shape, f"{found} stored where {shape} is"
    cast = [i if isinstance(i, Num | bool) else make(t, i) for i in items]
    assert all(not isinstance(i, Num) or i.t == t for i in cast), f"{cast} stored where {t} is"
    return Arr(t, shape, cast) if shape else cast[0]


def local(value: Any) -> Any:
    """What a local becomes: a bare literal gets i64 or f64, an array is copied."""
    if isinstance(value, list):
        shape, items = flatten(value)
        first = next((i for i in items if isinstance(i, Num | bool)), None)
        bare = "f64" if any(isinstance(i, float) for i in items) else "i64"
        return typed(first.t if isinstance(first, Num) else "bool" if first is not None else bare, shape, value)
    if isinstance(value, Arr):
        return value.copy()
    if isinstance(value, int) and not isinstance(value, bool):
        return make("i64", value)
    return make("f64", value) if isinstance(value, float) else value


def parse(text: str, sizes: dict[str, int]) -> tuple[str, tuple[int, ...]]:
    match = re.match(r"\s*(\w+)\s*(?:\[([^\]]*)\])?", text)
    assert match
    extents = [e.strip() for e in (match[2] or "").split(",") if e.strip()]
    return match[1], tuple(int(e) if e.isdigit() else sizes[e] for e in extents)


class Record:
    """Inputs, parameters, outputs or state: fields of declared types, all zero first."""

    def __init__(self, ports: dict[str, tuple[str, tuple[int, ...]]]):
        object.__setattr__(self, "_ports", ports)
        for name, (t, shape) in ports.items():
            zero = (
                False if t == "bool" else "nominal" if t == "Health" else "" if t == "TransitionRequest" else make(t, 0)
            )
            object.__setattr__(self, name, Arr(t, shape, [zero] * math.prod(shape)) if shape else zero)

    def __setattr__(self, name: str, value: Any) -> None:
        t, shape = self._ports[name]
        object.__setattr__(self, name, value if isinstance(value, str) else typed(t, shape, value))

    def clone(self) -> Record:
        other = Record(self._ports)
        for name in self._ports:
            value = getattr(self, name)
            object.__setattr__(other, name, value.copy() if isinstance(value, Arr) else value)
        return other


class _Words:
    def __getattr__(self, name: str) -> str:
        return "" if name == "none" else name


# ---- functions -----------------------------------------------------------------------------------------------------


def _settle(args: tuple[Any, ...]) -> list[Num]:
    t = next((a.t for a in args if isinstance(a, Num)), "f64" if any(isinstance(a, float) for a in args) else "i64")
    return [a if isinstance(a, Num) else make(t, a) for a in args]


def call_math(name: str, *args: Any) -> Num:
    values = _settle(args)
    if values[0].t not in FLOATS:
        values = [make("f64", v.v) for v in values]
    single = values[0].t == "f32"
    f = getattr(_MATH, f"cr_{name}" + ("f" if single else ""))
    scalar = ctypes.c_float if single else ctypes.c_double
    f.argtypes, f.restype = [scalar] * len(values), scalar
    return Num(values[0].t, float(f(*(v.v for v in values))))


def _whole(f: Callable[[float], int]) -> Callable[[Any], Num]:
    def run(x: Any) -> Num:
        (n,) = _settle((x,))
        v = float(n.v)
        return make(n.t, math.copysign(float(f(v)), v) if math.isfinite(v) else v)

    return run


def sqrt(x: Any) -> Num:
    (n,) = _settle((x,))
    v = float(n.v)
    return make("f32" if n.t == "f32" else "f64", math.nan if v < 0 else math.sqrt(v))


def minimum(*args: Any) -> Num:
    best, *rest = _settle(args)
    for x in rest:
        best = x if x < best else best
    return best


def maximum(*args: Any) -> Num:
    best, *rest = _settle(args)
    for x in rest:
        best = x if x > best else best
    return best


def clamp(*args: Any) -> Num:
    x, low, high = _settle(args)
    return low if x < low else high if high < x else x


def sign(x: Any) -> Num:
    (n,) = _settle((x,))
    return make(n.t, 1) if n > 0 else make(n.t, -1) if n < 0 else n


def _convert(t: str) -> Callable[[Any], Num]:
    def run(x: Any) -> Num:
        v = x.v if isinstance(x, Num) else x
        if t in FLOATS:
            return make(t, v)
        if isinstance(v, float) and not math.isfinite(v):
            raise Fault
        signed, bits = BITS[t]
        n = int(v)
        if not (-(1 << (bits - 1)) if signed else 0) <= n < 1 << (bits - signed):
            raise Fault
        return Num(t, n)

    return run


def zeros(*shape: Any) -> Arr:
    extents = tuple(int(n) for n in shape)
    return Arr("f64", extents, [Num("f64", 0.0)] * math.prod(extents))


def eye(n: int) -> Arr:
    return Arr("f64", (n, n), [Num("f64", float(i % (n + 1) == 0)) for i in range(n * n)])


def builtins() -> dict[str, Any]:
    names: dict[str, Any] = {n: (lambda *a, n=n: call_math(n, *a)) for n in _ELEMENTARY}
    names |= {t: _convert(t) for t in (*BITS, *FLOATS)}
    names |= {"floor": _whole(math.floor), "ceil": _whole(math.ceil), "trunc": _whole(math.trunc), "sqrt": sqrt}
    names |= {"min": minimum, "max": maximum, "clamp": clamp, "sign": sign, "abs": lambda x: abs(local(x))}
    names |= {"isnan": lambda x: math.isnan(x.v), "isfinite": lambda x: math.isfinite(x.v), "zeros": zeros, "eye": eye}
    names |= {"pi": math.pi, "inf": math.inf, "nan": math.nan, "Health": _Words(), "TransitionRequest": _Words()}
    return names | {"_local": local, "_typed": typed, "_parse": parse, "_from_end": FromEnd}


_ELEMENTARY = ("sin", "cos", "tan", "asin", "acos", "atan", "exp", "log", "atan2", "pow", "hypot")


# ---- programs ------------------------------------------------------------------------------------------------------


class _Rewrite(ast.NodeTransformer):
    """Stores copy and give bare literals their type; constant negative indices are marked. Lines stay where they are."""

    def __init__(self) -> None:
        self.function: ast.FunctionDef | None = None

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.function = node
        node.body = [self.visit(s) for s in node.body]
        self.function = None
        return node

    def visit_Return(self, node: ast.Return) -> ast.AST:
        self.generic_visit(node)
        assert self.function
        if node.value is not None and self.function.returns is not None:
            node.value = self._store(self.function.returns, node.value)
        return node

    def _store(self, annotation: ast.expr, value: ast.expr) -> ast.expr:
        text = annotation.value if isinstance(annotation, ast.Constant) else ast.unparse(annotation)
        parsed = self._call("_parse", ast.Constant(text), self._call("globals"))
        return self._call("_typed", ast.Starred(parsed, ast.Load()), value)

    def _call(self, name: str, *args: ast.expr) -> ast.expr:
        return ast.Call(ast.Name(name, ast.Load()), list(args), [])

    def visit_Assign(self, node: ast.Assign) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.targets[0], ast.Name) and (self.function or isinstance(node.value, ast.List)):
            node.value = self._call("_local", node.value)
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST:
        if node.value is None:
            return node
        self.generic_visit(node)
        return ast.Assign([node.target], self._store(node.annotation, node.value))

    def visit_Subscript(self, node: ast.Subscript) -> ast.AST:
        self.generic_visit(node)
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        marked = [
            self._call("_from_end", p.operand)
            if isinstance(p, ast.UnaryOp) and isinstance(p.op, ast.USub) and isinstance(p.operand, ast.Constant)
            else p
            for p in parts
        ]
        node.slice = ast.Tuple(marked, ast.Load()) if isinstance(node.slice, ast.Tuple) else marked[0]
        return node


def _execute(text: str, name: str, names: dict[str, Any]) -> None:
    tree = ast.parse("from __future__ import annotations\n" + text)
    tree.body = [n for n in tree.body if not (isinstance(n, ast.ImportFrom) and n.module == "fcsl_builtins")]
    exec(compile(ast.fix_missing_locations(_Rewrite().visit(tree)), name, "exec"), names)


def _generic(f: FunctionType) -> Callable[..., Any]:
    """A library function: the size variables of its annotations are bound from its arguments at each call."""
    patterns = [str(a).strip("'\"") for n, a in f.__annotations__.items() if n != "return"]

    def run(*args: Any) -> Any:
        sizes: dict[str, int] = {}
        values = [local(a) if isinstance(a, list) else a for a in args]
        for pattern, value in zip(patterns, values, strict=True):
            if "[" in pattern:
                for extent, size in zip(pattern.split("[")[1].rstrip("]").split(","), value.shape, strict=True):
                    assert not extent.strip().isdigit() or int(extent) == size
                    assert sizes.setdefault(extent.strip(), size) == size
        values = [make("f64", v) if not isinstance(v, Num | Arr) else v for v in values]
        return FunctionType(f.__code__, {**f.__globals__, **sizes})(*values)

    return run


@cache
def library() -> dict[str, Any]:
    """Builtins and library functions; each sees the others through the globals they share."""
    names = builtins()
    folder = Path(fcsl_compiler.__file__).parent / "library"
    for path in sorted(folder.glob("*.py")):
        before = dict(names)
        _execute(path.read_text(), str(path), names)
        for name, value in names.items():
            if isinstance(value, FunctionType) and before.get(name) is not value:
                names[name] = _generic(value)
    return names


class Program:
    """One algorithm run by CPython. `run(inputs)` is one execute; it returns the health."""

    def __init__(self, text: str, parameters: dict[str, Any] | None = None):
        self.names = dict(library())
        _execute(text, "<algorithm>", self.names)
        sizes = {n: v for n, v in self.names.items() if isinstance(v, int) and not isinstance(v, bool)}
        self.records = {}
        for record in ("Inputs", "Parameters", "Outputs", "State"):
            declared = getattr(self.names.get(record), "__annotations__", {})
            ports = {n: parse(str(a).strip("'\""), sizes) for n, a in declared.items()}
            if record == "Outputs":
                ports |= {"health": ("Health", ()), "transition_request": ("TransitionRequest", ())}
            self.records[record] = Record(ports)
        for name, value in (parameters or {}).items():
            setattr(self.records["Parameters"], name, value)
        if "start" in self.names:
            self._call("start")

    def _call(self, name: str) -> None:
        f = self.names[name]
        order = [str(a).strip("'\"") for n, a in f.__annotations__.items() if n != "return"]
        f(*(self.records[r] for r in order))

    def run(self, inputs: dict[str, Any]) -> str:
        for name, value in inputs.items():
            setattr(self.records["Inputs"], name, value)
        outputs = self.records["Outputs"]
        outputs.health, outputs.transition_request = "nominal", ""
        before = {r: self.records[r].clone() for r in ("Outputs", "State")}
        try:
            self._call("execute")
        except (Fault, ZeroDivisionError):  # the second: loop variables are plain integers here
            self.records.update(before)
            return "failed"
        return str(outputs.health)

    def values(self) -> Iterable[tuple[str, list[Any]]]:
        """Path below the instance and plain scalars of every output and state field."""
        for record in ("Outputs", "State"):
            r = self.records[record]
            for name in r._ports:
                if name in ("health", "transition_request"):
                    continue
                value = getattr(r, name)
                items = value.items() if isinstance(value, Arr) else [value]
                yield f"{record.lower()}.{name}", [i.v if isinstance(i, Num) else i for i in items]


def bits(value: Any, single: bool = False) -> Any:
    """What must be equal: every NaN is one, zeros have signs."""
    if isinstance(value, float):
        return "nan" if math.isnan(value) else struct.pack("<d", value).hex()
    return value
