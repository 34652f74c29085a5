"""The encoders and the operator: source blocks, whose outputs channels write; and the check of an encoder."""

from fcsl_builtins import abs, isfinite, min

FOREVER = 1000.0  # s


class Cart:
    """The encoder at the drive of the cart, 200 Hz."""

    outputs = {"position": "f64 m"}

    def execute(self):
        pass


class Pole:
    """The encoder at the pivot, 200 Hz. It counts through whole turns."""

    outputs = {"angle": "f64 rad"}  # from upright, positive towards + position; it hangs at pi when it is zeroed

    def execute(self):
        pass


class Operator:
    """The desk of the operator: whether it may move, and where the cart shall go."""

    outputs = {"run": "bool", "target": "f64 m"}

    def execute(self):
        pass


class EncoderCheck:
    """Whether the samples of an encoder can be used.

    | not, when | until |
    |---|---|
    | no sample came for `max_age_ticks` of its channel | one comes |
    | a sample is further from the last one than anything moves: counts are lost | for good: its zero is lost, too |
    | it has not changed for `frozen_s` while the motor acts (0: not looked at) | it changes |
    """

    inputs = {
        "value": "f64",  # of the encoder, in its unit
        "channel_valid": "bool",
        "fresh": "bool",
        "armed": "bool",  # the motor acts
        "dt": "f64 s",
    }
    outputs = {
        "valid": "bool",
        "usable": "bool",  # a new sample, and valid
        "still": "f64 s",  # time since it changed
    }
    parameters = {
        "largest_rate": "f64 in 0..",  # unit of the encoder per s
        "frozen_s": "f64 s in 0..",
    }
    state = {"last": "f64", "age": "f64 s", "frozen": "f64 s", "began": "bool", "slipped": "bool"}

    def execute(self):
        self.age = min(self.age + self.dt, FOREVER)
        self.still = min(self.still + self.dt, FOREVER)
        if self.fresh:
            moved = abs(self.value - self.last)
            if self.began and not moved <= self.largest_rate * self.age:
                self.slipped = True
            if moved > 0.0 or not self.began:
                self.frozen = 0.0
                self.still = 0.0
            self.began = True
            self.last = self.value
            self.age = 0.0
        self.frozen = min(self.frozen + self.dt, FOREVER) if self.armed else 0.0
        alive = self.channel_valid and isfinite(self.value)
        self.valid = alive and not self.slipped and not 0.0 < self.frozen_s < self.frozen
        self.usable = self.valid and self.fresh
        self.health = "nominal" if self.valid else "failed"
