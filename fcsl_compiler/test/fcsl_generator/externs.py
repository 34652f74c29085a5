# SPDX-License-Identifier: Apache-2.0
"""Externs of generated machines: C functions that record every call, and equivalent functions for the oracle.

A result is a hash of the arguments, so every bit of them matters; all NaNs are equal. C and Python record a call as the
same numbers: the extern, then each scalar of its arguments and of its result as 64 bits.
"""

from __future__ import annotations

import ctypes
import math
import struct
from collections.abc import Iterator
from typing import Any

from . import tree as t
from .types import FLOATS, RANGE, WIDTH, Array, Struct, Type, row

#: Maximum number of 64-bit words recorded by C for one machine. Further calls are only counted.
KEPT = 1 << 16

_ODD, _STEP = 0x9E3779B97F4A7C15, 0xD1B54A32D192ED03
_MASK = (1 << 64) - 1


# ---- the meaning of a call -----------------------------------------------------------------------------------------


def scalars(type_: Type, value: Any) -> Iterator[tuple[str, Any]]:
    """The leaves of a value, arrays row by row, with their types."""
    if isinstance(type_, Array):
        for item in value:
            yield from scalars(row(type_), item)
    elif isinstance(type_, Struct):
        for name, member in type_.members:
            yield from scalars(member, value[name])
    else:
        yield type_, value


def word(type_: str, value: Any) -> int:
    """A scalar as 64 bits: integers sign-extended, floats by their representation."""
    if type_ == "f32":
        return 0x7FC00000 if math.isnan(value) else int.from_bytes(struct.pack("<f", value), "little")
    if type_ == "f64":
        return 0x7FF8000000000000 if math.isnan(value) else int.from_bytes(struct.pack("<d", value), "little")
    return int(value) & _MASK


def _mixed(h: int, w: int) -> int:
    h = (h ^ w) * _ODD & _MASK
    return h ^ h >> 29


def _number(type_: str, x: int) -> Any:
    """A value of a scalar type from 64 random bits: mostly small, sometimes any."""
    if type_ == "bool":
        return bool(x >> 63)
    if type_ in FLOATS:
        special = x >> 40 & 31
        return (math.nan, math.inf, -0.0)[special] if special < 3 else ((x & 0xFFFF) - 32768.0) / 256.0
    shift = x & 63 | (0 if x >> 8 & 3 == 0 else 48)
    if type_ in ("u32", "u64"):
        return x >> shift & RANGE[type_][1]
    size = x >> shift & (1 << (WIDTH[type_] - 1)) - 1
    return -size if x >> 6 & 1 else size


def result(extern: t.Extern, words: list[int]) -> Any:
    """Result of a call with these arguments in the form of a JSON literal. None if the extern has no result."""
    h = _mixed(0, extern.number)
    for w in words:
        h = _mixed(h, w)

    def made(type_: Type) -> Any:
        nonlocal h
        if isinstance(type_, Array):
            return [made(row(type_)) for _ in range(type_.shape[0])]
        if isinstance(type_, Struct):
            return {name: made(member) for name, member in type_.members}
        h = _mixed(h, _STEP)
        return _number(type_, h)

    return made(extern.result) if extern.result is not None else None


class Calls:
    """Calls recorded by the oracle."""

    def __init__(self) -> None:
        self._calls: list[str] = []

    def call(self, extern: t.Extern, args: list[Any]) -> Any:
        pairs = zip(extern.arguments, args, strict=True)
        words = [word(k, v) for (_, type_), arg in pairs for k, v in scalars(type_, arg)]
        found = result(extern, words)
        given = [] if extern.result is None else [word(k, v) for k, v in scalars(extern.result, found)]
        self._calls.append(_line(extern, [*words, *given]))
        return found

    def count(self) -> int:
        return len(self._calls)

    def text(self) -> list[str]:
        return list(self._calls)


def _line(extern: t.Extern, words: list[int]) -> str:
    return f"{extern.name} {' '.join(f'{w:x}' for w in words)}"


# ---- the same in C -------------------------------------------------------------------------------------------------


class CCalls:
    """Calls recorded by a machine's library, from native code or from CPython: both call the C functions."""

    def __init__(self, library: ctypes.CDLL, machine: str, externs: tuple[t.Extern, ...]):
        self._externs = {e.number: e for e in externs}
        self._words = (ctypes.c_uint64 * KEPT).in_dll(library, f"{t.EXTERN}{machine}_words")
        self._used = ctypes.c_uint64.in_dll(library, f"{t.EXTERN}{machine}_used")
        self._count = ctypes.c_uint64.in_dll(library, f"{t.EXTERN}{machine}_calls")
        self._used.value = self._count.value = 0

    def count(self) -> int:
        return int(self._count.value)

    def text(self) -> list[str]:
        assert self._used.value <= KEPT, "a generated machine calls more externs than are noted"
        lines, at = [], 0
        while at < self._used.value:
            extern = self._externs[self._words[at]]
            types = [k for _, k in extern.arguments] + ([extern.result] if extern.result is not None else [])
            size = sum(len(list(_leaf_types(k))) for k in types)
            lines.append(_line(extern, self._words[at + 1 : at + 1 + size]))
            at += 1 + size
        return lines


def _leaf_types(type_: Type) -> Iterator[str]:
    if isinstance(type_, Array):
        for _ in range(type_.shape[0]):
            yield from _leaf_types(row(type_))
    elif isinstance(type_, Struct):
        for _, member in type_.members:
            yield from _leaf_types(member)
    else:
        yield type_


