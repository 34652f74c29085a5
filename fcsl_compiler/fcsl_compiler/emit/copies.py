# SPDX-License-Identifier: Apache-2.0
"""Copies of values with storage."""

from __future__ import annotations

from ..model import code

#: Blocks of at most this many elements are copied one by one. Of a short memcpy gcc makes loads of two elements at once.
#: These wait until the stores of both have reached the cache, and keep the block out of registers (measured: a step of
#: the lander takes 73 ns with memcpy and 39 ns without).
_SHORT_ELEMENTS = 16

_I = code.Name("i_")


def copied(to: code.Place, source: code.Place, type_: code.Type) -> code.Statement:
    """Copies a value. Blocks do not overlap."""
    if not isinstance(type_, code.Block):
        return code.Set(to, source)
    # Records are assigned: gcc 12 takes the first member of one for all bytes of a memcpy, and warns of an overflow.
    is_short = type_.count <= _SHORT_ELEMENTS
    if is_short or isinstance(type_.element, code.Named):
        element = code.Set(code.Element(to, _I), code.Element(source, _I))
        return code.Count(_I.text, type_.count, (element,), type_.count if is_short else 0)
    return code.Copy(to, source, type_)
