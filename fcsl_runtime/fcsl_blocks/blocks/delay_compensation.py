# SPDX-License-Identifier: Apache-2.0
"""A measurement that comes late, brought to the present."""

from fcsl_builtins import all, isfinite, min, zeros


class DelayCompensation:
    """Brings a late measurement to the present, by how what it measures has changed since it was taken.

    present = measured + integral of rate over the last `delay` s

    `rate` is the estimated derivative of what is measured: for a position the velocity of the filter that uses it, for a
    velocity its acceleration in the axes of the world; connect it with "delayed": true. Give `present` and `fresh` to the
    filter in place of the measurement. The sizes: n elements, and memory: the number of periods that are remembered, at
    least delay / period. The integral is one of rectangles, the oldest of them in part; the period may change.

    Source: T. D. Larsen, N. K. Andersen, O. Ravn, N. K. Poulsen, "Incorporation of Time Delayed Measurements in a
    Discrete-time Kalman Filter" (CDC 1998, abstract): extrapolation of the measurement to the present. Integrating the rate,
    in place of the difference of two estimates, keeps the corrections in between out of it.
    Limits: the error of the rate times the delay is added to the measurement, and is correlated with the filter's; noise and
    gain of the filter are not corrected for it. Of a position with an antenna arm, rate is that of the antenna; a heading
    comes out unwrapped. The memory is that of the fastest rate at which it runs, rounded up. `rate` of this run is that of the
    run before, so an acceleration a makes an error of a period delay / 2. Where the memory is shorter than the delay (after a
    break, too: `resumed`), what it holds is used, and health is degraded. A measurement whose sum is not finite is passed
    over: present stays, fresh is false, health is degraded.
    """

    inputs = {
        "measured": "f64[n]",  # as it comes
        "measured_fresh": "bool",  # measured is a new sample
        "rate": "f64[n]",  # derivative of what is measured, now
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "delay": "f64 s in 0..",  # from the measurement to this run
    }
    outputs = {
        "present": "f64[n]",  # what would be measured now
        "fresh": "bool",  # present is new
    }
    state = {
        "rates": "f64[memory][n]",  # newest first
        "periods": "f64[memory] s",
    }

    def execute(self):
        if self.resumed:
            self.periods = zeros(memory)
        for i in range(memory - 1, 0, -1):
            self.rates[i] = self.rates[i - 1]
            self.periods[i] = self.periods[i - 1]
        self.rates[0] = self.rate
        self.periods[0] = self.period
        self.fresh = False
        if self.measured_fresh:
            left = self.delay
            present = self.measured
            for i in range(memory):
                part = min(left, self.periods[i])
                if part > 0.0:
                    present = present + part * self.rates[i]
                    left -= part
            if left > 1e-9 * self.delay:
                self.health = "degraded"
            if all(isfinite(present)):
                self.present = present
                self.fresh = True
            else:
                self.health = "degraded"
