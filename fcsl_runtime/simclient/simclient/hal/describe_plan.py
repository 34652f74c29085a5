# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal describe board.plan`: the whole plan in words."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path

import numpy as np

from fcsl_compiler.api.board import IDENTITY, KINDS

from ..board.plan import Backend, Correction, Output, Plan, Pulse, Sensor, read_plan
from ..vars.show import jsonable, table
from .describe import show_numbers
from .filter_response import response

_SUFFIX = ".plan"
_HEAD = b"fcsl-board-plan "
_NS_PER_S = 1e9


def is_plan(text: str) -> bool:
    """Whether it names the plan of a board, or shall name one, rather than a driver."""
    if text.endswith(_SUFFIX):
        return True
    try:
        if not Path(text).is_file():
            return False
        with open(text, "rb") as file:
            return file.read(len(_HEAD)) == _HEAD
    except (OSError, ValueError):
        return False


def describe_plan(path: str, as_json: bool) -> None:
    """Raises TwinError for what is not a plan."""
    plan = read_plan(path)
    print(json.dumps(jsonable(asdict(plan))) if as_json else "\n".join(plan_lines(plan)))


def plan_lines(plan: Plan) -> list[str]:
    lines = [
        f"machine {plan.machine}, {plan.tick_hz} Hz{f', its ticks are the samples of {plan.pace}' if plan.pace else ''}"
    ]
    if plan.pace:
        lines.append(f"the flight ends when {plan.pace} is silent for {plan.pace_timeout_ns / _NS_PER_S:g} s")
    lines += ["", "devices", *_indented(table([_device_row(plan, name) for name in plan.devices]))]
    for sensor in plan.sensors:
        lines += ["", f"sensor {sensor.name} ({sensor.kind})", *(f"  {line}" for line in _sensor_lines(plan, sensor))]
    for output in plan.outputs:
        lines += ["", f"output {output.channel} → {output.device}", *(f"  {line}" for line in _output_lines(output))]
    hardware = _hardware_lines(plan)
    lines += ["", "hardware", *(f"  {line}" for line in hardware)] if hardware else []
    if plan.undriven:
        lines += ["", f"nothing drives {', '.join(plan.undriven)}"]
    return lines


def _indented(text: str) -> list[str]:
    return [f"  {line}" for line in text.splitlines()]


def _device_row(plan: Plan, name: str) -> tuple[str, ...]:
    device = plan.devices[name]
    used = [s.name for s in plan.sensors if any(b.device == name for b in s.backends)]
    used += [f"adc {c.number}" for c in plan.converters if c.device == name]
    used += [f"gpio {p.number}" for p in plan.pins if p.device == name and p.safe is None]
    driven = [o.channel for o in plan.outputs if o.device == name]
    driven += [f"gpio {p.number}" for p in plan.pins if p.device == name and p.safe is not None]
    if driven:
        pace = "actuator"
    elif device.period_ns == 0:
        pace = "sends when it likes" if used else "-"
    else:
        pace = f"{_NS_PER_S / device.period_ns:.6g} Hz"
    return (name, device.driver, device.address, pace, ", ".join([*used, *driven]) or "not used")


def _hardware_lines(plan: Plan) -> list[str]:
    lines = []
    for pin in plan.pins:
        if pin.safe is None:
            lines.append(f"hw_read_gpio({pin.number}): {pin.signal} of {pin.device}")
        else:
            safe = f"{'on' if pin.safe else 'off'} at the start and at the end"
            lines.append(f"hw_write_gpio({pin.number}): {pin.signal} of {pin.device}, {safe}")
    lines += [f"hw_read_adc({c.number}): {c.signal} of {c.device}" for c in plan.converters]
    for r in plan.registers:
        calls = "hw_read_u32 and hw_write_u32" if r.write else "hw_read_u32"
        where = f"{r.file}, from byte {r.offset} on" if r.offset else r.file
        lines.append(f"{calls} from {r.address:#x} to {r.address + r.bytes - 4:#x}: {where}")
    return lines


# ---- sensors ---------------------------------------------------------------------------------------------------------


