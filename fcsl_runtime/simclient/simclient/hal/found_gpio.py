# SPDX-License-Identifier: Apache-2.0
"""GPIO chips of this computer."""

from __future__ import annotations

import fcntl
import os
import struct
from dataclasses import dataclass
from pathlib import Path

from .found import Candidate, Found, first_unique
from .sysfs import dev_root, folders

#: GPIO_GET_CHIPINFO_IOCTL, struct gpiochip_info: name, label, lines.
_GET_CHIPINFO, _CHIPINFO = 0x8044B401, struct.Struct("32s32sI")


@dataclass(frozen=True)
class _Chip:
    """`label` "" and `lines` 0: it cannot be asked. sysfs does not tell them."""

    path: Path
    label: str = ""
    lines: int = 0


def _query(path: Path) -> _Chip:
    answer = bytearray(_CHIPINFO.size)
    try:
        file = os.open(dev_root() / path.name, os.O_RDONLY | os.O_NONBLOCK | os.O_CLOEXEC)
        try:
            fcntl.ioctl(file, _GET_CHIPINFO, answer)
        finally:
            os.close(file)
    except OSError:
        return _Chip(path)
    _, label, lines = _CHIPINFO.unpack(answer)
    text = label.split(b"\0")[0].decode(errors="replace")
    return _Chip(path, text if text.isprintable() else "", lines)


def find_gpio() -> list[Found]:
    chips = [_query(path) for path in folders("bus/gpio/devices", "gpiochip")]
    names = {chip: [chip.label, chip.path.name] for chip in chips}
    found = []
    for chip in chips:
        device = first_unique(names[chip], names.values())
        measures = [f"{chip.lines} lines"] if chip.lines else []
        candidates = [Candidate(driver, device) for driver in ("gpio", "gpio_out")]
        found.append(Found("GPIO chip", chip.label or chip.path.name, str(chip.path), measures, candidates))
    return found
