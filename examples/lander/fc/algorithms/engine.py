from fcsl_builtins import Health, max

G0 = 9.80665  # standard gravity, m/s^2: part of the definition of specific impulse


def commands(law: Health) -> bool:
    """Whether it has made its outputs. After a fault it has not: they are old ones, and the last command stays."""
    return law == "nominal" or law == "degraded"


class Engine:
    """The engine as the flight computer sees it: obeys the controller that flies, and expects an effect of that.

    A controller flies when the active state runs it; the others are stale, and their last throttle is history. With
    none of them the engine is off. It is armed until the vehicle has landed. The expected effect follows from thrust and propellant:

        thrust = throttle max_thrust,    a = thrust / mass - gravity,    mass' = -thrust / (specific_impulse g0)
    """

    inputs = {
        "ascent_health": "Health",
        "ascent_throttle": "f64",
        "descent_health": "Health",
        "descent_throttle": "f64",
        "descent_landed": "bool",
        "safe_health": "Health",
        "safe_throttle": "f64",
        "safe_landed": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "throttle": "f64",  # to the valve, 0 to 1
        "acceleration": "f64 m/s^2",  # expected until the next tick, positive upward
        "mass": "f64 kg",  # expected at the next tick
        "landed": "bool",  # the vehicle stands on the ground, engine off
        "armed": "bool",  # the valve may open
    }
    parameters = {
        "max_thrust": "f64 N",
        "specific_impulse": "f64 s",
        "wet_mass": "f64 kg",  # at launch
        "dry_mass": "f64 kg",
        "gravity": "f64 m/s^2",
    }

    def start(self):
        self.mass = self.wet_mass

    def execute(self):
        if commands(self.ascent_health):
            self.throttle = self.ascent_throttle
            self.landed = False
        elif commands(self.descent_health):
            self.throttle = self.descent_throttle
            self.landed = self.descent_landed
        elif commands(self.safe_health):
            self.throttle = self.safe_throttle
            self.landed = self.safe_landed
        elif self.ascent_health == "stale" and self.descent_health == "stale" and self.safe_health == "stale":
            self.throttle = 0.0
            self.landed = False
        self.armed = not self.landed
        thrust = self.throttle * self.max_thrust
        self.acceleration = thrust / self.mass - self.gravity
        self.mass = max(self.mass - thrust / (self.specific_impulse * G0) * self.dt, self.dry_mass)
