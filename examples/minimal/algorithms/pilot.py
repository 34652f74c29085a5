from fcsl_builtins import clamp


class Pilot:
    """Proportional-derivative law that holds a pendulum upright.

    force = -gain theta - thetadot, within the actuator's limit
    """

    inputs = {
        "theta": "f64 rad",  # angle from upright
        "thetadot": "f64 rad/s",  # its rate
    }
    outputs = {"force": "f64 N"}  # on the cart, positive to the right
    parameters = {"gain": "f64 N/rad", "limit": "f64 N"}

    def execute(self):
        self.force = clamp(-self.gain * self.theta - self.thetadot, -self.limit, self.limit)
