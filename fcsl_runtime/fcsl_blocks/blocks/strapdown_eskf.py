# SPDX-License-Identifier: Apache-2.0
"""Inertial navigation: strapdown integration, corrected by an error-state Kalman filter with the aids that a vehicle has."""

from fcsl_builtins import (
    all,
    atan2,
    cross3,
    diag,
    dot,
    exp,
    eye,
    f64,
    hypot,
    isfinite,
    isnan,
    kf_gain,
    kf_predict_cov,
    kf_update_cov_joseph,
    ldl_solve,
    matmul,
    matvec,
    min,
    nan,
    norm,
    outer,
    quat_from_euler,
    quat_rotate,
    quat_to_dcm,
    quat_turn,
    sat_add,
    skew,
    sqrt,
    symmetric_product,
    transpose,
    wrap_angle,
    zeros,
)

# Errors: angle 0 to 2 (body axes), velocity 3, position 6, gyro bias 9, accelerometer bias 12; of the aids: drift of the
# position 15, bias of the height 18. The state x: attitude 0 to 3, then these from 4, 7, 10, 13, 16 and 19 on.
N = 19
X = 20
MOTION = 15  # errors without those of the aids
OF_AIDS = 4
AIDS = 6
POSITION = 0
VELOCITY = 1
HEIGHT = 2
HEADING = 3
RANGE = 4
BODY_VELOCITY = 5
LEAST_LEVEL = 0.01  # squared cosine of the pitch: the x axis is 84 degrees up or down, and has no heading


def sound(x: "f64[X]", p: "f64[N][N]") -> bool:
    """Whether all is finite, and no variance negative."""
    fine = all(isfinite(x))
    for i in range(N):
        fine = fine and all(isfinite(p[i])) and p[i, i] >= 0.0
    return fine


def integrated(
    x: "f64[X]", angle: "f64[3]", push: "f64[3]", gravity: f64, dt: f64
) -> tuple["f64[X]", "f64[MOTION][MOTION]"]:
    """The state after a turn `angle` and a specific force with the integral `push`, and the transition of its errors."""
    q = x[0:4]
    dcm = quat_to_dcm(q)
    middle = quat_turn(q, 0.5 * angle)
    force = quat_rotate(middle, push)
    made = x
    made[0:4] = quat_turn(q, angle)
    made[4:7] = x[4:7] + force
    made[6] += gravity * dt
    made[7:10] = x[7:10] + (0.5 * dt) * (x[4:7] + made[4:7])

    f = eye(MOTION)
    f[0:3, 0:3] = transpose(quat_to_dcm(quat_turn([1.0, 0.0, 0.0, 0.0], angle)))
    lever = matmul(skew(force), dcm)
    f[3:6, 0:3] = -lever
    f[3:6, 9:12] = (0.5 * dt) * lever
    f[3:6, 12:15] = -dt * quat_to_dcm(middle)
    f[6:9, :] = f[6:9, :] + (0.5 * dt) * f[3:6, :]
    for i in range(3):
        f[i, 9 + i] = -dt
        f[6 + i, 3 + i] = dt
    return made, f


def predicted(
    p: "f64[N][N]", f: "f64[MOTION][MOTION]", q: "f64[MOTION]", fade: "f64[OF_AIDS]", q_aids: "f64[OF_AIDS]"
) -> "f64[N][N]":
    """The covariance after a period. The errors of the aids fade on their own; q, q_aids: what is added."""
    beside = matmul(f, p[0:MOTION, MOTION:])
    of_aids = p[MOTION:, MOTION:]
    for i in range(OF_AIDS):
        beside[:, i] = fade[i] * beside[:, i]
        for j in range(OF_AIDS):
            of_aids[i, j] *= fade[i] * fade[j]
        of_aids[i, i] += q_aids[i]
    after = zeros(N, N)
    after[0:MOTION, 0:MOTION] = kf_predict_cov(f, p[0:MOTION, 0:MOTION], diag(q))
    after[0:MOTION, MOTION:] = beside
    after[MOTION:, 0:MOTION] = transpose(beside)
    after[MOTION:, MOTION:] = of_aids
    return after


