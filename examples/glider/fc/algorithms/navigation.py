"""Attitude, velocity, height and wind from IMU, satellites, airspeed and pressure; the place beside them."""

from __future__ import annotations

from fcsl_builtins import (
    atan2,
    diag,
    eye,
    f64,
    hypot,
    isfinite,
    kf_gain,
    kf_predict_cov,
    kf_update_cov_joseph,
    matmul,
    matvec,
    max,
    norm,
    quat_conj,
    quat_from_euler,
    quat_rotate,
    quat_to_dcm,
    quat_to_euler,
    quat_turn,
    skew,
    sqrt,
    symmetric_product,
    transpose,
    zeros,
)

# Errors: angle 0 to 2 (body axes), velocity 3 (NED), gyro bias 6, accelerometer bias 9, wind 12 (north, east),
# height 14.
N = 15
HEIGHT = 14
REFUSED_S = 0.15  # s: an airspeed that the filter has refused for so long is not passed on
GATE = 25.0  # squared innovation over its variance: 6e-7 are beyond it


def corrected_by_one(p: f64[N][N], h: f64[1][N], variance: f64, innovation: f64) -> tuple[bool, f64[N], f64[N][N]]:
    """Whether the gate takes a scalar measurement, the errors that it shows, and the covariance after it."""
    s = symmetric_product(matmul(h, p), transpose(h))
    if not innovation * innovation < GATE * (s[0, 0] + variance):
        return False, zeros(N), p
    k = kf_gain(p, h, [[variance]])
    return True, matvec(k, [innovation]), kf_update_cov_joseph(p, k, h, [[variance]])


def transition(attitude: f64[4], delta_angle: f64[3], delta_velocity: f64[3], dt: f64) -> f64[N][N]:
    """How the errors go on in one step of the strapdown integration."""
    dcm = quat_to_dcm(attitude)
    lever = matmul(dcm, skew(delta_velocity))
    turn = skew(delta_angle)
    f = eye(N)
    f[HEIGHT, 5] = -dt
    for i in range(3):
        f[i, 6 + i] = -dt
        for j in range(3):
            f[i, j] -= turn[i, j]
            f[3 + i, j] = -lever[i, j]
            f[3 + i, 9 + j] = -dcm[i, j] * dt
    return f


