# SPDX-License-Identifier: Apache-2.0
"""Low-pass filters and notches, as second-order sections for the rate of a device.

    y = b0·x + b1·x₁ + b2·x₂ - a1·y₁ - a2·y₂

Low-pass: the 2nd-order Butterworth filter H(s) = 1 / (s² + √2·s + 1) by the bilinear transform s = (z - 1) / (K (z + 1))
with K = tan(π·hz/rate), which puts -3 dB exactly at hz. Oppenheim, Schafer, Discrete-Time Signal Processing, 3rd
edition, 7.1 and 7.2.

Notch: that of R. Bristow-Johnson's Cookbook formulae for audio EQ biquad filter coefficients, with
α = tan(π·width/rate) in place of its sin(ω)/(2 Q), which puts the two frequencies of -3 dB exactly width apart.
Orfanidis, Introduction to Signal Processing, 11.3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .devices import MAX_RATE_HZ, Device
from .kinds import MAX_SECTIONS
from .quantities import adjustable, by_quantity

#: A filter slower than this part of the rate loses its precision in a double.
_SLOWEST = 1e-4
_MIN_HZ = 1e-6


@dataclass(frozen=True)
class Section:
    b0: float
    b1: float
    b2: float
    a1: float
    a2: float


@dataclass(frozen=True)
class Filter:
    """`width_hz`: of a notch; 0 for a low-pass."""

    quantity: str
    hz: float
    width_hz: float
    span: Span


def low_pass(hz: float, rate_hz: float) -> Section:
    k = math.tan(math.pi * hz / rate_hz)
    norm = 1.0 + math.sqrt(2.0) * k + k * k
    b0 = k * k / norm
    return Section(b0, 2.0 * b0, b0, 2.0 * (k * k - 1.0) / norm, (1.0 - math.sqrt(2.0) * k + k * k) / norm)


def notch(hz: float, width_hz: float, rate_hz: float) -> Section:
    alpha = math.tan(math.pi * width_hz / rate_hz)
    b0 = 1.0 / (1.0 + alpha)
    b1 = -2.0 * math.cos(2.0 * math.pi * hz / rate_hz) * b0
    return Section(b0, b1, b0, b1, (1.0 - alpha) * b0)


def read_filters(
    low_pass_node: JsonNode | None, notch_node: JsonNode | None, kind: str, reader: ConfigReader
) -> tuple[Filter, ...]:
    """The filters of a sensor: low-passes, then notches."""
    found: list[Filter] = []
    for quantity, value in by_quantity(low_pass_node, "`low_pass_hz`", adjustable(kind), reader):
        hz = reader.number(value, f"`low_pass_hz` of `{quantity.name}`", _MIN_HZ, MAX_RATE_HZ)
        found += [] if hz is None else [Filter(quantity.name, hz, 0.0, value.span)]
    for quantity, value in by_quantity(notch_node, "`notch`", adjustable(kind), reader):
        for item in reader.list(value, f"`notch` of `{quantity.name}`"):
            found += _notch(quantity.name, item, reader)
    if len(found) > MAX_SECTIONS:
        message = f"{len(found)} filters in one sensor"
        reader.sink.error("E514", message, found[MAX_SECTIONS].span, help=f"there are {MAX_SECTIONS} at most")
    return tuple(found)


def _notch(quantity: str, node: JsonNode, reader: ConfigReader) -> list[Filter]:
    keys = reader.object(node, "a notch", ("hz", "width_hz")) or {}
    hz = reader.number(keys.get("hz"), "`hz`", _MIN_HZ, MAX_RATE_HZ)
    width_hz = reader.number(keys.get("width_hz"), "`width_hz`", _MIN_HZ, MAX_RATE_HZ)
    return [] if hz is None or width_hz is None else [Filter(quantity, hz, width_hz, node.span)]


def sections_for(filters: tuple[Filter, ...], device: Device, reader: ConfigReader) -> tuple[tuple[str, Section], ...]:
    """Quantity and section of each filter, for the rate of the device. Reports filters that it cannot have."""
    found: list[tuple[str, Section]] = []
    for f in filters:
        problem = _problem(f, device)
        if problem:
            reader.sink.error("E514", problem[0], f.span, help=problem[1], notes=[(device.span, "the device")])
        elif f.width_hz:
            found.append((f.quantity, notch(f.hz, f.width_hz, device.rate_hz)))
        else:
            found.append((f.quantity, low_pass(f.hz, device.rate_hz)))
    return tuple(found)


def _problem(f: Filter, device: Device) -> tuple[str, str] | None:
    """Why the device cannot have the filter, and the remedy."""
    if not device.rate_hz:
        return f"a filter of `{device.name}`, whose rate is unknown", "remove it, or give a device with `rate_hz`"
    low, high = f.hz - 0.5 * f.width_hz, f.hz + 0.5 * f.width_hz
    nyquist = 0.5 * device.rate_hz
    if f.width_hz and low < 0.0:
        return f"a notch at {f.hz:g} Hz that is {f.width_hz:g} Hz wide", "`width_hz` must be below twice `hz`"
    what = f"a notch from {low:g} to {high:g} Hz" if f.width_hz else f"a low-pass of {f.hz:g} Hz"
    if high >= nyquist:
        return (
            f"{what} at the {device.rate_hz:g} Hz of `{device.name}`",
            f"it must be below half the rate, {nyquist:g} Hz",
        )
    if min(f.width_hz or f.hz, low) < _SLOWEST * device.rate_hz:
        slowest = _SLOWEST * device.rate_hz
        return f"{what} is too slow for the {device.rate_hz:g} Hz of `{device.name}`", f"{slowest:g} Hz is possible"
    return None
