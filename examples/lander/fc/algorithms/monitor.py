from fcsl_builtins import isfinite


class Monitor:
    """Fault monitor: decides which sensor samples may be used, and fails when a sensor stays unusable.

    A sample is usable when the sensor block is healthy (the host fails it when a channel's samples stop coming) and
    the value is a number within the instrument's measuring range. An unusable sample is passed over at once; a
    sensor without a usable sample for longer than `patience` fails the monitor, and with it the machine goes to
    SAFE. A step in altitude is no fault.
    """

    inputs = {
        "pos_z": "f64 m",  # measured
        "vel_z": "f64 m/s",
        "sensors_health": "Health",
        "dt": "f64 s",
    }
    outputs = {
        "pos_valid": "bool",  # this tick's altitude may be used
        "vel_valid": "bool",  # this tick's velocity may be used
    }
    parameters = {
        "min_altitude": "f64 m",  # measuring range of the altimeter
        "max_altitude": "f64 m",
        "max_speed": "f64 m/s",  # measuring range of the velocimeter, either direction
        "patience": "f64 s",
    }
    state = {
        "pos_lost": "f64 s",  # time without a usable altitude
        "vel_lost": "f64 s",  # time without a usable velocity
    }

    def execute(self):
        alive = self.sensors_health != "failed"
        self.pos_valid = alive and isfinite(self.pos_z) and self.min_altitude <= self.pos_z <= self.max_altitude
        self.vel_valid = alive and isfinite(self.vel_z) and -self.max_speed <= self.vel_z <= self.max_speed
        self.pos_lost = 0.0 if self.pos_valid else self.pos_lost + self.dt
        self.vel_lost = 0.0 if self.vel_valid else self.vel_lost + self.dt
        if self.pos_lost > self.patience or self.vel_lost > self.patience:
            self.health = "failed"
        elif not (self.pos_valid and self.vel_valid):
            self.health = "degraded"