def fused(
    x: "f64[X]",
    p: "f64[N][N]",
    h: "f64[m][N]",
    setting: "f64[N][m]",
    sigma: "f64[m]",
    difference: "f64[m]",
    gate: f64,
    late: f64,
    gravity: f64,
) -> tuple[f64, bool, "f64[m]", "f64[X]", "f64[N][N]"]:
    """A measurement of h error, `difference` beyond what x expects: its normalized innovation squared (NaN: not usable),
    whether it is taken, its innovation, and state and covariance after it.

    Elements with a sigma of 0 are left out. One that is beyond the gate is taken with the gain `setting`, if others have
    been rejected since `late` s > 0; then what may have moved it in this time is unknown: the velocity by the step of the
    position / late, the tilt by the horizontal step of the velocity / (gravity late), or of the position, once more / late.
    """
    rows = h
    innovation = difference
    r = zeros(m, m)
    column = zeros(m, 1)
    measured = False
    for i in range(m):
        r[i, i] = sigma[i] * sigma[i]
        measured = measured or r[i, i] > 0.0
        if r[i, i] == 0.0:
            r[i, i] = 1.0
            rows[i] = zeros(N)
            innovation[i] = 0.0
        column[i, 0] = innovation[i]
    s = symmetric_product(matmul(rows, p), transpose(rows)) + r
    square = dot(innovation, ldl_solve(s, column)[:, 0])
    if not (measured and isfinite(square)):
        return nan, False, innovation, x, p
    k = kf_gain(p, rows, r)
    if not square < gate:
        if not late > 0.0:
            return square, False, innovation, x, p
        k = setting
        for i in range(m):
            if sigma[i] * sigma[i] == 0.0:
                k[:, i] = zeros(N)
    error = matvec(k, innovation)
    after = x
    after[0:4] = quat_turn(x[0:4], error[0:3])
    after[4:] = x[4:] + error[3:]
    less = kf_update_cov_joseph(p, k, rows, r)
    reset = eye(3) - skew(0.5 * error[0:3])
    beside = matmul(reset, less[0:3, 3:])
    less[0:3, 0:3] = symmetric_product(matmul(reset, less[0:3, 0:3]), transpose(reset))
    less[0:3, 3:] = beside
    less[3:, 0:3] = transpose(beside)
    if not square < gate:
        vertical = quat_to_dcm(after[0:4])[2]
        lean = min((hypot(error[3], error[4]) + hypot(error[6], error[7]) / late) / (gravity * late), 1.0)
        less[0:3, 0:3] = less[0:3, 0:3] + (lean * lean) * (eye(3) - outer(vertical, vertical))
        for i in range(3):
            drift = error[6 + i] / late
            less[3 + i, 3 + i] += drift * drift
    if not sound(after, less):
        return nan, False, innovation, x, p
    return square, True, innovation, after, less


