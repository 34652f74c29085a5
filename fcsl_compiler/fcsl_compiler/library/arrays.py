# SPDX-License-Identifier: Apache-2.0
"""Reductions of vectors, and their order. F is f64 or f32, T any number. Folds run from left to right."""

from fcsl_builtins import isnan, max, min


def sum(x: "F[n]") -> "F":
    """Σᵢ xᵢ.

    Order: from left to right.
    Singular: none.
    """
    total = x[0]
    for i in range(1, n):
        total += x[i]
    return total


def mean(x: "F[n]") -> "F":
    """Σᵢ xᵢ / n.

    Order: sum(x), then / n.
    Singular: none.
    """
    return sum(x) / n


def min__1(x: "T[n]") -> "T":
    """The least element.

    Order: min(a, b) from left to right.
    Singular: a NaN is passed over, unless it is the first element.
    """
    least = x[0]
    for i in range(1, n):
        least = min(least, x[i])
    return least


def max__1(x: "T[n]") -> "T":
    """The greatest element.

    Order: max(a, b) from left to right.
    Singular: a NaN is passed over, unless it is the first element.
    """
    greatest = x[0]
    for i in range(1, n):
        greatest = max(greatest, x[i])
    return greatest


def argmin(x: "T[n]") -> "i64":
    """The index of the least element, of equal ones the first.

    Order: exact.
    Singular: a NaN is passed over, unless it is the first element.
    """
    least = x[0]
    at = 0
    for i in range(1, n):
        if x[i] < least:
            least = x[i]
            at = i
    return at


def argmax(x: "T[n]") -> "i64":
    """The index of the greatest element, of equal ones the first.

    Order: exact.
    Singular: a NaN is passed over, unless it is the first element.
    """
    greatest = x[0]
    at = 0
    for i in range(1, n):
        if x[i] > greatest:
            greatest = x[i]
            at = i
    return at


def any(x: "bool[n]") -> "bool":
    """Whether an element is True.

    Order: exact.
    Singular: none.
    """
    found = x[0]
    for i in range(1, n):
        found = found or x[i]
    return found


def all(x: "bool[n]") -> "bool":
    """Whether every element is True.

    Order: exact.
    Singular: none.
    """
    found = x[0]
    for i in range(1, n):
        found = found and x[i]
    return found


def sort(x: "F[n]") -> "F[n]":
    """The elements in ascending order.

    Source: D. Knuth, "The Art of Computer Programming", vol. 3, §5.2.1 (straight insertion).
    Order: exact; equal elements keep their order. n (n − 1) / 2 comparisons in every case.
    Singular: NaN come last.
    """
    y = x
    for i in range(1, n):
        for j in range(i, 0, -1):
            if y[j] < y[j - 1] or (isnan(y[j - 1]) and not isnan(y[j])):
                held = y[j]
                y[j] = y[j - 1]
                y[j - 1] = held
    return y


def median(x: "F[n]") -> "F":
    """The middle element of sort(x), or the mean of the two.

    Order: sort(x); of two, half of each, then their sum.
    Singular: NaN count as greatest.
    """
    y = sort(x)
    if n % 2 == 1:
        return y[n // 2]
    return 0.5 * y[n // 2 - 1] + 0.5 * y[n // 2]
