# SPDX-License-Identifier: Apache-2.0
"""Numbers with types.

`f64` is Python's float: the same IEEE 754 arithmetic. `f32`, `i32`, `i64`, `u32` and `u64` are subclasses of float and
int, so that they print as numbers. The rewrite gives literals their types (infer.py). An int or float without type, for
example typed at a debugger's prompt, adopts the type of the other operand. Operators that differ in CPython (`/`, `//`,
`%`, `**`) are functions here, which the rewrite calls.
"""

from __future__ import annotations

import math
from ctypes import CDLL, c_char_p, c_float, c_void_p
from typing import Any, ClassVar

_strtof = CDLL(None).strtof
_strtof.argtypes, _strtof.restype = [c_char_p, c_void_p], c_float


class Fault(Exception):
    """A contained fault: it ends the `execute` in which it occurs. str() is its cause. place: path of a file, line, and
    offset in bytes; by default where it is raised."""

    def __init__(self, cause: str, place: tuple[str, int, int] | None = None):
        super().__init__(cause)
        self.place = place


class IllTyped(TypeError):
    """An operation on incompatible types. It shows a defect of the compiler, which accepted this program."""


_ZERO_DIVISOR = "the divisor is zero"


class F32(float):
    """A binary32 number; the argument must already be one (as_f32 rounds). Every operation is rounded once, which
    binary64 is precise enough for."""

    __slots__ = ()

    def __add__(self, other: Any) -> Any:
        if type(other) is not F32 and (other := _beside_f32(other)) is None:
            return NotImplemented
        return F32(c_float(float.__add__(self, other)).value)

    def __sub__(self, other: Any) -> Any:
        if type(other) is not F32 and (other := _beside_f32(other)) is None:
            return NotImplemented
        return F32(c_float(float.__sub__(self, other)).value)

    def __mul__(self, other: Any) -> Any:
        if type(other) is not F32 and (other := _beside_f32(other)) is None:
            return NotImplemented
        return F32(c_float(float.__mul__(self, other)).value)

    def __truediv__(self, other: Any) -> Any:
        if type(other) is not F32 and (other := _beside_f32(other)) is None:
            return NotImplemented
        return F32(c_float(_ieee_divide(float(self), float(other))).value)

    def __floordiv__(self, other: Any) -> Any:
        other = _beside_f32(other)
        return F32(c_float(math.nan if other == 0 else float.__floordiv__(self, other)).value)

    def __mod__(self, other: Any) -> Any:
        other = _beside_f32(other)
        return F32(c_float(math.nan if other == 0 else float.__mod__(self, other)).value)

    def __radd__(self, other: Any) -> Any:
        return as_f32(other) + self

    def __rsub__(self, other: Any) -> Any:
        return as_f32(other) - self

    def __rmul__(self, other: Any) -> Any:
        return as_f32(other) * self

    def __rtruediv__(self, other: Any) -> Any:
        return as_f32(other) / self

    def __rfloordiv__(self, other: Any) -> Any:
        return as_f32(other) // self

    def __rmod__(self, other: Any) -> Any:
        return as_f32(other) % self

    def __neg__(self) -> F32:
        return F32(float.__neg__(self))

    def __abs__(self) -> F32:
        return F32(float.__abs__(self))

    def __lt__(self, other: Any) -> bool:
        return float.__lt__(self, as_f32(other))

    def __le__(self, other: Any) -> bool:
        return float.__le__(self, as_f32(other))

    def __gt__(self, other: Any) -> bool:
        return float.__gt__(self, as_f32(other))

    def __ge__(self, other: Any) -> bool:
        return float.__ge__(self, as_f32(other))

    def __eq__(self, other: Any) -> bool:
        return float.__eq__(self, as_f32(other))

    def __ne__(self, other: Any) -> bool:
        return float.__ne__(self, as_f32(other))

    __hash__ = float.__hash__


def _beside_f32(other: Any) -> F32 | None:
    """The other operand of an f32. None if it is not a number (an array)."""
    return as_f32(other) if isinstance(other, int | float) else None


