# SPDX-License-Identifier: Apache-2.0
"""Pins: of the hw_* builtins in a flight, and of fcsl-guard. Levels are read from the kernel's gpio-sim."""

from __future__ import annotations

from functools import partial

from ..guest.chips import Ina226
from ..guest.i2c import I2cBus
from ..guest.lines import GpioChip
from ..trials import Failed
from .craft import Craft
from .outputs import REPETITIONS, SAFE_AFTER_S, describe
from .process import Flight, Guard, after, in_ms, until

_LINES = 16
_BUTTON, _LAMP, _BLINKER = 3, 5, 6
_VALVES = (8, 9)


def until_levels(chip: GpioChip, lines: tuple[int, ...], levels: tuple[bool, ...]) -> float:
    return until(f"lines {lines} are {levels}", lambda: tuple(map(chip.level, lines)) == levels)


def press(chip: GpioChip, pressed: bool) -> None:
    """The button pulls its line down."""
    chip.pull(_BUTTON, not pressed)


def panel(craft: Craft) -> Flight:
    return Flight(craft, "--hal", f"linux:{craft.plan('panel')}", machine="panel")


def try_lines(bus: I2cBus, craft: Craft) -> str:
    """A button, lamps, a converter; the chip goes and comes back. The kernel releases the lines of a program that is killed."""
    monitor, chip = Ina226(bus), GpioChip("panel", _LINES)
    monitor.replug()
    monitor.set_supply(22.2, 3.5)
    press(chip, False)
    lamps = (_LAMP, _BLINKER)
    with panel(craft) as flight:
        until_levels(chip, lamps, (False, False))
        lit_s = after(partial(press, chip, True), partial(until_levels, chip, lamps, (True, False)))
        flight.until_value("panel.outputs.counts", round(22.2 / 1.25e-3))
        flight.client.set({"panel.parameters.blink": True})
        until("the other lamp blinks", lambda: chip.level(_BLINKER))
        until("the other lamp blinks", lambda: not chip.level(_BLINKER))
        flight.client.set({"panel.parameters.blink": False})
        chip.remove()
        flight.until_value("panel.outputs.pressed", False)
        flight.until_said("device 'buttons' is not there")
        chip = GpioChip("panel", _LINES)
        press(chip, True)
        back_s = until_levels(chip, lamps, (True, False))
        chip.pull(_LAMP, False)
        chip.pull(_BLINKER, True)
        until_levels(chip, lamps, (True, False))
        free_s = after(flight.process.kill, partial(until_levels, chip, lamps, (False, True)))
    chip.remove()
    return (
        f"lamp {in_ms(lit_s)} after the button; chip back: {in_ms(back_s)}; "
        f"kill -9: as they are pulled after {in_ms(free_s)}"
    )


def try_valves(bus: I2cBus, craft: Craft) -> str:
    """kill -9 of a flight whose actuators fcsl-guard drives by lines."""
    del bus
    chip, times = GpioChip("panel", _LINES), []
    with Guard(craft, craft.plan("valves")) as guard:
        until_levels(chip, _VALVES, (False, True))
        for _ in range(REPETITIONS):
            with Flight(craft, "--guard", guard.slot) as flight:
                flight.set(throttle=0.75, steer=-1.0, arm=True)
                until_levels(chip, _VALVES, (True, False))
                times.append(after(flight.process.kill, partial(until_levels, chip, _VALVES, (False, True))))
        if guard.end() != 0:
            raise Failed(f"the guard ends with an error: {guard.said()}")
    chip.remove()
    return describe(times, SAFE_AFTER_S)
