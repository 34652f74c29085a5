# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal test-actuator`: moves one element of an output for some seconds, then makes it safe."""

from __future__ import annotations

import time

from ..board.plan import read_plan
from ..errors import TwinError
from .elements import Element, find_element
from .motion import Movable
from .pulses import ramp, ramp_seconds, start_of


def test_actuator(
    path: str, name: str, command: float | None, pulse: float | None, seconds: float, may_move: bool
) -> None:
    """Raises TwinError for what the plan does not have, Refused where the device must not or cannot be moved."""
    plan = read_plan(path)
    element = find_element(plan, name)
    target = _target(element, command, pulse)
    movable = Movable(plan, [element])
    words = _words(movable, element, target, seconds)
    if not may_move:
        raise TwinError(f"nothing moves without --yes-move-it. It would move {words}")
    movable.refuse_used()
    print(f"moving {words}", flush=True)
    with movable.moving() as motion:
        begun = time.monotonic()
        while not motion.is_interrupted and (elapsed := time.monotonic() - begun) < seconds:
            motion.write({element.rule.signal: ramp(element.rule, target, elapsed)})


def _target(element: Element, command: float | None, pulse: float | None) -> float:
    name, rule = element.name, element.rule
    if command is not None:
        if not rule.low <= command <= rule.high:
            raise TwinError(f"{name} takes commands from {rule.low:g} to {rule.high:g}, not {command:g}")
        return rule.line.at(command)
    assert pulse is not None
    if not rule.line.contains(pulse):
        low, high = sorted((rule.minimum, rule.maximum))
        raise TwinError(f"{name} takes pulses from {low:g} to {high:g}, not {pulse:g}")
    return pulse


def _words(movable: Movable, element: Element, target: float, seconds: float) -> str:
    rule, device = element.rule, movable.device
    words = f"{element.name}, {rule.signal} of {device.driver} {device.address}: from {start_of(rule):g} to "
    words += f"{target:g} within {ramp_seconds(rule, target):g} s, for {seconds:g} s, then "
    words += f"{rule.safe:g} (safe)"
    return f"{words}; the others of this device are safe: {movable.others}" if movable.others else words
