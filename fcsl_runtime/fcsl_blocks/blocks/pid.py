# SPDX-License-Identifier: Apache-2.0
"""The PID controller with two degrees of freedom."""

from fcsl_builtins import clamp, f64, isfinite, min


class Pid:
    """A PID controller with setpoint weights, filtered derivative, feedforward, saturation and anti-windup.

    P = kp (b r - y)
    I' = ki (r - y) + (u - v) / tracking_time    (the second term only with tracking_time > 0: back-calculation)
    D = kd s / (1 + derivative_time s) (c r - y)
    v = P + I + D + feedforward, u = clamp(v, low, high)

    I is integrated by forward Euler behind u, D by backward differences. With tracking_time = 0, the integral stands still
    while v is beyond a limit and the error would drive it further (clamping). In the first run after a break
    (`resumed`), I is chosen so that u begins at `track`: bumpless, with D = 0. Without ki nothing would take this I back:
    it is 0 then, and u begins at P + feedforward. ki is inside the integral, so that a change of ki makes no jump.

    Source: Modelica Standard Library, Modelica.Blocks.Continuous.LimPID (weights, filtered derivative, back-calculation),
    after K. J. Astrom and T. Hagglund, "PID Controllers", 2nd ed. (1995).
    Limits: a tracking_time below the period acts as the period. A setpoint, measurement or feedforward that is not finite,
    or that makes v or I so, is passed over: the command stays, and health is degraded. If it is the first one after a break,
    or `track` is not finite then, the next run begins at `track`.
    """

    inputs = {
        "setpoint": "f64",  # r
        "measured": "f64",  # y
        "feedforward": "f64",  # added before the limits
        "track": "f64",  # the command to begin at after a break, with ki > 0
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "kp": "f64",  # gain
        "ki": "f64 1/s in 0.. = 0",  # integral gain
        "kd": "f64 s in 0.. = 0",  # derivative gain
        "b": "f64 in 0..1 = 1",  # setpoint weight of P
        "c": "f64 in 0..1 = 0",  # setpoint weight of D; 0: no kick at a step of the setpoint
        "derivative_time": "f64 s in 0.. = 0",  # of the filter of D
        "tracking_time": "f64 s in 0.. = 0",  # of back-calculation; 0: clamping
        "low": "f64 = -1e308",  # least command
        "high": "f64 = 1e308",  # greatest command
    }
    outputs = {
        "command": "f64",  # u
        "saturated": "bool",  # v is beyond a limit
    }
    state = {"integral": "f64", "derivative": "f64", "last": "f64", "begins": "bool"}  # last: c r - y of the run before

    def execute(self):
        if self.resumed:
            self.begins = True
        known = isfinite(self.setpoint) and isfinite(self.measured) and isfinite(self.feedforward)
        if not known or (self.begins and not isfinite(self.track)):
            self.health = "degraded"
            return
        error = self.setpoint - self.measured
        weighted = self.c * self.setpoint - self.measured
        proportional = self.kp * (self.b * self.setpoint - self.measured)
        if self.begins:
            derivative = 0.0
            start = clamp(self.track, self.low, self.high) - proportional - self.feedforward
            integral = start if self.ki > 0.0 else 0.0
        else:
            derivative = differentiated(
                self.derivative, self.kd, weighted - self.last, self.derivative_time, self.period
            )
            integral = self.integral
        wanted = proportional + integral + derivative + self.feedforward
        step = self.ki * error * self.period
        integral = integrated(integral, step, wanted, self.low, self.high, self.tracking_time, self.period)
        if not (isfinite(wanted) and isfinite(integral) and isfinite(derivative) and isfinite(weighted)):
            self.health = "degraded"
            return
        self.begins = False
        self.command = clamp(wanted, self.low, self.high)
        self.saturated = self.command != wanted
        self.integral = integral
        self.derivative = derivative
        self.last = weighted


def differentiated(derivative: f64, kd: f64, change: f64, time: f64, period: f64) -> f64:
    """D of this run: of the run before, of kd, and of the change of c r - y; `time` is that of the filter."""
    return (time * derivative + kd * change) / (time + period)


def integrated(integral: f64, step: f64, wanted: f64, low: f64, high: f64, tracking_time: f64, period: f64) -> f64:
    """I of the next run, with anti-windup: of this run, of ki (r - y) period, and of v."""
    if tracking_time > 0.0:
        back = min(period / tracking_time, 1.0)
        return integral + (step + back * (clamp(wanted, low, high) - wanted))
    if wanted > high and step > 0.0 or wanted < low and step < 0.0:
        return integral
    return integral + step
