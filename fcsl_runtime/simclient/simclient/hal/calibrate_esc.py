# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal calibrate esc`: electronic speed controllers learn the range of their pulses.

One that gets its longest pulse while it powers up, confirms it by beeps and takes the next pulse for the shortest. ArduPilot
and PX4 do the same. Nothing is measured: the range is the board's, and the controllers keep it.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import time
from collections.abc import Mapping, Sequence

from ..board.plan import Plan, read_plan
from ..errors import TwinError
from ..vars.show import table
from .elements import Element, find_elements
from .errors import Refused
from .motion import Motion, Movable

#: For how long each step waits for Enter: nobody leaves controllers that learn.
_STEP_S = 300.0
_WARNING = "PROPELLERS OFF: a controller that has power turns its motor at full speed"


def calibrate_esc(path: str, names: Sequence[str], may_move: bool) -> None:
    """Raises TwinError for what the plan does not have, Refused where the device must not or cannot be moved."""
    plan = read_plan(path)
    movable = Movable(plan, _elements(plan, names))
    if not may_move:
        raise TwinError(f"nothing moves without --yes-move-it. {_WARNING}. It would send\n{_words(movable)}")
    movable.refuse_used()
    print(f"{_WARNING}\n{_words(movable)}")
    maximum = {element.rule.signal: _ends(element)[1] for element in movable.elements}
    minimum = {element.rule.signal: _ends(element)[0] for element in movable.elements}
    with movable.moving() as motion:
        _hold(motion, {}, "1. take the propellers off, cut the power of the controllers, then press Enter")
        _hold(motion, maximum, "2. maximum: give them power, wait for the beeps that confirm it, then press Enter")
        _hold(motion, minimum, "3. minimum: wait for the beeps that confirm it, then press Enter")


def _elements(plan: Plan, names: Sequence[str]) -> list[Element]:
    """Raises TwinError where one is of another device, or has a safe value that is full speed."""
    elements = find_elements(plan, names)
    first = elements[0]
    for element in elements:
        if (element.device.driver, element.device.address) != (first.device.driver, first.device.address):
            raise TwinError(f"{first.name} and {element.name} are of two devices: calibrate one device at a time")
        if element.rule.safe == _ends(element)[1]:
            raise TwinError(
                f"the safe value of {element.name}, {element.rule.safe:g}, is its longest pulse: it would turn at full speed"
            )
    return elements


def _ends(element: Element) -> tuple[float, float]:
    """The shortest and the longest pulse; a reversed output has the longest at its lowest command."""
    low, high = sorted((element.rule.minimum, element.rule.maximum))
    return low, high


def _words(movable: Movable) -> str:
    rows: list[tuple[str, ...]] = [("output", "signal", "maximum", "minimum", "safe, at last")]
    for element in movable.elements:
        low, high = _ends(element)
        rows.append((element.name, element.rule.signal, *(f"{number:g}" for number in (high, low, element.rule.safe))))
    others = f"\nthe others of this device are safe: {movable.others}" if movable.others else ""
    return f"by {movable.device.driver} {movable.device.address}:\n{table(rows)}{others}"


def _hold(motion: Motion, values: Mapping[str, float], prompt: str) -> None:
    """Sends the values until Enter, or a signal. Raises Refused where neither comes."""
    if motion.is_interrupted:
        return
    motion.write(values)
    if sys.stdin.isatty():
        termios.tcflush(sys.stdin, termios.TCIFLUSH)  # an Enter counts for the prompt that it answers
    print(prompt, flush=True)
    end = time.monotonic() + _STEP_S
    while not motion.is_interrupted and not _enter_came():
        if time.monotonic() >= end:
            raise Refused(f"not calibrated: no Enter came for {_STEP_S:g} s")
        motion.write(values)


def _enter_came() -> bool:
    """Takes one byte, and waits for none. Raises Refused at the end of the input."""
    if not select.select([sys.stdin], [], [], 0.0)[0]:
        return False
    byte = os.read(sys.stdin.fileno(), 1)
    if not byte:
        raise Refused("not calibrated: the input has ended, and nobody presses Enter")
    return byte == b"\n"
