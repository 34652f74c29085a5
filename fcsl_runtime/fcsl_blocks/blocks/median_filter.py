# SPDX-License-Identifier: Apache-2.0
"""The running median."""

from fcsl_builtins import isfinite, median


class MedianFilter:
    """A running median: it takes out single outliers, and leaves edges sharp.

    y_k = median(u_(k-n+1), ..., u_k), for even n the mean of the middle two

    The size n is the number of inputs: "sizes": {"n": 5}. Up to (n - 1) / 2 outliers in a row leave no trace; a step
    comes (n - 1) / 2 runs late. The first run after a break (`resumed`) takes its input for all n: y = u. It counts
    runs, not time: a change of the period changes nothing else.

    Source: PX4, lib/mathlib MedianFilter (the ring of inputs); the first run as in Dyad,
    DiscreteComponents.MedianFilter (steady state).
    Limits: sorting takes up to n (n - 1) / 2 comparisons in each run; n of 3 to 9 is usual. An outlier in the first run
    after a break stays until the window has enough other inputs. An input that is not finite is passed over: y stays,
    and health is degraded. If it is the first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "resumed": "bool",  # machine.resumed
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "window": "f64[n]",  # the last n inputs, newest first
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        if not isfinite(self.input):
            self.health = "degraded"
            return
        for i in range(len(self.window) - 1, 0, -1):
            self.window[i] = self.window[i - 1] if self.begun else self.input
        self.window[0] = self.input
        self.begun = True
        self.output = median(self.window)
