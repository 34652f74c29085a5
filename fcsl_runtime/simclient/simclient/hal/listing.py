# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal list`: what is there, and which driver would take it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from typing import Any

from ..errors import TwinError
from ..vars.show import table
from .driver import any_driver
from .driver_abi import OK
from .found import Candidate, Found
from .found_devices import find_devices

_HEAD = ("kind", "name", "driver", '"device" in board.json', "measures", "")


def list_devices(as_json: bool) -> None:
    listed = [(found, [_probe(candidate) for candidate in found.candidates]) for found in find_devices()]
    if as_json:
        print(json.dumps([_as_json(found, reasons) for found, reasons in listed]))
    elif listed:
        print(table([_HEAD, *(row for found, reasons in listed for row in _rows(found, reasons))]))
    else:
        print(
            "this computer has no IIO device, PWM chip, power supply, thermal zone, input device, serial port or CAN interface"
        )


def _probe(candidate: Candidate) -> str:
    """Why the driver would not take it; "" if it would."""
    try:
        status, why = any_driver(candidate.driver).probe(candidate.probed or candidate.device)
    except TwinError:
        return "no such driver comes with this FCSL"
    return "" if status == OK else why


def _rows(found: Found, reasons: Iterable[str]) -> list[tuple[str, ...]]:
    """One for each text for the board: several drivers may take the same."""
    if not found.candidates:
        return [(found.kind, found.name, "-", "-", ", ".join(found.measures) or "-", found.why)]
    by_device: dict[tuple[str, str], list[str]] = {}
    for candidate, why in zip(found.candidates, reasons, strict=True):
        by_device.setdefault((candidate.device, why), []).append(candidate.driver)
    measures = ", ".join(found.measures) or "what is connected"
    return [
        (found.kind, found.name, " or ".join(drivers), device, measures, why)
        for (device, why), drivers in by_device.items()
    ]


def _as_json(found: Found, reasons: Iterable[str]) -> dict[str, Any]:
    candidates = [
        {"driver": candidate.driver, "device": candidate.device, "ready": not why, "why": why}
        for candidate, why in zip(found.candidates, reasons, strict=True)
    ]
    return {
        "kind": found.kind,
        "name": found.name,
        "path": found.path,
        "measures": found.measures,
        "candidates": candidates,
        "why": "" if candidates else found.why,
    }
