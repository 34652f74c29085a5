# SPDX-License-Identifier: Apache-2.0
"""Discrete linear systems in state space."""

from fcsl_builtins import all, isfinite, matvec


class StateSpace:
    """A discrete linear system with n states, m inputs and p outputs.

    y = C x + D u, then x := A x + B u

    In the first run after a break (`resumed`), x is x0. The matrices are those of one period: discretize a continuous
    system for it, and schedule the block at that rate in every state; another period does not change what a run does. In
    place of changed matrices, x stays. Frozen matrices cost nothing for their zeros.

    Source: Modelica Standard Library, Modelica.Blocks.Discrete.StateSpace.
    Limits: a run whose y or next x would not be finite, by an input or by the overflow of an unstable system, is passed
    over: y and x stay, and health is degraded. An input that is not finite does no harm where only frozen zeros meet it.
    """

    inputs = {
        "u": "f64[m]",
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "a": "f64[n][n]",
        "b": "f64[n][m]",
        "c": "f64[p][n]",
        "d": "f64[p][m] = 0",
        "x0": "f64[n] = 0",  # x in the first run after a break
    }
    outputs = {"y": "f64[p]"}
    state = {
        "x": "f64[n]",  # of the next run
        "begun": "bool",  # since the last break there was a run that was not passed over
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        x = self.x if self.begun else self.x0
        y = matvec(self.c, x) + matvec(self.d, self.u)
        following = matvec(self.a, x) + matvec(self.b, self.u)
        if not (all(isfinite(y)) and all(isfinite(following))):
            self.health = "degraded"
            return
        self.begun = True
        self.y = y
        self.x = following
