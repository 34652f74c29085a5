# SPDX-License-Identifier: Apache-2.0
"""Vectors and matrices. Sums run from left to right and start from the first product; the loops are the definition.

Size variables (n, m, k) denote constants; every combination in use is compiled separately.
"""

from fcsl_builtins import abs, eye, nan, sqrt, zeros


def dot(a: "F[n]", b: "F[n]") -> "F":
    """Σᵢ aᵢ bᵢ.

    Order: products summed from left to right.
    Singular: none; overflow gives an infinity or NaN.
    """
    total = a[0] * b[0]
    for i in range(1, n):
        total += a[i] * b[i]
    return total


def norm(a: "F[n]") -> "F":
    """√(a·a), the Euclidean length.

    Order: dot(a, a), then sqrt.
    Singular: elements beyond 1e154 overflow to inf, those below 1e-154 lose digits; scale a where it can be so.
    """
    return sqrt(dot(a, a))


def normalize(a: "F[n]") -> "F[n]":
    """a / ‖a‖.

    Order: norm(a), then each element divided by it.
    Singular: NaN when a is zero.
    """
    return a / norm(a)


def cross3(a: "F[3]", b: "F[3]") -> "F[3]":
    """a × b.

    Order: (a₁b₂ − a₂b₁, a₂b₀ − a₀b₂, a₀b₁ − a₁b₀).
    Singular: none.
    """
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def skew(v: "F[3]") -> "F[3][3]":
    """The matrix of a cross product: skew(v) w = v × w.

    Order: exact.
    Singular: none.
    """
    return [[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]]


def outer(a: "F[n]", b: "F[m]") -> "F[n][m]":
    """a bᵀ.

    Order: one product per element.
    Singular: none.
    """
    c = zeros(n, m)
    for i in range(n):
        for j in range(m):
            c[i, j] = a[i] * b[j]
    return c


def trace(a: "F[n][n]") -> "F":
    """Σᵢ aᵢᵢ.

    Order: summed from the first row down.
    Singular: none.
    """
    total = a[0, 0]
    for i in range(1, n):
        total += a[i, i]
    return total


def diag(d: "F[n]") -> "F[n][n]":
    """The matrix with d on its diagonal and zeros elsewhere.

    Order: exact.
    Singular: none.
    """
    a = zeros(n, n)
    for i in range(n):
        a[i, i] = d[i]
    return a


def transpose(a: "F[n][m]") -> "F[m][n]":
    """aᵀ.

    Order: exact.
    Singular: none.
    """
    b = zeros(m, n)
    for i in range(m):
        for j in range(n):
            b[i, j] = a[j, i]
    return b


def matvec(a: "F[n][m]", x: "F[m]") -> "F[n]":
    """a x.

    Order: each element is a dot product, from left to right, without the structural zeros of a constant argument.
    Singular: none.
    """
    y = zeros(n)
    for i in range(n):
        total = a[i, 0] * x[0]
        for j in range(1, m):
            total += a[i, j] * x[j]
        y[i] = total
    return y


def matmul(a: "F[n][k]", b: "F[k][m]") -> "F[n][m]":
    """a b.

    Order: each element is a sum from left to right, without the structural zeros of a constant argument; rows are
    accumulated whole (i, k, j), which changes no element.
    Singular: none.
    """
    c = zeros(n, m)
    row = zeros(m)  # a local, so that C compilers keep it in registers
    for i in range(n):
        for j in range(m):
            row[j] = a[i, 0] * b[0, j]
        for p in range(1, k):
            for j in range(m):
                row[j] = row[j] + a[i, p] * b[p, j]
        for j in range(m):
            c[i, j] = row[j]
    return c


def symmetric_product(a: "F[n][k]", b: "F[k][n]") -> "F[n][n]":
    """a b where that is symmetric, as (F P) Fᵀ is for a symmetric P: its upper triangle, mirrored. The result is symmetric in
    every bit, and costs little more than half of matmul's.

    Order: on the diagonal and above it each element is that of matmul; each below is the one across the diagonal.
    Singular: none; elements of a b below the diagonal are ignored, even if they differ.
    """
    c = zeros(n, n)
    for i in range(n):
        for j in range(i, n):
            c[i, j] = a[i, 0] * b[0, j]
        for p in range(1, k):
            for j in range(i, n):
                c[i, j] = c[i, j] + a[i, p] * b[p, j]
        for j in range(i + 1, n):
            c[j, i] = c[i, j]
    return c


def inv(a: "F[n][n]") -> "F[n][n]":
    """a⁻¹ by Gauss-Jordan elimination with partial pivoting. To solve a system, `solve` is cheaper and more accurate.

    Source: N. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., §14.4.
    Order: for each column: the row of the largest pivot comes up, is divided by it, and is subtracted from all others.
    Singular: all NaN when a pivot is exactly zero.
    """
    left = a
    right = eye(n)
    for c in range(n):
        for r in range(c + 1, n):
            # An exchange at every larger element moves the largest up with constant row numbers, which cannot fault.
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


def det(a: "F[n][n]") -> "F":
    """|a|, the determinant, by Gaussian elimination with partial pivoting.

    Source: N. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., §9 and §14.6.
    Order: elimination as in lu_solve; the product of the pivots from the first down, negated at each exchange of rows.
    Singular: 0 when a pivot is exactly zero, which is then the determinant. Of a matrix that is singular but for
    roundings it is small, not 0: compare with a tolerance.
    """
    left = a
    product = 1.0
    for c in range(n):
        for r in range(c + 1, n):
            if abs(left[r, c]) > abs(left[c, c]):
                product = -product
                for j in range(c, n):
                    swap = left[c, j]
                    left[c, j] = left[r, j]
                    left[r, j] = swap
        if left[c, c] == 0.0:
            return 0.0
        product *= left[c, c]
        for i in range(c + 1, n):
            factor = left[i, c] / left[c, c]
            for j in range(c + 1, n):
                left[i, j] = left[i, j] - factor * left[c, j]
    return product


