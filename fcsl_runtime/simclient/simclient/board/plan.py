# SPDX-License-Identifier: Apache-2.0
"""The plan of a board, as far as Python reads it: names. fcsl_runtime/board/board_plan.h defines the format."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..errors import TwinError


@dataclass
class PlannedSensor:
    """`channels` by quantity; `devices` in order of preference."""

    name: str
    kind: str
    devices: list[str] = field(default_factory=list)
    channels: dict[str, str] = field(default_factory=dict)


@dataclass
class PlannedDevice:
    """`period_ns` 0: its driver waits for samples."""

    name: str
    driver: str
    address: str
    period_ns: int


@dataclass
class Plan:
    machine: str = ""
    devices: list[PlannedDevice] = field(default_factory=list)
    sensors: list[PlannedSensor] = field(default_factory=list)


def read_plan(path: str | Path) -> Plan:
    """Raises TwinError for a file that `fcslc board` has not written; the native reader checks all of it."""
    plan = Plan()
    try:
        lines = Path(path).read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TwinError(f"{path}: cannot be read: {error}") from None
    if lines[:1] != ["fcsl-board-plan 1"]:
        raise TwinError(f"{path}: not a plan that `fcslc board` wrote")
    for line in lines[1:]:
        match line.split(" "):
            case ["machine", name, _]:
                plan.machine = name
            case ["device", name, period_ns, driver, *address]:
                plan.devices.append(PlannedDevice(name, driver, " ".join(address), int(period_ns)))
            case ["sensor", name, kind]:
                plan.sensors.append(PlannedSensor(name, kind))
            case ["bind", quantity, channel]:
                plan.sensors[-1].channels[quantity] = channel
            case ["backend", device]:
                plan.sensors[-1].devices.append(device)
    return plan


def bound_channels(path: str | Path) -> frozenset[str]:
    """The channels that the board's sensors feed. Raises TwinError."""
    return frozenset(channel for sensor in read_plan(path).sensors for channel in sensor.channels.values())
