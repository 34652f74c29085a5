from __future__ import annotations

from fcsl_builtins import (
    diag,
    eye,
    f64,
    isfinite,
    kf_gain,
    kf_predict_cov,
    kf_update_cov_joseph,
    ldl_solve,
    matmul,
    matvec,
    min,
    norm,
    quat_conj,
    quat_mul,
    quat_normalize,
    skew,
    sqrt,
    symmetric_product,
    transpose,
    zeros,
)
from rotations import rotation_vector, turned

GATE = 30.0  # chi squared of 3 degrees of freedom: 1.4e-6 are beyond it
BLIND_NOISE = 0.1  # rad/s/sqrt(Hz): how the attitude may turn while the gyroscope says nothing
H = [[1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]]


def first_covariance(star: f64[3], bias: f64) -> f64[6][6]:
    """Of the attitude of one star tracker sample and a bias that nobody knows."""
    return diag([star[0] * star[0], star[1] * star[1], star[2] * star[2], bias * bias, bias * bias, bias * bias])


class Estimator:
    """Attitude and gyroscope bias: multiplicative extended Kalman filter.

    The gyroscope is integrated, q' = q (x) exp((dtheta - b dt) / 2). The six errors are the angle a in body axes
    (true attitude = q (x) exp(a / 2)) and that of the bias:

        a' = -w x a - db - noise,    db' = walk

    A star tracker sample s gives the innovation rotation_vector(q* (x) s) = a + noise. It is passed over when it is
    beyond one in 10^6 of what the filter expects. The first sample begins the filter; until then its sigmas are 0 and
    `known` is false. One that comes `restart_s` after the last one that was taken begins it anew, with the known bias.

    Source: F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
    section 6.2.
    """

    inputs = {
        "rate_measured": "f64[3] rad/s",
        "delta_angle": "f64[3] rad",
        "gyroscope_valid": "bool",
        "star_attitude": "f64[4]",
        "star_fresh": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "attitude": "f64[4]",  # body to inertial
        "rate": "f64[3] rad/s",  # body axes, without bias
        "bias": "f64[3] rad/s",
        "attitude_sigma": "f64[3] rad",  # standard deviations, about the body axes
        "bias_sigma": "f64[3] rad/s",
        "star_age": "f64 s",  # since a sample was taken
        "known": "bool",  # the attitude is fit for control
    }
    parameters = {
        "star_sigma": "f64[3] rad in 1e-9..",
        "gyroscope_noise": "f64 rad/s/sqrt(Hz) in 0..",
        "gyroscope_walk": "f64 rad/s^2/sqrt(Hz) in 0..",
        "first_bias_sigma": "f64 rad/s in 0..",
        "known_sigma": "f64 rad",  # largest attitude_sigma of `known`
        "known_bias_sigma": "f64 rad/s",
        "star_patience": "f64 s",  # largest star_age of `known`
        "restart_s": "f64 s",
    }
    state = {"running": "bool", "P": "f64[6][6]"}

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]
        self.star_age = 1e6

    def execute(self):
        self.star_age += self.dt
        usable = self.star_fresh and 0.5 < norm(self.star_attitude) < 2.0
        if usable and (not self.running or self.star_age > self.restart_s):
            self.attitude = quat_normalize(self.star_attitude)
            sigma = self.first_bias_sigma
            fresh = first_covariance(self.star_sigma, sigma)
            if self.running:
                for i in range(3):
                    fresh[3 + i, 3 + i] = min(self.P[3 + i, 3 + i], sigma * sigma)
            self.P = fresh
            self.running = True
            self.star_age = 0.0
        elif self.running:
            if self.gyroscope_valid:
                angle = self.delta_angle - self.bias * self.dt
                self.attitude = turned(self.attitude, angle)
            else:
                angle = zeros(3)
            f = eye(6)
            turn = skew(angle)
            q = zeros(6)
            noise = self.gyroscope_noise if self.gyroscope_valid else BLIND_NOISE
            for i in range(3):
                f[i, 3 + i] = -self.dt
                for j in range(3):
                    f[i, j] -= turn[i, j]
                q[i] = noise * noise * self.dt
                q[3 + i] = self.gyroscope_walk * self.gyroscope_walk * self.dt
            self.P = kf_predict_cov(f, self.P, diag(q))
            if usable:
                r = diag(self.star_sigma)
                for i in range(3):
                    r[i, i] *= r[i, i]
                z = rotation_vector(quat_mul(quat_conj(self.attitude), quat_normalize(self.star_attitude)))
                s = symmetric_product(matmul(H, self.P), transpose(H)) + r
                weighted = ldl_solve(s, [[z[0]], [z[1]], [z[2]]])
                if z[0] * weighted[0, 0] + z[1] * weighted[1, 0] + z[2] * weighted[2, 0] < GATE:
                    k = kf_gain(self.P, H, r)
                    error = matvec(k, z)
                    self.P = kf_update_cov_joseph(self.P, k, H, r)
                    self.attitude = turned(self.attitude, error[0:3])
                    self.bias = self.bias + error[3:6]
                    self.star_age = 0.0
        if self.gyroscope_valid and isfinite(norm(self.rate_measured)):
            self.rate = self.rate_measured - self.bias
        self.known = self.running and self.gyroscope_valid and self.star_age < self.star_patience
        for i in range(3):
            self.attitude_sigma[i] = sqrt(self.P[i, i])
            self.bias_sigma[i] = sqrt(self.P[3 + i, 3 + i])
            if self.attitude_sigma[i] > self.known_sigma or self.bias_sigma[i] > self.known_bias_sigma:
                self.known = False
        self.health = "nominal" if self.known else "degraded"
