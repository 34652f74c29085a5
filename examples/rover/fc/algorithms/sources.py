from fcsl_builtins import isfinite


class Operator:
    """Owns the wishes of who drives: they come from `cmd_vel`. What is no number counts as none."""

    outputs = {"speed": "f64 m/s", "yaw_rate": "f64 rad/s"}  # channels write them

    def execute(self):
        if not (isfinite(self.speed) and isfinite(self.yaw_rate)):
            self.health = "failed"


class Switches:
    """Owns what the operator switches: 0 stop, 1 by hand, 2 along the route; and the emergency stop."""

    outputs = {"mode": "i32", "stop": "bool"}  # channels write them

    def execute(self):
        pass


class Wheels:
    """Owns the encoders: angles that grow forward."""

    outputs = {"left": "f64 rad", "right": "f64 rad"}

    def execute(self):
        pass
