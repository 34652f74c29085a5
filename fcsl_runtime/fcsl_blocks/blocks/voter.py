# SPDX-License-Identifier: Apache-2.0
"""Voting among redundant sensors."""

from fcsl_builtins import abs, f64, isfinite, max, min


class MidValueVoter:
    """The mid value of three redundant inputs, and which of them is out.

    usable inputs: valid, and finite
    value = the mid one of three usable inputs, the mean of two, the only one; with none it stays
    out   = not usable, or |input - value| > limit; of two usable inputs both, if |difference| > limit, since nobody knows
            which of them is wrong
    agreed = at least two inputs are not out

    One wrong input of three, whatever it says, leaves value between the other two. Health is degraded while an input is
    out, and failed while none is usable. There is no memory but value, so that breaks and the period have no effect; at
    first, value is 0. For a time that a deviation must last, put a Debounce behind an `out`; to shut an input out for good,
    clear its `valid`.

    Source: GE Mark VIe system manual (median voting of analog signals; a disagreement detector that compares each with the
    voted value); Honeywell, US patent 9,092,313 (three inputs against the middle one).
    Limits: where value is the mid of other inputs than before, it may jump by as much as they differ. Not for angles that
    wrap. Three inputs of which two fail alike are outvoted.
    """

    inputs = {
        "a": "f64",
        "b": "f64",
        "c": "f64",
        "a_valid": "bool",
        "b_valid": "bool",
        "c_valid": "bool",
    }
    parameters = {"limit": "f64 in 0.."}  # greatest deviation of a good input from value; of two, from each other
    outputs = {
        "value": "f64",
        "agreed": "bool",  # two inputs confirm each other
        "a_out": "bool",
        "b_out": "bool",
        "c_out": "bool",
    }

    def execute(self):
        a = self.a_valid and isfinite(self.a)
        b = self.b_valid and isfinite(self.b)
        c = self.c_valid and isfinite(self.c)
        a_off = False
        b_off = False
        c_off = False
        if a and b and c:
            self.value = max(min(self.a, self.b), min(max(self.a, self.b), self.c))
            a_off = abs(self.a - self.value) > self.limit
            b_off = abs(self.b - self.value) > self.limit
            c_off = abs(self.c - self.value) > self.limit
        elif a and b:
            self.value, a_off = pair(self.a, self.b, self.limit)
            b_off = a_off
        elif a and c:
            self.value, a_off = pair(self.a, self.c, self.limit)
            c_off = a_off
        elif b and c:
            self.value, b_off = pair(self.b, self.c, self.limit)
            c_off = b_off
        elif a:
            self.value = self.a
        elif b:
            self.value = self.b
        elif c:
            self.value = self.c
        self.a_out = not a or a_off
        self.b_out = not b or b_off
        self.c_out = not c or c_off
        alone = self.a_out and self.b_out or self.b_out and self.c_out or self.a_out and self.c_out
        self.agreed = not alone
        if not (a or b or c):
            self.health = "failed"
        elif self.a_out or self.b_out or self.c_out:
            self.health = "degraded"


def pair(x: f64, y: f64, limit: f64) -> tuple[f64, bool]:
    """The mean of two inputs, and whether they are too far from each other."""
    return 0.5 * x + 0.5 * y, abs(x - y) > limit
