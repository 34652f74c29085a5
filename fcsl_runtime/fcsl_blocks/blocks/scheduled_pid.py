# SPDX-License-Identifier: Apache-2.0
"""The PID controller whose gains come from a table."""

from fcsl_builtins import clamp, inf, interp, isfinite, max, min
from pid import differentiated, integrated


class ScheduledPid:
    """Pid with gain scheduling: kp, ki and kd are interpolated in tables over a scheduling variable.

    kp, ki, kd = the line through the table's points beside `schedule`; beyond the ends, the gains of the ends
    P, I, D, v, u: those of Pid with these gains
    I = I + (last kp - kp) (b r - y)    before each run but the first, where ki > 0; at a limit, less: see below

    All else is as in Pid: forward Euler and backward differences, clamping or back-calculation, and in the first run after
    a break (`resumed`) a begin at `track` with D = 0, with the gains of that run. The period counts from the run in which
    it changes. Changes of gains make no jump, whether the schedule moves, jumps, or the tables change: ki and kd are inside
    the integral and the derivative, and what a change of kp does to P is taken from I. So P moves with b r - y alone (it is
    in velocity form), and the schedule does not disturb a loop at rest. Where v is beyond a limit, I changes only as far as
    the command needs to stay at it: of a large P, nothing is left in I. Without integral action (ki = 0), nothing would
    remove an offset from I: it begins at 0, not at `track`, and there P is kp (b r - y), and jumps with kp.

    Source: Dyad DiscreteComponents, DiscretePIDScheduled (gains inside integral and derivative, so that a change leaves both
    parts of the command as they are); MathWorks, "Analysis of Gain-Scheduled PI Controller" (ki before the integrator and
    behind it compared) and "PID Gain Scheduler" (a table per gain, interpolated). Derivation of the compensation: at
    constant r and y, v stays if the sum of P and I does.
    Limits: two breakpoints at least, ascending; gains are not finite beside two that are equal at an end. Gain scheduling
    promises nothing where the scheduling variable moves as fast as the loop. A tracking_time below the period acts as the
    period. A run whose inputs, gains or parts are not finite is passed over: all outputs stay, and health is degraded. If
    it is the first one after a break, or `track` is not finite then, the next run begins at `track`.
    """

    inputs = {
        "setpoint": "f64",  # r
        "measured": "f64",  # y
        "feedforward": "f64",  # added before the limits
        "schedule": "f64",  # scheduling variable: airspeed, altitude, dynamic pressure, mass
        "track": "f64",  # the command to begin at after a break
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "breakpoints": "f64[n]",  # values of `schedule`, ascending, of the tables
        "kp_table": "f64[n]",  # gain
        "ki_table": "f64[n] 1/s in 0.. = 0",  # integral gain
        "kd_table": "f64[n] s in 0.. = 0",  # derivative gain
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
        "kp": "f64",  # gain of this run
        "ki": "f64 1/s",  # integral gain of this run
        "kd": "f64 s",  # derivative gain of this run
    }
    state = {"integral": "f64", "derivative": "f64", "last": "f64", "begins": "bool"}  # last: c r - y of the run before

    def execute(self):
        if self.resumed:
            self.begins = True
        kp = interp(self.schedule, self.breakpoints, self.kp_table)
        ki = interp(self.schedule, self.breakpoints, self.ki_table)
        kd = interp(self.schedule, self.breakpoints, self.kd_table)
        given = isfinite(self.setpoint) and isfinite(self.measured) and isfinite(self.feedforward)
        known = given and isfinite(self.schedule) and isfinite(kp) and isfinite(ki) and isfinite(kd)
        if not known or (self.begins and not isfinite(self.track)):
            self.health = "degraded"
            return
        error = self.setpoint - self.measured
        weighted = self.c * self.setpoint - self.measured
        partial = self.b * self.setpoint - self.measured
        if self.begins:
            derivative = 0.0
            start = clamp(self.track, self.low, self.high) - kp * partial - self.feedforward
            integral = start if ki > 0.0 else 0.0
        else:
            derivative = differentiated(self.derivative, kd, weighted - self.last, self.derivative_time, self.period)
            integral = self.integral
            if ki > 0.0:
                # v with the kp of the run before, and what the command then needs of v
                kept = self.kp * partial + integral + derivative + self.feedforward
                least = min(kept, self.high) if kept > self.low else -inf
                most = max(kept, self.low) if kept < self.high else inf
                v = kp * partial + integral + derivative + self.feedforward
                integral += clamp(v, least, most) - v
        wanted = kp * partial + integral + derivative + self.feedforward
        step = ki * error * self.period
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
        self.kp = kp
        self.ki = ki
        self.kd = kd