def as_f32(value: Any) -> F32:
    """The value as f32: unchanged, or a literal that adopts the type."""
    if type(value) is F32:
        return value
    if type(value) is float:
        return F32(c_float(value).value)
    if type(value) is int:
        return F32(round_int_to_f32(value))
    raise IllTyped(f"{value!r} ({type(value).__name__}) where f32 is needed")


def decimal_f32(text: str) -> F32:
    """The f32 nearest to a float literal, rounded once (strtof of the C library)."""
    return F32(_strtof(text.replace("_", "").encode(), None))


def as_f64(value: Any) -> float:
    """The value as f64: unchanged, or a literal that adopts the type."""
    if type(value) is float:
        return value
    if type(value) is int:
        return float(value)
    raise IllTyped(f"{value!r} ({type(value).__name__}) where f64 is needed")


def as_bool(value: Any) -> bool:
    if type(value) is bool:
        return value
    raise IllTyped(f"{value!r} where a bool is needed")


def round_int_to_f32(n: int) -> float:
    """Rounds once, to nearest even. Conversion via f64 would round twice."""
    magnitude = abs(n)
    shift = max(0, magnitude.bit_length() - 24)
    kept, rest, half = magnitude >> shift, magnitude & ((1 << shift) - 1), (1 << shift) >> 1
    kept += rest > half or (shift > 0 and rest == half and kept & 1)
    return float(-kept << shift if n < 0 else kept << shift)


class TypedInt(int):
    """Base of the four integer types. `of` converts a result to its type, by wrapping it or with a fault."""

    __slots__ = ()
    bits: ClassVar[int]
    low: ClassVar[int]
    high: ClassVar[int]

    @classmethod
    def of(cls, value: int) -> Any:
        raise NotImplementedError

    @classmethod
    def adopt(cls, value: Any) -> Any:
        """The value in this type: unchanged, or a literal or loop variable that fits it."""
        if type(value) is cls:
            return value
        if type(value) is not int:
            raise IllTyped(f"{value!r} ({type(value).__name__}) where {cls.__name__.lower()} is needed")
        if not cls.low <= value <= cls.high:
            raise cls._overflow()
        return cls(value)

    @classmethod
    def _overflow(cls) -> Fault:
        return Fault(f"the result does not fit {cls.__name__.lower()}")

    def _beside(self, other: Any) -> Any:
        """The other operand. None if it is not a number (an array)."""
        if type(other) is int:
            return type(self).adopt(other)
        if isinstance(other, int | float):
            raise IllTyped(f"{type(self).__name__.lower()} mixed with {type(other).__name__.lower()}")
        return None

    def __add__(self, other: Any) -> Any:
        if type(other) is not type(self) and (other := self._beside(other)) is None:
            return NotImplemented
        return self.of(int.__add__(self, other))

    def __sub__(self, other: Any) -> Any:
        if type(other) is not type(self) and (other := self._beside(other)) is None:
            return NotImplemented
        return self.of(int.__sub__(self, other))

    def __mul__(self, other: Any) -> Any:
        if type(other) is not type(self) and (other := self._beside(other)) is None:
            return NotImplemented
        return self.of(int.__mul__(self, other))

    def __floordiv__(self, other: Any) -> Any:
        other = self.adopt(other)
        if int.__eq__(other, 0):
            raise Fault(_ZERO_DIVISOR)
        return self.of(int.__floordiv__(self, other))

    def __mod__(self, other: Any) -> Any:
        other = self.adopt(other)
        if int.__eq__(other, 0):
            raise Fault(_ZERO_DIVISOR)
        return self.of(int.__mod__(self, other))

    def __and__(self, other: Any) -> Any:
        return self.of(int.__and__(self, self.adopt(other)))

    def __or__(self, other: Any) -> Any:
        return self.of(int.__or__(self, self.adopt(other)))

    def __xor__(self, other: Any) -> Any:
        return self.of(int.__xor__(self, self.adopt(other)))

    def __lshift__(self, other: Any) -> Any:
        if self.low != 0:
            raise IllTyped("<< of a signed integer")
        return self.of(int.__lshift__(self, self._count(other)))

    def __rshift__(self, other: Any) -> Any:
        return self.of(int.__rshift__(self, self._count(other)))

    def _count(self, other: Any) -> int:
        count = int(other)
        if not 0 <= count < self.bits:
            raise Fault(f"the shift count is outside [0, {self.bits})")
        return count

    def __radd__(self, other: Any) -> Any:
        return self.adopt(other) + self

    def __rsub__(self, other: Any) -> Any:
        return self.adopt(other) - self

    def __rmul__(self, other: Any) -> Any:
        return self.adopt(other) * self

    def __rfloordiv__(self, other: Any) -> Any:
        return self.adopt(other) // self

    def __rmod__(self, other: Any) -> Any:
        return self.adopt(other) % self

    def __rand__(self, other: Any) -> Any:
        return self.adopt(other) & self

    def __ror__(self, other: Any) -> Any:
        return self.adopt(other) | self

    def __rxor__(self, other: Any) -> Any:
        return self.adopt(other) ^ self

    def __rlshift__(self, other: Any) -> Any:
        return self.adopt(other) << self

    def __rrshift__(self, other: Any) -> Any:
        return self.adopt(other) >> self

    def __truediv__(self, other: Any) -> Any:
        raise IllTyped("/ of integers")

    __rtruediv__ = __truediv__

    def __neg__(self) -> Any:
        return self.of(int.__neg__(self))

    def __abs__(self) -> Any:
        return self.of(int.__abs__(self))

    def __invert__(self) -> Any:
        return self.of(int.__invert__(self))


