# SPDX-License-Identifier: Apache-2.0
"""The way of an output to a pulse."""

from __future__ import annotations

from ..board.plan import Pulse

RAMP_S = 0.5


def start_of(rule: Pulse) -> float:
    """Where the ramp begins: at the safe pulse. If that is none that moves (0: no pulses), at the command nearest to zero."""
    if rule.line.contains(rule.safe):
        return rule.safe
    return rule.line.at(0.0)


def ramp_seconds(rule: Pulse, target: float) -> float:
    """0.5 s, or as long as the output's own limit takes."""
    way = abs(target - start_of(rule))
    return max(RAMP_S, way / rule.slew) if rule.slew > 0.0 else RAMP_S


def ramp(rule: Pulse, target: float, elapsed_s: float) -> float:
    """The pulse so long after the start."""
    start = start_of(rule)
    return start + (target - start) * min(1.0, elapsed_s / ramp_seconds(rule, target))