_C_TYPES = {
    "bool": "bool",
    "i32": "int32_t",
    "i64": "int64_t",
    "u32": "uint32_t",
    "u64": "uint64_t",
    "f32": "float",
    "f64": "double",
}

_SOURCE = """\
#include <math.h>
#include <string.h>

#include "{name}.h"
#include "{prefix}.h"

#define EXPORTED __attribute__((visibility("default")))

EXPORTED uint64_t {prefix}_words[{kept}];
EXPORTED uint64_t {prefix}_used, {prefix}_calls;

static uint64_t mixed(uint64_t h, uint64_t w)
{{
    h = (h ^ w) * UINT64_C({odd});
    return h ^ h >> 29;
}}

static void note(uint64_t w)
{{
    if ({prefix}_used < {kept}) {{
        {prefix}_words[{prefix}_used] = w;
    }}
    {prefix}_used++;
}}

static uint64_t word_f32(float x)
{{
    uint32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return isnan(x) ? 0x7fc00000 : bits;
}}

static uint64_t word_f64(double x)
{{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return isnan(x) ? UINT64_C(0x7ff8000000000000) : bits;
}}

static double as_float(uint64_t x)
{{
    const uint64_t special = x >> 40 & 31;
    return special == 0 ? NAN : special == 1 ? INFINITY : special == 2 ? -0.0 : ((double)(x & 0xffff) - 32768.0) / 256.0;
}}

static uint64_t shifted(uint64_t x)
{{
    return x >> ((x & 63) | ((x >> 8 & 3) == 0 ? 0 : 48));
}}
"""


class _Function:
    """Generates the C of one extern."""

    def __init__(self, machine: str, extern: t.Extern):
        self.machine, self.extern = machine, extern
        self.lines: list[str] = []
        self._depth = 0

    def prototype(self) -> str:
        """Scalars by value; arrays and structs by pointer, also as results."""
        out = self.extern.result
        args = [
            f"{self._type(k)} {n}" if isinstance(k, str) else f"const {self._type(k)} *{n}" for n, k in self._args()
        ]
        args += [f"{self._type(out)} *result"] if out is not None and not isinstance(out, str) else []
        returned = _C_TYPES[out] if isinstance(out, str) else "void"
        return f"{returned} {self.extern.name}({', '.join(args) or 'void'})"

    def definition(self) -> list[str]:
        out, number = self.extern.result, self.extern.number
        self.lines = ["", f"EXPORTED {self.prototype()}", "{", f"    {t.EXTERN_CASE}_calls++;", f"    note({number});"]
        self._line(f"uint64_t h = mixed(0, {number});")
        for name, type_ in self._args():
            self._each(type_, name, self._read)
        if isinstance(out, str):
            self._line(f"{_C_TYPES[out]} result;")
        if out is not None:
            self._each(out, "result", self._make)
        self._line("return result;" if isinstance(out, str) else "(void)h;")
        return [*self.lines, "}"]

    def _args(self) -> tuple[tuple[str, Type], ...]:
        return self.extern.arguments

    def _type(self, type_: Type) -> str:
        inner = type_.element if isinstance(type_, Array) else type_
        return f"{self.machine}_{inner}_t" if isinstance(inner, Struct) else _C_TYPES[inner]

    def _line(self, text: str) -> None:
        self.lines.append("    " * (self._depth + 1) + text)

    def _each(self, type_: Type, place: str, leaf: Any) -> None:
        """The text of `leaf` for every scalar. The place of a struct or array argument is a pointer."""
        if isinstance(type_, Struct):
            place = place if "[" in place or "." in place else f"(*{place})"
            for name, member in type_.members:
                self._each(member, f"{place}.{name}", leaf)
        elif isinstance(type_, Array):
            index = f"i{self._depth}"
            self._line(f"for (int {index} = 0; {index} < {math.prod(type_.shape)}; ++{index}) {{")
            self._depth += 1
            self._each(type_.element, f"{place}[{index}]", leaf)
            self._depth -= 1
            self._line("}")
        else:
            leaf(type_, place)

    def _read(self, type_: str, place: str) -> None:
        text = f"word_{type_}({place})" if type_ in FLOATS else f"(uint64_t)(int64_t){place}"
        self._line(f"note({text});")
        self._line(f"h = mixed(h, {text});")

    def _make(self, type_: str, place: str) -> None:
        self._line(f"h = mixed(h, UINT64_C({_STEP:#x}));")
        if type_ == "bool":
            value = "h >> 63 != 0"
        elif type_ in FLOATS:
            value = f"({_C_TYPES[type_]})as_float(h)"
        elif type_ in ("u32", "u64"):
            value = f"({_C_TYPES[type_]})shifted(h)"
        else:
            size = f"({_C_TYPES[type_]})(shifted(h) & {(1 << (WIDTH[type_] - 1)) - 1:#x})"
            value = f"(h >> 6 & 1) != 0 ? -{size} : {size}"
        self._line(f"{place} = {value};")
        text = f"word_{type_}({place})" if type_ in FLOATS else f"(uint64_t)(int64_t){place}"
        self._line(f"note({text});")


def c_files(machine: str, externs: tuple[t.Extern, ...]) -> tuple[str, str]:
    """Header and source. Names of externs are still those of the single case."""
    functions = [_Function(machine, e) for e in externs]
    header = ["#include <stdbool.h>", "#include <stdint.h>", "", *(f"{f.prototype()};" for f in functions)]
    source = _SOURCE.format(name=machine, prefix=t.EXTERN_CASE, kept=KEPT, odd=f"{_ODD:#x}")
    lines = [line for f in functions for line in f.definition()]
    return "\n".join(header) + "\n", source + "\n".join(lines) + "\n"