class _Signed(TypedInt):
    __slots__ = ()

    @classmethod
    def of(cls, value: int) -> Any:
        if cls.low <= value <= cls.high:
            return cls(value)
        raise cls._overflow()


class _Unsigned(TypedInt):
    __slots__ = ()

    @classmethod
    def of(cls, value: int) -> Any:
        return cls(value & cls.high)


class I32(_Signed):
    __slots__ = ()
    bits, low, high = 32, -(1 << 31), (1 << 31) - 1


class I64(_Signed):
    __slots__ = ()
    bits, low, high = 64, -(1 << 63), (1 << 63) - 1


class U32(_Unsigned):
    __slots__ = ()
    bits, low, high = 32, 0, (1 << 32) - 1


class U64(_Unsigned):
    __slots__ = ()
    bits, low, high = 64, 0, (1 << 64) - 1


INTEGERS: dict[str, type[TypedInt]] = {"i32": I32, "i64": I64, "u32": U32, "u64": U64}


def _ieee_divide(a: float, b: float) -> float:
    if b != 0.0:
        return a / b
    if a == 0.0 or math.isnan(a):
        return math.nan
    return math.copysign(math.inf, math.copysign(1.0, a) * math.copysign(1.0, b))


def divide(a: Any, b: Any) -> Any:
    """a / b as in IEEE 754; Python raises an exception for a zero divisor."""
    try:
        return a / b
    except ZeroDivisionError:
        return _ieee_divide(float(a), float(b))


class Zero:
    """A divisor that is an f64 zero. Code that divides often replaces a zero by it, which costs nothing where it is
    none."""

    __slots__ = ("zero",)

    def __init__(self, zero: float):
        self.zero = zero

    def __rtruediv__(self, a: float) -> float:
        return _ieee_divide(a, self.zero)


def floor_divide(a: Any, b: Any) -> Any:
    """a // b. A zero divisor faults for integers and gives NaN for floats."""
    try:
        return a // b
    except ZeroDivisionError:
        return _of_zero_divisor(a, b)


def modulo(a: Any, b: Any) -> Any:
    """a % b. A zero divisor faults for integers and gives NaN for floats."""
    try:
        return a % b
    except ZeroDivisionError:
        return _of_zero_divisor(a, b)


def _of_zero_divisor(a: Any, b: Any) -> float:
    if isinstance(a, float) or isinstance(b, float):
        return math.nan
    raise Fault(_ZERO_DIVISOR)


def power(base: Any, exponent: int) -> Any:
    """base ** exponent for a literal exponent from 0 to 4: repeated multiplication from the left."""
    if exponent == 0:
        return F32(1.0) if type(base) is F32 else type(base)(1)
    result = base
    for _ in range(exponent - 1):
        result = result * base
    return result
