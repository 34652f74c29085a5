from fcsl_builtins import f64


class Script:
    """Drives by hand from hand_s on, along the route from route_s to again_s, by hand until rest_s. The emergency stop is
    pressed from stop_s to release_s."""

    inputs = {"time_ns": "i64 ns"}
    parameters = {
        "hand_s": "f64 s",
        "route_s": "f64 s",
        "again_s": "f64 s",
        "stop_s": "f64 s",
        "release_s": "f64 s",
        "rest_s": "f64 s",
        "hand_speed": "f64 m/s",
        "hand_yaw_rate": "f64 rad/s",
    }
    outputs = {"speed": "f64 m/s", "yaw_rate": "f64 rad/s", "mode": "i32", "stop": "bool"}

    def execute(self):
        t = f64(self.time_ns) * 1e-9
        drives = t >= self.hand_s and t < self.rest_s
        along = t >= self.route_s and t < self.again_s
        self.mode = 0
        if drives:
            self.mode = 2 if along else 1
        self.speed = self.hand_speed if drives else 0.0
        self.yaw_rate = self.hand_yaw_rate if drives else 0.0
        self.stop = t >= self.stop_s and t < self.release_s
