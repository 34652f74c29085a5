# SPDX-License-Identifier: Apache-2.0
"""Operations of known scalars, computed by the reference."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from typing import Any

from ..model.ops import Op
from ..model.types import F32, Scalar
from ..reference.functions import builtins
from ..reference.values import F32 as Single
from ..reference.values import INTEGERS, Fault, divide, floor_divide, modulo, power

_SYMBOLS: dict[str, Callable[..., Any]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": divide,
    "//": floor_divide,
    "%": modulo,
    "neg": operator.neg,
    "not": operator.not_,
    "~": operator.invert,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
    "<<": operator.lshift,
    ">>": operator.rshift,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


class Faulted(Exception):
    """The operation faults for these operands."""


def evaluate(op: Op, args: Sequence[Any]) -> Any:
    """The value of an operation as a Python scalar. Raises Faulted."""
    if op.name == "assert":
        if not args[0]:
            raise Faulted
        return True
    typed = [_typed(value, type_) for value, type_ in zip(args, op.args, strict=True)]
    try:
        if op.name.startswith("**"):
            found = power(typed[0], int(op.name[2:]))
        else:
            found = (_SYMBOLS.get(op.name) or builtins()[op.name])(*typed)
    except Fault:
        raise Faulted from None
    return _plain(found, op.result)


def _typed(value: Any, type_: Scalar) -> Any:
    if type_.is_integer:
        return INTEGERS[type_.name](value)
    return Single(value) if type_ is F32 else value


def _plain(value: Any, type_: Scalar) -> Any:
    return float(value) if type_.is_float else int(value) if type_.is_integer else value
