# SPDX-License-Identifier: Apache-2.0
"""Metrics are expressions of whole columns: at each tick they have the value that a twin's condition has there."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fcsl_compiler.api.expressions import SCALARS, ExpressionError, Kind, Node, Quantity, evaluator, parse
from fcsl_sim.campaign.column_arithmetic import column_arithmetic, widest

FIELDS = {
    "a.x": (Quantity(Kind.FLOAT), np.array([0.0, 1.5, -2.0, math.nan, math.inf, 1e300])),
    "a.f": (Quantity(Kind.FLOAT), np.array([0.1, 2.0, -3.0, 0.0, 7.0, 1e-3], np.float32)),
    "a.v": (Quantity(Kind.FLOAT, (3,)), np.arange(18.0).reshape(6, 3) - 7.0),
    "a.n": (Quantity(Kind.INTEGER), np.array([0, 1, -7, 3, 100, -1], np.int32)),
    "a.u": (Quantity(Kind.INTEGER), np.array([0, 1, 7, 3, 4_000_000_000, 2], np.uint32)),
    "a.on": (Quantity(Kind.BOOL), np.array([True, False, True, True, False, False])),
    "a.state": (Quantity(Kind.NAME, names=("RUN", "SAFE")), np.array(["RUN", "SAFE", "RUN", "RUN", "SAFE", "SAFE"])),
}
TICKS = 6
expressions = st.recursive(
    st.sampled_from([*FIELDS, "2", "0.5", "0", "true", "'SAFE'"]),
    lambda inner: st.one_of(
        st.builds("({} {} {})".format, inner, st.sampled_from(["+", "-", "*", "/", "//", "%", "**"]), inner),
        st.builds("({} {} {})".format, inner, st.sampled_from(["<", "==", "and", "or", ">="]), inner),
        st.builds(
            "{}({})".format,
            st.sampled_from(["abs", "sqrt", "degrees", "norm", "isnan", "isfinite", "-", "not "]),
            inner,
        ),
        st.builds("{}({}, {})".format, st.sampled_from(["min", "max"]), inner, inner),
        st.builds("({} {} ({}, {}))".format, inner, st.sampled_from(["in", "not in"]), inner, inner),
        st.builds("({0} < {1} <= {0})".format, inner, inner),
    ),
    max_leaves=5,
)


def find(path: str) -> Quantity:
    if path not in FIELDS:
        raise ExpressionError(path)
    return FIELDS[path][0]


def at(tick: int) -> Any:
    return lambda leaf: FIELDS[leaf.value][1][tick].tolist()


@settings(max_examples=400)
@given(text=expressions)
@example(text="norm(a.v * a.x + 1)")
@example(text="a.on + a.on - (a.state == 'SAFE')")
@example(text="a.f * a.f")
@example(text="a.u * a.u")
@example(text="min(a.x, a.n, a.f)")
def test_a_column_has_the_values_of_its_ticks(text: str) -> None:
    try:
        root = parse(f"last({text})", find, series=True)
    except ExpressionError:
        return
    (column,) = root.parts
    try:
        with np.errstate(all="ignore"):
            values = evaluator(column, column_arithmetic(100.0))(lambda leaf: widest(FIELDS[leaf.value][1]))
    except ExpressionError:  # an integer does not fit, at one of the ticks
        assert any(has_no_value(column, tick) for tick in range(TICKS))
        return
    for tick in range(TICKS):
        try:
            expected = evaluator(column, SCALARS)(at(tick))
        except ExpressionError:
            continue  # columns have an infinity or NaN there
        got = np.broadcast_to(values, (TICKS,))[tick].item()
        assert same(got, expected), (text, tick, got, expected)


def has_no_value(column: Node, tick: int) -> bool:
    try:
        evaluator(column, SCALARS)(at(tick))
    except ExpressionError:
        return True
    return False


def same(got: Any, expected: Any) -> bool:
    if isinstance(expected, float) and isinstance(got, float):
        return (
            got == expected or (math.isnan(got) and math.isnan(expected)) or math.isclose(got, expected, rel_tol=1e-14)
        )
    return bool(got == expected)


def test_what_is_of_all_ticks() -> None:
    """NumPy's own figures."""

    def value(text: str) -> Any:
        root = parse(text, find, series=True)
        return evaluator(root, column_arithmetic(100.0))(source)

    def source(leaf: Node) -> Any:
        column = widest(FIELDS[leaf.value][1])
        return column if leaf.operator == "column" else column[-1]

    n = FIELDS["a.n"][1].astype(np.float64)
    assert (value("mean(a.n)"), value("std(a.n)")) == (n.mean(), n.std())
    assert (value("min(a.n)"), value("max(a.n)"), value("first(a.u)"), value("last(a.u)")) == (-7, 100, 0, 2)
    assert value("rms(a.n - 1)") == np.sqrt(((n - 1) ** 2).mean())
    assert value("max(norm(a.v))") == np.linalg.norm(FIELDS["a.v"][1], axis=1).max()
    assert (value("time(a.state == 'SAFE')"), value("duration(a.on)")) == (0.01, 0.03)
    assert math.isnan(value("time(a.n > 1000)"))
    assert (value("any(a.n > 99)"), value("all(a.n > 99)"), value("mean(a.on)")) == (True, False, 0.5)
    assert value("max(a.n) - a.n") == 101


def test_integers_that_do_not_fit_have_no_value() -> None:
    """A column must not wrap where a condition has no value."""
    large = {"a.n": np.array([1, 2**62]), "a.u": np.array([1, 2**63 + 5], np.uint64)}
    for text in ("a.n * 4", "a.n + a.n", "-a.n - a.n - a.n", "a.u > 9"):
        root = parse(f"last({text})", find, series=True)
        with pytest.raises(ExpressionError, match="does not fit 64 bits"):
            evaluator(root, column_arithmetic(100.0))(lambda leaf: widest(large[leaf.value]))
