# SPDX-License-Identifier: Apache-2.0
"""Vectors and matrices. Sums run from left to right and start from the first product; the loops are the definition.

Size variables (n, m, k) stand for constants; every combination in use is compiled for itself.
"""

from fcsl_builtins import abs, nan, sqrt, zeros


def dot(a: "f64[n]", b: "f64[n]") -> "f64":
    """Σᵢ aᵢ bᵢ."""
    total = a[0] * b[0]
    for i in range(1, n):
        total += a[i] * b[i]
    return total


def norm(a: "f64[n]") -> "f64":
    """√(a·a); overflows where a·a does."""
    return sqrt(dot(a, a))


def normalize(a: "f64[n]") -> "f64[n]":
    """a / ‖a‖; NaN when a is zero."""
    return a / norm(a)


def cross3(a: "f64[3]", b: "f64[3]") -> "f64[3]":
    """a × b."""
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def outer(a: "f64[n]", b: "f64[m]") -> "f64[n, m]":
    """a bᵀ."""
    c = zeros(n, m)
    for i in range(n):
        for j in range(m):
            c[i, j] = a[i] * b[j]
    return c


def trace(a: "f64[n, n]") -> "f64":
    """Σᵢ aᵢᵢ."""
    total = a[0, 0]
    for i in range(1, n):
        total += a[i, i]
    return total


def diag(d: "f64[n]") -> "f64[n, n]":
    """The matrix with d on its diagonal and zeros elsewhere."""
    a = zeros(n, n)
    for i in range(n):
        a[i, i] = d[i]
    return a


def transpose(a: "f64[n, m]") -> "f64[m, n]":
    """aᵀ."""
    b = zeros(m, n)
    for i in range(n):
        for j in range(m):
            b[j, i] = a[i, j]
    return b


def matvec(a: "f64[n, m]", x: "f64[m]") -> "f64[n]":
    """a x."""
    y = zeros(n)
    for i in range(n):
        total = a[i, 0] * x[0]
        for j in range(1, m):
            total += a[i, j] * x[j]
        y[i] = total
    return y


def matmul(a: "f64[n, k]", b: "f64[k, m]") -> "f64[n, m]":
    """a b. Each element is a sum from left to right; rows are accumulated whole (i, k, j), which changes no element."""
    c = zeros(n, m)
    for i in range(n):
        for j in range(m):
            c[i, j] = a[i, 0] * b[0, j]
        for p in range(1, k):
            for j in range(m):
                c[i, j] = c[i, j] + a[i, p] * b[p, j]
    return c


def inv(a: "f64[n, n]") -> "f64[n, n]":
    """a⁻¹ by Gauss-Jordan elimination with partial pivoting; all NaN when a pivot is exactly zero."""
    left = a
    right = eye(n)
    for c in range(n):
        for r in range(c + 1, n):
            # Exchanging at every larger element brings the largest up with constant row numbers: nothing can fault.
            if abs(left[r, c]) > abs(left[c, c]):
                for j in range(n):
                    swap = left[c, j]
                    left[c, j] = left[r, j]
                    left[r, j] = swap
                    swap = right[c, j]
                    right[c, j] = right[r, j]
                    right[r, j] = swap
        if left[c, c] == 0.0:
            for i in range(n):
                for j in range(n):
                    right[i, j] = nan
            return right
        scale = left[c, c]
        for j in range(n):
            left[c, j] = left[c, j] / scale
            right[c, j] = right[c, j] / scale
        for i in range(n):
            if i != c:
                factor = left[i, c]
                for j in range(n):
                    left[i, j] = left[i, j] - factor * left[c, j]
                    right[i, j] = right[i, j] - factor * right[c, j]
    return right
