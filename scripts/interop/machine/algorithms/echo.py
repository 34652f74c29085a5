# SPDX-License-Identifier: Apache-2.0
"""A command that says which measurement came last, and two requests: `mark` is refused unless `hold` was accepted."""


class Imu:
    outputs = {"rate": "f64[3] rad/s"}

    def execute(self):
        pass


class Echo:
    inputs = {"rate": "f64[3] rad/s", "hold": "bool", "mark": "bool"}
    outputs = {"speed": "f64 m/s", "held": "bool", "marked": "bool"}

    def execute(self):
        self.speed = self.rate[0]
        self.held = self.hold
        self.marked = self.mark and self.hold
