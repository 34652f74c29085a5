# SPDX-License-Identifier: Apache-2.0
"""Results of arithmetic instructions on two known values."""

from __future__ import annotations

from .values import WORD, Value, minus, plus, signed


def binary(name: str, a: Value, b: Value, bits: int) -> Value:
    """Result of an operation of a (the target) with b."""
    if name == "add":
        return plus(a, b, bits)
    if name == "sub":
        return minus(a, b, bits)
    if name == "and" and ("", 0) in (a, b):
        return ("", 0)
    if name == "and" and a is not None and a[0] in ("rsp", "rdi") and b == ("", WORD - 7):
        # On entry the stack pointer is a multiple of 8 (System V ABI). So is the machine, which contains its 64-bit
        # tick.
        return (a[0], a[1] & ~7)
    if a is None or b is None or a[0] != "" or b[0] != "":
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
