from __future__ import annotations

from fcsl_builtins import (
    diag,
    dot,
    exp,
    eye,
    f64,
    isfinite,
    kf_gain,
    kf_predict_cov,
    kf_update_cov_joseph,
    ldl_solve,
    matmul,
    matvec,
    norm,
    quat_conj,
    quat_rotate,
    quat_to_dcm,
    quat_turn,
    skew,
    sqrt,
    symmetric_product,
    transpose,
    wrap_angle,
    zeros,
)
from rotations import DOWN, heading

# Errors: angle 0 to 2 (body axes), velocity 3, position 6, gyro bias 9, accelerometer bias 12, drift of the GNSS 15,
# barometer bias 18.
N = 19
BAROMETER = 18
GATE_3 = 30.0  # chi squared of 3 degrees of freedom: 1.4e-6 are beyond it
GATE_1 = 24.0  # of 1
FIELD_TOLERANCE = 0.3  # of its strength; more is iron or a fault
H_VELOCITY = [
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
]
H_POSITION = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
]
H_HEIGHT = [[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]


def corrected(p: f64[N][N], h: f64[3][N], r: f64[3][3], innovation: f64[3]) -> tuple[bool, f64[N], f64[N][N]]:
    """Whether the gate takes a measurement, the errors that it shows, and the covariance after it."""
    s = symmetric_product(matmul(h, p), transpose(h)) + r
    weighted = ldl_solve(s, [[innovation[0]], [innovation[1]], [innovation[2]]])
    squared = innovation[0] * weighted[0, 0] + innovation[1] * weighted[1, 0] + innovation[2] * weighted[2, 0]
    if not squared < GATE_3:
        return False, zeros(N), p
    k = kf_gain(p, h, r)
    return True, matvec(k, innovation), kf_update_cov_joseph(p, k, h, r)


def corrected_by_one(p: f64[N][N], h: f64[1][N], variance: f64, innovation: f64) -> tuple[bool, f64[N], f64[N][N]]:
    """The same for a scalar."""
    s = symmetric_product(matmul(h, p), transpose(h))
    if not innovation * innovation < GATE_1 * (s[0, 0] + variance):
        return False, zeros(N), p
    k = kf_gain(p, h, [[variance]])
    return True, matvec(k, [innovation]), kf_update_cov_joseph(p, k, h, [[variance]])


def transition(attitude: f64[4], delta_angle: f64[3], delta_velocity: f64[3], keep: f64, dt: f64) -> f64[N][N]:
    """How the errors go on in one step of the strapdown integration. `keep`: what is left of the drift of the GNSS."""
    dcm = quat_to_dcm(attitude)
    lever = matmul(dcm, skew(delta_velocity))
    turn = skew(delta_angle)
    f = eye(N)
    for i in range(3):
        f[6 + i, 3 + i] = dt
        f[i, 9 + i] = -dt
        f[15 + i, 15 + i] = keep
        for j in range(3):
            f[i, j] -= turn[i, j]
            f[3 + i, j] = -lever[i, j]
            f[3 + i, 12 + j] = -dcm[i, j] * dt
    return f


def heading_row(attitude: f64[4], field: f64[3]) -> f64[1][N]:
    """How the heading of the magnetic field `field` (NED) in estimated axes depends on the angle error.

    In estimated axes the field is field + field x (R dtheta), and its heading atan2(east, north).
    """
    dcm = quat_to_dcm(attitude)
    lean = skew(field)
    square = field[0] * field[0] + field[1] * field[1]
    h = zeros(1, N)
    for j in range(3):
        for i in range(3):
            h[0, j] += (field[0] * lean[1, i] - field[1] * lean[0, i]) / square * dcm[i, j]
    return h


def first_covariance(sigma: f64[N], white: f64[3], drift: f64[3], height_white: f64) -> f64[N][N]:
    """After the alignment: the position is the sample of a GNSS, so its error is minus that of the GNSS; the bias of
    the barometer is what its height and that position make of it.
    """
    p = diag(sigma)
    for i in range(N):
        p[i, i] *= sigma[i]
    for i in range(3):
        p[15 + i, 15 + i] = drift[i] * drift[i]
        p[6 + i, 6 + i] = white[i] * white[i] + drift[i] * drift[i]
        p[6 + i, 15 + i] = -drift[i] * drift[i]
        p[15 + i, 6 + i] = -drift[i] * drift[i]
    p[BAROMETER, BAROMETER] = p[8, 8] + height_white * height_white
    for i in range(2):
        j = 8 if i == 0 else 17
        p[BAROMETER, j] = p[8, j]
        p[j, BAROMETER] = p[8, j]
    return p


class Navigation:
    """Attitude, velocity and position: strapdown integration of the IMU, corrected by an error-state Kalman filter.

    Each tick, with the biases bg and ba taken off the integrals of the IMU:

        q' = q (x) exp(dtheta / 2),    v' = v + R(q) dv + g dt,    p' = p + (v + v') dt / 2

    The 19 errors are angle (body axes), velocity, position, bg, ba, the drift b of the GNSS position (a Gauss-Markov
    process) and the bias of the barometer:

        d/dt dtheta = -w x dtheta - dbg,    d/dt dv = -R (a x dtheta) - R dba,    d/dt dp = dv,
        d/dt db = -db / drift_time + noise

    and random walks of the other biases. GNSS position and velocity are vectors of 3, the height of the barometer and
    the magnetic heading scalars. Each is taken in Joseph's form when it is new, and passed over if its innovation is
    beyond one in 10^6 of what the filter expects. The magnetometer corrects heading alone.

    A constant part of the magnetic heading cannot be observed: `attitude_sigma` has its deviation added. Until
    `alignment` has ended the filter repeats its result.

    Source: J. Sola, Quaternion kinematics for the error-state Kalman filter, arXiv 1711.02508 (2017), chapters 5 and 6.
    """

    inputs = {
        "delta_angle": "f64[3] rad",
        "delta_velocity": "f64[3] m/s",
        "gyro": "f64[3] rad/s",
        "imu_valid": "bool",
        "gnss_position": "f64[3] m",
        "gnss_velocity": "f64[3] m/s",
        "gnss_fresh": "bool",
        "barometer_height": "f64 m",
        "barometer_fresh": "bool",
        "field": "f64[3] T",
        "field_fresh": "bool",
        "aligned": "bool",  # of the alignment, with its results
        "first_attitude": "f64[4]",
        "first_position": "f64[3] m",
        "first_gyro_bias": "f64[3] rad/s",
        "first_barometer_bias": "f64 m",
        "dt": "f64 s",
    }
    outputs = {
        "attitude": "f64[4]",  # body to NED, w, x, y, z
        "rate": "f64[3] rad/s",  # body axes, without bias
        "velocity": "f64[3] m/s",  # NED
        "position": "f64[3] m",  # NED, from the reference of the GNSS
        "attitude_sigma": "f64[3] rad",  # standard deviations; these about the body axes
        "velocity_sigma": "f64[3] m/s",
        "position_sigma": "f64[3] m",
        "gyro_bias": "f64[3] rad/s",
        "accelerometer_bias": "f64[3] m/s^2",
        "barometer_bias": "f64 m",
        "ready": "bool",  # fit to fly
        "gnss_age": "f64 s",  # since a position and a velocity were used
        "barometer_age": "f64 s",
        "magnetometer_age": "f64 s",
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "field_ned": "f64[3] T",  # of the Earth, at this place
        "settle_s": "f64 s",  # from the alignment to `ready`
        "gyro_noise": "f64 rad/s/sqrt(Hz) in 0..",
        "gyro_walk": "f64 rad/s^2/sqrt(Hz) in 0..",
        "accelerometer_noise": "f64 m/s^2/sqrt(Hz) in 0..",
        "accelerometer_walk": "f64 m/s^3/sqrt(Hz) in 0..",
        "barometer_walk": "f64 m/s/sqrt(Hz) in 0..",
        "position_white": "f64[3] m in 0..",  # of the GNSS
        "position_drift": "f64[3] m in 0..",
        "drift_time": "f64 s in 1..",
        "velocity_white": "f64[3] m/s in 0..",
        "barometer_white": "f64 m in 0..",
        "heading_white": "f64 rad in 0..",
        "heading_drift": "f64 rad in 0..",
        "first_sigma": "f64[19] in 0..",  # after the alignment; those of position, drift, barometer are computed
    }
    state = {"running": "bool", "settled_s": "f64 s", "P": "f64[19][19]", "drift": "f64[3] m"}

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        self.gnss_age += self.dt
        self.barometer_age += self.dt
        self.magnetometer_age += self.dt
        if not self.imu_valid:
            self.health = "failed"
        elif not self.running:
            self.attitude = self.first_attitude
            self.position = self.first_position
            self.gyro_bias = self.first_gyro_bias
            self.barometer_bias = self.first_barometer_bias
            sigma = self.first_sigma
            self.P = first_covariance(sigma, self.position_white, self.position_drift, self.barometer_white)
            self.running = self.aligned
            self.health = "degraded"
        else:
            # ---- prediction
            angle = self.delta_angle - self.gyro_bias * self.dt
            push = self.delta_velocity - self.accelerometer_bias * self.dt
            keep = exp(-self.dt / self.drift_time)
            f = transition(self.attitude, angle, push, keep, self.dt)
            velocity = self.velocity + quat_rotate(quat_turn(self.attitude, 0.5 * angle), push)
            velocity[2] += self.gravity * self.dt
            self.position = self.position + (self.velocity + velocity) * (0.5 * self.dt)
            self.velocity = velocity
            self.attitude = quat_turn(self.attitude, angle)
            q = zeros(N)
            for i in range(3):
                q[i] = self.gyro_noise * self.gyro_noise * self.dt
                q[3 + i] = self.accelerometer_noise * self.accelerometer_noise * self.dt
                q[9 + i] = self.gyro_walk * self.gyro_walk * self.dt
                q[12 + i] = self.accelerometer_walk * self.accelerometer_walk * self.dt
                q[15 + i] = self.position_drift[i] * self.position_drift[i] * (1.0 - keep * keep)
            q[BAROMETER] = self.barometer_walk * self.barometer_walk * self.dt
            self.drift = self.drift * keep
            self.P = kf_predict_cov(f, self.P, diag(q))

            # ---- corrections: each is compared with what the ones before it have found
            error = zeros(N)
            whole = self.gnss_fresh
            for i in range(3):
                whole = whole and isfinite(self.gnss_position[i]) and isfinite(self.gnss_velocity[i])
            if whole:
                r = zeros(3, 3)
                for i in range(3):
                    r[i, i] = self.velocity_white[i] * self.velocity_white[i]
                fast, found, p = corrected(self.P, H_VELOCITY, r, self.gnss_velocity - self.velocity)
                error = error + found
                self.P = p
                for i in range(3):
                    r[i, i] = self.position_white[i] * self.position_white[i]
                lacking = self.gnss_position - self.position - self.drift - error[6:9] - error[15:18]
                near, found, p = corrected(self.P, H_POSITION, r, lacking)
                error = error + found
                self.P = p
                if fast and near:
                    self.gnss_age = 0.0
            if self.barometer_fresh and isfinite(self.barometer_height):
                expected = self.barometer_bias + error[BAROMETER] - self.position[2] - error[8]
                variance = self.barometer_white * self.barometer_white
                taken, found, p = corrected_by_one(self.P, H_HEIGHT, variance, self.barometer_height - expected)
                error = error + found
                self.P = p
                if taken:
                    self.barometer_age = 0.0
            strength = norm(self.field) / norm(self.field_ned)
            if self.field_fresh and 1.0 - FIELD_TOLERANCE < strength < 1.0 + FIELD_TOLERANCE:
                row = heading_row(self.attitude, self.field_ned)
                expected = heading(self.field_ned) + dot(row[0], error)
                innovation = wrap_angle(heading(quat_rotate(self.attitude, self.field)) - expected)
                variance = self.heading_white * self.heading_white
                taken, found, p = corrected_by_one(self.P, row, variance, innovation)
                error = error + found
                self.P = p
                if taken:
                    self.magnetometer_age = 0.0
            self.attitude = quat_turn(self.attitude, error[0:3])
            self.velocity = self.velocity + error[3:6]
            self.position = self.position + error[6:9]
            self.gyro_bias = self.gyro_bias + error[9:12]
            self.accelerometer_bias = self.accelerometer_bias + error[12:15]
            self.drift = self.drift + error[15:18]
            self.barometer_bias += error[BAROMETER]
            self.settled_s += self.dt

        # ---- what it reports
        self.rate = self.gyro - self.gyro_bias
        self.ready = self.settled_s > self.settle_s and self.imu_valid
        down = quat_rotate(quat_conj(self.attitude), DOWN)
        for i in range(3):
            iron = self.heading_drift * down[i]
            self.attitude_sigma[i] = sqrt(self.P[i, i] + iron * iron)
            self.velocity_sigma[i] = sqrt(self.P[3 + i, 3 + i])
            self.position_sigma[i] = sqrt(self.P[6 + i, 6 + i])
