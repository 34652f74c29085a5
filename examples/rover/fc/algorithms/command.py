from fcsl_builtins import abs, max, min, sqrt


class Command:
    """Owns the speeds that the rover shall have: by hand, along the route, or none.

    Along the route: v = min(cruise, sqrt(2 deceleration remaining), sqrt(turn_acceleration / |curvature|)), w = curvature v,
    so that it stops at the end and turns without skidding. While `mode` faults, it wants none: what that says is old.
    """

    inputs = {
        "mode": "Health",
        "by_hand": "bool",
        "speed_by_hand": "f64 m/s",
        "yaw_rate_by_hand": "f64 rad/s",
        "follow": "Health",  # stale: it does not run
        "curvature": "f64 1/m",
        "remaining": "f64 m",
    }
    parameters = {
        "cruise": "f64 m/s in 0..",
        "deceleration": "f64 m/s^2 in 0..",
        "turn_acceleration": "f64 m/s^2 in 0..",  # across the way
    }
    outputs = {"speed": "f64 m/s", "yaw_rate": "f64 rad/s"}

    def execute(self):
        self.speed = 0.0
        self.yaw_rate = 0.0
        if self.mode == "failed":
            return
        if self.follow == "nominal":
            to_end = sqrt(2.0 * self.deceleration * max(0.0, self.remaining))
            in_turn = sqrt(self.turn_acceleration / max(abs(self.curvature), 1e-3))
            self.speed = min(self.cruise, to_end, in_turn)
            self.yaw_rate = self.curvature * self.speed
        elif self.by_hand:
            self.speed = self.speed_by_hand
            self.yaw_rate = self.yaw_rate_by_hand
