from fcsl_builtins import isfinite, norm


class Stillness:
    """Whether the vehicle stands still, and what the sensors measure then.

    Means are first-order low-passes with time constant `mean_s`. The vehicle is still when no sample of the last
    `still_s` was further from the mean than the limits.
    """

    inputs = {"gyro": "f64[3] rad/s", "accel": "f64[3] m/s^2", "dt": "f64 s"}
    outputs = {
        "still": "bool",
        "gyro_mean": "f64[3] rad/s",  # the bias while it stands still
        "accel_mean": "f64[3] m/s^2",
    }
    parameters = {
        "gyro_limit": "f64 rad/s in 0..",
        "accel_limit": "f64 m/s^2 in 0..",
        "mean_s": "f64 s in 0.01..",
        "still_s": "f64 s in 0..",
    }
    state = {
        "started": "bool",  # whether there are means
        "calm_for": "f64 s",
    }

    def execute(self):
        if not self.started:
            self.gyro_mean = self.gyro
            self.accel_mean = self.accel
        turn = norm(self.gyro - self.gyro_mean)
        shake = norm(self.accel - self.accel_mean)
        share = min(1.0, self.dt / self.mean_s)
        self.gyro_mean += (self.gyro - self.gyro_mean) * share
        self.accel_mean += (self.accel - self.accel_mean) * share
        self.started = isfinite(turn) and isfinite(shake)
        calm = turn < self.gyro_limit and shake < self.accel_limit
        self.calm_for = self.calm_for + self.dt if calm else 0.0
        self.still = self.calm_for >= self.still_s
