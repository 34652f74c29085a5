# SPDX-License-Identifier: Apache-2.0
"""Limits of signals: of their rate, and from below."""

from fcsl_builtins import abs, clamp, copysign, isfinite


class RateLimiter:
    """A rate limiter (slew rate limiter) with a rate up and a rate down.

    y_n = clamp(u_n, y_(n-1) - falling period, y_(n-1) + rising period)

    The first run after a break (`resumed`) gives y = track, from where y moves toward u. A change of the period or of a
    rate changes only how fast y moves on.

    Source: PX4, lib/slew_rate SlewRate (one rate for both directions, and the forced value to begin at).
    Limits: a sinusoid that is limited comes out late: phase is lost where amplitude 2 pi frequency is above a rate. An
    input or, in the first run, a track that is not finite is passed over: y stays, and health is degraded. If that is
    the first run after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "track": "f64",  # the output to begin at after a break; connect the source of the input to begin there
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "rising": "f64 in 0..",  # greatest rate up, in units of the input per s
        "falling": "f64 in 0..",  # greatest rate down, in units of the input per s, positive
    }
    outputs = {
        "output": "f64",  # y
        "limited": "bool",  # y is not u
    }
    state = {"begun": "bool"}  # since the break, y has begun

    def execute(self):
        self.begun = self.begun and not self.resumed
        if not (isfinite(self.input) and (self.begun or isfinite(self.track))):
            self.health = "degraded"
            return
        if self.begun:
            up = self.output + self.rising * self.period
            down = self.output - self.falling * self.period
            self.output = clamp(self.input, down, up)
        else:
            self.output = self.track
        self.begun = True
        self.limited = self.output != self.input


class Deadband:
    """A deadband (dead zone) with hysteresis: what is small is 0.

    active begins where |u| > width + hysteresis, and ends where |u| <= width
    y = u - width sign(u) while active, else 0

    At the end of `active`, y comes to 0 without a jump; at its beginning it jumps by the hysteresis. Without hysteresis
    it is the usual dead zone, continuous everywhere. After a break (`resumed`), the first run begins
    without `active`. The period has no influence. A change of the width shifts y by as much.

    Source: JSBSim, FGDeadBand (the dead zone; there, width is that of both sides); the hysteresis is that of a Schmitt
    trigger.
    Limits: in a control loop, a deadband leaves an error of up to width + hysteresis. An input that is not finite is
    passed over: y stays, and health is degraded.
    """

    inputs = {
        "input": "f64",  # u
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "width": "f64 in 0..",  # of one side, in units of the input
        "hysteresis": "f64 in 0.. = 0",  # in units of the input
    }
    outputs = {
        "output": "f64",  # y
        "active": "bool",  # |u| is outside of the band
    }

    def execute(self):
        self.active = self.active and not self.resumed
        if not isfinite(self.input):
            self.health = "degraded"
            return
        size = abs(self.input)
        self.active = size > (self.width if self.active else self.width + self.hysteresis)
        self.output = copysign(size - self.width, self.input) if self.active else 0.0
