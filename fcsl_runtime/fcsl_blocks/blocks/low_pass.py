# SPDX-License-Identifier: Apache-2.0
"""Low-pass and high-pass filters by cutoff frequency, exact for an input that is held between runs."""

from fcsl_builtins import cos, exp, expm1, f64, isfinite, pi, sin, sqrt


class LowPass:
    """A low-pass filter of first order.

    y' = w (u - y), w = 2 pi cutoff

    The input is taken as held since the run before, which makes the step of any length exact:
    y_n = y_(n-1) + (1 - exp(-w period)) (u_n - y_(n-1)). The first run after a break (`resumed`) gives y = u. A change
    of the period or of the cutoff changes only how y moves on: it makes no jump. A cutoff of 0 holds y.

    Source: derivation, the solution of y' = w (u - y) for constant u.
    Limits: the cutoff is that of the continuous filter; above about a tenth of the rate of runs, the filter of samples
    attenuates less than it. An input for which y would not be finite is passed over: y stays, and health is degraded.
    If it is the first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "cutoff": "f64 Hz in 0..1e9",  # the frequency of half the power (-3 dB)
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {"begun": "bool"}  # since the break, a finite input has come

    def execute(self):
        self.begun = self.begun and not self.resumed
        share = -expm1(-2.0 * pi * self.cutoff * self.period) if self.begun else 1.0
        last = self.output if self.begun else self.input
        wanted = last + share * (self.input - last)
        if not isfinite(wanted):
            self.health = "degraded"
            return
        self.begun = True
        self.output = wanted


class SecondOrderLowPass:
    """A low-pass filter of second order, which also gives the derivative of its output.

    y'' + 2 damping w y' + w^2 y = w^2 u, w = 2 pi cutoff

    The input is taken as held since the run before, which makes the step of any length exact. With x = y - u,
    s = damping w, d = w sqrt(1 - damping^2) and h = period:
    x_n  = exp(-s h) (x (cos(d h) + s sin(d h) / d) + y' sin(d h) / d)
    y'_n = exp(-s h) (y' (cos(d h) - s sin(d h) / d) - x w^2 sin(d h) / d)
    and the same with hyperbolic functions for damping > 1. The first run after a break (`resumed`) gives y = u, y' = 0.
    y and y' are the state: a change of the period, the cutoff or the damping makes no jump in either.
    A cutoff of 0 lets y run on with the derivative that it has.

    Source: derivation, the solution of the equation for constant u.
    Limits: cutoff is the natural frequency; with a damping of sqrt(1/2) (Butterworth) it is also that of half the
    power. A damping of 0 rings for ever. Above about a tenth of the rate of runs, the filter of samples attenuates less
    than the continuous one. An input for which y or y' would not be finite is passed over: both stay, and health is
    degraded. If it is the first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "cutoff": "f64 Hz in 0..1e9",  # natural frequency
        "damping": "f64 in 0..1e3 = 0.7071067811865476",  # damping ratio; below 1 a step overshoots
    }
    outputs = {
        "output": "f64",  # y
        "derivative": "f64",  # y', in units of the input per s
    }
    state = {"begun": "bool"}  # since the break, a finite input has come

    def execute(self):
        self.begun = self.begun and not self.resumed
        w = 2.0 * pi * self.cutoff
        even, odd = decay(w * self.period, self.damping)
        error = self.output - self.input if self.begun else 0.0
        slope = self.derivative if self.begun else 0.0
        skew = self.damping * w * self.period * odd
        wanted = self.input + (error * (even + skew) + slope * (self.period * odd))
        derivative = slope * (even - skew) - error * (w * (w * self.period * odd))
        if not (isfinite(wanted) and isfinite(derivative)):
            self.health = "degraded"
            return
        self.begun = True
        self.output = wanted
        self.derivative = derivative


def decay(angle: f64, damping: f64) -> tuple[f64, f64]:
    """exp(-s) cos(d) and exp(-s) sin(d) / angle, for s = damping angle and d = angle sqrt(1 - damping^2); for
    damping > 1, cosh and sinh of angle sqrt(damping^2 - 1)."""
    even = 0.0
    odd = 0.0
    if damping < 1.0:
        root = sqrt((1.0 - damping) * (1.0 + damping))
        envelope = exp(-damping * angle)
        even = envelope * cos(root * angle)
        odd = envelope * (sin(root * angle) / (root * angle) if root * angle > 0.0 else 1.0)
    else:
        root = sqrt((damping - 1.0) * (damping + 1.0))
        slow = exp(-angle / (damping + root))  # the slow of the two poles, of product 1
        gap = -expm1(-2.0 * root * angle)  # what the fast one lacks to it
        even = slow * (1.0 - 0.5 * gap)
        odd = slow * (0.5 * gap / (root * angle) if root * angle > 0.0 else 1.0)
    return even, odd


class HighPass:
    """A high-pass filter of first order (washout): the input less its low-pass.

    y = u - x, x' = w (u - x), w = 2 pi cutoff

    The input is taken as held since the run before, as in LowPass: y_n = exp(-w period) (y_(n-1) + u_n - u_(n-1)). The
    first run after a break (`resumed`) gives y = 0. A change of the period or of the cutoff makes no jump. A cutoff of
    0 gives u less its value in the first run.

    Source: derivation, as LowPass.
    Limits: cutoff well below the rate of runs; a step of u comes out as exp(-w period) of it. An input for which y
    would not be finite is passed over: y stays, and health is degraded. If it is the first one after a break, the next
    one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "cutoff": "f64 Hz in 0..1e9",  # the frequency of half the power (-3 dB)
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "low": "f64",  # x
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        fall = -2.0 * pi * self.cutoff * self.period
        error = self.input - self.low if self.begun else self.input - self.input  # 0, or NaN if it is not finite
        wanted = exp(fall) * error
        low = self.low - expm1(fall) * error if self.begun else self.input
        if not (isfinite(wanted) and isfinite(low)):
            self.health = "degraded"
            return
        self.begun = True
        self.low = low
        self.output = wanted
