# SPDX-License-Identifier: Apache-2.0
"""The layout of the rerun viewer for a machine, derived from its topics, so it fits every machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from .lines import TIMELINE
from .panels import Panel, panels_of
from .scene import STEP_AFTER, Cast, angle_entity
from .signals import Signals
from .styles import Style, rgba, styles
from .world import ROOT, VEHICLE, World

#: Visible time range of a live run, in s.
_LIVE_S = 30.0
#: How many plots of the first page stand above each other.
_PLOTS_IN_COLUMN = 8
#: A viewer draws one page at a time; these limits keep a page fast for machines of any size.
_PLOTS_IN_PANEL, _PANELS_ON_PAGE, _PAGES = 4, 12, 16
#: Radius and opacity (of 255) of measurements: rerun draws points over lines.
_DOT, _DOT_OPACITY = 1.0, 90
#: Solid lines are this much broader than in pictures, so that they are seen below thin ones of truth and command.
_BROADER = 2.0
#: The share of a plot's width that its legend has for itself, beside the data.
_LEGEND = 0.3


class Plan:
    """Makes the blueprint of one run. `span` is its first and last time in s; None: a live run that continues.

    `reach` is the largest height or distance of the vehicle, in m.
    """

    def __init__(self, cast: Cast, world: World, span: tuple[float, float] | None, reach: float = 0.0):
        self._cast, self._world, self._live, self._reach = cast, world, span is None, reach
        boundary = rr.TimeRangeBoundary.cursor_relative if span is None else rr.TimeRangeBoundary.absolute
        begin, end = (-_LIVE_S, 0.0) if span is None else span
        legend_width = (end - begin) * _LEGEND / (1.0 - _LEGEND)

        def sight(until: float) -> rrb.TimeAxis:
            return rrb.TimeAxis(view_range=rr.TimeRange(start=boundary(seconds=begin), end=boundary(seconds=until)))

        self._sight, self._sight_with_legend = sight(end), sight(end + legend_width)

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
        """The first page: states on top, the vehicle on the left, the chosen panels on the right."""
        plots = [self._curves(panel) for panel in self._cast.choice.panels]
        columns = [plots[i : i + _PLOTS_IN_COLUMN] for i in range(0, len(plots), _PLOTS_IN_COLUMN)]
        left: list[Any] = [self._vehicle()] if self._world else [self._health()]
        left.append(self._log())
        below = rrb.Horizontal(
            rrb.Vertical(*left, row_shares=[3, 1]),
            *(rrb.Vertical(*column) for column in columns),
            column_shares=[2, *[3] * len(columns)],
        )
        return rrb.Vertical(self._states(), below, row_shares=[1, 6], name="overview")

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
        lanes = [(self._states(), 1.0), (step, 2.0), (self._health(), 3.0)]
        if self._cast.violations:
            lanes.append((self._requirements(), 1.5))
        views, shares = zip(*lanes, (self._log(), 1.2), strict=True)
        return rrb.Vertical(*views, row_shares=shares, name="states and health")

    # ---- views -----------------------------------------------------------------------------------------------

    def _lines(
        self, name: str, entities: Sequence[str], overrides: Mapping[str, Any] | None = None
    ) -> rrb.TimeSeriesView:
        legend = rrb.PlotLegend(rrb.Corner2D.RightTop)
        return rrb.TimeSeriesView(
            origin="/",
            contents=list(entities),
            name=name,
            plot_legend=legend,
            axis_x=self._sight_with_legend,
            overrides=overrides or {},
        )

    def _curves(self, panel: Panel) -> rrb.TimeSeriesView:
        """A plot of a panel, with the colours and styles of its curves, back to front."""
        curve_styles: dict[str, list[tuple[int, str, Style, bool]]] = {}
        sizes: dict[str, int] = {}
        ordered = list(zip(panel.curves, styles([curve.role for curve in panel.curves]), strict=True))
        for curve, style in sorted(ordered, key=lambda pair: pair[1].order):
            value = curve.value
            if curve.angle is not None:
                entity, size = angle_entity(value, curve.angle), 1
            else:
                entity, size = f"{value.signals.topic}/{value.field}", max(1, value.signals.sizes[value.field])
            sizes[entity] = size
            curve_styles.setdefault(entity, []).append((curve.element or 0, curve.label, style, curve.steps))
        return self._lines(
            panel.name,
            list(curve_styles),
            {entity: _series(curve_styles[entity], sizes[entity]) for entity in curve_styles},
        )

    def _panels(self, signals: Signals) -> list[Any]:
        """A panel for an instance, or several: plots below each other, one or more for each unit."""
        plots = [self._curves(panel) for panel in panels_of(signals)]
        parts = [plots[i : i + _PLOTS_IN_PANEL] for i in range(0, len(plots), _PLOTS_IN_PANEL)]
        return [part[0] if len(part) == 1 else rrb.Vertical(*part, name=signals.name) for part in parts]

    def _states(self) -> rrb.StateTimelineView:
        return rrb.StateTimelineView(origin=f"{self._cast.prefix}/state", name="state", time_view=self._sight)

    def _health(self) -> rrb.StateTimelineView:
        lanes = [f"{signals.topic}/health" for signals in self._cast.instances]
        return rrb.StateTimelineView(origin=self._cast.prefix, contents=lanes, name="health", time_view=self._sight)

    def _requirements(self) -> rrb.StateTimelineView:
        lanes = list(self._cast.lanes_of_requirements.values())
        return rrb.StateTimelineView(
            origin=self._cast.prefix, contents=lanes, name="requirements", time_view=self._sight
        )

    def _log(self) -> rrb.TextLogView:
        prefix = self._cast.prefix
        contents = [f"{prefix}/{log}" for log in ("transitions", "health", "requirements", "events", "telemetry")]
        columns = rrb.TextLogColumns(timeline_columns=[TIMELINE], text_log_columns=["loglevel", "body"])
        return rrb.TextLogView(origin=prefix, contents=contents, name="events", columns=columns)

    def _vehicle(self) -> rrb.Spatial3DView:
        """The whole flight from the side (live: beside the vehicle) with the trail so far."""
        size, up = self._world.size, self._world.up
        if self._live and self._world.moves:
            beside = rrb.EyeControls3D(
                position=[-6 * size, -7 * size, up * 3 * size], look_target=[0, 0, 0], tracking_entity=VEHICLE
            )
        else:
            top = max(4 * size, self._reach) if self._world.moves else 1.5 * size
            middle = up * top / 2 if self._world.moves else 0.0
            beside = rrb.EyeControls3D(position=[-0.9 * top, -1.1 * top, up * 0.7 * top], look_target=[0, 0, middle])
        start, now = rr.TimeRangeBoundary.infinite(), rr.TimeRangeBoundary.cursor_relative(seconds=0.0)
        up_to_now = rrb.VisibleTimeRanges(timeline=TIMELINE, start=start, end=now)
        return rrb.Spatial3DView(
            origin=ROOT, name="vehicle", eye_controls=beside, overrides={f"{ROOT}/trail": [up_to_now]}
        )


def _series(curves: Sequence[tuple[int, str, Style, bool]], size: int) -> list[Any]:
    """Visualizers of one entity of `size` lines, for curves (element, label, style, steps): lines, dots, or both."""
    found: list[Any] = []
    for dots in (True, False):
        mine = {element: (label, style) for element, label, style, _ in curves if style.dots == dots}
        if not mine:
            continue
        hidden = ("", Style("#000000", "#000000", 1.0, dots, False, 0))
        labels, its_styles = zip(*(mine.get(i, hidden) for i in range(size)), strict=True)
        common: dict[str, Any] = {
            "names": labels,
            "colors": [[*rgba(style.rerun_colour)[:3], _DOT_OPACITY if dots else 255] for style in its_styles],
            "visible_series": [i in mine for i in range(size)],
        }
        if dots:
            found.append(rr.SeriesPoints(**common, markers=["circle"] * size, marker_sizes=[_DOT] * size))
            continue
        mode = STEP_AFTER if any(steps for *_, steps in curves) else None
        found.append(
            rr.SeriesLines(**common, widths=[_BROADER * s.width - 0.5 for s in its_styles], interpolation_mode=mode)
        )
    return found
