# SPDX-License-Identifier: Apache-2.0
"""Attitude from two directions that are measured and known."""

from fcsl_builtins import (
    abs,
    argmax,
    atan2,
    copysign,
    cross3,
    dot,
    f64,
    max,
    min,
    nan,
    norm,
    normalize,
    outer,
    pi,
    quat_normalize,
)


def unit(v: "f64[3]") -> "f64[3]":
    """v / |v|, also where the squares would overflow or vanish; NaN for zero."""
    return normalize(v / max(abs(v)))


def apart(a: "f64[3]", b: "f64[3]") -> f64:
    """The angle between two unit vectors, with all its digits near 0 and pi too."""
    return atan2(norm(cross3(a, b)), dot(a, b))


class Triad:
    """TRIAD: attitude from two vectors measured in body axes and known in the world's, with its covariance.

    w1, w2 (body), v1, v2 (world): unit vectors; n = w1 x w2 / s, s = |w1 x w2|; m = v1 x v2 / |v1 x v2|
    R = v1 w1' + m n' + (v1 x m) (w1 x n)'    (body to world: R w1 = v1, and R w2 lies in the plane of v1 and v2)
    covariance = primary_deviation^2 (n n' + w2 w2' / s^2) + secondary_deviation^2 w1 w1' / s^2
    residual = angle between w1 and w2 - angle between v1 and v2

    The primary vector is fitted exactly, so the more accurate one is to be primary; of the secondary one only the turn
    about the primary one is used. The covariance is that of the error d of attitude = true exp(d / 2), d in body axes.
    The lengths of the vectors make no difference. What R does not fit is the residual: it shows a disturbed vector.
    Health is degraded where two vectors are at less than degraded_angle from being parallel or opposite, in either
    frame. It is failed, and all outputs are NaN, where they are at less than failed_angle, or one is zero or not
    finite. The block has no memory: first run, breaks and period make no difference.

    Source: ahrs (Mayitzin/ahrs, filters/triad.py): the two triads. The covariance follows from errors d1 and d2 of w1
    and w2, across them and equal in all directions, with the variances per axis: d1 turns w1 by w1 x d1, and for the
    normal to stay that of w1 and w2, the turn about w1 is (n.d2 - c n.d1) / s, c = w1.w2. The sum of both has this
    covariance. As a sum of squares, it equals the form that is attributed to Shuster and Oh (1981),
    s1^2 I + ((s2^2 - s1^2) w1 w1' + s1^2 c (w1 w2' + w2 w1')) / s^2.
    Limits: deviations well below s, for the covariance is of first order. Errors of the known vectors count as those of
    the measured: add their squares. The attitude has the sign with w >= 0, so it may jump to that of the same rotation.
    """

    inputs = {
        "primary": "f64[3]",  # measured, body axes, any unit
        "secondary": "f64[3]",  # measured, body axes, any unit
        "primary_reference": "f64[3]",  # the same vector in the world's axes, any unit
        "secondary_reference": "f64[3]",  # the same vector in the world's axes, any unit
    }
    parameters = {
        "primary_deviation": "f64 rad in 0.. = 0",  # standard deviation of its direction, about each axis across it
        "secondary_deviation": "f64 rad in 0.. = 0",  # standard deviation of its direction, about each axis across it
        "degraded_angle": "f64 rad in 0..1.6 = 0.1",  # from being parallel, below which health is degraded
        "failed_angle": "f64 rad in 1e-6..1.6 = 1e-3",  # below which there is no attitude
    }
    outputs = {
        "attitude": "f64[4]",  # quaternion w, x, y, z, body to world
        "covariance": "f64[3][3] rad^2",  # of the error of attitude, about body axes
        "angle": "f64 rad",  # between the measured vectors
        "residual": "f64 rad",  # angle less that of the known vectors
    }

    def start(self):
        self.attitude[0] = 1.0

    def execute(self):
        w1 = unit(self.primary)
        w2 = unit(self.secondary)
        v1 = unit(self.primary_reference)
        v2 = unit(self.secondary_reference)
        angle = apart(w1, w2)
        known = apart(v1, v2)
        least = min(angle, pi - angle, known, pi - known)
        usable = least >= self.failed_angle and known >= 0.0  # min keeps a NaN of angle, but passes over one of known
        mark = 0.0 if usable else nan
        if not usable:
            self.health = "failed"
        elif least < self.degraded_angle:
            self.health = "degraded"

        across = cross3(w1, w2)
        s = norm(across)
        n = across / s
        m = normalize(cross3(v1, v2))
        r = outer(v1, w1) + outer(m, n) + outer(cross3(v1, m), cross3(w1, n))
        # 4 q q', of which the row with the greatest element on the diagonal keeps its digits
        products = [
            [1.0 + r[0, 0] + r[1, 1] + r[2, 2], r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], 1.0 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[0, 1] + r[1, 0], 1.0 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1.0 - r[0, 0] - r[1, 1] + r[2, 2]],
        ]
        best = argmax([products[0, 0], products[1, 1], products[2, 2], products[3, 3]])
        q = quat_normalize(products[best])
        self.attitude = (copysign(1.0, q[0]) + mark) * q
        p1 = self.primary_deviation**2
        p2 = self.secondary_deviation**2
        k = w2 / s
        g = w1 / s
        covariance = p1 * (outer(n, n) + outer(k, k)) + p2 * outer(g, g)
        self.covariance = (1.0 + mark) * covariance
        self.angle = angle + mark
        self.residual = angle - known + mark
