# SPDX-License-Identifier: Apache-2.0
"""A command that says which measurement came last."""


class Imu:
    outputs = {"rate": "f64[3] rad/s"}

    def execute(self):
        pass


class Echo:
    inputs = {"rate": "f64[3] rad/s"}
    outputs = {"speed": "f64 m/s"}

    def execute(self):
        self.speed = self.rate[0]
