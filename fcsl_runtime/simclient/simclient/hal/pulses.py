# SPDX-License-Identifier: Apache-2.0
"""From a command to the pulse of an output, and the way of a pulse to it. fcsl_runtime/board/output_map.c has the same rules."""

from __future__ import annotations

from ..board.plan import Pulse

RAMP_S = 0.5


def pulse_of(rule: Pulse, command: float) -> float:
    """On the straight lines from (low, minimum) over the middle to (high, maximum)."""
    middle = (rule.low + rule.high) / 2.0
    if command < middle:
        part = (max(command, rule.low) - rule.low) / (middle - rule.low)
        return rule.minimum + part * (rule.middle - rule.minimum)
    part = (min(command, rule.high) - middle) / (rule.high - middle)
    return rule.middle + part * (rule.maximum - rule.middle)


def is_in_range(rule: Pulse, pulse: float) -> bool:
    return min(rule.minimum, rule.maximum) <= pulse <= max(rule.minimum, rule.maximum)


def start_of(rule: Pulse) -> float:
    """Where the ramp begins: at the safe pulse. If that is none that moves (0: no pulses), at the command nearest to zero."""
    if is_in_range(rule, rule.safe):
        return rule.safe
    return pulse_of(rule, min(max(0.0, rule.low), rule.high))


def ramp_seconds(rule: Pulse, target: float) -> float:
    """0.5 s, or as long as the output's own limit takes."""
    way = abs(target - start_of(rule))
    return max(RAMP_S, way / rule.slew) if rule.slew > 0.0 else RAMP_S


def ramp(rule: Pulse, target: float, elapsed_s: float) -> float:
    """The pulse so long after the start."""
    start = start_of(rule)
    return start + (target - start) * min(1.0, elapsed_s / ramp_seconds(rule, target))
