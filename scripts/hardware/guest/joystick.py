# SPDX-License-Identifier: Apache-2.0
"""A joystick of the kernel's uinput."""

from __future__ import annotations

import fcntl
import os
import struct
import time
from collections.abc import Mapping
from pathlib import Path

_UI_DEV_CREATE, _UI_DEV_DESTROY, _UI_DEV_SETUP, _UI_ABS_SETUP = 0x5501, 0x5502, 0x405C5503, 0x401C5504
_UI_SET_EVBIT, _UI_SET_KEYBIT, _UI_SET_ABSBIT = 0x40045564, 0x40045565, 0x40045567
_EV_SYN, _EV_KEY, _EV_ABS = 0, 1, 3
_BUS_VIRTUAL = 6
_EVENT = "llHHi"  # struct input_event
_APPEARS_S = 2.0


class Joystick:
    """`axes`: code (ABS_X is 0) to minimum and maximum; `buttons`: codes (BTN_JOYSTICK is 0x120). `close` pulls its plug."""

    def __init__(self, name: str, axes: Mapping[int, tuple[int, int]], buttons: tuple[int, ...]) -> None:
        self.name = name
        self._file = os.open("/dev/uinput", os.O_WRONLY)
        for kind in (_EV_KEY, _EV_ABS):
            fcntl.ioctl(self._file, _UI_SET_EVBIT, kind)
        for button in buttons:
            fcntl.ioctl(self._file, _UI_SET_KEYBIT, button)
        for axis, (least, most) in axes.items():
            fcntl.ioctl(self._file, _UI_SET_ABSBIT, axis)
            middle = (least + most) // 2
            fcntl.ioctl(self._file, _UI_ABS_SETUP, struct.pack("H2x6i", axis, middle, least, most, 0, 0, 0))
        fcntl.ioctl(self._file, _UI_DEV_SETUP, struct.pack("4H80sI", _BUS_VIRTUAL, 0, 0, 1, name.encode(), 0))
        fcntl.ioctl(self._file, _UI_DEV_CREATE)

    @property
    def path(self) -> Path:
        """/dev/input/eventN. Raises TimeoutError when it does not appear."""
        limit = time.monotonic() + _APPEARS_S
        while time.monotonic() < limit:
            for event in Path("/sys/class/input").glob("event*"):
                if (event / "device/name").read_text().strip() == self.name:
                    return Path("/dev/input") / event.name
            time.sleep(0.01)
        raise TimeoutError(f"no input device {self.name}")

    def move(self, axes: Mapping[int, int], buttons: Mapping[int, bool] | None = None) -> None:
        """One report."""
        events = [(_EV_ABS, code, value) for code, value in axes.items()]
        events += [(_EV_KEY, code, int(down)) for code, down in (buttons or {}).items()]
        for kind, code, value in [*events, (_EV_SYN, 0, 0)]:
            os.write(self._file, struct.pack(_EVENT, 0, 0, kind, code, value))

    def close(self) -> None:
        fcntl.ioctl(self._file, _UI_DEV_DESTROY)
        os.close(self._file)