def _sensor_lines(plan: Plan, sensor: Sensor) -> list[str]:
    units = {q.name: q.unit or "" for q in KINDS[sensor.kind]}
    max_age, stuck, recover = (ns / _NS_PER_S for ns in sensor.health)
    lines = [f"{quantity} → channel {channel}" for quantity, channel in sensor.channels.items()]
    healthy = f"healthy: a reading younger than {max_age:g} s"
    healthy += f", not the same for {stuck:g} s" if stuck else ""
    lines.append(f"{healthy}; one that failed counts again after {recover:g} s")
    for quantity, (low, high) in sensor.limits.items():
        lines.append(f"{quantity} between {low:g} and {high:g} {units[quantity]}".rstrip())
    for quantity, tolerance in sensor.tolerances.items():
        lines.append(f"{quantity} within {tolerance:g} {units[quantity]} of the other devices")
    for place, backend in enumerate(sensor.backends, start=1):
        lines.append(f"{place}. {backend.device}")
        lines += [f"   {line}" for line in _backend_lines(plan, backend, sensor.kind)]
    return lines


def _backend_lines(plan: Plan, backend: Backend, kind: str) -> list[str]:
    units = {q.name: q.unit or "" for q in KINDS[kind]}
    lines = [f"{quantity}: its signal {signal}" for quantity, signal in backend.signals.items()]
    for quantity, correction in backend.corrections.items():
        is_scalar = any(q.name == quantity and q.count == 1 for q in KINDS[kind])
        words = _scalar_words if is_scalar else _vector_words
        lines += [f"{quantity}: {text}" for text in words(correction, units[quantity])]
    period_ns = plan.devices[backend.device].period_ns
    for quantity, sections in backend.sections.items():
        lines += [f"{quantity}: {_filter_words(section, period_ns)}" for section in sections]
    for channel, (minimum, middle, maximum, deadband) in backend.sticks.items():
        band = f", {deadband:g} us on both sides of the middle are 0" if deadband else ""
        lines.append(f"stick {channel}: {minimum:g}, {middle:g}, {maximum:g} us become -1, 0, 1{band}")
    return lines


def _vector_words(correction: Correction, unit: str) -> list[str]:
    words = _offset_words(correction, unit, show_numbers)
    if tuple(correction.matrix) != IDENTITY:
        rows = (correction.matrix[i : i + 3] for i in (0, 3, 6))
        words.append(f"times {', '.join(map(show_numbers, rows))}")
    return words


def _scalar_words(correction: Correction, unit: str) -> list[str]:
    """Only the first element of each counts."""
    words = _offset_words(correction, unit, lambda values: show_numbers(values[:1]))
    return words if correction.matrix[0] == 1.0 else [*words, f"times {correction.matrix[0]:.6g}"]


def _offset_words(correction: Correction, unit: str, show: Callable[[list[float]], str]) -> list[str]:
    words = []
    if any(correction.offset):
        words.append(f"offset {show(correction.offset)} {unit}".rstrip())
    if any(correction.per_kelvin):
        change = f"{show(correction.per_kelvin)} {unit}".rstrip()
        words.append(f"offset changes by {change} per kelvin above {correction.celsius:g} degC")
    return words


def _filter_words(section: list[float], period_ns: int) -> str:
    """By the response of the biquad: a notch is 1 at both ends of the band, a low-pass is 0 at its upper end."""
    b, a = np.array(section[:3]), np.array([1.0, *section[3:]])
    at_half_rate = abs(b @ [1, -1, 1]) / abs(a @ [1, -1, 1])
    kind = "notch" if at_half_rate > 0.5 else "low-pass"
    if period_ns == 0:
        return kind
    rate_hz = _NS_PER_S / period_ns
    hz = np.linspace(0.0, 0.5 * rate_hz, 20001)[1:-1]
    gain, _ = response([section], rate_hz, hz)
    found = gain.argmin() if kind == "notch" else abs(gain - math.sqrt(0.5)).argmin()
    return f"{kind} at {hz[found]:.3g} Hz"


# ---- outputs ---------------------------------------------------------------------------------------------------------


def _output_lines(output: Output) -> list[str]:
    return [f"{output.channel}[{pulse.index}] → {pulse.signal}: {_pulse_words(pulse)}" for pulse in output.pulses]


def _pulse_words(pulse: Pulse) -> str:
    middle = (pulse.low + pulse.high) / 2
    words = f"{pulse.low:g}, {middle:g}, {pulse.high:g} become {pulse.minimum:g}, {pulse.middle:g}, {pulse.maximum:g}"
    slew = f", at most {pulse.slew:g} per second" if pulse.slew else ""
    return f"{words}{slew}; safe: {pulse.safe:g}"