class StrapdownEskf:
    """Attitude, velocity, position and the biases of an IMU, by an error-state Kalman filter whose aids are optional.

    With the biases bg and ba taken off, angle = the integral of the rate, push = that of the specific force in a period:

    q' = q (x) exp(angle), v' = v + R(q (x) exp(angle / 2)) push + g dt, p' = p + (v + v') dt / 2

    up is -1 with z_down, else 1. The 19 errors are angle (about body axes: q_true = q (x) exp(dtheta)), velocity, position, bg,
    ba, and those of two aids: the drift b of a measured position (of GNSS, say), a Gauss-Markov process, and the bias c of a
    height (a barometer's):

    d/dt dtheta = -w x dtheta - dbg - noise, d/dt dv = -R (f x dtheta) - R dba - noise, d/dt dp = dv,
    d/dt b = -b / measured_position_drift_time + noise, other biases: random walks

    An aid that is not fresh costs nothing and changes nothing. With a the arm of the sensor, w = rate - bg, R = R(q):

    position = p + b + R a        velocity = v + R (w x a)          (arm of the antenna)
    height = up p_z + c           heading = atan2(R_10, R_00)       (the turn of body x about the world's z axis)
    body_velocity = R^T v + w x a (wheels, Doppler, pitot; a wheeled vehicle measures 0 aside and down)
    range = (h - n.(p + R a)) / (n.R r)      (along the beam r to the plane n.y = h; n = vertical: the ground)

    Each is taken alone, in this order, in Joseph's form: K = P H^T S^-1, S = H P H^T + diag(sigma^2), dx = K innovation, P =
    (I - K H) P (I - K H)^T + K R K^T; then dx goes into the state, and P = G P G^T with G = I - [dtheta / 2]x. Elements with
    a sigma of 0 are not measured: so is the height of a position in the plane. An aid that is fresh and has no other sigma is
    not used, and health is degraded. An aid is rejected if innovation^T S^-1
    innovation is not below its gate: chi squared. The defaults reject one in 10^4 of the samples that fit. If an aid has been
    rejected for reset_after, reset_count times in a row at least, the next sample sets what it measures (position, velocity
    or heading), as the gain that moves this alone, in Joseph's form. What may have led it away in the
    time T of the rejections becomes unknown by as much: the velocity by (step of position) / T, the tilt by (horizontal
    step of velocity) / (g T) or that of position / (g T^2), at most 1 rad.

    The world is north, east, down and the body forward, right, down; without z_down, east, north, up and forward, left,
    up. The IMU gives integrals or rates: what is not connected is 0. The first run, and the first after a break (`resumed`),
    aligns anew: to first_attitude if it is not zero; otherwise at rest for align_time, to the mean specific force, to the
    last heading that was fresh then (without one to first_heading), and with the mean rate as the gyroscope's bias. There
    the errors of tilt and accelerometer bias are correlated: tilt = bias / g. Other biases stay over a break. Until then
    `aligned` is false and health is degraded. Each step takes the time since the last sample, so the period may change.

    Source: J. Sola, "Quaternion kinematics for the error-state Kalman filter" (2017), sections 5.3 to 6.3: errors, impulses,
    Joseph's form, injection, reset; position by trapezoids, force in the axes of the middle, and the half steps of both in
    the transition are added. PX4 Autopilot, ekf2 (range_height_control.cpp, ev_yaw_control.cpp): gates, time-outs, and the
    gain that sets one state. Jacobians of the aids: derived from R_true = R (I + [dtheta]x).
    Limits: flat earth that does not turn, constant gravity; coning and sculling within a period are left out. Aids are taken
    to be of this run: a delay is an error of speed times delay, which DelayCompensation takes off; keep `..._fresh` true for
    one run per sample. Errors of an aid are white but for b and c, or its sigma must cover them: a drift that is taken for
    white noise becomes velocity, and the filter claims to know the position several times better than it does. A constant part
    of b cannot be observed by position alone. Where the errors of first_position are those of the first sample, give a
    first_position_sigma that is larger than both: the sample itself then makes the correlation. No heading within 6 degrees of
    the vertical. Heading is observable only by its aid, or by horizontal acceleration beside position or velocity. An IMU
    sample that is not finite, or that makes the estimate so, is passed over: outputs stay, health is degraded, the next sample
    is taken for the whole gap. Of an aid that is not finite only this aid is passed over.
    """

    inputs = {
        "delta_angle": "f64[3] rad",  # integral of the gyroscope in this period, body axes; or:
        "gyro": "f64[3] rad/s",  # body rates
        "delta_velocity": "f64[3] m/s",  # integral of the specific force in this period, body axes; or:
        "acceleration": "f64[3] m/s^2",  # specific force, body axes
        "measured_position": "f64[3] m",  # of the antenna in the world
        "position_fresh": "bool",  # measured_position is a new sample; so with the others
        "measured_velocity": "f64[3] m/s",  # of the antenna, axes of the world
        "velocity_fresh": "bool",  # measured_velocity is new
        "measured_height": "f64 m",  # up, of the IMU
        "height_fresh": "bool",  # measured_height is new
        "measured_heading": "f64 rad",  # from north to the east with z_down, else from east to the north
        "heading_fresh": "bool",  # measured_heading is new
        "measured_range": "f64 m",  # along the beam
        "range_fresh": "bool",  # measured_range is new
        "ground": "f64 m",  # height (up) of the plane at the origin
        "ground_normal": "f64[3]",  # unit normal of the plane, towards the vehicle, axes of the world; 0: up
        "measured_body_velocity": "f64[3] m/s",  # body axes
        "body_velocity_fresh": "bool",  # measured_body_velocity is new
        "first_attitude": "f64[4]",  # to align to, w, x, y, z; 0: at rest
        "first_heading": "f64 rad",  # to align to at rest without a heading
        "first_velocity": "f64[3] m/s",  # to align to
        "first_position": "f64[3] m",  # to align to
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "z_down": "bool = true",  # world NED and body FRD; else ENU and FLU
        "gravity": "f64 m/s^2 in 1e-3.. = 9.80665",  # of the place
        "gyro_noise": "f64 rad/s/sqrt(Hz) in 0..",  # density
        "accelerometer_noise": "f64 m/s^2/sqrt(Hz) in 0..",  # density
        "gyro_walk": "f64 rad/s^2/sqrt(Hz) in 0..",  # of the bias; 0 with a first sigma of 0: not estimated
        "accelerometer_walk": "f64 m/s^3/sqrt(Hz) in 0..",  # of the bias, likewise
        "align_time": "f64 s in 0.. = 1",  # at rest
        "align_rate": "f64 rad/s in 0.. = 0.1",  # a faster turn is no rest
        "acceleration_gate": "f64 in 0.. = 0.2",  # a larger deviation from gravity, relative, is no rest
        "align_heading": "bool = false",  # wait for a heading
        "first_tilt_sigma": "f64 rad in 0.. = 0.02",  # after the alignment; at rest beside the accelerometer's bias
        "first_heading_sigma": "f64 rad in 0.. = 0.2",  # without a heading
        "first_velocity_sigma": "f64[3] m/s in 0.. = 0.1",  # axes of the world
        "first_position_sigma": "f64[3] m in 0.. = 10",  # axes of the world
        "first_gyro_bias_sigma": "f64 rad/s in 0.. = 0.01",  # of each element
        "first_accelerometer_bias_sigma": "f64 m/s^2 in 0.. = 0.2",  # of each element
        "antenna_arm": "f64[3] m = 0",  # of position and velocity from the IMU, body axes
        "measured_position_sigma": "f64[3] m in 0.. = 0",  # 0: this element is not measured; so with the others
        "position_gate": "f64 in 0.. = 21.11",  # chi squared of 3 elements
        "measured_velocity_sigma": "f64[3] m/s in 0.. = 0",  # standard deviation
        "velocity_gate": "f64 in 0.. = 21.11",  # chi squared of 3 elements
        "measured_position_drift": "f64[3] m in 0.. = 0",  # standard deviation of b, axes of the world
        "measured_position_drift_time": "f64 s in 1e-3.. = 100",  # correlation time of b
        "measured_height_sigma": "f64 m in 0.. = 0",  # standard deviation
        "measured_height_walk": "f64 m/s/sqrt(Hz) in 0.. = 0",  # of its bias c; 0 with a first sigma of 0: not estimated
        "first_height_bias_sigma": "f64 m in 0.. = 0",  # of c
        "height_gate": "f64 in 0.. = 15.14",  # chi squared of 1
        "measured_heading_sigma": "f64 rad in 0.. = 0",  # standard deviation
        "heading_gate": "f64 in 0.. = 15.14",  # chi squared of 1
        "measured_range_sigma": "f64 m in 0.. = 0",  # standard deviation at range 0
        "measured_range_sigma_slope": "f64 in 0.. = 0",  # and what it grows by range
        "range_gate": "f64 in 0.. = 15.14",  # chi squared of 1
        "range_arm": "f64[3] m = 0",  # of the range finder from the IMU, body axes
        "range_beam": "f64[3] = 0",  # unit vector along the beam, body axes; 0: down the body's z axis
        "range_least_cosine": "f64 in 0..1 = 0.5",  # between beam and normal: beyond it the range is not used
        "measured_body_velocity_sigma": "f64[3] m/s in 0.. = 0",  # standard deviation
        "body_velocity_gate": "f64 in 0.. = 21.11",  # chi squared of 3 elements
        "body_velocity_arm": "f64[3] m = 0",  # of the point whose velocity it is, from the IMU, body axes
        "reset_after": "f64 s in 1e-3.. = 10",  # of rejections of an aid; 1e308: never
        "reset_count": "u32 in 1.. = 3",  # least rejections in a row before it
    }
    outputs = {
        "attitude": "f64[4]",  # quaternion w, x, y, z, body to world
        "velocity": "f64[3] m/s",  # of the IMU, axes of the world
        "position": "f64[3] m",  # of the IMU in the world
        "gyro_bias": "f64[3] rad/s",  # of the gyroscope
        "accelerometer_bias": "f64[3] m/s^2",  # of the accelerometer
        "position_drift": "f64[3] m",  # b: measured less true, axes of the world
        "height_bias": "f64 m",  # c: measured less true
        "rate": "f64[3] rad/s",  # body rates less bias, mean of the period
        "specific_force": "f64[3] m/s^2",  # body axes, less bias, mean of the period
        "linear_acceleration": "f64[3] m/s^2",  # axes of the world, without gravity
        "attitude_sigma": "f64[3] rad",  # standard deviation, about body axes
        "velocity_sigma": "f64[3] m/s",  # standard deviation
        "position_sigma": "f64[3] m",  # standard deviation
        "gyro_bias_sigma": "f64[3] rad/s",  # standard deviation
        "accelerometer_bias_sigma": "f64[3] m/s^2",  # standard deviation
        "position_drift_sigma": "f64[3] m",  # standard deviation
        "height_bias_sigma": "f64 m",  # standard deviation
        "position_innovation": "f64[3] m",  # of the last sample: measured less expected; so are the others
        "velocity_innovation": "f64[3] m/s",  # axes of the world
        "height_innovation": "f64 m",  # up
        "heading_innovation": "f64 rad",  # in [-pi, pi]
        "range_innovation": "f64 m",  # along the beam
        "body_velocity_innovation": "f64[3] m/s",  # body axes
        "innovation_squared": "f64[6]",  # innovation^T S^-1 innovation: position, velocity, height, heading, range, body
        "rejected": "bool[6]",  # the last sample of the aid, in this order
        "rejections": "u32[6]",  # how many since the start; wraps
        "resets": "u32[6]",  # how often an aid set what it measures; wraps
        "aid_age": "f64[6] s",  # since a sample of the aid was taken, or the first run
        "aligned": "bool",  # the filter runs
    }
    state = {
        "covariance": "f64[N][N]",  # of the errors
        "since": "f64 s",  # time since the sample before
        "rest": "f64 s",  # time at rest, with the sums over it:
        "turned": "f64[3] rad",
        "pushed": "f64[3] m/s",
        "heard": "bool",  # a heading, since it rests
        "heard_heading": "f64 rad",
        "rejecting": "f64[6] s",  # since the first rejection in a row
        "in_row": "u32[6]",  # rejections
    }

    def start(self):
        self.attitude[0] = 1.0

    def execute(self):
        if self.resumed:
            self.aligned = False
            self.rest = 0.0
            self.since = 0.0
        self.since += self.period
        for i in range(AIDS):
            self.aid_age[i] += self.period
        dt = self.since
        up = -1.0 if self.z_down else 1.0
        g = self.gravity
        rate = self.gyro + self.delta_angle / self.period
        force = self.acceleration + self.delta_velocity / self.period
        if not (all(isfinite(rate)) and all(isfinite(force))):
            self.health = "degraded"
            return
        x = zeros(X)
        x[0:4] = self.attitude
        x[4:7] = self.velocity
        x[7:10] = self.position
        x[10:13] = self.gyro_bias
        x[13:16] = self.accelerometer_bias
        x[16:19] = self.position_drift
        x[19] = self.height_bias
        p = self.covariance

        if self.aligned:
            turn = dt * (rate - self.gyro_bias)
            push = dt * (force - self.accelerometer_bias)
            x, f = integrated(x, turn, push, -up * g, dt)
            keep = exp(-dt / self.measured_position_drift_time)
            x[16:19] = keep * x[16:19]
            q = zeros(MOTION)
            q_aids = zeros(OF_AIDS)
            for i in range(3):
                q[i] = self.gyro_noise * self.gyro_noise * dt
                q[3 + i] = self.accelerometer_noise * self.accelerometer_noise * dt
                q[9 + i] = self.gyro_walk * self.gyro_walk * dt
                q[12 + i] = self.accelerometer_walk * self.accelerometer_walk * dt
                drift = self.measured_position_drift[i]
                q_aids[i] = drift * drift * (1.0 - keep * keep)
            q_aids[3] = self.measured_height_walk * self.measured_height_walk * dt
            p = predicted(p, f, q, [keep, keep, keep, 1.0], q_aids)
            if not sound(x, p):
                self.health = "degraded"
                return
            square = [-1.0, -1.0, -1.0, -1.0, -1.0, -1.0]  # below 0: not fresh
            taken = [False, False, False, False, False, False]
            late = zeros(AIDS)
            for i in range(AIDS):
                if self.rejected[i]:
                    self.rejecting[i] += dt
                    if self.rejecting[i] >= self.reset_after and self.in_row[i] >= self.reset_count:
                        late[i] = self.rejecting[i]

            if self.position_fresh:
                dcm = quat_to_dcm(x[0:4])
                h = zeros(3, N)
                h[:, 0:3] = -matmul(dcm, skew(self.antenna_arm))
                h[:, 6:9] = eye(3)
                h[:, 15:18] = eye(3)
                setting = zeros(N, 3)
                setting[6:9, :] = eye(3)
                difference = self.measured_position - x[7:10] - x[16:19] - matvec(dcm, self.antenna_arm)
                square[POSITION], taken[POSITION], difference, x, p = fused(
                    x, p, h, setting, self.measured_position_sigma, difference, self.position_gate, late[POSITION], g
                )
                if isfinite(square[POSITION]):
                    self.position_innovation = difference
            if self.velocity_fresh:
                dcm = quat_to_dcm(x[0:4])
                swing = cross3(rate - x[10:13], self.antenna_arm)
                h = zeros(3, N)
                h[:, 0:3] = -matmul(dcm, skew(swing))
                h[:, 3:6] = eye(3)
                h[:, 9:12] = matmul(dcm, skew(self.antenna_arm))
                setting = zeros(N, 3)
                setting[3:6, :] = eye(3)
                difference = self.measured_velocity - x[4:7] - matvec(dcm, swing)
                square[VELOCITY], taken[VELOCITY], difference, x, p = fused(
                    x, p, h, setting, self.measured_velocity_sigma, difference, self.velocity_gate, late[VELOCITY], g
                )
                if isfinite(square[VELOCITY]):
                    self.velocity_innovation = difference
            row = zeros(1, N)
            column = zeros(N, 1)
            if self.height_fresh:
                row[0, 8] = up
                row[0, 18] = 1.0
                column[8, 0] = up
                lacking = [self.measured_height - up * x[9] - x[19]]
                square[HEIGHT], taken[HEIGHT], lacking, x, p = fused(
                    x, p, row, column, [self.measured_height_sigma], lacking, self.height_gate, late[HEIGHT], g
                )
                if isfinite(square[HEIGHT]):
                    self.height_innovation = lacking[0]
            dcm = quat_to_dcm(x[0:4])
            level = dcm[0, 0] * dcm[0, 0] + dcm[1, 0] * dcm[1, 0]
            if self.heading_fresh and level > LEAST_LEVEL:
                row = zeros(1, N)
                row[0, 1] = dcm[2, 1] / level
                row[0, 2] = dcm[2, 2] / level
                column = zeros(N, 1)
                column[0:3, 0] = dcm[2]
                lacking = [wrap_angle(self.measured_heading - atan2(dcm[1, 0], dcm[0, 0]))]
                square[HEADING], taken[HEADING], lacking, x, p = fused(
                    x, p, row, column, [self.measured_heading_sigma], lacking, self.heading_gate, late[HEADING], g
                )
                if isfinite(square[HEADING]):
                    self.heading_innovation = lacking[0]
            dcm = quat_to_dcm(x[0:4])
            normal = self.ground_normal
            if norm(normal) == 0.0:
                normal = [0.0, 0.0, up]
            beam = self.range_beam
            if norm(beam) == 0.0:
                beam = [0.0, 0.0, -up]
            seen = matvec(transpose(dcm), normal)
            slope = dot(seen, beam)
            if self.range_fresh and not -slope <= self.range_least_cosine:
                away = normal[2] * up * self.ground - dot(normal, x[7:10]) - dot(seen, self.range_arm)
                expected = away / slope
                row = zeros(1, N)
                row[0, 0:3] = cross3(seen, self.range_arm + expected * beam) / slope
                row[0, 6:9] = -normal / slope
                column = zeros(N, 1)
                column[6:9, 0] = (-slope / dot(normal, normal)) * normal
                lacking = [self.measured_range - expected]
                sigma = self.measured_range_sigma + self.measured_range_sigma_slope * abs(self.measured_range)
                square[RANGE], taken[RANGE], lacking, x, p = fused(
                    x, p, row, column, [sigma], lacking, self.range_gate, late[RANGE], g
                )
                if isfinite(square[RANGE]):
                    self.range_innovation = lacking[0]
            if self.body_velocity_fresh:
                dcm = quat_to_dcm(x[0:4])
                ahead = matvec(transpose(dcm), x[4:7])
                h = zeros(3, N)
                h[:, 0:3] = skew(ahead)
                h[:, 3:6] = transpose(dcm)
                h[:, 9:12] = skew(self.body_velocity_arm)
                setting = zeros(N, 3)
                setting[3:6, :] = dcm
                swing = cross3(rate - x[10:13], self.body_velocity_arm)
                difference = self.measured_body_velocity - ahead - swing
                square[BODY_VELOCITY], taken[BODY_VELOCITY], difference, x, p = fused(
                    x,
                    p,
                    h,
                    setting,
                    self.measured_body_velocity_sigma,
                    difference,
                    self.body_velocity_gate,
                    late[BODY_VELOCITY],
                    g,
                )
                if isfinite(square[BODY_VELOCITY]):
                    self.body_velocity_innovation = difference

            gates = [
                self.position_gate,
                self.velocity_gate,
                self.height_gate,
                self.heading_gate,
                self.range_gate,
                self.body_velocity_gate,
            ]
            for i in range(AIDS):
                if isnan(square[i]):
                    self.health = "degraded"
                elif square[i] >= 0.0:
                    self.innovation_squared[i] = square[i]
                    self.rejected[i] = not taken[i]
                    self.in_row[i] = 0 if taken[i] else sat_add(self.in_row[i], 1)
                    if taken[i]:
                        self.rejecting[i] = 0.0
                        self.aid_age[i] = 0.0
                    if not square[i] < gates[i]:
                        if taken[i]:
                            self.resets[i] += 1
                        else:
                            self.rejections[i] += 1
        else:
            self.health = "degraded"
            given = norm(self.first_attitude)
            still = abs(norm(force) / g - 1.0) <= self.acceleration_gate and norm(rate) <= self.align_rate
            if self.rest == 0.0:
                self.turned = zeros(3)
                self.pushed = zeros(3)
                self.heard = False
            if still:
                self.rest += dt
                self.turned = self.turned + dt * rate
                self.pushed = self.pushed + dt * force
                if self.heading_fresh and isfinite(self.measured_heading) and self.measured_heading_sigma > 0.0:
                    self.heard = True
                    self.heard_heading = self.measured_heading
            else:
                self.rest = 0.0
            self.since = 0.0
            waits = self.rest < self.align_time or self.rest == 0.0 or self.align_heading and not self.heard
            if not isfinite(given) or waits and given == 0.0:
                return
            heading_sigma = self.first_heading_sigma
            if given > 0.0:
                x[0:4] = self.first_attitude / given
            else:
                x[10:13] = self.turned / self.rest
                mean = self.pushed / self.rest - self.accelerometer_bias
                roll = atan2(up * mean[1], up * mean[2])
                pitch = atan2(-up * mean[0], hypot(mean[1], mean[2]))
                heading = self.first_heading
                if self.heard:
                    heading = self.heard_heading
                    heading_sigma = self.measured_heading_sigma
                x[0:4] = quat_from_euler(roll, pitch, heading)
            x[4:7] = self.first_velocity
            x[7:10] = self.first_position
            x[16:19] = zeros(3)
            dcm = quat_to_dcm(x[0:4])
            lean = self.first_tilt_sigma * self.first_tilt_sigma
            spread = diag([lean, lean, heading_sigma * heading_sigma])
            p = zeros(N, N)
            p[0:3, 0:3] = symmetric_product(matmul(transpose(dcm), spread), dcm)
            for i in range(3):
                p[3 + i, 3 + i] = self.first_velocity_sigma[i] * self.first_velocity_sigma[i]
                p[6 + i, 6 + i] = self.first_position_sigma[i] * self.first_position_sigma[i]
                p[9 + i, 9 + i] = self.first_gyro_bias_sigma * self.first_gyro_bias_sigma
                p[12 + i, 12 + i] = self.first_accelerometer_bias_sigma * self.first_accelerometer_bias_sigma
                p[15 + i, 15 + i] = self.measured_position_drift[i] * self.measured_position_drift[i]
            p[18, 18] = self.first_height_bias_sigma * self.first_height_bias_sigma
            if not given > 0.0:
                tie = eye(N)
                tie[0:3, 12:15] = skew(dcm[2]) * (up / g)
                p = symmetric_product(matmul(tie, p), transpose(tie))
            if not (sound(x, p) and norm(x[0:4]) > 0.5):
                return
            self.aligned = True
            self.health = "nominal"
            for i in range(AIDS):
                self.rejected[i] = False
                self.rejecting[i] = 0.0
                self.in_row[i] = 0

        self.since = 0.0
        self.covariance = p
        self.attitude = x[0:4]
        self.velocity = x[4:7]
        self.position = x[7:10]
        self.gyro_bias = x[10:13]
        self.accelerometer_bias = x[13:16]
        self.position_drift = x[16:19]
        self.height_bias = x[19]
        self.rate = rate - self.gyro_bias
        self.specific_force = force - self.accelerometer_bias
        self.linear_acceleration = quat_rotate(self.attitude, self.specific_force) - [0.0, 0.0, up * g]
        for i in range(3):
            self.attitude_sigma[i] = sqrt(p[i, i])
            self.velocity_sigma[i] = sqrt(p[3 + i, 3 + i])
            self.position_sigma[i] = sqrt(p[6 + i, 6 + i])
            self.gyro_bias_sigma[i] = sqrt(p[9 + i, 9 + i])
            self.accelerometer_bias_sigma[i] = sqrt(p[12 + i, 12 + i])
            self.position_drift_sigma[i] = sqrt(p[15 + i, 15 + i])
        self.height_bias_sigma = sqrt(p[18, 18])
