"""What watches the sensors, and what ends a descent without them."""

from fcsl_builtins import abs, max

POSITION = 0  # aids of the filter
VELOCITY = 1
HEIGHT = 2
HEADING = 3


class Monitor:
    """Fails when the vehicle cannot navigate any more, and asks for a landing when it can, but should not go on.

    | lost for longer than its patience | then |
    |---|---|
    | IMU, GNSS | failed: SAFE |
    | barometer, magnetometer, radio link, battery voltage | degraded: LAND |

    A sensor is lost when nothing of it was used: it is silent, or the filter refuses it. The filter is ready when it has run
    for `settle_s` with all of them.
    """

    inputs = {
        "imu_valid": "bool",
        "aligned": "bool",  # the filter runs
        "aid_age": "f64[6] s",  # since a sample of the aid was taken
        "order_valid": "bool",
        "voltage": "f64 V",
        "dt": "f64 s",
    }
    outputs = {
        "ready": "bool",  # the filter is fit to fly
        "barometer_age": "f64 s",
        "transition_request": "TransitionRequest",
    }
    parameters = {"settle_s": "f64 s", "patience": "f64 s", "low_voltage": "f64 V", "low_s": "f64 s"}
    state = {"low": "f64 s", "settled": "f64 s"}

    def execute(self):
        self.low = self.low + self.dt if self.voltage < self.low_voltage else 0.0
        self.barometer_age = self.aid_age[HEIGHT]
        lost = max(self.aid_age[POSITION], self.aid_age[VELOCITY]) > self.patience
        old = self.barometer_age > self.patience or self.aid_age[HEADING] > self.patience
        self.settled = self.settled + self.dt if self.aligned and not (lost or old) else 0.0
        self.ready = self.settled > self.settle_s
        if not self.imu_valid or lost:
            self.health = "failed"
        elif old or not self.order_valid or self.low > self.low_s:
            self.health = "degraded"
            self.transition_request = "LAND"


class Descent:
    """The end of a descent in SAFE: the ground carries the vehicle, or it must have come down by now.

    The time is that of the descent from the last known height at `sink_speed`, twice, and `margin_s`.
    """

    inputs = {
        "thrust_share": "f64",
        "velocity": "f64[3] m/s",
        "position": "f64[3] m",
        "resumed": "bool",
        "dt": "f64 s",
    }
    outputs = {"landed": "bool"}
    parameters = {
        "sink_speed": "f64 m/s in 0.1..",
        "carried_share": "f64",
        "carried_s": "f64 s",
        "margin_s": "f64 s",
    }
    state = {"carried": "f64 s", "left": "f64 s"}

    def execute(self):
        if self.resumed:
            self.carried = 0.0
            self.left = 2.0 * abs(self.position[2]) / self.sink_speed + self.margin_s
        rests = self.thrust_share < self.carried_share and abs(self.velocity[2]) < 0.5 * self.sink_speed
        self.carried = self.carried + self.dt if rests else 0.0
        self.left -= self.dt
        if self.carried > self.carried_s or self.left < 0.0:
            self.landed = True
