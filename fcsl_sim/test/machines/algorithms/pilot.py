class Pilot:
    """Full throttle until a sampled altitude is above 20 m; then a throttle along a velocity profile."""

    inputs = {"fresh": "bool"}
    outputs = {
        "pos_z": "f64 m",  # sampled
        "vel_z": "f64 m/s",  # sampled
        "throttle": "f64",
        "samples": "u64",  # altitudes received
        "transition_request": "TransitionRequest",
    }
    state = {"turned": "bool"}

    def execute(self):
        if self.fresh:
            self.samples += 1
        if self.turned:
            target = -(0.5 + 0.25 * max(self.pos_z, 0.0))
            self.throttle = clamp(0.4 + 0.5 * (target - self.vel_z), 0.0, 1.0)
        else:
            self.throttle = 1.0
            self.turned = self.pos_z > 20.0
        self.transition_request = "TURN" if self.turned else ""
