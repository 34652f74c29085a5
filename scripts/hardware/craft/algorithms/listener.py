# SPDX-License-Identifier: Apache-2.0
"""The algorithm of a machine that a CAN bus paces."""


class Listener:
    """Adds up what it hears, once per tick."""

    inputs = {"little": "f64", "big": "f64"}
    outputs = {"sum": "f64", "last_big": "f64"}

    def execute(self):
        self.sum += self.little
        self.last_big = self.big
