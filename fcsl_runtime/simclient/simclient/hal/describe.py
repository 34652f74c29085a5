# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal describe DRIVER [DEVICE]`: the signals of a driver, and what a device tells of them now."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable
from typing import Any

from ..vars.show import jsonable, table
from .driver import Device, Driver, Sample, any_driver
from .driver_abi import OK, SENSOR
from .errors import Refused

_POLL_S = 0.02


def describe_driver(name: str, address: str | None, seconds: float, as_json: bool) -> None:
    """Raises TwinError without the driver, Refused where the device tells nothing."""
    driver = any_driver(name)
    sample, why = None, ""
    if address is not None:
        try:
            sample = _read_sample(driver, address, seconds)
        except Refused as error:
            why = str(error)
    if as_json:
        print(json.dumps(_as_json(driver, address, sample, why)))
    else:
        print("\n".join(_lines(driver, sample)))
    if why:
        raise Refused(why)
    if address is not None and sample is None and not as_json:
        print(f"device '{address}' is there; an actuator is not opened, because opening may change what it does")


def _read_sample(driver: Driver, address: str, seconds: float) -> Sample | None:
    """A sample of a sensor; None for an actuator that is there. Raises Refused."""
    if driver.direction == SENSOR:
        with driver.open(address, optional=[signal.name for signal in driver.signals]) as device:
            return _first_sample(device, seconds)
    status, why = driver.probe(address)
    if status != OK:
        raise Refused(f"device '{address}' of driver '{driver.name}' is not there: {why}")
    return None


def _first_sample(device: Device, seconds: float) -> Sample:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        sample = device.read()
        if sample is not None:
            return sample
        if not device.driver.waits:
            time.sleep(_POLL_S)
    why = f": {device.silence()}" if device.silence() else ""
    raise Refused(f"device '{device.address}' of driver '{device.driver.name}' gave no sample in {seconds:g} s{why}")


def _lines(driver: Driver, sample: Sample | None) -> list[str]:
    rows = []
    for signal in driver.signals:
        value = [] if sample is None else [show_numbers(sample.values[signal.name], unit=signal.unit)]
        rows.append([f"  {signal.name}", signal.type_text, signal.unit or "-", *value, signal.doc])
    kind = "sensor" if driver.direction == SENSOR else "actuator"
    pace = "" if kind == "actuator" else ", it sets the pace" if driver.waits else ", polled: it needs a rate_hz"
    return [f"{driver.name} ({kind}{pace}): {driver.doc}", table(rows)]


def show_numbers(values: Iterable[float], digits: int = 6, unit: str = "") -> str:
    """So many digits of each, of a coordinate those to a centimetre; where all are NaN, that nothing is told."""
    form = ".7f" if unit == "deg" else f".{digits}g"
    texts = ["-" if math.isnan(value) else f"{value:{form}}" for value in values]
    if all(text == "-" for text in texts):
        return "not told"
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"


def _as_json(driver: Driver, address: str | None, sample: Sample | None, why: str) -> dict[str, Any]:
    described: dict[str, Any] = {
        "driver": driver.name,
        "direction": "sensor" if driver.direction == SENSOR else "actuator",
        "waits": driver.waits,
        "doc": driver.doc,
        "signals": [
            {"name": s.name, "type": s.type, "count": s.count, "unit": s.unit, "doc": s.doc} for s in driver.signals
        ],
    }
    if address is not None:
        values = None if sample is None else jsonable(sample.values)
        described |= {"device": address, "values": values, "why": why}
    return described
