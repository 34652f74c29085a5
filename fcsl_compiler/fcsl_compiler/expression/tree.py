# SPDX-License-Identifier: Apache-2.0
"""Checked expressions: every part knows the kind, shape and unit of its value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .units import Unit


class Kind(Enum):
    """A name is one of a list: of a state, a health, a request."""

    BOOL = "a bool"
    INTEGER = "an integer"
    FLOAT = "a number"
    NAME = "a name"


@dataclass(frozen=True)
class Quantity:
    """What a value is. `shape` is () for a scalar, (n,) for a vector; `unit` None: any; `names` are those that a name may be."""

    kind: Kind
    shape: tuple[int, ...] = ()
    unit: Unit | None = None
    names: tuple[str, ...] = ()


@dataclass(frozen=True)
class Node:
    """A part of an expression. `operator` is as it is written, or the name of a function, or one of

    literal     `value` is the number, bool or text
    field       `value` is the path; its value now, or at the end of a flight
    column      `value` is the path; its values at all ticks
    metric      `value` is the name of another expression
    compare     `value` has the operators of a chain of comparisons
    """

    operator: str
    text: str
    quantity: Quantity
    parts: tuple[Node, ...] = ()
    value: Any = None

    def walk(self) -> Iterator[Node]:
        yield self
        for part in self.parts:
            yield from part.walk()


class ExpressionError(ValueError):
    """What is wrong with an expression, or with a value that it read."""
