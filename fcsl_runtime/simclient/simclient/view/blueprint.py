# SPDX-License-Identifier: Apache-2.0
"""The layout of the rerun viewer for a machine, derived from its topics, so it fits every machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from .lines import TIMELINE
from .scene import LINE_COLOURS, Cast, angle_entity
from .signals import ALTITUDE, STATUS_FIELDS, THROTTLE, VELOCITY, Signals, named, quaternions
from .summary import ANGLES
from .world import ROOT, World

#: Visible time range of a live run, in s.
_LIVE_S = 30.0
#: Most instances on the first page of a machine without a vehicle.
_MAX_PLOTS = 4
#: A viewer draws one page at a time; these limits keep a page fast for machines of any size.
_LINES_IN_PLOT, _PLOTS_IN_PANEL, _PANELS_ON_PAGE, _PAGES = 24, 4, 12, 16


class Plan:
    """Makes the blueprint of one run. `span` is its first and last time in s; None: a live run that continues.

    `reach` is the largest height or distance of the vehicle, in m.
    """

    def __init__(self, cast: Cast, world: World, span: tuple[float, float] | None, reach: float = 0.0):
        self._cast, self._world, self._live, self._reach = cast, world, span is None, reach
        boundary = rr.TimeRangeBoundary
        if span is None:
            sight = boundary.cursor_relative(seconds=-_LIVE_S), boundary.cursor_relative(seconds=0.0)
        else:
            sight = boundary.absolute(seconds=span[0]), boundary.absolute(seconds=span[1])
        self._sight = rrb.TimeAxis(view_range=rr.TimeRange(start=sight[0], end=sight[1]))

    def blueprint(self) -> rrb.Blueprint:
        parts: dict[str, list[Signals]] = {"outputs": self._cast.instances, "plant": self._cast.plant}
        for signals in self._cast.inside:
            parts.setdefault(signals.name.rpartition(".")[2], []).append(signals)
        pages = [self._part(name, its) for name, its in parts.items() if its]
        tabs = [self._overview(), *pages, self._states_page()]
        play = {"play_state": "following"} if self._live else {}
        return rrb.Blueprint(
            rrb.Tabs(*tabs, active_tab=0),
            rrb.TimePanel(timeline=TIMELINE, state="collapsed", **play),
            rrb.BlueprintPanel(state="collapsed"),
            rrb.SelectionPanel(state="collapsed"),
        )

    # ---- pages -----------------------------------------------------------------------------------------------

    def _overview(self) -> rrb.Container:
        """The first page: states on top, the vehicle on the left, its plots on the right."""
        plots = self._vehicle_plots() or self._first_plots()
        left: list[Any] = [self._vehicle()] if self._world else [self._health()]
        left.append(self._log())
        below = rrb.Horizontal(rrb.Vertical(*left, row_shares=[3, 1]), rrb.Vertical(*plots), column_shares=[2, 3])
        return rrb.Vertical(self._states(), below, row_shares=[1, 6], name="overview")

    def _vehicle_plots(self) -> list[rrb.TimeSeriesView]:
        groups = (("altitude, m", ALTITUDE), ("velocity, m/s", VELOCITY), ("throttle", THROTTLE))
        plots = []
        for title, quantity in groups:
            pairs = named(self._cast.signals, quantity)
            if pairs:
                plots.append(self._lines(title, [f"{s.topic}/{name}" for s, name in pairs]))
        attitudes = quaternions(self._cast.signals)
        for angle in ANGLES if attitudes else ():
            plots.append(self._lines(f"{angle}, deg", [angle_entity(s, name, angle) for s, name in attitudes]))
        return plots

    def _first_plots(self) -> list[Any]:
        shown = [self._panels(signals)[:1] for signals in self._cast.instances or self._cast.inside]
        return [panel for panels in shown for panel in panels][:_MAX_PLOTS]

    def _part(self, name: str, all_signals: Sequence[Signals]) -> rrb.Container:
        """A page with a panel for each instance; several pages if there are many."""
        panels = [(signals.name, panel) for signals in all_signals for panel in self._panels(signals)]
        pages = [panels[i : i + _PANELS_ON_PAGE] for i in range(0, len(panels), _PANELS_ON_PAGE)]
        if len(pages) <= 1:
            return rrb.Grid(*(panel for _, panel in panels), name=name)
        grids = [
            rrb.Grid(*(panel for _, panel in page), name=f"{page[0][0]} to {page[-1][0]}") for page in pages[:_PAGES]
        ]
        return rrb.Tabs(*grids, active_tab=0, name=name)

    def _states_page(self) -> rrb.Container:
        prefix = self._cast.prefix
        step = self._lines("states by number", [f"{prefix}/state/step", f"{prefix}/transitions/marker"])
        return rrb.Vertical(
            self._states(), step, self._health(), self._log(), row_shares=[1, 2, 3, 1.2], name="states and health"
        )

    # ---- views -----------------------------------------------------------------------------------------------

    def _lines(self, name: str, entities: Sequence[str], colours: Sequence[Sequence[int]] = ()) -> rrb.TimeSeriesView:
        """A plot; with `colours` each entity has a given colour instead of its instance's."""
        legend = rrb.PlotLegend(rrb.Corner2D.RightTop)
        looks = {e: rr.SeriesLines(colors=[c]) for e, c in zip(entities, colours, strict=False)}
        return rrb.TimeSeriesView(
            origin="/", contents=list(entities), name=name, plot_legend=legend, axis_x=self._sight, overrides=looks
        )

    def _panels(self, signals: Signals) -> list[Any]:
        """A panel for an instance, or several: plots below each other."""
        plots = self._plots(signals)
        parts = [plots[i : i + _PLOTS_IN_PANEL] for i in range(0, len(plots), _PLOTS_IN_PANEL)]
        return [part[0] if len(part) == 1 else rrb.Vertical(*part, name=signals.name) for part in parts]

    def _plots(self, signals: Signals) -> list[rrb.TimeSeriesView]:
        """A plot per unit, or several plots if there are many lines.

        Elements of an array have separate colours already.
        """
        plots = []
        for unit, names in _by_unit(signals).items():
            title = f"{signals.name}, {unit}" if unit else signals.name
            for some in _bunches(names, signals.sizes):
                scalars = [f"{signals.topic}/{name}" for name in some if not signals.sizes[name]]
                arrays = [f"{signals.topic}/{name}" for name in some if signals.sizes[name]]
                colours = [LINE_COLOURS[i % len(LINE_COLOURS)] for i in range(len(scalars))]
                plots.append(self._lines(title, scalars + arrays, colours))
        return plots

    def _states(self) -> rrb.StateTimelineView:
        return rrb.StateTimelineView(origin=f"{self._cast.prefix}/state", name="state", time_view=self._sight)

    def _health(self) -> rrb.StateTimelineView:
        lanes = [f"{signals.topic}/health" for signals in self._cast.instances]
        return rrb.StateTimelineView(origin=self._cast.prefix, contents=lanes, name="health", time_view=self._sight)

    def _log(self) -> rrb.TextLogView:
        prefix = self._cast.prefix
        contents = [f"{prefix}/{log}" for log in ("transitions", "health", "telemetry")]
        columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
        return rrb.TextLogView(origin=prefix, contents=contents, name="transitions and health", columns=columns)

    def _vehicle(self) -> rrb.Spatial3DView:
        """The whole flight from the side (live: beside the vehicle) with the trail so far; attitudes from close up."""
        if self._live and self._world.vehicle:
            beside = rrb.EyeControls3D(
                position=[-18.0, -22.0, 10.0], look_target=[0, 0, 2], tracking_entity=self._world.vehicle
            )
        else:
            top = max(10.0, self._reach) if self._world.vehicle else 3.0
            middle = top / 2 if self._world.vehicle else 0.0
            beside = rrb.EyeControls3D(position=[-0.9 * top, -1.1 * top, 0.7 * top], look_target=[0, 0, middle])
        start, now = rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.cursor_relative(seconds=0.0)
        up_to_now = rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=now)
        return rrb.Spatial3DView(
            origin=ROOT, name="vehicle", eye_controls=beside, overrides={f"{ROOT}/trail": [up_to_now]}
        )


def _by_unit(signals: Signals) -> dict[str, list[str]]:
    """The fields to plot, by unit."""
    units: dict[str, list[str]] = {}
    for name in signals.sizes:
        if name not in STATUS_FIELDS:
            units.setdefault(signals.units.get(name, ""), []).append(name)
    return units


def _bunches(names: Sequence[str], sizes: Mapping[str, int]) -> list[list[str]]:
    """Groups of fields that share a plot: as many as stay below the limit of lines, at least one."""
    bunches: list[list[str]] = []
    lines = 0
    for name in names:
        size = max(1, sizes[name])
        if not bunches or lines + size > _LINES_IN_PLOT:
            bunches.append([])
            lines = 0
        bunches[-1].append(name)
        lines += size
    return bunches
