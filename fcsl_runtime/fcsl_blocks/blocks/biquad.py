# SPDX-License-Identifier: Apache-2.0
"""Filters of second order by frequency and quality factor: notch, low-pass, high-pass, that can be retuned in flight.

All are outputs of one pair of integrators, the state-variable filter. With w = 2 pi frequency and q = quality:
band' = (w / q) (u - band - low), low' = q w band
band / u = (w / q) s / d, low / u = w^2 / d, d = s^2 + (w / q) s + w^2; notch = u - band; high = u - band - low

Both are integrated by the trapezoidal rule with tan(pi frequency period) in the place of w period / 2: the bilinear
transform, prewarped to be exact at `frequency`. The state is band, low and u of the run before: values of signals, and
not of a delay line, whose meaning depends on the coefficients. So each output moves on from where it is, whatever the
coefficients become, and one at rest stays there. While q is constant, q^2 band^2 + low^2 never grows without input,
however the frequency and the period change: it falls by q tan(pi frequency period) (band + new band)^2 in each run.
"""

from fcsl_builtins import f64, isfinite, pi, tan

HIGHEST = 0.49  # greatest frequency, of the rate of runs


def integrate(band: f64, low: f64, last: f64, u: f64, cycles: f64, q: f64) -> tuple[f64, f64]:
    """Band and low a run later, with cycles = frequency period: both rules, solved for band + new band (`both`)."""
    g = tan(pi * min(cycles, HIGHEST))
    both = (2.0 * q * band + g * ((u - low) + (last - low))) / (q + g * (1.0 + g * q))
    return both - band, low + g * q * both


