"""Where the rocket is: alignment on the stand, then an error-state Kalman filter of IMU, GNSS and range finder."""

from __future__ import annotations

from fcsl_builtins import (
    atan2,
    diag,
    exp,
    eye,
    f64,
    hypot,
    isfinite,
    kf_gain,
    kf_predict_cov,
    kf_update_cov_joseph,
    ldl_solve,
    matmul,
    matvec,
    norm,
    quat_from_euler,
    quat_rotate,
    quat_to_dcm,
    quat_turn,
    skew,
    sqrt,
    symmetric_product,
    transpose,
    zeros,
)
from rotations import DOWN

# Errors: angle 0 to 2 (body axes), velocity 3, position 6, gyro bias 9, accelerometer bias 12, drift of the GNSS 15.
N = 18
GATE_3 = 30.0  # chi squared of 3 degrees of freedom: 1.4e-6 are beyond it
GATE_1 = 24.0  # of 1
STILL = 0.1  # rad/s: more than that is no rest
PAST = 16  # ticks that are remembered, for measurements that come late
LEAST_DOWN = 0.5  # cosine of the tilt: beyond it the beam says little about the height
H_VELOCITY = [
    [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
]
H_POSITION = [
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0],
]


class Alignment:
    """The first attitude and position, at rest on the stand.

        roll = atan2(-f2, -f3),  pitch = atan2(f1, |f2, f3|)      f: mean specific force

    The heading of the stand is surveyed. The horizontal position is that of the GNSS, the height that of the range
    finder: the site is level. It ends after `rest_s` without a turn faster than 0.1 rad/s, when both have been heard.
    """

    inputs = {
        "delta_angle": "f64[3] rad",
        "delta_velocity": "f64[3] m/s",
        "gyro": "f64[3] rad/s",
        "imu_valid": "bool",
        "gnss_position": "f64[3] m",
        "gnss_fresh": "bool",
        "range": "f64 m",
        "range_fresh": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "aligned": "bool",
        "attitude": "f64[4]",  # body to NED
        "position": "f64[3] m",
        "gyro_bias": "f64[3] rad/s",
    }
    parameters = {"stand_heading": "f64 rad", "rest_s": "f64 s in 0.1.."}
    state = {
        "rest": "f64 s",
        "angle": "f64[3] rad",  # sums since it rests
        "velocity": "f64[3] m/s",
        "gnss_heard": "bool",
        "range_heard": "bool",
    }

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        if not self.aligned:
            if self.gnss_fresh and isfinite(norm(self.gnss_position)):
                self.position[0:2] = self.gnss_position[0:2]
                self.gnss_heard = True
            if self.range_fresh and isfinite(self.range):
                self.position[2] = -self.range
                self.range_heard = True
            self.rest += self.dt
            self.angle = self.angle + self.delta_angle
            self.velocity = self.velocity + self.delta_velocity
            if not (self.imu_valid and norm(self.gyro) < STILL):
                self.rest = 0.0
                self.angle = zeros(3)
                self.velocity = zeros(3)
            if self.rest > self.rest_s and self.gnss_heard and self.range_heard:
                f = self.velocity
                roll = atan2(-f[1], -f[2])
                pitch = atan2(f[0], hypot(f[1], f[2]))
                self.attitude = quat_from_euler(roll, pitch, self.stand_heading)
                self.gyro_bias = self.angle / self.rest
                self.aligned = True
            self.health = "degraded"


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


def range_row(attitude: f64[4], distance: f64) -> f64[1][N]:
    """How distance cos(tilt) - height depends on the errors: the height is -down, the beam the z axis of the body.

    cos(tilt) is the last element of R; that of R exp(dtheta) is larger by R_3 (dtheta x z) = R_31 dtheta_2 - R_32
    dtheta_1.
    """
    dcm = quat_to_dcm(attitude)
    h = zeros(1, N)
    h[0, 0] = distance * dcm[2, 1]
    h[0, 1] = -distance * dcm[2, 0]
    h[0, 8] = -1.0
    return h


