from fcsl_builtins import Health, exp, quat_to_euler, zeros


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Reference:
    """The path that is flown: a filter of third order behind the target of the state that flies.

        p''' = l^3 (target - p) - 3 l^2 p' - 3 l p''

    Its three poles are at -l. A target that steps makes a step of the third derivative alone, so position, velocity
    and acceleration are continuous through every change of state. It begins where the vehicle is. Each step is
    the exact response to a target that stays for the step, p = target + (c0 + c1 t + c2 t^2) exp(-l t).
    """

    inputs = {
        "take_off_health": "Health",
        "take_off_target": "f64[3] m",
        "take_off_spool": "f64",
        "hold_health": "Health",
        "hold_target": "f64[3] m",
        "mission_health": "Health",
        "mission_target": "f64[3] m",
        "mission_over": "bool",
        "land_health": "Health",
        "land_target": "f64[3] m",
        "here": "f64[3] m",  # where the vehicle is
        "attitude": "f64[4]",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "target": "f64[3] m",
        "position": "f64[3] m",
        "velocity": "f64[3] m/s",
        "acceleration": "f64[3] m/s^2",
        "yaw": "f64 rad",
        "spool": "f64",  # share of the thrust that is let through
        "mission_done": "bool",
    }
    parameters = {"pole": "f64 1/s in 0.1.."}

    def execute(self):
        if self.resumed:
            self.target = self.here
            self.position = self.here
            self.velocity = zeros(3)
            self.acceleration = zeros(3)
            self.yaw = quat_to_euler(self.attitude)[2]
        if commands(self.take_off_health):
            self.spool = self.take_off_spool
            self.target = self.take_off_target
        elif commands(self.hold_health):
            self.target = self.hold_target
        elif commands(self.mission_health):
            self.target = self.mission_target
            self.mission_done = self.mission_over
        elif commands(self.land_health):
            self.target = self.land_target
        left = exp(-self.pole * self.dt)
        c0 = self.position - self.target
        c1 = self.velocity + c0 * self.pole
        c2 = (self.acceleration + self.velocity * (2.0 * self.pole) + c0 * (self.pole * self.pole)) * 0.5
        shape = c0 + c1 * self.dt + c2 * (self.dt * self.dt)
        slope = c1 + c2 * (2.0 * self.dt)
        self.position = self.target + shape * left
        self.velocity = (slope - shape * self.pole) * left
        self.acceleration = (c2 * 2.0 - slope * (2.0 * self.pole) + shape * (self.pole * self.pole)) * left
