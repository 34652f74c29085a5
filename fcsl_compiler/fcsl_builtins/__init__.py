# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, so that CPython can import algorithm files. __init__.pyi describes them for editors.

The compiler does not use this module. Functions compute with fcsl_compiler.reference, which is loaded by the first
call; a constant such as `LIMIT = sqrt(2.0)` therefore has its value. Functions that reach outside the machine raise
RuntimeError.
"""

import functools
import math
from collections.abc import Callable
from typing import Any

_CONVERSIONS = ("i32", "i64", "u32", "u64", "f32", "f64")
_TYPES = (*_CONVERSIONS, "bool", "TransitionRequest", "Health")
_HARDWARE = ("hw_read_gpio", "hw_write_gpio", "hw_read_adc", "hw_read_u32", "hw_write_u32")
_FUNCTIONS = (
    # functions of scalars
    "sqrt sin cos tan asin acos atan atan2 sinh cosh tanh exp expm1 log log1p log2 log10 pow cbrt hypot floor ceil trunc round "
    "fmod copysign lerp wrap_angle isnan isinf isfinite abs min max clamp sign wrap_i32 wrap_i64 wrap_u32 wrap_u64 "
    "sat_i32 sat_i64 sat_u32 sat_u64 where wrap_add wrap_sub wrap_mul sat_add sat_sub sat_mul "
    # array constructors, and the numeric library
    "zeros eye "
    "dot norm normalize cross3 skew outer trace diag transpose matvec matmul symmetric_product inv det lu_solve "
    "ldl_solve solve cholesky quat_mul quat_conj quat_normalize quat_rotate quat_to_dcm quat_from_axis_angle quat_turn "
    "quat_from_euler quat_to_euler quat_slerp kf_predict_state kf_predict_cov kf_gain kf_update_state kf_update_cov "
    "kf_update_cov_joseph sum mean argmin argmax any all sort median "
    "interp_cell interp interp2 interp3 extrapolate extrapolate2 extrapolate3"
).split()

__all__ = ["event", "extern", "pi", "inf", "nan", *_TYPES, *_HARDWARE, *_FUNCTIONS]

pi, inf, nan = math.pi, math.inf, math.nan


class _Type:
    """A scalar type, or an array type such as f64[3][3]. Numeric scalar types also convert numbers."""

    def __init__(self, name: str):
        self._name = name

    def __repr__(self) -> str:
        return self._name

    def __getitem__(self, extent: Any) -> "_Type":
        if isinstance(extent, tuple):
            raise TypeError(f"write {self}{''.join(f'[{e}]' for e in extent)}: one pair of brackets for each dimension")
        return _Type(f"{self}[{extent}]")

    def __call__(self, value: Any) -> Any:
        if self._name not in _CONVERSIONS:
            raise TypeError(f"{self} converts nothing: it is a type for annotations")
        return _compute(self._name, (value,))


def extern(*, header: str, lang: str = "c") -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Declares a C function. The result keeps name and documentation of the stub, and raises RuntimeError when
    called."""
    return lambda stub: _outside(stub.__name__, f"an extern of {header}", stub)


def _outside(name: str, what: str, stub: Callable[..., Any] | None = None) -> Callable[..., Any]:
    def call(*args: Any, **named: Any) -> Any:
        raise RuntimeError(f"`{name}` is {what}: it works in a compiled machine only (AlgTwin, fcsl-fc)")

    call.__name__ = call.__qualname__ = name
    return functools.wraps(stub)(call) if stub is not None else call


# ---- functions -----------------------------------------------------------------------------------------------------


def _compute(name: str, args: tuple[Any, ...]) -> Any:
    from fcsl_compiler.reference.functions import builtins
    from fcsl_compiler.reference.library import library

    functions = library().functions
    variant = f"{name}__{len(args)}"  # one overload for each number of arguments
    if variant not in functions and name in builtins():
        return builtins()[name](*args)
    return functions[variant if variant in functions else name](*map(_as_f64, args))


def _as_f64(value: Any) -> Any:
    """An argument of the library. Numbers become f64, lists arrays."""
    if isinstance(value, list):
        from fcsl_compiler.reference.arrays import array_of
        from fcsl_compiler.reference.types import SCALARS

        return array_of(SCALARS["f64"])(*map(_as_f64, value))
    return float(value) if type(value) is int else value


def _function(name: str) -> Callable[..., Any]:
    def call(*args: Any) -> Any:
        return _compute(name, args)

    call.__name__ = call.__qualname__ = name
    return call


globals().update({name: _Type(name) for name in _TYPES})
globals().update({name: _outside(name, "a hardware function") for name in _HARDWARE})
event = _outside("event", "a report to the host")
globals().update({name: _function(name) for name in _FUNCTIONS})
