# SPDX-License-Identifier: Apache-2.0
"""Runs in the guest: flies the craft on real drivers. `python3 -m hardware.flights FOLDER [NAME…]`, with what flight/craft.py built."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

from .flight.craft import Craft
from .flight.inertial import BOTTOM, TOP, try_buffer, try_inertial, try_pace
from .flight.lines import try_lines, try_valves
from .flight.others import try_can, try_rc, try_slow
from .flight.outputs import (
    try_commands,
    try_full_disk,
    try_guard_end,
    try_guard_kill,
    try_hang,
    try_kill,
    try_pwm_unplug,
    try_stop,
)  # fmt: skip
from .flight.whole import try_whole
from .guest.chips import Bmp280, Ina226, LidarLite, Mag3110
from .guest.i2c import I2cBus
from .guest.pca9685 import Pca9685
from .trials import run_trials

_TRIALS: tuple[Callable[[I2cBus, Craft], str], ...] = (
    try_inertial, try_buffer, try_pace, try_slow, try_rc, try_can,
    try_commands, try_kill, try_stop, try_hang, try_full_disk, try_guard_end, try_guard_kill, try_pwm_unplug, try_lines, try_valves, try_whole,
)  # fmt: skip


def main() -> int:
    craft = Craft(Path(sys.argv[1]))
    chips = (Bmp280, Mag3110, LidarLite, Ina226, Pca9685)
    bus = I2cBus(TOP, BOTTOM, *(chip.ADDRESS for chip in chips))
    trials = {f.__name__.removeprefix("try_"): partial(f, bus, craft) for f in _TRIALS}
    return run_trials({name: trial for name, trial in trials.items() if name in (sys.argv[2:] or trials)})


if __name__ == "__main__":
    sys.exit(main())
