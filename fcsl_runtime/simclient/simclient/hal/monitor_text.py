# SPDX-License-Identifier: Apache-2.0
"""Snapshots of `fcsl hal monitor` as text: a table for a terminal, a line per sensor elsewhere."""

from __future__ import annotations

import math
from typing import Any

from fcsl_compiler.api.board import KINDS

from ..vars.show import table, with_unit
from .describe import show_numbers

_HEAD = ("device", "", "rate", "age", "errors", "dropped", "lost", "rejected", "")


def table_lines(snapshot: dict[str, Any]) -> list[str]:
    lines = table([_HEAD, *(_device_row(device) for device in snapshot["devices"])]).splitlines()
    for sensor in snapshot["sensors"]:
        primary = sensor["primary"]
        lines += [
            "",
            f"{sensor['name']} ({sensor['kind']}): {f'primary {primary}' if primary else 'no healthy device'}",
        ]
        lines += [f"  {line}" for line in table(_quantity_rows(sensor)).splitlines()]
    if snapshot["hardware"]:
        rows = [(one["name"], f"{one['signal']} of {one['device']}", _value(one)) for one in snapshot["hardware"]]
        lines += ["", "hardware", *(f"  {line}" for line in table(rows).splitlines())]
    return lines


def _value(one: dict[str, Any]) -> str:
    """Of a pin or a converter."""
    return "-" if one["value"] is None else f"{one['value']:g}"


def _quantity_rows(sensor: dict[str, Any]) -> list[tuple[str, ...]]:
    """A row per quantity: what the machine would get, and what each device told before its correction."""
    heads = [f"{backend['device']}: {backend['condition']}" for backend in sensor["backends"]]
    columns = [sensor["values"] or {}, *(backend["raw"] or {} for backend in sensor["backends"])]
    rows: list[tuple[str, ...]] = [("", "corrected", *heads)]
    for quantity in KINDS[sensor["kind"]]:
        if any(quantity.name in column for column in columns):
            unit = quantity.unit or ""
            texts = (show_numbers(c[quantity.name], 4, unit) if quantity.name in c else "-" for c in columns)
            rows.append((with_unit(quantity.name, unit), *texts))
    return rows


def sensor_lines(snapshot: dict[str, Any], time_s: float) -> list[str]:
    devices = {device["name"]: device for device in snapshot["devices"]}
    lines = []
    for sensor in snapshot["sensors"]:
        states = []
        for backend in sensor["backends"]:
            device = devices[backend["device"]]
            condition = backend["condition"] if device["there"] else "not there"
            counts = f"{device['errors']} errors"
            if device["rejected"]:
                counts += f", {device['rejected']} of {device['bytes']} bytes rejected"
            why = f": {device['why']}" if device["why"] else ""
            states.append(f"{device['name']} {_rate(device['rate_hz'])} {condition}, {counts}{why}")
        values = _values(sensor["kind"], sensor["values"])
        lines.append(
            f"{time_s:.1f} s  {sensor['name']}: {sensor['primary'] or 'no healthy device'}  {values}  ({'; '.join(states)})"
        )
    if snapshot["hardware"]:
        values = "  ".join(f"{one['name']}: {_value(one)}" for one in snapshot["hardware"])
        lines.append(f"{time_s:.1f} s  hardware: {values}")
    return lines


def _device_row(device: dict[str, Any]) -> tuple[str, ...]:
    age = "-" if math.isnan(device["age_s"]) else f"{device['age_s']:.3f} s"
    counts = (str(device[name]) for name in ("errors", "dropped", "lost", "rejected"))
    state = "there" if device["there"] else "not there"
    return (device["name"], state, _rate(device["rate_hz"]), age, *counts, device["note"])


def _rate(rate_hz: float) -> str:
    return "-" if math.isnan(rate_hz) else f"{rate_hz:.1f} Hz"


def _values(kind: str, values: dict[str, list[float]] | None) -> str:
    """Quantities with their units, in the order of the kind."""
    if not values:
        return "-"
    units = {quantity.name: quantity.unit or "" for quantity in KINDS[kind]}
    return "  ".join(
        f"{name} {with_unit(show_numbers(numbers, unit=units[name]), units[name])}" for name, numbers in values.items()
    )
