"""What stands around the filter: the range without its delay, and what its estimate is worth."""

from fcsl_builtins import isfinite, max, quat_to_dcm

POSITION = 0  # aids of the filter
VELOCITY = 1
RANGE = 4


class Beam:
    """The range at present: the range finder is late, and the vehicle sinks and turns in the meantime.

    range = height / R_33,    range' = -(v_down + range (R_31 w_2 - R_32 w_1)) / R_33
    """

    inputs = {
        "range": "f64 m",
        "range_fresh": "bool",
        "attitude": "f64[4]",  # body to NED, of the tick before
        "velocity": "f64[3] m/s",
        "rate": "f64[3] rad/s",
    }
    outputs = {
        "present": "f64 m",
        "fresh": "bool",
    }
    parameters = {"delay": "f64 s in 0.."}

    def execute(self):
        r = quat_to_dcm(self.attitude)
        turned = r[2, 0] * self.rate[1] - r[2, 1] * self.rate[0]
        slope = -(self.velocity[2] + self.range * turned) / r[2, 2]
        present = self.range + self.delay * slope
        self.fresh = self.range_fresh and isfinite(present)
        if self.fresh:
            self.present = present


class Estimate:
    """Whether the estimate is fit to fly, how old its aids are, and the height of the feet.

    It is ready `settle_s` after the alignment, when GNSS and range finder are used.
    """

    inputs = {
        "aligned": "bool",
        "aid_age": "f64[6] s",  # since a sample of the aid was taken
        "position": "f64[3] m",
        "gyro": "f64[3] rad/s",  # at the tick: the filter's rate is the mean of the period before, and later
        "gyro_bias": "f64[3] rad/s",
        "imu_valid": "bool",
        "dt": "f64 s",
    }
    outputs = {
        "height": "f64 m",  # of the feet above the ground, upright
        "rate": "f64[3] rad/s",
        "gnss_age": "f64 s",  # since position and velocity were used
        "range_age": "f64 s",
        "ready": "bool",
    }
    parameters = {"leg_height": "f64 m", "settle_s": "f64 s", "patience": "f64 s"}
    state = {"settled": "f64 s"}

    def execute(self):
        self.height = -self.position[2] - self.leg_height
        self.rate = self.gyro - self.gyro_bias
        self.gnss_age = max(self.aid_age[POSITION], self.aid_age[VELOCITY])
        self.range_age = self.aid_age[RANGE]
        used = self.gnss_age < self.patience and self.range_age < self.patience
        self.settled = self.settled + self.dt if self.aligned and used and self.imu_valid else 0.0
        self.ready = self.settled > self.settle_s
