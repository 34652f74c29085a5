# SPDX-License-Identifier: Apache-2.0
"""About how much stack a step needs, from the arrays and records of its functions: what a host looks at before it runs a
machine. The bound that a build prints is that of the code (driver/stack.py)."""

from __future__ import annotations

from collections.abc import Sequence

from ..model import code
from ..model.types import Scalar

#: Of a function beside its arrays and records: what it saves, and its numbers.
_FRAME_BYTES = 256


def stack_bytes(records: Sequence[code.Record], functions: Sequence[code.Function], entry: str) -> int:
    """The most bytes along the calls of `entry`. Callees come before their callers."""
    sizes: dict[str, int] = {}
    for record in records:
        sizes[record.name] = sizes[record.like] if record.like else sum(_size(f.type, sizes) for f in record.fields)
    deepest: dict[str, int] = {}
    for function in functions:
        below = max((deepest.get(name, 0) for name in code.used_functions(function.body)), default=0)
        deepest[function.name] = _FRAME_BYTES + _locals(function.body, sizes) + below
    return deepest[entry]


def _locals(body: code.Body, sizes: dict[str, int]) -> int:
    total = 0
    for s in body:
        if isinstance(s, code.Let | code.Var) and isinstance(s.type, code.Block | code.Named):
            total += _size(s.type, sizes)
        total += sum(_locals(inner, sizes) for inner in code.parts(s)[1])
    return total


def _size(type_: code.Type, sizes: dict[str, int]) -> int:
    """Bytes, padding included where it may be."""
    if isinstance(type_, code.Block):
        return type_.count * _size(type_.element, sizes)
    if isinstance(type_, code.Named):
        return sizes.get(type_.name, 8)
    return type_.size if isinstance(type_, Scalar) else 8
