from fcsl_builtins import clamp, norm, quat_normalize


class ThrustVector:
    """From an acceleration to a thrust and the attitude that points it there, the shortest way from upright."""

    inputs = {"accel": "f64[3]"}
    outputs = {"thrust": "f64", "q": "f64[4]"}
    parameters = {"hover": "f64"}  # thrust that is the weight

    def execute(self):
        force = self.accel + [0.0, 0.0, 9.80665]
        size = norm(force)
        self.thrust = clamp(self.hover * size / 9.80665, 0.0, 1.0)
        if size > 0.1:
            d = force / size
            self.q = quat_normalize([1.0 + d[2], -d[1], d[0], 0.0])
        else:
            self.q = [1.0, 0.0, 0.0, 0.0]