class Navigation:
    """Error-state Kalman filter. Its nominal state is the strapdown integration:

        q' = q (x) exp(dtheta / 2),  v' = v + R(q) dv + g dt
        d/dt dtheta = -w x dtheta - dbg,  d/dt dv = -R (a x dtheta) - R dba,  height' = -v_down,  wind: a random walk

    | measured | expected | Hz |
    |---|---|---|
    | GNSS velocity | v | 5 |
    | airspeed | abs(v - wind) | 10 |
    | no sideslip | 0 = (R^T (v - wind)) . y | 10 |
    | pressure altitude | height | 25 |

    Wind is horizontal. No compass: airspeed and sideslip tell heading from course. Both count above `flying_speed`; a
    measured airspeed below it is refused in flight. At rest roll and pitch come from gravity; the heading is that of
    the winch. The place is an observer of first order behind velocity and GNSS. `airspeed` is the measured one, or
    that of the filter while the measured one is not valid or refused.
    """

    inputs = {
        "gyro": "f64[3] rad/s",
        "delta_angle": "f64[3] rad",
        "delta_velocity": "f64[3] m/s",
        "imu_valid": "bool",
        "gnss_position": "f64[3] m",
        "gnss_velocity": "f64[3] m/s",
        "gnss_fresh": "bool",
        "barometer_height": "f64 m",
        "barometer_fresh": "bool",
        "measured_airspeed": "f64 m/s",
        "airspeed_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "ready": "bool",
        "attitude": "f64[4]",  # body to NED
        "roll": "f64 rad",
        "pitch": "f64 rad",
        "yaw": "f64 rad",
        "rate": "f64[3] rad/s",
        "velocity": "f64[3] m/s",
        "course": "f64 rad",
        "ground_speed": "f64 m/s",
        "wind": "f64[2] m/s",
        "airspeed": "f64 m/s",
        "position": "f64[3] m",
        "height": "f64 m",  # above the place of the start
        "gyro_bias": "f64[3] rad/s",
        "accelerometer_bias": "f64[3] m/s^2",
        "specific_force": "f64[3] m/s^2",
        "attitude_sigma": "f64[3] rad",  # body axes
        "velocity_sigma": "f64[3] m/s",
        "wind_sigma": "f64[2] m/s",
        "gnss_age": "f64 s",  # since it was used
        "airspeed_age": "f64 s",  # since the gate took it, or it was too slow to count
    }
    parameters = {
        "gravity": "f64 m/s^2",
        "launch_heading": "f64 rad",
        "rest_s": "f64 s in 0.1..",
        "flying_speed": "f64 m/s",
        "gyro_noise": "f64 rad/s/sqrt(Hz) in 0..",
        "gyro_walk": "f64 rad/s^2/sqrt(Hz) in 0..",
        "accelerometer_noise": "f64 m/s^2/sqrt(Hz) in 0..",
        "accelerometer_walk": "f64 m/s^3/sqrt(Hz) in 0..",
        "wind_walk": "f64 m/s^2/sqrt(Hz) in 0..",
        "velocity_white": "f64[3] m/s in 0..",
        "airspeed_white": "f64 m/s in 0..",
        "sideslip_white": "f64 m/s in 0..",
        "first_sigma": "f64[15] in 0..",
        "air_ticks": "u32 in 1..",  # between two corrections by the air
        "height_white": "f64 m in 0..",
        "height_walk": "f64 m/sqrt(s) in 0..",
        "position_gain": "f64 in 0..1",
    }
    state = {
        "P": "f64[15][15]",
        "rest": "f64 s",
        "angle_sum": "f64[3] rad",
        "velocity_sum": "f64[3] m/s",
        "ground_height": "f64 m",  # the mean at rest
        "heights": "f64",  # how many it is the mean of
        "heard": "bool",
        "air_tick": "u32",
    }

    def start(self):
        self.attitude = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        self.gnss_age += self.dt
        self.airspeed_age += self.dt
        if not self.imu_valid:
            self.health = "failed"
        elif not self.ready:
            # ---- at rest: tilt from gravity, bias of the gyroscope from the mean rate
            self.rest += self.dt
            self.angle_sum = self.angle_sum + self.delta_angle
            self.velocity_sum = self.velocity_sum + self.delta_velocity
            if self.gnss_fresh:
                self.position = self.gnss_position
                self.heard = True
            if self.barometer_fresh and isfinite(self.barometer_height):
                self.heights += 1.0
                self.ground_height += (self.barometer_height - self.ground_height) / self.heights
            up = self.velocity_sum
            if norm(up) > 0.0:
                roll, pitch = atan2(-up[1], -up[2]), atan2(up[0], hypot(up[1], up[2]))
                self.attitude = quat_from_euler(roll, pitch, self.launch_heading)
            self.gyro_bias = self.angle_sum / self.rest
            self.airspeed_age = 0.0
            if self.rest > self.rest_s and self.heard and self.heights > 0.0:
                self.P = diag(self.first_sigma)
                for i in range(N):
                    self.P[i, i] *= self.first_sigma[i]
                self.ready = True
            self.health = "degraded"
        else:
            # ---- prediction
            angle = self.delta_angle - self.gyro_bias * self.dt
            push = self.delta_velocity - self.accelerometer_bias * self.dt
            f = transition(self.attitude, angle, push, self.dt)
            before = self.velocity
            self.velocity = before + quat_rotate(quat_turn(self.attitude, 0.5 * angle), push)
            self.velocity[2] += self.gravity * self.dt
            self.attitude = quat_turn(self.attitude, angle)
            self.position = self.position + (before + self.velocity) * (0.5 * self.dt)
            self.height -= 0.5 * (before[2] + self.velocity[2]) * self.dt
            q = zeros(N)
            for i in range(3):
                q[i] = self.gyro_noise * self.gyro_noise * self.dt
                q[3 + i] = self.accelerometer_noise * self.accelerometer_noise * self.dt
                q[6 + i] = self.gyro_walk * self.gyro_walk * self.dt
                q[9 + i] = self.accelerometer_walk * self.accelerometer_walk * self.dt
            q[12] = self.wind_walk * self.wind_walk * self.dt
            q[13] = q[12]
            q[HEIGHT] = self.height_walk * self.height_walk * self.dt
            self.P = kf_predict_cov(f, self.P, diag(q))

            # ---- corrections: each is compared with what the ones before it have found
            error = zeros(N)
            whole = self.gnss_fresh
            for i in range(3):
                whole = whole and isfinite(self.gnss_position[i]) and isfinite(self.gnss_velocity[i])
            if whole:
                near = True
                for i in range(3):
                    h = zeros(1, N)
                    h[0, 3 + i] = 1.0
                    variance = self.velocity_white[i] * self.velocity_white[i]
                    lacking = self.gnss_velocity[i] - self.velocity[i] - error[3 + i]
                    taken, found, p = corrected_by_one(self.P, h, variance, lacking)
                    near = near and taken
                    error = error + found
                    self.P = p
                if near:
                    self.position = self.position + (self.gnss_position - self.position) * self.position_gain
                    self.gnss_age = 0.0
            if self.barometer_fresh and isfinite(self.barometer_height):
                h = zeros(1, N)
                h[0, HEIGHT] = 1.0
                lacking = self.barometer_height - self.ground_height - self.height - error[HEIGHT]
                variance = self.height_white * self.height_white
                _taken, found, p = corrected_by_one(self.P, h, variance, lacking)
                error = error + found
                self.P = p
            air = self.velocity - [self.wind[0], self.wind[1], 0.0]
            flying = norm(air) > self.flying_speed and norm(self.velocity) > 0.5 * self.flying_speed
            self.air_tick = self.air_tick + 1 if self.air_tick < self.air_ticks else 1
            if not flying:
                self.airspeed_age = 0.0
            elif self.air_tick == self.air_ticks:
                if self.airspeed_valid and self.measured_airspeed > self.flying_speed:
                    h = zeros(1, N)
                    way = air / norm(air)
                    for i in range(3):
                        h[0, 3 + i] = way[i]
                    h[0, 12] = -way[0]
                    h[0, 13] = -way[1]
                    lacking = self.measured_airspeed - norm(air) - matvec(h, error)[0]
                    variance = self.airspeed_white * self.airspeed_white
                    taken, found, p = corrected_by_one(self.P, h, variance, lacking)
                    error = error + found
                    self.P = p
                    if taken:
                        self.airspeed_age = 0.0
                dcm = quat_to_dcm(self.attitude)
                body = quat_rotate(quat_conj(self.attitude), air)
                lean = skew(body)
                h = zeros(1, N)
                for i in range(3):
                    h[0, i] = lean[1, i]
                    h[0, 3 + i] = dcm[i, 1]
                h[0, 12] = -dcm[0, 1]
                h[0, 13] = -dcm[1, 1]
                lacking = -body[1] - matvec(h, error)[0]
                _taken, found, p = corrected_by_one(self.P, h, self.sideslip_white * self.sideslip_white, lacking)
                error = error + found
                self.P = p
            self.attitude = quat_turn(self.attitude, error[0:3])
            self.velocity = self.velocity + error[3:6]
            self.gyro_bias = self.gyro_bias + error[6:9]
            self.accelerometer_bias = self.accelerometer_bias + error[9:12]
            self.wind = self.wind + error[12:14]
            self.height += error[HEIGHT]

        # ---- what it reports
        self.roll, self.pitch, self.yaw = quat_to_euler(self.attitude)
        self.rate = self.gyro - self.gyro_bias
        self.specific_force = self.delta_velocity / self.dt - self.accelerometer_bias
        self.ground_speed = hypot(self.velocity[0], self.velocity[1])
        self.course = atan2(self.velocity[1], self.velocity[0]) if self.ground_speed > 2.0 else self.yaw
        modelled = norm(self.velocity - [self.wind[0], self.wind[1], 0.0])
        self.airspeed = self.measured_airspeed if self.airspeed_valid and self.airspeed_age < REFUSED_S else modelled
        for i in range(3):
            self.attitude_sigma[i] = sqrt(max(self.P[i, i], 0.0))
            self.velocity_sigma[i] = sqrt(max(self.P[3 + i, 3 + i], 0.0))
        self.wind_sigma = [sqrt(max(self.P[12, 12], 0.0)), sqrt(max(self.P[13, 13], 0.0))]
