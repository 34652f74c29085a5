"""What watches cart and pole, what starts them, and what leads back from SAFE."""

from fcsl_builtins import Health, abs, clamp, isfinite


class Monitor:
    """Fails without an encoder, and where the cart comes near an end of its rail. Asks for a stop when the operator
    does, or when nothing is heard of him.

    An encoder of the pole that is stuck gives samples like any other. It is known by two things together: its count
    stands, and the innovations of the filter have a trend, since the model says that the pole must move. A pole that is
    hit makes a trend, too, but its count runs.

    The cart is near when it is beyond `end_limit`, or would be within `look_ahead` at its present speed.
    """

    inputs = {
        "cart_valid": "bool",
        "pole_valid": "bool",
        "run": "bool",
        "run_valid": "bool",
        "position": "f64 m",
        "speed": "f64 m/s",
        "pole_still": "f64 s",
        "trend": "f64",  # of the innovations of the angle
    }
    outputs = {"near_end": "bool", "transition_request": "TransitionRequest"}
    parameters = {
        "end_limit": "f64 m in 0..",
        "look_ahead": "f64 s in 0..",
        "still_s": "f64 s in 0..",
        "trend_limit": "f64 in 0..",
    }

    def execute(self):
        ahead = abs(self.position + self.look_ahead * self.speed)
        self.near_end = abs(self.position) > self.end_limit or ahead > self.end_limit
        stuck = abs(self.trend) > self.trend_limit and self.pole_still > self.still_s
        if not (self.cart_valid and self.pole_valid) or stuck or self.near_end:
            self.health = "failed"
        elif not (self.run and self.run_valid):
            self.transition_request = "STOP"


class Standby:
    """Waits, without force, for the operator, for a cart not too far from the middle, and for known rates."""

    inputs = {
        "run": "bool",
        "run_valid": "bool",
        "ready": "bool",
        "monitor_health": "Health",
        "position": "f64 m",
    }
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"start_limit": "f64 m in 0.."}

    def execute(self):
        wanted = self.run and self.run_valid and self.ready and self.monitor_health == "nominal"
        if wanted and abs(self.position) < self.start_limit:
            self.transition_request = "SWING_UP"


class Safe:
    """No force. Back to STANDBY when the operator has let go and nothing is wrong for `rest_s`."""

    inputs = {"run": "bool", "monitor_health": "Health", "resumed": "bool", "dt": "f64 s"}
    outputs = {"transition_request": "TransitionRequest"}
    parameters = {"rest_s": "f64 s in 0.."}
    state = {"rested": "f64 s"}

    def execute(self):
        if self.resumed:
            self.rested = 0.0
        self.rested = 0.0 if self.run or self.monitor_health != "nominal" else self.rested + self.dt
        if self.rested > self.rest_s:
            self.transition_request = "STANDBY"


def acts(health: Health) -> bool:
    """The controller runs in this state."""
    return health == "nominal" or health == "degraded"


class Motor:
    """Owns the motor: the force of the controller that runs, within the limit.

    Armed only while one runs and the monitor is content: the force ends in the tick that sees a failure, one before
    the first of SAFE.
    """

    inputs = {
        "monitor_health": "Health",
        "swing_up_health": "Health",
        "swing_up_force": "f64 N",
        "balance_health": "Health",
        "balance_force": "f64 N",
    }
    outputs = {"force": "f64 N", "armed": "bool"}
    parameters = {"force_limit": "f64 N in 0.."}

    def execute(self):
        self.force = 0.0
        self.armed = False
        if self.monitor_health != "failed":
            if acts(self.swing_up_health):
                self.force = clamp(self.swing_up_force, -self.force_limit, self.force_limit)
                self.armed = True
            elif acts(self.balance_health):
                self.force = clamp(self.balance_force, -self.force_limit, self.force_limit)
                self.armed = True
        if not isfinite(self.force):
            self.force = 0.0
            self.armed = False
