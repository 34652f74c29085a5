# SPDX-License-Identifier: Apache-2.0
"""Functions that rewritten code calls. Their names contain a dot, which names of a program cannot."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

from ..model.ops import assertion
from .arrays import array_of, constant_index, copy_of, each, eye, zeros
from .functions import builtins
from .structs import StructType
from .types import SCALARS
from .values import Fault, Zero, divide, floor_divide, modulo, power


def _power(base: Any, exponent: int) -> Any:
    """base ** a literal integer: repeated multiplication up to 4, else pow."""
    return power(base, exponent) if 0 <= exponent <= 4 else builtins()["pow"](base, exponent)


def require(condition: bool, text: str) -> None:
    """`assert condition, text`."""
    if not condition:
        raise Fault(assertion(text).faults[0])


def runtime(structs: Mapping[str, StructType]) -> dict[str, Any]:
    """Builtins, constructors of structs, and the functions that the rewrite inserts (rewrite.py)."""
    names: dict[str, Any] = {"divide": divide, "zero": Zero, "floor_divide": floor_divide, "modulo": modulo}
    names |= {
        "require": require,
        "power": _power,
        "pow": builtins()["pow"],
        "copy": copy_of,
        "constant_index": constant_index,
    }
    names |= {f"as_{name}": type_.store for name, type_ in SCALARS.items()}
    names |= {f"zeros_{name}": partial(zeros, type_) for name, type_ in SCALARS.items()}
    names |= {f"eye_{name}": partial(eye, type_) for name, type_ in SCALARS.items()}
    names |= {f"each_{name}": partial(each, type_) for name, type_ in SCALARS.items()}
    names |= {f"array_{name}": array_of(type_) for name, type_ in (SCALARS | dict(structs)).items()}
    hidden = {f"fcsl.{name}": value for name, value in names.items()}
    return hidden | builtins() | {name: struct.construct for name, struct in structs.items()}