def first_covariance(sigma: f64[N], white: f64[3], drift: f64[3]) -> f64[N][N]:
    """After the alignment: the horizontal position is a sample of the GNSS, so its error is minus that of the GNSS."""
    p = diag(sigma)
    for i in range(N):
        p[i, i] *= sigma[i]
    for i in range(3):
        p[15 + i, 15 + i] = drift[i] * drift[i]
    for i in range(2):
        p[6 + i, 6 + i] = white[i] * white[i] + drift[i] * drift[i]
        p[6 + i, 15 + i] = -drift[i] * drift[i]
        p[15 + i, 6 + i] = -drift[i] * drift[i]
    return p


class Navigation:
    """Attitude, velocity and position: strapdown integration of the IMU, corrected by an error-state Kalman filter.

    Each tick, with the biases bg and ba taken off the integrals of the IMU:

        q' = q (x) exp(dtheta / 2),    v' = v + R(q) dv + g dt,    p' = p + (v + v') dt / 2

    The 18 errors are angle (body axes), velocity, position, bg, ba, and the drift b of the GNSS position (a
    Gauss-Markov process):

        d/dt dtheta = -w x dtheta - dbg,    d/dt dv = -R (a x dtheta) - R dba,    d/dt dp = dv,
        d/dt db = -db / drift_time + noise

    and random walks of the biases. The range finder measures the height without drift, so it finds the vertical drift
    of the GNSS, and its loss near the ground costs little. GNSS and range come late: each is compared with the estimate
    of its own time, which is remembered, and the error found is taken for that of the present. Each measurement is
    taken in Joseph's form when it is new, and passed over if its innovation is beyond one in 10^6 of what the filter
    expects. Nothing measures the heading: horizontal acceleration makes it observable, with the GNSS.

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
        "range": "f64 m",
        "range_fresh": "bool",
        "aligned": "bool",
        "first_attitude": "f64[4]",
        "first_position": "f64[3] m",
        "first_gyro_bias": "f64[3] rad/s",
        "dt": "f64 s",
    }
    outputs = {
        "attitude": "f64[4]",  # body to NED
        "velocity": "f64[3] m/s",
        "position": "f64[3] m",
        "height": "f64 m",  # of the feet above the ground, upright
        "rate": "f64[3] rad/s",
        "specific_force": "f64[3] m/s^2",  # body axes
        "gyro_bias": "f64[3] rad/s",
        "accelerometer_bias": "f64[3] m/s^2",
        "attitude_sigma": "f64[3] rad",
        "velocity_sigma": "f64[3] m/s",
        "position_sigma": "f64[3] m",
        "gnss_age": "f64 s",  # since one was used
        "range_age": "f64 s",
        "ready": "bool",
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "leg_height": "f64 m",  # of the centre of mass over the feet
        "settle_s": "f64 s",  # from the alignment to `ready`
        "gyro_noise": "f64 rad/s/sqrt(Hz) in 0..",
        "gyro_walk": "f64 rad/s^2/sqrt(Hz) in 0..",
        "accelerometer_noise": "f64 m/s^2/sqrt(Hz) in 0..",
        "accelerometer_walk": "f64 m/s^3/sqrt(Hz) in 0..",
        "position_white": "f64[3] m in 0..",  # of the GNSS
        "position_drift": "f64[3] m in 0..",
        "drift_time": "f64 s in 1..",
        "velocity_white": "f64[3] m/s in 0..",
        "range_white": "f64 m in 0..",
        "range_scale": "f64 in 0..",  # noise by range
        "gnss_delay": "i32 in 0..15",  # ticks
        "range_delay": "i32 in 0..15",
        "first_sigma": "f64[18] in 0..",  # after the alignment; those of position and drift are computed
    }
    state = {
        "running": "bool",
        "settled_s": "f64 s",
        "P": "f64[18][18]",
        "drift": "f64[3] m",
        "now": "i32",  # row of the present in the memory
        "past_attitude": "f64[16][4]",
        "past_velocity": "f64[16][3] m/s",
        "past_position": "f64[16][3] m",
    }

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        self.gnss_age += self.dt
        self.range_age += self.dt
        if not self.imu_valid:
            self.health = "failed"
        elif not self.running:
            self.attitude = self.first_attitude
            self.position = self.first_position
            self.gyro_bias = self.first_gyro_bias
            sigma = self.first_sigma
            self.P = first_covariance(sigma, self.position_white, self.position_drift)
            for i in range(PAST):
                self.past_attitude[i] = self.attitude
                self.past_position[i] = self.position
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
            self.drift = self.drift * keep
            self.P = kf_predict_cov(f, self.P, diag(q))

            # ---- corrections: each is compared with what the ones before it have found
            self.now = (self.now + 1) % PAST
            self.past_attitude[self.now] = self.attitude
            self.past_velocity[self.now] = self.velocity
            self.past_position[self.now] = self.position
            gnss_row = (self.now + PAST - self.gnss_delay) % PAST
            beam_row = (self.now + PAST - self.range_delay) % PAST
            error = zeros(N)
            whole = self.gnss_fresh
            for i in range(3):
                whole = whole and isfinite(self.gnss_position[i]) and isfinite(self.gnss_velocity[i])
            if whole:
                r = zeros(3, 3)
                for i in range(3):
                    r[i, i] = self.velocity_white[i] * self.velocity_white[i]
                fast, found, p = corrected(self.P, H_VELOCITY, r, self.gnss_velocity - self.past_velocity[gnss_row])
                error = error + found
                self.P = p
                for i in range(3):
                    r[i, i] = self.position_white[i] * self.position_white[i]
                lacking = self.gnss_position - self.past_position[gnss_row] - self.drift - error[6:9] - error[15:18]
                near, found, p = corrected(self.P, H_POSITION, r, lacking)
                error = error + found
                self.P = p
                if fast and near:
                    self.gnss_age = 0.0
            past = self.past_attitude[beam_row]
            down = quat_rotate(past, DOWN)[2]
            if self.range_fresh and isfinite(self.range) and down > LEAST_DOWN:
                row = range_row(past, self.range)
                sigma_range = (self.range_white + self.range_scale * self.range) * down
                expected = -self.past_position[beam_row, 2] + row[0, 0] * error[0] + row[0, 1] * error[1] - error[8]
                innovation = self.range * down - expected
                taken, found, p = corrected_by_one(self.P, row, sigma_range * sigma_range, innovation)
                error = error + found
                self.P = p
                if taken:
                    self.range_age = 0.0
            self.attitude = quat_turn(self.attitude, error[0:3])
            self.velocity = self.velocity + error[3:6]
            self.position = self.position + error[6:9]
            self.gyro_bias = self.gyro_bias + error[9:12]
            self.accelerometer_bias = self.accelerometer_bias + error[12:15]
            self.drift = self.drift + error[15:18]
            for i in range(PAST):
                self.past_velocity[i] = self.past_velocity[i] + error[3:6]
                self.past_position[i] = self.past_position[i] + error[6:9]
            self.settled_s += self.dt

        # ---- what it reports
        self.rate = self.gyro - self.gyro_bias
        self.specific_force = self.delta_velocity / self.dt - self.accelerometer_bias
        self.height = -self.position[2] - self.leg_height
        self.ready = self.settled_s > self.settle_s and self.imu_valid
        for i in range(3):
            self.attitude_sigma[i] = sqrt(self.P[i, i])
            self.velocity_sigma[i] = sqrt(self.P[3 + i, 3 + i])
            self.position_sigma[i] = sqrt(self.P[6 + i, 6 + i])
