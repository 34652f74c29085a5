# SPDX-License-Identifier: Apache-2.0
"""The linear Kalman filter, step by step. Covariances (p, q, r) are symmetric. Of a symmetric product only one half is
computed and then mirrored, so that results are exactly symmetric.

Reference: R. Labbe, "Kalman and Bayesian Filters in Python", chapter 6; D. Simon, "Optimal State Estimation", §5.1.
"""

from fcsl_builtins import eye, ldl_solve, matmul, matvec, symmetric_product, transpose


def kf_predict_state(f: "F[n][n]", x: "F[n]") -> "F[n]":
    """x⁻ = F x.

    Source: Labbe, ch. 6; Simon §5.1.
    Order: matvec(f, x).
    Singular: none.
    """
    return matvec(f, x)


def kf_predict_state__4(f: "F[n][n]", x: "F[n]", b: "F[n][m]", u: "F[m]") -> "F[n]":
    """x⁻ = F x + B u.

    Source: Labbe, ch. 6; Simon §5.1.
    Order: matvec(f, x) + matvec(b, u).
    Singular: none.
    """
    return matvec(f, x) + matvec(b, u)


def kf_predict_cov(f: "F[n][n]", p: "F[n][n]", q: "F[n][n]") -> "F[n][n]":
    """P⁻ = F P Fᵀ + Q.

    Source: Simon §5.1.
    Order: symmetric_product of F P and Fᵀ, then + Q.
    Singular: none. The result is invalid if P or Q is not symmetric.
    """
    return symmetric_product(matmul(f, p), transpose(f)) + q


def kf_gain(p: "F[n][n]", h: "F[m][n]", r: "F[m][m]") -> "F[n][m]":
    """K = P Hᵀ S⁻¹ with the innovation covariance S = H P Hᵀ + R.

    Source: Simon §5.1.
    Order: S is symmetric_product of H P and Hᵀ, then + R; the result is the transpose of ldl_solve(S, H P): no inverse is computed,
    and P Hᵀ is taken from H P.
    Singular: all NaN when S is not positive definite (a pivot is not above zero) or contains a NaN. The result is invalid if P or
    R is not symmetric.
    """
    return transpose(ldl_solve(symmetric_product(matmul(h, p), transpose(h)) + r, matmul(h, p)))


def kf_update_state(x: "F[n]", k: "F[n][m]", z: "F[m]", h: "F[m][n]") -> "F[n]":
    """x⁺ = x + K (z − H x).

    Source: Simon §5.1.
    Order: H x, z − (H x), K times the difference, added to x.
    Singular: none.
    """
    return x + matvec(k, z - matvec(h, x))


def kf_update_cov(p: "F[n][n]", k: "F[n][m]", h: "F[m][n]") -> "F[n][n]":
    """P⁺ = (I − K H) P, for the K of kf_gain.

    Source: Simon §5.1.
    Order: symmetric_product of K and H P, subtracted from P.
    Singular: none, but rounding can destroy positive definiteness: prefer the Joseph form for long runs. The result is
    invalid for another K, or if P is not symmetric.
    """
    return p - symmetric_product(k, matmul(h, p))


def kf_update_cov_joseph(p: "F[n][n]", k: "F[n][m]", h: "F[m][n]", r: "F[m][m]") -> "F[n][n]":
    """P⁺ = (I − K H) P (I − K H)ᵀ + K R Kᵀ, for any K.

    Source: Simon §5.1.
    Order: A = I − (K H), then symmetric_product of A P and Aᵀ + symmetric_product of K R and Kᵀ.
    Singular: none; the result is symmetric, and positive definite except for rounding. It is invalid if P or R is not symmetric.
    """
    a = eye(n) - matmul(k, h)
    return symmetric_product(matmul(a, p), transpose(a)) + symmetric_product(matmul(k, r), transpose(k))
