# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal monitor`: the devices and sensors of a plan, at the tick rate of its machine, without the machine."""

from __future__ import annotations

import contextlib
import json
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack

from ..board.plan import find_sensor, read_plan
from ..errors import TwinError
from ..screen import Screen
from ..vars.show import jsonable
from .errors import Refused
from .monitor_plot import Curves
from .monitor_text import sensor_lines, table_lines
from .watch import Watch

_NS_PER_S = 1_000_000_000
#: Time between two redraws, and between two lines.
_REDRAW_NS, _LINE_NS = 100_000_000, _NS_PER_S


def monitor(path: str, sensor: str | None, seconds: float | None, as_json: bool, as_plot: bool) -> None:
    """Until `seconds` have passed (None: until Ctrl-C). Raises Refused where a device is missing at that time."""
    plan = read_plan(path)
    sensors = list(range(len(plan.sensors))) if sensor is None else [find_sensor(plan, sensor)]
    with_hardware = sensor is None and not as_plot
    if not sensors and not (with_hardware and plan.inputs):
        raise TwinError(
            f"{path}: the plan has no sensors{'' if plan.inputs else ', and no pins or converters to read'}"
        )
    live = sys.stdout.isatty() and not as_json
    if as_plot and not live and seconds is None:
        raise TwinError("without a terminal --plot draws once, at the end: give --seconds")
    with ExitStack() as opened:
        watch = Watch(path, plan)
        opened.callback(watch.close)
        curves = Curves(watch, sensors) if as_plot else None
        show = _shower(watch, sensors, with_hardware, curves, as_json, live, opened)
        with contextlib.suppress(KeyboardInterrupt):  # the normal end
            _run(watch, seconds, curves, show, _REDRAW_NS if live else _LINE_NS, shows_news=not live)
            _check(watch, sensors, with_hardware)


Show = Callable[[int, bool], None]


def _shower(
    watch: Watch,
    sensors: list[int],
    with_hardware: bool,
    curves: Curves | None,
    as_json: bool,
    live: bool,
    opened: ExitStack,
) -> Show:
    """What shows the state at a time in ns since the start; the flag is that of the last call."""
    screen = opened.enter_context(Screen()) if live else None

    def lines(time_ns: int) -> list[str]:
        if curves is not None:
            return curves.lines(*Screen.size())
        snapshot = watch.snapshot(time.monotonic_ns(), sensors, with_hardware)
        if as_json:
            return [json.dumps(jsonable({"time_s": time_ns / _NS_PER_S, **snapshot}))]
        return table_lines(snapshot) if live else sensor_lines(snapshot, time_ns / _NS_PER_S)

    def show(time_ns: int, is_last: bool) -> None:
        if screen is not None:
            screen.draw(lines(time_ns))
        elif curves is None or is_last:
            print("\n".join(lines(time_ns)), flush=True)

    return show


def _run(
    watch: Watch, seconds: float | None, curves: Curves | None, show: Show, period_ns: int, shows_news: bool
) -> None:
    begun = time.monotonic_ns()
    shown = begun
    for tick in _ticks(watch.plan.tick_hz, begun, seconds):
        now = time.monotonic_ns()
        for text in watch.tick(now):
            if shows_news:
                print(f"fcsl hal: {text}", file=sys.stderr, flush=True)
        if curves is not None:
            curves.take(tick)
        if now - shown >= period_ns:
            shown += (now - shown) // period_ns * period_ns
            show(now - begun, False)
    show(time.monotonic_ns() - begun, True)


def _ticks(tick_hz: int, begun_ns: int, seconds: float | None) -> Iterator[int]:
    """The numbers of ticks, each at its time. Those that are late already are left out."""
    tick = 0
    while seconds is None or tick < seconds * tick_hz:
        time.sleep(max(0, begun_ns + tick * _NS_PER_S // tick_hz - time.monotonic_ns()) / _NS_PER_S)
        yield tick
        tick = max(tick + 1, (time.monotonic_ns() - begun_ns) * tick_hz // _NS_PER_S)


def _check(watch: Watch, sensors: list[int], with_hardware: bool) -> None:
    missing = [d for d in watch.snapshot(time.monotonic_ns(), sensors, with_hardware)["devices"] if not d["there"]]
    if missing:
        raise Refused("; ".join(f"device '{d['name']}' {d['note'] or 'is not there'}" for d in missing))
