# SPDX-License-Identifier: Apache-2.0
"""Calls of externs: the real C functions in a shared library (fcsl_compiler.driver.externs)."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from .algorithm import Extern
from .arrays import ArrayType
from .structs import StructType
from .types import Scalar, Type

_SCALARS = {
    "bool": ctypes.c_bool,
    "i32": ctypes.c_int32,
    "i64": ctypes.c_int64,
    "u32": ctypes.c_uint32,
    "u64": ctypes.c_uint64,
    "f32": ctypes.c_float,
    "f64": ctypes.c_double,
}


@cache
def _layout(type_: Type) -> Any:
    """The ctypes type of a value as in the machine's header: arrays flat, structs in the order of their members."""
    if isinstance(type_, StructType):
        members = [(f"m_{name}", _layout(member)) for name, member in type_.members.items()]
        return type(type_.name, (ctypes.Structure,), {"_fields_": members})
    if isinstance(type_, ArrayType):
        return _layout(type_.element) * type_.count
    return _SCALARS[type_.name]


def _to_c(type_: Type, value: Any) -> Any:
    if isinstance(type_, StructType):
        return _layout(type_)(*(_to_c(member, getattr(value, name)) for name, member in type_.members.items()))
    if isinstance(type_, ArrayType):
        return _layout(type_)(*(_to_c(type_.element, item) for item in value.data))
    return value


def _from_c(type_: Type, value: Any) -> Any:
    if isinstance(type_, StructType):
        return type_.of({name: _from_c(member, getattr(value, f"m_{name}")) for name, member in type_.members.items()})
    if isinstance(type_, ArrayType):
        return type_.of([_from_c(type_.element, item) for item in value])
    assert isinstance(type_, Scalar)
    return type_.of(value)


def externs_of(library: Path) -> Callable[[Extern], Callable[..., Any]]:
    """Makes callables of declared externs for ReferenceMachine: numbers by value, arrays and structs as pointers."""
    # Behind it the process, which has the C library: zig does not name that in a library which calls nothing of it.
    loaded = ctypes.CDLL(str(library)), ctypes.CDLL(None)

    def bind(extern: Extern) -> Callable[..., Any]:
        function = loaded[not hasattr(loaded[0], extern.name)][extern.name]
        result = extern.result
        out = None if isinstance(result, Scalar | None) else _layout(result)
        function.argtypes = [_parameter(t) for t in extern.arguments] + ([ctypes.POINTER(out)] if out else [])
        function.restype = _layout(result) if isinstance(result, Scalar) else None

        def call(*args: Any) -> Any:
            pairs = zip(extern.arguments, args, strict=True)
            values = [_to_c(type_, type_.store(arg)) for type_, arg in pairs]
            if out is None or result is None:
                found = function(*values)
                return None if result is None else _from_c(result, found)
            filled = out()
            function(*values, filled)
            return _from_c(result, filled)

        return call

    return bind


def _parameter(type_: Type) -> Any:
    return _layout(type_) if isinstance(type_, Scalar) else ctypes.POINTER(_layout(type_))
