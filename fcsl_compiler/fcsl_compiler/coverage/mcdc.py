# SPDX-License-Identifier: Apache-2.0
"""Masking MC/DC of one decision with short-circuit operators, from the combinations of its conditions that occurred.

RTCA DO-178C requires for every condition of a decision a demonstration that it independently affects the outcome.
CAST-10 and DOT/FAA/AR-01/18 accept masking for this purpose. A condition *decides* an evaluation if it was evaluated
and the outcome follows it on the whole path to the root: for every operator on the path, the other operand does not fix
the result. An operand skipped by short circuit fixes nothing, because the left operand alone determined the result. A
condition is shown by two evaluations in which it was True and False and decided both times. The outcomes then differ
because of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

#: A condition's number; ["not", a]; ["and", a, b]; ["or", a, b]. Conditions are numbered from left to right.
Tree = int | list[Any]

#: Maximum number of conditions: a word also holds a used mark and the outcome.
MAX_CONDITIONS = 31
#: Maximum number of combinations stored per decision.
MAX_VECTORS = 256

_USED, _OUTCOME, _EVALUATED, _VALUE = 0, 1, 2, 2 + MAX_CONDITIONS
_MASK = (1 << MAX_CONDITIONS) - 1


@dataclass(frozen=True)
class Vector:
    """One evaluation. Bit i of `evaluated` and of `value` belongs to condition i."""

    evaluated: int
    value: int
    outcome: bool

    @classmethod
    def unpack(cls, word: int) -> Vector | None:
        """Decodes a word that fcsl_cover_decided stored. None if the word is invalid."""
        evaluated, value = word >> _EVALUATED & _MASK, word >> _VALUE & _MASK
        if not word >> _USED & 1 or value & ~evaluated:
            return None
        return cls(evaluated, value, bool(word >> _OUTCOME & 1))

    def pack(self) -> int:
        return 1 << _USED | self.outcome << _OUTCOME | self.evaluated << _EVALUATED | self.value << _VALUE

    def of(self, condition: int) -> bool | None:
        """Value of a condition. None if it was not evaluated."""
        return bool(self.value >> condition & 1) if self.evaluated >> condition & 1 else None


def conditions(tree: Tree) -> list[int]:
    """All conditions of the tree, from left to right."""
    return [tree] if isinstance(tree, int) else [c for part in tree[1:] for c in conditions(part)]


def combinations(tree: Tree) -> tuple[int, int]:
    """Numbers of combinations of evaluated conditions with the outcomes False and True."""
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
    """Value of this part of the decision. None if it was not evaluated, or the vector does not belong to this
    decision."""
    if isinstance(tree, int):
        return vector.of(tree)
    left = result(tree[1], vector)
    if tree[0] == "not" or left is None:
        return None if left is None else not left
    return left if left == (tree[0] == "or") else result(tree[2], vector)


def is_evaluation(tree: Tree, vector: Vector) -> bool:
    """Whether Python can evaluate the decision this way: exactly the needed conditions, and the matching outcome."""
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
    fixing = tree[0] == "or"  # operand value that fixes the result
    left, right = result(tree[1], vector), result(tree[2], vector)
    if left == fixing:
        return deciding(tree[1], vector)
    return deciding(tree[2], vector) | (deciding(tree[1], vector) if right is not fixing else set())


def shown(tree: Tree, vectors: Iterable[Vector]) -> dict[int, dict[bool, Vector]]:
    """For every condition, the values with which it decided, each with the first such evaluation. With both values,
    MC/DC is met for it."""
    found: dict[int, dict[bool, Vector]] = {c: {} for c in conditions(tree)}
    for vector in vectors:
        for condition in deciding(tree, vector):
            found[condition].setdefault(bool(vector.of(condition)), vector)
    return found


def required(tree: Tree, condition: int, value: bool) -> list[tuple[Tree, bool]]:
    """The other operands that are evaluated when the condition decides with this value, with their values."""
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
    """Outcome of the decision when the condition decides with this value."""
    if isinstance(tree, int):
        return value
    if tree[0] == "not":
        return not outcome_with(tree[1], condition, value)
    return outcome_with(tree[1] if condition in conditions(tree[1]) else tree[2], condition, value)
