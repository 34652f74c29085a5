# SPDX-License-Identifier: Apache-2.0
"""Masking MC/DC of a decision: mcdc.py agrees with the definition on small expressions of every shape."""

import itertools
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from fcsl_compiler.coverage.mcdc import (
    MAX_CONDITIONS,
    Tree,
    Vector,
    combinations,
    conditions,
    deciding,
    is_evaluation,
    outcome_with,
    required,
    shown,
)


def numbered(shape: Any, numbers: Any) -> Tree:
    if shape is None:
        return next(numbers)
    return [shape[0], *(numbered(part, numbers) for part in shape[1:])]


SHAPES = st.recursive(
    st.none(),
    lambda inner: st.one_of(
        st.tuples(st.just("not"), inner),
        st.tuples(st.just("and"), inner, inner),
        st.tuples(st.just("or"), inner, inner),
    ),
    max_leaves=6,
)
TREES = SHAPES.map(lambda shape: numbered(shape, itertools.count()))


def truth(tree: Tree, values: tuple[bool, ...]) -> bool:
    """The Boolean function without short circuit."""
    if isinstance(tree, int):
        return values[tree]
    if tree[0] == "not":
        return not truth(tree[1], values)
    left, right = truth(tree[1], values), truth(tree[2], values)
    return left and right if tree[0] == "and" else left or right


def evaluate(tree: Tree, values: tuple[bool, ...]) -> Vector:
    """Python evaluates the decision and records the evaluated conditions."""
    asked: dict[int, bool] = {}

    def ask(number: int) -> bool:
        asked[number] = values[number]
        return values[number]

    def text(part: Tree) -> str:
        if isinstance(part, int):
            return f"ask({part})"
        return f"(not {text(part[1])})" if part[0] == "not" else f"({text(part[1])} {part[0]} {text(part[2])})"

    outcome = eval(text(tree), {"ask": ask})
    return Vector(sum(1 << n for n in asked), sum(1 << n for n, v in asked.items() if v), outcome)


def assignments(tree: Tree) -> list[tuple[bool, ...]]:
    return list(itertools.product((False, True), repeat=len(conditions(tree))))


def decides(tree: Tree, vector: Vector, condition: int) -> bool:
    """The definition: the condition was evaluated, and for some values of the skipped conditions its inversion inverts
    the outcome."""
    if vector.of(condition) is None:
        return False
    for values in assignments(tree):
        if all(vector.of(n) in (None, v) for n, v in enumerate(values)):
            turned = tuple(v != (n == condition) for n, v in enumerate(values))
            if truth(tree, turned) != truth(tree, values):
                return True
    return False


def is_shown(tree: Tree, vectors: list[Vector], condition: int) -> bool:
    """The definition: in some pair the condition differs, decided both times, and the outcomes differ."""
    own = [v for v in vectors if decides(tree, v, condition)]
    return any(
        v.of(condition) != w.of(condition) and v.outcome != w.outcome for v, w in itertools.product(own, repeat=2)
    )


def test_the_definition() -> None:
    """A few cases by hand, to exclude a common error of both implementations."""
    tree: Tree = ["or", ["and", 0, 1], 2]
    true_true, false_false = evaluate(tree, (True, True, False)), evaluate(tree, (False, False, False))
    assert (true_true.evaluated, false_false.evaluated) == (0b011, 0b101)
    assert [is_shown(tree, [true_true, false_false], n) for n in range(3)] == [True, False, False]
    masked = evaluate(tree, (True, False, True))  # the third alone decides: (a and b) is False
    assert deciding(tree, masked) == {2}
    assert is_shown(tree, [masked, false_false], 2)  # although the first differs, too: (a and b) is False both times
    assert not is_shown(tree, [masked, true_true], 2)


@settings(max_examples=150)
@given(TREES, st.data())
def test_what_is_shown_is_what_the_definition_says(tree: Tree, data: st.DataObject) -> None:
    every = [evaluate(tree, values) for values in assignments(tree)]
    assert all(is_evaluation(tree, v) and Vector.unpack(v.pack()) == v for v in every)
    distinct = list(dict.fromkeys(every))
    assert sum(combinations(tree)) == len(distinct)
    for vector in distinct:
        assert deciding(tree, vector) == {n for n in conditions(tree) if decides(tree, vector, n)}
    seen = data.draw(st.lists(st.sampled_from(distinct), unique=True))
    pairs = shown(tree, seen)
    for condition in conditions(tree):
        assert (len(pairs[condition]) == 2) == is_shown(tree, seen, condition)


@settings(max_examples=100)
@given(TREES)
def test_every_condition_can_be_shown_and_the_advice_leads_there(tree: Tree) -> None:
    distinct = list(dict.fromkeys(evaluate(tree, values) for values in assignments(tree)))
    assert all(len(seen) == 2 for seen in shown(tree, distinct).values())
    for condition, value in itertools.product(conditions(tree), (False, True)):
        wanted = required(tree, condition, value)
        for values in assignments(tree):
            follows = values[condition] == value and all(truth(part, values) == v for part, v in wanted)
            if follows:
                vector = evaluate(tree, values)
                assert condition in deciding(tree, vector)
                assert vector.outcome == outcome_with(tree, condition, value)
        assert any(
            values[condition] == value and all(truth(p, values) == v for p, v in wanted) for values in assignments(tree)
        )


@settings(max_examples=50)
@given(TREES, st.integers(0, 2**64 - 1))
def test_a_word_that_is_no_evaluation_is_known(tree: Tree, word: int) -> None:
    possible = {evaluate(tree, values).pack() for values in assignments(tree)}
    vector = Vector.unpack(word)
    assert (vector is not None and vector.pack() == word and is_evaluation(tree, vector)) == (word in possible)


def test_a_word_holds_as_many_conditions_as_it_says() -> None:
    every = (1 << MAX_CONDITIONS) - 1
    full = Vector(every, every, True)
    assert full.pack() < 2**64 and Vector.unpack(full.pack()) == full
    assert Vector.unpack(0) is None and Vector.unpack(Vector(1, 3, True).pack()) is None
