# SPDX-License-Identifier: Apache-2.0
"""A GPIO chip of the kernel's gpio-sim."""

from __future__ import annotations

from pathlib import Path

from . import sysfs


class GpioChip:
    """`count` lines. `remove` takes it away."""

    def __init__(self, label: str, count: int) -> None:
        self._config = sysfs.CONFIGFS / "gpio-sim" / label
        self._bank = self._config / "bank0"
        self._config.mkdir()
        self._bank.mkdir()
        sysfs.put(self._bank / "num_lines", count)
        sysfs.put(self._bank / "label", label)
        sysfs.put(self._config / "live", 1)
        #: /dev/gpiochipN
        self.path = Path("/dev") / sysfs.get(self._bank / "chip_name")
        device = sysfs.get(self._config / "dev_name")
        self._lines = Path("/sys/devices/platform") / device / self.path.name

    def pull(self, line: int, high: bool) -> None:
        """What is on the line from outside."""
        sysfs.put(self._lines / f"sim_gpio{line}" / "pull", "pull-up" if high else "pull-down")

    def level(self, line: int) -> bool:
        return sysfs.get(self._lines / f"sim_gpio{line}" / "value") == "1"

    def remove(self) -> None:
        sysfs.put(self._config / "live", 0)
        self._bank.rmdir()
        self._config.rmdir()
