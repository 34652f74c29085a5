# SPDX-License-Identifier: Apache-2.0
"""When a backend counts as healthy."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..model.types import F64, Array
from ..parse.json_reader import ConfigReader
from ..parse.json_source import JsonNode
from .devices import Device
from .quantities import by_quantity, measured

MIN_AGE_S, MAX_TIME_S = 0.001, 3600.0
MIN_TOLERANCE, MAX_TOLERANCE = 1e-12, 1e12
_RECOVER_S = 1.0
#: Without `max_age_s`: nominal periods, and at least so many seconds and ticks.
_AGE_PERIODS, _AGE_S, _AGE_TICKS = 3, 0.02, 2
#: Of devices without a nominal period; receivers of satellites are often set to 1 Hz.
_AGE_WAITING_S, _AGE_GNSS_S = 0.5, 1.5
#: Only with two others that agree a backend can be the one that is wrong.
_VOTERS = 3


@dataclass(frozen=True)
class Health:
    """Times in s. `stuck_s` 0: equal readings are no fault."""

    max_age_s: float
    stuck_s: float
    recover_s: float
    limits: dict[str, tuple[float, float]]
    tolerances: dict[str, float]


def read_health(
    node: JsonNode | None, kind: str, devices: Sequence[Device], tick_hz: int | None, reader: ConfigReader
) -> Health:
    """`devices`: of the sensor's backends. Without tick_hz the machine has an error."""
    optional = ("max_age_s", "stuck_s", "recover_s", "limits", "tolerance")
    keys = (reader.object(node, "`health`", (), optional) or {}) if node is not None else {}
    age = reader.number(keys.get("max_age_s"), "`max_age_s`", MIN_AGE_S, MAX_TIME_S)
    stuck = reader.number(keys.get("stuck_s"), "`stuck_s`", 0.0, MAX_TIME_S)
    recover = reader.number(keys.get("recover_s"), "`recover_s`", 0.0, MAX_TIME_S)
    if age is not None:
        _check_age(age, keys["max_age_s"], devices, reader)
    return Health(
        age if age is not None else _default_age(kind, devices, tick_hz or 1),
        stuck or 0.0,
        _RECOVER_S if recover is None else recover,
        _limits(keys.get("limits"), kind, reader),
        _tolerances(keys.get("tolerance"), kind, len(devices), reader),
    )


def _default_age(kind: str, devices: Sequence[Device], tick_hz: int) -> float:
    """Long enough for the slowest backend."""
    waiting_s = _AGE_GNSS_S if kind == "gnss" else _AGE_WAITING_S
    ages = [_AGE_PERIODS * d.period_s if d.rate_hz else waiting_s for d in devices]
    return max(_AGE_S, _AGE_TICKS / tick_hz, *ages)


def _check_age(age_s: float, node: JsonNode, devices: Sequence[Device], reader: ConfigReader) -> None:
    for device in devices:
        if age_s <= device.period_s:
            message = f"`max_age_s` is {age_s:g}, and `{device.name}` has a reading every {device.period_s:g} s"
            notes = [(device.span, "the device")]
            fix = f"it is longer than that; {_AGE_PERIODS} periods are the default"
            reader.sink.error("E513", message, node.span, help=fix, notes=notes)


def _limits(node: JsonNode | None, kind: str, reader: ConfigReader) -> dict[str, tuple[float, float]]:
    found: dict[str, tuple[float, float]] = {}
    for quantity, value in by_quantity(node, "`limits`", measured(kind), reader):
        pair = reader.value(value, Array(F64, (2,)), f"`limits` of `{quantity.name}`")
        if pair is None:
            continue
        low, high = map(float, pair)
        if not low < high:
            message = f"no `{quantity.name}` is between {low:g} and {high:g}"
            reader.sink.error("E513", message, value.span, help="write the lower limit first")
        found[quantity.name] = (low, high)
    return found


def _tolerances(node: JsonNode | None, kind: str, backends: int, reader: ConfigReader) -> dict[str, float]:
    found: dict[str, float] = {}
    for quantity, value in by_quantity(node, "`tolerance`", measured(kind), reader):
        what = f"`tolerance` of `{quantity.name}`"
        distance = reader.number(value, what, MIN_TOLERANCE, MAX_TOLERANCE)
        if distance is not None:
            found[quantity.name] = distance
            if backends < _VOTERS:
                why = f"two that agree judge a third, and the sensor has {backends}"
                reader.sink.warning("W505", f"{what} has no effect", value.span, why=why)
    return found
