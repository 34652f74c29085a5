from fcsl_builtins import clamp


class Ascent:
    """Powered climb at a constant rate, up to engine cut-off at the target altitude.

    The throttle follows the estimated velocity. Cut-off is decided on the altimeter itself: it happens in the very
    tick that reads past the target, whatever the estimator has seen before. Altimeter noise makes it up to two
    sigma early, and the coast that follows carries the vehicle far beyond.
    """

    inputs = {
        "altimeter": "f64 m",  # measured altitude
        "altimeter_valid": "bool",
        "vel_z": "f64 m/s",  # estimated velocity
    }
    outputs = {
        "throttle": "f64",  # 0 to 1
        "transition_request": "TransitionRequest",
    }
    parameters = {
        "target_altitude": "f64 m",
        "climb_rate": "f64 m/s",
        "gain": "f64 1/s",  # acceleration asked for each m/s of error
        "gravity": "f64 m/s^2",
        "hover_throttle": "f64",  # throttle whose thrust is the vehicle's weight
    }

    def execute(self):
        acceleration = self.gain * (self.climb_rate - self.vel_z)
        self.throttle = clamp(self.hover_throttle * (1.0 + acceleration / self.gravity), 0.0, 1.0)
        if self.altimeter_valid and self.altimeter >= self.target_altitude:
            self.throttle = 0.0
            self.transition_request = "START_COAST"
