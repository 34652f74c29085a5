# SPDX-License-Identifier: Apache-2.0
"""C identifiers and literals for names and values of the source."""

from __future__ import annotations

import math

from .types import F32, Scalar

#: Keywords of C11 and C++.
C_KEYWORDS = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline int long register
    restrict return short signed sizeof static struct switch typedef union unsigned void volatile while bool true false
    alignas alignof and and_eq asm bitand bitor catch class compl concept constexpr decltype delete dynamic_cast explicit
    export friend mutable namespace new noexcept not not_eq nullptr operator or or_eq private protected public
    reinterpret_cast requires static_assert static_cast template this thread_local throw try typeid typename using virtual
    wchar_t xor xor_eq
    """.split()
)
# Records of an instance; macros and functions of the headers that generated code includes.
_RESERVED = C_KEYWORDS | frozenset(
    """
    inputs parameters outputs state
    NULL NAN INFINITY HUGE_VAL errno memcpy memset offsetof isnan isinf isfinite signbit linux unix
    sqrt fabs floor ceil trunc fmod sqrtf fabsf floorf ceilf truncf fmodf HUGE_VALF HUGE_VALL math_errhandling MATH_ERRNO
    MATH_ERREXCEPT SIZE_MAX PTRDIFF_MIN PTRDIFF_MAX SIG_ATOMIC_MIN SIG_ATOMIC_MAX WCHAR_MIN WCHAR_MAX WINT_MIN WINT_MAX
    """.split()
)
#: Macros and types of the C that Nim makes.
_OF_NIM = frozenset(
    """
    ALLOC_0 CLANG_NO_SANITIZE_ADDRESS COMMA DL_ALLOC_0 GC_GUARD HAVE_STDINT_H IL64 INF NAN_INFINITY NIMBASE_H SEQ_DECL_SIZE
    STRING_LITERAL paramCount nimAddInt nimAddInt64 nimModInt nimModInt64 nimMulInt nimMulInt64 nimSubInt nimSubInt64
    NB8 NC NF NF32 NF64 NI NI8 NI16 NI32 NI64 NU NU8 NU16 NU32 NU64
    """.split()
)
_PREFIXES = ("fcsl_", "FCSL_", "cr_", "alg_", "mod_", "INT", "UINT", "int", "uint", "FP_", "M_", "_", "NIM_", "N_")


def c_name(name: str) -> str:
    """The name itself if C allows it, else the name with an underscore appended.

    Injective: a name that ends in an underscore gets another one. Generated names end in exactly one underscore and
    stay distinct.
    """
    if "." in name:
        return name.replace(".", "") + "_"  # hidden local of the checker
    if name in _RESERVED or name in _OF_NIM or "_tr_" in name or name.endswith("_") or name.startswith(_PREFIXES):
        return name + "_"
    return name


def c_literal(value: bool | int | float, type_: Scalar) -> str:
    """A C expression with exactly this value and type. If the value is written in hexadecimal, a comment gives the
    decimal."""
    if type_.name == "bool":
        return "true" if value else "false"
    if type_.is_float:
        return _float(float(value), "f" if type_ is F32 else "")
    assert isinstance(value, int)
    if type_.is_signed:
        if value == type_.low:
            return f"INT{type_.size * 8}_MIN"
        return str(value) if abs(value) < 2**31 else f"INT64_C({value})"
    return f"{value}u" if value < 2**32 else f"UINT64_C({value})"


def _float(value: float, suffix: str) -> str:
    if math.isnan(value):
        return f'__builtin_nan{suffix}("")'
    if math.isinf(value):
        return f"{'-' if value < 0 else ''}__builtin_inf{suffix}()"
    if value == int(value) and abs(value) < 1e6:
        return f"{value!r}{suffix}"
    mantissa, _, exponent = value.hex().partition("p")
    digits = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
    return f"{digits}p{exponent}{suffix} /* {value!r} */"


def c_string(text: str) -> str:
    """A C string literal, ASCII only, without trigraphs."""
    return f'"{text.encode().decode("latin-1").translate(_ESCAPES)}"'


#: What stands for a byte in a string literal, if not its character.
_ESCAPES = {byte: f"\\{byte:03o}" for byte in (*range(32), *range(127, 256))}
_ESCAPES |= {ord(char): f"\\{char}" for char in '"\\?'} | {ord("\n"): "\\n"}


def c_comment(text: str) -> str:
    """The text with comment delimiters broken up, so that it cannot end a comment."""
    return text.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("\n", " ")
