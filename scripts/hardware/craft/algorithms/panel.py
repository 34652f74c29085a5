# SPDX-License-Identifier: Apache-2.0
"""The algorithm of a machine that reaches pins and a converter."""


class Panel:
    """A button lights a lamp; the other lamp blinks with the ticks when it may."""

    outputs = {"pressed": "bool", "lit": "bool", "counts": "u32", "ticks": "u64"}
    parameters = {"blink": "bool"}

    def execute(self):
        self.ticks += 1
        self.pressed = hw_read_gpio(3)
        hw_write_gpio(17, self.pressed)
        self.lit = hw_read_gpio(17)
        hw_write_gpio(18, self.blink and self.ticks % 2 == 0)
        self.counts = hw_read_adc(0)
