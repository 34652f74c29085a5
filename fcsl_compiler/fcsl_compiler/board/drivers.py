# SPDX-License-Identifier: Apache-2.0
"""The drivers that come with FCSL, and their signals: drivers.json of fcsl_hal."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from ..base.diagnostics import nearest
from ..base.packages import package_share
from ..base.source import Span
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .limits import check_name

_SIGNAL = re.compile(r"[A-Za-z_]\w*", re.ASCII)


#: Kinds of drivers: read at a rate; waits, and the device samples at the rate that it is set to; waits for the next sample;
#: writes.
POLLED, BUFFERED, WAITING, ACTUATOR = "polled", "buffered", "waiting", "actuator"


@dataclass(frozen=True)
class Driver:
    """A driver that comes with FCSL. `signals`: of an actuator, those that an output can drive, one f64 each. `pins`: whether
    they may be "levels" or "counts" of the machine's hardware. `pulse_hz`: how often they are pulses of so many microseconds,
    where the address says nothing else; 0: they are none. `serial`: its device is a serial port."""

    kind: str
    signals: tuple[str, ...]
    serial: bool
    pins: tuple[str, ...]
    pulse_hz: float


def known_drivers() -> dict[str, Driver]:
    """By name. Raises PackageNotFound where `fcsl_hal` is not installed."""
    return _read(package_share("fcsl_hal") / "drivers.json")


def kind_of(driver: str) -> str:
    """Of a driver that comes with FCSL; of another one nothing is known: ""."""
    known = known_drivers().get(driver)
    return known.kind if known else ""


@cache
def _read(path: Path) -> dict[str, Driver]:
    return {row["name"]: _driver(row) for row in json.loads(path.read_text(encoding="utf-8"))}


def _driver(row: dict[str, Any]) -> Driver:
    signals = tuple(name for text in row["signals"] for name in _numbered(text))
    return Driver(row["kind"], signals, row.get("serial", False), tuple(row.get("pins", ())), row.get("pulse_hz", 0.0))


def _numbered(text: str) -> Iterator[str]:
    """`line0..63` is short for line0, line1 and so on."""
    match = re.fullmatch(r"(\w*\D)(\d+)\.\.(\d+)", text, re.ASCII)
    yield from (f"{match[1]}{i}" for i in range(int(match[2]), int(match[3]) + 1)) if match else (text,)


def read_signal(node: JsonNode | None, what: str, reader: ConfigReader) -> str | None:
    """The name of a signal. None after reporting an error."""
    name = reader.string(node, what)
    if node is None or name is None:
        return None
    if not _SIGNAL.fullmatch(name):
        fix = "letters, digits and underscores, as the driver names it"
        reader.sink.error("E203", f"`{name}` is not the name of a signal", node.span, help=fix)
        return None
    return name if check_name(name, node.span, reader) else None


def check_signal(name: str, driver: str, span: Span, reader: ConfigReader) -> None:
    """Reports a signal that the driver does not have, or that no output can drive. Nothing is known of the drivers of libraries."""
    known = known_drivers().get(driver)
    if known is not None and name not in known.signals:
        hint = nearest(name, known.signals) or f"it has {_listed(known.signals)}"
        reader.sink.error("E521", f"driver `{driver}` has no signal `{name}`", span, help=hint)


def _listed(signals: tuple[str, ...]) -> str:
    """Ten names at most: numbered ones are many."""
    return ", ".join(signals) if len(signals) <= 10 else f"{', '.join(signals[:2])}, … {signals[-1]}"
