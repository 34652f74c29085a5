# SPDX-License-Identifier: Apache-2.0
"""Reads devices by sysfs and /dev as plainly as that can be done: what smoke.py compares with what guest/ set."""

from __future__ import annotations

import os
import struct
import time
from dataclasses import dataclass
from pathlib import Path

from .guest import sysfs

_TRIGGERS = sysfs.CONFIGFS / "iio/triggers/hrtimer"
_IIO = Path("/sys/bus/iio/devices")


def number(attribute: Path) -> float:
    return float(sysfs.get(attribute))


def channel(device: Path, name: str) -> float:
    """A channel in IIO's unit: in_NAME_input, or in_NAME_raw with the scale of the channel or of its type."""
    processed = device / f"in_{name}_input"
    if processed.exists():
        return number(processed)
    own, shared = device / f"in_{name}_scale", device / f"in_{name.rsplit('_', 1)[0]}_scale"
    return number(device / f"in_{name}_raw") * number(own if own.exists() else shared)


def add_timer(name: str, rate: float) -> Path:
    """Makes a timer trigger and returns its folder."""
    (_TRIGGERS / name).mkdir()
    trigger = sysfs.find(_IIO, "name", name)
    sysfs.put(trigger / "sampling_frequency", rate)
    return trigger


@dataclass(frozen=True)
class Scans:
    """`values` are raw, a row per scan; times are of CLOCK_MONOTONIC in s."""

    values: list[tuple[int, ...]]
    stamps: list[float]
    read: list[float]


def capture(device: Path, trigger: str, channels: tuple[str, ...], count: int) -> Scans:
    """Reads `count` scans of channels that are signed, of 16 bits and little-endian."""
    elements = device / "scan_elements"
    for name in (*channels, "timestamp"):
        sysfs.put(elements / (f"in_{name}_en"), 1)
    sysfs.put(device / "current_timestamp_clock", "monotonic")
    sysfs.put(device / "trigger/current_trigger", trigger)
    sysfs.put(device / "buffer/enable", 1)
    try:
        return _read_scans(device, len(channels), count)
    finally:
        sysfs.put(device / "buffer/enable", 0)
        sysfs.put(device / "trigger/current_trigger", "")


def _read_scans(device: Path, width: int, count: int) -> Scans:
    padding = -2 * width % 8
    layout = struct.Struct(f"<{width}h{padding}xq")
    values, stamps, read = [], [], []
    file = os.open(f"/dev/{device.name}", os.O_RDONLY)
    try:
        for _ in range(count):
            *row, stamp = layout.unpack(os.read(file, layout.size))
            read.append(time.monotonic())
            values.append(tuple(row))
            stamps.append(stamp * 1e-9)
    finally:
        os.close(file)
    return Scans(values, stamps, read)
