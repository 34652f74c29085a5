# SPDX-License-Identifier: Apache-2.0
"""The linear Kalman filter, step by step.

Reference: R. Labbe, "Kalman and Bayesian Filters in Python", chapter 6; D. Simon, "Optimal State Estimation", §5.1.
"""

from fcsl_builtins import eye, inv, matmul, matvec, transpose


def kf_predict_state(f: "f64[n, n]", x: "f64[n]") -> "f64[n]":
    """x⁻ = F x.

    Source: Labbe, ch. 6; Simon §5.1.
    Order: matvec(f, x).
    Singular: none.
    """
    return matvec(f, x)


def kf_predict_state__4(f: "f64[n, n]", x: "f64[n]", b: "f64[n, m]", u: "f64[m]") -> "f64[n]":
    """x⁻ = F x + B u.

    Source: Labbe, ch. 6; Simon §5.1.
    Order: matvec(f, x) + matvec(b, u).
    Singular: none.
    """
    return matvec(f, x) + matvec(b, u)


def kf_predict_cov(f: "f64[n, n]", p: "f64[n, n]", q: "f64[n, n]") -> "f64[n, n]":
    """P⁻ = F P Fᵀ + Q.

    Source: Simon §5.1.
    Order: (F P) Fᵀ, then + Q.
    Singular: none; the result is symmetric but for roundings.
    """
    return matmul(matmul(f, p), transpose(f)) + q


def kf_gain(p: "f64[n, n]", h: "f64[m, n]", r: "f64[m, m]") -> "f64[n, m]":
    """K = P Hᵀ S⁻¹ with the innovation covariance S = H P Hᵀ + R.

    Source: Simon §5.1.
    Order: (P Hᵀ) inv((H P) Hᵀ + R).
    Singular: all NaN when a pivot of S is exactly zero.
    """
    return matmul(matmul(p, transpose(h)), inv(matmul(matmul(h, p), transpose(h)) + r))


def kf_update_state(x: "f64[n]", k: "f64[n, m]", z: "f64[m]", h: "f64[m, n]") -> "f64[n]":
    """x⁺ = x + K (z − H x).

    Source: Simon §5.1.
    Order: H x, z less that, K times that, added to x.
    Singular: none.
    """
    return x + matvec(k, z - matvec(h, x))


def kf_update_cov(p: "f64[n, n]", k: "f64[n, m]", h: "f64[m, n]") -> "f64[n, n]":
    """P⁺ = (I − K H) P, for the K of kf_gain.

    Source: Simon §5.1.
    Order: P − K (H P): H P, then K times that, then P less that.
    Singular: none, but it drifts from symmetry and loses positive definiteness to roundings: prefer the Joseph form for
    long runs.
    """
    return p - matmul(k, matmul(h, p))


def kf_update_cov_joseph(p: "f64[n, n]", k: "f64[n, m]", h: "f64[m, n]", r: "f64[m, m]") -> "f64[n, n]":
    """P⁺ = (I − K H) P (I − K H)ᵀ + K R Kᵀ, for any K.

    Source: Simon §5.1.
    Order: A = I − (K H), then (A P) Aᵀ + (K R) Kᵀ.
    Singular: none; the result is positive and symmetric but for roundings.
    """
    a = eye(n) - matmul(k, h)
    return matmul(matmul(a, p), transpose(a)) + matmul(matmul(k, r), transpose(k))