class Notch:
    """A notch filter of second order: it takes out one frequency.

    y / u = (s^2 + w^2) / (s^2 + (w / quality) s + w^2), w = 2 pi frequency

    Discretised by the bilinear transform, exact at `frequency` (prewarping). The first run after a break (`resumed`)
    gives y = u, as if u had always had this value. A change of the period, the frequency or the quality makes no
    jump: y is made of signals that move on from their values (see the head of biquad.py).

    Source: R. Bristow-Johnson, "Cookbook formulae for audio equalizer biquad filter coefficients" (the transfer
    function, the transform, the meaning of the quality); the form is derived at the head of biquad.py.
    Limits: a frequency above 0.49 of the rate of runs acts as 0.49 of it; one of 0 lets u pass. An input for which y
    would not be finite is passed over: y stays, and health is degraded. If it is the first one after a break, the next
    one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "frequency": "f64 Hz in 0..1e9",  # of the centre, where the gain is 0
        "quality": "f64 in 0.01..1e4",  # frequency / width between the points of half the power (-3 dB)
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "band": "f64",
        "low": "f64",
        "last": "f64",  # u of the run before
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        band, low = 0.0, self.input
        if self.begun:
            cycles = self.frequency * self.period
            band, low = integrate(self.band, self.low, self.last, self.input, cycles, self.quality)
        if not (isfinite(self.input - band) and isfinite(low)):
            self.health = "degraded"
            return
        self.begun = True
        self.band, self.low, self.last = band, low, self.input
        self.output = self.input - band


class TrackingNotch:
    """A notch filter whose centre follows an input, such as the speed of a rotor.

    y / u = (s^2 + w^2) / (s^2 + (w / quality) s + w^2), w = 2 pi centre
    centre = harmonic frequency, but no less than `least` and no more than 0.49 of the rate of runs

    Discretised by the bilinear transform, exact at the centre (prewarping). The first run after a break (`resumed`)
    gives y = u, as if u had always had this value. A change of the period, the frequency or a parameter makes no jump
    (see the head of biquad.py). A frequency that is not finite is passed over: the filter runs on with the centre that
    it had (before there was one, y = u), and health is degraded.

    Source: as Notch; ArduPilot, HarmonicNotchFilter (a notch at a multiple of a measured frequency, of constant quality
    factor, with a least and a greatest centre).
    Limits: the notch forms within some quality / (pi centre) s of a change: a frequency that moves by more than its
    width in that time is not taken out whole. An input for which y would not be finite is passed over: y stays, and
    health is degraded. If it is the first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "frequency": "f64 Hz",  # of the disturbance
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "harmonic": "f64 in 0.01..100 = 1",  # multiple of the frequency to take out, such as the number of blades
        "quality": "f64 in 0.01..1e4",  # centre / width between the points of half the power (-3 dB)
        "least": "f64 Hz in 0..1e9",  # least centre, above the band of the wanted signal
    }
    outputs = {
        "output": "f64",  # y
        "centre": "f64 Hz",  # the frequency that is taken out
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "band": "f64",
        "low": "f64",
        "last": "f64",  # u of the run before
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        if isfinite(self.frequency):
            self.centre = min(max(self.harmonic * self.frequency, self.least), HIGHEST / self.period)
        else:
            self.health = "degraded"
        band, low = 0.0, self.input
        if self.begun:
            cycles = self.centre * self.period
            band, low = integrate(self.band, self.low, self.last, self.input, cycles, self.quality)
        if not (isfinite(self.input - band) and isfinite(low)):
            self.health = "degraded"
            return
        self.begun = True
        self.band, self.low, self.last = band, low, self.input
        self.output = self.input - band


class BiquadLowPass:
    """A low-pass filter of second order, by frequency and quality factor.

    y / u = w^2 / (s^2 + (w / quality) s + w^2), w = 2 pi frequency

    Discretised by the bilinear transform, exact at `frequency` (prewarping). The first run after a break (`resumed`)
    gives y = u, as if u had always had this value. A change of the period, the frequency or the quality makes no
    jump: y is made of signals that move on from their values (see the head of biquad.py).

    Source: R. Bristow-Johnson, "Cookbook formulae for audio equalizer biquad filter coefficients" (the transfer
    function, the transform, the meaning of the quality); the form is derived at the head of biquad.py.
    Limits: a frequency above 0.49 of the rate of runs acts as 0.49 of it; one of 0 holds y. An input for which y
    would not be finite is passed over: y stays, and health is degraded. If it is the first one after a break, the next
    one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "frequency": "f64 Hz in 0..1e9",  # of the corner
        "quality": "f64 in 0.01..1e4 = 0.7071067811865476",  # gain at the frequency; default: Butterworth
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "band": "f64",
        "low": "f64",
        "last": "f64",  # u of the run before
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        band, low = 0.0, self.input
        if self.begun:
            cycles = self.frequency * self.period
            band, low = integrate(self.band, self.low, self.last, self.input, cycles, self.quality)
        if not (isfinite(self.input - band) and isfinite(low)):
            self.health = "degraded"
            return
        self.begun = True
        self.band, self.low, self.last = band, low, self.input
        self.output = low


class BiquadHighPass:
    """A high-pass filter of second order, by frequency and quality factor.

    y / u = s^2 / (s^2 + (w / quality) s + w^2), w = 2 pi frequency

    Discretised by the bilinear transform, exact at `frequency` (prewarping). The first run after a break (`resumed`)
    gives y = 0, as if u had always had this value. A change of the period, the frequency or the quality makes no
    jump: y is made of signals that move on from their values (see the head of biquad.py).

    Source: R. Bristow-Johnson, "Cookbook formulae for audio equalizer biquad filter coefficients" (the transfer
    function, the transform, the meaning of the quality); the form is derived at the head of biquad.py.
    Limits: a frequency above 0.49 of the rate of runs acts as 0.49 of it; one of 0 gives the change of u since the
    first run. An input for which y would not be finite is passed over: y stays, and health is degraded. If it is the
    first one after a break, the next one takes its place.
    """

    inputs = {
        "input": "f64",  # u
        "period": "f64 s",  # machine.period
        "resumed": "bool",  # machine.resumed
    }
    parameters = {
        "frequency": "f64 Hz in 0..1e9",  # of the corner
        "quality": "f64 in 0.01..1e4 = 0.7071067811865476",  # gain at the frequency; default: Butterworth
    }
    outputs = {
        "output": "f64",  # y
    }
    state = {
        "begun": "bool",  # since the break, a finite input has come
        "band": "f64",
        "low": "f64",
        "last": "f64",  # u of the run before
    }

    def execute(self):
        self.begun = self.begun and not self.resumed
        band, low = 0.0, self.input
        if self.begun:
            cycles = self.frequency * self.period
            band, low = integrate(self.band, self.low, self.last, self.input, cycles, self.quality)
        if not (isfinite(self.input - band) and isfinite(low)):
            self.health = "degraded"
            return
        self.begun = True
        self.band, self.low, self.last = band, low, self.input
        self.output = self.input - band - low
