# SPDX-License-Identifier: Apache-2.0
"""Monitors of one value: range, standing still, rate of change."""

from fcsl_builtins import abs, clamp, isfinite
from logic import debounced, reached

GREATEST = 1.7976931348623157e308


class RangeMonitor:
    """Whether a value has been outside of [low, high] for a time.

    violated = not low <= value <= high, as NaN is
    failed becomes true once `violated` has held for `persistence`, and false again once it has not for `recovery`; with
    `latching` it stays true until a run with `reset`, in which failed and the time begin anew.

    The time counts from the first run that violates: persistence = 0 fails in it. In the first run after a break (`resumed`)
    the time begins anew, and failed is false unless it is latched. A changed period counts from the next run on, changed
    limits and times from this one.

    Source: NASA cFS Limit Checker, fsw/src/lc_watch.c (consecutive violations of a limit, not one, raise an alarm; here in
    time, not in runs).
    Limits: times are rounded up to whole periods, after an allowance of a hundredth of a period for the rounding of the sum.
    low above high: always violated. A value that is not finite is not passed over, since that is what this block is to
    find: it violates every finite range, and health is degraded in that run.
    """

    inputs = {
        "value": "f64",
        "reset": "bool",  # forget a failure
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "low": "f64 = -1e308",
        "high": "f64 = 1e308",
        "persistence": "f64 s in 0.. = 0",
        "recovery": "f64 s in 0.. = 0",
        "latching": "bool = false",
    }
    outputs = {
        "violated": "bool",  # in this run
        "failed": "bool",  # for the time
    }
    state = {"held": "f64 s"}  # for how long `violated` will have differed from `failed` at the next run

    def execute(self):
        if not isfinite(self.value):
            self.health = "degraded"
        if self.resumed or self.reset:
            self.held = 0.0
            self.failed = self.failed and self.latching and not self.reset
        self.violated = not self.low <= self.value <= self.high
        kept = self.failed and self.latching
        failed, self.held = debounced(
            self.violated, self.failed, self.held, self.persistence, self.recovery, self.period
        )
        self.failed = failed or kept


class StuckMonitor:
    """Whether a value has stood still for a time, as that of a frozen sensor does.

    still = time since |value - anchor| > tolerance; in a run in which that holds, anchor := value and still = 0
    failed = still >= persistence; with `latching` it stays true until a run with `reset`, in which failed, anchor and the
    time begin anew.

    The anchor, unlike the value of the run before, tells a slow drift from standing still. In the first run after a break
    (`resumed`) the anchor is the value, still = 0, and failed is false unless it is latched. A changed period counts from
    the next run on; changed parameters count for the time that has passed, too.

    Source: PX4-Autopilot, src/modules/sensors/data_validator/DataValidator.cpp (equal values in a row make data stale;
    there, of neighbours and in counts).
    Limits: only for values with noise or motion above the tolerance: a persistence of many noise periods and of more than
    the sensor's own period, which repeats values. Rounded as in RangeMonitor. A value that is not finite is passed over:
    outputs and time stay, and health is degraded.
    """

    inputs = {
        "value": "f64",
        "reset": "bool",  # forget a failure
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "tolerance": "f64 in 0.. = 0",  # least change that counts as motion is above it
        "persistence": "f64 s in 0..",
        "latching": "bool = false",
    }
    outputs = {
        "still": "f64 s",  # time without motion
        "failed": "bool",
    }
    state = {
        "anchor": "f64",
        "coming": "f64 s",  # still of the next run, if the value does not move
        "begun": "bool",  # since the last break there was a run with a finite value
    }

    def execute(self):
        if self.resumed or self.reset:
            self.begun = False
            self.failed = self.failed and self.latching and not self.reset
        if not isfinite(self.value):
            self.health = "degraded"
            return
        if not self.begun or abs(self.value - self.anchor) > self.tolerance:
            self.anchor = self.value
            self.coming = 0.0
            self.begun = True
        self.still = self.coming
        self.coming = self.still + self.period
        kept = self.failed and self.latching
        self.failed = kept or reached(self.still, self.persistence, self.period)


class RateMonitor:
    """Whether a value has changed faster than a limit for a time.

    rate = (value - last) / time since last, violated = |rate| > max_rate    last: the last finite value before
    failed becomes true once `violated` has held for `persistence`, and false again once it has not for `recovery`; with
    `latching` it stays true until a run with `reset`, in which failed and the time of persistence begin anew.

    The time counts from the first run that violates: persistence = 0 fails in it. In the first run after a break (`resumed`)
    the rate is 0, the time begins anew, and failed is false unless it is latched. A changed period counts from the next run
    on, changed limits and times from this one.

    Source: NASA cFS Limit Checker, fsw/src/lc_watch.c (consecutive violations of a limit, not one, raise an alarm; here in
    time, not in runs). The rate is the difference quotient.
    Limits: a value that comes more slowly than the block runs changes in single runs: schedule the block at the sensor's
    rate. One jump violates in one run only: with a persistence above 0 it does not fail. Rounded as in RangeMonitor. A value
    that is not finite is passed over: outputs and the time of persistence stay, and health is degraded; the time since
    last goes on.
    """

    inputs = {
        "value": "f64",
        "reset": "bool",  # forget a failure
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "max_rate": "f64 in 0..",  # unit of the value per s
        "persistence": "f64 s in 0.. = 0",
        "recovery": "f64 s in 0.. = 0",
        "latching": "bool = false",
    }
    outputs = {
        "rate": "f64",  # unit of the value per s
        "violated": "bool",  # in this run
        "failed": "bool",  # for the time
    }
    state = {
        "last": "f64",
        "gap": "f64 s",  # since last, at the next run
        "held": "f64 s",  # for how long `violated` will have differed from `failed` at the next run
        "begun": "bool",  # since the last break there was a run with a finite value
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        if self.resumed or self.reset:
            self.held = 0.0
            self.failed = self.failed and self.latching and not self.reset
        if not isfinite(self.value):
            self.gap += self.period
            self.health = "degraded"
            return
        rate = (self.value - self.last) / self.gap if self.begun else 0.0
        self.rate = clamp(rate, -GREATEST, GREATEST)
        self.last = self.value
        self.gap = self.period
        self.begun = True
        self.violated = abs(self.rate) > self.max_rate
        kept = self.failed and self.latching
        failed, self.held = debounced(
            self.violated, self.failed, self.held, self.persistence, self.recovery, self.period
        )
        self.failed = failed or kept
