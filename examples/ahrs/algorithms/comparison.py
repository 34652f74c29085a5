from fcsl_builtins import atan2, cross3, dot, norm, quat_conj, quat_rotate, sqrt

UP = [0.0, 0.0, 1.0]


class Comparison:
    """How far two attitudes disagree in tilt: the angle between what each takes for up. Yaw does not enter.

    With up = R^T [0, 0, 1] of each, the angle is atan2(|up1 x up2|, up1 . up2), exact for small angles too.
    """

    inputs = {
        "orientation": "f64[4]",  # unit quaternions w, x, y, z, body to world
        "reference": "f64[4]",  # zero while there is none
    }
    outputs = {
        "tilt_error": "f64 rad",
        "tilt_error_rms": "f64 rad",  # since the first reference
    }
    state = {
        "squares": "f64 rad^2",  # sum over the ticks compared
        "ticks": "f64",
    }

    def execute(self):
        if norm(self.reference) > 0.5:
            up = quat_rotate(quat_conj(self.orientation), UP)
            up_reference = quat_rotate(quat_conj(self.reference), UP)
            self.tilt_error = atan2(norm(cross3(up, up_reference)), dot(up, up_reference))
            self.squares += self.tilt_error * self.tilt_error
            self.ticks += 1.0
            self.tilt_error_rms = sqrt(self.squares / self.ticks)
        else:
            self.health = "degraded"
