# SPDX-License-Identifier: Apache-2.0
"""Truth over time: debouncing, timers, edges."""

from fcsl_builtins import f64

#: Times are sums of periods, which are rounded: of a period, this much may be missing.
SLACK = 0.01


def reached(time: f64, delay: f64, period: f64) -> bool:
    """Whether `time`, a sum of periods, is at least `delay`."""
    return time >= delay - SLACK * period


def debounced(signal: bool, value: bool, held: f64, on_delay: f64, off_delay: f64, period: f64) -> tuple[bool, f64]:
    """(value, held) after a run; held is the time for which `signal` will have differed from `value` at the next one."""
    if signal == value:
        return value, 0.0
    if reached(held, on_delay if signal else off_delay, period):
        return signal, 0.0
    return value, held + period


class Debounce:
    """A bool that follows another one after that has held for a time: on-delay, off-delay, debouncing.

    value := signal    once signal has differed from value without interruption for on_delay (signal true) or off_delay
                       (signal false); otherwise value stays

    The time counts from the first run with the other signal: on_delay = 0.1 s at 100 Hz is 10 runs later, 0 the same run.
    In the first run after a break (`resumed`), value is `initial`, and the time begins. A changed period counts from the
    next run on; changed delays count for the time that has passed, too.

    Source: PX4-Autopilot, src/lib/hysteresis (a time for each direction); Modelica Standard Library,
    Modelica.Blocks.MathBoolean.OnDelay.
    Limits: delays are rounded up to whole periods, after an allowance of a hundredth of a period for the rounding of the
    sum. A signal that changes and returns between two runs is not seen.
    """

    inputs = {
        "signal": "bool",
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "on_delay": "f64 s in 0.. = 0",  # how long the signal is true before the value is
        "off_delay": "f64 s in 0.. = 0",  # how long the signal is false before the value is
        "initial": "bool = false",  # value to begin with after a break
    }
    outputs = {"value": "bool"}
    state = {"held": "f64 s"}  # for how long the signal will have differed from the value at the next run

    def execute(self):
        if self.resumed:
            self.value = self.initial
            self.held = 0.0
        self.value, self.held = debounced(
            self.signal, self.value, self.held, self.on_delay, self.off_delay, self.period
        )


class Timer:
    """The time since a condition holds, and whether that is long enough: the on-delay timer (TON).

    elapsed = 0 in the first run in which the condition holds, then + period in each run; 0 while it does not hold
    done = condition and elapsed >= delay

    In the first run after a break (`resumed`), the time begins anew. A changed period counts from the next run on. After
    `done`, elapsed goes on.

    Source: the timer TON as OpenPLC and ABB Automation Builder document it (theirs stop at the delay); Modelica Standard
    Library, Modelica.Blocks.MathBoolean.OnDelay.
    Limits: elapsed is a sum of rounded periods. `done` allows a hundredth of a period for it, and else rounds the delay up
    to whole periods. A condition that fails and returns between two runs is not seen.
    """

    inputs = {
        "condition": "bool",
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {"delay": "f64 s in 0.. = 0"}
    outputs = {
        "elapsed": "f64 s",  # since the condition holds
        "done": "bool",  # the condition has held for the delay
    }
    state = {"coming": "f64 s"}  # elapsed of the next run, if the condition still holds

    def execute(self):
        self.elapsed = 0.0 if self.resumed else self.coming
        self.done = self.condition and reached(self.elapsed, self.delay, self.period)
        if self.condition:
            self.coming = self.elapsed + self.period
        else:
            self.elapsed = 0.0
            self.coming = 0.0


class Edge:
    """The rising and falling edges of a bool, each true for one run (R_TRIG, F_TRIG).

    rising = signal and not last, falling = last and not signal    last: the signal of the run before

    In the first run after a break (`resumed`) there is no edge, whatever the signal is. The period has no effect.

    Source: Modelica Standard Library, Modelica.Blocks.MathBoolean.RisingEdge and FallingEdge (there, the signal before the
    start is a parameter).
    Limits: a signal that changes and returns between two runs has no edge.
    """

    inputs = {
        "signal": "bool",
        "resumed": "bool",  # machine.resumed
    }
    outputs = {"rising": "bool", "falling": "bool"}
    state = {"last": "bool"}

    def execute(self):
        if self.resumed:
            self.last = self.signal
        self.rising = self.signal and not self.last
        self.falling = self.last and not self.signal
        self.last = self.signal
