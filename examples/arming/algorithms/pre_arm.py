from fcsl_builtins import f64, norm, u32
from rc import KILL, ON, THROTTLE

STANDARD_GRAVITY: f64 = 9.80665  # m/s^2

# The bits of `reasons`.
NO_GYRO: u32 = 1
NO_ACCEL: u32 = 2
NO_BATTERY: u32 = 4
NO_RANGE: u32 = 8
NO_RC: u32 = 16
MOVING: u32 = 32  # it turns or shakes
GRAVITY: u32 = 64  # the accelerometer measures another length than that of gravity: not calibrated, or broken
GYRO_BIAS: u32 = 128  # the gyroscope turns while the vehicle stands: not calibrated
BATTERY_LOW: u32 = 256
THROTTLE_UP: u32 = 512
KILL_ON: u32 = 1024


def reason(bit: u32, holds: bool) -> u32:
    """A bit for a check that failed. Checks say what must hold, so that a NaN fails them."""
    return 0 if holds else bit


class PreArm:
    """Whether arming is allowed, and why not."""

    inputs = {
        "gyro_valid": "bool",
        "accel_valid": "bool",
        "battery_valid": "bool",
        "range_valid": "bool",
        "rc_valid": "bool",
        "still": "bool",
        "gyro_mean": "f64[3] rad/s",
        "accel_mean": "f64[3] m/s^2",
        "voltage": "f64 V",
        "sticks": "f64[8]",
    }
    outputs = {
        "allowed": "bool",
        "reasons": "u32",  # bits that speak against arming: 1 gyroscope, 2 accelerometer, 4 battery, 8 range finder,
        # 16 remote control silent; 32 moving, 64 gravity, 128 gyroscope bias, 256 battery low, 512 throttle up,
        # 1024 kill switch
    }
    parameters = {
        "gravity_tolerance": "f64 m/s^2 in 0..",
        "gyro_bias_limit": "f64 rad/s in 0..",
        "battery_min": "f64 V in 0..",
        "throttle_low": "f64 in -1..1",  # the stick must be below
    }

    def execute(self):
        self.reasons = (
            reason(NO_GYRO, self.gyro_valid)
            | reason(NO_ACCEL, self.accel_valid)
            | reason(NO_BATTERY, self.battery_valid)
            | reason(NO_RANGE, self.range_valid)
            | reason(NO_RC, self.rc_valid)
            | reason(MOVING, self.still)
            | reason(GRAVITY, abs(norm(self.accel_mean) - STANDARD_GRAVITY) < self.gravity_tolerance)
            | reason(GYRO_BIAS, norm(self.gyro_mean) < self.gyro_bias_limit)
            | reason(BATTERY_LOW, self.voltage > self.battery_min)
            | reason(THROTTLE_UP, self.sticks[THROTTLE] < self.throttle_low)
            | reason(KILL_ON, self.sticks[KILL] < ON)
        )
        self.allowed = self.reasons == 0
