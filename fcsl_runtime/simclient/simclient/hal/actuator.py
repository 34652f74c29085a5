# SPDX-License-Identifier: Apache-2.0
"""`fcsl-hal test-actuator`: moves one element of an output for some seconds, then makes it safe.

Signals only set a flag, so nothing comes between the last movement and the safe pulse.
"""

from __future__ import annotations

import re
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from ..board.plan import Plan, Pulse, read_plan
from ..errors import TwinError, did_you_mean
from .driver import Device, Driver
from .driver_abi import ACTUATOR
from .errors import Refused
from .in_use import user_of
from .pulses import ramp, ramp_seconds, start_of

_ELEMENT = re.compile(r"(?P<channel>[^\[\]]+)(?:\[(?P<index>\d{1,5})\])?")
_PERIOD_S = 0.02
#: For how long safe values are tried.
_SAFE_S = 2.0
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


@dataclass(frozen=True)
class Movement:
    """`safe`: the safe values of all signals of the device that the plan drives."""

    name: str
    driver: str
    address: str
    rule: Pulse
    target: float
    safe: dict[str, float]


def test_actuator(
    path: str, element: str, command: float | None, pulse: float | None, seconds: float, may_move: bool
) -> None:
    """Raises TwinError for what the plan does not have, Refused where the device must not or cannot be moved."""
    movement = _movement(read_plan(path), element, command, pulse)
    words = _words(movement, seconds)
    driver = _driver(movement)
    if not may_move:
        raise TwinError(f"nothing moves without --yes-move-it. It would move {words}")
    if user := user_of(movement.address):
        raise Refused(f"{movement.name} is not moved: {user}; end it first")
    print(f"moving {words}", flush=True)
    with _signals_seen() as seen:
        with driver.open(movement.address, needed=movement.safe) as device:
            _move(device, movement, seconds, seen)
    print(f"{movement.name} is safe: {movement.rule.safe:g}", flush=True)
    if seen:
        raise KeyboardInterrupt


def _movement(plan: Plan, element: str, command: float | None, pulse: float | None) -> Movement:
    matched = _ELEMENT.fullmatch(element)
    names = [f"{output.channel}[{p.index}]" for output in plan.outputs for p in output.pulses]
    name = f"{matched['channel']}[{int(matched['index'] or 0)}]" if matched else element
    if name not in names:
        has = ", ".join(names) or "none"
        raise TwinError(f"the plan has no output `{name}`{did_you_mean(name, names)}; it has {has}")
    rules = {f"{o.channel}[{p.index}]": (plan.devices[o.device], p) for o in plan.outputs for p in o.pulses}
    device, rule = rules[name]
    same = [(d, p) for d, p in rules.values() if (d.driver, d.address) == (device.driver, device.address)]
    target = _target(name, rule, command, pulse)
    return Movement(name, device.driver, device.address, rule, target, {p.signal: p.safe for _, p in same})


def _target(name: str, rule: Pulse, command: float | None, pulse: float | None) -> float:
    if command is not None:
        if not rule.low <= command <= rule.high:
            raise TwinError(f"{name} takes commands from {rule.low:g} to {rule.high:g}, not {command:g}")
        return rule.line.at(command)
    assert pulse is not None
    if not rule.line.contains(pulse):
        low, high = sorted((rule.minimum, rule.maximum))
        raise TwinError(f"{name} takes pulses from {low:g} to {high:g}, not {pulse:g}")
    return pulse


def _driver(movement: Movement) -> Driver:
    """Raises TwinError where a signal is no f64, as fcsl-guard does."""
    driver = Driver(movement.driver, ACTUATOR)
    types = {signal.name: signal.type_text for signal in driver.signals}
    for name in movement.safe:
        if types.get(name) != "f64":
            has = f"is {types[name]}" if name in types else "is missing"
            raise TwinError(f"driver '{movement.driver}': an output needs a signal `{name}` that is f64, and it {has}")
    return driver


def _words(movement: Movement, seconds: float) -> str:
    rule = movement.rule
    others = ", ".join(f"{name} {value:g}" for name, value in movement.safe.items() if name != rule.signal)
    words = f"{movement.name}, {rule.signal} of {movement.driver} {movement.address}: from {start_of(rule):g} to "
    words += f"{movement.target:g} within {ramp_seconds(rule, movement.target):g} s, for {seconds:g} s, then "
    words += f"{rule.safe:g} (safe)"
    return f"{words}; the others of this device are safe: {others}" if others else words


@contextmanager
def _signals_seen() -> Iterator[list[int]]:
    """The signals that have come: a list that grows. One has ended the command, so the next ones are ignored to its end."""
    seen: list[int] = []
    before = {number: signal.signal(number, lambda number, _: seen.append(number)) for number in _SIGNALS}
    try:
        yield seen
    finally:
        for number, handler in before.items():
            signal.signal(number, signal.SIG_IGN if seen else handler)


def _move(device: Device, movement: Movement, seconds: float, seen: list[int]) -> None:
    try:
        device.write(movement.safe)
        begun = time.monotonic()
        while not seen and (elapsed := time.monotonic() - begun) < seconds:
            device.write({movement.rule.signal: ramp(movement.rule, movement.target, elapsed)})
            time.sleep(_PERIOD_S)
    except Refused as error:
        _make_safe(device, movement)
        raise Refused(f"{error}; then it took its safe values") from None
    except BaseException:
        _make_safe(device, movement)
        raise
    _make_safe(device, movement)


def _make_safe(device: Device, movement: Movement) -> None:
    """Tries for 2 s. Raises Refused."""
    end = time.monotonic() + _SAFE_S
    while True:
        try:
            device.write(movement.safe)
            return
        except Refused as error:
            if time.monotonic() >= end:
                raise Refused(f"{movement.name} IS NOT SAFE, cut its power: {error}") from None
        time.sleep(_PERIOD_S)
