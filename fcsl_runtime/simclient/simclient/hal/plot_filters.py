# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal describe board.plan --plot FILE`: gain and group delay of the filters of a plan, over frequency."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..board.plan import Plan, Sensor, read_plan
from ..errors import TwinError
from ..view.picture import SUFFIXES, Line, draw_panel, new_figure, pyplot, save
from .filter_response import Array, response

_NS_PER_S = 1e9
_POINTS = 1000
_DECADES = 2.0
_FLOOR_DB = -60.0


@dataclass(frozen=True, eq=False)
class Response:
    """Of one device's filters of a quantity, up to half the device's rate."""

    device: str
    hz: Array
    gain_db: Array
    delay_ms: Array


def plot_filters(path: str, output: str) -> None:
    """Writes the picture, complete or not at all. Raises TwinError and BagError."""
    if Path(output).suffix.lower() not in SUFFIXES:
        raise TwinError(f"{output}: the name of a picture ends in {', '.join(SUFFIXES)}")
    plan = read_plan(path)
    found = responses(plan)
    if not found:
        raise TwinError(f"{path}: nothing to plot: no sensor has a filter; see `low_pass_hz` and `notch`")
    figure = _draw(plan, found)
    try:
        save(figure, output)
    finally:
        pyplot.close(figure)
    print(f"{output}: {Path(output).stat().st_size} bytes")


def responses(plan: Plan) -> dict[tuple[str, str], list[Response]]:
    """By sensor and quantity, in the order of the plan."""
    found: dict[tuple[str, str], list[Response]] = {}
    for sensor in plan.sensors:
        for quantity, one in _of_sensor(plan, sensor):
            found.setdefault((sensor.name, quantity), []).append(one)
    return found


def _of_sensor(plan: Plan, sensor: Sensor) -> Iterator[tuple[str, Response]]:
    for backend in sensor.backends:
        period_ns = plan.devices[backend.device].period_ns
        if period_ns == 0:  # without a rate there is no frequency
            continue
        rate_hz = _NS_PER_S / period_ns
        hz = rate_hz / 2 * np.logspace(-_DECADES, 0.0, _POINTS)
        for quantity, sections in backend.sections.items():
            gain, delay_s = response(sections, rate_hz, hz)
            gain_db = 20 * np.log10(np.maximum(gain, 10 ** (_FLOOR_DB / 20)))
            yield quantity, Response(backend.device, hz, gain_db, delay_s * 1e3)


def _draw(plan: Plan, found: dict[tuple[str, str], list[Response]]) -> Any:
    """The matplotlib figure: two panels for each sensor and quantity, a curve for each device."""
    title = f"{plan.machine}: filters, ticks {plan.tick_hz} Hz"
    figure, axes = new_figure(2 * len(found), title, "frequency, Hz")
    for place, ((sensor, quantity), of_devices) in enumerate(found.items()):
        gain, delay = axes[2 * place : 2 * place + 2]
        _mark_folding(gain, plan.tick_hz / 2, of_devices)
        draw_panel(gain, f"{sensor} {quantity}: gain, dB", [Line(r.device, r.hz, r.gain_db) for r in of_devices])
        gain.set_ylim(_FLOOR_DB, 3.0)
        _mark_folding(delay, plan.tick_hz / 2, of_devices)
        draw_panel(delay, "group delay, ms", [Line(r.device, r.hz, r.delay_ms) for r in of_devices])
        delay.set_ylim(bottom=0.0)
    axes[-1].set_xscale("log")
    axes[-1].xaxis.set_major_formatter("{x:g}")
    return figure


def _mark_folding(axis: Any, half_tick_hz: float, of_devices: list[Response]) -> None:
    """Grey beyond half the tick rate: what passes the filter there, the machine sees at a lower frequency."""
    end_hz = max(r.hz[-1] for r in of_devices)
    if half_tick_hz < end_hz:
        axis.axvspan(half_tick_hz, end_hz, color="#EEEEEE", zorder=0, label=f"folds, above {half_tick_hz:g} Hz")
        axis.axvline(half_tick_hz, color="#888888", linewidth=0.8, zorder=1)