def lu_solve(a: "F[n][n]", b: "F[n][m]") -> "F[n][m]":
    """x with a x = b for every column of b, by Gaussian elimination with partial pivoting.

    Source: G. Golub, C. Van Loan, "Matrix Computations", 4th ed., §3.4.
    Order: for each column of a: the row of the largest pivot comes up, and factor (element / pivot) times that row is
    subtracted from those below; then from the last row up: right-hand side less the products from left to right,
    divided by the pivot. Columns of b do not influence each other.
    Singular: all NaN when a pivot is exactly zero.
    """
    left = a
    x = b
    for c in range(n):
        for r in range(c + 1, n):
            # An exchange at every larger element moves the largest up with constant row numbers, which cannot fault.
            if abs(left[r, c]) > abs(left[c, c]):
                for j in range(c, n):
                    swap = left[c, j]
                    left[c, j] = left[r, j]
                    left[r, j] = swap
                for j in range(m):
                    swap = x[c, j]
                    x[c, j] = x[r, j]
                    x[r, j] = swap
        if left[c, c] == 0.0:
            for i in range(n):
                for j in range(m):
                    x[i, j] = nan
            return x
        for i in range(c + 1, n):
            factor = left[i, c] / left[c, c]
            for j in range(c + 1, n):
                left[i, j] = left[i, j] - factor * left[c, j]
            for j in range(m):
                x[i, j] = x[i, j] - factor * x[c, j]
    for i in range(n - 1, -1, -1):
        for p in range(i + 1, n):
            for j in range(m):
                x[i, j] = x[i, j] - left[i, p] * x[p, j]
        for j in range(m):
            x[i, j] = x[i, j] / left[i, i]
    return x


def ldl_solve(a: "F[n][n]", b: "F[n][m]") -> "F[n][m]":
    """x with a x = b for every column of b, for a symmetric and positive definite a, by elimination of one half of it without
    pivoting, which such a matrix does not need (a = L D Lᵀ). Only its upper triangle is read.

    Source: N. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., §10.1; G. Golub, C. Van Loan, "Matrix
    Computations", 4th ed., §4.1.
    Order: for each column of a: factor (element / pivot, of the element right of the pivot) times the pivot's row is subtracted
    from those below. From each row of b the products of the factors with the rows above are subtracted from left to right;
    then from the last row up: that row divided by the pivot, less the products with the factors from left to right.
    Singular: all NaN when a is not positive definite (a pivot is not above zero) or contains a NaN.
    """
    left = a
    for c in range(n):
        if not (left[c, c] > 0.0):
            left[c, c] = nan
        for i in range(c + 1, n):
            factor = left[c, i] / left[c, c]
            left[i, c] = factor
            for j in range(i, n):
                left[i, j] = left[i, j] - factor * left[c, j]
    if n > 8:  # by rows, whose operations are vectors
        x = b
        for i in range(1, n):
            for p in range(i):
                for j in range(m):
                    x[i, j] = x[i, j] - left[i, p] * x[p, j]
        for i in range(n - 1, -1, -1):
            for j in range(m):
                x[i, j] = x[i, j] / left[i, i]
            for p in range(i + 1, n):
                for j in range(m):
                    x[i, j] = x[i, j] - left[p, i] * x[p, j]
    else:  # by columns, each in a local, so that C compilers keep it in registers
        column = zeros(n)
        x = zeros(n, m)
        for j in range(m):
            for i in range(n):
                column[i] = b[i, j]
                for p in range(i):
                    column[i] = column[i] - left[i, p] * column[p]
            for i in range(n - 1, -1, -1):
                column[i] = column[i] / left[i, i]
                for p in range(i + 1, n):
                    column[i] = column[i] - left[p, i] * column[p]
            for i in range(n):
                x[i, j] = column[i]
    return x


def solve(a: "F[n][n]", b: "F[n]") -> "F[n]":
    """x with a x = b.

    Order: lu_solve with b as its only column.
    Singular: all NaN when a pivot is exactly zero.
    """
    columns = zeros(n, 1)
    columns[:, 0] = b
    columns = lu_solve(a, columns)
    return columns[:, 0]


def cholesky(a: "F[n][n]") -> "F[n][n]":
    """The lower triangular L with L Lᵀ = a, for a symmetric and positive definite a. Only its lower triangle is read.

    Source: N. Higham, "Accuracy and Stability of Numerical Algorithms", 2nd ed., algorithm 10.2.
    Order: column by column; from an element of a the products of L are subtracted from left to right, then comes the
    square root (diagonal) or the division by it (below).
    Singular: all NaN when a is not positive definite (a root of what is not above zero) or contains a NaN.
    """
    low = zeros(n, n)
    for j in range(n):
        for i in range(j, n):
            total = a[i, j]
            for p in range(j):
                total -= low[i, p] * low[j, p]
            low[i, j] = total
        if not (low[j, j] > 0.0):
            for i in range(n):
                for p in range(n):
                    low[i, p] = nan
            return low
        low[j, j] = sqrt(low[j, j])
        for i in range(j + 1, n):
            low[i, j] = low[i, j] / low[j, j]
    return low
