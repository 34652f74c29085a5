# SPDX-License-Identifier: Apache-2.0
"""The lead-lag compensator."""

from fcsl_builtins import isfinite


class LeadLag:
    """A lead-lag compensator of unit gain at rest: lead for lead_time > lag_time, else lag.

    y / u = (1 + lead_time s) / (1 + lag_time s), discretised by the bilinear (Tustin) rule, h = period:
    y_n = y_(n-1) + (2 lead_time (u_n - u_(n-1)) + h (u_n + u_(n-1) - 2 y_(n-1))) / (2 lag_time + h)

    The first run after a break (`resumed`) gives y = u, as if u had always had this value. The state is u and y of the
    run before: a change of the period or of a time makes no jump.

    Source: JSBSim, FGFilter (LEAD_LAG_FILTER: the bilinear rule for this transfer function).
    Limits: a lag_time below half the period acts as half the period, below which the rule rings at each step. The gain
    at high frequencies is lead_time / lag_time: noise grows with it. The corner frequencies are warped near half the
    rate of runs. An input for which y would not be finite is passed over: y stays, and health is degraded. If it is the
    first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "lead_time": "f64 s in 0..1e9",  # of the zero
        "lag_time": "f64 s in 0..1e9",  # of the pole
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "last": "f64",  # u of the run before
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        last = self.last if self.begun else self.input
        before = self.output if self.begun else self.input
        wide = max(2.0 * self.lag_time, self.period) + self.period
        lead = 2.0 * self.lead_time * (self.input - last)
        wanted = before + (lead + self.period * ((self.input - before) + (last - before))) / wide
        if not isfinite(wanted):
            self.health = "degraded"
            return
        self.begun = True
        self.last = self.input
        self.output = wanted
