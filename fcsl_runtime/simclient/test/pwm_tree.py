# SPDX-License-Identifier: Apache-2.0
"""A tree of files that stands for a PWM chip in sysfs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Sysfs:
    """A PWM chip of 16 channels; `channels`: those that a test uses."""

    root: Path
    channels: tuple[int, ...] = (0, 3)

    @property
    def chip(self) -> Path:
        return self.root / "class/pwm/pwmchip2"

    def make(self) -> None:
        (self.root / "devices/1-0040").mkdir(parents=True)
        self.chip.mkdir(parents=True)
        (self.chip / "device").symlink_to("../../../devices/1-0040")
        (self.chip / "npwm").write_text("16\n")
        for index in self.channels:
            channel = self.chip / f"pwm{index}"
            channel.mkdir()
            for name, text in {"period": "0", "duty_cycle": "0", "polarity": "inversed", "enable": "0"}.items():
                (channel / name).write_text(text + "\n")

    def get(self, index: int, name: str = "duty_cycle") -> str:
        """The first line: a write does not cut a plain file."""
        return (self.chip / f"pwm{index}" / name).read_text().partition("\n")[0]

    def pulses(self) -> tuple[str, ...]:
        return tuple(self.get(index) for index in self.channels)
