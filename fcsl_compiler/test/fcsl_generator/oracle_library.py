# SPDX-License-Identifier: Apache-2.0
"""The library with NumPy. Its loops define it, so CPython runs them on arrays and scalars of the type of the arguments. The
rules for constant arguments are implemented again here."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from functools import cache
from types import FunctionType
from typing import Any

import numpy as np

from .catalog import FILES, Pattern, library
from .types import FLOATS


def call(name: str, args: list[Any]) -> Any:
    """Calls a library function on lists of rows and scalars."""
    from . import oracle

    given = [np.array(a).view(_Constant) if isinstance(a, oracle.Constant) else a for a in args]
    element = _element(args[0])
    result = _named(name, len(args), element)(*given)
    return oracle.constant(_plain(result)) if isinstance(result, _Constant) else _plain(result)


def _element(value: Any) -> str:
    """The type of a number, or of the elements of rows. Python's integers stand for every type of integers."""
    while isinstance(value, list):
        value = value[0]
    return {np.float64: "f64", np.float32: "f32", bool: "bool"}.get(type(value), "int")


class _Constant(np.ndarray[Any, Any]):
    """A constant argument, or the transpose of one. Any other result computed from it is an ordinary array."""

    def __add__(self, other: Any) -> Any:
        left, right = np.asarray(self), np.asarray(other)
        if isinstance(other, _Constant):
            return np.where(right == 0.0, left, left + right)
        return np.where(left == 0.0, right, left + right)

    def __sub__(self, other: Any) -> Any:
        left, right = np.asarray(self), np.asarray(other)
        return np.where(right == 0.0, left, left - right) if isinstance(other, _Constant) else left - right

    def __array_wrap__(self, array: Any, *_: Any) -> Any:
        return array[()] if array.ndim == 0 else array

    def __getitem__(self, index: Any) -> Any:
        return np.asarray(self)[index]

    def __radd__(self, other: Any) -> Any:
        right, left = np.asarray(self), np.asarray(other)
        return np.where(right == 0.0, left, left + right)

    def __rsub__(self, other: Any) -> Any:
        right, left = np.asarray(self), np.asarray(other)
        return np.where(right == 0.0, left, left - right)


def _product(a: Any, b: Any) -> Any:
    """matmul or matvec with at least one constant argument: products with a structural zero are omitted."""
    counts_a, counts_b = (np.asarray(x) != 0.0 if isinstance(x, _Constant) else np.full(x.shape, True) for x in (a, b))
    left, right = np.asarray(a), np.asarray(b).reshape(b.shape[0], -1)
    counts_b = counts_b.reshape(right.shape)
    result = np.zeros((left.shape[0], right.shape[1]), left.dtype)
    for i, j in np.ndindex(result.shape):
        products = [left[i, p] * right[p, j] for p in range(left.shape[1]) if counts_a[i, p] and counts_b[p, j]]
        total = products[0] if products else left.dtype.type(0.0)
        for one in products[1:]:
            total = total + one
        result[i, j] = total
    return result[:, 0] if b.ndim == 1 else result


_DTYPES: dict[str, Any] = {"f64": np.float64, "f32": np.float32, "bool": bool, "int": object}


def _named(name: str, count: int, element: str) -> Callable[..., Any]:
    functions = _functions(element)
    return functions.get(f"{name}__{count}") or functions[name]


@cache
def _functions(element: str) -> dict[str, Any]:
    """The functions for elements of this type."""
    from . import oracle

    dtype = _DTYPES[element]
    names: dict[str, Any] = {
        "zeros": lambda *n: np.zeros(n, dtype),
        "eye": lambda n: np.eye(n, dtype=dtype),
        "nan": dtype(math.nan) if element in FLOATS else math.nan,
        "pi": dtype(math.pi) if element in FLOATS else math.pi,
        "wrap_add": operator.add,
        "wrap_sub": operator.sub,
    }
    for builtin in ("abs", "sqrt", "lerp", "isnan", "min", "max", "clamp", *oracle.ELEMENTARY_1, *oracle.ELEMENTARY_2):
        names[builtin] = _builtin(oracle.builtin, builtin, element)
    for path in FILES:
        own: dict[str, Any] = {}
        text = "from __future__ import annotations\n" + path.read_text().replace("from fcsl_builtins import", "#")
        exec(compile(text, str(path), "exec"), names, own)
        names |= {n: _sized(n, f, names, element) for n, f in own.items() if isinstance(f, FunctionType)}
    return names


def _builtin(f: Callable[..., Any], name: str, element: str) -> Callable[..., Any]:
    """Literals among the arguments have the type of the others: of the elements, unless all are integers."""

    def call(*args: Any) -> Any:
        whole = all(isinstance(a, int) for a in args) or element not in FLOATS
        return f(name, "i64", list(args)) if whole else f(name, element, [_DTYPES[element](a) for a in args])

    return call


def _sized(name: str, f: FunctionType, names: dict[str, Any], element: str) -> Callable[..., Any]:
    """Arguments are copies, the result is an array or a scalar. Size variables get their values at each call."""
    name, dtype = name.split("__")[0], _DTYPES[element]
    patterns: tuple[Pattern, ...] = next(
        s.args for s in library() if s.name == name and len(s.args) == f.__code__.co_argcount
    )

    def run(*args: Any) -> Any:
        arrays = [a if isinstance(a, _Constant) else np.array(a, dtype=dtype) for a in args]
        constant = any(isinstance(a, _Constant) for a in arrays)
        if constant and name in ("matmul", "matvec"):
            return _product(*arrays)
        if constant and name == "symmetric_product":
            upper = np.triu(np.ones((len(arrays[0]), len(arrays[0])), dtype=bool))
            full = _product(*arrays)
            return np.where(upper, full, full.T)
        sizes: dict[str, Any] = {}
        for pattern, array in zip(patterns, arrays, strict=True):
            extents = (n if isinstance(n, str) else str(n) for n in pattern.extents)
            sizes |= dict(zip(extents, array.shape, strict=True))
        values = [a if a.shape else dtype(a) if element in FLOATS else a[()] for a in arrays]
        overloads = {s.name: _overloaded(s.name, element) for s in library() if s.name == name}
        result = FunctionType(f.__code__, {**names, **overloads, **sizes})(*values)
        if constant and name == "transpose":
            return result.view(_Constant)
        return np.array(result, dtype=dtype) if isinstance(result, list) else result

    return run


def _overloaded(name: str, element: str) -> Callable[..., Any]:
    """A function by its number of arguments, as a call within the library chooses it."""

    def call(*args: Any) -> Any:
        functions = _functions(element)
        found = functions.get(f"{name}__{len(args)}") or functions[name]
        return found(*args)

    return call


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [_plain(v) for v in value]
    return bool(value) if isinstance(value, np.bool_) else value
