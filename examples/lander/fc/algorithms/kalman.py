from fcsl_builtins import kf_gain, kf_predict_cov, kf_predict_state, kf_update_cov_joseph, kf_update_state, sqrt

H_POS = [[1.0, 0.0]]
H_VEL = [[0.0, 1.0]]


class Kalman:
    """Kalman filter of altitude z and vertical velocity v.

    Prediction over one tick with the acceleration a that `engine` expects of the thrust it commanded:

        z' = z + v dt + a dt^2 / 2,    v' = v + a dt,    Q = accel_sigma^2 g g',  g = [dt^2 / 2, dt]

    where `accel_sigma` stands for what that expectation misses (thrust, mass and valve errors). Each usable sample
    is then taken as a scalar measurement, covariances in Joseph's form. Without samples the prediction goes on
    alone (dead reckoning), which the filter reports as degraded. On the ground the velocity is known to be zero.

    Source: Bar-Shalom, Li, Kirubarajan, Estimation with Applications to Tracking and Navigation, Wiley 2001,
    sections 5.2 (filter) and 6.3.2 (piecewise constant white acceleration).
    """

    inputs = {
        "altimeter": "f64 m",  # measured
        "velocimeter": "f64 m/s",
        "pos_valid": "bool",
        "vel_valid": "bool",
        "acceleration": "f64 m/s^2",  # expected since the last tick, gravity included
        "landed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "pos_z": "f64 m",  # estimates
        "vel_z": "f64 m/s",
        "pos_sigma": "f64 m",  # their standard deviations, as the filter sees them
        "vel_sigma": "f64 m/s",
    }
    parameters = {
        "altimeter_sigma": "f64 m",  # standard deviations of the sensors
        "velocimeter_sigma": "f64 m/s",
        "accel_sigma": "f64 m/s^2",  # of the error of `acceleration`, one draw each tick
    }
    state = {
        "initialised": "bool",
        "x": "f64[2]",  # z in m, v in m/s
        "P": "f64[2][2]",  # their covariance
    }

    def execute(self):
        R_pos = [[self.altimeter_sigma * self.altimeter_sigma]]
        R_vel = [[self.velocimeter_sigma * self.velocimeter_sigma]]
        if not self.initialised:
            self.initialised = self.pos_valid and self.vel_valid
            if self.initialised:
                self.x = [self.altimeter, self.velocimeter]
                self.P = [[R_pos[0, 0], 0.0], [0.0, R_vel[0, 0]]]
        else:
            F = [[1.0, self.dt], [0.0, 1.0]]
            g = [self.dt * self.dt / 2.0, self.dt]
            q = self.accel_sigma * self.accel_sigma
            Q = [[q * g[0] * g[0], q * g[0] * g[1]], [q * g[1] * g[0], q * g[1] * g[1]]]
            self.x = kf_predict_state(F, self.x)
            if self.landed:
                self.x[1] = 0.0
            else:
                self.x = self.x + g * self.acceleration
            self.P = kf_predict_cov(F, self.P, Q)
            if self.pos_valid:
                K = kf_gain(self.P, H_POS, R_pos)
                self.x = kf_update_state(self.x, K, [self.altimeter], H_POS)
                self.P = kf_update_cov_joseph(self.P, K, H_POS, R_pos)
            if self.vel_valid:
                K = kf_gain(self.P, H_VEL, R_vel)
                self.x = kf_update_state(self.x, K, [self.velocimeter], H_VEL)
                self.P = kf_update_cov_joseph(self.P, K, H_VEL, R_vel)
        if not (self.pos_valid and self.vel_valid):
            self.health = "degraded"
        self.pos_z = self.x[0]
        self.vel_z = self.x[1]
        self.pos_sigma = sqrt(self.P[0, 0])
        self.vel_sigma = sqrt(self.P[1, 1])
