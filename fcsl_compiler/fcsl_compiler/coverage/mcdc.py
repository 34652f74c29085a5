# SPDX-License-Identifier: Apache-2.0
"""Masking MC/DC of one decision with short-circuit operators, from the combinations of its conditions that were seen.

RTCA DO-178C asks of every condition in a decision that it be shown to affect the outcome independently; CAST-10 and
DOT/FAA/AR-01/18 admit masking as the way to show it. In an evaluation a condition *decides* when it was evaluated and the
outcome follows it on the whole way to the root: of every operator above it, the other operand does not fix the result.
An operand that short circuit left out fixes nothing, for the left one alone has. A condition is shown by a pair of
evaluations in which it was True and False and decided both times; the outcomes then differ because of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

#: A condition's number; ["not", a]; ["and", a, b]; ["or", a, b]. Conditions are numbered from left to right.
Tree = int | list[Any]

#: What fits a word beside the mark that it is used and the outcome.
MAX_CONDITIONS = 31
#: Combinations that are kept of one decision.
MAX_VECTORS = 256

_USED, _OUTCOME, _EVALUATED, _VALUE = 0, 1, 2, 2 + MAX_CONDITIONS
_MASK = (1 << MAX_CONDITIONS) - 1


@dataclass(frozen=True)
class Vector:
    """One evaluation: bit i of `evaluated` and of `value` is condition i's."""

    evaluated: int
    value: int
    outcome: bool

    @classmethod
    def unpack(cls, word: int) -> Vector | None:
        """A word as fcsl_cover_decided stores it; None for one that cannot be."""
        evaluated, value = word >> _EVALUATED & _MASK, word >> _VALUE & _MASK
        if not word >> _USED & 1 or value & ~evaluated:
            return None
        return cls(evaluated, value, bool(word >> _OUTCOME & 1))

    def pack(self) -> int:
        return 1 << _USED | self.outcome << _OUTCOME | self.evaluated << _EVALUATED | self.value << _VALUE

    def of(self, condition: int) -> bool | None:
        """The condition's value; None: it was not evaluated."""
        return bool(self.value >> condition & 1) if self.evaluated >> condition & 1 else None


def conditions(tree: Tree) -> list[int]:
    """The conditions below, from left to right."""
    return [tree] if isinstance(tree, int) else [c for part in tree[1:] for c in conditions(part)]


def combinations(tree: Tree) -> tuple[int, int]:
    """How many combinations of evaluated conditions lead to False, and how many to True."""
    if isinstance(tree, int):
        return (1, 1)
    no, yes = combinations(tree[1])
    if tree[0] == "not":
        return (yes, no)
    right_no, right_yes = combinations(tree[2])
    if tree[0] == "and":
        return (no + yes * right_no, yes * right_yes)
    return (no * right_no, yes + no * right_yes)


def result(tree: Tree, vector: Vector) -> bool | None:
    """What this part of the decision was; None: it was not evaluated, or the vector is none of this decision."""
    if isinstance(tree, int):
        return vector.of(tree)
    left = result(tree[1], vector)
    if tree[0] == "not" or left is None:
        return None if left is None else not left
    return left if left == (tree[0] == "or") else result(tree[2], vector)


def is_evaluation(tree: Tree, vector: Vector) -> bool:
    """Whether Python could have evaluated the decision so: every condition that it needs, no other, and that outcome."""
    return result(tree, vector) is vector.outcome and vector.evaluated == _evaluated(tree, vector)


def _evaluated(tree: Tree, vector: Vector) -> int:
    if isinstance(tree, int):
        return 1 << tree
    left = _evaluated(tree[1], vector)
    if tree[0] == "not" or result(tree[1], vector) == (tree[0] == "or"):
        return left
    return left | _evaluated(tree[2], vector)


def deciding(tree: Tree, vector: Vector) -> set[int]:
    """The conditions that decided this evaluation."""
    if isinstance(tree, int):
        return set() if vector.of(tree) is None else {tree}
    if tree[0] == "not":
        return deciding(tree[1], vector)
    fixing = tree[0] == "or"  # the value of an operand that fixes the result
    left, right = result(tree[1], vector), result(tree[2], vector)
    if left == fixing:
        return deciding(tree[1], vector)
    return deciding(tree[2], vector) | (deciding(tree[1], vector) if right is not fixing else set())


def shown(tree: Tree, vectors: Iterable[Vector]) -> dict[int, dict[bool, Vector]]:
    """For every condition the values with which it decided, each with the first such evaluation; both: MC/DC is met."""
    found: dict[int, dict[bool, Vector]] = {c: {} for c in conditions(tree)}
    for vector in vectors:
        for condition in deciding(tree, vector):
            found[condition].setdefault(bool(vector.of(condition)), vector)
    return found


def required(tree: Tree, condition: int, value: bool) -> list[tuple[Tree, bool]]:
    """The other operands that are evaluated when the condition decides with this value, and the value each then has."""
    if isinstance(tree, int):
        return []
    if tree[0] == "not":
        return required(tree[1], condition, value)
    neutral = tree[0] == "and"
    if condition not in conditions(tree[1]):
        return [(tree[1], neutral), *required(tree[2], condition, value)]
    inner = required(tree[1], condition, value)
    return [*inner, (tree[2], neutral)] if outcome_with(tree[1], condition, value) is neutral else inner


def outcome_with(tree: Tree, condition: int, value: bool) -> bool:
    """The decision's outcome when the condition decides with this value."""
    if isinstance(tree, int):
        return value
    if tree[0] == "not":
        return not outcome_with(tree[1], condition, value)
    return outcome_with(tree[1] if condition in conditions(tree[1]) else tree[2], condition, value)
