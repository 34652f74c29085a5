# SPDX-License-Identifier: Apache-2.0
"""The linear Kalman filter, step by step.

Reference: R. Labbe, "Kalman and Bayesian Filters in Python", chapter 6; D. Simon, "Optimal State Estimation", §5.1.
"""

from fcsl_builtins import eye, inv, matmul, matvec, transpose


def kf_predict_state(f: "f64[n, n]", x: "f64[n]") -> "f64[n]":
    """x⁻ = F x."""
    return matvec(f, x)


def kf_predict_cov(f: "f64[n, n]", p: "f64[n, n]", q: "f64[n, n]") -> "f64[n, n]":
    """P⁻ = (F P) Fᵀ + Q."""
    return matmul(matmul(f, p), transpose(f)) + q


def kf_gain(p: "f64[n, n]", h: "f64[m, n]", r: "f64[m, m]") -> "f64[n, m]":
    """K = (P Hᵀ) ((H P) Hᵀ + R)⁻¹; all NaN when the innovation covariance is singular."""
    ht = transpose(h)
    return matmul(matmul(p, ht), inv(matmul(matmul(h, p), ht) + r))


def kf_update_state(x: "f64[n]", k: "f64[n, m]", z: "f64[m]", h: "f64[m, n]") -> "f64[n]":
    """x⁺ = x + K (z − H x)."""
    return x + matvec(k, z - matvec(h, x))


def kf_update_cov(p: "f64[n, n]", k: "f64[n, m]", h: "f64[m, n]") -> "f64[n, n]":
    """P⁺ = (I − K H) P; short, but it drifts from symmetry: prefer the Joseph form for long runs."""
    return matmul(eye(n) - matmul(k, h), p)


def kf_update_cov_joseph(p: "f64[n, n]", k: "f64[n, m]", h: "f64[m, n]", r: "f64[m, m]") -> "f64[n, n]":
    """P⁺ = (I − K H) P (I − K H)ᵀ + (K R) Kᵀ: symmetric and positive for any K."""
    a = eye(n) - matmul(k, h)
    return matmul(matmul(a, p), transpose(a)) + matmul(matmul(k, r), transpose(k))
