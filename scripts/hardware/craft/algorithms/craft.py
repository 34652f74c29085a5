# SPDX-License-Identifier: Apache-2.0
"""The algorithms of the craft that flies in the guest."""


class Sensors:
    """What the board gives."""

    outputs = {
        "gyro": "f64[3] rad/s",
        "accel": "f64[3] m/s^2",
        "angle": "f64[3] rad",  # over the time below
        "span": "f64 s",
        "pressure": "f64 Pa",
        "field": "f64[3] T",
        "distance": "f64 m",
        "voltage": "f64 V",
        "current": "f64 A",
        "charge": "f64",
        "zone": "f64 degC",
        "supply": "f64 V",
        "sticks": "f32[4]",
    }

    def execute(self):
        pass


class Odometer:
    """Adds up the angles, and counts the ticks whose angular velocity is old."""

    inputs = {"angle": "f64[3] rad", "span": "f64 s", "fresh": "bool", "age": "u32"}
    outputs = {
        "turned": "f64[3] rad",
        "spanned": "f64 s",
        "ticks": "u64",
        "late_ticks": "u64",  # older than a tick
    }

    def execute(self):
        if self.fresh:
            for i in range(3):
                self.turned[i] += self.angle[i]
            self.spanned += self.span
        self.ticks += 1
        if self.age > 1:
            self.late_ticks += 1


class Pilot:
    """Passes its parameters to the motors; asks for SAFE when the angular velocity is not valid. Told to hang, it makes steps that take
    the larger part of a second."""

    inputs = {"valid": "bool"}
    outputs = {"motors": "f64[2]", "armed": "bool", "transition_request": "TransitionRequest"}
    parameters = {"throttle": "f64", "steer": "f64", "arm": "bool", "hang": "bool"}
    state = {"spun": "f64"}

    def execute(self):
        if self.hang:
            for i in range(10000000):
                self.spun = sin(self.spun + f64(i))
        self.motors[0] = self.throttle
        self.motors[1] = self.steer
        self.armed = self.arm
        self.transition_request = "FLY" if self.valid else "LOSE"
