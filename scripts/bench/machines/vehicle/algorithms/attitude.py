from fcsl_builtins import cross3, norm, quat_conj, quat_mul, quat_normalize, quat_rotate

UP = [0.0, 0.0, 1.0]


class Attitude:
    """Attitude by Mahony's explicit complementary filter.

    The gyro is integrated to first order, the accelerometer levels it.
    """

    inputs = {"gyro": "f64[3]", "specific_force": "f64[3]", "dt": "f64 s"}
    outputs = {
        "q": "f64[4]",  # body to world
        "rate": "f64[3]",
        "accel": "f64[3]",  # without gravity, world axes
    }
    parameters = {"kp": "f64 1/s", "ki": "f64 1/s^2"}
    state = {"bias": "f64[3]"}

    def start(self):
        self.q = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        size = norm(self.specific_force)
        self.rate = self.gyro - self.bias
        turn = self.rate
        if size > 1.0:
            error = cross3(self.specific_force / size, quat_rotate(quat_conj(self.q), UP))
            self.bias = self.bias - error * (self.ki * self.dt)
            turn = turn + error * self.kp
        h = 0.5 * self.dt
        dq = quat_mul(self.q, [0.0, turn[0], turn[1], turn[2]])
        self.q = quat_normalize(self.q + h * dq)
        self.accel = quat_rotate(self.q, self.specific_force)
        self.accel[2] = self.accel[2] - 9.80665
