# SPDX-License-Identifier: Apache-2.0
"""Results of arithmetic instructions on two known values."""

from __future__ import annotations

from .bases import Aligned, Between
from .values import WORD, Value, greatest, minus, plus, signed


def binary(name: str, a: Value, b: Value, bits: int) -> Value:
    """Result of an operation of a (the target) with b."""
    if name == "add":
        return plus(a, b, bits)
    if name == "sub":
        return minus(a, b, bits)
    if name == "and" and ("", 0) in (a, b):
        return ("", 0)
    if a is None or b is None:
        return None
    if name == "and" and b[0] == "" and bits == 64 and a[0] != "":
        return _aligned(a, WORD + 1 - b[1])
    if name == "shr" and b[0] == "" and isinstance(a[0], Between):
        return _shifted(a, b[1] & (63 if bits == 64 else 31))
    if a[0] != "" or b[0] != "":
        return a if name in ("and", "or") and a == b else None
    x, y, mask = a[1], b[1], (1 << bits) - 1
    count = y & (63 if bits == 64 else 31)
    if name in ("shl", "shr"):
        return ("", (x << count if name == "shl" else x >> count) & mask)
    if name == "sar":
        return ("", signed(x, bits) >> count & mask)
    if name in ("ror", "rol"):
        count = count % bits if name == "ror" else -count % bits
        return ("", (x >> count | x << (bits - count)) & mask)
    if name == "imul":
        return ("", signed(x, bits) * signed(y, bits) & mask)
    if name in ("and", "or", "xor"):
        return ("", {"and": x & y, "or": x | y, "xor": x ^ y}[name] & mask)
    return None


def _aligned(address: tuple[object, int], step: int) -> Value:
    """An address without its lowest bits: the greatest multiple of `step` up to it."""
    base, at = address
    if step & (step - 1) or not isinstance(base, str) or base in ("byte", "low"):
        return None
    if base == "rsp":
        return (base, at & -step) if step <= 8 else None  # on entry a multiple of 8 (System V ABI)
    return (Aligned(base, at, step), 0)


def _shifted(value: tuple[object, int], count: int) -> Value:
    most = greatest(value)
    if most is None:
        return None
    low = value[1] >> count
    spread = (most >> count) - low
    return (Between(("shifted", value, count), spread), low) if spread else ("", low)
